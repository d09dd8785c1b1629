"""Records with gaps, late clocks, saturation, dead times and aliases; records that are refused."""

from math import inf, pi
from typing import Any

import numpy as np
import pytest
from recorded_drives import SINE, TIMES, deviations

from systems import Gravity, HorizontalDrive, TorqueDrive, VerticalDrive, driven_pendulum
from systems.lab import record_acceleration, recover_drive


def test_a_gap_and_a_late_clock() -> None:
    times = TIMES[(TIMES < 0.3) | (TIMES > 0.8)] + 1000.0
    found = recover_drive(times, record_acceleration(SINE, times, 3.0))
    assert np.abs(deviations(SINE, found)).max() < 3.5
    # The phase at time 0 is known as well as the frequency over 1,000 s.
    assert found.phase_errors[0] == pytest.approx(2.0 * pi * 1000.55 * found.frequency_error, rel=0.01)


def test_steps_of_a_converter_are_no_saturation() -> None:
    """With 5 bits over 400 m/s^2 the turning points are long runs of equal samples."""
    found = recover_drive(TIMES, record_acceleration(SINE, TIMES, full_scale=400.0, bits=5))
    assert found.clipped == 0
    assert np.abs(deviations(SINE, found)).max() < 2.0


def test_saturated_samples_are_left_out() -> None:
    for faults in ({}, {"noise": 3.0}, {"noise": 3.0, "bits": 10}):
        record = record_acceleration(SINE, TIMES, full_scale=200.0, **faults)  # type: ignore[arg-type]
        found = recover_drive(TIMES, record)
        # A fraction 1 - 2/pi asin(200/265.8) = 0.459 of a sine of 265.8 m/s^2 is beyond 200; a little more with noise.
        assert found.clipped / 2000 == pytest.approx(0.459, abs=0.06)
        assert found.amplitudes[0] == pytest.approx(0.003, abs=4 * found.amplitude_errors[0] + 1e-10)
    told = recover_drive(TIMES, record, limits=(-150.0, 150.0))
    assert np.abs(deviations(SINE, told)).max() < 4.0
    naive = recover_drive(TIMES, record, limits=(-inf, inf))
    assert naive.amplitudes[0] < 0.0028


@pytest.mark.parametrize("fraction", [0.65, 0.85])
def test_saturation_before_the_noise_is_found_by_its_crowd(fraction: float) -> None:
    """A sensor that saturates, and a converter that adds noise: extremes are not equal, but crowd."""
    top = fraction * 0.003 * (2.0 * pi * 47.37) ** 2
    for seed in range(4):
        noise = np.random.default_rng(seed).normal(0.0, 0.5, TIMES.size)
        found = recover_drive(TIMES, np.clip(record_acceleration(SINE, TIMES), -top, top) + noise)
        assert found.clipped > 0.25 * TIMES.size
        assert len(found.amplitudes) == 1
        assert np.abs(deviations(SINE, found)).max() < 4.0


@pytest.mark.parametrize("value", [0.0, -150.0, None])
def test_a_dead_time_is_a_gap(value: float | None) -> None:
    """For a seventh of the record the sensor repeats one reading; taken for data, 0.003 m come out 15 % too small."""
    dead = slice(600, 900)
    for limits in (inf, 600.0):
        record = np.clip(record_acceleration(SINE, TIMES, noise=1.0, rng=4), -limits, limits)
        record[dead] = record[600] if value is None else value
        found = recover_drive(TIMES, record)
        assert found.missing in (300, 301)
        assert np.abs(deviations(SINE, found)).max() < 4.0


def test_a_wave_that_rests_in_every_period_is_not_dead() -> None:
    """Two of five parts of each period are even: they belong to the wave, and nothing is left out."""
    rotations = 20.0 * TIMES
    shape = np.where(np.mod(rotations, 1.0) < 0.6, np.sin(2.0 * pi * np.mod(rotations, 1.0) / 0.6), 0.0)
    found = recover_drive(TIMES, 300.0 * shape)
    assert found.missing == 0
    assert found.frequency == pytest.approx(20.0, rel=1e-3)


