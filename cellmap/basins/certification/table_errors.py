"""Bounds on interpolation errors in the cells of an interpolated map, and their propagation by the map."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..._lib.threads import run_over, slices
from ...maps.coordinates import turns_of, wrap
from ...maps.grid import CellGrid, grid_points
from ...maps.orbit_batch import CHUNK, Orbits
from ...maps.point_map import PointMap

_UNBOUNDED = 1e9  # widths of a cell: an error of which nothing follows
_ACROSS = 0.49  # step of differences over a cell, in widths of it


@dataclass(frozen=True, eq=False)
class TableErrors:
    """What the table says about errors, in widths of its cells; all arrays are flat.

    ``slopes`` (n, d, d) derivatives at the centres, ``bends`` (n,) their change over a cell, ``errors`` (n,) of a
    period of the table, ``tolerances`` (n,) of the exact map; ``images`` (n, d) places of the centres' images in cells
    from the first edge, unwrapped.
    """

    slopes: NDArray[np.float64]
    bends: NDArray[np.float64]
    errors: NDArray[np.float64]
    tolerances: NDArray[np.float64]
    images: NDArray[np.float64]

    @staticmethod
    def memory(grid: CellGrid) -> int:
        """Return the bytes that the bounds of a table need."""
        d = grid.dimension
        return 8 * grid.size * (d * d + 3 * d + 6)

    @classmethod
    @np.errstate(over="ignore", invalid="ignore")  # images of maps that diverge
    def of(cls, point_map: PointMap, safety: float, progress: bool) -> TableErrors:
        """Measure derivatives at the centres of all cells, and take errors from the check of the table."""
        table, exact = point_map.table, point_map.exact
        assert table is not None and exact is not None
        grid, d = table.grid, point_map.dimension
        slopes, images = np.empty((grid.size, d, d)), np.empty((grid.size, d))
        axes = [grid.axis(j) for j in range(d)]

        def measure(part: slice) -> None:
            centres = grid_points(axes, part)
            images[part] = (images_of(point_map, centres) - grid.lower) / grid.widths
            slopes[part] = slopes_of(point_map, centres, grid.widths, np.full(len(centres), _ACROSS))[0]

        run_over(slices(grid.size, CHUNK), measure, f"derivatives of {point_map.name}" if progress else None)
        bends = np.zeros((grid.size, 2))
        for i, j in np.ndindex(d, d):
            for k, change in enumerate(_changes(slopes[:, i, j].reshape(grid.shape), grid)):
                bends[:, k] += change.ravel() ** 2
        # A table that orbits stay in despite a neighbour without image has an error that is not known to be small.
        errors = safety * _of_neighbours(np.maximum, np.minimum(table.indicator, _UNBOUNDED).astype(float), grid)
        errors = np.where(table.rough, np.inf, errors).ravel()
        tolerances = tolerance_in_cells(exact, images * grid.widths + grid.lower, grid)
        known = np.isfinite(slopes).all(axis=(1, 2)) & np.isfinite(tolerances)
        errors = np.where(known, errors + tolerances, np.inf)
        return cls(slopes, np.sqrt(bends), errors, np.where(known, tolerances, np.inf), images)


def images_of(point_map: PointMap, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the unwrapped images of points."""
    wrapped = wrap(points, point_map.coordinates)
    orbits = Orbits.starting(wrapped.copy())
    point_map.advance(orbits, 1)
    return np.asarray(orbits.points + orbits.rotations * turns_of(point_map.coordinates)[1] + (points - wrapped))


@np.errstate(over="ignore", invalid="ignore")  # images of maps that diverge
def slopes_of(
    point_map: PointMap, points: NDArray[np.float64], widths: NDArray[np.float64], steps: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return derivatives (n, d, d) by differences to both sides, and by how much the two differ (n,), in cells."""
    n, d = points.shape
    slopes, bends = np.empty((n, d, d)), np.zeros(n)
    middle = images_of(point_map, points)
    for j in range(d):
        shift = steps[:, None] * widths * (np.arange(d) == j)
        before, after = (images_of(point_map, points + way * shift) for way in (-1.0, 1.0))
        slopes[:, :, j] = (after - before) / widths / (2.0 * steps[:, None])
        bends += (((after - 2.0 * middle + before) / widths / steps[:, None]) ** 2).sum(axis=1)
    return slopes, np.sqrt(bends)


def tolerance_in_cells(exact: PointMap, points: NDArray[np.float64], grid: CellGrid) -> NDArray[np.float64]:
    """Return the tolerance of an exact map at images, the largest component (n,) in widths of a table's cells."""
    relative, absolute = exact.tolerance
    return np.asarray(((absolute + relative * np.abs(points)) / grid.widths).max(axis=1))


def _of_neighbours(combine: Any, values: NDArray[np.float64], grid: CellGrid) -> NDArray[np.float64]:
    """Combine for each cell its value with those of the cells around it, corners included."""
    for j in range(grid.dimension):
        before, after = _beside(values, j, grid)
        values = combine(combine(before, values), after)
    return values


def _beside(values: NDArray[np.float64], j: int, grid: CellGrid) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return for each cell the values of the cells before and behind it along an axis; at an end its own."""
    n = grid.shape[j]
    first, last = slice(0, 1), slice(n - 1, n)
    ends = (last, first) if grid.wraps[j] else (first, last)

    def at(part: slice) -> NDArray[np.float64]:
        return values[(slice(None),) * j + (part,)]

    before = np.concatenate([at(ends[0]), at(slice(0, n - 1))], axis=j)
    after = np.concatenate([at(slice(1, n)), at(ends[1])], axis=j)
    return before, after


def _changes(values: NDArray[np.float64], grid: CellGrid) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return how much values change from a cell to the next, at most, and how far a straight line is from them."""
    change = np.fmax(_of_neighbours(np.fmax, values, grid) - values, values - _of_neighbours(np.fmin, values, grid))
    curved = np.zeros_like(values)
    for j in range(grid.dimension):
        before, after = _beside(values, j, grid)
        curved += np.abs(before - 2.0 * values + after) / 8.0
    # Where a line bends, and it may bend more next to the centre: the largest around, twice.
    return change, 2.0 * _of_neighbours(np.fmax, curved, grid)
