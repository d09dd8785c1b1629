"""Periodic attractors: ends of orbits are refined by Newton's method, and what it finds gets a trapping region."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from ..._lib.arrays import Bools, Floats, Ints, evenly
from ...maps.coordinates import difference
from ...maps.orbit_batch import Orbits
from ...maps.point_map import PointMap
from ...orbits.attractor import Attractor, Kind, Neighbourhood
from ...orbits.newton import newton, stable_orbit
from ..regions.boxes import inside_cover
from ..regions.lyapunov_regions import Afford, always
from ..regions.trapping import still_trapping, trapping_neighbourhood
from ..regions.tube import SAMPLED
from ..settling.settle import Catalogue
from .ends import Ends
from .recurrence import CLOSED, closed_attractors

LOOKED_AT = 256
"""Ends among which those to be refined are chosen."""

_REPRESENTATIVES = 8  # end points that are refined at a time because they lie far apart
_SETTLING = 16  # ends that come back closest, among which as many are chosen
_RETURNS = 4  # likely periods tried for each of them, besides 1,
_SLOW = 1e-3  # unless it moves by less than this part of the extent in a period, and ever farther
_RETURNED = 0.2  # if they bring it back to within this part of the extent, or where derivatives cost more than periods,
_CLOSE = 1e-3  # within this one
_SAME = 1e-4  # part of the extent in which ends that have closed are on one orbit
_CYCLES = 16  # closed orbits of more than one period that are refined at a time


def look(ends: Ends) -> list[Attractor]:
    """Return the periodic attractors to which some ends lead, each with its trapping neighbourhood."""
    point_map, examined = ends.point_map, ends.examined
    for guesses, periods in _guesses(ends):
        if not examined.may_refine(guesses, periods):
            return closed_attractors(point_map.without_table, guesses, periods, ends.known, ends.extent)
        solutions, settled = examined.refined(point_map, guesses, periods)
        good = sorted(np.flatnonzero(settled), key=lambda i: periods[i])
        if found := verified_cycles(ends, [(solutions[i], int(periods[i])) for i in good], refined=True):
            return found
    return []


def verified_cycles(
    ends: Ends, cycles: Iterable[tuple[Floats, int]], found: Sequence[Attractor] = (), refined: bool = False
) -> list[Attractor]:
    """Return new periodic attractors, each with its trapping neighbourhood, beside points that all but close.

    ``cycles``: such points, each with its period, or periodic points that are `refined` already; ``found``: attractors
    that are new as well.
    """
    point_map, examined, extent = ends.point_map, ends.examined, ends.extent
    attractors, catalogue = list[Attractor](), Catalogue.of([*ends.known, *found], point_map)
    for point, period in cycles:
        # A periodic point inside a verified neighbourhood is the attractor that this belongs to.
        if point in examined or _belong(point[None], catalogue, point_map):
            continue
        if not refined:
            solutions, settled = newton(point_map, point[None], np.array([period]), extent, attracting=True)
            if not settled[0] or solutions[0] in examined:
                continue
            point = solutions[0]
        orbit = stable_orbit(point_map, point, period, extent)
        # Where the neighbourhood is narrower than the error of the solution, another point of the orbit may be in.
        if orbit is None or _belong(orbit.points, catalogue, point_map):
            examined.refuse(point[None] if orbit is None else orbit.points)
            continue
        neighbourhood = neighbourhood_of(point_map, orbit, examined.reach, afford=examined.afford)
        if neighbourhood is None:
            examined.refuse(orbit.points)
            continue
        attractors.append(replace(orbit, neighbourhood=neighbourhood))
        examined.verified.append(attractors[-1])
        catalogue = Catalogue.of([*catalogue.attractors, attractors[-1]], point_map)
    return attractors


def _belong(points: Floats, catalogue: Catalogue, point_map: PointMap) -> bool:
    """Tell whether any of some points of an orbit is in the trapping region of an attractor: then it is on that one."""
    tubes = [a.cover for a in catalogue.attractors if a.kind is Kind.QUASIPERIODIC and a.cover is not None]
    return bool((catalogue.owners_of(points) >= 0).any()) or any(
        inside_cover(tube, points, point_map).any() for tube in tubes
    )


def _guesses(look: Ends) -> Iterator[tuple[Floats, Ints]]:
    """Yield guesses of periodic points with their periods: first period 1, then those of the closest returns.

    Guesses are ends that lie far apart, and ends whose orbits come back closest.  In more than four dimensions, where a
    derivative costs many periods, the first ones are ends whose orbits have closed by themselves, one of each orbit.
    """
    point_map, extent, many = look.point_map, look.extent, look.point_map.dimension > SAMPLED
    ends = look.points[evenly(len(look.points), LOOKED_AT)]
    distance = look.examined.return_distances(point_map, ends, look.longest_period)
    if many:
        yield from _closed(ends, distance, extent)
    patience = np.argsort(distance.min(axis=0), kind="stable")
    chosen = _far_apart(ends, np.arange(len(ends)), point_map, extent)
    chosen += [i for i in _far_apart(ends, patience[:_SETTLING], point_map, extent) if i not in chosen]
    ends, distance = ends[chosen], distance[:, chosen]
    yield ends, np.ones(len(ends), np.int64)
    if look.longest_period > 1:
        closest = 2 + np.argsort(distance[1:], axis=0, kind="stable")[:_RETURNS]
        returned = np.take_along_axis(distance, closest - 1, axis=0)
        # One that moves slowly, and away, is beside a fixed point, or on its way to one.
        close = (returned < (_CLOSE if many else _RETURNED)) & ((returned < distance[0]) | (distance[0] > _SLOW))
        rank, row = np.nonzero(close & ~_multiples(closest))
        if len(row):
            yield ends[row], closest[rank, row]


def _closed(ends: Floats, distance: Floats, extent: Floats) -> Iterator[tuple[Floats, Ints]]:
    """Yield ends (n, d) whose orbits have closed, one for each place, with their periods: fixed points first."""
    closed = distance <= CLOSED
    periods = np.where(closed.any(axis=0), 1 + np.argmax(closed, axis=0), 0)
    places = np.round(ends / (_SAME * extent))
    for fixed in (True, False):
        rows = np.flatnonzero((periods == 1) if fixed else (periods > 1))
        rows = np.sort(rows[np.unique(places[rows], axis=0, return_index=True)[1]])[: None if fixed else _CYCLES]
        if len(rows):
            yield ends[rows], periods[rows]


def _multiples(periods: Ints) -> Bools:
    """Tell which periods in each column are multiples of one before them: an orbit near a cycle returns after both."""
    found = np.zeros(periods.shape, bool)
    for earlier in range(len(periods) - 1):
        found[earlier + 1 :] |= periods[earlier + 1 :] % periods[earlier] == 0
    return found


def _far_apart(ends: Floats, rows: Ints, point_map: PointMap, extent: Floats) -> list[int]:
    """Choose rows that lie far apart, each the farthest from those before it, beginning with the first."""
    chosen = [int(rows[0])]
    nearest = np.full(len(rows), np.inf)
    for _ in range(_REPRESENTATIVES - 1):
        shift = difference(ends[rows], ends[chosen[-1]], point_map.coordinates) / extent
        nearest = np.minimum(nearest, (shift**2).sum(axis=-1))
        farthest = int(np.argmax(nearest))
        if nearest[farthest] <= 1e-12:
            break
        chosen.append(int(rows[farthest]))
    return chosen


def neighbourhood_of(
    point_map: PointMap,
    attractor: Attractor,
    extent: Floats,
    like: Neighbourhood | None = None,
    afford: Afford = always,
) -> Neighbourhood | None:
    """Return the trapping region of a periodic attractor, None where there is none or the map does not follow it.

    One that is `like` that of a similar map is returned where it is verified.
    """
    if not _carried(point_map, attractor):
        return None
    again = None if like is None else still_trapping(point_map, attractor, extent, like)
    return trapping_neighbourhood(point_map, attractor, extent, afford) if again is None else again


def _carried(point_map: PointMap, attractor: Attractor) -> bool:
    """Whether the map carries orbits along the attractor; a table that orbits leave does not, where it has no cells."""
    orbit = Orbits.starting(attractor.points.copy())
    point_map.advance(orbit, 1)
    return bool(orbit.alive.all())
