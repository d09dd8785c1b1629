"""Decay profiles: the parabola, kinds of damping identified, and the natural frequency."""

from collections.abc import Callable
from math import pi, sin, sqrt, tanh

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad, solve_ivp

from systems import lab
from systems.lab.free_swings.decay_models import decaying

LENGTH = 0.069
FREQUENCY = sqrt(9.8 / LENGTH)
TIMES = np.arange(0.0, 8.0, 0.005)


def envelope(amplitudes: NDArray[np.float64], times: NDArray[np.float64], error: float = 1e-3) -> lab.Envelope:
    n = len(times)
    sides = np.where(np.arange(n) % 2, -1, 1).astype(np.int8)
    return lab.Envelope(times, amplitudes, sides, np.full(n, error), np.full(n, 1e-4), 0.0, error)


def film(amplitude: float, coefficients: dict[str, float], noise: float = 0.0, seed: int = 0) -> NDArray[np.float64]:
    """Angles of the released rod, by SciPy; smoothed signs stand for dry friction, which never gets to stick here."""
    c = {"damping": 0.0, "friction": 0.0, "drag": 0.0} | coefficients

    def rhs(t: float, x: NDArray[np.float64]) -> list[float]:
        angle, rate = x.tolist()
        lost = c["damping"] * rate + c["friction"] * tanh(rate / 1e-4) + c["drag"] * rate * abs(rate)
        return [rate, -(FREQUENCY**2) * sin(angle) - lost]

    found = solve_ivp(rhs, (0.0, TIMES[-1]), [amplitude, 0.0], "LSODA", TIMES, rtol=1e-9, atol=1e-11, max_step=0.02)
    return np.asarray(found.y[0] + np.random.default_rng(seed).normal(0.0, noise, TIMES.size))


def test_a_parabola_is_found_exactly() -> None:
    times = 0.27 * np.arange(1, 21)
    found = lab.quadratic_decay(envelope(0.0082 * times**2 - 0.1979 * times + 1.28, times), start_time=0.0)
    np.testing.assert_allclose(found.coefficients, [0.0082, -0.1979, 1.28], rtol=1e-10)
    assert found.rmse < 1e-12
    # REFERENCES.md: the report's own fit has 54 % of the curvature of an exponential.
    assert found.curvature == pytest.approx(0.54, abs=0.005)
    assert found([0.0, 1.0]) == pytest.approx([1.28, 1.0903])
    assert "RMSE" in repr(found)


@pytest.mark.thorough
def test_intervals_of_the_parabola_cover_as_often_as_they_say() -> None:
    times = 0.27 * np.arange(1, 21)
    exact, inside = np.array([0.0082, -0.1979, 1.28]), []
    for seed in range(400):
        noise = np.random.default_rng(seed).normal(0.0, 0.006664, times.size)
        found = lab.quadratic_decay(envelope(np.polyval(exact, times) + noise, times), start_time=0.0)
        inside.append(np.abs(found.coefficients - exact) < found.half_widths())
    # Binomial standard error of 400 trials: 0.011.
    assert np.mean(inside, axis=0) == pytest.approx([0.95] * 3, abs=0.035)


@pytest.mark.parametrize("amplitude", [1e-4, 0.3, 1.3, 2.8])
@pytest.mark.parametrize(("name", "power"), [("damping", 2), ("friction", 1), ("drag", 3)])
def test_losses_are_those_of_the_integrals_over_a_swing(amplitude: float, name: str, power: int) -> None:
    """Energy w^2 (1 - cos A) falls by the integral of abs(rate)^power over a period; the integrals by quadrature."""

    def rate(a: float) -> float:
        return FREQUENCY * sqrt(max(4.0 * (np.sin(0.5 * amplitude) ** 2 - np.sin(0.5 * a) ** 2), 0.0))

    # The angle is amplitude sin u, which takes the roots at the ends out of both integrals.
    def along(f: Callable[[float], float]) -> float:
        return quad(lambda u: f(amplitude * np.sin(u)) * amplitude * np.cos(u), 0.0, pi / 2, epsrel=1e-11, limit=200)[0]

    period = 4.0 * along(lambda a: 1.0 / rate(a))
    lost = 4.0 * along(lambda a: rate(a) ** (power - 1))
    expected = lost / (period * FREQUENCY**2 * np.sin(amplitude))
    step = 1e-3 * amplitude / expected
    now, later = decaying(amplitude + 0.5 * step * expected, {name: 1.0}, FREQUENCY, np.array([0.0, step]))
    assert (now - later) / step == pytest.approx(expected, rel=2e-5)


