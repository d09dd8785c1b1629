"""Coordinates that orbits keep above zero while they fall below their absolute tolerance, foreseen from a few orbits.

The infected of an epidemic and the photons of a laser may fall by tens of decades before they grow again.  Below its
`atol` a coordinate has no correct digit, not even its sign: what grows again is the error of the integrator.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .._lib.arrays import Floats, evenly
from .._lib.checks import warn_caller
from .compiled_advance import FlowAdvance, recorded
from .orbit_batch import Orbits
from .point_map import PointMap, ToleranceWarning

ORBITS = 8
"""How many orbits are looked at."""

_PERIODS = 32
_STEPS = 1024  # in a period
_RELATIVE = 1e-290
"""Absolute tolerance that leaves a coordinate to the relative one."""


def warn_of_small_states_ahead(point_map: PointMap, points: Floats) -> None:
    """Warn of coordinates that fall below their absolute tolerance and grow again on orbits of some points (n, d)."""
    advance = point_map.without_table.advance
    if not isinstance(advance, FlowAdvance) or not len(points) or advance.motion.vectors:
        return
    motion = advance.motion
    kept = np.flatnonzero(motion.keeps_zero & (motion.atol > _RELATIVE))
    if not len(kept):
        return
    floors = motion.atol[kept]
    atol = motion.atol.copy()
    atol[kept] = _RELATIVE
    exact = replace(advance, motion=replace(motion, atol=atol, max_steps=min(motion.max_steps, _STEPS)))
    chosen = points[evenly(len(points), ORBITS)]
    orbits = Orbits.starting(chosen.copy())
    path = np.concatenate([chosen[None], *(places for places, _, _ in recorded(exact, orbits, _PERIODS))])
    sizes = np.abs(path[:, :, kept])
    above, below = sizes > 10.0 * floors, sizes < 0.1 * floors
    # Below after it was above, and above after that.
    fell = below & np.logical_or.accumulate(above, axis=0)
    regrown = (above & np.logical_or.accumulate(fell, axis=0)).any(axis=(0, 1))
    if regrown.any():
        names = [point_map.coordinates[j].name for j in kept[regrown]]
        smallest = np.nanmin(sizes[:, :, regrown])
        warn_caller(
            f"{', '.join(names)} of {point_map.name} falls to {smallest:.1g} and grows again, and below its atol of "
            f"{floors[regrown].max():.1g} no digit of it is known: orbits of this map may diverge that do not. Give "
            f"atol={{{names[0]!r}: 1e-290}}, which leaves it to rtol, or make its logarithm the coordinate",
            ToleranceWarning,
        )