def test_an_alias_is_taken_for_what_it_looks_like() -> None:
    """90 Hz, sampled at 100 Hz, is 10 Hz; told the truth, there is an error."""
    times = np.arange(200) / 100.0
    record = record_acceleration(VerticalDrive(0.003, 90.0), times, 0.1)
    assert recover_drive(times, record).frequency == pytest.approx(10.0, abs=1e-3)
    with pytest.raises(ValueError, match=r"frequency=90.0: .* below the limit of Nyquist, 50 Hz; sample faster"):
        recover_drive(times, record, frequency=90.0)


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda r: (TIMES, 0.0 * r + 9.8), ValueError, "acceleration is constant, 9.8"),
        (lambda r: (TIMES, np.full(2000, np.nan)), ValueError, "acceleration has 0 numbers: give at least 10"),
        (lambda r: (TIMES[:9], r[:9]), ValueError, "acceleration has 9 numbers"),
        (lambda r: (TIMES[:55], r[:55]), ValueError, "no drive found: .* slower than two periods"),
        (lambda r: (TIMES, 5.0 * TIMES), ValueError, "no drive found"),
        (lambda r: (TIMES[::-1], r), ValueError, r"times\[1\] is not after the one before"),
        (lambda r: (0.0 * TIMES, r), ValueError, r"times\[1\] is not after"),
        (lambda r: (TIMES, r[:-1]), ValueError, r"times have the shape \(2000,\) and acceleration \(1999,\)"),
        (lambda r: (np.where(TIMES == 0.5, np.nan, TIMES), r), ValueError, r"times\[1000\] is not finite"),
        (lambda r: (TIMES, np.where(TIMES == 0.5, inf, r)), ValueError, r"acceleration\[1000\] is infinite"),
        (lambda r: (TIMES, "record"), TypeError, "acceleration: give real numbers"),
        (lambda r: (TIMES, r, 1001.0), ValueError, "frequency=1001.0: .* below the limit of Nyquist, 1000 Hz"),
        (lambda r: (TIMES, r, 1.5), ValueError, "frequency=1.5: the record .* spans 1.5 periods"),
        (lambda r: (TIMES, r, -1.0), ValueError, "frequency=-1.0: give a number above 0"),
        (lambda r: (TIMES, r, 60.0), ValueError, "no drive found: .* no line near 60 Hz"),
        (lambda r: (TIMES, r, 47.0, 30), ValueError, "harmonics=30: give at most 21, all below the limit of Nyquist"),
        (lambda r: (TIMES, r, None, 0), ValueError, "harmonics=0: give a whole number of at least 1"),
        (lambda r: (TIMES, r, None, None, True, (1.0, -1.0)), ValueError, "give the lower one first"),
        (lambda r: (TIMES, r, None, None, True, 3.0), TypeError, "limits=3.0: give two numbers"),
        (lambda r: (TIMES, r, None, None, True, None, "red"), ValueError, "noise='red': choose one of"),
        (lambda r: (TIMES, np.clip(r, -1.0, 1.0)), ValueError, "of the samples stand at the extremes: the sensor"),
    ],
)
def test_bad_records_are_refused(make: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        recover_drive(*make(record_acceleration(SINE, TIMES, noise=1.0)))


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: record_acceleration(Gravity(9.8), TIMES), ValueError, "give a drive that moves the pivot up and down"),
        (lambda: record_acceleration(HorizontalDrive(0.1, 5.0), TIMES), ValueError, "up and down"),
        (lambda: record_acceleration(TorqueDrive(0.1, 5.0), TIMES), ValueError, "up and down"),
        (lambda: record_acceleration(driven_pendulum(amplitude=0.0), TIMES), ValueError, "does not move up and down"),
        (lambda: record_acceleration(3.0, TIMES), TypeError, "source=3.0: give a drive"),  # type: ignore[arg-type]
        (lambda: record_acceleration(SINE, TIMES[::-1]), ValueError, "increasing"),
        (lambda: record_acceleration(SINE, TIMES, bits=8), ValueError, "bits=8: give the full_scale"),
        (lambda: record_acceleration(SINE, TIMES, noise=-1.0), ValueError, "noise=-1.0"),
        (lambda: record_acceleration(SINE, TIMES, missing=1.5), ValueError, "missing=1.5"),
    ],
)
def test_bad_sensors_are_refused(make: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        make()
