"""How long orbits have to stay among the boxes of a chaotic attractor until they count as converged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..._lib.arrays import Floats
from ...maps.orbit_batch import Orbits
from ...maps.paths import path_of
from ...maps.point_map import PointMap
from ...orbits.attractor import Attractor, Cover, Kind
from ..regions.boxes import box_keys, full_residence, inside_cover
from ..regions.trapping_boxes import is_trapped, with_trapped_boxes

OBSERVED = 2048
"""Initial conditions whose orbits show how long those stay that leave; some times as many have to be labelled."""

_TIMES, _MORE = 2, 8  # the longest stay that ended, and periods besides
_RESIDENT = 0.5  # of the last quarter of the periods, in which orbits on an attractor are among its boxes


def unobserved(attractors: Sequence[Attractor]) -> bool:
    """Tell whether any chaotic attractor waits for its residence to be observed."""
    return any(
        a.kind is Kind.CHAOTIC and a.cover is not None and a.cover.residence is None and not is_trapped(a)
        for a in attractors
    )


def with_full_residence(attractors: Sequence[Attractor]) -> tuple[Attractor, ...]:
    """Return attractors to which the longest residence applies: nothing was observed of these orbits and this map."""
    return tuple(
        replace(a, cover=replace(a.cover, residence=None, trapped=None))
        if a.cover is not None and (a.cover.residence is not None or a.cover.trapped is not None)
        else a
        for a in attractors
    )


def is_same(one: Attractor, other: Attractor) -> bool:
    """Tell whether one record was made from the other, perhaps with another residence."""
    return one.points is other.points


def with_residence(
    point_map: PointMap, attractors: Sequence[Attractor], points: Floats, periods: int
) -> tuple[Attractor, ...]:
    """Return attractors, the chaotic ones with the periods after which an orbit among their boxes is on them.

    Orbits of points (n, dimension), a sample of initial conditions, are followed for some periods.  Those that are not
    among the boxes of an attractor in the end have only passed by.  Such stays become rare exponentially with their
    length: if the longest of n lasts L periods, one of 2 L has a probability near 1/n^2.  An orbit that stays for
    2 L + 8 periods has converged; where fewer than 2048 were followed, one that stays for no fewer than 64, or more
    where chaos is weak.

    Of flows, boxes in which orbits have converged at once are looked for first; none is followed if all have some.
    """
    found = with_trapped_boxes(point_map, attractors) if point_map.is_flow else list(attractors)
    if not unobserved(found) or any(a.symmetry is not None for a in found):
        return tuple(found)
    path = path_of(point_map, Orbits.starting(points), periods)
    for number, attractor in enumerate(found):
        if unobserved([attractor]):
            assert attractor.cover is not None
            least = 0 if len(points) >= OBSERVED else full_residence(attractor)
            residence = max(_TIMES * _longest_stay(attractor.cover, path, point_map) + _MORE, least)
            found[number] = replace(attractor, cover=replace(attractor.cover, residence=residence))
    return tuple(found)


def _longest_stay(cover: Cover, path: Floats, point_map: PointMap) -> int:
    """Return the longest stay among boxes, in periods, of orbits (periods, n, d) that are not among them in the end.

    Orbits on an attractor are out of its boxes now and then, for a sample of it does not show all of them.
    """
    keys = np.sort(box_keys(cover.boxes, cover.corners))
    inside = np.array([inside_cover(cover, points, point_map, keys) for points in path])
    inside = inside[:, inside[-len(path) // 4 :].mean(axis=0) < _RESIDENT]
    longest, now = 0, np.zeros(inside.shape[1], np.int64)
    for row in inside:
        now = np.where(row, now + 1, 0)
        longest = max(longest, int(now.max(initial=0)))
    return longest
