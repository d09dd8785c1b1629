"""Small measurements on this machine, on which a plan is based."""

from __future__ import annotations

import warnings
from collections.abc import Callable

import numpy as np

from ..._lib.memory import memory_available
from ..._lib.threads import thread_count
from ...maps.coordinates import turns_of
from ...maps.grid import CellGrid
from ...maps.interpolation.spline_coefficients import ORDERS
from .job import Job, percentile_error, places_in, some_initial_conditions
from .measurements import ExactProbe, Measurements
from .table_probe import table_probe
from .timing import label, seconds_per_image, time_labelling

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
