"""Orbits that nothing bounds: beyond a bound that is a million times as far as the region, and growing as before."""

from __future__ import annotations

import numpy as np

from ..._lib.arrays import Bools, Floats, evenly
from ...maps.coordinates import turns_of
from ...maps.orbit_batch import Orbits
from ...maps.point_map import PointMap
from ...maps.side_by_side import advance_on_threads

_FAR = 1e6  # times as far as a region is large, from where orbits escape that go as many times farther in as long again
_FOLLOWED = 16  # orbits beyond a bound that have to


def far_bound(point_map: PointMap, states: Floats) -> Floats:
    """Return how far from the origin each coordinate of an orbit is once it has left the region of some states behind.

    A coordinate that is 0 has no size of its own.
    """
    turning, size = turns_of(point_map.coordinates)[1] > 0, np.abs(states).max(axis=0)
    size = np.where(size > 0.0, size, np.where(turning, 0.0, size).max() or 1.0)
    with np.errstate(over="ignore"):
        return np.where(turning, np.inf, _FAR * size)


def beyond(points: Floats, bound: Floats) -> Bools:
    """Tell which points (n, d) are beyond a bound; those that are NaN are not."""
    return np.asarray((np.abs(points) > bound).any(axis=1))


def escape(point_map: PointMap, points: Floats, bound: Floats, age: int) -> bool:
    """Tell whether orbits go on as they came, from points (n, d) beyond a bound after so many periods.

    In as many periods more they go as many times farther, or have ended: what grows by a power of time does not, nor an
    orbit that comes back from an excursion, or to an attractor far away.
    """
    some = points[evenly(len(points), _FOLLOWED)]
    far = (np.abs(some) / bound).max(axis=1)
    orbits = Orbits.starting(some.copy())
    advance_on_threads(point_map.without_table.advance, orbits, age)
    farther = (np.abs(orbits.points) / bound).max(axis=1) >= _FAR * far
    return bool(len(some) and (farther | ~orbits.alive).all())


def escape_on(path: Floats, bound: Floats) -> bool:
    """Tell the same of orbits along their path (periods, n, d), NaN from where they have ended.

    What the path is too short for is left open; one orbit at least has to escape, and none to come back.
    """
    size = (np.abs(path) / bound).max(axis=2)
    far = size > 1.0
    first, rows = far.argmax(axis=0), np.arange(size.shape[1])
    known = far.any(axis=0) & (2 * first < len(path))
    later = size[np.minimum(2 * first, len(path) - 1), rows]
    goes_on = np.isnan(later) | (later >= _FAR * size[first, rows])
    return bool(known.any() and goes_on[known].all())
