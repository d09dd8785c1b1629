"""The mass on a moving belt: exact motions, where steady sliding is stable, and the vibrations beyond."""

from math import asin, cos, exp, pi, sin, sqrt

import numpy as np
import pytest

from cellmap import stroboscopic_map, trajectory
from cellmap.maps import jacobian
from systems import stick_slip_oscillator

BELT, STATIC, LEAST, SPEED = 0.1, 0.4, 0.25, 0.5
CRITICAL_DAMPING = 0.75 * (STATIC - LEAST) / SPEED * (1.0 - (BELT / SPEED) ** 2)


def test_the_friction_falls_from_rest_and_then_grows() -> None:
    """mu_s at rest, mu_m at the speed v_m, and odd in the sliding speed."""
    system = stick_slip_oscillator(damping=0.0, forcing=0.0)

    def friction(r: float, side: float) -> float:
        return -system.derivative(0.0, (0.0, BELT + r), (side,))[1]

    assert friction(0.0, 1.0) == STATIC
    assert friction(SPEED, 1.0) == pytest.approx(LEAST)
    assert friction(0.99 * SPEED, 1.0) > LEAST < friction(1.01 * SPEED, 1.0)
    assert friction(-0.3, -1.0) == pytest.approx(-friction(0.3, 1.0))


@pytest.mark.thorough
def test_coulombs_friction_on_a_belt_exactly() -> None:
    """Stuck, the mass moves with the belt until the spring overcomes the friction; then it is on a circle about mu_s.

    The circle has the radius of the belt's speed and touches it once in each revolution.
    """
    period = 7.0
    system = stick_slip_oscillator(BELT, STATIC, STATIC, damping=0.0, forcing=0.0, frequency=2.0 * pi / period)
    strobe = stroboscopic_map(system, rtol=1e-13, atol=1e-13)
    for x in (-0.3, 0.0, 0.35):
        rotated = period - (STATIC - x) / BELT
        exact = (x + BELT * period, BELT) if rotated < 0.0 else (STATIC + BELT * sin(rotated), BELT * cos(rotated))
        assert strobe([x, BELT]) == pytest.approx(exact, abs=1e-12)
    inside = np.array([STATIC, 0.0]) + 0.6 * BELT * np.array([[1.0, 0.0], [0.0, 1.0], [-0.6, 0.8]])
    c, s = cos(period), sin(period)
    assert strobe(inside) == pytest.approx((inside - (STATIC, 0.0)) @ np.array([[c, -s], [s, c]]) + (STATIC, 0.0))
    for radius in (1.5, 3.0):
        # A wider circle meets the belt where it still sticks.
        ic = np.array([STATIC + radius * BELT, 0.0])
        met = STATIC - BELT * sqrt(radius * radius - 1.0)
        left = period - pi - asin(1.0 / radius)
        rotated = left - (STATIC - met) / BELT
        exact = (met + BELT * left, BELT) if rotated < 0.0 else (STATIC + BELT * sin(rotated), BELT * cos(rotated))
        assert strobe(ic) == pytest.approx(exact, abs=1e-12)


@pytest.mark.parametrize("fraction", [0.8, 1.2])
def test_steady_sliding_is_stable_above_the_critical_damping(fraction: float) -> None:
    """Multipliers exp((a +- i w) T) with 2 a = -mu'(belt_speed) - 2 damping, exactly, and what follows from them."""
    system = stick_slip_oscillator(damping=fraction * CRITICAL_DAMPING, forcing=0.0)
    rest = [STATIC - 1.5 * (STATIC - LEAST) * (BELT / SPEED - (BELT / SPEED) ** 3 / 3.0), 0.0]
    strobe = stroboscopic_map(system, rtol=1e-12, atol=1e-12)
    assert strobe(rest) == pytest.approx(rest, abs=1e-14)
    growth = (1.0 - fraction) * CRITICAL_DAMPING
    multiplier = np.linalg.eigvals(jacobian(strobe, rest))[0]
    assert abs(multiplier) == pytest.approx(exp(growth * system.length), rel=1e-12)
    assert multiplier.real == pytest.approx(abs(multiplier) * cos(sqrt(1.0 - growth**2) * system.length), abs=1e-12)
    later = strobe.iterate([rest[0] + 1e-6, 0.0], 300).points
    assert (np.linalg.norm(later - rest) < 1e-6) == (fraction > 1.0)


def test_stick_slip_vibrations() -> None:
    """Where steady sliding is unstable, all orbits end in one cycle, which sticks for a part of its time."""
    system = stick_slip_oscillator(damping=0.02, forcing=0.0, frequency=1.0)
    strobe = stroboscopic_map(system)
    initial_conditions = strobe.iterate([[0.3, 0.01], [2.0, 1.0], [0.0, BELT]], 80).points
    motion = trajectory(system, initial_conditions, 20, samples_per_period=256)
    stuck = motion.states[..., 1] == BELT
    assert (stuck.mean(axis=0) > 0.2).all() and (stuck.mean(axis=0) < 0.8).all()
    assert (motion.states[..., 1].max(axis=0) == BELT).all()
    assert motion.states[..., 0].max(axis=0) == pytest.approx(np.full(3, motion.states[..., 0].max()), abs=1e-4)


def test_pure_sliding_vibrations_have_the_amplitude_of_thomsen_and_fidlin() -> None:
    """2 sqrt(v_1^2 - v_b^2) for belts little slower than the critical speed v_1, by averaging."""
    static, least, damping = 0.04, 0.025, 0.001
    critical = SPEED * sqrt(1.0 - 4.0 * damping * SPEED / (3.0 * (static - least)))
    belt = 0.97 * critical
    system = stick_slip_oscillator(belt, static, least, SPEED, damping, forcing=0.0)
    ic = stroboscopic_map(system).iterate([0.2, 0.0], 3000).points
    motion = trajectory(system, ic, 20, samples_per_period=256)
    assert motion.states[:, 1].max() < belt
    amplitude = 0.5 * (motion.states[:, 0].max() - motion.states[:, 0].min())
    assert amplitude == pytest.approx(2.0 * sqrt(critical**2 - belt**2), rel=5e-4)
