"""Orbits that have not settled: detection of chaotic transients, and the reasons why orbits are undecided."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._lib.stopping import check_stop
from ..maps.orbit_batch import Orbits
from ..maps.point_map import PointMap
from ..orbits.attractor import Attractor, Kind
from .labels import Label
from .settling import RESIDENCE, Catalogue, settle

_ENDURANCE = 5  # times its age that a chaotic orbit has to last on
_RECOGNISED = 4 * RESIDENCE  # and periods in which one on a known chaotic attractor is seen to stay there
_STRETCH = 256  # periods between looks


class Reason(StrEnum):
    """Why an orbit is undecided."""

    REGULAR = "not converged, and not clearly chaotic"
    LATE = "converges after more periods"
    CREEPING = "creep to rest, ever more slowly"
    ENDING = "escapes or diverges after more periods"
    PERIODIC = "on a periodic orbit that is not verified to attract"
    PRESERVED = "not chaotic, and volumes do not shrink"
    TORUS = "three or more Lyapunov exponents are nearly zero: slow convergence, or a torus of as many frequencies"
    CONSERVATIVE = "chaotic, but volumes do not shrink"
    TRANSIENT = "chaotic transient"
    KNOWN = f"on a known chaotic attractor, for less than {RESIDENCE} periods"
    VISITING = "visits a known chaotic attractor without staying"


@dataclass(frozen=True, eq=False)
class FollowedOn:
    """Orbits, followed beyond the periods that they have lasted.

    ``reasons`` (n,): why each is undecided, unless it is lasting; ``lasting``: rows of the orbits that end on no known
    attractor, ``orbits``: their states; ``transients``: points of those that came to a known chaotic attractor late,
    before they did.
    """

    reasons: NDArray[Any]
    lasting: NDArray[np.int64]
    orbits: Orbits
    transients: tuple[NDArray[np.float64], ...]


def follow_on(
    point_map: PointMap,
    points: NDArray[np.float64],
    chaotic: NDArray[np.bool_],
    known: Sequence[Attractor],
    age: int,
) -> FollowedOn:
    """Follow orbits that have lasted for some periods, for five times as long, to see where they end.

    Those that stay among the boxes of a known chaotic attractor from the beginning are on it.  If any chaotic one
    leaves, or ends on an attractor that is not chaotic, none is lasting.
    """
    catalogue = Catalogue.of(known, point_map)
    strange = np.array([k for k, a in enumerate(known) if a.kind is Kind.CHAOTIC], np.int64)
    periods = max(_ENDURANCE * age, _RECOGNISED if len(strange) else 0)
    owners, times = np.full(len(points), Label.UNDECIDED), np.full(len(points), -1)
    lasting, orbits = np.arange(len(points)), Orbits.starting(points.copy())
    for begin in range(0, periods, _STRETCH):
        check_stop()
        settled = settle(point_map, orbits, catalogue, min(_STRETCH, periods - begin), begin)
        owners[lasting], times[lasting] = settled.labels, settled.times
        lasting, orbits = lasting[settled.undecided], settled.orbits
        if (chaotic & (owners != Label.UNDECIDED) & ~np.isin(owners, strange)).any():
            lasting, orbits = lasting[:0], orbits[:0]
        if not len(lasting):
            break
    reasons = np.where(owners >= 0, Reason.LATE, Reason.ENDING).astype(object)
    reasons[chaotic | (owners == Label.UNDECIDED)] = Reason.TRANSIENT
    resident = np.isin(owners, strange)
    reasons[resident] = np.where(times[resident] < RESIDENCE, Reason.KNOWN, Reason.TRANSIENT)
    late = resident & (times >= RESIDENCE)
    before = np.empty((RESIDENCE, np.count_nonzero(late), point_map.dimension))
    orbit = Orbits.starting(points[late].copy())
    for k in range(RESIDENCE):
        before[k] = orbit.points
        point_map.advance(orbit, 1)
    return FollowedOn(reasons, lasting, orbits, tuple(before.swapaxes(0, 1)))
