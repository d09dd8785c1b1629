"""Harmonics of recovered drives, and their peak-to-peak values."""

from math import pi

import numpy as np
import pytest
from recorded_drives import SHORT, TIMES, TWO, deviations

from systems import Gravity, HarmonicDrive, Pendulum, TriangleDrive, VerticalDrive, driven_pendulum, lab, scene


def test_triangles_have_their_harmonics() -> None:
    """Of odd order, 8 a/(pi k)^2 each."""
    found = lab.recover_drive(TIMES, lab.record_acceleration(TriangleDrive(300.0, 41.3, 0.4), TIMES, noise=1.0))
    order = np.arange(1, len(found.amplitudes) + 1)
    expected = np.where(order % 2 == 1, 8.0 * 300.0 / (pi * order) ** 2 / (2.0 * pi * 41.3 * order) ** 2, 0.0)
    assert len(order) >= 9
    assert (np.abs(found.amplitudes - expected) < 4.0 * found.amplitude_errors + 1e-3 * expected)[:9].all()
    assert isinstance(found.drive, HarmonicDrive)


def test_a_fundamental_below_a_stronger_harmonic_is_found() -> None:
    """The second and third harmonic accelerate 5 and 4 times as much."""
    drive = HarmonicDrive((0.001, 0.00125, 0.00045), (1.0, 2.0, 3.0), 20.3)
    found = lab.recover_drive(TIMES, lab.record_acceleration(drive, TIMES, noise=1.0, rng=2))
    assert len(found.amplitudes) == 3
    assert np.abs(deviations(drive, found)).max() < 4.0


def test_a_given_frequency_finds_what_has_no_fundamental() -> None:
    drive = HarmonicDrive((0.0, 0.001, 0.0005), (0.0, 2.0, 3.0), 20.3)
    found = lab.recover_drive(TIMES, lab.record_acceleration(drive, TIMES, noise=1.0), frequency=20.0)
    assert found.frequency == pytest.approx(20.3, abs=5 * found.frequency_error)
    assert found.amplitudes[1:] == pytest.approx([0.001, 0.0005], rel=0.01)
    assert found.amplitudes[0] < 4.0 * found.amplitude_errors[0]


def test_hum_near_a_harmonic_is_not_followed() -> None:
    """Hum of 50 Hz, stronger than a drive of 24.3 Hz that is given, is no second harmonic of 25 Hz."""
    drive = VerticalDrive(0.003, 24.3, 1.0)
    hum = 150.0 * np.cos(2.0 * pi * 50.0 * TIMES)
    found = lab.recover_drive(TIMES, lab.record_acceleration(drive, TIMES, noise=1.0) + hum, frequency=24.3)
    assert np.abs(deviations(drive, found)).max() < 3.0


def test_a_long_list_of_harmonics_is_shortened() -> None:
    times = TIMES[:400]
    square = 200.0 * np.sign(np.sin(2.0 * pi * 41.3 * times))
    found = lab.recover_drive(times, square + np.random.default_rng(0).normal(0.0, 1.0, times.size))
    assert f"mm and {len(found.amplitudes) - 4} harmonics more; 400 samples" in repr(found)


def test_peak_to_peak_of_harmonics() -> None:
    found = lab.recover_drive(TIMES, lab.record_acceleration(TWO, TIMES, noise=3.0))
    fine = np.linspace(0.0, 1.0 / 23.37, 200_001)
    assert found.peak_to_peak == pytest.approx(np.ptp(found.acceleration(fine)), rel=1e-8)
    errors = []
    for seed in range(40):
        one = lab.recover_drive(SHORT, lab.record_acceleration(TWO, SHORT, 10.0, rng=seed), harmonics=2)
        errors.append((one.peak_to_peak - np.ptp(lab.pivot_acceleration(TWO, fine))) / one.peak_to_peak_error)
    assert np.std(errors) == pytest.approx(1.0, abs=0.35)  # three standard errors of 40


def test_a_recovered_drive_drives_a_scene() -> None:
    found = lab.recover_drive(
        TIMES, lab.record_acceleration(driven_pendulum(amplitude=0.003), TIMES, noise=1.0, offset=9.8)
    )
    assert found.drive.parameters == pytest.approx({"amplitude": 0.003, "frequency": 50.0, "phase": 0.0}, abs=1e-3)
    assert "amplitude" in scene(Pendulum(0.0272), Gravity(9.8), found.drive).params
    assert found.reading(TIMES).mean() == pytest.approx(9.8, abs=0.1)
    assert repr(found).startswith("RecoveredDrive(49.99996 +- ")
    assert repr(found).endswith(" mm; 2000 samples)")
