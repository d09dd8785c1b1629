"""Series, their noise, and the extremes of free swings, against damped cosines whose extremes are known."""

from math import atan2, cos, pi

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from systems.lab import Envelope, natural_frequency, swing_envelope
from systems.lab.free_swings.swing_extremes import slowing
from systems.lab.time_series import neighbour_correlation, noise_level, widening

FREQUENCY, RATE = 11.9, 0.15
TIMES = np.arange(0.0, 8.0, 0.005)


def damped(phase: float = 0.3, noise: float = 0.0, seed: int = 0) -> NDArray[np.float64]:
    """0.3 exp(-RATE t) cos(FREQUENCY t + phase) about 0.02."""
    wave = 0.3 * np.exp(-RATE * TIMES) * np.cos(FREQUENCY * TIMES + phase)
    return 0.02 + wave + np.random.default_rng(seed).normal(0.0, noise, TIMES.size)


def extremes(times: NDArray[np.float64], phase: float = 0.3) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times and heights of the extremes nearest to some times: where the derivative is zero."""
    lag = atan2(-RATE, FREQUENCY)
    number = np.rint((FREQUENCY * times + phase - lag) / pi)
    exact = (number * pi + lag - phase) / FREQUENCY
    return exact, 0.3 * np.exp(-RATE * exact) * cos(lag)


def test_extremes_of_a_damped_cosine_without_noise() -> None:
    found = swing_envelope(TIMES, damped())
    times, heights = extremes(found.times)
    np.testing.assert_allclose(found.times, times, atol=5e-6)
    np.testing.assert_allclose(found.amplitudes, heights, atol=5e-5)
    assert found.rest == pytest.approx(0.02, abs=5e-5)
    assert (np.diff(found.sides) != 0).all()
    assert found.half_swings.tolist() == [1] * (len(found.times) - 1)
    assert len(found.times) == 30


@pytest.mark.thorough
@pytest.mark.parametrize("noise", [0.001, 0.004])
def test_errors_are_those_of_many_measurements(noise: float) -> None:
    heights, times, count = [], [], []
    for seed in range(40):
        phase = float(np.random.default_rng(1000 + seed).uniform(0.0, 2.0 * pi))
        found = swing_envelope(TIMES, damped(phase, noise, seed), rest=0.02)
        exact = extremes(found.times, phase)
        heights += list((found.amplitudes - exact[1]) / found.standard_errors)
        times += list((found.times - exact[0]) / found.time_errors)
        count.append(len(found.times))
        assert found.noise == pytest.approx(noise, rel=0.12)  # four standard errors
    assert min(count) >= 29
    assert max(count) <= 30
    for z in (np.array(heights), np.array(times)):
        assert abs(z.mean()) < 0.2
        assert z.std() == pytest.approx(1.0, abs=0.12)


@pytest.mark.parametrize("begin", [1.13, 1.44])
@pytest.mark.parametrize("length", [0.05, 0.5])
def test_gaps_hide_extremes_and_are_counted(begin: float, length: float) -> None:
    gapped = damped(noise=1e-3)
    gapped[(begin < TIMES) & (begin + length > TIMES)] = np.nan
    whole, found = swing_envelope(TIMES, damped(noise=1e-3)), swing_envelope(TIMES, gapped)
    nearest = np.array([np.abs(whole.times - t).argmin() for t in found.times])
    np.testing.assert_allclose(found.times, whole.times[nearest], atol=6e-3)
    assert np.diff(nearest).tolist() == found.half_swings.tolist()
    assert len(whole.times) - len(found.times) <= 2 + length * FREQUENCY / pi


def test_coarse_steps_make_no_monstrous_extremes() -> None:
    """Angles rounded to a third of the amplitude: caps are flat, and no extreme may leave the range of the samples."""
    found = swing_envelope(TIMES, np.round(damped() / 0.1) * 0.1)
    assert found.amplitudes.min() > 0.0 and found.amplitudes.max() < 0.35


def test_negative_correlation_narrows_no_error() -> None:
    alternating = np.array([1.0, -1.0, 1.0, -1.0, 1.0])
    assert neighbour_correlation(alternating) == pytest.approx(-1.0)
    assert widening(alternating) == 1.0
    # An autoregression of first order with the coefficient 0.5 widens errors by the square root of 1.5/0.5.
    noise = np.random.default_rng(0).normal(size=200_000)
    following = lfilter([1.0], [1.0, -0.5], noise)
    assert widening(following) == pytest.approx(np.sqrt(3.0), rel=0.02)


def test_noise_is_seen_past_a_cubic_and_gaps() -> None:
    times = np.sort(np.random.default_rng(0).uniform(0.0, 1.0, 4000))
    noise = np.random.default_rng(1).normal(0.0, 0.02, times.size)
    values = 3.0 - times + 40.0 * times**2 - 70.0 * times**3
    assert noise_level(times, values) == pytest.approx(0.0, abs=1e-12)
    values[::7] = np.nan
    assert noise_level(times, values + noise) == pytest.approx(0.02, rel=0.05)
    assert np.isnan(noise_level(times[:4], values[:4]))


def test_a_wide_swing_is_slow() -> None:
    """Hard case of the report's pendulum: 3 rad at l = 2.72 cm takes 0.851124077002 s."""
    small = 2.0 * pi * np.sqrt(0.0272 / 9.8)
    assert small * slowing(3.0) == pytest.approx(0.851124077002, rel=1e-12)


