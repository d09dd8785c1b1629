"""The one chaotic attractor on which all of many orbits are, known before these have been followed for long."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..._lib.arrays import evenly
from ...maps.coordinates import turns_of
from ...maps.grid import CellGrid
from ...maps.interpolation.drafts import draft_of
from ...maps.interpolation.interpolated import Interpolated
from ...maps.orbit_batch import Orbits
from ...maps.point_map import PointMap
from ...maps.side_by_side import advance_on_threads
from ...orbits.attractor import Attractor
from ..kinds.chaos import MATURE, one_attractor, returns, with_exponents
from ..kinds.ends import ORBITS, Ends
from ..kinds.transients import Late
from ..regions.trapping_boxes import is_trapped, region_around, with_trapped_boxes
from ..settling.labels import Label
from ..settling.settle import Catalogue, settle

_CELLS = 256  # of the surrogate along each axis: errors are 1e-6 of the window
_FALLBACK = 0.25  # fraction of them that the exact map may have to serve
_FOLLOWED = 512  # orbits


def only_attractor(ends: Ends, late: Late, periods: int) -> tuple[Attractor | None, bool]:
    """Return the chaotic attractor of orbits that are all chaotic, if it is one, with boxes that no orbit leaves.

    The orbits show where the attractor is when they are 256 periods old.  As it may hold a periodic attractor with a
    small basin, 512 of them are followed to an age of some `periods`, by a surrogate of the map: orbits are chaotic, so
    that each of them is lost at any accuracy, and what they come to is not.  The surrogate is an interpolated map, with
    the exact one in fallback cells.  None where an orbit comes back to where it was or ends, and in more than two
    dimensions, where interpolation takes many images: then orbits have to be followed.

    So they have where there are no such boxes, which need not be looked for again: that is returned as well.
    """
    point_map, points, extent, known = ends.point_map, ends.points, ends.extent, ends.known
    if point_map.dimension > 2:
        return None, False
    sample = Orbits.starting(points[evenly(len(points), ORBITS)])
    advance_on_threads(point_map.advance, sample, max(MATURE - ends.age, 0))
    if not sample.alive.all():
        return None, False
    attractor, _ = one_attractor(point_map, sample.points, extent, known, late)
    surrogate = None if attractor is None else _surrogate(point_map, attractor, known)
    if attractor is None or surrogate is None:
        return None, False
    (attractor,) = with_trapped_boxes(point_map, [attractor], known, surrogate)
    if not is_trapped(attractor):
        return None, True
    many = Orbits.starting(points[evenly(len(points), _FOLLOWED)])
    settled = settle(surrogate, many, Catalogue.of((), surrogate), max(periods - ends.age, 1), ends.age)
    places = settled.orbits.points
    if (settled.labels != Label.UNDECIDED).any() or returns(surrogate, places, extent).any():
        return None, False
    return with_exponents(point_map, attractor, places, extent), False


def _surrogate(point_map: PointMap, attractor: Attractor, known: Sequence[Attractor]) -> PointMap | None:
    """Return a map that is cheap around an attractor, None where there is none, or one that is known is there."""
    assert attractor.cover is not None
    region = region_around(point_map, attractor.cover, known)
    if region is None or point_map.table is not None:
        return None if region is None else point_map
    cut, turn = turns_of(point_map.coordinates)
    lower, upper = np.where(turn > 0, (cut, cut + turn), region).tolist()
    grid = CellGrid(lower, upper, (_CELLS,) * point_map.dimension)
    made = draft_of(Interpolated(point_map, grid, 5, "integrate", None, 1))
    assert made.table is not None
    return made if made.table.fallback.mean() <= _FALLBACK else None
