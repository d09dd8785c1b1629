"""The natural frequency of a free swing, at small amplitude, and the effective length that follows."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import least_squares
from scipy.special import ellipj

from cellmap.utils import finite_number, one_of

from ..arrays import Floats
from ..time_series import measured_series, widening
from .swing_extremes import GAUSS, Envelope, check_rhythm, slowing, swing_envelope

_WIDEST = 3.14159
_BESIDE = 4  # extremes to both sides over which the loss of amplitude is taken
# A half swing that loses the fraction s of its amplitude is longer than the mean over the amplitudes by c s^2:
# measured, the middle of c for viscous damping, dry friction and quadratic drag, and how far these are from it.
_AMPLITUDES = (0.0, 0.5, 1.0, 1.5, 2.0, 2.25, 2.5, 2.7, 2.9)
_LONGER = (0.051, 0.059, 0.087, 0.143, 0.301, 0.467, 0.806, 1.445, 3.486)
_UNSURE = (0.051, 0.044, 0.024, 0.020, 0.076, 0.128, 0.219, 0.386, 1.020)
# The frequency of a wave whose amplitude falls exponentially is lower by c s^2: viscous damping of small swings has
# this c, exactly, and measured ones of other kinds are as far from it, on swings that are not wide.
_VISCOUS, _OTHERS, _WIDE = 0.5 / pi**2, 0.12, 2.2


@dataclass(frozen=True)
class Estimate:
    """A number with its standard error."""

    value: float
    standard_error: float

    def __repr__(self) -> str:
        return f"{self.value:.6g} +- {self.standard_error:.2g}"


@dataclass(frozen=True, eq=False)
class SineFit:
    """A decaying sine through the first periods of a swing, rest + amplitude exp(-decay (t - middle)) cos(w t + phase).

    Where the swing is wide, the shape of the pendulum's wave may stand in the place of the cosine, and w rises as the
    amplitude falls.

    Parameters
    ----------
    frequency : Estimate
        Angular frequency w in the middle of these periods (rad/s), at the amplitude there.
    amplitude : float
        Amplitude in the middle (rad).
    decay : float
        Rate at which it falls (1/s).
    phase : float
        Phase in the middle (rad).
    rest : float
        Angle of rest (rad).
    rmse : float
        Root mean square of the residuals (rad).
    inside : slice
        The samples.
    """

    frequency: Estimate
    amplitude: float
    decay: float
    phase: float
    rest: float
    rmse: float
    inside: slice

    def __repr__(self) -> str:
        return f"SineFit(w = {self.frequency!r} rad/s at {self.amplitude:.4g} rad, RMSE {self.rmse:.3g})"

    @property
    def natural_frequency(self) -> Estimate:
        """Angular frequency of small swings (rad/s): a pendulum that swings wide is slower, and so is a damped one."""
        square = (self.decay * pi / self.frequency.value) ** 2
        factor = float(slowing(self.amplitude)) * (1.0 + _VISCOUS * square)
        unsure = _OTHERS * (1.0 + (self.amplitude / _WIDE) ** 8) * square
        apart = self.frequency.value * factor * unsure
        return Estimate(self.frequency.value * factor, float(np.hypot(self.frequency.standard_error * factor, apart)))


def sine_fit(times: ArrayLike, angles: ArrayLike, periods: float = 1.0, shape: str = "pendulum") -> SineFit:
    """Fit a sine to the first periods of a free swing.

    The amplitude falls exponentially within them, so that damping does not bend the frequency.  Nor does the width of
    the swing, if the wave has the shape and the frequency of the undamped pendulum at each amplitude.  Decays that
    are not exponential, those of swings wider than 1 rad among them, are fitted the better the fewer the periods.  What
    the wave misses widens the error, by residuals that follow each other; beyond 2 rad not always by enough.

    Parameters
    ----------
    times : array_like, shape (n,)
        Times (s), increasing.
    angles : array_like, shape (n,)
        Angles (rad), continuous; NaN marks a gap.
    periods : float, optional
        Periods from the first sample on, at least 1.
    shape : {"pendulum", "sine"}, optional
        The wave; "sine" is that of small swings.

    Returns
    -------
    SineFit
        The sine; its `natural_frequency` is that of small swings.

    Raises
    ------
    TypeError, ValueError
        As :func:`swing_envelope`, and where gaps leave too little of these periods.

    Examples
    --------
    >>> t = np.linspace(0.0, 5.0, 1001)
    >>> fit = sine_fit(t, 0.01 * np.exp(-0.2 * t) * np.cos(12.0 * t))
    >>> round(fit.frequency.value, 2), round(fit.natural_frequency.value, 2)
    (12.0, 12.0)
    """
    t, x = measured_series(times, angles)
    many = finite_number("periods", periods, at_least=1.0)
    wave = {"pendulum": _pendulum, "sine": _sine}[one_of("shape", shape, ("pendulum", "sine"))]
    envelope = swing_envelope(t, x)
    check_rhythm(envelope, max(2, round(2 * many)))
    halves = np.diff(envelope.times) / envelope.half_swings
    guess = pi / float(np.median(halves[: max(2, round(2 * many))]))
    stop = int(np.searchsorted(t, t[0] + many * 2.0 * pi / guess, side="right"))
    inside = np.flatnonzero(np.isfinite(x[:stop]))
    span = 2.0 * pi / guess * many
    if inside.size < 12 or np.ptp(t[inside]) < 0.9 * span or np.diff(t[inside]).max() > 0.25 * span / many:
        raise ValueError(
            f"angles have {inside.size} samples in the first {many:g} periods of {2 * pi / guess:.3g} s, and gaps: "
            "begin where the swing is seen without them"
        )
    moments, values = t[inside], x[inside]
    middle = 0.5 * (moments[0] + moments[-1])
    late = moments - middle
    waves = np.stack([np.ones_like(late), np.cos(guess * late), np.sin(guess * late)], axis=-1)
    (rest, even, odd), *_ = np.linalg.lstsq(waves, values, rcond=None)

    def residuals(q: Floats) -> Floats:
        rest, amplitude, decay, w, phase = q
        return np.asarray(rest + wave(amplitude, decay, w, phase, late) - values)

    begin = [rest, np.hypot(even, odd), 0.0, guess, np.arctan2(-odd, even)]
    found = least_squares(residuals, begin, x_scale="jac", xtol=1e-14, ftol=1e-14, gtol=1e-14)
    rest, amplitude, decay, w, phase = found.x.tolist()
    if amplitude < 0.0:
        amplitude, phase = -amplitude, phase + pi
    variance = 2.0 * found.cost / (moments.size - 5)
    error = widening(found.fun) * float(np.sqrt(variance * np.linalg.inv(found.jac.T @ found.jac)[3, 3]))
    turned = float(np.remainder(phase + pi, 2.0 * pi) - pi)
    rmse = float(np.sqrt(2.0 * found.cost / moments.size))
    return SineFit(Estimate(w, error), amplitude, decay, turned, rest, rmse, slice(0, stop))


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
    >>> t = np.linspace(0.0, 5.0, 1001)
    >>> round(natural_frequency(swing_envelope(t, 0.01 * np.exp(-0.2 * t) * np.cos(12.0 * t))).value, 3)
    12.0
    """
    steps = envelope.half_swings
    if len(steps) < 3:
        raise ValueError(f"envelope has {len(steps) + 1} extremes: give at least 4")
    check_rhythm(envelope, len(steps))
    # Times of neighbouring extremes share an error, so the line through all times is fitted, not the mean of intervals.
    weights = 1.0 / np.maximum(envelope.time_errors, 1e-12 * np.ptp(envelope.times)) ** 2
    logs, count = np.log(envelope.amplitudes), np.concatenate([[0], np.cumsum(steps)])
    first = np.maximum(np.arange(len(steps)) - _BESIDE, 0)
    last = np.minimum(np.arange(len(steps)) + 1 + _BESIDE, len(steps))
    losses = (logs[first] - logs[last]) / (count[last] - count[first])
    squares, middle = losses**2, np.exp(0.5 * (logs[1:] + logs[:-1]))
    longer, unsure = (np.interp(middle, _AMPLITUDES, table) * squares for table in (_LONGER, _UNSURE))
    lasted = steps * envelope.slowings
    found, other = (
        _line(np.concatenate([[0.0], np.cumsum(lasted * (1.0 + more))]), envelope, weights)
        for more in (longer, longer + unsure)
    )
    return Estimate(found.value, float(np.hypot(found.standard_error, other.value - found.value)))


