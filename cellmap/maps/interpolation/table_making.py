"""Tables of interpolated maps: coefficients from images of the nodes, errors in cells, tables of several periods."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..._lib.arrays import Bools, Floats
from ..cell_table import CellTable
from ..coordinates import turns_of
from ..grid import CellGrid, grid_points
from ..orbit_batch import Orbits
from ..point_map import PointMap
from .look_ups import LookUps
from .spline_coefficients import PADDING, filtered, nodes_of, with_spare_doubles
from .spline_errors import leading_errors
from .tabulation import TableTiles

_FARTHEST = 100.0  # an image so many windows away counts as none


def spline_coefficients_of(
    exact: PointMap, grid: CellGrid, order: int, progress: bool, tiles: TableTiles | None = None
) -> tuple[Floats, Bools]:
    """Return the B-spline coefficients of displacements at the nodes, and the cells next to nodes without image."""
    values = _displacements(exact, nodes_of(grid, order), progress, tiles)
    extent = np.array(grid.upper) - np.array(grid.lower)
    with np.errstate(invalid="ignore"):
        failed = ~(np.abs(values) <= _FARTHEST * extent).all(axis=-1)
    if failed.any():
        _fill_from_neighbours(values, failed)
    for j in range(grid.dimension):
        values = filtered(values, j, order, grid.wraps[j])
    return with_spare_doubles(values), _cells_with_failed_corner(failed, grid, order)


def _displacements(exact: PointMap, axes: list[Floats], progress: bool, tiles: TableTiles | None = None) -> Floats:
    """Return image minus node, angles unwrapped, for all nodes; shape (nodes_1, ..., nodes_d, d)."""
    shape = tuple(map(len, axes))
    moved = np.empty((int(np.prod(shape)), len(axes)))

    bar = f"interpolation grid of {exact.name}" if progress else None

    def displacements(part: slice, images: Floats) -> list[Floats]:
        return [images - grid_points(axes, part)]

    (tiles or TableTiles()).fill(exact, axes, {"displacement": moved}, displacements, bar)
    return moved.reshape(*shape, len(axes))


def _fill_from_neighbours(displacement: Floats, failed: Bools) -> None:
    """Give nodes without image the value of the nearest node with one, lest they spoil the filter far around."""
    if failed.all():
        displacement[:] = 0.0
        return
    from scipy.ndimage import distance_transform_edt

    nearest = distance_transform_edt(failed, return_distances=False, return_indices=True)
    displacement[:] = displacement[tuple(nearest)]


def _cells_with_failed_corner(failed: Bools, grid: CellGrid, order: int) -> Bools:
    corner = failed
    for j, (n, wraps) in enumerate(zip(grid.shape, grid.wraps, strict=True)):
        first = 0 if wraps else PADDING[order]
        lower = np.take(corner, np.arange(first, first + n), axis=j)
        upper = np.take(corner, np.arange(first + 1, first + n + 1) % corner.shape[j], axis=j)
        corner = lower | upper
    return corner


def errors_in_cells(
    exact: PointMap, table: CellTable, allowed: Floats, progress: bool, tiles: TableTiles | None = None
) -> tuple[NDArray[np.float32], Bools]:
    """Bound the error in every cell: the errors along the axes, and what they leave unexplained at the centre."""
    grid = table.grid
    indicator = np.empty(grid.size, np.float32)
    fallback = np.empty(grid.size, bool)
    turn = turns_of(exact.coordinates)[1]
    interpolated = LookUps(exact, [table], "escape")
    axes = [grid.axis(j) for j in range(grid.dimension)]
    leading = leading_errors(table.coefficients, table.order, grid.wraps)
    sums, absolute = (errors.reshape(grid.size, -1) for errors in leading)

    @np.errstate(invalid="ignore", over="ignore")
    def errors(part: slice, images: Floats) -> tuple[Floats, Bools]:
        orbits = Orbits.starting(grid_points(axes, part))
        interpolated(orbits, 1)
        error = np.abs(images - (orbits.points + orbits.rotations * turn) - sums[part])
        error += 0.5 * (absolute[part] + np.abs(sums[part]))
        worst = (error / grid.widths).max(axis=-1)
        fallback = np.asarray(~(error <= allowed).all(axis=-1))
        return np.where(np.isfinite(worst), worst, np.inf), fallback

    bar, results = f"interpolation errors of {exact.name}", {"indicator": indicator, "rough": fallback}
    (tiles or TableTiles()).fill(exact, axes, results, errors, bar if progress else None)
    return indicator.reshape(grid.shape), fallback.reshape(grid.shape)


@np.errstate(invalid="ignore")
def leading_errors_in_cells(table: CellTable, allowed: Floats) -> tuple[NDArray[np.float32], Bools]:
    """Return the errors along the axes in every cell, which are a part of those of :func:`errors_in_cells`."""
    sums, absolute = leading_errors(table.coefficients, table.order, table.grid.wraps)
    error = 0.5 * (absolute + np.abs(sums))
    worst = (error / table.grid.widths).max(axis=-1)
    indicator = np.where(np.isfinite(worst), worst, np.inf).astype(np.float32)
    return indicator, np.asarray(~(error <= allowed).all(axis=-1))


def doubled_table(
    exact: PointMap, tables: Sequence[CellTable], outside: str, allowed: Floats, progress: bool
) -> CellTable:
    """Interpolate twice as many periods as the last table does, by iteration of the table of one period."""
    grid, order = tables[0].grid, tables[0].order
    periods = 2 ** len(tables)
    # Orbits of nodes past the ends of the window, and those that come back to it, are smooth as well.
    carried = _several(exact, LookUps(exact, tables[:1], "integrate"), periods)
    coefficients, spoilt = spline_coefficients_of(carried, grid, order, progress)
    smooth = CellTable.unexamined(grid, order, coefficients)
    single = _several(exact, LookUps(exact, tables[:1], outside), periods)
    indicator, fallback = errors_in_cells(single, smooth, allowed, progress)
    if outside == "escape":
        ended = np.isnan(
            _displacements(single, nodes_of(grid, order), progress)[..., 0]
        )  # an end takes all coordinates
        spoilt |= _cells_with_failed_corner(ended, grid, order)
        # Where no corner of the cells around leaves the window on its way, no point of the cell does.
        for j in range(grid.dimension):
            spoilt |= np.roll(spoilt, 1, axis=j) | np.roll(spoilt, -1, axis=j)
    return replace(smooth, indicator=indicator, fallback=fallback | spoilt | tables[-1].fallback)


def _several(exact: PointMap, advance: LookUps, periods: int) -> PointMap:
    """Return the map whose step is several periods of a table."""

    def make(orbits: Orbits, steps: int) -> None:
        advance(orbits, steps * periods)

    return replace(exact, advance=make, tangent=None, coarse_tangent=None, stretch=None)
