"""The driven pendulum, exactly and interpolated."""

from __future__ import annotations

from math import pi

import pytest

import systems
from cellmap import CellGrid, PointMap, interpolated_map, stroboscopic_map


@pytest.fixture(scope="module")
def pendulum() -> PointMap:
    return stroboscopic_map(systems.driven_pendulum(), rtol=1e-12, atol=1e-12)


@pytest.fixture(scope="module")
def interpolated_pendulum(pendulum: PointMap) -> PointMap:
    return interpolated_map(pendulum, CellGrid((-pi, -100.0), (pi, 100.0), (64, 64)))
