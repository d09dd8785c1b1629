"""Studies of measurements: films, decays and shakers, with the truth known."""

from math import pi

import numpy as np
import pytest

from cellmap import trajectory
from studies import decay, shaker, tracking
from systems import LONG_ROD
from systems.lab import (
    Bar,
    Camera,
    Look,
    Rod,
    free_pendulum,
    pivot_acceleration,
    quadratic_decay,
    record_acceleration,
    recover_drive,
    swing_envelope,
)


@pytest.mark.parametrize("film", [4.0, 8.0])
def test_a_simulated_rod_has_the_parabola_of_the_report(film: float) -> None:
    """Averaging and extremes are two ways; they agree to a small part of the report's own intervals."""
    rod = decay.with_parabola(film)
    system = free_pendulum(LONG_ROD, rod.coefficients)
    motion = trajectory(system, [rod.amplitude, 0.0], round(film / system.length), 105)
    found = quadratic_decay(swing_envelope(motion.times, motion.states[:, 0]), start_time=0.0)
    assert (np.abs(found.coefficients - decay.REPORT) < 0.5 * decay.INTERVALS).all()


def test_a_short_film_of_a_rod(capsys: pytest.CaptureFixture[str]) -> None:
    """Past the bar, beside a bright object, with dropped frames; true centres are known."""
    system = free_pendulum(0.069, {"damping": 0.4})
    motion = trajectory(system, [2.4, 0.0], 1, samples_per_period=120)
    camera = Camera(scale=450.0, origin=(43.0, 37.0), shape=(86, 86))
    rods, bars = [Rod(0, camera.origin, 0.069 * camera.scale)], [Bar(30.0, 36.0, 0.0, 85.0)]
    case = tracking.film_and_track(motion, camera, 200.0, 0.002, 0.4, Look(), bars, rods, 1, 1)
    tracking.report(case)
    assert "taken for another: 0 (expected 0); hidden in part and not flagged: 0" in capsys.readouterr().out
    assert (case.recording.visible < 0.5).any()
    assert tracking.rms(case.errors) < 0.1
    assert tracking.rms(tracking.angle_errors(case) / case.angles.errors) == pytest.approx(1.0, abs=0.4)
    assert len(tracking.draw([case, case]).axes) == 6


@pytest.mark.parametrize("drive", [shaker.SINE, shaker.TWO, shaker.TRIANGLE])
def test_true_harmonics_are_those_of_the_drive(drive: shaker.Effect) -> None:
    """By Fourier sums over one period; 4,096 samples of a triangle alias its far harmonics at 1e-6 of the first."""
    frequency, n = drive.parameters["frequency"], 4096
    factors = np.fft.rfft(pivot_acceleration(drive, np.arange(n) / (n * frequency)))[1:8] * 2.0 / n
    order = np.arange(1, 8)
    amplitudes, phases = shaker.true_harmonics(drive, 7)
    there = np.isfinite(phases)
    expected = -amplitudes * (2.0 * pi * frequency * order) ** 2 * np.exp(1j * np.where(there, phases, 0.0))
    np.testing.assert_allclose(factors, expected, atol=1e-5 * np.abs(factors).max())


def test_an_error_is_carried_over_to_the_critical_amplitude() -> None:
    found = recover_drive(shaker.EVEN, record_acceleration(shaker.TWO, shaker.EVEN, 5.0, rng=1))
    true = shaker.critical_amplitude(np.array(shaker.TWO.amplitudes), np.array(shaker.TWO.phases), shaker.TWO.frequency)
    value, error = shaker.carried_over(found)
    assert abs(value - true) < 3.5 * error
    # Averaging has the mean square of the velocity: A1^2 + (2 A2)^2 = 2 g l/w^2; damping and the drive's size matter.
    w = 2.0 * pi * shaker.TWO.frequency
    averaged = np.sqrt(2.0 * shaker.GRAVITY * shaker.ROD / w**2 - (2.0 * shaker.TWO.amplitudes[1]) ** 2)
    assert true == pytest.approx(averaged, rel=0.02)
