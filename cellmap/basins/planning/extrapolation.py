"""Errors and costs of interpolation grids of all sizes, extrapolated from measured ones."""

from __future__ import annotations

from collections.abc import Sequence
from math import log

import numpy as np

from ...maps.grid import CellGrid
from ...maps.interpolation.interpolated import ALLOWED, table_memory
from .measurements import Measurements, TableProbe

_MOST_CELLS = 1 << 14
_LEAST = 1e-300


def table_grids(measured: Measurements, probe: TableProbe) -> list[CellGrid]:
    """Return tables with 2^k and 1.5 * 2^k cells along the longest axis, up to the first that memory cannot hold."""
    grids = []
    cells = probe.cells[0]
    for _ in range(64):
        grid = sized(measured.window, cells)
        grids.append(grid)
        if cells >= _MOST_CELLS or (measured.free is not None and table_memory(grid, probe.order) > measured.free):
            break
        cells = cells * 3 // 2 if cells & (cells - 1) == 0 else cells * 4 // 3
    return grids


def sized(window: CellGrid, cells: int) -> CellGrid:
    """Return a window with so many cells along its longest axis, and as many more or fewer along the others."""
    longest = max(window.shape)
    shape = tuple(max(1, round(n * cells / longest)) for n in window.shape)
    return CellGrid(window.lower, window.upper, shape, window.wraps)


def error_of(probe: TableProbe, grid: CellGrid) -> float:
    """Return the error of a table by the measured ones; it falls no faster than the order of the splines allows.

    A coarse grid with many fallback cells may be more accurate than a finer one without; grids between the two are
    therefore given the larger error.  Beyond the largest grid, errors without fallback cells are extrapolated, limited
    by the error from which on a cell becomes a fallback cell.
    """
    cells = max(grid.shape)
    if cells > probe.cells[-1]:
        raw = _power_law(list(zip(probe.cells, probe.raw, strict=True)), cells, probe.order + 1.0)
        return min(raw, ALLOWED[probe.order] * float(grid.widths.max()))
    falling = np.maximum.accumulate(probe.errors[::-1])[::-1]
    return _power_law(list(zip(probe.cells, map(float, falling), strict=True)), cells, probe.order + 1.0)


def fallback_of(probe: TableProbe, cells: int) -> float:
    """Return how many images of an orbit are evaluated with the exact map."""
    return _power_law(probe.fallback, cells, probe.order + 1.0)


def _power_law(known: Sequence[tuple[int, float]], cells: int, steepest: float) -> float:
    """Read off a falling quantity: between measured sizes, and beyond the last with the slope of the last two.

    A slope above `steepest` is not yet that of the limit, and is not carried on; a rising one is an accident.
    """
    if not known or known[-1][1] <= 0.0:
        return 0.0
    sizes = [log(n) for n, _ in known]
    values = [log(max(v, _LEAST)) for _, v in known]
    place = log(cells)
    if place <= sizes[-1] or len(known) == 1:
        return float(np.exp(np.interp(place, sizes, values)))
    slope = (values[-2] - values[-1]) / (sizes[-1] - sizes[-2])
    return float(np.exp(values[-1] - min(max(slope, 0.0), steepest) * (place - sizes[-1])))


def slower(probe: TableProbe, grid: CellGrid) -> float:
    """Return how much slower than in the largest measured table a look-up is, as tables outgrow caches."""
    if not probe.lookups:
        return 1.0
    sizes = [log(size) for size, _ in probe.lookups]
    seconds = np.maximum.accumulate([s for _, s in probe.lookups])

    def at(cells: int) -> float:
        return float(np.interp(log(table_memory(sized(grid, cells), probe.order)), sizes, seconds))

    return at(max(grid.shape)) / at(probe.cells[-1])
