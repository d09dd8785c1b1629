"""The natural frequency of a free swing, at small amplitude, and the effective length that follows."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np

from cellmap.utils import finite_number

from ..arrays import Floats
from .swing_extremes import Envelope, check_rhythm

_BESIDE = 4  # extremes to both sides over which the loss of amplitude is taken
# A half swing that loses the fraction s of its amplitude is longer than the mean over the amplitudes by c s^2:
# measured, the middle of c for viscous damping, dry friction and quadratic drag, and how far these are from it.
_AMPLITUDES = (0.0, 0.5, 1.0, 1.5, 2.0, 2.25, 2.5, 2.7, 2.9)
_LONGER = (0.051, 0.059, 0.087, 0.143, 0.301, 0.467, 0.806, 1.445, 3.486)
_UNSURE = (0.051, 0.044, 0.024, 0.020, 0.076, 0.128, 0.219, 0.386, 1.020)


@dataclass(frozen=True)
class Estimate:
    """A number with its standard error."""

    value: float
    standard_error: float

    def __repr__(self) -> str:
        return f"{self.value:.6g} +- {self.standard_error:.2g}"


def natural_frequency(envelope: Envelope) -> Estimate:
    """Return the angular frequency of small swings (rad/s) from all half swings, each at its own amplitude.

    Half a period at the amplitude A takes 2 K(sin(A/2))/w with the complete elliptic integral K.  Damping makes it
    longer, in the square of the fraction of its amplitude lost in a half swing; by how much depends a little on the
    kind of damping.  The middle of viscous damping, dry friction and quadratic drag is corrected for, and how far they
    are from it is part of the standard error.

    Parameters
    ----------
    envelope : Envelope
        Extremes of a free swing.

    Returns
    -------
    Estimate
        Mean of the half swings, and its standard error from their scatter and from the kind of damping.

    Raises
    ------
    ValueError
        For fewer than four extremes, and times between them that are no whole numbers of half swings.

    Examples
    --------
    >>> from systems.lab import swing_envelope
    >>> t = np.linspace(0.0, 5.0, 1001)
    >>> round(natural_frequency(swing_envelope(t, 0.01 * np.exp(-0.2 * t) * np.cos(12.0 * t))).value, 3)
    12.0
    """
    steps = envelope.half_swings
    if len(steps) < 3:
        raise ValueError(f"envelope has {len(steps) + 1} extremes: give at least 4")
    check_rhythm(envelope, len(steps))
    # Times of neighbouring extremes share an error, so the line through all times is fitted, not the mean of intervals.
    errors = np.maximum(envelope.time_errors, 1e-12 * np.ptp(envelope.times))
    logs, count = np.log(envelope.amplitudes), np.concatenate([[0], np.cumsum(steps)])
    first = np.maximum(np.arange(len(steps)) - _BESIDE, 0)
    last = np.minimum(np.arange(len(steps)) + 1 + _BESIDE, len(steps))
    losses = (logs[first] - logs[last]) / (count[last] - count[first])
    squares, middle = losses**2, np.exp(0.5 * (logs[1:] + logs[:-1]))
    longer, unsure = (np.interp(middle, _AMPLITUDES, table) * squares for table in (_LONGER, _UNSURE))
    lasted = steps * envelope.slowings
    found, other = (
        _line(np.concatenate([[0.0], np.cumsum(lasted * (1.0 + more))]), envelope, errors)
        for more in (longer, longer + unsure)
    )
    return Estimate(found.value, float(np.hypot(found.standard_error, other.value - found.value)))


def _line(order: Floats, envelope: Envelope, errors: Floats) -> Estimate:
    line, spread = np.polyfit(order, envelope.times, 1, w=1.0 / errors, cov="unscaled")
    rest = (envelope.times - np.polyval(line, order)) / errors
    scatter = max(float(rest @ rest) / (len(order) - 2), 1.0)
    return Estimate(pi / float(line[0]), pi / float(line[0]) ** 2 * float(np.sqrt(scatter * spread[0, 0])))


def effective_length(frequency: Estimate, gravity: float = 9.8) -> Estimate:
    """Return the effective length g / w^2 of a pendulum (m).

    Parameters
    ----------
    frequency : Estimate
        Angular frequency of small swings (rad/s).
    gravity : float, optional
        Acceleration of free fall (m/s^2), above 0.

    Returns
    -------
    Estimate
        Length and its standard error.

    Raises
    ------
    TypeError, ValueError
        For numbers out of range.

    Examples
    --------
    >>> effective_length(Estimate(10.0, 0.1), gravity=9.8)
    0.098 +- 0.002
    """
    w = finite_number("frequency", frequency.value, above=0.0)
    length = finite_number("gravity", gravity, above=0.0) / w**2
    return Estimate(length, 2.0 * length * frequency.standard_error / w)
