"""Cost and accuracy of methods for computing basins, predicted from measurements."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import ceil

from ..._lib.checks import finite_number, in_bytes
from ..._lib.signatures import checked
from ...maps.grid import CellGrid
from ...maps.interpolation.interpolated import table_memory
from ...maps.interpolation.spline_coefficients import number_of_nodes
from ...maps.orbit_batch import CHUNK
from ..label_store import basins_memory
from .extrapolation import error_of, fallback_of, slower, table_grids
from .measurements import ExactProbe, Measurements, TableProbe

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
    memory = basins_memory(measured.initial_conditions)
    return Option(
        kind="direct",
        method=source.method,
        tolerance=source.tolerance,
        order=None,
        shape=None,
        error=source.error,
        tabulation=0.0,
        iteration=ratio * _wall(measured, measured.direct.per_point),
        search=ratio * measured.direct.fixed,
        memory=memory,
        obstacle=_obstacle(memory, measured.free),
    )


def _table(measured: Measurements, probe: TableProbe, grid: CellGrid, source: ExactProbe) -> Option:
    cells = max(grid.shape)
    memory = table_memory(grid, probe.order) + basins_memory(measured.initial_conditions)
    each = probe.labelling.per_point * slower(probe, grid) + fallback_of(probe, cells) * source.seconds
    return Option(
        kind="table",
        method=source.method,
        tolerance=source.tolerance,
        order=probe.order,
        shape=grid.shape,
        error=error_of(probe, grid) + _CARRIED * source.error,
        tabulation=(number_of_nodes(grid, probe.order) + grid.size)
        * (source.seconds + probe.surplus)
        / measured.threads,
        iteration=_wall(measured, each),
        search=probe.labelling.fixed,
        memory=memory,
        obstacle=_obstacle(memory, measured.free),
    )


def _wall(measured: Measurements, per_point: float) -> float:
    """Seconds for all starts on all threads; slices of work are not divided."""
    return per_point * measured.initial_conditions / parallel(measured.initial_conditions, measured.threads)


def parallel(initial_conditions: int, threads: int) -> int:
    """Return how many threads a number of initial conditions keeps at work."""
    return max(1, min(threads, ceil(initial_conditions / CHUNK)))


def _obstacle(memory: int, free: int | None) -> str:
    if free is None or memory <= free:
        return ""
    return f"needs {in_bytes(memory)} of memory, {in_bytes(free)} are free"