@pytest.mark.parametrize(
    ("kind", "coefficients"),
    [
        pytest.param("viscous", {"damping": 0.4}, marks=pytest.mark.thorough),
        pytest.param("dry", {"friction": 2.0}, marks=pytest.mark.thorough),
        pytest.param("quadratic", {"drag": 0.08}, marks=pytest.mark.thorough),
        ("viscous and dry", {"damping": 0.2, "friction": 1.2}),
    ],
)
def test_kinds_are_told_apart_and_measured_at_large_amplitude(kind: str, coefficients: dict[str, float]) -> None:
    motion = film(1.3, coefficients)
    right = []
    for seed in range(3):
        noisy = motion + np.random.default_rng(seed).normal(0.0, 0.004, TIMES.size)
        found = lab.compare_decays(lab.swing_envelope(TIMES, noisy))
        right.append(found.best.kind == kind)
        for name, value in coefficients.items():
            # Averaging leaves terms of second order in damping over frequency; errors of the fit are below them.
            assert found[kind].coefficients[name] == pytest.approx(
                value, abs=4.0 * found[kind].standard_errors[name] + 0.003 * value
            )
        assert sum(found.weights.values()) == pytest.approx(1.0)
    # Of two nested models Akaike's criterion takes the larger one too often, once in six: that is its nature.
    assert sum(right) >= 2


def first_period(motion: NDArray[np.float64]) -> lab.MotionFit:
    part = 2.0 * pi / FREQUENCY >= TIMES
    system = lab.free_pendulum(0.07, {"damping": 0.2})
    return lab.fit_motion(system, TIMES[part], motion[part], ["length", "damping"], zero=True)


@pytest.mark.parametrize(("amplitude", "damping"), [(1.3, 0.4), pytest.param(0.05, 0.0, marks=pytest.mark.thorough)])
def test_the_first_period_tells_length_and_damping(amplitude: float, damping: float) -> None:
    """Without noise, of the motion of SciPy: swings of any width, whose frequency damping does not bend."""
    fit = first_period(film(amplitude, {"damping": damping}))
    assert fit.estimates["length"] == pytest.approx(LENGTH, rel=4e-7)
    assert fit.estimates["damping"] == pytest.approx(damping, abs=1e-5)


def test_frequencies_of_a_decaying_swing() -> None:
    """Viscous damping lowers the frequency by gamma^2/(8 w^2) of itself, hardly more than the error."""
    motion = film(0.8, {"damping": 0.3}, noise=0.003)
    shifted = FREQUENCY * (1.0 - 0.3**2 / (8.0 * FREQUENCY**2))
    every = lab.natural_frequency(lab.swing_envelope(TIMES, motion))
    assert every.value == pytest.approx(shifted, abs=3.0 * every.standard_error)
    assert every.standard_error < 2e-3
    first = first_period(motion)
    assert first.estimates["length"] == pytest.approx(LENGTH, abs=3.0 * first.standard_errors["length"])
    assert 0.5 * first.estimates["damping"] == pytest.approx(0.15, abs=0.01)
    gapped = motion.copy()
    gapped[300:460] = np.nan
    assert lab.natural_frequency(lab.swing_envelope(TIMES, gapped)).value == pytest.approx(shifted, rel=3e-4)


def test_a_long_gap_in_a_wide_swing_bends_no_frequency() -> None:
    """Amplitudes fall to a third within it, and most of the slowing is at its beginning."""
    motion = film(1.0, {"damping": 0.4}, noise=0.001)
    shifted = FREQUENCY * (1.0 - 0.4**2 / (8.0 * FREQUENCY**2))
    motion[100:900] = np.nan
    found = lab.swing_envelope(TIMES, motion)
    assert found.half_swings.max() == 16
    assert lab.natural_frequency(found).value == pytest.approx(shifted, rel=4e-4)


@pytest.mark.thorough
def test_errors_of_the_first_period_cover() -> None:
    exact, z = film(0.1, {"damping": 0.1}), []
    for seed in range(25):
        fit = first_period(exact + np.random.default_rng(seed).normal(0.0, 1e-3, TIMES.size))
        z.append((fit.estimates["length"] - LENGTH) / fit.standard_errors["length"])
    # Standard error of a standard deviation of 25: 0.14; of their mean: 0.2.
    assert np.std(z) == pytest.approx(1.0, abs=0.45)
    assert abs(np.mean(z)) < 0.6
