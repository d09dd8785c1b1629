"""Guesses of periodic points among the ends of orbits, and of their periods."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .._lib.arrays import Bools, Floats, Ints
from ..maps.coordinates import difference
from ..maps.point_map import PointMap
from .examined import Examined

LOOKED_AT = 256
"""Ends among which those to be refined are chosen."""

_REPRESENTATIVES = 8  # end points that are refined at a time because they lie far apart
_SETTLING = 16  # ends that come back closest, among which as many are chosen
_RETURNS = 4  # likely periods tried for each of them, besides 1,
_RETURNED = 0.2  # if they bring it back to within this part of the extent


def guesses_of(
    point_map: PointMap, states: Floats, longest_period: int, extent: Floats, examined: Examined
) -> Iterator[tuple[Floats, Ints]]:
    """Yield guesses of periodic points with their periods: first period 1, then those of the closest returns.

    Guesses are ends that lie far apart, and ends whose orbits come back closest.
    """
    ends = states[np.unique(np.linspace(0, len(states) - 1, LOOKED_AT).round().astype(np.int64))]
    distance = examined.return_distances(point_map, ends, longest_period)
    patience = np.argsort(distance.min(axis=0), kind="stable")
    chosen = _far_apart(ends, np.arange(len(ends)), point_map, extent)
    chosen += [i for i in _far_apart(ends, patience[:_SETTLING], point_map, extent) if i not in chosen]
    ends, distance = ends[chosen], distance[:, chosen]
    yield ends, np.ones(len(ends), np.int64)
    if longest_period > 1:
        closest = 2 + np.argsort(distance[1:], axis=0, kind="stable")[:_RETURNS]
        close = np.take_along_axis(distance, closest - 1, axis=0) < _RETURNED
        rank, row = np.nonzero(close & ~_multiples(closest))
        if len(row):
            yield ends[row], closest[rank, row]


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
