"""Markov chain of a map on cells: classes, invariant measures, absorption (Hsu 1981)."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from .._lib.arrays import Bools, Floats, Ints
from .._lib.checks import claim_memory, finite_number, whole_number
from .._lib.computed import computed_once
from .._lib.signatures import checked
from ..attractors.settling.labels import Label
from ..basins.record import Basins
from ..maps.grid import CellGrid
from ..maps.orbit_batch import Cost
from ..maps.point_map import PointMap
from ..orbits.attractor import Attractor
from .box_images import DIVERGED, LEFT
from .markov import Components, Sparse, invariant_measure, periods_of, solve_transient
from .recurrent_sets import adjacent_sets, basins_from_cells, refined_sets

_POSSIBLE = 1e-9
"""Probability above which a cell counts as one from which a class can be reached."""


@dataclass(frozen=True, eq=False)
class CellClass:
    """Communicating class of cells of a Markov chain.

    Parameters
    ----------
    cells : ndarray of int64, shape (n,)
        Flat numbers of the cells, sorted.
    period : int
        Period of the class: the greatest common divisor of the numbers of steps after which a cell can return to
        itself.
    closed : bool
        Whether no transition leaves the class: closed classes contain attractors, others saddles and transients.
    """

    cells: Ints
    period: int
    closed: bool

    def __repr__(self) -> str:
        return f"CellClass({'closed' if self.closed else 'transient'}, {len(self.cells):,} cells, period {self.period})"


@dataclass(frozen=True, eq=False)
class CellChain:
    """Markov chain of a map on cells.

    Parameters
    ----------
    matrix : scipy.sparse.csr_array, shape (cells + 2, cells + 2)
        Transition probabilities from the cell of the row to that of the column.  The last two states are sinks: ``-1``
        for outside the window, ``-2`` for orbits that diverge or do not return to the Poincaré section of a map.
    grid : CellGrid
        The cells.
    point_map : PointMap
        The map.
    samples : tuple of int or int
        Sample points in each cell: numbers along each axis of a regular lattice, or a number of random points.
    periods : int
        Steps of the map in one step of the chain.
    noisy : bool
        Whether noise acts.
    components : Components
        Strongly connected components of the chain.
    inaccurate : int
        Samples for which the integrator missed its tolerance.
    cost : Cost
        Wall time and number of steps of the map.
    """

    matrix: Sparse = field(repr=False)
    grid: CellGrid
    point_map: PointMap = field(repr=False)
    samples: tuple[int, ...] | int
    periods: int
    noisy: bool
    components: Components = field(repr=False)
    inaccurate: int = 0
    cost: Cost = Cost()

    def __repr__(self) -> str:
        return (
            f"CellChain({self.point_map.name}, {self.grid.size:,} cells, {self.matrix.nnz:,} transitions, "
            f"{len(self.closed)} closed classes)"
        )

    @computed_once
    def closed(self) -> tuple[CellClass, ...]:
        """Closed classes, in the order of their first cells: they contain the attractors."""
        return self._classes(self.components.closed)

    @computed_once
    def transient(self) -> tuple[CellClass, ...]:
        """Transient classes, in the order of their first cells: saddles."""
        return self._classes(~self.components.closed & self.components.recurs)

    @property
    def classes(self) -> tuple[CellClass, ...]:
        """Closed classes, then transient ones."""
        return self.closed + self.transient

    def _classes(self, chosen: Bools) -> tuple[CellClass, ...]:
        numbers = np.flatnonzero(chosen)
        # The sinks are classes of their own.
        numbers = numbers[self.components.order[self.components.begin[numbers]] < self.grid.size]
        periods = periods_of(self.matrix, self.components, numbers)
        found = [
            CellClass(self.components.states(int(c)), int(p), bool(self.components.closed[c]))
            for c, p in zip(numbers, periods, strict=True)
        ]
        return tuple(sorted(found, key=lambda one: one.cells[0]))

    @computed_once
    def measures(self) -> tuple[Floats, ...]:
        """Invariant measure of each closed class: probabilities of its cells."""
        return tuple(invariant_measure(self.matrix, one.cells) for one in self.closed)

    @checked
    def density(self, group: int = 0) -> Floats:
        """Return the invariant density of a closed class, shape of the grid; its integral over the window is 1."""
        if not self.closed:
            raise ValueError(f"{self!r}, and so no density: take a window that orbits do not leave, or less noise")
        group = whole_number("group", group, at_most=len(self.closed) - 1)
        density = np.zeros(self.grid.size)
        density[self.closed[group].cells] = self.measures[group] / np.prod(self.grid.widths)
        return density.reshape(self.grid.shape)

    @computed_once
    def absorption(self) -> Floats:
        """Absorption probability of each cell in each closed class, shape ``(*grid, classes + 2)``.

        The last two columns are -2, diverged, and -1, outside the window.
        """
        return self._probabilities(np.arange(len(self.closed)), len(self.closed))

    @computed_once
    def domiciles(self) -> Ints:
        """Number of closed classes that can be reached from each cell, the outside included, shape of the grid.

        Cells with 1 have a single domicile (Hsu); those with more lie along basin boundaries.
        """
        return np.count_nonzero(self.absorption > _POSSIBLE, axis=-1)

    @computed_once
    def expected_times(self) -> Floats:
        """Expected number of steps of the map until absorption in a closed class or outside, shape of the grid."""
        values = self._solved(np.zeros((self.grid.size + 2, 1)), np.ones(1))
        return np.asarray(values[: self.grid.size, 0] * self.periods).reshape(self.grid.shape)

    @checked
    def probabilities(
        self,
        refine: bool | None = None,
        max_periods: int = 2000,
        longest_period: int = 32,
        attractors: Sequence[Attractor] = (),
    ) -> tuple[tuple[Attractor, ...], Floats]:
        """Compute the attractors and the probability with which each cell converges to each of them.

        Parameters
        ----------
        refine : bool, optional
            Iterate the exact map from each closed class and label the class with the attractor that is found, so that
            classes of one attractor are merged.  Otherwise classes are attractors, and adjacent classes are merged;
            this is the default with noise.
        max_periods, longest_period, attractors : optional
            As in :func:`find_basins`, for these iterations.

        Returns
        -------
        tuple
            Attractors, and probabilities of the shape ``(*grid, attractors + 3)``: the last columns are -3, undecided,
            -2, diverged, and -1, outside the window.

        Raises
        ------
        ValueError
            For `refine` with noise.
        """
        if refine and self.noisy:
            raise ValueError(f"refine={refine!r}: orbits with noise settle on no point; leave refine out")
        cells = np.concatenate([np.empty(0, np.int64), *(one.cells for one in self.closed)])
        owners = np.repeat(np.arange(len(self.closed)), [len(one.cells) for one in self.closed])
        if refine is None:
            refine = not self.noisy
        if refine:
            limits = {"max_periods": max_periods, "longest_period": longest_period, "attractors": attractors}
            found, labels = refined_sets(self.point_map, self.grid, cells, owners, limits)
        else:
            weights = np.concatenate([np.empty(0), *self.measures])
            periods = np.array([one.period for one in self.closed], np.int64)
            likeliest = _likeliest(self.matrix, cells)
            found, labels = adjacent_sets(
                self.grid, self.point_map.coordinates, cells, owners, likeliest, weights, periods
            )
        return found, self._probabilities(labels % (len(found) + 3), len(found) + 1)

    @checked
    def basins(
        self,
        refine: bool | None = None,
        min_probability: float = 0.0,
        max_periods: int = 2000,
        longest_period: int = 32,
        attractors: Sequence[Attractor] = (),
    ) -> Basins:
        """Return basins in which each cell has the label of its most probable attractor.

        Parameters
        ----------
        refine, max_periods, longest_period, attractors : optional
            As in :meth:`probabilities`.
        min_probability : float, optional
            Smallest probability; cells whose largest probability is below it are undecided.

        Returns
        -------
        Basins
            Basins whose settling times are the expected numbers of steps to a closed class, rounded.
        """
        min_probability = finite_number("min_probability", min_probability, at_least=0.0, at_most=1.0)
        began = time.perf_counter()
        found, chances = self.probabilities(refine, max_periods, longest_period, attractors)
        columns = chances.shape[-1]
        chances = chances.reshape(-1, columns)
        labels = chances.argmax(axis=1)
        likely = np.take_along_axis(chances, labels[:, None], axis=1)[:, 0]
        labels = np.where(labels < len(found), labels, labels - columns)
        verifiable = not self.noisy and refine is not False
        settings = {"max_periods": max_periods, "longest_period": longest_period, "method": "generalized cell mapping"}
        return basins_from_cells(
            self.point_map if verifiable else None,
            self.grid,
            np.where(likely >= min_probability, labels, Label.UNDECIDED),
            found,
            np.round(self.expected_times.ravel()),
            self.point_map,
            {**settings, "samples": self.samples, "periods": self.periods, "min_probability": min_probability},
            self.inaccurate,
            Cost(self.cost.seconds + time.perf_counter() - began, self.cost.steps),
        )

    def _probabilities(self, columns: Ints, count: int) -> Floats:
        """Return the probabilities to end in closed classes, those of one column together, and in the sinks."""
        n = self.grid.size
        claim_memory(
            f"probabilities of {n:,} cells to end in {count:,} classes",
            8 * (n + 2) * (count + 2),
            "take fewer cells, or set refine=True, so that classes are merged",
        )
        values = np.zeros((n + 2, count + 2))
        for one, column in zip(self.closed, columns, strict=True):
            values[one.cells, column] = 1.0
        values[LEFT, LEFT] = values[DIVERGED, DIVERGED] = 1.0
        return self._solved(values, np.zeros(count + 2))[:n].reshape(*self.grid.shape, count + 2)

    def _solved(self, values: Floats, gain: Floats) -> Floats:
        solve_transient(self.matrix, self.components, values, gain)
        return values


def _likeliest(matrix: Sparse, cells: Ints) -> Ints:
    """Return the state to which each of some states goes most likely, the first of them if they are several."""
    rows = matrix[cells]
    highest = np.maximum.reduceat(rows.data, rows.indptr[:-1]) if len(cells) else rows.data
    places = np.flatnonzero(rows.data == np.repeat(highest, np.diff(rows.indptr)))
    owners = np.searchsorted(rows.indptr, places, side="right") - 1
    first = np.unique(owners, return_index=True)[1]
    return np.asarray(rows.indices[places[first]], dtype=np.int64)
