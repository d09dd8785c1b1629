"""Amplitude of a shaker's displacement from the volts of the accelerometer on it.

The accelerometer gives volts in proportion to acceleration, by a calibration in volts per g.  The report's (21) is
that of 0.1 V per g, a factor of 10 g per volt: A = 9.8 (Vpp/2) 10 / (2 pi f)^2.  It writes omega for what is a
frequency f in Hz, and Vpk for what is peak to peak.  Volts are peak to peak throughout: a sine of 1 V r.m.s. has
2 sqrt(2) V, one of 1 V amplitude 2 V.  From the number alone nobody can tell which it is, so a voltmeter that shows
r.m.s. makes the amplitude too small by a factor of 2.83 without a sign of it.

A sine is taken for granted.  For other wave forms, noise and offsets see :mod:`systems.lab.shaker.drive_recovery`.
"""

from __future__ import annotations

from math import pi
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cellmap.utils import finite_number

from ..arrays import Floats
from ..time_series import real_numbers

VOLTS_PER_G = 0.1
"""Calibration of the report's accelerometer (V per g)."""

STANDARD_GRAVITY = 9.8
"""What one g is taken for in the report (m/s^2); calibrations mean 9.80665, which is 0.068 % more."""


def displacement_amplitude(
    peak_to_peak_volts: ArrayLike,
    frequency: ArrayLike,
    volts_per_g: float = VOLTS_PER_G,
    standard_gravity: float = STANDARD_GRAVITY,
) -> Any:
    """Return the amplitude of a sinusoidal displacement from the peak-to-peak volts of an accelerometer.

    Parameters
    ----------
    peak_to_peak_volts : array_like, shape (...)
        Volts from the lowest to the highest point, at least 0; neither r.m.s. nor an amplitude.
    frequency : array_like, shape (...)
        Frequency (Hz), above 0; broadcasts against the volts.
    volts_per_g : float, optional
        Calibration of the accelerometer (V per g), above 0.
    standard_gravity : float, optional
        Acceleration that the calibration calls one g (m/s^2), above 0.

    Returns
    -------
    float or ndarray, shape (...)
        Amplitude (m), half of the stroke.

    Raises
    ------
    TypeError, ValueError
        For numbers that are not finite or out of bounds, and for shapes that do not broadcast.

    References
    ----------
    Formula (21) of the report.

    Examples
    --------
    >>> displacement_amplitude(6.04, 50.0)
    0.0029987
    """
    volts, rate = _checked(peak_to_peak_volts=peak_to_peak_volts, frequency=frequency)
    return _plain(0.5 * volts * _acceleration_per_volt(volts_per_g, standard_gravity) / (2.0 * pi * rate) ** 2)


def peak_to_peak_volts(
    amplitude: ArrayLike,
    frequency: ArrayLike,
    volts_per_g: float = VOLTS_PER_G,
    standard_gravity: float = STANDARD_GRAVITY,
) -> Any:
    """Return the peak-to-peak volts that a sinusoidal displacement gives: the inverse of the amplitude.

    Parameters
    ----------
    amplitude : array_like, shape (...)
        Amplitude of the displacement (m), at least 0.
    frequency : array_like, shape (...)
        Frequency (Hz), above 0.
    volts_per_g, standard_gravity : float, optional
        As for :func:`displacement_amplitude`.

    Returns
    -------
    float or ndarray, shape (...)
        Volts, peak to peak.

    Raises
    ------
    TypeError, ValueError
        As :func:`displacement_amplitude`.

    Examples
    --------
    >>> peak_to_peak_volts(0.003, 50.0)
    6.0426...
    """
    height, rate = _checked(amplitude=amplitude, frequency=frequency)
    return _plain(2.0 * height * (2.0 * pi * rate) ** 2 / _acceleration_per_volt(volts_per_g, standard_gravity))


