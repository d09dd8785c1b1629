"""Covariant Lyapunov vectors and the angles between them (Ginelli et al. 2007)."""

from __future__ import annotations

from dataclasses import dataclass
from math import log

import numpy as np
from numpy.typing import ArrayLike

from .._lib.arrays import Floats
from .._lib.checks import claim_memory, whole_number
from .._lib.signatures import checked
from ..maps.coordinates import Coordinate, state_points, wrap
from ..maps.point_map import PointMap
from ..maps.tangent import tangent
from .lyapunov import GROUPS

_FACTOR = 100.0  # factor by which growth may differ for a while where eigenvectors are far from orthogonal
_VANISHING = 1e-14  # growth in one step, of the largest, below which a direction is lost to rounding


@dataclass(frozen=True, eq=False)
class CovariantVectors:
    """Covariant Lyapunov vectors along an orbit: directions that the derivative of the map takes to each other.

    Parameters
    ----------
    points : ndarray, shape (n, d)
        The orbit, angles wrapped.
    vectors : ndarray, shape (n, d, d)
        Unit columns at each point, in the order of the exponents.  The derivative takes column j to a multiple of
        column j at the next point.  If exponents cannot be distinguished from equal ones, their columns are an
        orthonormal basis of one subspace, which the derivative takes to the corresponding subspace at the next point.
    growth : ndarray, shape (n, d)
        Logarithm of the absolute value of that multiple; in a subspace of several dimensions, the logarithm of the
        growth of its volume divided by its dimension.
    exponents, standard_errors : ndarray, shape (d,)
        Mean growth per step, the largest first, and its standard error from the spread between 20 parts of the orbit;
        in a subspace of several dimensions the error includes the spread between the exponents of a frame in it.
    dimensions : tuple of int
        Dimensions of the subspaces, in the order of the exponents; all 1 if the exponents differ.
    transient : int
        Steps before and after these points in which the directions converged.
    name : str
        Name of the system.
    coordinates : tuple of Coordinate
        State variables.
    """

    points: Floats
    vectors: Floats
    growth: Floats
    exponents: Floats
    standard_errors: Floats
    dimensions: tuple[int, ...]
    transient: int
    name: str
    coordinates: tuple[Coordinate, ...]

    def __repr__(self) -> str:
        values = [
            f"{self.exponents[k]:.4g} +- {self.standard_errors[k]:.1g}"
            + (f" (one subspace of dimension {n})" if n > 1 else "")
            for k, n in zip(self._begins, self.dimensions, strict=True)
        ]
        return f"CovariantVectors({self.name}, {len(self.points)} points: {', '.join(values)} per step)"

    @property
    def _begins(self) -> list[int]:
        """Number of the first direction of each subspace."""
        return (np.cumsum(self.dimensions) - self.dimensions).tolist()

    @property
    def expanding(self) -> int:
        """Number of positive exponents."""
        return int(np.count_nonzero(self.exponents > 0.0))

    @checked
    def angles(self, first: int | None = None) -> Floats:
        """Return the smallest angle between the span of the first directions and that of the others, at each point.

        Parameters
        ----------
        first : int, optional
            Number of first directions; by default the number of expanding ones.

        Returns
        -------
        ndarray, shape (n,)
            Angles between 0 and pi/2.  On a hyperbolic set the angle between expanding and contracting subspaces is
            bounded away from 0; with tangencies of stable and unstable manifolds it comes the nearer to 0 the longer
            the orbit is.

        Raises
        ------
        ValueError
            If no direction is left on one of the sides, or `first` divides a subspace.
        """
        d = self.points.shape[1]
        k = self.expanding if first is None else whole_number("first", first)
        if not 0 < k < d:
            raise ValueError(f"first={k}: of {d} directions at least one has to be on each side")
        if k not in self._begins:
            raise ValueError(
                f"first={k} divides a subspace whose directions grow alike: give one of {self._begins[1:]}, or take "
                "more periods to distinguish them"
            )
        one, other = (np.linalg.qr(part)[0] for part in (self.vectors[..., :k], self.vectors[..., k:]))
        # Sines, as cosines do not tell small angles apart; of two spaces the smaller one's.
        small, large = (one, other) if k <= d - k else (other, one)
        rest = small - large @ (large.swapaxes(-1, -2) @ small)
        return np.asarray(np.arcsin(np.linalg.svd(rest, compute_uv=False)[..., -1].clip(0.0, 1.0)))


