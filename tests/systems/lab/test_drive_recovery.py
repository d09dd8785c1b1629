"""Drives from records of an accelerometer: exact ones, errors against truth over seeds, faults, and what is none."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import inf, pi
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import least_squares

from systems import (
    Effect,
    Gravity,
    HarmonicDrive,
    HorizontalDrive,
    Pendulum,
    RotatingDrive,
    SquareDrive,
    TiltedDrive,
    TorqueDrive,
    TriangleDrive,
    VerticalDrive,
    driven_pendulum,
    scene,
)
from systems.lab import (
    RecoveredDrive,
    displacement_amplitude,
    pivot_acceleration,
    record_acceleration,
    recover_drive,
    volts_from_acceleration,
)
from systems.lab.shaker import harmonic_fit

Array = NDArray[np.float64]

TIMES = np.arange(2000) / 2000.0
SHORT = np.arange(500) / 1000.0
SINE = VerticalDrive(0.003, 47.37, 3.1)
TWO = HarmonicDrive((0.003, 0.0005), (3.1, -1.0), 23.37)


def wrapped(angle: Any) -> Any:
    return np.angle(np.exp(1j * np.asarray(angle)))


def deviations(drive: Effect, found: RecoveredDrive) -> Array:
    """Errors of frequency, amplitudes and phases, in standard errors."""
    if isinstance(drive, HarmonicDrive):
        amplitudes, phases = np.array(drive.amplitudes), np.array(drive.phases)
    else:
        amplitudes, phases = np.array([drive.parameters["amplitude"]]), np.array([drive.parameters["phase"]])
    return np.concatenate(
        [
            [(found.frequency - drive.parameters["frequency"]) / found.frequency_error],
            (found.amplitudes - amplitudes) / found.amplitude_errors,
            wrapped(found.phases - phases) / found.phase_errors,
        ]
    )


# --- records


@pytest.mark.parametrize(
    ("drive", "wave"),
    [
        (SINE, lambda a: -0.003 * (2 * pi * 47.37) ** 2 * np.cos(a + 3.1)),
        (TiltedDrive(0.003, 47.37, 0.3), lambda a: -0.003 * np.cos(0.3) * (2 * pi * 47.37) ** 2 * np.cos(a)),
        (RotatingDrive(0.003, 0.001, 47.37), lambda a: -0.003 * (2 * pi * 47.37) ** 2 * np.cos(a)),
        (SquareDrive(70.0, 47.37, 0.4), lambda a: -70.0 * np.sign(np.cos(a + 0.4))),
        (TriangleDrive(70.0, 47.37, 0.4), lambda a: -70.0 * 2 / pi * np.arcsin(np.cos(a + 0.4))),
    ],
    ids=lambda v: type(v).__name__,
)
def test_a_sensor_feels_the_acceleration_of_the_pivot(drive: Effect, wave: Callable[[Array], Array]) -> None:
    times = TIMES[::7] + 1e-4
    expected = wave(2.0 * pi * 47.37 * times)
    np.testing.assert_allclose(pivot_acceleration(drive, times), expected, rtol=1e-10, atol=1e-9)
    # A scene tells it by differences, unless the wave has edges.
    if not drive.terms.clocks:
        np.testing.assert_allclose(pivot_acceleration(scene(Pendulum(1.0), drive), times), expected, atol=1e-7)


def test_faults_of_a_record() -> None:
    clean = pivot_acceleration(SINE, TIMES)
    np.testing.assert_allclose(record_acceleration(SINE, TIMES, offset=9.8, drift=2.0), clean + 9.8 + 2.0 * TIMES)
    volts = record_acceleration(SINE, TIMES, volts_per_g=0.1)
    np.testing.assert_allclose(volts, clean / 98.0)
    noisy = record_acceleration(SINE, TIMES, noise=3.0, rng=1)
    assert np.std(noisy - clean) == pytest.approx(3.0, rel=0.05)  # 2,000 samples tell it to 1.6 %
    assert (noisy == record_acceleration(SINE, TIMES, noise=3.0, rng=1)).all()
    coloured = record_acceleration(SINE, TIMES, noise=3.0, noise_time=2e-3) - clean
    neighbours = np.corrcoef(coloured[:-1], coloured[1:])[0, 1]
    assert neighbours == pytest.approx(np.exp(-0.25), abs=0.06)  # 5e-4 s apart; (1 - r^2)/n is 0.014
    stepped = record_acceleration(SINE, TIMES, full_scale=400.0, bits=8)
    assert np.abs(stepped - clean).max() <= 0.5 * 400.0 / 128 + 1e-9
    np.testing.assert_allclose(stepped / (400.0 / 128), np.rint(stepped / (400.0 / 128)), atol=1e-9)
    assert np.abs(record_acceleration(SINE, TIMES, full_scale=200.0)).max() == 200.0
    lost = np.isnan(record_acceleration(SINE, TIMES, missing=0.3, rng=2)).mean()
    assert lost == pytest.approx(0.3, abs=0.04)  # 0.01 of standard error


# --- exact records


@pytest.mark.parametrize("drive", [SINE, TWO, VerticalDrive(0.003, 50.0, pi), VerticalDrive(1e-9, 2.5, -pi + 1e-9)])
@pytest.mark.parametrize("offset", [0.0, 1e3])
def test_a_clean_record_gives_the_drive_back(drive: Effect, offset: float) -> None:
    found = recover_drive(
        TIMES,
        record_acceleration(drive, TIMES) * (1.0 + 0.0 * TIMES)
        + offset * np.max(np.abs(pivot_acceleration(drive, TIMES))),
    )
    made = found.drive
    assert type(made) is type(drive)
    assert made.frequency == pytest.approx(drive.parameters["frequency"], rel=1e-9)
    for name, value in drive.parameters.items():
        if name.startswith("phase"):
            assert wrapped(made.parameters[name] - value) == pytest.approx(0.0, abs=1e-7)
            assert -pi < made.parameters[name] <= pi
        else:
            assert made.parameters[name] == pytest.approx(value, rel=1e-8)
    np.testing.assert_allclose(
        found.acceleration(TIMES), pivot_acceleration(made, TIMES), rtol=1e-9, atol=1e-9 * found.peak_to_peak
    )


def test_the_least_squares_are_those_of_scipy() -> None:
    """All parameters at once by SciPy; its Jacobian and the residuals give the same errors for white noise."""
    record = record_acceleration(TWO, SHORT, noise=10.0, offset=9.8, drift=5.0, rng=4)
    found = recover_drive(SHORT, record, harmonics=2, noise="white")

    def residual(p: Array) -> Array:
        w = 2.0 * pi * p[0]
        model = p[5] + p[6] * (SHORT - SHORT[-1] / 2)
        for k in (1, 2):
            model = model - p[k] * 1e-3 * (k * w) ** 2 * np.cos(k * w * SHORT + p[2 + k])
        return model - record

    start = [23.37, 3.0, 0.5, 3.1, -1.0, 9.8, 0.0]
    solution = least_squares(residual, start, xtol=1e-15, ftol=1e-15, gtol=1e-15, x_scale="jac", jac="3-point")
    covariance = np.linalg.inv(solution.jac.T @ solution.jac) * 2.0 * solution.cost / (len(SHORT) - 7)
    errors = np.sqrt(covariance.diagonal())
    ours = [found.frequency, *1e3 * found.amplitudes, *found.phases, found.mean, found.drift]
    # Both stop within 1e-4 of the errors.
    assert np.abs((np.array(ours) - solution.x) / errors).max() < 3e-4
    # Student's factor for 493 degrees of freedom is 1.0024.
    assert found.frequency_error == pytest.approx(errors[0], rel=4e-3)
    assert 1e3 * found.amplitude_errors == pytest.approx(errors[1:3], rel=4e-3)
    assert found.phase_errors == pytest.approx(errors[3:5], rel=4e-3)
    assert (found.mean_error, found.drift_error) == pytest.approx(errors[5:7], rel=4e-3)
    assert found.noise == pytest.approx(10.0, rel=0.1)


def test_errors_of_a_sine_are_the_least_possible() -> None:
    """Cramer and Rao: amplitude sqrt(2/n) s, frequency sqrt(6/n)/(pi T R) s, for n samples of white noise s."""
    record = record_acceleration(SINE, TIMES, noise=3.0, rng=8)
    found = recover_drive(TIMES, record, noise="white", drift=False)
    peak = 0.003 * (2.0 * pi * 47.37) ** 2
    assert found.frequency_error == pytest.approx(3.0 * np.sqrt(6.0 / 2000) / (pi * peak), rel=0.05)
    assert found.amplitude_errors[0] / 0.003 == pytest.approx(3.0 * np.sqrt(2.0 / 2000) / peak, rel=0.05)


# --- errors over seeds


def uneven(seed: int) -> tuple[Array, Array]:
    times = np.sort(np.random.default_rng(seed).uniform(0.0, 0.5, 500))
    return times, record_acceleration(SINE, times, 30.0, rng=seed)


RECORDS: dict[str, tuple[Effect, Callable[[int], tuple[Array, Array]]]] = {
    "white": (SINE, lambda s: (SHORT, record_acceleration(SINE, SHORT, 30.0, offset=9.8, rng=s))),
    "two harmonics": (TWO, lambda s: (SHORT, record_acceleration(TWO, SHORT, 10.0, rng=s))),
    "coloured": (SINE, lambda s: (SHORT, record_acceleration(SINE, SHORT, 30.0, 0.005, rng=s))),
    "uneven": (SINE, uneven),
    "lost": (SINE, lambda s: (SHORT, record_acceleration(SINE, SHORT, 30.0, missing=0.5, rng=s))),
    "8 bits": (SINE, lambda s: (SHORT, record_acceleration(SINE, SHORT, 2.0, full_scale=400.0, bits=8, rng=s))),
    "saturated": (SINE, lambda s: (SHORT, record_acceleration(SINE, SHORT, 10.0, full_scale=200.0, rng=s))),
}


@cache
def recovered(name: str) -> list[RecoveredDrive]:
    """The drives of sixty records."""
    return [recover_drive(*RECORDS[name][1](seed)) for seed in range(60)]


@pytest.mark.parametrize("name", RECORDS)
def test_error_bars_cover_the_truth(name: str) -> None:
    """95 % within 1.96; of 60 seeds times parameters a fraction of 88 % and less has a chance below 0.001."""
    drive, _ = RECORDS[name]
    found = recovered(name)
    right = [f for f in found if len(f.amplitudes) == (2 if drive is TWO else 1)]
    assert len(right) >= 56
    share = np.mean([np.abs(deviations(drive, f)) < 1.96 for f in right])
    assert 0.88 <= share <= 0.995
    if name == "saturated":
        assert all(f.clipped > 150 for f in found)


@pytest.mark.slow
@pytest.mark.parametrize("name", RECORDS)
def test_error_bars_cover_95_percent(name: str) -> None:
    drive, make = RECORDS[name]
    found = [recover_drive(*make(seed)) for seed in range(600)]
    right = [f for f in found if len(f.amplitudes) == (2 if drive is TWO else 1)]
    assert len(right) >= 570
    shares = np.mean([np.abs(deviations(drive, f)) < 1.96 for f in right], axis=0)
    assert ((shares > 0.92) & (shares < 0.98)).all()


def test_bars_for_white_noise_are_too_short_in_coloured_noise() -> None:
    drive, make = RECORDS["coloured"]
    as_white = [recover_drive(*make(seed), noise="white") for seed in range(60)]
    white, coloured = (
        np.mean([np.abs(deviations(drive, found)) < 1.96 for found in drives])
        for drives in (as_white, recovered("coloured"))
    )
    assert white < 0.8 < 0.9 < coloured
    one = recover_drive(*make(0))
    # Of noise that forgets itself in 5 ms, sampled each ms: exp(-0.2); and 2 tau/dt/(1 + (w tau)^2) at 47 Hz.
    assert one.autocorrelation == pytest.approx(np.exp(-0.2), abs=0.08)
    assert one.noise_factors[0] == pytest.approx(10.0 / (1.0 + (2 * pi * 47.37 * 0.005) ** 2), rel=0.5)


def test_noise_is_no_drive() -> None:
    """A chance of 0.001 each: two and more of 60 have one of 0.002."""
    found = 0
    for seed in range(60):
        memory = 0.02 * (seed % 2)
        try:
            recover_drive(SHORT, record_acceleration(VerticalDrive(1e-15, 50.0), SHORT, 1.0, memory, rng=seed))
            found += 1
        except ValueError as error:
            assert "no drive found" in str(error)
    assert found <= 1


# --- harmonics


def test_triangles_have_their_harmonics() -> None:
    """Of odd order, 8 a/(pi k)^2 each."""
    found = recover_drive(TIMES, record_acceleration(TriangleDrive(300.0, 41.3, 0.4), TIMES, noise=1.0))
    order = np.arange(1, len(found.amplitudes) + 1)
    expected = np.where(order % 2 == 1, 8.0 * 300.0 / (pi * order) ** 2 / (2.0 * pi * 41.3 * order) ** 2, 0.0)
    assert len(order) >= 9
    assert (np.abs(found.amplitudes - expected) < 4.0 * found.amplitude_errors + 1e-3 * expected)[:9].all()
    assert isinstance(found.drive, HarmonicDrive)


def test_a_fundamental_below_a_stronger_harmonic_is_found() -> None:
    """The second and third harmonic accelerate 5 and 4 times as much."""
    drive = HarmonicDrive((0.001, 0.00125, 0.00045), (1.0, 2.0, 3.0), 20.3)
    found = recover_drive(TIMES, record_acceleration(drive, TIMES, noise=1.0, rng=2))
    assert len(found.amplitudes) == 3
    assert np.abs(deviations(drive, found)).max() < 4.0


def test_a_given_frequency_finds_what_has_no_fundamental() -> None:
    drive = HarmonicDrive((0.0, 0.001, 0.0005), (0.0, 2.0, 3.0), 20.3)
    found = recover_drive(TIMES, record_acceleration(drive, TIMES, noise=1.0), frequency=20.0)
    assert found.frequency == pytest.approx(20.3, abs=5 * found.frequency_error)
    assert found.amplitudes[1:] == pytest.approx([0.001, 0.0005], rel=0.01)
    assert found.amplitudes[0] < 4.0 * found.amplitude_errors[0]


def test_a_given_number_of_harmonics_is_kept() -> None:
    record = record_acceleration(SINE, TIMES, noise=1.0)
    assert len(recover_drive(TIMES, record, harmonics=3).amplitudes) == 3
    assert len(recover_drive(TIMES, record).amplitudes) == 1


def test_hum_beside_the_drive() -> None:
    """A line of 60 Hz with a seventh of the acceleration leaks into the frequency, and the error bars know it."""
    drive = VerticalDrive(0.003, 35.0, 0.5)
    hum = 20.0 * np.cos(2.0 * pi * 60.0 * TIMES)
    found = recover_drive(TIMES, record_acceleration(drive, TIMES, noise=1.0) + hum, frequency=35.0)
    assert np.abs(deviations(drive, found)).max() < 3.0


def test_hum_near_a_harmonic_is_not_followed() -> None:
    """Hum of 50 Hz, stronger than a drive of 24.3 Hz that is given, is no second harmonic of 25 Hz."""
    drive = VerticalDrive(0.003, 24.3, 1.0)
    hum = 150.0 * np.cos(2.0 * pi * 50.0 * TIMES)
    found = recover_drive(TIMES, record_acceleration(drive, TIMES, noise=1.0) + hum, frequency=24.3)
    assert np.abs(deviations(drive, found)).max() < 3.0


@pytest.mark.slow
def test_slow_noise_is_no_far_fundamental() -> None:
    """Of 40 drives of some ten periods in noise that forgets itself in 50 ms none is taken for a multiple."""
    rng = np.random.default_rng(4)
    times = np.arange(1000) / 2000.0
    for seed in range(40):
        rate = rng.uniform(17.0, 24.0)
        drive = HarmonicDrive((0.003, 0.0003, 0.0001), (rng.uniform(-3.0, 3.0), 1.0, 2.0), rate)
        found = recover_drive(times, record_acceleration(drive, times, noise=3.0, noise_time=0.05, rng=seed))
        assert found.frequency == pytest.approx(rate, abs=0.1)


def test_a_long_list_of_harmonics_is_shortened() -> None:
    times = TIMES[:400]
    square = 200.0 * np.sign(np.sin(2.0 * pi * 41.3 * times))
    found = recover_drive(times, square + np.random.default_rng(0).normal(0.0, 1.0, times.size))
    assert f"mm and {len(found.amplitudes) - 4} harmonics more; 400 samples" in repr(found)


# --- difficult records


def test_phases_about_pi_agree_round_the_circle() -> None:
    drive = VerticalDrive(0.003, 47.37, pi)
    found = [recover_drive(SHORT, record_acceleration(drive, SHORT, 10.0, rng=s)) for s in range(20)]
    phases = np.array([f.phases[0] for f in found])
    assert (phases > 3.0).any() and (phases < -3.0).any()
    assert np.abs([wrapped(f.phases[0] - pi) / f.phase_errors[0] for f in found]).max() < 3.5


@pytest.mark.parametrize("drift", [0.0, 1e4])
def test_three_periods_are_enough(drift: float) -> None:
    times = np.arange(64) / 1000.0
    found = recover_drive(times, record_acceleration(SINE, times, 5.0, drift=drift, rng=1))
    assert np.abs(deviations(SINE, found)).max() < 3.5
    assert found.drift == pytest.approx(drift, abs=4 * found.drift_error)


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


@pytest.mark.parametrize("share", [0.65, 0.85])
def test_saturation_before_the_noise_is_found_by_its_crowd(share: float) -> None:
    """A sensor that saturates, and a converter that adds noise: extremes are not equal, but crowd."""
    top = share * 0.003 * (2.0 * pi * 47.37) ** 2
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


@pytest.mark.slow
def test_a_million_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    """Some dozens of passes with some terms each, as for a thousand samples: 230 numbers a sample."""
    computed, original = 0, harmonic_fit._rows

    def rows(*arguments: Any) -> Any:
        nonlocal computed
        for part, terms in original(*arguments):
            computed += terms.size
            yield part, terms

    monkeypatch.setattr(harmonic_fit, "_rows", rows)
    times = np.arange(1_000_000) / 20_000.0
    found = recover_drive(times, record_acceleration(SINE, times, 30.0, offset=9.8))
    assert np.abs(deviations(SINE, found)).max() < 4.0
    assert computed < 300 * times.size


# --- peak to peak


def test_noise_does_not_widen_the_fit() -> None:
    """The extremes of 2,000 samples of noise s are some 3 s beyond those of the sine, on both sides."""
    true = 2.0 * 0.003 * (2.0 * pi * 47.37) ** 2
    found, extremes = [], []
    for seed in range(10):
        record = record_acceleration(SINE, TIMES, 30.0, rng=seed)
        one = recover_drive(TIMES, record)
        found.append((one.peak_to_peak - true) / one.peak_to_peak_error)
        extremes.append(np.ptp(record) / true)
        by_volts = displacement_amplitude(volts_from_acceleration(one.peak_to_peak), one.frequency)
        assert by_volts == pytest.approx(one.amplitudes[0], rel=1e-6)
    assert np.abs(np.mean(found)) < 3.0 / np.sqrt(10.0)
    assert min(extremes) > 1.15


def test_peak_to_peak_of_harmonics() -> None:
    found = recover_drive(TIMES, record_acceleration(TWO, TIMES, noise=3.0))
    fine = np.linspace(0.0, 1.0 / 23.37, 200_001)
    assert found.peak_to_peak == pytest.approx(np.ptp(found.acceleration(fine)), rel=1e-8)
    errors = []
    for seed in range(40):
        one = recover_drive(SHORT, record_acceleration(TWO, SHORT, 10.0, rng=seed), harmonics=2)
        errors.append((one.peak_to_peak - np.ptp(pivot_acceleration(TWO, fine))) / one.peak_to_peak_error)
    assert np.std(errors) == pytest.approx(1.0, abs=0.35)  # three standard errors of 40


def test_a_recovered_drive_drives_a_scene() -> None:
    found = recover_drive(TIMES, record_acceleration(driven_pendulum(amplitude=0.003), TIMES, noise=1.0, offset=9.8))
    assert found.drive.parameters == pytest.approx({"amplitude": 0.003, "frequency": 50.0, "phase": 0.0}, abs=1e-3)
    assert "amplitude" in scene(Pendulum(0.0272), Gravity(9.8), found.drive).params
    assert found.reading(TIMES).mean() == pytest.approx(9.8, abs=0.1)
    assert repr(found).startswith("RecoveredDrive(49.99996 +- ")
    assert repr(found).endswith(" mm; 2000 samples)")


# --- what is refused


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
