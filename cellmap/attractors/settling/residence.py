"""How long orbits have to stay among the boxes of a chaotic attractor until they count as converged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import ceil, log

import numpy as np

from ..._lib.arrays import Bools, Floats
from ..._lib.stopping import check_stop
from ...maps.orbit_batch import Orbits
from ...maps.paths import path_of
from ...maps.point_map import PointMap
from ...orbits.attractor import Attractor, Kind
from ..regions.boxes import RESIDENCE, box_keys, full_residence, inside_cover
from ..regions.trapping_boxes import is_trapped, with_trapped_boxes
from .settle import Catalogue

OBSERVED = 2048
"""Initial conditions whose orbits show how long those stay that leave; some times as many have to be labelled."""

_WATCHED, _TIMES = 256, 4  # periods for which the sample is followed, or as many times as long as orbits have to stay
_TAIL, _MORE = 16, 8  # longest stays that tell how rare longer ones are, and periods besides
_WRONG = 0.1  # stays of all initial conditions that are expected to be longer than an orbit has to stay
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
    point_map: PointMap, attractors: Sequence[Attractor], points: Floats, periods: int, total: int, most: int
) -> tuple[Attractor, ...]:
    """Return attractors, the chaotic ones with the periods after which an orbit among their boxes is on them.

    Orbits of points (n, dimension), a sample of `total` initial conditions, are followed for 256 periods, and for twice
    as long again until that is four times as long as an orbit has to stay, up to some `periods`.  Those that are not
    among the boxes of an attractor in the end have only passed by.  Such stays become rare exponentially with their
    length, as the longest 16 of them show: an orbit has to stay so long that 0.1 longer stays are expected of all
    initial conditions together, twice as long as any that was seen, and `most` periods at most; where fewer than 2048
    were followed, for no fewer than 64 periods, or more where chaos is weak.

    Of flows, boxes in which orbits have converged at once are looked for first; none is followed if all have some.
    """
    found = with_trapped_boxes(point_map, attractors) if point_map.is_flow else list(attractors)
    if not unobserved(found) or any(a.symmetry is not None for a in found):
        return tuple(found)
    covers = {k: a.cover for k, a in enumerate(found) if a.cover is not None and unobserved([a])}
    keys = {k: np.sort(box_keys(cover.boxes, cover.corners)) for k, cover in covers.items()}
    catalogue = Catalogue.of([a for a in found if a.verified], point_map)
    orbits, rows, made, until = Orbits.starting(points), np.arange(len(points)), 0, min(_WATCHED, periods)
    inside = {k: np.zeros((0, len(points)), bool) for k in covers}
    while True:
        for begin in range(made, until, RESIDENCE):
            check_stop()
            path = path_of(point_map, orbits, min(RESIDENCE, until - begin))
            for k, cover in covers.items():
                now = np.zeros((len(path), len(points)), bool)
                now[:, rows] = [inside_cover(cover, places, point_map, keys[k]) for places in path]
                inside[k] = np.concatenate([inside[k], now])
            left = np.flatnonzero(orbits.alive & (catalogue.owners_of(orbits.points) < 0))
            orbits, rows = orbits[left], rows[left]
        made, needed = until, {k: _needed(inside[k], total / len(points)) for k in covers}
        until = min(2 * made, periods)
        if until == made or made >= _TIMES * max(needed.values()):
            break
    for k, cover in covers.items():
        least = 0 if len(points) >= OBSERVED else full_residence(found[k])
        residence = max(min(needed[k], most), least)
        found[k] = replace(found[k], cover=replace(cover, residence=residence))
    return tuple(found)


def _needed(inside: Bools, times: float) -> int:
    """Return for how many periods orbits have to stay among boxes, as shown by a part of them (periods, n).

    There are some `times` as many.  Orbits on an attractor are out of its boxes now and then, for a sample of it does
    not show all of them: their stays do not count, nor do those that go on in the end.
    """
    passing = inside[:, inside[-len(inside) // 4 :].mean(axis=0) < _RESIDENT].T
    changes = np.diff(np.pad(passing, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    begins, ends = (np.nonzero(changes == sign)[1] for sign in (1, -1))
    stays = -np.sort((begins - ends)[ends < len(inside)])[: _TAIL + 1]
    if not len(stays):
        return _MORE
    tail, beyond = stays[:_TAIL], int(stays[_TAIL]) if len(stays) > _TAIL else 0
    mean = float((tail - beyond).mean()) * (1.0 + len(tail) ** -0.5)
    return _MORE + max(2 * int(stays[0]), beyond + ceil(mean * log(len(tail) * times / _WRONG)))