@checked
def covariant_vectors(
    point_map: PointMap, initial_condition: ArrayLike, periods: int = 1000, transient: int = 200
) -> CovariantVectors:
    r"""Return the covariant Lyapunov vectors along an orbit.

    They satisfy :math:`D P(x_n) v_j(x_n) \propto v_j(x_{n+1})`, with the mean growth :math:`\lambda_j`.

    An orthonormal frame iterated forward spans the directions of largest growth; vector j is the direction within the
    span of the first j columns that grows least under backward iteration (Ginelli et al. 2007).  Single directions of
    equal exponents, as of a complex pair of multipliers or of a defective multiplier, are not defined: neighbours whose
    growth over n steps differs by less than a factor of 100 n^2, or by less than three standard errors, are combined
    into one subspace.

    Parameters
    ----------
    point_map : PointMap
        Stroboscopic or discrete map with an invertible derivative; for an interpolated map, the exact map behind it is
        used.
    initial_condition : array_like, shape (d,)
        Initial condition of the orbit.
    periods : int, optional
        Number of points at which vectors are computed, at least 20.
    transient : int, optional
        Steps before and after these points in which the directions converge.  Their error is about ``exp(-transient *
        gap)``, where the gap is the difference of neighbouring exponents.

    Returns
    -------
    CovariantVectors
        Directions, their growth and exponents.

    Raises
    ------
    TypeError, ValueError
        For arguments out of range, an orbit that terminates, or a singular derivative.

    References
    ----------
    Ginelli, Poggi, Turchi, Chaté, Livi, Politi, Physical Review Letters 99 (2007) 130601.

    Examples
    --------
    >>> from cellmap import discrete_map
    >>> bent = discrete_map(lambda x, p: (2 * x[0] + x[1], x[1] / 2), {}, ("x", "y"))
    >>> found = covariant_vectors(bent, [0.0, 0.0], periods=20)
    >>> np.abs(found.vectors[0].T * np.sqrt([[1], [13]])).round(9)
    array([[1., 0.],
           [2., 3.]])
    """
    exact = point_map.without_table
    begin = state_points("initial_condition", initial_condition, exact.coordinates)
    if begin.ndim != 1:
        raise ValueError(
            f"initial_condition has the shape {begin.shape}: give one point of {exact.dimension} coordinates"
        )
    periods = whole_number("periods", periods, at_least=GROUPS)
    transient = whole_number("transient", transient)
    d = exact.dimension
    total = periods + transient
    claim_memory(f"frames along {total:,} steps", 24 * total * d * d, "take fewer periods")
    points, frames, factors = _forward(exact, wrap(begin, exact.coordinates), transient, total)
    logs = np.log(np.abs(np.diagonal(factors, axis1=1, axis2=2)))
    groups = _alike(logs)
    bases = [np.eye(d)[:, group] for group in groups]
    vectors, growth = np.empty((periods, d, d)), np.empty((periods, d))
    for k in reversed(range(total)):
        for number, group in enumerate(groups):
            basis, upper = np.linalg.qr(np.linalg.solve(factors[k], bases[number]))
            sizes = np.diagonal(upper)
            bases[number] = basis * np.sign(sizes)
            if k < periods:
                vectors[k][:, group] = frames[k] @ bases[number]
                growth[k, group] = -np.log(np.abs(sizes)).mean()
    spread = np.concatenate([np.full(g.stop - g.start, 0.5 * np.ptp(logs[:, g].mean(axis=0))) for g in groups])
    groups.sort(key=lambda g: -float(growth[:, g.start].mean()))
    order = np.concatenate([np.arange(g.start, g.stop) for g in groups])
    return CovariantVectors(
        points=points[:periods],
        vectors=vectors[..., order],
        growth=growth[:, order],
        exponents=growth.mean(axis=0)[order],
        standard_errors=np.hypot(_errors(growth), spread)[order],
        dimensions=tuple(g.stop - g.start for g in groups),
        transient=transient,
        name=exact.name,
        coordinates=exact.coordinates,
    )


def _errors(growth: Floats) -> Floats:
    """Return standard errors of mean growth (n, d), from the spread between parts of the orbit."""
    parts = np.array([part.mean(axis=0) for part in np.array_split(growth, GROUPS)])
    return np.asarray(parts.std(axis=0, ddof=1) / np.sqrt(GROUPS))


def _alike(logs: Floats) -> list[slice]:
    """Return the neighbouring directions of a frame whose growth (n, d) cannot be distinguished.

    Of two vectors that a matrix without a second eigenvector carries, one grows n^2 times as much as the other that is
    kept orthogonal to it; those of a complex pair take turns.
    """
    n, d = logs.shape
    apart = logs[:, :-1] - logs[:, 1:]
    told = (apart.sum(axis=0) > log(_FACTOR * n**2)) & (apart.mean(axis=0) > 3.0 * _errors(apart))
    ends = [*(np.flatnonzero(told) + 1).tolist(), d]
    return [slice(begin, end) for begin, end in zip([0, *ends[:-1]], ends, strict=True)]


def _forward(exact: PointMap, place: Floats, turning: int, total: int) -> tuple[Floats, Floats, Floats]:
    """Return points (n, d), frames there and triangular factors (n, d, d) of so many steps, after some others."""
    d = len(place)
    points, frames, factors = np.empty((total, d)), np.empty((total, d, d)), np.empty((total, d, d))
    # Not the axes, of which a map may keep some.
    frame = np.linalg.qr(np.random.default_rng(0).standard_normal((d, d)))[0]
    for k in range(-turning, total):
        image, matrix = tangent(exact, place, coarse=True)
        if not (np.isfinite(image).all() and np.isfinite(matrix).all()):
            raise ValueError(f"initial_condition: the orbit terminates at {place.tolist()} after {turning + k} periods")
        turned, upper = np.linalg.qr(matrix @ frame)
        sizes = np.abs(np.diagonal(upper))
        if not sizes.min() > _VANISHING * sizes.max():
            raise ValueError(
                f"initial_condition: the orbit comes to {place.tolist()}, where the derivative is singular in double "
                "precision: a direction is mapped to zero there"
            )
        if k >= 0:
            points[k], frames[k], factors[k] = place, frame, upper
        place, frame = wrap(image, exact.coordinates), turned
    return points, frames, factors
