"""Oscillators under a harmonic force or with a modulated spring, against closed forms, published numbers and tables."""

from collections.abc import Callable
from functools import partial
from math import acos, cos, cosh, pi, sin, sqrt, tanh
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import mathieu_a, mathieu_b

import systems
from cellmap import ForcedSystem, stroboscopic_map
from cellmap.attractors.kinds.exponents import Growing
from cellmap.maps import jacobian
from systems import hill_equation, mathieu_equation


@pytest.mark.parametrize(
    ("factory", "acceleration"),
    [
        (partial(systems.duffing_oscillator, linear=0.4, cubic=0.7), lambda x, v: -0.4 * x - 0.7 * x**3 - 0.15 * v),
        (systems.two_well_duffing, lambda x, v: x - x**3 - 0.15 * v),
        (systems.moon_li_duffing, lambda x, v: 0.5 * x * (1.0 - x**2) - 0.15 * v),
        (systems.ueda_oscillator, lambda x, v: -(x**3) - 0.15 * v),
        (systems.helmholtz_oscillator, lambda x, v: x**2 - x - 0.15 * v),
        (systems.forced_pendulum, lambda x, v: -sin(x) - 0.15 * v),
    ],
)
def test_the_equations(factory: Any, acceleration: Callable[[float, float], float]) -> None:
    x, v, t = 0.7, -0.4, 1.3
    system = factory(damping=0.15, forcing=0.2, frequency=2.0)
    assert system.derivative(t, (x, v)) == pytest.approx((v, acceleration(x, v) + 0.2 * cos(2.0 * t)), rel=1e-15)


@pytest.mark.parametrize(
    ("system", "points", "digits"),
    [
        (systems.two_well_duffing(), [(-0.77905493, 0.02741682), (1.21009083, 0.05529497)], 1e-8),
        (systems.forced_pendulum(), [(-0.4728, 2.0371), (-0.4782, -0.6082)], 1e-4),
    ],
    ids=["two-well Duffing", "forced pendulum"],
)
def test_fixed_points(system: ForcedSystem, points: list[tuple[float, float]], digits: float) -> None:
    """The two attractors are fixed points of the map, and stable."""
    strobe = stroboscopic_map(system)
    assert strobe(points) == pytest.approx(np.array(points), abs=3.0 * digits)
    assert np.abs(np.linalg.eigvals(jacobian(strobe, points))).max() < 1.0


@pytest.mark.parametrize(
    ("factory", "velocity", "critical"),
    [
        (systems.moon_li_duffing, lambda t: tanh(t / sqrt(2.0)) / cosh(t / sqrt(2.0)), 0.0881),
        (systems.helmholtz_oscillator, lambda t: 1.5 * tanh(0.5 * t) / cosh(0.5 * t) ** 2, 0.0633),
    ],
)
def test_melnikovs_critical_forcing(factory: Any, velocity: Callable[[float], float], critical: float) -> None:
    """Moon and Li (1985); Thompson (1989) gives the criterion.

    What the damping takes along the separatrix is as much as the force can give: damping times the integral of v^2 is
    forcing times the largest integral of v cos(frequency t + phase).  All velocities here are odd in time.
    """
    p = factory().parameters
    taken = quad(lambda t: velocity(t) ** 2, 0.0, 40.0)[0]
    given = abs(quad(lambda t: velocity(t) * sin(p.frequency * t), 0.0, 40.0, limit=200)[0])
    assert p.damping * taken / given == pytest.approx(critical, abs=6e-5)


@pytest.mark.thorough
def test_the_exponents_of_uedas_attractor() -> None:
    """0.1034 and -0.1534 in the unit of t (Sprott, *Chaos and Time-Series Analysis*, 2003); the sum is -damping."""
    strobe = stroboscopic_map(systems.ueda_oscillator())
    initial_conditions = strobe.iterate(np.random.default_rng(0).uniform(-2.0, 2.0, (500, 2)), 50).points
    exponents = Growing.along(strobe, initial_conditions, 300).exponents / (2.0 * pi)
    assert exponents.sum(axis=-1) == pytest.approx(-0.05, abs=1e-12)
    assert exponents.mean(axis=0) == pytest.approx([0.1034, -0.1534], abs=1e-3)


def test_the_limit_cycle_of_van_der_pol() -> None:
    """Unforced, for mu = 1: period 6.663286859323 and amplitude 2.008619860875."""
    period, amplitude = 6.663286859323, 2.008619860875
    system = systems.van_der_pol_oscillator(mu=1.0, forcing=0.0, frequency=2.0 * pi / period)
    strobe = stroboscopic_map(system, rtol=1e-12, atol=1e-12)
    assert strobe([amplitude, 0.0]) == pytest.approx([amplitude, 0.0], abs=1e-11)
    multipliers = np.sort(np.linalg.eigvals(jacobian(strobe, [amplitude, 0.0])).real)
    assert multipliers[1] == pytest.approx(1.0, abs=1e-9)  # along the cycle
    assert 0.0 < multipliers[0] < 1e-3
    settled = strobe.iterate([0.1, 0.0], 40).points
    assert np.linalg.norm(settled) > 1.5
    assert strobe(settled) == pytest.approx(settled, abs=1e-9)


def trace(system: ForcedSystem) -> float:
    return float(np.trace(jacobian(stroboscopic_map(system), [0.0, 0.0])))


def test_the_equations_of_mathieu_and_hill() -> None:
    x, v, t = 0.7, -0.4, 1.3
    mathieu = mathieu_equation(damping=0.2, delta=0.5, epsilon=0.3)
    assert mathieu.derivative(t, (x, v)) == pytest.approx((v, -(0.5 + 0.3 * cos(2.0 * t)) * x - 0.2 * v), rel=1e-15)
    stiffness = 0.5 + 0.3 * cos(2.0 * t) + 0.2 * cos(4.0 * t) - 0.1 * cos(6.0 * t)
    hill = hill_equation(damping=0.2, delta=0.5, epsilon1=0.3, epsilon2=0.2, epsilon3=-0.1)
    assert hill.derivative(t, (x, v)) == pytest.approx((v, -stiffness * x - 0.2 * v), rel=1e-14)


@pytest.mark.parametrize("q", [0.5, 2.0, -1.0])
def test_the_edges_of_mathieus_tongues(q: float) -> None:
    """On the characteristic curves a_m, b_m of SciPy's tables there is a solution of period pi or 2 pi."""
    for order in range(4):
        curves = [mathieu_a(order, abs(q))] + ([mathieu_b(order, abs(q))] if order else [])
        for characteristic in curves:
            system = mathieu_equation(damping=0.0, delta=float(characteristic), epsilon=-2.0 * q)
            assert trace(system) == pytest.approx(2.0 * (-1.0) ** order, abs=1e-8)


def test_the_lunar_perigee() -> None:
    """Hill (1886) found c = 1.071583277416; cos(pi c) is half the trace."""
    c = 2.0 - acos(0.5 * trace(hill_equation())) / pi
    assert c == pytest.approx(1.071583277416, abs=1e-9)
