"""Coordinates that orbits keep above zero while they fall below their absolute tolerance, foreseen from a few orbits.

The infected of an epidemic and the photons of a laser may fall by tens of decades before they grow again.  Below its
`atol` a coordinate has no correct digit, not even its sign: what grows again is the error of the integrator.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .._lib.arrays import Bools, Floats, Ints, evenly
from .._lib.checks import warn_caller
from .compiled_advance import DiscreteAdvance, FlowAdvance, recorded
from .integration import Flow
from .orbit_batch import Orbits
from .point_map import PointMap, ToleranceWarning, warn_of_small_states

ORBITS = 8
"""How many orbits are looked at."""

_PERIODS, _RETURNS = 32, 4
_STEPS = 1024  # largest number of steps in a period
_RELATIVE = 1e-290
"""Absolute tolerance that leaves a coordinate to the relative one."""


def warn_of_small_states_ahead(point_map: PointMap, points: Floats) -> None:
    """Warn of coordinates that fall below their absolute tolerance and grow again on orbits of some points (n, d)."""
    advance = point_map.without_table.advance
    if not len(points):
        return
    chosen = points[evenly(len(points), ORBITS)]
    if hasattr(advance, "take_lost") and not isinstance(advance, FlowAdvance | DiscreteAdvance):
        advance(Orbits.starting(chosen.copy()), _RETURNS)
        warn_of_small_states(point_map.without_table)
        return
    if not isinstance(advance, FlowAdvance) or advance.motion.vectors:
        return
    kept = np.flatnonzero(advance.motion.keeps_zero & (advance.motion.atol > _RELATIVE))
    if not len(kept):
        return
    floors = advance.motion.atol[kept]
    path = seen(replace(advance, motion=exact_motion(advance.motion, kept)), chosen, _PERIODS)
    sizes = np.abs(path[:, :, kept])
    grown = regrown(sizes, floors)
    if grown.any():
        names = [point_map.coordinates[j].name for j in kept[grown]]
        smallest = np.nanmin(sizes[:, :, grown])
        warn_caller(
            f"{', '.join(names)} of {point_map.name} falls to {smallest:.1g} and grows again, and below its atol of "
            f"{floors[grown].max():.1g} no digit of it is known: orbits of this map may diverge that do not. Give "
            f"atol={{{names[0]!r}: 1e-290}}, which leaves it to rtol, or make its logarithm the coordinate",
            ToleranceWarning,
        )


def exact_motion(motion: Flow, kept: Ints) -> Flow:
    """Return the motion in which some coordinates are left to the relative tolerance."""
    atol = motion.atol.copy()
    atol[kept] = _RELATIVE
    return replace(motion, atol=atol, max_steps=min(motion.max_steps, _STEPS))


def seen(advance: FlowAdvance, points: Floats, periods: int) -> Floats:
    """Return where orbits are in the beginning and after each of some periods, shape (1 + periods, n, d)."""
    orbits = Orbits.starting(points.copy())
    return np.concatenate([points[None], *(places for places, _, _ in recorded(advance, orbits, periods))])


def regrown(sizes: Floats, floors: Floats) -> Bools:
    """Tell which coordinates (periods, n, k) are below their tolerances after they were above, and above after that."""
    above, below = sizes > 10.0 * floors, sizes < 0.1 * floors
    fell = below & np.logical_or.accumulate(above, axis=0)
    return np.asarray((above & np.logical_or.accumulate(fell, axis=0)).any(axis=(0, 1)))
