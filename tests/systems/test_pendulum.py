"""The vertically driven pendulum, against the numbers of tests/REFERENCES.md."""

from math import pi, sin, sqrt

import numpy as np
import pytest
from scipy.special import ellipk

from cellmap import stroboscopic_map
from cellmap.maps import jacobian
from systems import dimensionless_pendulum, driven_pendulum

W = 2.0 * pi * 50.0


def test_the_sign_convention() -> None:
    """theta'' = -gamma theta' - ((g + y'')/l) sin theta, y = A cos(w t): the pivot begins at its top, y'' = -A w^2."""
    theta, rate = 0.7, 3.0
    field = 9.8 - 0.003 * W * W
    assert driven_pendulum().derivative(0.0, (theta, rate)) == pytest.approx(
        (rate, -10.0 * rate - field / 0.0272 * sin(theta)), rel=1e-14
    )
    half = driven_pendulum(phase=pi).derivative(0.0, (theta, rate))
    assert half[1] == pytest.approx(-10.0 * rate - (9.8 + 0.003 * W * W) / 0.0272 * sin(theta), rel=1e-14)


def test_the_map_of_one_period() -> None:
    strobe = stroboscopic_map(driven_pendulum(), rtol=1e-12, atol=1e-12)
    expected = (1.4219856563553754, 0.052018392069488984)
    assert strobe([1.0, 0.1 * W]) / [1.0, W] == pytest.approx(expected, rel=1e-12)


def test_rotations() -> None:
    """At 3 mm two rotations in step with the drive, mirror images of each other."""
    strobe = stroboscopic_map(driven_pendulum(), rtol=1e-12, atol=1e-12)
    theta, v = 2.520339579944, 1.019933227842
    initial_conditions = np.array([[theta, v * W], [-theta, -v * W]])
    images = strobe.iterate(initial_conditions, 1)
    assert images.points / [1.0, W] == pytest.approx(initial_conditions / [1.0, W], abs=2e-11)
    assert images.rotations[:, 0].tolist() == [1, -1]
    assert strobe.iterate(initial_conditions, 100).rotations[:, 0].tolist() == [100, -100]


@pytest.mark.parametrize(
    ("alpha", "beta", "gamma", "point", "period", "rotations"),
    [
        (0.5, 0.1, 0.03, (2.65934, 0.67711), 1, 1),
        (0.5, 0.1, 0.03, (0.67083, 1.15836), 2, 0),
        (-0.1, 0.545, 0.2, (2.18475, 1.18826), 1, 1),
    ],
)
def test_attractors_of_the_literature(alpha, beta, gamma, point, period, rotations):
    """REFERENCES.md gives five decimals; rotations come in mirrored pairs."""
    strobe = stroboscopic_map(dimensionless_pendulum(alpha, beta, gamma))
    for sign in (1.0, -1.0):
        orbit = strobe.iterate(sign * np.array(point), period)
        assert orbit.points == pytest.approx(sign * np.array(point), abs=3e-5)
        assert orbit.rotations[0] == sign * rotations * period
        assert np.abs(np.linalg.eigvals(jacobian(strobe, sign * np.array(point), period))).max() < 1.0


def test_without_drive_and_damping_the_swing_has_its_exact_period() -> None:
    """4 K(sin(a/2)) sqrt(l/g); for a = 3 rad 0.851124077002 s (REFERENCES.md)."""
    system = driven_pendulum(amplitude=0.0, damping=0.0, frequency=1.0)
    period = 4.0 * ellipk(sin(1.5) ** 2) * sqrt(0.0272 / 9.8)
    assert period == pytest.approx(0.851124077002, abs=1e-12)
    strobe = stroboscopic_map(
        driven_pendulum(amplitude=0.0, damping=0.0, frequency=1.0 / period), rtol=1e-12, atol=1e-12
    )
    assert strobe([3.0, 0.0]) == pytest.approx([3.0, 0.0], abs=1e-8)
    assert system.params == {"length": 0.0272, "gravity": 9.8}
