"""Branches of the driven pendulum and of Henon's map."""

from __future__ import annotations

from math import pi

import pytest

from cellmap import PointMap, continue_orbit, periodic_orbit, stroboscopic_map
from cellmap.bifurcations import Branch
from systems import driven_pendulum, henon_map


@pytest.fixture(scope="module")
def pendulum() -> PointMap:
    return stroboscopic_map(driven_pendulum(amplitude=0.003), rtol=1e-12, atol=1e-12)


@pytest.fixture(scope="module")
def inverted(pendulum: PointMap) -> Branch:
    return continue_orbit(pendulum, periodic_orbit(pendulum, [pi, 0.0]), "amplitude", 0.001, 0.014)


@pytest.fixture(scope="module")
def henon() -> Branch:
    exact = henon_map(0.2, 0.3)
    return continue_orbit(exact, periodic_orbit(exact, [0.5, 0.2]), "a", -1.0, 1.4, max_points=300)
