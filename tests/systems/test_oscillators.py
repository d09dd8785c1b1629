"""Oscillators under a harmonic force, against closed forms, published numbers and those of tests/REFERENCES.md."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, cosh, pi, sin, sqrt, tanh
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.special import ellipk

from cellmap import CellGrid, ForcedSystem, find_basins, stroboscopic_map
from cellmap.attractors.chaos import lyapunov_exponents
from cellmap.maps import jacobian
from systems import (
    duffing_oscillator,
    forced_pendulum,
    helmholtz_oscillator,
    moon_li_duffing,
    two_well_duffing,
    ueda_oscillator,
    van_der_pol_oscillator,
)

DAMPED = (
    duffing_oscillator,
    two_well_duffing,
    moon_li_duffing,
    ueda_oscillator,
    helmholtz_oscillator,
    forced_pendulum,
)


@pytest.mark.parametrize(
    ("factory", "acceleration"),
    [
        (two_well_duffing, lambda x, v: x - x**3 - 0.15 * v),
        (moon_li_duffing, lambda x, v: 0.5 * x * (1.0 - x**2) - 0.15 * v),
        (ueda_oscillator, lambda x, v: -(x**3) - 0.15 * v),
        (helmholtz_oscillator, lambda x, v: x**2 - x - 0.15 * v),
        (forced_pendulum, lambda x, v: -sin(x) - 0.15 * v),
    ],
)
def test_the_equations(factory: Any, acceleration: Callable[[float, float], float]) -> None:
    x, v, t = 0.7, -0.4, 1.3
    system = factory(damping=0.15, forcing=0.2, frequency=2.0)
    assert system.derivative(t, (x, v)) == pytest.approx((v, acceleration(x, v) + 0.2 * cos(2.0 * t)), rel=1e-15)


@pytest.mark.parametrize(
    ("factory", "linear", "cubic"),
    [(two_well_duffing, -1.0, 1.0), (moon_li_duffing, -0.5, 0.5), (ueda_oscillator, 0.0, 1.0)],
)
def test_the_named_duffing_oscillators_are_special_cases(factory: Any, linear: float, cubic: float) -> None:
    general = duffing_oscillator(damping=0.3, linear=linear, cubic=cubic, forcing=0.4, frequency=1.2)
    special = factory(damping=0.3, forcing=0.4, frequency=1.2)
    for state in np.random.default_rng(0).uniform(-2.0, 2.0, (5, 2)):
        assert special.derivative(0.8, state) == pytest.approx(general.derivative(0.8, state), rel=1e-14, abs=1e-14)


@pytest.mark.parametrize("factory", DAMPED)
def test_bad_parameters_are_refused(factory: Any) -> None:
    with pytest.raises(ValueError, match=r"damping=-0.1: give a number of at least 0"):
        factory(damping=-0.1)
    with pytest.raises(ValueError, match=r"frequency=0.0: give a number above 0"):
        factory(frequency=0.0)


@pytest.mark.parametrize(
    ("system", "points", "digits"),
    [
        (two_well_duffing(), [(-0.77905493, 0.02741682), (1.21009083, 0.05529497)], 1e-8),
        (forced_pendulum(), [(-0.4728, 2.0371), (-0.4782, -0.6082)], 1e-4),
    ],
    ids=["two-well Duffing", "forced pendulum"],
)
def test_fixed_points(system: ForcedSystem, points: list[tuple[float, float]], digits: float) -> None:
    """The two attractors are fixed points of the map, and stable."""
    strobe = stroboscopic_map(system)
    assert strobe(points) == pytest.approx(np.array(points), abs=3.0 * digits)
    assert np.abs(np.linalg.eigvals(jacobian(strobe, points))).max() < 1.0


@pytest.mark.parametrize(("linear", "cubic", "amplitude"), [(1.0, 1.0, 1.5), (1.0, -0.2, 1.5), (0.0, 1.0, 2.0)])
def test_the_free_duffing_oscillator_has_its_exact_period(linear: float, cubic: float, amplitude: float) -> None:
    """4 K(m)/sqrt(linear + cubic a^2) at the amplitude a, with m = cubic a^2 / (2 (linear + cubic a^2))."""
    square = linear + cubic * amplitude**2
    period = 4.0 * ellipk(0.5 * cubic * amplitude**2 / square) / sqrt(square)
    free = {"damping": 0.0, "forcing": 0.0, "frequency": 2.0 * pi / period}
    systems = [duffing_oscillator(linear=linear, cubic=cubic, **free)]
    if linear == 0.0:
        systems.append(ueda_oscillator(**free))
    for system in systems:
        image = stroboscopic_map(system, rtol=1e-12, atol=1e-12)([amplitude, 0.0])
        assert image == pytest.approx([amplitude, 0.0], abs=1e-10)


SEPARATRICES: list[Any] = [
    # Orbits that leave a saddle and return to it, and Melnikov's critical force with the factory's defaults.
    pytest.param(
        two_well_duffing,
        lambda t: (sqrt(2.0) / cosh(t), -sqrt(2.0) * tanh(t) / cosh(t)),
        None,
        id="two-well Duffing",
    ),
    pytest.param(
        moon_li_duffing,
        lambda t: (sqrt(2.0) / cosh(t / sqrt(2.0)), -tanh(t / sqrt(2.0)) / cosh(t / sqrt(2.0))),
        0.0881,
        id="Moon and Li",
    ),
    pytest.param(
        helmholtz_oscillator,
        lambda t: (1.0 - 1.5 / cosh(0.5 * t) ** 2, 1.5 * tanh(0.5 * t) / cosh(0.5 * t) ** 2),
        0.0633,
        id="Helmholtz",
    ),
]


@pytest.mark.parametrize(("factory", "orbit", "critical"), SEPARATRICES)
def test_separatrices(factory: Any, orbit: Callable[[float], tuple[float, float]], critical: float | None) -> None:
    """The free oscillator follows the closed form."""
    strobe = stroboscopic_map(factory(damping=0.0, forcing=0.0, frequency=2.0 * pi / 3.0), rtol=1e-12, atol=1e-12)
    for begin in (-2.5, -1.0, 0.4):
        assert strobe(orbit(begin)) == pytest.approx(orbit(begin + 3.0), abs=1e-10)


@pytest.mark.parametrize(("factory", "orbit", "critical"), SEPARATRICES[1:])
def test_melnikovs_critical_forcing(
    factory: Any, orbit: Callable[[float], tuple[float, float]], critical: float
) -> None:
    """Moon and Li (1985); Thompson (1989) gives the criterion.

    What the damping takes along the separatrix is as much as the force can give: damping times the integral of v^2 is
    forcing times the largest integral of v cos(frequency t + phase).  All velocities here are odd in time.
    """
    p = factory().parameters
    taken = quad(lambda t: orbit(t)[1] ** 2, 0.0, 40.0)[0]
    given = abs(quad(lambda t: orbit(t)[1] * sin(p.frequency * t), 0.0, 40.0, limit=200)[0])
    assert p.damping * taken / given == pytest.approx(critical, abs=6e-5)


def test_a_small_and_a_large_oscillation_coexist_in_a_hardening_spring() -> None:
    system = duffing_oscillator()
    basins = find_basins(stroboscopic_map(system), CellGrid((-3.0, -3.0), (3.0, 3.0), (30, 30)))
    assert [a.period for a in basins.attractors] == [1, 1]
    assert sum(f.fraction for k, f in basins.fractions.items() if k >= 0) == 1.0
    # Harmonic balance: ((1 - w^2 + 3/4 a^2)^2 + (damping w)^2) a^2 = forcing^2 (Kovacic, Brennan 2011).
    w = 1.4
    squares = np.roots([9.0 / 16.0, 1.5 * (1.0 - w * w), (1.0 - w * w) ** 2 + (0.1 * w) ** 2, -0.09])
    assert np.abs(squares.imag).max() == 0.0
    small, _, large = np.sqrt(np.sort(squares.real))
    times = np.arange(64) / 64.0 * system.length
    for attractor, amplitude in zip(basins.attractors, (small, large), strict=True):
        solution = solve_ivp(system.fun, (0.0, system.length), attractor.points[0], "DOP853", times, rtol=1e-9)
        assert 2.0 * abs(np.mean(solution.y[0] * np.exp(1j * w * times))) == pytest.approx(amplitude, rel=0.02)


def test_the_exponents_of_uedas_attractor() -> None:
    """0.1034 and -0.1534 in the unit of t (Sprott, *Chaos and Time-Series Analysis*, 2003); the sum is -damping."""
    strobe = stroboscopic_map(ueda_oscillator())
    initial_conditions = strobe.iterate(np.random.default_rng(0).uniform(-2.0, 2.0, (500, 2)), 50).points
    exponents = lyapunov_exponents(strobe, initial_conditions, 300)[0] / (2.0 * pi)
    assert exponents.sum(axis=-1) == pytest.approx(-0.05, abs=1e-12)
    assert exponents.mean(axis=0) == pytest.approx([0.1034, -0.1534], abs=1e-3)


def test_the_lip_of_the_helmholtz_oscillator() -> None:
    """Without the force it is a saddle with the exponents -b/2 +- sqrt(b^2/4 + 1); orbits beyond it diverge."""
    system = helmholtz_oscillator(forcing=0.0)
    strobe = stroboscopic_map(system)
    rates = np.log(np.linalg.eigvals(jacobian(strobe, [1.0, 0.0])).real) / system.length
    assert np.sort(rates) == pytest.approx([-0.05 - sqrt(1.0025), -0.05 + sqrt(1.0025)], abs=1e-9)
    basins = find_basins(strobe, [(0.99, 0.0), (1.01, 0.0), (-2.0, 0.0)])
    assert basins.labels.tolist() == [0, -2, -2]
    assert basins.attractors[0].points == pytest.approx(np.zeros((1, 2)), abs=1e-9)


def test_the_limit_cycle_of_van_der_pol() -> None:
    """Unforced, for mu = 1: period 6.663286859323 and amplitude 2.008619860875."""
    period, amplitude = 6.663286859323, 2.008619860875
    system = van_der_pol_oscillator(mu=1.0, forcing=0.0, frequency=2.0 * pi / period)
    strobe = stroboscopic_map(system, rtol=1e-12, atol=1e-12)
    assert strobe([amplitude, 0.0]) == pytest.approx([amplitude, 0.0], abs=1e-11)
    multipliers = np.sort(np.linalg.eigvals(jacobian(strobe, [amplitude, 0.0])).real)
    assert multipliers[1] == pytest.approx(1.0, abs=1e-9)  # along the cycle
    assert 0.0 < multipliers[0] < 1e-3
    settled = strobe.iterate([0.1, 0.0], 40).points
    assert np.linalg.norm(settled) > 1.5
    assert strobe(settled) == pytest.approx(settled, abs=1e-9)


@pytest.mark.parametrize("mu", [0.05, 0.1])
def test_the_limit_cycle_of_a_weak_van_der_pol(mu: float) -> None:
    """Period and amplitude by the series of Lindstedt and Poincaré; the next terms are of the order mu^6."""
    period = 2.0 * pi * (1.0 + mu**2 / 16.0 - 5.0 * mu**4 / 3072.0)
    amplitude = 2.0 + mu**2 / 96.0 - 1033.0 * mu**4 / 552960.0
    system = van_der_pol_oscillator(mu=mu, forcing=0.0, frequency=2.0 * pi / period)
    image = stroboscopic_map(system, rtol=1e-12, atol=1e-12)([amplitude, 0.0])
    assert image == pytest.approx([amplitude, 0.0], abs=2e-2 * mu**6)


def test_van_der_pol_locks_to_the_force() -> None:
    basins = find_basins(stroboscopic_map(van_der_pol_oscillator()), CellGrid((-3.0, -3.0), (3.0, 3.0), (12, 12)))
    assert [a.period for a in basins.attractors] == [1]
    assert basins.fractions[0].fraction == 1.0


def test_van_der_pol_refuses_a_negative_mu() -> None:
    with pytest.raises(ValueError, match=r"mu=-1.0: give a number of at least 0"):
        van_der_pol_oscillator(mu=-1.0)
