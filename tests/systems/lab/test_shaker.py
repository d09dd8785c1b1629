"""Amplitudes from volts: the report's formula, its inverse, its errors against random draws, and bad input."""

from __future__ import annotations

from math import pi
from typing import Any

import numpy as np
import pytest

from systems.lab import (
    acceleration_from_volts,
    displacement_amplitude,
    displacement_error,
    peak_to_peak_volts,
    volts_from_acceleration,
)


def test_it_is_the_formula_of_the_report() -> None:
    """(21): 9.8 (Vpp/2) 10 / (2 pi f)^2."""
    for volts, frequency in ((1.5, 15.0), (3.4, 35.0), (0.0, 20.0)):
        expected = 9.8 * (volts / 2) * 10 / (2 * pi * frequency) ** 2
        assert displacement_amplitude(volts, frequency) == pytest.approx(expected, rel=1e-15)


def test_a_moving_sensor_gives_its_own_amplitude() -> None:
    """The second difference of 3 mm cos(2 pi 50 t), in g and volts."""
    h = 1e-5
    times = np.arange(2000) * h

    def height(t: Any) -> Any:
        return 0.003 * np.cos(2.0 * pi * 50.0 * t)

    acceleration = (height(times - h) - 2.0 * height(times) + height(times + h)) / h**2
    volts = acceleration / 9.8 * 0.1
    assert displacement_amplitude(np.ptp(volts), 50.0) == pytest.approx(0.003, rel=1e-5)


def test_arrays_and_the_inverse() -> None:
    volts, frequencies = np.array([[1.0], [2.0]]), np.array([15.0, 20.0, 35.0])
    amplitudes = displacement_amplitude(volts, frequencies, volts_per_g=0.25, standard_gravity=9.80665)
    assert amplitudes.shape == (2, 3)
    back = peak_to_peak_volts(amplitudes, frequencies, volts_per_g=0.25, standard_gravity=9.80665)
    np.testing.assert_allclose(back, np.broadcast_to(volts, (2, 3)), rtol=1e-14)
    assert isinstance(displacement_amplitude(1.0, 15.0), float)


def test_twice_the_calibration_is_half_of_the_amplitude() -> None:
    assert displacement_amplitude(1.0, 15.0, 0.2) == pytest.approx(0.5 * displacement_amplitude(1.0, 15.0), rel=1e-15)


def test_errors_are_those_of_random_draws() -> None:
    """Errors of 1 to 2 %, whose squares a first order leaves out: 1e-3 of the error; 200,000 draws tell it to 0.2 %."""
    rng = np.random.default_rng(0)
    n = 200_000
    volts, rate, scale = rng.normal(2.0, 0.02, n), rng.normal(25.0, 0.25, n), rng.normal(0.1, 0.001, n)
    drawn = 9.8 / scale * 0.5 * volts / (2.0 * pi * rate) ** 2
    told = displacement_error(2.0, 25.0, 0.02, 0.25, 0.1, 0.001)
    assert drawn.std() == pytest.approx(told, rel=0.01)


def test_errors_of_no_motion_are_those_of_the_volts() -> None:
    assert displacement_error(0.0, 25.0, 0.02) == pytest.approx(displacement_amplitude(0.02, 25.0), rel=1e-15)
    assert displacement_error(2.0, 25.0) == 0.0


def test_volts_and_accelerations() -> None:
    record = np.array([1.0, np.nan, -0.5])
    np.testing.assert_allclose(acceleration_from_volts(record), [98.0, np.nan, -49.0], rtol=1e-15)
    np.testing.assert_allclose(volts_from_acceleration(acceleration_from_volts(record)), record, rtol=1e-15)


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: displacement_amplitude(-1.0, 15.0), ValueError, "peak_to_peak_volts=-1.0: .* at least 0"),
        (lambda: displacement_amplitude(1.0, 0.0), ValueError, "frequency=0.0: give finite numbers above 0"),
        (lambda: displacement_amplitude(1.0, [15.0, -2.0]), ValueError, "frequency=-2.0"),
        (lambda: displacement_amplitude(np.nan, 15.0), ValueError, "peak_to_peak_volts=nan"),
        (lambda: displacement_amplitude("one", 15.0), TypeError, "peak_to_peak_volts='one': give real numbers"),
        (lambda: displacement_amplitude(1.0, 15.0, 0.0), ValueError, "volts_per_g=0.0: give a number above 0"),
        (lambda: displacement_amplitude(1.0, 15.0, standard_gravity=-9.8), ValueError, "standard_gravity=-9.8"),
        (lambda: displacement_amplitude([1.0, 2.0], [1.0, 2.0, 3.0]), ValueError, "shapes do not go together"),
        (lambda: displacement_error(1.0, 15.0, volts_error=-0.1), ValueError, "volts_error=-0.1"),
        (lambda: displacement_error(1.0, 15.0, volts_per_g_error=-0.1), ValueError, "volts_per_g_error=-0.1"),
        (lambda: displacement_error(1.0, 15.0, frequency_error=np.inf), ValueError, "frequency_error=inf"),
        (lambda: peak_to_peak_volts(-1.0, 15.0), ValueError, "amplitude=-1.0"),
        (lambda: acceleration_from_volts("one"), TypeError, "volts='one'"),
    ],
)
def test_bad_input_is_refused(make: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        make()
