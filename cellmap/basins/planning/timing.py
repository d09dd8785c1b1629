"""Timing of maps and of small grids of initial conditions on this machine."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..._lib.threads import run_over, slices, thread_count
from ...maps.grid import CellGrid
from ...maps.orbit_batch import Orbits
from ...maps.point_map import PointMap, follow
from ..finding import find_basins
from .job import Job, some_initial_conditions
from .measurements import Labelling
from .options import parallel

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
