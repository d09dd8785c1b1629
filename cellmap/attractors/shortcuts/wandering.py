"""Orbits that wander over the same chaotic sets as others, which are evidence enough."""

from __future__ import annotations

import numpy as np

from ..._lib.arrays import Floats, Ints, evenly
from ...maps.orbit_batch import Orbits
from ...maps.paths import path_of
from ...maps.point_map import PointMap
from ..kinds.chaos import EXPONENT_PERIODS, tested
from ..kinds.clouds import Clouds, pieces_of
from ..kinds.ends import ORBITS
from ..kinds.transients import Reason
from ..regions.boxes import BOXES
from ..regions.covers import lattice

FEWEST = 512
"""Orbits from which on it is worthwhile to leave some out."""

_FIRST = 8  # orbits whose exponents fill a vector
_KEPT = 256  # orbits of each set
_SAMPLED = 256  # periods of the orbits that show where the sets are


def are_chaotic(point_map: PointMap, points: Floats, extent: Floats) -> bool:
    """Tell whether exponents of 32 of some orbits (n, dimension), evenly spread, show that all of these are chaotic.

    Eight of them are tried first, which show most often that they are not.
    """
    chosen = points[evenly(len(points), ORBITS)]
    first = np.isin(np.arange(len(chosen)), evenly(len(chosen), _FIRST))
    return all(
        (tested(point_map, some, extent, EXPONENT_PERIODS, unanimous=True)[1] == Reason.TRANSIENT).all()
        for some in (chosen[first], chosen[~first])
        if len(some)
    )


def representatives(point_map: PointMap, points: Floats, extent: Floats) -> Ints:
    """Return the rows of chaotic orbits (n, dimension) that stand for all.

    Points of 32 of them show the sets over which they wander: of the orbits on each set 256 are kept, evenly spread,
    for on one set all have the same future on average.  Those that are on none are kept, too.
    """
    everyone = np.arange(len(points))
    orbits = Orbits.starting(points[evenly(len(points), ORBITS)])
    history = path_of(point_map, orbits, _SAMPLED)
    if len(points) < FEWEST or not orbits.alive.all():
        return everyone
    widths = lattice(history.reshape(-1, point_map.dimension), point_map, extent)[1]
    clouds = Clouds(point_map, list(history.swapaxes(0, 1)), BOXES * widths)
    place = clouds.place_of(pieces_of(point_map, points), clouds.group)
    sets = [np.flatnonzero(place == g) for g in np.unique(place[place >= 0])]
    kept = [rows[evenly(len(rows), _KEPT)] for rows in sets]
    return np.sort(np.concatenate([np.flatnonzero(place < 0), *kept]))
