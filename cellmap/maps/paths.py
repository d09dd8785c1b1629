"""Paths of orbits: where they are after each of some periods."""

from __future__ import annotations

import numpy as np

from .._lib.arrays import Floats, Ints
from .._lib.stopping import check_stop
from .compiled_advance import recorded
from .orbit_batch import Orbits, Status
from .point_map import PointMap
from .side_by_side import advance_on_threads, long_parts, over_parts

_AT_ONCE = 64  # periods between looks whether the end was asked for


def path_of(point_map: PointMap, orbits: Orbits, periods: int) -> Floats:
    """Move orbits on; return where they have been (periods, n, dimension), NaN once they have ended."""

    def path(part: Orbits) -> Floats:
        looks = recorded(point_map.advance, part, periods)
        return np.concatenate([np.where((s < Status.ESCAPED)[..., None], points, np.nan) for points, _, s in looks])

    cuts = long_parts(len(orbits), periods if point_map.is_flow else 0)
    return np.concatenate(over_parts(orbits, cuts, path), axis=1)


def history_of(exact: PointMap, orbits: Orbits, periods: int) -> tuple[Floats, Ints]:
    """Move orbits on; return where they have been (periods, n, d), and their full rotations."""
    parts = [(points.copy(), rotations.copy()) for points, rotations, _ in recorded(exact.advance, orbits, periods)]
    return np.concatenate([p for p, _ in parts]), np.concatenate([r for _, r in parts])


def moved_on(exact: PointMap, orbits: Orbits, periods: int) -> None:
    """Move orbits on."""
    for begin in range(0, periods, _AT_ONCE):
        check_stop()
        advance_on_threads(exact.advance, orbits, min(_AT_ONCE, periods - begin))
