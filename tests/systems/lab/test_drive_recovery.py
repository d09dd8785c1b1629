"""Drives from records of an accelerometer: exact ones, faults, and standard errors over seeds of the noise."""

from collections.abc import Callable
from math import pi

import numpy as np
import pytest
from recorded_drives import SHORT, SINE, TIMES, TWO, Array, deviations, wrapped
from scipy.optimize import least_squares

from systems import Effect, Pendulum, RotatingDrive, SquareDrive, TiltedDrive, TriangleDrive, VerticalDrive, scene
from systems.lab import pivot_acceleration, record_acceleration, recover_drive


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


WAIT = {60: pytest.mark.thorough, 600: pytest.mark.slow}
CASES = [("white", 60), *(pytest.param(n, k, marks=WAIT[k]) for k in WAIT for n in RECORDS if (n, k) != ("white", 60))]


@pytest.mark.parametrize(("name", "seeds"), CASES)
def test_error_bars_cover_the_truth(name, seeds):
    """95 % within 1.96; of 60 seeds times parameters a fraction of 88 % and less has a chance below 0.001."""
    drive, make = RECORDS[name]
    found = [recover_drive(*make(seed)) for seed in range(seeds)]
    right = [f for f in found if len(f.amplitudes) == (2 if drive is TWO else 1)]
    assert len(right) >= 0.93 * seeds
    inside = np.array([np.abs(deviations(drive, f)) < 1.96 for f in right])
    assert 0.88 <= inside.mean() <= 0.995
    if seeds > 60:
        assert np.abs(inside.mean(axis=0) - 0.95).max() < 0.03
    if name == "saturated":
        assert all(f.clipped > 150 for f in found)


def test_noise_is_no_drive() -> None:
    """A chance of 0.001 each: two and more of 20 have one of 0.0002."""
    found = 0
    for seed in range(20):
        memory = 0.02 * (seed % 2)
        try:
            recover_drive(SHORT, record_acceleration(VerticalDrive(1e-15, 50.0), SHORT, 1.0, memory, rng=seed))
            found += 1
        except ValueError as error:
            assert "no drive found" in str(error)
    assert found <= 1
