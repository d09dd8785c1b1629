"""Small measurements on this machine, on which a plan is based."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from threading import Lock

import numpy as np

from ..._lib.arrays import Floats
from ..._lib.memory import memory_available
from ..._lib.randomness import random_numbers
from ..._lib.threads import run_over, slices, thread_count
from ...maps.cell_table import CellTable
from ...maps.coordinates import difference, turns_of
from ...maps.grid import CellGrid, grid_points
from ...maps.interpolation.interpolated import interpolated_map, table_memory
from ...maps.interpolation.look_ups import LookUps
from ...maps.interpolation.spline_coefficients import ORDERS, number_of_nodes, with_spare_doubles
from ...maps.orbit_batch import Orbits
from ...maps.point_map import PointMap, follow
from ...maps.stroboscopic import SMALLEST_TOLERANCE, method_of, stroboscopic_map
from ...maps.system import ForcedSystem
from ..finding import find_basins
from .predictions import ExactProbe, Labelling, Measurements, TableProbe, parallel, sized

Source = tuple[str, float]
"""Method and tolerance of an exact map."""

_TOLERANCES = (1e-4, 1e-7, 1e-10, 1e-13)
_LOOSE = (1e-4, 1e-7)  # tolerances of RK45, which takes too many steps for finer ones
_JUMPING = (1e-6, 1e-10)  # tolerances for discontinuous right-hand sides, whose kernels take long to compile
_BASE = 1e-7  # about the tolerance with which probes are labelled
_PLACES = 4096  # random places at which errors are measured


@dataclass(frozen=True, eq=False)
class Job:
    """A basin image to be planned: exact maps by method and tolerance, the most precise one, and the task."""

    sources: Mapping[Source, PointMap]
    reference: PointMap
    grid: CellGrid
    periods: int | None
    outside: str
    seed: int

    @property
    def base(self) -> Source:
        """Method and tolerance with which initial conditions are labelled in probes."""
        return min(self.sources, key=lambda s: (s[0] == "RK45", abs(np.log(s[1] / _BASE)), s[0] == "DOP853"))

    @property
    def finest(self) -> PointMap:
        """The map that is interpolated in probes, so that they show the error of interpolation."""
        return self.sources[min(self.sources, key=lambda s: (s[0] == "RK45", s[1], s[0] == "DOP853"))]


def exact_maps(system: ForcedSystem | PointMap, phase: float) -> tuple[dict[Source, PointMap], PointMap]:
    """Return the exact maps that come into question, and the most precise one."""
    if isinstance(system, PointMap):
        name = method_of(system) or system.recipe["kind"]
        return {(name, max(system.tolerance)): system}, system
    reference = stroboscopic_map(system, phase, SMALLEST_TOLERANCE, SMALLEST_TOLERANCE)
    usual = method_of(reference)
    wanted: dict[str, tuple[float, ...]] = {usual: _JUMPING}
    if system.functions[1:] == (None, None):
        wanted = {usual: _TOLERANCES, "DOP853": _TOLERANCES, "RK45": _LOOSE}
    found = {(m, tol): stroboscopic_map(system, phase, tol, tol, m) for m, tols in wanted.items() for tol in tols}
    return found, reference


def percentile_error(one: PointMap, other: PointMap, places: Floats) -> float:
    """Return the 99th percentile of the largest component by which images differ, where both maps have one."""
    shift = difference(follow(one, places, 1).points, follow(other, places, 1).points, one.coordinates)
    errors = np.abs(shift).max(axis=-1)
    errors = errors[np.isfinite(errors)]
    return float(np.quantile(errors, 0.99)) if errors.size else float("inf")


def places_in(window: CellGrid, seed: int) -> Floats:
    """Return random places of a window."""
    return random_numbers(seed).uniform(window.lower, window.upper, (_PLACES, window.dimension))


def some_initial_conditions(grid: CellGrid, count: int) -> Floats:
    """Return some initial conditions of a grid, in its order."""
    some = grid.size > count
    rows = np.sort(np.random.default_rng(0).choice(grid.size, count, replace=False)) if some else np.arange(grid.size)
    return grid_points([grid.axis(j) for j in range(grid.dimension)], rows)


SECONDS = 0.3
"""About how long one probe takes."""

BATCH = 16384
FEW = 1600
"""Initial conditions of a probe, and of the small grid."""

_MANY = 4  # slices of work of the larger grid, at most, for each thread


def seconds_per_image(source: PointMap, grid: CellGrid) -> float:
    """Return seconds of one thread for an image, with all threads at work."""
    initial_conditions = some_initial_conditions(grid, BATCH)
    threads = thread_count()
    parts = slices(len(initial_conditions), -(-len(initial_conditions) // threads))

    def once() -> None:
        run_over(parts, lambda part: source.advance(Orbits.starting(initial_conditions[part].copy()), 1))

    source.advance(Orbits.starting(initial_conditions[:16].copy()), 1)  # compiles
    return median_seconds(once) * min(threads, len(parts)) / len(initial_conditions)


def median_seconds(work: Callable[[], object]) -> float:
    """Return how long some work takes, undisturbed by a single pause."""
    taken: list[float] = []
    while len(taken) < 3 and (not taken or sum(taken) < SECONDS):
        began = time.perf_counter()
        work()
        taken.append(time.perf_counter() - began)
    return max(float(np.median(taken)), 1e-9)


def thinned(grid: CellGrid, count: int) -> CellGrid:
    """Return the grid with about `count` cells."""
    if grid.size <= count:
        return grid
    wide = sum(n > 1 for n in grid.shape)
    factor = (count / grid.size) ** (1.0 / wide)
    return CellGrid(grid.lower, grid.upper, tuple(max(1, round(n * factor)) for n in grid.shape))


@dataclass(frozen=True)
class Trial:
    """Labelling of a small grid: initial conditions, seconds, periods for each of them, and counted images."""

    initial_conditions: int
    seconds: float
    periods: float
    images: int

    @property
    def effort(self) -> float:
        """Initial conditions of the busiest thread."""
        return self.initial_conditions / parallel(self.initial_conditions, thread_count())


def label(job: Job, point_map: PointMap, initial_conditions: int, count: Callable[[], int]) -> Trial:
    """Label a thinned grid of initial conditions, or iterate it."""
    grid = thinned(job.grid, initial_conditions)
    before, began = count(), time.perf_counter()
    if job.periods is None:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # warnings of a probe come again for the basin image itself
            periods = find_basins(point_map, grid).cost.steps / grid.size
    else:
        periods = float(job.periods)
        follow(point_map, grid.centres(), job.periods)
    return Trial(grid.size, time.perf_counter() - began, periods, count() - before)


def time_labelling(job: Job, point_map: PointMap, count: Callable[[], int]) -> tuple[Labelling, float, float]:
    """Measure labelling with a small grid and a larger one; also return periods and counted images of an orbit."""
    if job.grid.size <= 2 * FEW:
        whole = label(job, point_map, job.grid.size, count)
        return Labelling(whole.seconds, 0.0), whole.periods, whole.images / whole.initial_conditions
    few = label(job, point_map, FEW, count)
    if few.seconds < SECONDS:
        few = min(few, label(job, point_map, FEW, count), key=lambda trial: trial.seconds)
    most = min(_MANY * thread_count() * BATCH, job.grid.size)
    more, many = few.initial_conditions, few
    # Until labelling takes longer than the search, whose time fluctuates.
    while many is few or (many.initial_conditions < most and many.seconds < max(3.0 * SECONDS, 1.5 * few.seconds)):
        more = min(4 * more, most)
        many = label(job, point_map, more, count)
        if more == most:
            break
    work = (many.seconds - few.seconds) / max(many.effort - few.effort, 1.0)
    if work <= 0.0 or job.periods is not None:
        work = many.seconds / many.effort
    images = (many.images - few.images) / max(many.initial_conditions - few.initial_conditions, 1)
    fixed = max(0.0, few.seconds - work * few.effort)
    return Labelling(fixed, work), many.periods, max(0.0, images)


_MOST_IMAGES = 500_000  # images of the first two tables of an order, at most
_FIRST_SIZE = {1: 64, 2: 32, 3: 12}
_LARGEST_LOOKUPS = 1 << 25  # bytes of the largest table whose look-ups are timed; no cache holds much of it
_SHOWN = 8  # periods over which evaluations of the exact map are counted


def _counting(exact: PointMap) -> tuple[PointMap, Callable[[], int]]:
    """Return a map that counts its images."""
    lock, images = Lock(), [0]

    def advance(orbits: Orbits, periods: int) -> None:
        with lock:
            images[0] += len(orbits) * periods
        exact.advance(orbits, periods)

    return replace(exact, advance=advance), lambda: images[0]


@dataclass(frozen=True)
class _Sample:
    """A small interpolated map, with its errors with and without fallback cells."""

    cells: int
    table: PointMap
    error: float
    raw: float
    fallback: float


def table_probe(job: Job, window: CellGrid, order: int) -> TableProbe | None:
    """Measure interpolated maps of an order; None where no grid that is fine enough can be computed quickly.

    The time of exact images is subtracted, for it depends on the integration method.
    """
    exact, count = _counting(job.finest)
    image = seconds_per_image(job.finest, job.grid)
    samples, surplus = _samples(job, exact, count, window, order, image)
    if not samples:
        return None
    last = samples[-1]
    labelling, periods, images = time_labelling(job, last.table, count)
    lookups = _lookup_times(job.finest, window, order, last.cells)
    # Evaluations of the exact map with smaller grids, relative to the last one, are taken from a few periods.
    least = max(last.fallback, 1.0 / FEW)
    # Differences of times are uncertain; evaluations at neighbouring points are faster than at random ones.
    least_time = 0.5 * periods * lookups[0][1]
    own = max(0.1 * labelling.per_point, least_time, labelling.per_point - images * image)
    return TableProbe(
        order=order,
        cells=tuple(s.cells for s in samples),
        errors=tuple(s.error for s in samples),
        raw=tuple(s.raw for s in samples),
        surplus=surplus,
        labelling=Labelling(labelling.fixed, own),
        fallback=tuple((s.cells, images * max(s.fallback, least) / least) for s in samples),
        lookups=lookups,
    )


def _samples(
    job: Job, exact: PointMap, count: Callable[[], int], window: CellGrid, order: int, image: float
) -> tuple[list[_Sample], float]:
    """Interpolate on finer and finer grids, as long as that is quick; keep those with few fallback cells.

    Also return the seconds for each node, besides those of the exact map.
    """
    samples: list[_Sample] = []
    surplus = 0.0
    n, threads = _FIRST_SIZE.get(window.dimension, 8), thread_count()
    limit = memory_available() // 4
    while True:
        grid = sized(window, n)
        images = number_of_nodes(grid, order) + grid.size
        # An order of convergence needs two sizes, however slow the machine is at the moment.
        long = images > _MOST_IMAGES if len(samples) < 2 else images * (image + surplus) / threads > SECONDS
        if long or table_memory(grid, order) > limit:
            return samples, surplus
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a small grid may well be too coarse
            table = interpolated_map(exact, grid, order, job.outside)
        surplus = max(0.0, table.cost.seconds * threads / images - image)
        if table.table is not None and table.table.fallback.mean() <= 0.5:
            samples.append(_sample(job, table, table.table, n, count))
        n = 2 * n if window.dimension < 3 else (3 * n // 2 if n & (n - 1) == 0 else 4 * n // 3)


def _sample(job: Job, point_map: PointMap, table: CellTable, cells: int, count: Callable[[], int]) -> _Sample:
    places = places_in(table.grid, job.seed)
    everywhere = replace(table, fallback=np.zeros_like(table.fallback))
    raw = replace(point_map, table=everywhere, advance=LookUps(job.finest, [everywhere], job.outside))
    error, raw_error = (percentile_error(m, job.finest, places) for m in (point_map, raw))
    initial_conditions = thinned(job.grid, FEW).centres().reshape(-1, table.grid.dimension)
    before = count()
    follow(point_map, initial_conditions, _SHOWN)
    return _Sample(cells, point_map, error, raw_error, (count() - before) / (_SHOWN * len(initial_conditions)))


def _lookup_times(exact: PointMap, window: CellGrid, order: int, cells: int) -> tuple[tuple[int, float], ...]:
    """Measure look-ups at random places of tables that hold nothing, up to one that no cache holds."""
    found = []
    initial_conditions = np.random.default_rng(0).uniform(window.lower, window.upper, (BATCH, window.dimension))
    grid = sized(window, cells)
    while True:
        shape = (*(n + order for n in grid.shape), grid.dimension)
        coefficients = with_spare_doubles(np.full(shape, 1e-9))
        look_up = LookUps(exact, [CellTable.unexamined(grid, order, coefficients)], "escape")
        seconds = median_seconds(lambda look=look_up: look(Orbits.starting(initial_conditions.copy()), 1))  # type: ignore[misc]
        found.append((table_memory(grid, order), seconds / BATCH))
        cells *= 4 if grid.dimension == 1 else 2
        grid = sized(window, cells)
        if 8 * int(np.prod(grid.shape, dtype=object)) * grid.dimension > _LARGEST_LOOKUPS:
            return tuple(found)


_TRAVEL = 32  # periods of the orbits that determine the window
_LEAVING = 0.002  # fraction of their points that may lie beyond each end of an axis


def measure(job: Job, window: CellGrid | None, say: Callable[[str], object]) -> Measurements:
    """Take all measurements for a plan."""
    say("orbits")
    window, outside = window_of_orbits(job) if window is None else (window.on(job.reference.coordinates), 0.0)
    exact = []
    places = places_in(window, job.seed)
    for (method, tolerance), source in job.sources.items():
        say(f"{method} at {tolerance:.0e}")
        error = percentile_error(source, job.reference, places)
        if source is job.reference:
            error = source.tolerance[1] + source.tolerance[0] * float(np.abs([window.lower, window.upper]).max())
        exact.append(ExactProbe(method, tolerance, error, seconds_per_image(source, job.grid)))
    base = next(e for e in exact if (e.method, e.tolerance) == job.base)
    say("labelling with the exact map")
    label(job, job.sources[job.base], 64, int)  # compiles
    direct, periods, _ = time_labelling(job, job.sources[job.base], int)
    tables = []
    for order in ORDERS:
        say(f"interpolation of order {order}")
        found = table_probe(job, window, order)
        if found is not None:
            tables.append(found)
    return Measurements(
        initial_conditions=job.grid.size,
        periods=periods,
        window=window,
        threads=thread_count(),
        exact=tuple(exact),
        base=base,
        direct=direct,
        tables=tuple(tables),
        free=memory_available(),
        outside=outside,
    )


def window_of_orbits(job: Job) -> tuple[CellGrid, float]:
    """Return a window of the initial conditions and their orbits, and the fraction of points of orbits outside of it.

    It is wider than the grid where more than one point in 500 lies beyond an end of an axis, by at most the grid's
    width at each end.  Divergent orbits are not considered.
    """
    grid, exact = job.grid, job.sources[job.base]
    travel = _TRAVEL if job.periods is None else max(1, min(_TRAVEL, job.periods))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a missed tolerance matters to the labels, not to the window
        orbits = exact.orbit(some_initial_conditions(grid, 1024), travel).points
    points = orbits[:, np.isfinite(orbits[-1]).all(axis=1)].reshape(-1, grid.dimension)
    if not len(points):
        points = some_initial_conditions(grid, 1024)
    turn = turns_of(exact.coordinates)[1]
    around = np.where(turn > 0.0, turn, 1.0)
    points -= np.where(turn > 0.0, around * np.floor((points - grid.lower) / around), 0.0)
    lower, upper, parts = list(grid.lower), list(grid.upper), []
    for j, (a, b, n) in enumerate(zip(grid.lower, grid.upper, grid.shape, strict=True)):
        if turn[j]:
            if np.mean(points[:, j] > b) > _LEAVING:
                upper[j] = a + turn[j]
        else:
            low, high = np.quantile(points[:, j], (_LEAVING, 1.0 - _LEAVING))
            most = b - a if n > 1 else np.inf
            room = 0.05 * (min(max(high, b), b + most) - max(min(low, a), a - most))
            lower[j] = a if low >= a else max(low - room, a - most)
            upper[j] = b if high <= b else min(high + room, b + most)
        parts.append((upper[j] - lower[j]) / (b - a) * n)
    # A slice one cell thick does not determine the resolution across it.
    longest = max(parts)
    shape = [max(1, round(256 * (1.0 if n == 1 else max(p / longest, 0.25))))
             for p, n in zip(parts, grid.shape, strict=True)]  # fmt: skip
    held = ((points >= lower) & (points <= upper)).all(axis=1)
    return CellGrid(tuple(lower), tuple(upper), tuple(shape)).on(exact.coordinates), float(1.0 - held.mean())
