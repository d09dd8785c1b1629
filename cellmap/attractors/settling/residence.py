"""How long orbits have to stay among the boxes of a chaotic attractor until they count as converged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..._lib.arrays import Floats
from ..._lib.stopping import Stop
from ...maps.orbit_batch import Orbits
from ...maps.point_map import PointMap
from ...orbits.attractor import Attractor, Kind
from ..regions.boxes import full_residence
from ..regions.trapping_boxes import is_trapped, with_trapped_boxes
from .settle import Catalogue, settle_on_threads

OBSERVED = 2048
"""Initial conditions whose orbits show how long those stay that leave; some times as many have to be labelled."""

_TIMES, _MORE = 2, 8  # the longest stay that ended, and periods besides


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
    point_map: PointMap, attractors: Sequence[Attractor], points: Floats, periods: int, stop: Stop | None = None
) -> tuple[Attractor, ...]:
    """Return attractors, the chaotic ones with the periods after which an orbit among their boxes is on them.

    Orbits of points (n, dimension), a sample of initial conditions, are followed until they have been among the boxes
    for 64 periods in a row, or more where chaos is weak, have come to another attractor, or have ended.  Stays of
    orbits that only pass by become rare exponentially with their length: if the longest of n lasts L periods, one of
    2 L has a probability near 1/n^2.  An orbit that stays for 2 L + 8 periods, or as many as these, has converged.

    Of flows, boxes in which orbits have converged at once are looked for first; none is followed if all have some.
    """
    found = with_trapped_boxes(point_map, attractors) if point_map.is_flow else list(attractors)
    if not unobserved(found):
        return tuple(found)
    catalogue = Catalogue.of(found, point_map)
    settled = settle_on_threads(point_map, Orbits.starting(points), catalogue, periods, stop=stop)
    for (number, cover, _), longest in zip(catalogue.covers, settled.stays.tolist(), strict=True):
        if found[number].kind is Kind.CHAOTIC:
            residence = min(_TIMES * longest + _MORE, full_residence(found[number]))
            found[number] = replace(found[number], cover=replace(cover, residence=residence))
    return tuple(found)
