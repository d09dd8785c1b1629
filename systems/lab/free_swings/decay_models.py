"""Kinds of damping, identified by the decay profile of a free swing at any amplitude below pi.

Averaged over a swing of amplitude A, a pendulum theta'' = -damping theta' - friction sign(theta') - drag theta'
abs(theta') - w^2 sin theta loses amplitude at the rate

    dA/dt = -(damping 4 (E - (1 - m) K) + friction A/w + drag 2 w (sin A - A cos A)) / (K sin A)

with the complete elliptic integrals K and E of the parameter m = sin(A/2)^2.  For small A the three terms are damping
A/2, 2 friction/(pi w) and 4 drag w A^2/(3 pi): an exponential, a line and a hyperbola.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp
from scipy.optimize import curve_fit
from scipy.special import ellipe, ellipk, stdtrit
from scipy.stats import linregress

from cellmap.utils import finite_number

from ..arrays import Floats
from ..time_series import akaike_criterion, akaike_weights, real_numbers, undetermined, warn_of_undetermined
from .natural_frequency import natural_frequency
from .swing_extremes import Envelope

KINDS: Mapping[str, tuple[str, ...]] = {
    "viscous": ("damping",),
    "dry": ("friction",),
    "quadratic": ("drag",),
    "viscous and dry": ("damping", "friction"),
    "viscous and quadratic": ("damping", "drag"),
}
"""Kinds of damping by name, with the parameters of the effects that they are made of."""

USUAL = ("viscous", "dry", "quadratic", "viscous and dry")
"""Kinds that are compared where nothing else is asked for."""

FEWEST = 6
"""Extremes of a decay that kinds of damping are told by: a kind of two coefficients leaves two degrees of freedom."""

_SMALLEST = 1e-9  # amplitude (rad) below which rates are those at it


@dataclass(frozen=True, eq=False)
class DecayModel:
    """One kind of damping fitted to a decay profile.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    coefficients : mapping of str to float
        Parameters of its effects: damping (1/s), friction (rad/s^2), drag (pure number).
    standard_errors : mapping of str to float
        Of the coefficients.
    amplitude : float
        Amplitude at the time of the first extreme (rad).
    frequency : float
        Angular frequency of small swings (rad/s).
    start : float
        Time of the first extreme (s).
    rmse : float
        Root mean square of the residuals (rad).
    chi_square : float
        Sum of squared residuals over the squared errors of the extremes, by degrees of freedom: about 1 for a model
        that is right, if the errors are.
    aicc : float
        Akaike's information criterion for small samples; the smaller the better.
    """

    kind: str
    coefficients: Mapping[str, float]
    standard_errors: Mapping[str, float]
    amplitude: float
    frequency: float
    start: float
    rmse: float
    chi_square: float
    aicc: float

    def __repr__(self) -> str:
        terms = ", ".join(f"{n} {v:.4g} +- {self.standard_errors[n]:.2g}" for n, v in self.coefficients.items())
        flaws = "".join(f", {n} undetermined" for n in self.undetermined)
        return f"DecayModel({self.kind}: {terms}; RMSE {self.rmse:.3g} rad, AICc {self.aicc:.1f}{flaws})"

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Coefficients whose standard errors exceed their values."""
        return undetermined(self.coefficients, self.standard_errors)

    def __call__(self, times: ArrayLike) -> Floats:
        """Return the amplitude (rad) at increasing times (s) from `start` on."""
        t = real_numbers("times", times)
        return decaying(self.amplitude, self.coefficients, self.frequency, t - self.start)


@dataclass(frozen=True, eq=False)
class DecayComparison:
    """Kinds of damping in the order of their information criterion.

    Parameters
    ----------
    models : tuple of DecayModel
        The best first.
    envelope : Envelope
        The extremes.
    """

    models: tuple[DecayModel, ...]
    envelope: Envelope

    def __repr__(self) -> str:
        return f"DecayComparison({', '.join(f'{k} {w:.3g}' for k, w in self.weights.items())})"

    def __getitem__(self, kind: str) -> DecayModel:
        """Return one kind."""
        for model in self.models:
            if model.kind == kind:
                return model
        raise KeyError(f"kind={kind!r}: the kinds that were compared are {', '.join(m.kind for m in self.models)}")

    @property
    def best(self) -> DecayModel:
        """The model with the least criterion."""
        return self.models[0]

    @property
    def weights(self) -> dict[str, float]:
        """Akaike weights: how likely each kind is the best of these, by the data."""
        return akaike_weights({model.kind: model.aicc for model in self.models})


def compare_decays(envelope: Envelope, frequency: float | None = None, kinds: Sequence[str] = USUAL) -> DecayComparison:
    """Fit several kinds of damping to a decay profile and compare them by Akaike's criterion.

    Extremes weigh by their errors, and the size of the scatter is free.  The profile alone decides; a fit of the
    whole motion by :func:`~systems.lab.fit_damping` is sharper.  Averaged amplitudes are right to about a thousandth;
    of swings wider than 2 rad with less noise than that, coefficients err by several standard errors, and viscous
    damping is taken for viscous and dry.

    Parameters
    ----------
    envelope : Envelope
        Extremes of a free swing, at least 6.
    frequency : float, optional
        Angular frequency of small swings (rad/s); by default that of the envelope.
    kinds : sequence of str, optional
        Names among `KINDS`.

    Returns
    -------
    DecayComparison
        Fits and weights.

    Raises
    ------
    TypeError, ValueError
        For unknown kinds, too few extremes, and a swing that does not decay.

    Warns
    -----
    UserWarning
        For coefficients of the best kind that are undetermined.

    References
    ----------
    Burnham, Anderson, *Model Selection and Multimodel Inference* (2002); Marchewka, Abbott, Beichner, American Journal
    of Physics 72 (2004) 477.

    Examples
    --------
    >>> from systems.lab import swing_envelope
    >>> t = np.linspace(0.0, 8.0, 1601)
    >>> noise = np.random.default_rng(0).normal(0.0, 1e-3, t.size)
    >>> compare_decays(swing_envelope(t, 0.3 * np.exp(-0.2 * t) * np.cos(12.0 * t) + noise)).best.kind
    'viscous'
    """
    found = compared_decays(envelope, frequency, kinds)
    best = found.best
    warn_of_undetermined(
        best.coefficients, best.standard_errors, best.undetermined, "compare fewer kinds=, or give a longer film"
    )
    return found


