"""What ways to a picture cost and how accurate they are, predicted from measured probes alone."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import ceil, log

import numpy as np

from .basins import basins_memory
from .checks import in_bytes
from .grid import CellGrid
from .interpolated import ALLOWED, table_memory
from .orbit_batch import CHUNK
from .spline_coefficients import tabulated_nodes

SAFETY = 2.0
"""Factor by which a predicted error stays below the accuracy that is wanted."""

_CARRIED = 2.0  # how much of the exact map's own error the splines of a table can make of it
_MOST_CELLS = 1 << 14
_LEAST = 1e-300


@dataclass(frozen=True)
class ExactProbe:
    """One way to integrate, measured.

    ``seconds`` of one thread for an image; ``error`` as :attr:`Option.error`.
    """

    method: str
    tolerance: float
    error: float
    seconds: float


@dataclass(frozen=True)
class Labelling:
    """Time that the starts of a picture take: ``fixed`` seconds, and ``per_start`` seconds of one thread."""

    fixed: float
    per_start: float


@dataclass(frozen=True)
class TableProbe:
    """Tables of one order, measured at some sizes.

    Parameters
    ----------
    order : int
        Degree of the splines.
    cells : tuple of int
        Cells along the longest axis, ascending.
    errors : tuple of float
        Error of one period at those sizes.
    raw : tuple of float
        The same, were no cell left to the exact map.
    surplus : float
        Seconds of one thread for each tabulated image, besides those of the exact map.
    labelling : Labelling
        By the largest size, without what the exact map takes in its place.
    fallback : tuple of (int, float)
        Cells, and the images of a start that are left to the exact map with so many.
    lookups : tuple of (int, float)
        Bytes of a table, and the seconds of a look-up at a random place in it.
    """

    order: int
    cells: tuple[int, ...]
    errors: tuple[float, ...]
    raw: tuple[float, ...]
    surplus: float
    labelling: Labelling
    fallback: tuple[tuple[int, float], ...] = ()
    lookups: tuple[tuple[int, float], ...] = ()


@dataclass(frozen=True)
class Measurements:
    """All that a plan rests on.

    Parameters
    ----------
    starts : int
        Starts of the picture.
    periods : float
        Periods that one of them takes, on average.
    window : CellGrid
        Window of the tables; its shape tells how many cells along each axis go with how many along the longest.
    threads : int
        Threads in use.
    exact : tuple of ExactProbe
        Ways to integrate.
    base : ExactProbe
        The one by which `direct` was measured.
    direct : Labelling
        Of starts without a table.
    tables : tuple of TableProbe
        One for each order.
    free : int or None
        Bytes of memory that are free.
    outside : float
        Share of the points of orbits that lie outside of the window.
    """

    starts: int
    periods: float
    window: CellGrid
    threads: int
    exact: tuple[ExactProbe, ...]
    base: ExactProbe
    direct: Labelling
    tables: tuple[TableProbe, ...] = ()
    free: int | None = None
    outside: float = 0.0


@dataclass(frozen=True)
class Option:
    """One way to a picture, with what it is expected to cost.

    Parameters
    ----------
    kind : {"direct", "table"}
        Whether starts are integrated or looked up.
    method, tolerance : str, float
        Of the exact map, or of that which a table is made from.
    order, shape : int or None, tuple of int or None
        Of the table.
    error : float
        Of one period: the 99th percentile, over random places of the window, of the largest component of the
        difference to the true image, in the units of the coordinates.
    tabulation, iteration, search : float
        Seconds to make the table, to label the starts, and for what does not depend on their number: the search for
        attractors.
    memory : int
        Bytes.
    obstacle : str
        Why this way is closed; empty for one that is open.
    """

    kind: str
    method: str
    tolerance: float
    order: int | None
    shape: tuple[int, ...] | None
    error: float
    tabulation: float
    iteration: float
    search: float
    memory: int
    obstacle: str = ""

    @property
    def seconds(self) -> float:
        """Seconds from nothing to the picture."""
        return self.tabulation + self.iteration + self.search

    @property
    def family(self) -> str:
        """What options that differ by one dial have in common."""
        return self.method if self.order is None else f"order {self.order}"

    def meets(self, accuracy: float) -> bool:
        """Tell whether the error is expected to stay below an accuracy, with a margin for the prediction."""
        return SAFETY * self.error <= accuracy

    def __str__(self) -> str:
        source = f"{self.method} {self.tolerance:.0e}"
        if self.shape is None:
            return source
        return f"order {self.order}, {' x '.join(map(str, self.shape))} of {source}"


def choose(options: Sequence[Option], accuracy: float) -> tuple[Option, bool]:
    """Return the fastest open option that meets an accuracy, and True; or the most accurate one, and False.

    As the options do not depend on the accuracy, a stricter one is never expected to be cheaper.
    """
    possible = [o for o in options if not o.obstacle]
    if not possible:
        raise MemoryError(f"no way to the picture fits into memory: {options[0].obstacle}; take fewer starts")
    good = [o for o in possible if o.meets(accuracy)]
    if good:
        return min(good, key=lambda o: (o.seconds, o.error)), True
    return min(possible, key=lambda o: (o.error, o.seconds)), False


def options_of(measured: Measurements) -> tuple[Option, ...]:
    """Return what can be done, without what is slower and less accurate than another option of its family."""
    direct = [_direct(measured, source) for source in measured.exact]
    tables = [
        _table(measured, probe, grid, source)
        for probe in measured.tables
        for grid in table_grids(measured, probe)
        for source in measured.exact
    ]
    return tuple(_worthwhile([*direct, *tables]))


def _worthwhile(options: Iterable[Option]) -> list[Option]:
    """Keep what no option of the same family beats in both error and time, by family, the least accurate first."""
    families: dict[tuple[str, bool], list[Option]] = {}
    for option in options:
        families.setdefault((option.family, bool(option.obstacle)), []).append(option)
    kept = []
    for members in families.values():
        best = float("inf")
        front = []
        for option in sorted(members, key=lambda o: (o.error, o.seconds)):
            if option.seconds < best:
                best = option.seconds
                front.append(option)
        kept += front[::-1]
    return kept


def _direct(measured: Measurements, source: ExactProbe) -> Option:
    ratio = source.seconds / measured.base.seconds
    memory = basins_memory(measured.starts)
    return Option(
        kind="direct",
        method=source.method,
        tolerance=source.tolerance,
        order=None,
        shape=None,
        error=source.error,
        tabulation=0.0,
        iteration=ratio * _wall(measured, measured.direct.per_start),
        search=ratio * measured.direct.fixed,
        memory=memory,
        obstacle=_obstacle(memory, measured.free),
    )


def _table(measured: Measurements, probe: TableProbe, grid: CellGrid, source: ExactProbe) -> Option:
    cells = max(grid.shape)
    memory = table_memory(grid, probe.order) + basins_memory(measured.starts)
    each = probe.labelling.per_start * _slower(probe, grid) + fallback_of(probe, cells) * source.seconds
    return Option(
        kind="table",
        method=source.method,
        tolerance=source.tolerance,
        order=probe.order,
        shape=grid.shape,
        error=error_of(probe, grid) + _CARRIED * source.error,
        tabulation=(tabulated_nodes(grid, probe.order) + grid.size)
        * (source.seconds + probe.surplus)
        / measured.threads,
        iteration=_wall(measured, each),
        search=probe.labelling.fixed,
        memory=memory,
        obstacle=_obstacle(memory, measured.free),
    )


def _wall(measured: Measurements, per_start: float) -> float:
    """Seconds for all starts on all threads; slices of work are not divided."""
    return per_start * measured.starts / parallel(measured.starts, measured.threads)


def parallel(starts: int, threads: int) -> int:
    """Return how many threads a number of starts keeps at work."""
    return max(1, min(threads, ceil(starts / CHUNK)))


def _obstacle(memory: int, free: int | None) -> str:
    if free is None or memory <= free:
        return ""
    return f"needs {in_bytes(memory)} of memory, {in_bytes(free)} are free"


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

    A coarse table that leaves much to the exact map may be better than a finer one that does not; that is no reason to
    trust those between them.  Beyond the last one the errors count that are made if nothing is left to the exact map,
    unless they are so large that their cells will be.
    """
    cells = max(grid.shape)
    if cells > probe.cells[-1]:
        raw = _power_law(list(zip(probe.cells, probe.raw, strict=True)), cells, probe.order + 1.0)
        return min(raw, ALLOWED[probe.order] * float(grid.widths.max()))
    falling = np.maximum.accumulate(probe.errors[::-1])[::-1]
    return _power_law(list(zip(probe.cells, map(float, falling), strict=True)), cells, probe.order + 1.0)


def fallback_of(probe: TableProbe, cells: int) -> float:
    """Return the images of a start that a table leaves to the exact map."""
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


def _slower(probe: TableProbe, grid: CellGrid) -> float:
    """Return how much slower than in the largest measured table a look-up is, as tables outgrow caches."""
    if not probe.lookups:
        return 1.0
    sizes = [log(size) for size, _ in probe.lookups]
    seconds = np.maximum.accumulate([s for _, s in probe.lookups])

    def at(cells: int) -> float:
        return float(np.interp(log(table_memory(sized(grid, cells), probe.order)), sizes, seconds))

    return at(max(grid.shape)) / at(probe.cells[-1])