def displacement_error(
    peak_to_peak_volts: ArrayLike,
    frequency: ArrayLike,
    volts_error: ArrayLike = 0.0,
    frequency_error: ArrayLike = 0.0,
    volts_per_g: float = VOLTS_PER_G,
    volts_per_g_error: float = 0.0,
    standard_gravity: float = STANDARD_GRAVITY,
) -> Any:
    """Return the standard error of the amplitude, from independent errors of volts, frequency and calibration.

    To first order, with A in proportion to V / (s f^2): the square of the error is (A dV/V)^2 + (2 A df/f)^2 +
    (A ds/s)^2.  The error of the calibration is common to all points of one accelerometer: it moves a curve as a
    whole, and enters a comparison once, not with every point.

    Parameters
    ----------
    peak_to_peak_volts, frequency : array_like, shape (...)
        As for :func:`displacement_amplitude`.
    volts_error, frequency_error : array_like, shape (...), optional
        Standard errors of the volts (V) and of the frequency (Hz), at least 0.
    volts_per_g : float, optional
        Calibration (V per g), above 0.
    volts_per_g_error : float, optional
        Standard error of the calibration (V per g), at least 0.
    standard_gravity : float, optional
        One g (m/s^2), above 0.

    Returns
    -------
    float or ndarray, shape (...)
        Standard error (m).

    Raises
    ------
    TypeError, ValueError
        As :func:`displacement_amplitude`.

    Examples
    --------
    >>> displacement_error(6.04, 50.0, volts_error=0.0604) / displacement_amplitude(6.04, 50.0)
    0.01
    """
    volts, rate, volts_spread, rate_spread = _checked(
        peak_to_peak_volts=peak_to_peak_volts,
        frequency=frequency,
        volts_error=volts_error,
        frequency_error=frequency_error,
    )
    calibration = finite_number("volts_per_g_error", volts_per_g_error, at_least=0.0)
    per_volt = 0.5 * _acceleration_per_volt(volts_per_g, standard_gravity) / (2.0 * pi * rate) ** 2
    fractions = np.hypot(2.0 * rate_spread / rate, calibration / volts_per_g)
    return _plain(per_volt * np.hypot(volts_spread, volts * fractions))


def acceleration_from_volts(
    volts: ArrayLike, volts_per_g: float = VOLTS_PER_G, standard_gravity: float = STANDARD_GRAVITY
) -> Any:
    """Return the acceleration that an accelerometer's volts stand for; NaN, a lost sample, stays NaN.

    Parameters
    ----------
    volts : array_like, shape (...)
        Record (V).
    volts_per_g, standard_gravity : float, optional
        As for :func:`displacement_amplitude`.

    Returns
    -------
    float or ndarray, shape (...)
        Acceleration (m/s^2).

    Raises
    ------
    TypeError, ValueError
        For a record that is not of real numbers, and a calibration out of bounds.

    Examples
    --------
    >>> acceleration_from_volts([0.1, -0.2]).tolist()
    [9.8, -19.6]
    """
    return _plain(real_numbers(f"volts={volts!r}", volts) * _acceleration_per_volt(volts_per_g, standard_gravity))


def volts_from_acceleration(
    acceleration: ArrayLike, volts_per_g: float = VOLTS_PER_G, standard_gravity: float = STANDARD_GRAVITY
) -> Any:
    """Return the volts that an acceleration gives; NaN stays NaN.

    Parameters
    ----------
    acceleration : array_like, shape (...)
        Acceleration (m/s^2).
    volts_per_g, standard_gravity : float, optional
        As for :func:`displacement_amplitude`.

    Returns
    -------
    float or ndarray, shape (...)
        Volts.

    Raises
    ------
    TypeError, ValueError
        As :func:`acceleration_from_volts`.

    Examples
    --------
    >>> volts_from_acceleration(19.6)
    0.2
    """
    return _plain(
        real_numbers(f"acceleration={acceleration!r}", acceleration)
        / _acceleration_per_volt(volts_per_g, standard_gravity)
    )


def _acceleration_per_volt(volts_per_g: float, standard_gravity: float) -> float:
    scale = finite_number("volts_per_g", volts_per_g, above=0.0)
    return finite_number("standard_gravity", standard_gravity, above=0.0) / scale


def _checked(**given: ArrayLike) -> list[Floats]:
    """Return finite numbers of at least 0, frequencies above 0, in arrays that broadcast."""
    arrays = {name: real_numbers(f"{name}={values!r}", values) for name, values in given.items()}
    for name, values in arrays.items():
        fine = np.isfinite(values) & ((values > 0.0) if name == "frequency" else (values >= 0.0))
        if not fine.all():
            least = "above" if name == "frequency" else "of at least"
            raise ValueError(f"{name}={float(values[~fine][0])!r}: give finite numbers {least} 0")
    try:
        np.broadcast_shapes(*(a.shape for a in arrays.values()))
    except ValueError:
        shapes = ", ".join(f"{name} {a.shape}" for name, a in arrays.items())
        raise ValueError(
            f"shapes do not go together: {shapes}; give one number for each point, or one for all"
        ) from None
    return list(arrays.values())


def _plain(values: Floats) -> Any:
    """Return a number for numbers, an array for arrays."""
    return float(values) if np.ndim(values) == 0 else values