def compared_decays(envelope: Envelope, frequency: float | None, kinds: Sequence[str]) -> DecayComparison:
    """Compare as :func:`compare_decays` does, without a warning."""
    check_decay(envelope, FEWEST)
    w = natural_frequency(envelope).value if frequency is None else finite_number("frequency", frequency, above=0.0)
    models = [_fitted(kind, envelope, w) for kind in checked_kinds(kinds)]
    return DecayComparison(tuple(sorted(models, key=lambda m: m.aicc)), envelope)


def checked_kinds(kinds: Sequence[str]) -> list[str]:
    """Return kinds of damping, each once."""
    if isinstance(kinds, str) or not kinds:
        raise ValueError(f"kinds={kinds!r}: name at least one of {', '.join(map(repr, KINDS))}, in a list")
    for kind in kinds:
        if kind not in KINDS:
            raise ValueError(f"kinds has {kind!r}: choose among {', '.join(map(repr, KINDS))}")
    return list(dict.fromkeys(kinds))


def decaying(amplitude: float, coefficients: Mapping[str, float], frequency: float, times: Floats) -> Floats:
    """Return the amplitude (rad) of a swing at times (s) from 0 on, shape (n,), increasing; 0 once it has stopped."""

    def loss(t: float, a: Floats) -> Floats:
        rates = _rates(np.maximum(a, _SMALLEST), frequency, coefficients)
        return -sum((c * rates[n] for n, c in coefficients.items()), np.zeros_like(a))

    grown = np.concatenate([[0.0], times]) if times.size and times[0] > 0.0 else times
    end = max(float(grown[-1]), 1e-300)
    found = solve_ivp(loss, (0.0, end), [amplitude], t_eval=grown, rtol=1e-8, atol=1e-10)
    return np.maximum(found.y[0, len(grown) - len(times) :], 0.0)


def _rates(a: Floats, w: float, names: Iterable[str]) -> dict[str, Floats]:
    """Loss of amplitude per time for coefficients of 1, of some names."""
    m = np.sin(0.5 * a) ** 2
    k, turning = ellipk(m), np.sin(a)
    fraction = k * turning
    found = {}
    for name in names:
        if name == "damping":
            lost = np.where(a > 1e-3, ellipe(m) - (1.0 - m) * k, np.pi / 4.0 * m * (1.0 + m / 8.0))
            found[name] = 4.0 * lost / fraction
        elif name == "friction":
            found[name] = a / (w * fraction)
        else:
            cubic = np.where(a > 1e-2, turning - a * np.cos(a), a**3 / 3.0 * (1.0 - a * a / 10.0))
            found[name] = 2.0 * w * cubic / fraction
    return found


def _fitted(kind: str, envelope: Envelope, frequency: float) -> DecayModel:
    names = KINDS[kind]
    t, heights = envelope.times - envelope.times[0], envelope.amplitudes
    errors = np.maximum(envelope.standard_errors, 1e-9 * heights[0])
    middle = np.array([heights.mean()])
    slope = max(-float(np.polyfit(t, heights, 1)[0]), 1e-12)
    rates = _rates(middle, frequency, names)
    begin = [float(heights[0]), *(slope / (len(names) * float(rates[n][0])) for n in names)]

    def curve(t: Floats, amplitude: float, *q: float) -> Floats:
        return decaying(amplitude, dict(zip(names, q, strict=True)), frequency, t)

    bounds = [0.0] * len(begin), [np.pi, *([np.inf] * len(names))]
    found, spread = curve_fit(curve, t, heights, begin, errors, bounds=bounds, x_scale=begin)
    rest, count = curve(t, *found) - heights, len(heights)
    total = float(((rest / errors) ** 2).sum())
    return DecayModel(
        kind,
        dict(zip(names, found[1:].tolist(), strict=True)),
        dict(zip(names, np.sqrt(np.diag(spread))[1:].tolist(), strict=True)),
        float(found[0]),
        frequency,
        float(envelope.times[0]),
        float(np.sqrt(np.mean(rest**2))),
        total / (count - len(begin)),
        akaike_criterion(count, total, len(begin) + 1),
    )


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
        flaws = "".join(f", {n} undetermined" for n in self.undetermined)
        return f"QuadraticDecay({terms} (95 %), RMSE {self.rmse:.4g}{flaws})"

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Coefficients, of a, b and c, whose standard errors exceed their values; without a, the profile is a line."""
        columns = (dict(zip("abc", v.tolist(), strict=True)) for v in (self.coefficients, self.standard_errors))
        return undetermined(*columns)

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
        t = real_numbers("times", times) - self.start
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
