"""The driven pendulum of the hard cases."""

from __future__ import annotations

import systems
from cellmap import PointMap, stroboscopic_map


def strobe(**parameters: float) -> PointMap:
    return stroboscopic_map(systems.driven_pendulum(**parameters))
