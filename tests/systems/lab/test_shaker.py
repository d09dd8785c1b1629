"""Amplitudes from volts: the report's formula, its inverse, its errors against random draws, and bad input."""

from math import pi

import numpy as np
import pytest

from systems import lab


def test_it_is_the_formula_of_the_report() -> None:
    """(21): 9.8 (Vpp/2) 10 / (2 pi f)^2."""
    for volts, frequency in ((1.5, 15.0), (3.4, 35.0), (0.0, 20.0)):
        expected = 9.8 * (volts / 2) * 10 / (2 * pi * frequency) ** 2
        assert lab.displacement_amplitude(volts, frequency) == pytest.approx(expected, rel=1e-15)


def test_arrays_and_the_inverse() -> None:
    volts, frequencies = np.array([[1.0], [2.0]]), np.array([15.0, 20.0, 35.0])
    amplitudes = lab.displacement_amplitude(volts, frequencies, volts_per_g=0.25, standard_gravity=9.80665)
    assert amplitudes.shape == (2, 3)
    back = lab.peak_to_peak_volts(amplitudes, frequencies, volts_per_g=0.25, standard_gravity=9.80665)
    np.testing.assert_allclose(back, np.broadcast_to(volts, (2, 3)), rtol=1e-14)
    assert isinstance(lab.displacement_amplitude(1.0, 15.0), float)


def test_errors_are_those_of_random_draws() -> None:
    """Errors of 1 to 2 %, whose squares a first order leaves out: 1e-3 of the error; 200,000 draws tell it to 0.2 %."""
    rng = np.random.default_rng(0)
    n = 200_000
    volts, rate, scale = rng.normal(2.0, 0.02, n), rng.normal(25.0, 0.25, n), rng.normal(0.1, 0.001, n)
    drawn = 9.8 / scale * 0.5 * volts / (2.0 * pi * rate) ** 2
    told = lab.displacement_error(2.0, 25.0, 0.02, 0.25, 0.1, 0.001)
    assert drawn.std() == pytest.approx(told, rel=0.01)


def test_volts_and_accelerations() -> None:
    record = np.array([1.0, np.nan, -0.5])
    np.testing.assert_allclose(lab.acceleration_from_volts(record), [98.0, np.nan, -49.0], rtol=1e-15)
    np.testing.assert_allclose(lab.volts_from_acceleration(lab.acceleration_from_volts(record)), record, rtol=1e-15)
