"""Orbits that have not settled: detection of chaotic transients, and the reasons why orbits are undecided."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..._lib.arrays import Bools, Floats, Ints
from ..._lib.stopping import check_stop
from ...maps.orbit_batch import Orbits
from ...maps.paths import path_of
from ...maps.point_map import PointMap
from ...orbits.attractor import Attractor, Kind
from ..regions.boxes import RESIDENCE, full_residence
from ..settling.labels import Label
from ..settling.residence import with_full_residence
from ..settling.settle import Catalogue, settle

HALF = RESIDENCE // 2
"""Periods after half of its way to an attractor in which an orbit is seen to be chaotic or not."""

ENDURANCE = 5
"""Times its age that a chaotic orbit has to last on."""

_RECOGNISED = 4  # times the periods that it takes on a known attractor, in which it is seen to stay there
_STRETCH = 256  # periods between looks
_EARLY = 0.25  # of the periods, in which orbits may still be on their way
_PLACES = 16  # of each orbit, that are kept
_LATEST = 32  # orbits, of those that came to an attractor late
_LOOKS = 4  # from a quarter to half of its way: an orbit on its way is near a chaotic set at all of them hardly ever


class Reason(StrEnum):
    """Why an orbit is undecided."""

    REGULAR = "neither converged nor chaotic so far: the largest exponent is zero within its error"
    LATE = "converges after more periods"
    CREEPING = "creep to rest, ever more slowly"
    ENDING = "escapes or diverges after more periods"
    FADING = "approach a cycle with a multiplier of 1 or -1, by a power of time"
    PERIODIC = "on a periodic orbit that is not verified to attract"
    RESONANT = "drift slowly along a closed curve, close to a resonance"
    PRESERVED = "not chaotic, and volumes do not shrink"
    TORUS = "three or more Lyapunov exponents are nearly zero: slow convergence, or a torus of as many frequencies"
    CONSERVATIVE = "chaotic, but volumes do not shrink"
    TRANSIENT = "chaotic transient"
    RIDDLED = "chaotic beside an invariant subspace, to which orbits come and from which they may go away again"
    KNOWN = "on a known chaotic attractor, for too few periods so far"
    VISITING = "visits a known chaotic attractor without staying"


MORE = "raise max_periods={}"
"""What helps orbits that only have to be followed on."""

REMEDIES = {
    Reason.REGULAR: MORE + ", tell the final states apart by classify_by_features, or add damping if nothing attracts",
    Reason.LATE: MORE,
    Reason.CREEPING: MORE + ", or take them for what they would come to: some never reach the place where they rest",
    Reason.ENDING: MORE,
    Reason.PERIODIC: "take initial conditions beside lines of symmetry, lower rtol and atol of the map, move the "
    "parameters away from the bifurcation, or tell the final states apart by classify_by_features",
    Reason.FADING: "move the parameters away from the bifurcation, or use classify_by_features",
    Reason.RESONANT: "change a parameter a little, so that the rotation number moves away from the resonance",
    Reason.PRESERVED: "there is no attractor to be found: add damping",
    Reason.TORUS: MORE + ", or use classify_by_features: such a torus has no trapping region here",
    Reason.CONSERVATIVE: "there is no attractor to be found: add damping, or use lyapunov_spectrum",
    Reason.TRANSIENT: MORE,
    Reason.RIDDLED: MORE,
    Reason.KNOWN: MORE,
    Reason.VISITING: MORE,
}
"""What helps where orbits are undecided for some reason; the periods that were allowed are to be filled in."""


class UnsettledWarning(UserWarning):
    """Many initial conditions have no attractor."""


@dataclass(frozen=True, eq=False)
class Late:
    """Initial conditions (n, dimension) whose orbits came to attractors that are not chaotic, and in which periods."""

    points: Floats
    times: Ints

    @staticmethod
    def latest(times: NDArray[Any]) -> Ints:
        """Choose those that came last, by the periods of all; -1 where an orbit came to no such attractor."""
        rows = np.argsort(-times, kind="stable")[:_LATEST]
        return np.asarray(rows[times[rows] >= RESIDENCE])

    def halfway(self, point_map: PointMap, attractors: Sequence[Attractor]) -> Floats:
        """Return where the orbits were at some times (times, n, dimension) in the second quarter of their way."""
        if not len(self.points):
            return np.empty((_LOOKS, *self.points.shape))
        catalogue = Catalogue.of(attractors, point_map)
        # An attractor that is found when orbits rest on it has been reached long before.
        times = settle(point_map, Orbits.starting(self.points.copy()), catalogue, int(self.times.max())).times
        places = np.full((_LOOKS, *self.points.shape), np.nan)
        for half in np.unique(times // 2):
            rows = np.flatnonzero(times // 2 == half)
            if half >= HALF:
                orbits, age = Orbits.starting(self.points[rows]), 0
                for look, at in enumerate(np.linspace(half // 2, half, _LOOKS).astype(int).tolist()):
                    point_map.advance(orbits, at - age)
                    places[look, rows], age = orbits.points, at
        return places[:, np.isfinite(places).all(axis=(0, 2))]


def regular(labels: NDArray[Any], attractors: Sequence[Attractor]) -> Bools:
    """Tell which labels are those of attractors that are not chaotic."""
    return np.isin(labels, [k for k, a in enumerate(attractors) if a.kind is not Kind.CHAOTIC])


@dataclass(frozen=True, eq=False)
class FollowedOn:
    """Orbits, followed beyond the periods that they have lasted.

    ``reasons`` (n,): why each is undecided, unless it is lasting; ``lasting``: rows of the orbits that end on no known
    attractor, ``orbits``: their states; ``path`` (times, n, dimension): where they were at some times before;
    ``transients`` (n, periods, dimension): points, before that, of those that came late to a known attractor, if this
    is chaotic or they did not seem so.
    """

    reasons: NDArray[Any]
    lasting: Ints
    orbits: Orbits
    path: Floats
    transients: Floats


def follow_on(point_map: PointMap, points: Floats, chaotic: Bools, known: Sequence[Attractor], age: int) -> FollowedOn:
    """Follow orbits that have lasted for some periods, for five times as long, to see where they end.

    Those that stay among the boxes of a known chaotic attractor from the beginning are on it.  If any chaotic one
    leaves, or ends on an attractor that is not chaotic, none is lasting.
    """
    catalogue = Catalogue.of(with_full_residence(known), point_map)
    strange = np.array([k for k, a in enumerate(known) if a.kind is Kind.CHAOTIC], np.int64)
    periods = max([ENDURANCE * age, *(_RECOGNISED * full_residence(known[k]) for k in strange)])
    owners, times = np.full(len(points), Label.UNDECIDED), np.full(len(points), -1)
    lasting, orbits, path = np.arange(len(points)), Orbits.starting(points.copy()), list[Floats]()
    for begin in range(0, periods, _STRETCH):
        check_stop()
        path.append(np.full(points.shape, np.nan))
        path[-1][lasting] = orbits.points
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
    late = (resident | (~chaotic & (owners >= 0))) & (times >= RESIDENCE)
    before = path_of(point_map, Orbits.starting(points[late].copy()), RESIDENCE - 1)
    kept = np.unique(np.linspace(_EARLY * len(path), len(path), _PLACES).round().astype(np.int64))[:-1]
    places = [*(path[k][lasting] for k in kept), orbits.points]
    return FollowedOn(
        reasons, lasting, orbits, np.array(places), np.concatenate([points[late][None], before]).swapaxes(0, 1)
    )
