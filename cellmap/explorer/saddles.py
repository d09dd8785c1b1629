"""Saddles of the map of an image, their stable manifolds, which are the basin boundaries, and their unstable ones."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from .._lib.arrays import Floats
from .._lib.checks import whole_number
from ..analysis.boundary.manifolds import saddle_manifold
from ..basins.live import LiveFrame
from ..maps.grid import CellGrid
from ..maps.inverse import inverse_stroboscopic_map
from ..maps.point_map import PointMap
from ..maps.stroboscopic import Stroboscopic
from ..orbits.orbit_kinds import PeriodicOrbit
from ..orbits.periodic_search import find_periodic_orbits
from .view import View

LONGEST_PERIOD = 8

_CELLS = 100  # cells along each axis from whose centres periodic orbits are searched for
_LENGTH = 12.0  # length of each branch, in sizes of the window
_SPACING = 0.005
_SECONDS = 20.0  # seconds after which no further manifold is begun


def saddles(view: View, frame: LiveFrame, longest_period: Any) -> tuple[dict[str, Any], bytes]:
    """Return the saddles with a point in the window, up to a period, and as bytes their manifolds.

    The bytes are numbers of four bytes, two for each point of a curve, NaN where a curve is interrupted: all stable
    manifolds, then all unstable ones.  `lengths` has the number of points by kind for each saddle, 0 for those that are
    left out.
    """
    if len(view.axes) != 2 or len(view.others) != 2:
        raise ValueError("manifolds are curves for maps of two coordinates only: take another system")
    longest = whole_number("longest_period", longest_period, at_least=1, at_most=LONGEST_PERIOD)
    point_map = frame.basins.point_map
    assert point_map is not None
    exact, window = point_map.without_table, view.initial_conditions()
    assert isinstance(window, CellGrid)
    region = CellGrid(window.lower, window.upper, (_CELLS, _CELLS))
    found = [orbit for orbit in find_periodic_orbits(exact, region, longest) if _is_saddle(orbit)]
    inverse, curves, began = _inverse(exact), dict[str, list[Floats]](), time.monotonic()
    for kind in ("stable", "unstable"):
        curves[kind] = [
            np.empty((0, 2)) if time.monotonic() - began > _SECONDS else _curve(exact, orbit, kind, region, inverse)
            for orbit in found
        ]
    facts = {
        "saddles": [
            {
                "kind": str(orbit.kind),
                "period": orbit.period,
                "points": orbit.points,
                "multipliers": np.abs(orbit.multipliers),
            }
            for orbit in found
        ],
        "lengths": {kind: [len(curve) for curve in each] for kind, each in curves.items()},
    }
    return facts, np.concatenate([*curves["stable"], *curves["unstable"], np.empty((0, 2))]).astype("<f4").tobytes()


def _is_saddle(orbit: PeriodicOrbit) -> bool:
    largest, smallest = np.abs(orbit.multipliers)
    return bool(largest > 1.0 > smallest > 0.0)


def _inverse(exact: PointMap) -> PointMap | None:
    """Return the inverse of a stroboscopic map; None where preimages have to be searched for."""
    spec = exact.spec
    if not isinstance(spec, Stroboscopic) or spec.system.switches is not None or spec.system.impacts:
        return None
    return inverse_stroboscopic_map(spec.system, spec.phase, spec.rtol, spec.atol)


def _curve(exact: PointMap, orbit: PeriodicOrbit, kind: str, region: CellGrid, inverse: PointMap | None) -> Floats:
    """Return all branches of a manifold, one after another with NaN between them."""
    manifold = saddle_manifold(exact, orbit, kind, region, _LENGTH, _SPACING, inverse)
    interruption = np.full((1, 2), np.nan)
    return np.concatenate([part for branch in manifold.branches for part in (branch.points, interruption)])
