"""The vertically driven pendulum, against the numbers of tests/REFERENCES.md."""

from __future__ import annotations

from math import acos, cos, exp, pi, sin, sqrt
from typing import Any

import numpy as np
import pytest
from scipy.special import ellipk

from cellmap import stroboscopic_map
from cellmap.maps import jacobian
from systems import dimensionless_parameters, dimensionless_pendulum, driven_pendulum, physical_parameters

W = 2.0 * pi * 50.0
INVERTED = (pi, 0.0)


def multipliers(amplitude: float, ic: tuple[float, float] = INVERTED, **changes: float) -> Any:
    strobe = stroboscopic_map(driven_pendulum(amplitude=amplitude, **changes))
    return np.sort_complex(np.linalg.eigvals(jacobian(strobe, ic)))[::-1]


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


def test_the_same_in_dimensionless_form() -> None:
    scaled = dimensionless_pendulum(**dimensionless_parameters(0.0272, 0.003, 50.0, 10.0))
    strobe = stroboscopic_map(scaled, rtol=1e-12, atol=1e-12)
    assert strobe([1.0, 0.1]) == pytest.approx((1.4219856563553754, 0.052018392069488984), rel=1e-12)


@pytest.mark.parametrize(
    ("amplitude", "beta"), [(0.002, 0.0735294), (0.003, 0.1102941), (0.004, 0.1470588), (0.010, 0.3676471)]
)
def test_dimensionless_parameters(amplitude: float, beta: float) -> None:
    scaled = dimensionless_parameters(length=0.0272, amplitude=amplitude, frequency=50.0, damping=10.0)
    assert scaled == {
        "alpha": pytest.approx(0.00365054264594, rel=1e-11),
        "beta": pytest.approx(beta, abs=5e-8),
        "gamma": pytest.approx(0.0318309886, rel=1e-9),
    }
    physical = {"length": 0.0272, "amplitude": amplitude, "frequency": 50.0, "damping": 10.0, "gravity": 9.8}
    assert physical_parameters(**scaled, length=0.0272, frequency=50.0) == pytest.approx(physical, rel=1e-14)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"length": 0.0}, "length=0.0: give a number above 0"),
        ({"frequency": -50.0}, "frequency=-50.0: give a number above 0"),
        ({"damping": -1.0}, "damping=-1.0: give a number of at least 0"),
    ],
)
def test_conversions_check_their_numbers(arguments: dict[str, float], message: str) -> None:
    physical = {"length": 0.0272, "amplitude": 0.003, "frequency": 50.0, "damping": 10.0, **arguments}
    with pytest.raises(ValueError, match=message):
        dimensionless_parameters(**physical)
    with pytest.raises(ValueError, match="gamma=-1: give a number of at least 0"):
        physical_parameters(0.1, 0.1, -1, 1.0, 1.0)


@pytest.mark.parametrize("amplitude", [0.002, 0.003, 0.004, 0.010])
def test_the_determinant_of_the_map(amplitude: float) -> None:
    strobe = stroboscopic_map(driven_pendulum(amplitude=amplitude))
    initial_conditions = np.random.default_rng(0).uniform(-1.0, 1.0, (40, 2)) * (pi, 100.0)
    matrices = jacobian(strobe, initial_conditions) * np.array([[1.0, W], [1.0 / W, 1.0]])
    assert np.linalg.det(matrices) == pytest.approx(exp(-0.2), abs=1e-10)


def test_multipliers_of_the_inverted_state() -> None:
    assert multipliers(0.002) == pytest.approx([1.126883285335, 0.726544411238], abs=1e-10)
    pair = 0.865837958746 + 0.262783907940j
    assert multipliers(0.003) == pytest.approx([pair, pair.conjugate()], abs=1e-10)


@pytest.mark.parametrize(
    ("amplitude", "damping", "ic", "multiplier"),
    [
        (2.329021135978e-3, 10.0, INVERTED, 1.0),
        (2.327849487651e-3, 0.0, INVERTED, 1.0),
        (12.542910208e-3, 10.0, INVERTED, -1.0),
        (12.210173235e-3, 10.0, (0.0, 0.0), -1.0),
    ],
)
def test_where_the_equilibria_change_stability(
    amplitude: float, damping: float, ic: tuple[float, float], multiplier: float
) -> None:
    """At the critical amplitudes one multiplier is 1 or -1; undamped both are, up to the square root of the error."""
    values = multipliers(amplitude, ic, damping=damping)
    assert np.abs(values - multiplier).min() < (1e-8 if damping else 1e-4)


def test_the_slope_of_the_multiplier_at_its_threshold() -> None:
    """At A_c -+ 1e-3 mm the multiplier is 1.000624 and 0.999372."""
    critical = 2.329021135978e-3
    assert multipliers(critical + 1e-6)[0].real == pytest.approx(0.999372, abs=1e-6)
    assert multipliers(critical - 1e-6)[0].real == pytest.approx(1.000624, abs=1e-6)


def test_principal_resonance() -> None:
    """alpha 0.25, gamma 0.05: the hanging state is lost at beta = 0.050027335537, with a multiplier of -1."""
    strobe = stroboscopic_map(dimensionless_pendulum(alpha=0.25, beta=0.050027335537, gamma=0.05))
    values = np.linalg.eigvals(jacobian(strobe, [0.0, 0.0]))
    assert np.abs(values + 1.0).min() < 1e-9


