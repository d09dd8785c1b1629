"""Units of coordinates: how large the region of some initial conditions is, and how far their orbits go."""

from __future__ import annotations

import numpy as np

from ..._lib.arrays import Floats, evenly
from ...maps.coordinates import turns_of, wrap
from ...maps.orbit_batch import Orbits, Status
from ...maps.paths import path_of
from ...maps.point_map import PointMap

_LARGEST = 1e100  # size of a region, and its inverse the smallest: products of sizes are numbers
_FOLLOWED = 64  # orbits from which it is seen how far orbits go,
_FOR = 32  # periods at first, and up to four times as many where all orbits go ever farther
_MOST = 0.9  # of them, in the order of how far they go
_AWAY = 1.75  # times farther in twice as many periods go orbits that drift, by 2 times, or diverge
_TINY = 0.1  # of the ways of orbits: regions that are smaller say nothing of the size of attractors
_AT_REST = 1e-6  # of the place or of the longest way: shorter ways of coordinates may be rounding


def ways_of(point_map: PointMap, states: Floats) -> tuple[Floats, Floats]:
    """Return how far orbits of some states go along each coordinate, 0 if that is not known, and their path.

    Orbits that end, drift or diverge do not count, and there are none with a table, whose window they do not leave.
    Those that have come to 1e100 are not on the path.
    """
    turning, nowhere = turns_of(point_map.coordinates)[1] > 0, np.zeros(point_map.dimension)
    if point_map.table is not None:
        return nowhere, np.empty((1, 0, point_map.dimension))
    orbits = Orbits.starting(wrap(states[evenly(len(states), _FOLLOWED)], point_map.coordinates))
    path, periods = orbits.points[None].copy(), _FOR
    while True:
        path = np.concatenate([path, path_of(point_map, orbits, periods + 1 - len(path))])
        early, ways = np.ptp(path[: periods // 2 + 1], axis=0), np.ptp(path, axis=0)
        moves = ways > _AT_REST * ways.max(axis=1, keepdims=True)
        staying = orbits.alive & ~(moves & ~turning & (ways > _AWAY * early)).any(axis=1)
        over = orbits.status == Status.DIVERGED
        if staying.any():
            return np.where(turning, 0.0, np.quantile(ways[staying], _MOST, axis=0)), path[:, ~over]
        if periods >= 4 * _FOR or not orbits.alive.any():
            return nowhere, path[:, ~over]
        periods *= 2


def region_extent(point_map: PointMap, states: Floats, ways: Floats | None = None) -> Floats:
    """Return the typical size of each coordinate: period of an angle, window of a table, else span of the states.

    A coordinate that a slice fixes, or whose span is tiny against the `ways` of orbits, has the size of these.
    """
    turn, table, span = turns_of(point_map.coordinates)[1], point_map.table, np.ptp(states, axis=0)
    ways, magnitude = ways_of(point_map, states)[0] if ways is None else ways, np.abs(states).max(axis=0)
    size = span if table is None else np.array(table.grid.upper) - np.array(table.grid.lower)
    size = np.where(size > 0, size, np.where(magnitude > 0, magnitude, 1.0))
    # A single state may be on an attractor already, and its ways tell how exactly.
    fixed = (span == 0) & (span > 0).any() & (ways > _AT_REST * np.maximum(magnitude, ways.max()))
    size = np.where(fixed | (size < _TINY * ways), ways, size)
    return np.where(turn > 0, turn, np.clip(size, 1.0 / _LARGEST, _LARGEST))


def extent_of_motion(extent: Floats, ways: Floats) -> Floats:
    """Return the extent of a region, four times as much larger as the ways of orbits are longer.

    Of the coordinates that a slice fixes, and of a window that is tiny against the motion, the extent of the states
    says nothing about that of basins: there the largest half-width of a trapping region, a quarter of what is returned,
    is about the way that orbits go.
    """
    return np.where(ways < extent, extent, 4.0 * ways - 3.0 * np.where(extent == ways, 0.0, extent))
