"""Orbits that come to rest so slowly that they are seen to move: where they creep to, and how fast."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._lib.arrays import Bools, Floats
from .._lib.stopping import check_stop
from ..maps.coordinates import difference, wrap
from ..maps.orbit_batch import Orbits
from ..maps.point_map import PointMap
from ..maps.side_by_side import advance_on_threads

_PERIODS = 16  # the ways of as many are compared with those of as many that follow
_SEEN = 1e-12  # least way that is no rounding, in units of the region
_STRAIGHT = 0.9  # least cosine of the angle between them
_SLOW = 1e-4  # largest move in a period, in units of the region, and
_NEAR = 0.02  # of all moves that are still ahead
_POWERS = (1.0, 1.5, 2.0, 3.0)  # the way ahead, in units of what it is where moves shrink by the same factor
_RELAXING = 64  # periods in which an orbit from where it would rest comes to the curve along which it creeps
_STILL = 0.1  # largest move of the place where an orbit would rest, in units of the move of the orbit


@dataclass(frozen=True, eq=False)
class Creeping:
    """Which orbits creep, and where they would come to rest.

    ``found`` (n,): whether orbits creep; ``moves`` (n,): how far they move in a period, the largest coordinate;
    ``ends`` (n, d): the places where they would come to rest, NaN for the others.
    """

    found: Bools
    moves: Floats
    ends: Floats


def creeping(point_map: PointMap, states: Floats, extent: Floats) -> Creeping:
    """Tell which orbits creep from some states (n, d) on, in a region of some size (d,).

    An orbit creeps if it moves slowly, straight on and ever less, towards a place ahead that moves much less than it
    does.  Such orbits come to the edge of a sticking set, or to a neutral point, from which they are as far after n
    periods as a power of 1/n; others come to a node whose multiplier is nearly 1.
    """
    coordinates, size = point_map.coordinates, np.asarray(extent, dtype=float)
    before, middle = _moved(point_map, states, 1), _moved(point_map, states, _PERIODS)
    after = _moved(point_map, middle, _PERIODS)
    first, second = (difference(b, a, coordinates) / size for a, b in ((states, middle), (middle, after)))
    move = np.abs(difference(before, states, coordinates))
    ways, lasting = np.linalg.norm(first, axis=1), np.linalg.norm(second, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        straight = (first * second).sum(axis=1) >= _STRAIGHT * ways * lasting
        ahead = ways / (1.0 - lasting / ways)
        slow = (move / size).max(axis=1) <= _SLOW
        found = (lasting > _SEEN) & (lasting < ways) & straight & slow & (ahead <= _NEAR)
    ends, least = np.full(states.shape, np.nan), _STILL * (move / size).max(axis=1)
    for power in _POWERS:
        rows = np.flatnonzero(found)
        far = power * ahead[rows]
        places = states[rows] + (far / ways[rows])[:, None] * first[rows] * size
        places = wrap(places, coordinates)
        # The way is straight only almost: what is beside it comes to it first.
        there = _moved(point_map, places, _RELAXING)
        moved = np.abs(difference(_moved(point_map, there, 1), there, coordinates) / size).max(axis=1)
        aside = np.linalg.norm(difference(there, places, coordinates) / size, axis=1)
        better = (moved <= least[rows]) & (aside <= far)
        ends[rows[better]], least[rows[better]] = there[better], moved[better]
    return Creeping(np.isfinite(ends).all(axis=1), move.max(axis=1), ends)


def _moved(point_map: PointMap, states: Floats, periods: int) -> Floats:
    """Return images of states, NaN where there is none."""
    check_stop()
    orbits = Orbits.starting(states.copy())
    advance_on_threads(point_map.advance, orbits, periods)
    return np.where(orbits.alive[:, None], orbits.points, np.nan)