@pytest.mark.parametrize(("amplitude", "critical"), [(0.003, 0.927068123), (0.004, 1.226427972)])
def test_kapitzas_angle(amplitude: float, critical: float) -> None:
    """The paper's critical angle follows from the same alpha and beta: cos theta_c = 2 alpha / beta^2."""
    scaled = dimensionless_parameters(0.0272, amplitude, 50.0, 10.0)
    assert acos(2.0 * scaled["alpha"] / scaled["beta"] ** 2) == pytest.approx(critical, abs=1e-9)


def test_rotations() -> None:
    """At 3 mm two rotations in step with the drive, mirror images of each other."""
    strobe = stroboscopic_map(driven_pendulum(), rtol=1e-12, atol=1e-12)
    theta, v = 2.520339579944, 1.019933227842
    initial_conditions = np.array([[theta, v * W], [-theta, -v * W]])
    images = strobe.iterate(initial_conditions, 1)
    assert images.points / [1.0, W] == pytest.approx(initial_conditions / [1.0, W], abs=2e-11)
    assert images.rotations[:, 0].tolist() == [1, -1]
    assert strobe.iterate(initial_conditions, 100).rotations[:, 0].tolist() == [100, -100]


def test_the_period_4_pair_at_10_mm() -> None:
    strobe = stroboscopic_map(driven_pendulum(amplitude=0.010), rtol=1e-12, atol=1e-12)
    points = np.array([[0.100306867278, 0.282821064590], [0.536047919253, -0.034158641173]]) * [1.0, W]
    for ic in (*points, *-points):
        assert strobe.iterate(ic, 4).points / [1.0, W] == pytest.approx(ic / [1.0, W], abs=1e-9)
        assert abs(strobe(ic)[0] - ic[0]) > 0.1


@pytest.mark.parametrize(
    ("alpha", "beta", "gamma", "point", "period", "rotations"),
    [
        (0.5, 0.1, 0.03, (2.65934, 0.67711), 1, 1),
        (0.5, 0.1, 0.03, (0.67083, 1.15836), 2, 0),
        (-0.1, 0.545, 0.2, (2.18475, 1.18826), 1, 1),
    ],
)
def test_attractors_of_the_literature(
    alpha: float, beta: float, gamma: float, point: tuple[float, float], period: int, rotations: int
) -> None:
    """REFERENCES.md gives five decimals; rotations come in mirrored pairs."""
    strobe = stroboscopic_map(dimensionless_pendulum(alpha, beta, gamma))
    for sign in (1.0, -1.0):
        orbit = strobe.iterate(sign * np.array(point), period)
        assert orbit.points == pytest.approx(sign * np.array(point), abs=3e-5)
        assert orbit.rotations[0] == sign * rotations * period
        assert np.abs(np.linalg.eigvals(jacobian(strobe, sign * np.array(point), period))).max() < 1.0


def test_mirror_symmetry() -> None:
    strobe = stroboscopic_map(driven_pendulum(amplitude=0.010))
    initial_conditions = np.random.default_rng(1).uniform(-1.0, 1.0, (200, 2)) * (3.0, 300.0)
    assert np.array_equal(
        strobe.iterate(-initial_conditions, 3).unwrapped, -strobe.iterate(initial_conditions, 3).unwrapped
    )


def test_the_phase_of_the_drive_is_that_of_the_section() -> None:
    initial_conditions = np.random.default_rng(2).uniform(-1.0, 1.0, (20, 2)) * (3.0, 100.0)
    moved = stroboscopic_map(driven_pendulum(phase=pi / 2))(initial_conditions)
    assert moved == pytest.approx(
        stroboscopic_map(driven_pendulum(), phase=0.25)(initial_conditions), rel=1e-8, abs=1e-8
    )


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


def test_without_drive_and_damping_energy_is_kept() -> None:
    """To 1e-11 over 1,000 periods of 0.02 s."""
    strobe = stroboscopic_map(driven_pendulum(amplitude=0.0, damping=0.0), rtol=1e-12, atol=1e-12)
    ic = np.array([3.0, 0.0])
    end = strobe.iterate(ic, 1000).points

    def energy(x: Any) -> float:
        return float(0.5 * x[1] ** 2 - 9.8 / 0.0272 * cos(x[0]))

    assert energy(end) == pytest.approx(energy(ic), rel=1e-11)


def test_a_free_rotor() -> None:
    rotor = driven_pendulum(amplitude=0.0, damping=0.0, gravity=0.0)
    image = stroboscopic_map(rotor).iterate([1.0, 1000.0], 1)
    assert image.unwrapped == pytest.approx([21.0, 1000.0], rel=1e-14)


def test_free_decay() -> None:
    """Damping alone: the rate falls as exp(-damping t)."""
    image = stroboscopic_map(driven_pendulum(amplitude=0.0, gravity=0.0)).iterate([0.0, 100.0], 5)
    assert image.unwrapped == pytest.approx([10.0 * (1.0 - exp(-1.0)), 100.0 * exp(-1.0)], rel=1e-8)
