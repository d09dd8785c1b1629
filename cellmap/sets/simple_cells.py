"""Simple cell mapping: each cell is mapped to the cell of the image of its centre (Hsu 1980)."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._compiled.kernels.chains import unravel
from .._lib.arrays import Floats, Ints
from .._lib.checks import claim_memory, whole_number
from .._lib.signatures import checked
from .._lib.threads import run_over, slices
from ..basins.record import Basins
from ..maps.grid import CellGrid
from ..maps.orbit_batch import CHUNK, Cost, Orbits, Status
from ..maps.point_map import PointMap
from ..orbits.attractor import Attractor
from .box_images import DIVERGED, LEFT, cells_of, centres_of, images_of, warn_of_inaccurate
from .recurrent_sets import adjacent_sets, basins_from_cells, ends_of_sets, exchanging_sets, refined_sets

_UNKNOWN = -3


@dataclass(frozen=True, eq=False)
class CellMapping:
    """Simple cell mapping of a window: image cells, periodic groups and steps to them.

    Parameters
    ----------
    images : ndarray of int64, shape of the grid
        Flat number of the image of each cell; -1 for outside the window, -2 where the orbit of the centre diverges or
        does not return to the Poincaré section of a map.
    groups : ndarray of int, shape of the grid
        Number of the periodic group that each cell reaches; -1 or -2 for cells that escape.
    steps : ndarray of int, shape of the grid
        Number of steps of the mapping to the first cell of that group, or to the outside; 0 for periodic cells.
    group_periods : ndarray of int, shape (groups,)
        Number of cells of each group: its period in steps of the mapping.
    grid : CellGrid
        The cells.
    periods : int
        Steps of the map in one step of the mapping.
    point_map : PointMap
        The map.
    stray_cells, stray_images : ndarray of int64, shape (n,), and ndarray, shape (n, dimension)
        Cells with an image outside the window, and these images, which may lie in a wider one.
    inaccurate : int
        Cells for which the integrator missed its tolerance.
    cost : Cost
        Wall time and number of steps of the map.
    """

    images: Ints
    groups: NDArray[np.integer[Any]]
    steps: NDArray[np.integer[Any]]
    group_periods: NDArray[np.integer[Any]]
    grid: CellGrid
    periods: int
    point_map: PointMap = field(repr=False)
    stray_cells: Ints
    stray_images: Floats
    inaccurate: int = 0
    cost: Cost = Cost()

    def __repr__(self) -> str:
        lost = 100.0 * float((self.groups < 0).mean())
        return (
            f"CellMapping({self.point_map.name}, {self.grid.size:,} cells, {len(self.group_periods)} periodic groups, "
            f"{lost:.4g} % escape)"
        )

    @property
    def cell_periods(self) -> NDArray[np.integer[Any]]:
        """Period of the group that each cell reaches, shape of the grid; 1 for the outside, which is a sink."""
        sinks = np.ones(2, self.group_periods.dtype)
        return np.asarray(np.append(self.group_periods, sinks)[self.groups])

    @property
    def periodic_cells(self) -> Ints:
        """Flat numbers of all periodic cells."""
        return np.flatnonzero((self.steps.ravel() == 0) & (self.groups.ravel() >= 0))

    @checked
    def basins(
        self,
        refine: bool = True,
        max_periods: int = 2000,
        longest_period: int = 32,
        attractors: Sequence[Attractor] = (),
    ) -> Basins:
        """Return the basins of attraction of this mapping.

        Parameters
        ----------
        refine : bool, optional
            Iterate the exact map from each group and label the group with the attractor that is found, so that groups
            of one attractor are merged, and spurious groups are recognised.  Otherwise groups are attractors; adjacent
            groups are merged, and so are those that are connected in both directions by perturbations of one cell.
            Groups whose orbits converge to another one without rounding to centres are spurious.  A quasi-periodic
            attractor is listed as periodic.
        max_periods, longest_period, attractors : optional
            As in :func:`find_basins`, for these iterations.

        Returns
        -------
        Basins
            Settling times are the numbers of steps to a group, in steps of the map.  Without `refine`, attractors have
            no multipliers and no neighbourhoods, and basins no map with which they could be verified.
        """
        began = time.perf_counter()
        limits = {"max_periods": max_periods, "longest_period": longest_period}
        cells = self.periodic_cells
        owners = self.groups.ravel()[cells].astype(np.int64)
        if refine:
            given = {**limits, "attractors": attractors}
            found, labels = refined_sets(self.point_map, self.grid, cells, owners, given)
        else:
            images = self.images.ravel()
            hits = np.bincount(images[images >= 0], minlength=self.grid.size)[cells].astype(float)
            alike = exchanging_sets(self.grid, cells, owners, self.groups.ravel().astype(np.int64))
            axes = self.point_map.coordinates
            found, labels = adjacent_sets(self.grid, axes, cells, owners, images[cells], hits, alike=alike)
            sets = np.append(labels, (DIVERGED, LEFT))[self.groups.ravel()]
            labels = ends_of_sets(self.point_map, self.grid, cells, sets[cells], sets, self.periods)[labels]
        return basins_from_cells(
            self.point_map if refine else None,
            self.grid,
            np.append(labels, (DIVERGED, LEFT))[self.groups.ravel()],
            found,
            self.steps.ravel() * self.periods,
            self.point_map,
            {**limits, "method": "simple cell mapping", "periods": self.periods, "refine": refine},
            self.inaccurate,
            Cost(self.cost.seconds + time.perf_counter() - began, self.cost.steps),
        )

    @checked
    def extend(self, grid: CellGrid, progress: bool = False) -> CellMapping:
        """Return the mapping of a wider window; only the new cells are mapped.

        Parameters
        ----------
        grid : CellGrid
            A window that contains this one, with cells of the same widths and edges.
        progress : bool, optional
            Show a progress bar on a terminal if the work takes more than two seconds.

        Raises
        ------
        ValueError
            For a window that does not contain this one, or cells that do not continue its cells.
        """
        return _assembled(self.point_map, grid.on(self.point_map.coordinates), self.periods, [self], progress)

    @checked
    def join(self, other: CellMapping) -> CellMapping:
        """Return the mapping of the union of two adjacent or overlapping windows, without mapping any cell again.

        Cells and groups with images in the other window are connected to them (Gyebroszki, Csernák 2017).

        Parameters
        ----------
        other : CellMapping
            A mapping of the same map, with cells of the same widths, whose window forms a box together with this one.

        Raises
        ------
        ValueError
            For mappings that do not fit together, or windows with a gap or corners between them.
        """
        _check_same_map(self, other)
        a, b = self.grid, other.grid
        lower, upper = np.minimum(a.lower, b.lower), np.maximum(a.upper, b.upper)
        shape = np.round((upper - lower) / a.widths).astype(np.int64)
        grid = CellGrid(tuple(lower), tuple(upper), tuple(shape)).on(self.point_map.coordinates)
        covered = a.size + b.size - _overlap(a, b)
        if covered < grid.size:
            raise ValueError(
                f"other covers {b.lower} to {b.upper}, which makes no box with {a.lower} to {a.upper}: "
                f"{grid.size - covered:,} cells are missing; use extend, which maps them"
            )
        return _assembled(self.point_map, grid, self.periods, [self, other], False)


@checked
def simple_cell_mapping(point_map: PointMap, grid: CellGrid, periods: int = 1, progress: bool = False) -> CellMapping:
    """Compute a simple cell mapping: the image of a cell is the cell that contains the image of its centre.

    Every cell reaches a periodic group of cells, or the outside of the window.  All groups, the numbers of steps to
    them, and the basins of attraction follow from one pass over the cells.  The error from rounding images to centres
    is small if a step moves points by many cells; for this reason, take several periods in one step.

    Parameters
    ----------
    point_map : PointMap
        Exact, interpolated or discrete map.
    grid : CellGrid
        Cells of a window.  An axis that covers one period of an angle is periodic.
    periods : int, optional
        Steps of the map in one step of the mapping.
    progress : bool, optional
        Show a progress bar on a terminal if the work takes more than two seconds.

    Returns
    -------
    CellMapping
        Images, groups, periods and steps; its method `basins` returns labels.

    Raises
    ------
    TypeError, ValueError
        For arguments out of range.
    MemoryError
        If the cells do not fit into memory.

    Warns
    -----
    ToleranceWarning
        If the integrator missed its tolerance for some centres.

    References
    ----------
    Hsu, Journal of Applied Mechanics 47 (1980) 931; Hsu, Guttalu, the same 47 (1980) 940; Gyebroszki, Csernák,
    Communications in Nonlinear Science and Numerical Simulation 42 (2017) 518.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map
    >>> thirds = discrete_map(lambda x, p: (x[0] / 3,), {}, ("x",))
    >>> mapping = simple_cell_mapping(thirds, CellGrid((-1,), (1,), (5,)))
    >>> mapping.images, mapping.steps
    (array([1, 2, 2, 2, 3]), array([2, 1, 0, 1, 2], dtype=int32))
    >>> mapping.basins().fractions[0].fraction
    1.0
    """
    grid = grid.on(point_map.coordinates)
    periods = whole_number("periods", periods, at_least=1)
    return _assembled(point_map, grid, periods, [], progress)


def _assembled(
    point_map: PointMap, grid: CellGrid, periods: int, parts: Sequence[CellMapping], progress: bool
) -> CellMapping:
    """Return the mapping of a window from those of its parts; cells that are in none of them are mapped."""
    began = time.perf_counter()
    places = [_places_in(part.grid, grid) for part in parts]
    claim_memory(f"a cell mapping of {grid.size:,} cells", (36 + 8 * grid.dimension) * grid.size, "take fewer cells")
    images = np.full(grid.size, _UNKNOWN, np.int64)
    for part, place in zip(parts, places, strict=True):
        old = part.images.ravel()
        images[place] = np.where(old >= 0, place[old], old)
    missing: range | Ints = np.flatnonzero(images == _UNKNOWN) if parts else range(grid.size)

    def work(piece: slice) -> tuple[Ints, Floats, int]:
        mine = np.asarray(missing[piece])
        orbits = images_of(point_map, centres_of(grid, mine), periods)
        images[mine] = found = cells_of(point_map, grid, orbits)
        astray = np.flatnonzero((found == LEFT) & np.isfinite(orbits.points).all(axis=-1))
        return mine[astray], orbits.points[astray], int(np.count_nonzero(orbits.status == Status.INACCURATE))

    label = f"mapping cells of {point_map.name}" if progress else None
    mapped = run_over(slices(len(missing), CHUNK), work, label)
    missed = sum(count for *_, count in mapped)
    warn_of_inaccurate(missed, len(missing), bool((images[missing] == DIVERGED).any()))
    known = [(place[part.stray_cells], part.stray_images) for part, place in zip(parts, places, strict=True)]
    known += [(np.empty(0, np.int64), np.empty((0, grid.dimension))), *((rows, ends) for rows, ends, _ in mapped)]
    cells, points = (np.concatenate(column) for column in zip(*known, strict=True))
    cells, first = np.unique(cells, return_index=True)
    points = points[first]
    images[cells] = cells_of(point_map, grid, Orbits.starting(points.copy()))
    outside = images[cells] == LEFT
    kind = np.dtype(np.int32 if grid.size < 2**31 else np.int64)
    groups, steps, group_periods = (np.empty(grid.size, kind) for _ in range(3))
    count = unravel(images, groups, steps, group_periods)
    return CellMapping(
        images=images.reshape(grid.shape),
        groups=groups.reshape(grid.shape),
        steps=steps.reshape(grid.shape),
        group_periods=group_periods[:count].copy(),
        grid=grid,
        periods=periods,
        point_map=point_map,
        stray_cells=cells[outside],
        stray_images=points[outside],
        inaccurate=sum(part.inaccurate for part in parts) + missed,
        cost=Cost(
            sum(part.cost.seconds for part in parts) + time.perf_counter() - began,
            sum(part.cost.steps for part in parts) + len(missing) * periods,
        ),
    )


def _check_same_map(a: CellMapping, b: CellMapping) -> None:
    """Refuse mappings of different maps, or of different numbers of periods."""
    if a.point_map is not b.point_map and (
        a.point_map.coordinates != b.point_map.coordinates
        or dict(a.point_map.params) != dict(b.point_map.params)
        or dict(a.point_map.recipe) != dict(b.point_map.recipe)
    ):
        raise ValueError(f"other is a mapping of {b.point_map!r}, and this one of {a.point_map!r}: map both by one map")
    if a.periods != b.periods:
        raise ValueError(f"other takes {b.periods} periods in a step, and this mapping {a.periods}: take as many")


def _cells_before(inner: CellGrid, outer: CellGrid) -> Ints:
    """Return how many cells of one grid are before another one along each axis."""
    if not np.allclose(inner.widths, outer.widths, rtol=1e-9, atol=0.0):
        raise ValueError(
            f"grid={outer!r}: cells of widths {outer.widths} do not continue cells of widths {inner.widths}: give a "
            "window of whole cells more"
        )
    before = (np.array(inner.lower) - np.array(outer.lower)) / outer.widths
    if (np.abs(before - np.round(before)) > 1e-6).any():
        raise ValueError(
            f"the corner {outer.lower} is {before} cells from {inner.lower}: give a corner that is whole cells away"
        )
    return np.round(before).astype(np.int64)


def _places_in(inner: CellGrid, outer: CellGrid) -> Ints:
    """Return the flat numbers that the cells of a grid have in a wider one."""
    before = _cells_before(inner, outer)
    if (before < 0).any() or (before + inner.shape > outer.shape).any():
        raise ValueError(
            f"the window {outer.lower} to {outer.upper} does not contain {inner.lower} to {inner.upper}: widen it"
        )
    axes = [np.arange(n) + k for n, k in zip(inner.shape, before, strict=True)]
    return np.asarray(np.ravel_multi_index(np.ix_(*axes), outer.shape).ravel(), dtype=np.int64)


def _overlap(a: CellGrid, b: CellGrid) -> int:
    """Count the cells that two grids have in common."""
    before = _cells_before(b, a)
    low = np.maximum(before, 0)
    high = np.minimum(before + b.shape, a.shape)
    return int(np.prod(np.maximum(high - low, 0), dtype=object))
