"""Cost and accuracy of methods for computing basins, predicted from small measurements."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, log

import numpy as np

from ..._lib.checks import finite_number, in_bytes
from ..._lib.signatures import checked
from ...maps.grid import CellGrid
from ...maps.interpolation.interpolated import ALLOWED, table_memory
from ...maps.interpolation.spline_coefficients import number_of_nodes
from ...maps.orbit_batch import CHUNK
from ..label_store import basins_memory


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
    """Time of labelling: ``fixed`` seconds, and ``per_point`` seconds of one thread for each initial condition."""

    fixed: float
    per_point: float


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
        The same without fallback cells.
    surplus : float
        Seconds of one thread for each node, besides those of the exact map.
    labelling : Labelling
        By the largest size, without evaluations of the exact map.
    fallback : tuple of (int, float)
        Cells, and the images of an orbit that are evaluated with the exact map at that size.
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
    initial_conditions : int
        Number of initial conditions.
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
        With the exact map alone.
    tables : tuple of TableProbe
        One for each order.
    free : int or None
        Bytes of memory that are free.
    outside : float
        Fraction of the points of orbits that lie outside of the window.
    """

    initial_conditions: int
    periods: float
    window: CellGrid
    threads: int
    exact: tuple[ExactProbe, ...]
    base: ExactProbe
    direct: Labelling
    tables: tuple[TableProbe, ...] = ()
    free: int | None = None
    outside: float = 0.0


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
    beyond = cells > probe.cells[-1]
    errors = probe.raw if beyond else np.maximum.accumulate(probe.errors[::-1])[::-1].tolist()
    found = _power_law(list(zip(probe.cells, errors, strict=True)), cells, probe.order + 1.0)
    return min(found, ALLOWED[probe.order] * float(grid.widths.max())) if beyond else found


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


SAFETY = 2.0
"""Factor by which a predicted error stays below the accuracy that is wanted."""

_CARRIED = 2.0  # how much of the exact map's own error the splines of a table can make of it


@dataclass(frozen=True)
class Option:
    """A method for computing basins, with its predicted cost and accuracy.

    Parameters
    ----------
    kind : {"direct", "table"}
        Direct integration of the initial conditions, or an interpolated map.
    method, tolerance : str, float
        Integration method and tolerance of the exact map, or of the map that is interpolated.
    order, shape : int or None, tuple of int or None
        Order and number of cells of the interpolated map.
    error : float
        Predicted error of one period: the 99th percentile, over random points of the window, of the largest component
        of the difference to the true image, in the units of the coordinates.
    tabulation, iteration, search : float
        Seconds for the interpolated map, for labelling the initial conditions, and for the search for attractors, which
        does not depend on their number.
    memory : int
        Memory in bytes.
    obstacle : str
        Reason for exclusion; empty if the method can be used.
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
        """Total time in seconds."""
        return self.tabulation + self.iteration + self.search

    @property
    def family(self) -> str:
        """Name of the family of methods that differ in one parameter only."""
        return self.method if self.order is None else f"order {self.order}"

    @checked
    def meets(self, accuracy: float) -> bool:
        """Return whether the predicted error, with a safety margin, is below an accuracy."""
        return SAFETY * self.error <= finite_number("accuracy", accuracy)

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
        raise MemoryError(f"no method fits into memory: {options[0].obstacle}; take fewer initial conditions")
    good = [o for o in possible if o.meets(accuracy)]
    if good:
        return min(good, key=lambda o: (o.seconds, o.error)), True
    return min(possible, key=lambda o: (o.error, o.seconds)), False


def options_of(measured: Measurements) -> tuple[Option, ...]:
    """Return what no option of the same family beats in both error and time, by family, the least accurate first."""
    direct = [_option(measured, source) for source in measured.exact]
    tables = [
        _option(measured, source, probe, grid)
        for probe in measured.tables
        for grid in table_grids(measured, probe)
        for source in measured.exact
    ]
    families: dict[tuple[str, bool], list[Option]] = {}
    for option in sorted([*direct, *tables], key=lambda o: (o.error, o.seconds)):
        members = families.setdefault((option.family, bool(option.obstacle)), [])
        if not members or option.seconds < members[-1].seconds:
            members.append(option)
    order = dict.fromkeys((option.family, bool(option.obstacle)) for option in [*direct, *tables])
    return tuple(option for family in order for option in reversed(families[family]))


def _option(
    measured: Measurements, source: ExactProbe, probe: TableProbe | None = None, grid: CellGrid | None = None
) -> Option:
    """Predict direct integration, or a table on a grid."""
    count, ratio = measured.initial_conditions, source.seconds / measured.base.seconds
    memory, error, tabulation = basins_memory(count), source.error, 0.0
    each, search = ratio * measured.direct.per_point, ratio * measured.direct.fixed
    if probe is not None and grid is not None:
        memory += table_memory(grid, probe.order)
        error = error_of(probe, grid) + _CARRIED * source.error
        images = number_of_nodes(grid, probe.order) + grid.size
        tabulation = images * (source.seconds + probe.surplus) / measured.threads
        exact = fallback_of(probe, max(grid.shape)) * source.seconds
        each, search = probe.labelling.per_point * slower(probe, grid) + exact, probe.labelling.fixed
    held = measured.free is None or memory <= measured.free
    return Option(
        kind="direct" if probe is None else "table",
        method=source.method,
        tolerance=source.tolerance,
        order=None if probe is None else probe.order,
        shape=None if grid is None else grid.shape,
        error=error,
        tabulation=tabulation,
        iteration=each * count / parallel(count, measured.threads),  # slices of work are not divided
        search=search,
        memory=memory,
        obstacle="" if held else f"needs {in_bytes(memory)} of memory, {in_bytes(measured.free or 0)} are free",
    )


def parallel(initial_conditions: int, threads: int) -> int:
    """Return how many threads a number of initial conditions keeps at work."""
    return max(1, min(threads, ceil(initial_conditions / CHUNK)))
