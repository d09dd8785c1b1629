"""Small measurements on this machine, from which a plan is made."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from .basin_finding import find_basins
from .checks import memory_available
from .coordinates import difference, turns_of
from .cost_model import ExactProbe, Labelling, Measurements, TableProbe, parallel, sized
from .grid import CellGrid, grid_points
from .interpolated import interpolated_map, table_memory
from .kernels.contraction import WIDTH
from .look_ups import LookUps
from .orbit_batch import Orbits
from .pointmap import CellTable, PointMap, follow
from .spline_coefficients import ORDERS, tabulated_nodes
from .stroboscopic import SMALLEST_TOLERANCE, stroboscopic_map
from .system import ForcedSystem
from .threads import run_over, slices, thread_count

Source = tuple[str, float]
"""Method and tolerance of an exact map."""

_TOLERANCES = (1e-4, 1e-7, 1e-10, 1e-13)
_LOOSE = (1e-4, 1e-7)  # of RK45, which takes too many steps for more
_JUMPING = (1e-6, 1e-10)  # of right-hand sides that jump, whose kernels take long to compile
_BASE = 1e-7  # about what starts are labelled with in probes
_PLACES = 4096  # random places at which errors are measured
_BATCH = 16384
_FEW = 1600  # starts of the small picture
_MANY = 4  # slices of work of the larger one, at most, for each thread
_MOST_IMAGES = 500_000  # of the first two tables of an order
_SECONDS = 0.3  # for one probe, about
_FIRST_SIZE = {1: 64, 2: 32, 3: 12}
_LARGEST_LOOKUPS = 1 << 25  # bytes of the largest table whose look-ups are timed; no cache holds much of it
_TRAVEL = 32  # periods after which orbits have shown where they go
_LEAVING = 0.002  # share of their points that may lie beyond each end of an axis


@dataclass(frozen=True, eq=False)
class Job:
    """A picture that is planned: exact maps by method and tolerance, the most precise one, and what is to be done."""

    sources: Mapping[Source, PointMap]
    reference: PointMap
    grid: CellGrid
    periods: int | None
    outside: str
    seed: int

    @property
    def base(self) -> Source:
        """The way to integrate by which starts are labelled in probes."""
        return min(self.sources, key=lambda s: (s[0] == "RK45", abs(np.log(s[1] / _BASE)), s[0] == "DOP853"))

    @property
    def finest(self) -> PointMap:
        """The map of which tables are made in probes, so that what they show is the error of interpolation."""
        return self.sources[min(self.sources, key=lambda s: (s[0] == "RK45", s[1], s[0] == "DOP853"))]


def exact_maps(system: ForcedSystem | PointMap, phase: float) -> tuple[dict[Source, PointMap], PointMap]:
    """Return the exact maps that come into question, and the most precise one."""
    if isinstance(system, PointMap):
        name = system.recipe.get("method", system.recipe.get("kind", "map"))
        return {(str(name), max(system.tolerance)): system}, system
    reference = stroboscopic_map(system, phase, SMALLEST_TOLERANCE, SMALLEST_TOLERANCE)
    usual = str(reference.recipe["method"])
    wanted: dict[str, tuple[float, ...]] = {usual: _JUMPING}
    if system.switches is None:
        wanted = {usual: _TOLERANCES, "DOP853": _TOLERANCES, "RK45": _LOOSE}
    found = {(m, tol): stroboscopic_map(system, phase, tol, tol, m) for m, tols in wanted.items() for tol in tols}
    return found, reference


def measure(job: Job, window: CellGrid | None, say: Callable[[str], object]) -> Measurements:
    """Take all measurements for a picture."""
    say("orbits")
    window, outside = window_of_orbits(job) if window is None else (window.on(job.reference.coordinates), 0.0)
    exact = []
    places = places_in(window, job.seed)
    for (method, tolerance), source in job.sources.items():
        say(f"{method} at {tolerance:.0e}")
        error = percentile_error(source, job.reference, places)
        if source is job.reference:
            error = source.tolerance[1] + source.tolerance[0] * float(np.abs([window.lower, window.upper]).max())
        exact.append(ExactProbe(method, tolerance, error, _seconds_per_image(source, job.grid)))
    base = next(e for e in exact if (e.method, e.tolerance) == job.base)
    say("labelling by the exact map")
    _label(job, job.sources[job.base], 64, int)  # compiles
    direct, periods, _ = _labelling(job, job.sources[job.base], int)
    tables = []
    for order in ORDERS:
        say(f"tables of order {order}")
        found = _table_probe(job, window, order)
        if found is not None:
            tables.append(found)
    return Measurements(
        starts=job.grid.size,
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


def percentile_error(one: PointMap, other: PointMap, places: NDArray[np.float64]) -> float:
    """Return the 99th percentile of the largest component by which images differ, where both maps have one."""
    shift = difference(follow(one, places, 1).points, follow(other, places, 1).points, one.coordinates)
    errors = np.abs(shift).max(axis=-1)
    errors = errors[np.isfinite(errors)]
    return float(np.quantile(errors, 0.99)) if errors.size else float("inf")


def places_in(window: CellGrid, seed: int) -> NDArray[np.float64]:
    """Return random places of a window."""
    return np.random.default_rng(seed).uniform(window.lower, window.upper, (_PLACES, window.dimension))


def _starts(grid: CellGrid, count: int) -> NDArray[np.float64]:
    """Return some starts of a picture, in its order."""
    some = grid.size > count
    rows = np.sort(np.random.default_rng(0).choice(grid.size, count, replace=False)) if some else np.arange(grid.size)
    return grid_points([grid.axis(j) for j in range(grid.dimension)], rows)


def _seconds_per_image(source: PointMap, grid: CellGrid) -> float:
    """Return seconds of one thread for an image, with all threads at work."""
    starts = _starts(grid, _BATCH)
    threads = thread_count()
    parts = slices(len(starts), -(-len(starts) // threads))

    def once() -> None:
        run_over(parts, lambda part: source.advance(Orbits.starting(starts[part].copy()), 1))

    source.advance(Orbits.starting(starts[:16].copy()), 1)  # compiles
    return median_seconds(once) * min(threads, len(parts)) / len(starts)


def median_seconds(work: Callable[[], object]) -> float:
    """Return how long some work takes, undisturbed by a single pause."""
    taken: list[float] = []
    while len(taken) < 3 and (not taken or sum(taken) < _SECONDS):
        began = time.perf_counter()
        work()
        taken.append(time.perf_counter() - began)
    return max(float(np.median(taken)), 1e-9)


def window_of_orbits(job: Job) -> tuple[CellGrid, float]:
    """Return a window that holds the picture and its orbits, and the share of their points that it does not hold.

    It is wider than the picture where more than one point in 500 lies beyond an end of an axis, by at most the width of
    the picture at each end.  Orbits that are on their way to infinity are none of its business.
    """
    grid, exact = job.grid, job.sources[job.base]
    travel = _TRAVEL if job.periods is None else max(1, min(_TRAVEL, job.periods))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a missed tolerance matters to the picture, not to its window
        orbits = exact.orbit(_starts(grid, 1024), travel).points
    points = orbits[:, np.isfinite(orbits[-1]).all(axis=1)].reshape(-1, grid.dimension)
    if not len(points):
        points = _starts(grid, 1024)
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
    # Where the picture is a slice one cell thick, it does not tell how fine the table has to be across it.
    longest = max(parts)
    shape = [max(1, round(256 * (1.0 if n == 1 else max(p / longest, 0.25))))
             for p, n in zip(parts, grid.shape, strict=True)]  # fmt: skip
    held = ((points >= lower) & (points <= upper)).all(axis=1)
    return CellGrid(tuple(lower), tuple(upper), tuple(shape)).on(exact.coordinates), float(1.0 - held.mean())


def _thinned(grid: CellGrid, count: int) -> CellGrid:
    """Return the picture with about so many starts."""
    if grid.size <= count:
        return grid
    wide = sum(n > 1 for n in grid.shape)
    factor = (count / grid.size) ** (1.0 / wide)
    return CellGrid(grid.lower, grid.upper, tuple(max(1, round(n * factor)) for n in grid.shape))


@dataclass(frozen=True)
class _Trial:
    """A small picture that was labelled: its starts, seconds, periods a start, and images that were counted."""

    starts: int
    seconds: float
    periods: float
    images: int

    @property
    def effort(self) -> float:
        """Starts of the busiest thread."""
        return self.starts / parallel(self.starts, thread_count())


def _label(job: Job, point_map: PointMap, starts: int, count: Callable[[], int]) -> _Trial:
    """Label a thinned picture, or iterate it."""
    grid = _thinned(job.grid, starts)
    before, began = count(), time.perf_counter()
    if job.periods is None:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # what they say of a probe, the picture will say of itself
            periods = find_basins(point_map, grid).cost.steps / grid.size
    else:
        periods = float(job.periods)
        follow(point_map, grid.centres(), job.periods)
    return _Trial(grid.size, time.perf_counter() - began, periods, count() - before)


def _labelling(job: Job, point_map: PointMap, count: Callable[[], int]) -> tuple[Labelling, float, float]:
    """Measure labelling by a small picture and a larger one; also return periods and counted images of a start."""
    if job.grid.size <= 2 * _FEW:
        whole = _label(job, point_map, job.grid.size, count)
        return Labelling(whole.seconds, 0.0), whole.periods, whole.images / whole.starts
    few = _label(job, point_map, _FEW, count)
    if few.seconds < _SECONDS:
        few = min(few, _label(job, point_map, _FEW, count), key=lambda trial: trial.seconds)
    most = min(_MANY * thread_count() * _BATCH, job.grid.size)
    more, many = few.starts, few
    # Until the starts cost more than the search, lest their cost is lost in its noise.
    while many is few or (many.starts < most and many.seconds < max(3.0 * _SECONDS, 1.5 * few.seconds)):
        more = min(4 * more, most)
        many = _label(job, point_map, more, count)
        if more == most:
            break
    work = (many.seconds - few.seconds) / max(many.effort - few.effort, 1.0)
    if work <= 0.0 or job.periods is not None:
        work = many.seconds / many.effort
    images = (many.images - few.images) / max(many.starts - few.starts, 1)
    fixed = max(0.0, few.seconds - work * few.effort)
    return Labelling(fixed, work), many.periods, max(0.0, images)


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
    """A small table, with its errors with and without the exact map in the place of rough cells."""

    cells: int
    table: PointMap
    error: float
    raw: float
    fallback: float


def _table_probe(job: Job, window: CellGrid, order: int) -> TableProbe | None:
    """Measure tables of an order; None where none that is fine enough to serve is soon made.

    What exact images cost on the way is taken out of the times, for it depends on how they are made.
    """
    exact, count = _counting(job.finest)
    image = _seconds_per_image(job.finest, job.grid)
    samples, surplus = _samples(job, exact, count, window, order, image)
    if not samples:
        return None
    last = samples[-1]
    labelling, periods, images = _labelling(job, last.table, count)
    lookups = _lookup_times(job.finest, window, order, last.cells)
    # Smaller tables differ from the last one in what they leave to the exact map as they do over a few periods.
    least = max(last.fallback, 1.0 / _FEW)
    # Differences of times are uncertain; neighbours are looked up at neighbouring places, faster than random ones.
    least_time = 0.5 * periods * lookups[0][1]
    own = max(0.1 * labelling.per_start, least_time, labelling.per_start - images * image)
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
    """Tabulate larger and larger tables, as long as that is soon done; keep those that do most of the work.

    Also return the seconds that tabulating takes for each image, besides those of the exact map.
    """
    samples: list[_Sample] = []
    surplus = 0.0
    n, threads = _FIRST_SIZE.get(window.dimension, 8), thread_count()
    limit = (memory_available() or 1 << 32) // 4
    while True:
        grid = sized(window, n)
        images = tabulated_nodes(grid, order) + grid.size
        # An order of convergence needs two sizes, however slow the machine is at the moment.
        long = images > _MOST_IMAGES if len(samples) < 2 else images * (image + surplus) / threads > _SECONDS
        if long or table_memory(grid, order) > limit:
            return samples, surplus
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a small table may well be too coarse
            table = interpolated_map(exact, grid, order, job.outside)
        surplus = max(0.0, table.cost.seconds * threads / images - image)
        if table.table is not None and table.table.rough.mean() <= 0.5:
            samples.append(_sample(job, table, table.table, n, count))
        n = 2 * n if window.dimension < 3 else (3 * n // 2 if n & (n - 1) == 0 else 4 * n // 3)


def _sample(job: Job, point_map: PointMap, table: CellTable, cells: int, count: Callable[[], int]) -> _Sample:
    places = places_in(table.grid, job.seed)
    everywhere = replace(table, rough=np.zeros_like(table.rough))
    raw = replace(point_map, table=everywhere, advance=LookUps(job.finest, [everywhere], job.outside))
    error, raw_error = (percentile_error(m, job.finest, places) for m in (point_map, raw))
    starts = _thinned(job.grid, _FEW).centres().reshape(-1, table.grid.dimension)
    before = count()
    follow(point_map, starts, _TRAVEL // 4)
    return _Sample(cells, point_map, error, raw_error, (count() - before) / (_TRAVEL // 4 * len(starts)))


def _lookup_times(exact: PointMap, window: CellGrid, order: int, cells: int) -> tuple[tuple[int, float], ...]:
    """Measure look-ups at random places of tables that hold nothing, up to one that no cache holds."""
    found = []
    starts = np.random.default_rng(0).uniform(window.lower, window.upper, (_BATCH, window.dimension))
    grid = sized(window, cells)
    while True:
        shape = (*(n + order for n in grid.shape), grid.dimension)
        size = int(np.prod(shape, dtype=object))
        coefficients = np.full(size + WIDTH, 1e-9)[:size].reshape(shape)
        empty = CellTable(grid, order, coefficients, np.zeros(0, np.float32), np.zeros((0,) * grid.dimension, bool))
        look_up = LookUps(exact, [empty], "escape")
        seconds = median_seconds(lambda look=look_up: look(Orbits.starting(starts.copy()), 1))  # type: ignore[misc]
        found.append((table_memory(grid, order), seconds / _BATCH))
        cells *= 4 if grid.dimension == 1 else 2
        grid = sized(window, cells)
        if 8 * int(np.prod(grid.shape, dtype=object)) * grid.dimension > _LARGEST_LOOKUPS:
            return tuple(found)
