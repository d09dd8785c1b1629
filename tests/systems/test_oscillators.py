"""Duffing, the pendulum under a torque and Henon's map, against the numbers of references.md."""

from __future__ import annotations

from math import cos, sin

import numpy as np
import pytest

from cellmap import ForcedSystem, jacobian, stroboscopic_map
from systems import forced_pendulum, henon_map, two_well_duffing


def test_the_equations() -> None:
    x, v, t = 0.7, -0.4, 1.3
    duffing = two_well_duffing(damping=0.15, forcing=0.2, frequency=2.0)
    assert duffing.derivative(t, (x, v)) == pytest.approx((v, x - x**3 - 0.15 * v + 0.2 * cos(2.0 * t)), rel=1e-15)
    pendulum = forced_pendulum(damping=0.2, forcing=2.0, frequency=2.0)
    assert pendulum.derivative(t, (x, v)) == pytest.approx((v, -0.2 * v - sin(x) + 2.0 * cos(2.0 * t)), rel=1e-15)
    assert henon_map()([x, v]) == pytest.approx([1.0 - 1.4 * x * x + v, 0.3 * x], rel=1e-15)


@pytest.mark.parametrize(
    ("system", "points", "digits"),
    [
        (two_well_duffing(), [(-0.77905493, 0.02741682), (1.21009083, 0.05529497)], 1e-8),
        (forced_pendulum(), [(-0.4728, 2.0371), (-0.4782, -0.6082)], 1e-4),
    ],
    ids=["Duffing", "forced pendulum"],
)
def test_fixed_points(system: ForcedSystem, points: list[tuple[float, float]], digits: float) -> None:
    """The two attractors are fixed points of the map, and stable."""
    strobe = stroboscopic_map(system)
    assert strobe(points) == pytest.approx(np.array(points), abs=3.0 * digits)
    assert np.abs(np.linalg.eigvals(jacobian(strobe, points))).max() < 1.0


@pytest.mark.parametrize("factory", [two_well_duffing, forced_pendulum])
def test_bad_parameters_are_refused(factory: object) -> None:
    assert callable(factory)
    with pytest.raises(ValueError, match=r"damping=-0.1: give a number of at least 0"):
        factory(damping=-0.1)
    with pytest.raises(ValueError, match=r"frequency=0.0: give a number above 0"):
        factory(frequency=0.0)


def test_henons_map_contracts_areas_by_b() -> None:
    points = np.random.default_rng(0).uniform(-1.0, 1.0, (50, 2))
    assert np.linalg.det(jacobian(henon_map(a=1.2, b=0.25), points)) == pytest.approx(-0.25, rel=1e-14)
