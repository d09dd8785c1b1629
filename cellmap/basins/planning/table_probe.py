"""Measurements on coarse interpolation grids: errors, fallback cells, and the time of an evaluation."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from threading import Lock

import numpy as np

from ..._lib.memory import memory_available
from ..._lib.threads import thread_count
from ...maps.cell_table import CellTable
from ...maps.grid import CellGrid
from ...maps.interpolation.interpolated import interpolated_map, table_memory
from ...maps.interpolation.look_ups import LookUps
from ...maps.interpolation.spline_coefficients import number_of_nodes, with_spare_doubles
from ...maps.orbit_batch import Orbits
from ...maps.point_map import PointMap, follow
from .extrapolation import sized
from .job import Job, percentile_error, places_in
from .measurements import Labelling, TableProbe
from .timing import BATCH, FEW, SECONDS, median_seconds, seconds_per_image, thinned, time_labelling

_MOST_IMAGES = 500_000  # of the first two tables of an order
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
