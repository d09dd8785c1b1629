"""Transfer operators by Ulam's method: transition probabilities between boxes, and eigenvectors."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import eigs, eigsh

from .._lib.arrays import Bools, Complexes, Floats
from .._lib.checks import claim_memory, whole_number
from .._lib.computed import computed_once
from .._lib.signatures import checked
from ..maps.coordinates import Coordinate
from ..maps.point_map import PointMap
from .box_images import box_transitions, points_in
from .box_set import BoxSet
from .markov import components_of, invariant_measure, recurrent_parts

_DENSE = 400  # boxes up to which all eigenvalues are found
_KRYLOV = 40  # least size of the space in which some are sought


@dataclass(frozen=True, eq=False)
class Cycle:
    """Cycle of sets of boxes, each of which is mapped onto the next.

    Parameters
    ----------
    order : int
        Number of the sets.
    eigenvalues : ndarray of complex, shape (order,)
        Eigenvalues of the operator nearest to the roots of unity, in their order; their distance from the unit circle
        measures the fraction that leaves the cycle in a step.
    sets : tuple of BoxSet
        The sets, in the order in which they are visited.
    """

    order: int
    eigenvalues: Complexes
    sets: tuple[BoxSet, ...]

    def __repr__(self) -> str:
        off = np.abs(self.eigenvalues - np.exp(2j * np.pi * np.arange(self.order) / self.order)).max()
        return f"Cycle({self.order} sets; eigenvalues within {off:.2g} of the roots of unity)"


@dataclass(frozen=True, eq=False)
class AlmostInvariant:
    """Almost invariant sets: sets of boxes that orbits seldom leave.

    Parameters
    ----------
    sets : tuple of BoxSet
        The sets, a partition of the boxes that carry the invariant measure.
    kept : tuple of float
        Fraction of the measure of each set that remains in it after one step.
    eigenvalues : ndarray, shape (number of sets,)
        Largest eigenvalues of the time-symmetrised operator; 1 means that nothing is exchanged.
    """

    sets: tuple[BoxSet, ...]
    kept: tuple[float, ...]
    eigenvalues: Floats

    def __repr__(self) -> str:
        return f"AlmostInvariant({len(self.sets)} sets that keep {', '.join(f'{k:.4g}' for k in self.kept)})"


@dataclass(frozen=True, eq=False)
class TransferOperator:
    """Transfer operator of a map on measures that are uniform in each box (Ulam 1960).

    Parameters
    ----------
    boxes : BoxSet
        The boxes.
    matrix : csr_array, shape (n, n)
        Fraction of each box (row) that is mapped into each box (column).
    lost : ndarray, shape (n,)
        Fraction of each box that is mapped out of the set.
    samples : int
        Number of sample points in each box.
    coordinates : tuple of Coordinate
        State variables.
    """

    boxes: BoxSet
    matrix: csr_array = field(repr=False)
    lost: Floats = field(repr=False)
    samples: int
    coordinates: tuple[Coordinate, ...]

    def __repr__(self) -> str:
        return f"TransferOperator({self.boxes}, {self.matrix.nnz:,} transitions, {self.samples} points in each)"

    @computed_once
    def invariant_measures(self) -> tuple[Floats, ...]:
        """Invariant measures as probabilities (n,) of the boxes, one for each closed component."""
        found = components_of(self.matrix, self.lost > 0.0)
        measures = []
        for number in np.flatnonzero(found.closed):
            members = found.states(int(number))
            measure = np.zeros(len(self.boxes))
            measure[members] = invariant_measure(self.matrix, members)
            measures.append(measure)
        return tuple(measures)

    @computed_once
    def invariant_measure(self) -> Floats:
        """Invariant measure as probabilities (n,) of the boxes, which sum to 1.

        Where mass escapes from every component, the measure is quasi-stationary: conditioned on survival.

        Raises
        ------
        ValueError
            If there are several, as with several attractors, or none, as no box returns to itself.
        """
        if len(self.invariant_measures) > 1:
            raise ValueError(
                f"{self!r} has {len(self.invariant_measures)} invariant measures: take one of invariant_measures, or "
                "boxes that hold one attractor"
            )
        if not self._recurs:
            raise ValueError(
                f"{self!r} has no invariant measure, as all mass leaks out of the boxes: take more of them"
            )
        return self.invariant_measures[0] if self.invariant_measures else self._leading[1]

    @property
    def density(self) -> Floats:
        """Invariant density: measure per volume, shape (n,)."""
        return self.invariant_measure / float(np.prod(self.boxes.grid.widths))

    @property
    def escape_rate(self) -> float:
        """Escape rate per step: minus the logarithm of the largest eigenvalue."""
        if self.invariant_measures:
            return 0.0
        return float(-np.log(self._leading[0])) if self._recurs else np.inf

    @computed_once
    def _recurs(self) -> bool:
        """Whether there are boxes that lead back to themselves."""
        return bool((recurrent_parts(self.matrix) >= 0).any())

    @computed_once
    def _leading(self) -> tuple[float, Floats]:
        return _leading(self.matrix)

    @checked
    def eigenvalues(self, n_eigenvalues: int | None = None) -> Complexes:
        """Compute the eigenvalues of largest modulus, by default six; of a conjugate pair the upper one first."""
        return self.eigenvectors(n_eigenvalues)[0]

    @checked
    def eigenvectors(self, n_eigenvalues: int | None = None) -> tuple[Complexes, Complexes]:
        """Compute the eigenvalues of largest modulus (m,) and their eigenmeasures (n, m)."""
        most = len(self.boxes)
        n_eigenvalues = (
            min(6, most)
            if n_eigenvalues is None
            else whole_number("n_eigenvalues", n_eigenvalues, at_least=1, at_most=most)
        )
        return _eigen(csr_array(self.matrix.T), n_eigenvalues)

    @checked
    def cycle(self, order: int) -> Cycle:
        """Compute the sets that are visited in a cycle of the given order.

        The eigenvectors at the roots of unity are combined: set k is where their sum, each rotated by k times its
        angle, is largest.

        Parameters
        ----------
        order : int
            Number of sets, at least 2.

        Raises
        ------
        ValueError
            If not all roots of unity of that order are close to eigenvalues.

        References
        ----------
        Dellnitz, Junge, SIAM Journal on Numerical Analysis 36 (1999) 491.
        """
        order = whole_number("order", order, at_least=2, at_most=max(2, len(self.boxes)))
        values, vectors = _eigen(self.matrix, min(2 * order + 2, len(self.boxes)))
        roots = np.exp(2j * np.pi * np.arange(order) / order)
        nearest = np.abs(values - roots[:, None]).argmin(axis=1)
        found = values[nearest]
        if len(set(nearest.tolist())) < order or np.abs(found - roots).max() > 0.5 / order:
            raise ValueError(
                f"order={order}: the eigenvalues nearest to the roots of unity are {np.round(found, 4).tolist()}; "
                "choose an order whose roots are all among eigenvalues()"
            )
        carried = self._carried
        reference = int(np.argmax(np.where(carried, self._weights, 0.0)))
        functions = vectors[:, nearest] / vectors[reference, nearest]
        members = np.stack([(functions * roots**-k).sum(axis=1).real for k in range(order)])
        where = members.argmax(axis=0)
        return Cycle(order, found, tuple(self.boxes.chosen(carried & (where == k)) for k in range(order)))

    @checked
    def almost_invariant_sets(self, n_sets: int = 2) -> AlmostInvariant:
        """Compute a partition into sets that retain as much of the invariant measure as possible.

        The operator is symmetrised in time; its leading eigenvectors are nearly constant on the sets.  The boxes that
        lie farthest apart in the space of these vectors represent the sets, and each box is assigned to the set with
        its largest membership.

        Parameters
        ----------
        n_sets : int, optional
            Number of sets, at least 2.

        References
        ----------
        Dellnitz, Junge (1999); Froyland, Physica D 200 (2005) 205; Deuflhard, Weber, Linear Algebra and its
        Applications 398 (2005) 161, on the choice of the sets.
        """
        n_sets = whole_number("n_sets", n_sets, at_least=2, at_most=int(self._carried.sum()))
        carried = np.flatnonzero(self._carried)
        weights = self._weights[carried]
        inner = csr_array(self.matrix[carried][:, carried])
        flow = diags_array(weights) @ inner
        root = np.sqrt(weights)
        symmetric = csr_array(diags_array(0.5 / root) @ (flow + flow.T) @ diags_array(1.0 / root))
        values, vectors = _largest_symmetric(symmetric, n_sets)
        functions = vectors / root[:, None]
        corners = _far_corners(functions)
        members = np.linalg.solve(functions[corners].T, functions.T).argmax(axis=0)
        masks = [members == k for k in range(n_sets)]
        kept = tuple(float(flow[m][:, m].sum() / weights[m].sum()) for m in masks)
        return AlmostInvariant(tuple(BoxSet(self.boxes.grid, self.boxes.keys[carried[m]]) for m in masks), kept, values)

    @computed_once
    def _weights(self) -> Floats:
        """Mean of all invariant measures."""
        measures = self.invariant_measures
        return np.mean(measures, axis=0) if measures else self._leading[1]

    @property
    def _carried(self) -> Bools:
        """Boxes that carry measure."""
        return self._weights > 0.0


@checked
def transfer_operator(boxes: BoxSet, point_map: PointMap, samples: int = 8, periods: int = 1) -> TransferOperator:
    """Compute the transfer operator of a map on a set of boxes.

    Parameters
    ----------
    boxes : BoxSet
        The boxes, for example from :func:`relative_attractor`.
    point_map : PointMap
        The map.
    samples : int, optional
        Sample points along each axis of a box: transition probabilities have an error of the order of 1/samples.
    periods : int, optional
        Number of iterates of the map that are taken as one step.

    Returns
    -------
    TransferOperator
        The operator, with invariant measures, eigenvalues, cycles and almost invariant sets.

    Raises
    ------
    TypeError, ValueError
        For arguments out of range, or an empty set.
    MemoryError
        If the matrix needs more memory than is free.

    References
    ----------
    Ulam, *A Collection of Mathematical Problems* (1960); Dellnitz, Junge, SIAM Journal on Numerical Analysis 36 (1999)
    491.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map
    >>> tent = discrete_map(lambda x, p: (1 - abs(2 * x[0] - 1),), {}, ("x",))
    >>> operator = transfer_operator(BoxSet.full(CellGrid((0,), (1,), (64,))), tent)
    >>> bool(np.allclose(operator.density, 1.0))
    True
    """
    if not len(boxes):
        raise ValueError(f"boxes={boxes!r}: give a BoxSet of at least one box")
    number = points_in(samples, boxes.grid.dimension)
    counts = box_transitions(boxes, point_map, samples, periods)
    matrix = csr_array(counts / float(number))
    lost = 1.0 - counts.sum(axis=1) / number
    return TransferOperator(boxes, matrix, lost, number, point_map.coordinates)


def _leading(matrix: csr_array) -> tuple[float, Floats]:
    """Return the largest eigenvalue of a matrix that is nowhere negative, and its left eigenvector, which sums to 1."""
    values, vectors = _eigen(csr_array(matrix.T), 1)
    measure = np.abs(vectors[:, 0])
    return float(values[0].real), measure / measure.sum()


def _eigen(matrix: csr_array, number: int) -> tuple[Complexes, Complexes]:
    """Return the eigenvalues of largest modulus, and right eigenvectors, always in the same order."""
    n = matrix.shape[0]
    if n <= max(_DENSE, number + 2):
        values, vectors = np.linalg.eig(matrix.toarray())
    else:
        size = min(n, max(_KRYLOV, 4 * number))
        claim_memory(f"eigenvectors of {n:,} boxes", 8 * n * (size + 2 * number), "ask for fewer, or take fewer boxes")
        # Not the vector of ones, which may be an eigenvector itself and leave nothing to be found.
        begin = np.random.default_rng(0).uniform(0.5, 1.5, n)
        values, vectors = eigs(matrix, k=number, which="LM", v0=begin, ncv=size, maxiter=100 * n)
    order = np.lexsort((-values.imag, -values.real.round(9), -np.abs(values).round(9)))[:number]
    return values[order].astype(complex), vectors[:, order].astype(complex)


def _largest_symmetric(matrix: csr_array, number: int) -> tuple[Floats, Floats]:
    """Return the largest eigenvalues of a symmetric matrix, the largest first, and their eigenvectors."""
    n = matrix.shape[0]
    if n <= max(_DENSE, number + 1):
        values, vectors = np.linalg.eigh(matrix.toarray())
    else:
        begin = np.random.default_rng(0).uniform(0.5, 1.5, n)
        values, vectors = eigsh(matrix, k=number, which="LA", v0=begin, ncv=min(n, max(_KRYLOV, 4 * number)))
    return values[: -number - 1 : -1], vectors[:, : -number - 1 : -1]


def _far_corners(functions: Floats) -> list[int]:
    """Return rows that lie far apart: each has the largest distance from the space of those before it."""
    chosen = [int(np.argmax((functions**2).sum(axis=1)))]
    rest = functions - functions[chosen[0]]
    for _ in range(functions.shape[1] - 1):
        chosen.append(int(np.argmax((rest**2).sum(axis=1))))
        direction = rest[chosen[-1]] / np.linalg.norm(rest[chosen[-1]])
        rest = rest - np.outer(rest @ direction, direction)
    return chosen
