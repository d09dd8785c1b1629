"""Bounds on interpolation errors in the cells of an interpolated map, and their propagation by the map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..._compiled.kernels.cell_errors import Bounds, Given, bounding, curve, differences, probes
from ..._lib.arrays import Floats
from ..._lib.threads import run_over, slices
from ...maps.coordinates import turns_of
from ...maps.grid import CellGrid
from ...maps.orbit_batch import CHUNK, Orbits
from ...maps.point_map import PointMap
from ...maps.stroboscopic import Stroboscopic

_UNBOUNDED = 1e9  # widths of a cell: an error of which nothing follows
UNRESOLVED = 1.0  # error of the spline, in widths of a cell, from which it says nothing of what is between its nodes
_ACROSS = 0.49  # step of differences over a cell, in widths of it
_CELLS = 4096  # cells whose derivatives are measured together: their images stay in the cache


@dataclass(frozen=True, eq=False)
class TableErrors:
    """Error estimates of a table, in widths of its cells; all arrays are flat.

    ``slopes`` (n, d, d) derivatives at the centres, ``bends`` (n,) their change over a cell, ``errors`` (n,) of a
    period of the table, ``tolerances`` (n,) of the exact map; ``images`` (n, d) places of the centres' images in cells
    from the first edge, unwrapped; ``estimates`` (n,) of the spline's errors, also in cells that it does not serve;
    ``of_orbits`` (n,) errors of a period along orbits, which are integrated in fallback cells.
    """

    slopes: Floats
    bends: Floats
    errors: Floats
    tolerances: Floats
    images: Floats
    estimates: Floats
    of_orbits: Floats

    @staticmethod
    def memory(grid: CellGrid) -> int:
        """Return the bytes that the bounds of a table need."""
        d = grid.dimension
        return 8 * grid.size * (2 * d * d + 3 * d + 8)

    @classmethod
    @np.errstate(over="ignore", invalid="ignore")  # images of maps that diverge
    def of(cls, point_map: PointMap, safety: float, progress: bool) -> TableErrors:
        """Measure derivatives at the centres of all cells, and take errors from the check of the table."""
        table, exact = point_map.table, point_map.exact
        assert table is not None and exact is not None
        grid, d, n = table.grid, point_map.dimension, table.grid.size
        axes = np.concatenate([grid.axis(j) for j in range(d)])
        origin, cells, wraps = np.array(grid.lower), np.array(grid.shape, np.int64), np.array(grid.wraps)
        turn = turns_of(point_map.coordinates)[1]
        slopes, images = np.empty((n, d, d)), np.empty((n, d))
        bends, errors, tolerances, estimates = np.empty((n, 2)), np.empty(n), np.empty(n), np.empty(n)

        def measure(part: slice) -> None:
            points = np.empty(((part.stop - part.start) * (1 + 2 * d), d))
            probes(axes, cells, _ACROSS * grid.widths, part.start, points)
            found = _after_a_period(point_map, points)
            step = 1.0 / grid.widths, _ACROSS
            differences(found.points, found.rotations, turn, origin, *step, slopes[part], images[part])

        run_over(slices(n, _CELLS), measure, f"derivatives of {point_map.name}" if progress else None)
        by_rows = slopes.reshape(n // grid.shape[-1], -1)
        curved = np.empty(by_rows.shape)
        # A table that orbits stay in despite a neighbour without image has an error that is not known to be small.
        numbers = safety, _UNBOUNDED, *map(float, exact.tolerance)
        by_cells = table.indicator.reshape(-1, grid.shape[-1]), table.fallback.reshape(-1, grid.shape[-1])

        given = Given(by_rows, curved, images, *by_cells)
        found = Bounds(bends, errors, tolerances, estimates)

        def bend(part: slice) -> None:
            curve(by_rows, cells, wraps, part.start, part.stop, curved)

        def bound(part: slice) -> None:
            bounding(d)((origin, grid.widths, cells, wraps), given, numbers, part.start, part.stop, found)

        parts = slices(len(by_rows), CHUNK // grid.shape[-1] + 1)
        run_over(parts, bend)
        run_over(parts, bound)
        of_orbits = errors
        if has_power_series(exact):
            # Nothing jumps within a cell: what its derivatives do not show at the centres is at most as steep as a wave
            # that is as high as the error of the spline, and as long as a cell.
            smooth = np.isinf(errors) & np.isfinite(tolerances) & (estimates <= UNRESOLVED)
            for j in np.flatnonzero(~wraps):  # beyond the outermost centres nothing is between two of them
                np.moveaxis(smooth.reshape(grid.shape), j, 0)[[0, -1]] = False
            of_orbits = errors.copy()
            errors[smooth], of_orbits[smooth] = estimates[smooth], tolerances[smooth]
            bends[smooth, 1] += 2.0 * np.pi * estimates[smooth]
        return cls(slopes, bends, errors, tolerances, images, estimates, of_orbits)


def has_power_series(exact: PointMap) -> bool:
    """Tell whether a map is known to follow a flow of analytic functions, so that it has no kinks and does not jump."""
    if not isinstance(exact.spec, Stroboscopic):
        return False
    known = exact.spec.formulas.plain
    return known is not None and known.is_analytic


def images_of(point_map: PointMap, points: Floats) -> Floats:
    """Return the unwrapped images of points."""
    orbits = _after_a_period(point_map, points.copy())
    return np.asarray(orbits.points + orbits.rotations * turns_of(point_map.coordinates)[1])


def _after_a_period(point_map: PointMap, points: Floats) -> Orbits:
    """Move points on by a period, in place, with the full rotations of their angles."""
    orbits = Orbits.starting(points)
    orbits.wrap(*turns_of(point_map.coordinates))
    point_map.advance(orbits, 1)
    return orbits


@np.errstate(over="ignore", invalid="ignore")  # images of maps that diverge
def slopes_of(point_map: PointMap, points: Floats, widths: Floats, steps: Floats) -> tuple[Floats, Floats]:
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


def tolerance_in_cells(exact: PointMap, points: Floats, grid: CellGrid) -> Floats:
    """Return the tolerance of an exact map at images, the largest component (n,) in widths of a table's cells."""
    relative, absolute = exact.tolerance
    return np.asarray(((absolute + relative * np.abs(points)) / grid.widths).max(axis=1))
