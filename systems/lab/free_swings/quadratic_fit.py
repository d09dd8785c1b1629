"""The quadratic fit of a decay profile, as the report has it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import stdtrit
from scipy.stats import linregress

from cellmap.utils import finite_number

from ..arrays import Floats
from .swing_extremes import Envelope


@dataclass(frozen=True, eq=False)
class QuadraticDecay:
    """The parabola a t^2 + b t + c of least squares through the extremes of a decaying swing.

    Parameters
    ----------
    coefficients : ndarray, shape (3,)
        a (rad/s^2), b (rad/s) and c (rad); time counts from `start_time`.
    standard_errors : ndarray, shape (3,)
        Of the coefficients, from the scatter of the extremes about the parabola.
    rmse : float
        Root of the sum of squared residuals over their degrees of freedom (rad).
    start : float
        Time at which t is 0 (s).
    envelope : Envelope
        The extremes.
    """

    coefficients: Floats
    standard_errors: Floats
    rmse: float
    start: float
    envelope: Envelope

    def __repr__(self) -> str:
        reach = self.half_widths()
        terms = ", ".join(f"{n} = {v:.4g} +- {r:.2g}" for n, v, r in zip("abc", self.coefficients, reach, strict=True))
        return f"QuadraticDecay({terms} (95 %), RMSE {self.rmse:.4g})"

    def half_widths(self, confidence: float = 0.95) -> Floats:
        """Return half the widths of the intervals of a, b and c (Student's distribution)."""
        freedom = len(self.envelope.times) - 3
        fraction = finite_number("confidence", confidence, above=0.0, at_most=1.0 - 1e-12)
        return float(stdtrit(freedom, 0.5 + 0.5 * fraction)) * self.standard_errors

    @property
    def curvature(self) -> float:
        """Curvature relative to that of the exponential with the same value and slope at t = 0, a / (b^2 / 2c).

        It is 1 for viscous damping and 0 for dry friction, in either case for small swings.
        """
        a, b, c = self.coefficients.tolist()
        return 2.0 * a * c / (b * b)

    def __call__(self, times: ArrayLike) -> Floats:
        """Return the parabola at some times (s)."""
        a, b, c = self.coefficients
        t = np.asarray(times, dtype=float) - self.start
        return np.asarray((a * t + b) * t + c)


def quadratic_decay(envelope: Envelope, start_time: float | None = None) -> QuadraticDecay:
    """Fit a parabola to a decay profile, all extremes with one weight.

    Parameters
    ----------
    envelope : Envelope
        Extremes of a free swing, at least 5.
    start_time : float, optional
        Time at which t is 0 (s); by default that of the first extreme.

    Returns
    -------
    QuadraticDecay
        Coefficients with their errors.

    Raises
    ------
    TypeError, ValueError
        For something else, too few extremes, and a swing that does not decay.

    Examples
    --------
    >>> from systems.lab import swing_envelope
    >>> t = np.linspace(0.0, 5.0, 1001)
    >>> swings = swing_envelope(t, (0.9 - 0.1 * t) * np.cos(12.0 * t))
    >>> quadratic_decay(swings, start_time=0.0).coefficients.round(3) + 0.0
    array([ 0. , -0.1,  0.9])
    """
    check_decay(envelope, fewest=5)
    begin = float(envelope.times[0]) if start_time is None else finite_number("start_time", start_time)
    t = envelope.times - begin
    factors, spread = np.polyfit(t, envelope.amplitudes, 2, cov=True)
    rest = envelope.amplitudes - np.polyval(factors, t)
    return QuadraticDecay(
        factors, np.sqrt(np.diag(spread)), float(np.sqrt(rest @ rest / (len(t) - 3))), begin, envelope
    )


def check_decay(envelope: Envelope, fewest: int) -> None:
    """Refuse an envelope that is too short or does not decay."""
    if not isinstance(envelope, Envelope):
        raise TypeError(f"envelope={envelope!r}: give an Envelope, as swing_envelope returns it")
    count = len(envelope.times)
    if count < fewest:
        raise ValueError(f"envelope has {count} extremes: give at least {fewest}, by a longer film or less noise")
    slope, *_, error = linregress(envelope.times, envelope.amplitudes)
    error = max(float(error), 1e-15 * float(envelope.amplitudes[0]))
    if slope > -float(stdtrit(count - 2, 0.975)) * error:
        raise ValueError(
            f"envelope changes by {slope:.3g} +- {error:.2g} rad/s: that is no decay; film a free swing, for longer"
        )