@pytest.mark.parametrize(
    ("times", "angles", "message"),
    [
        (TIMES, np.full(TIMES.size, 0.3), "is constant, 0.3: nothing moves"),
        (TIMES, np.full(TIMES.size, np.nan), "has 0 numbers: give at least"),
        (TIMES, 0.1 * TIMES, "extremes in"),
        (TIMES, damped(noise=0.3), "extremes in"),
        (TIMES[:150], damped()[:150], "has 2 extremes|have 2 extremes"),
        (TIMES[::40], damped()[::40], "at least 10 samples a half swing"),
        (TIMES, np.where(TIMES < 4.0, damped(), np.inf), "is infinite: mark what is missing with NaN"),
        (TIMES[::-1], damped(), r"times\[1\] is not after the one before"),
        (TIMES[1:], damped(), r"times have the shape \(1599,\) and angles \(1600,\)"),
        (TIMES, np.stack([damped()] * 2), r"times have the shape \(1600,\) and angles \(2, 1600\)"),
        (np.where(np.arange(TIMES.size) == 5, np.nan, TIMES), damped(), r"times\[5\] is not finite"),
        (TIMES, np.remainder(20.0 * damped(), 2.0 * pi), "unwrap them"),
        (TIMES, 20.0 * damped(), "over the top"),
    ],
)
def test_series_without_an_envelope(times: NDArray[np.float64], angles: NDArray[np.float64], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        swing_envelope(times, angles)


def test_half_swings_are_counted_where_most_extremes_are_hidden() -> None:
    """At random times gaps hide so many extremes that the usual interval is no half swing; phases tell the count."""
    hidden = 0
    for seed in range(8):
        rng = np.random.default_rng(seed)
        times = np.sort(rng.uniform(0.0, 8.0, 550))
        wave = 0.3 * np.exp(-RATE * times) * np.cos(FREQUENCY * times + 0.3)
        found = swing_envelope(times, 0.02 + wave + rng.normal(0.0, 0.006, times.size))
        exact = np.rint((FREQUENCY * found.times + 0.3 - atan2(-RATE, FREQUENCY)) / pi)
        assert found.half_swings.tolist() == np.diff(exact).astype(int).tolist()
        assert (found.misfits < 0.35).all()
        assert natural_frequency(found).value == pytest.approx(FREQUENCY, rel=0.01)
        hidden += float(np.median(np.diff(exact))) > 1.0
    assert hidden >= 3


def test_intervals_that_are_no_half_swings_are_refused() -> None:
    """Extremes on one side only, the last one where noise made it: 13 halves are neither 12 nor 14."""
    times = np.array([0.0, 2.0, 4.0, 6.0, 19.0])
    envelope = Envelope(times, np.full(5, 0.1), np.ones(5, np.int8), np.full(5, 1e-3), np.full(5, 0.01), 0.0, 1e-3)
    assert envelope.half_swings.tolist()[:3] == [2, 2, 2]
    with pytest.raises(ValueError, match="from the extreme at 6 s to the next one at 19 s it is no whole number"):
        natural_frequency(envelope)


def test_a_rod_that_has_stopped_beside_its_rest_makes_no_extremes() -> None:
    """Dry friction, and noise for as long again: what is out of step after the last swing is left out."""
    times = np.arange(0.0, 12.0, 0.013)
    number = np.floor(times * FREQUENCY / pi)
    heights = 0.3 - 0.02 * number - 0.01
    wave = np.where(heights > 0.0, heights, 0.0) * np.cos(FREQUENCY * times) + 0.01 * (-1.0) ** number
    stopped = times > 14.0 * pi / FREQUENCY
    wave[stopped] = 0.012
    for seed in range(10):
        noise = np.random.default_rng(seed).normal(0.0, 0.002, times.size)
        found = swing_envelope(times, wave + noise)
        assert found.times[-1] < 14.5 * pi / FREQUENCY
        assert (found.half_swings == 1).all()
        assert (found.misfits < 0.35).all()
