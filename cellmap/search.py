"""The search for attractors: orbits settle, their ends are polished, what is left is examined."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .attractor import Attractor, is_on, same_orbit, sort_key
from .chaos import chaotic_attractors
from .checks import finite_points, whole_number
from .coordinates import difference, turns_of, wrap
from .periodic import newton, stable_orbit
from .pointmap import Orbits, PointMap
from .settling import Catalogue, settle
from .trapping import trapping_neighbourhood

_FIRST_LOOK = 32  # periods before ends are polished for the first time
_REPRESENTATIVES = 8  # ends that are polished at a time
_RETURNS = 4  # likely periods tried for each of them, besides 1


def find_attractors(
    point_map: PointMap,
    starts: ArrayLike,
    max_periods: int = 2000,
    max_period: int = 32,
    known: Sequence[Attractor] = (),
) -> tuple[Attractor, ...]:
    """Find the attractors that orbits from given starts end on.

    Orbits are followed; ends that are spread far apart are polished by Newton's method on the exact map, for the
    periods after which their orbits come closest to themselves; a solution counts where its multipliers prove it
    stable, and gets a verified neighbourhood, with which all other orbits are sorted out.  Orbits that never settle are
    examined for chaos.

    Parameters
    ----------
    point_map : PointMap
        The map that the orbits follow; periodic points are polished on its exact map.
    starts : array_like, shape (..., dimension)
        Starts of the orbits.
    max_periods : int, optional
        Longest orbit.
    max_period : int, optional
        Longest period of a periodic attractor.
    known : sequence of Attractor, optional
        Attractors that need not be found again.

    Returns
    -------
    tuple of Attractor
        In an order that does not depend on the starts: fixed points, periodic, rotating, chaotic.

    Examples
    --------
    >>> from cellmap import discrete_map
    >>> henon = discrete_map(lambda x, p: (1 - p.a * x[0]**2 + x[1], 0.3 * x[0]), {"a": 0.2}, ("x", "y"))
    >>> find_attractors(henon, [[0.0, 0.0], [0.5, 0.5]])
    (Attractor(fixed point (1.09, 0.327) at (1.08945, 0.326836), |multiplier| 0.8074),)
    """
    states = finite_points("starts", starts, point_map.dimension).reshape(-1, point_map.dimension)
    max_periods = whole_number("max_periods", max_periods, at_least=1)
    max_period = whole_number("max_period", max_period, at_least=1)
    extent = region_extent(point_map, states)
    attractors = list(known)
    orbits = Orbits.starting(wrap(states, point_map.coordinates))
    age, horizon = 0, _FIRST_LOOK
    while len(orbits):
        settled = settle(point_map, orbits, Catalogue.of(attractors, point_map), min(horizon, max_periods - age), age)
        age, horizon = min(age + horizon, max_periods), 2 * age if age else horizon
        orbits, attractors = sort_out(point_map, settled.orbits, attractors, max_period, extent, age)
        if age == max_periods:
            break
    if len(orbits):
        attractors += chaotic_attractors(point_map, orbits.points)
    return tuple(sorted(attractors, key=sort_key))


def sort_out(
    point_map: PointMap,
    orbits: Orbits,
    attractors: list[Attractor],
    max_period: int,
    extent: NDArray[np.float64],
    age: int,
) -> tuple[Orbits, list[Attractor]]:
    """Find new attractors from orbits that are left, until a look finds none; return the rest and all attractors."""
    while len(orbits):
        fresh = new_attractors(point_map, orbits.points, attractors, max_period, extent)
        if not fresh:
            break
        attractors = [*attractors, *fresh]
        orbits = settle(point_map, orbits, Catalogue.of(attractors, point_map), 0, age).orbits
    return orbits, attractors


def region_extent(point_map: PointMap, states: NDArray[np.float64]) -> NDArray[np.float64]:
    """Typical size of each coordinate: the turn of an angle, the window of a table, else the span of the starts."""
    turn = turns_of(point_map.coordinates)[1]
    table = point_map.table
    span = np.ptp(states, axis=0) if table is None else np.array(table.grid.upper) - np.array(table.grid.lower)
    magnitude = np.abs(states).max(axis=0)
    span = np.where(span > 0, span, np.where(magnitude > 0, magnitude, 1.0))
    return np.where(turn > 0, turn, span)


def new_attractors(
    point_map: PointMap,
    states: NDArray[np.float64],
    known: Sequence[Attractor],
    max_period: int,
    extent: NDArray[np.float64],
) -> list[Attractor]:
    """Polish some ends of orbits; return the attractors that are not known yet, each with its neighbourhood."""
    ends = states[_spread(states, point_map, extent)]
    for guesses, periods in _likely_returns(point_map, ends, max_period, extent):
        found: list[Attractor] = []
        solutions, settled = newton(point_map, guesses, periods, extent)
        for point, period in zip(solutions[settled], periods[settled], strict=True):
            listed = [*known, *found]
            if any(a.period and is_on(point, a.points, a.coordinates, 1e-6 * extent) for a in listed):
                continue
            attractor = stable_orbit(point_map, point, int(period), extent)
            if attractor is None or any(same_orbit(attractor, a, extent) for a in listed):
                continue
            neighbourhood = trapping_neighbourhood(point_map, attractor, extent)
            if neighbourhood is not None:
                found.append(replace(attractor, neighbourhood=neighbourhood))
        if found:
            return found
    return []


def _spread(states: NDArray[np.float64], point_map: PointMap, extent: NDArray[np.float64]) -> list[int]:
    """Choose rows that lie far apart, each the farthest from those before it."""
    chosen = [0]
    nearest = np.full(len(states), np.inf)
    for _ in range(_REPRESENTATIVES - 1):
        shift = difference(states, states[chosen[-1]], point_map.coordinates) / extent
        nearest = np.minimum(nearest, (shift**2).sum(axis=-1))
        farthest = int(np.argmax(nearest))
        if nearest[farthest] <= 1e-12:
            break
        chosen.append(farthest)
    return chosen


def _likely_returns(
    point_map: PointMap, ends: NDArray[np.float64], max_period: int, extent: NDArray[np.float64]
) -> Iterator[tuple[NDArray[np.float64], NDArray[np.int64]]]:
    """Yield guesses of periodic points with their periods: first period 1, then those of the closest returns."""
    yield ends, np.ones(len(ends), np.int64)
    if max_period == 1:
        return
    orbit = Orbits.starting(ends.copy())
    distance = np.full((max_period + 1, len(ends)), np.inf)
    for q in range(1, max_period + 1):
        point_map.advance(orbit, 1)
        shift = difference(orbit.points, ends, point_map.coordinates) / extent
        distance[q] = np.where(orbit.alive, np.abs(shift).max(axis=-1), np.inf)
    closest = 2 + np.argsort(distance[2:], axis=0, kind="stable")[:_RETURNS]
    likely = np.take_along_axis(distance, closest, axis=0) < 0.2
    rank, row = np.nonzero(likely)
    if len(row):
        yield ends[row], closest[rank, row]