def _line(order: Floats, envelope: Envelope, weights: Floats) -> Estimate:
    x, y = (v - np.average(v, weights=weights) for v in (order, envelope.times))
    spread = float(weights @ x**2)
    half = float(weights @ (x * y)) / spread
    scatter = float(weights @ (y - half * x) ** 2) / (len(x) - 2)
    return Estimate(pi / half, pi / half**2 * float(np.sqrt(max(scatter, 1.0) / spread)))


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


def swing(amplitude: ArrayLike, phase: ArrayLike) -> Floats:
    """Return the angle (rad) of the undamped pendulum at a phase (rad) from its farthest point, 2 pi a period.

    Parameters
    ----------
    amplitude : array_like, shape (...)
        Amplitudes (rad), below pi in size.
    phase : array_like, shape (...)
        Phases.

    Returns
    -------
    ndarray, shape (...)
        amplitude cos(phase) for small amplitudes; in general 2 asin(k cd(2 K phase/pi, k)) with k = sin(amplitude/2).

    Examples
    --------
    >>> swing(1.0, [0.0, np.pi / 2, np.pi]).round(12) + 0.0
    array([ 1.,  0., -1.])
    """
    wide = np.clip(np.asarray(amplitude, dtype=float), -_WIDEST, _WIDEST)
    k = np.sin(0.5 * wide)
    _, cn, dn, _ = ellipj(slowing(wide) * np.asarray(phase, dtype=float), k * k)
    return np.asarray(2.0 * np.arcsin(k * cn / dn))


def _pendulum(amplitude: float, decay: float, w: float, phase: float, late: Floats) -> Floats:
    """Wave of a swing whose amplitude falls, with the frequency that goes with it, integrated by Gauss's rule."""
    nodes, weights = GAUSS
    between = 0.5 * late[:, None] * (nodes + 1.0)
    relative = slowing(amplitude) / slowing(np.clip(amplitude * np.exp(-decay * between), -_WIDEST, _WIDEST))
    turned = 0.5 * late * (relative @ weights)
    return swing(amplitude * np.exp(-decay * late), w * turned + phase)


def _sine(amplitude: float, decay: float, w: float, phase: float, late: Floats) -> Floats:
    return amplitude * np.exp(-decay * late) * np.cos(w * late + phase)
