"""Measured series, with NaN where nothing was seen: their noise, their residuals, and criteria of models of them."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from math import exp, log, sqrt

import numpy as np
from numpy.typing import ArrayLike

from cellmap.utils import check_length

from .arrays import Floats

_NEIGHBOURS = 5
_OUTLYING = 4.0
_MEDIAN = 0.6744897501960817  # of the absolute value of a standard normal variable


def measured_series(
    times: ArrayLike, values: ArrayLike, name: str = "angles", fewest: int = 8
) -> tuple[Floats, Floats]:
    """Return a measured series as new arrays, checked.

    Parameters
    ----------
    times : array_like, shape (n,)
        Times (s), finite and increasing, not necessarily even.
    values : array_like, shape (n,)
        Values; NaN marks a gap.
    name : str, optional
        Name of the values in messages.
    fewest : int, optional
        Values that must be there.

    Returns
    -------
    times, values : ndarray, shape (n,)
        The series, gaps included.

    Raises
    ------
    TypeError, ValueError
        For arrays of other shapes, times that do not increase, infinite values, too few values, or values that are all
        equal.

    Examples
    --------
    >>> times, values = measured_series([0.0, 0.1, 0.2], [1.0, float("nan"), 2.0], fewest=2)
    >>> values
    array([ 1., nan,  2.])
    """
    t, v = (real_numbers(n, a, " in an array of shape (n,)") for n, a in (("times", times), (name, values)))
    if t.ndim != 1 or t.shape != v.shape:
        raise ValueError(f"times have the shape {t.shape} and {name} {v.shape}: give (n,) twice")
    if not np.isfinite(t).all():
        raise ValueError(f"times[{int(np.argmin(np.isfinite(t)))}] is not finite: leave the sample out")
    if not (np.diff(t) > 0.0).all():
        first = int(np.argmin(np.diff(t) > 0.0)) + 1
        raise ValueError(f"times[{first}] is not after the one before: sort the series by time")
    if np.isinf(v).any():
        raise ValueError(f"{name}[{int(np.argmax(np.isinf(v)))}] is infinite: mark what is missing with NaN")
    seen = v[np.isfinite(v)]
    if seen.size < fewest:
        raise ValueError(f"{name} has {seen.size} numbers: give at least {fewest}")
    if not np.ptp(seen) > 1e-13 * abs(seen[0]):
        raise ValueError(f"{name} is constant, {seen[0]:g}: nothing moves")
    return t, v


def real_numbers(name: str, given: ArrayLike, form: str = "") -> Floats:
    """Return a new array of real numbers; an error names the argument and the form that it should have."""
    check_length(name, given)
    try:
        return np.array(given, dtype=np.float64)
    except (TypeError, ValueError):
        raise TypeError(f"{name}: give real numbers{form}") from None


def noise_level(times: Floats, values: Floats, neighbours: int = _NEIGHBOURS) -> float:
    """Return the standard deviation of independent noise on a smooth series, from its divided differences.

    Of five neighbours the fourth divided difference has no part of any cubic, and its weights are known.  Those far
    beyond the median are left out as outliers.  A motion that is sampled badly counts as noise, the less the more
    neighbours are taken.

    Parameters
    ----------
    times : ndarray, shape (n,)
        Times (s), increasing.
    values : ndarray, shape (n,)
        Values; NaN marks a gap.
    neighbours : int, optional
        Values of a difference.

    Returns
    -------
    float
        Standard deviation; NaN for fewer values than `neighbours`.

    Examples
    --------
    >>> times = np.linspace(0.0, 10.0, 2000)
    >>> noise = np.random.default_rng(0).normal(0.0, 0.01, times.size)
    >>> round(noise_level(times, np.cos(times) + noise), 3)
    0.01
    """
    seen = np.isfinite(values)
    if np.count_nonzero(seen) < neighbours:
        return np.nan
    t, v = (np.lib.stride_tricks.sliding_window_view(a[seen], neighbours) for a in (times, values))
    t = t / np.ptp(t, axis=1, keepdims=True)
    weights = 1.0 / np.stack([np.delete(t[:, k, None] - t, k, axis=1).prod(axis=1) for k in range(neighbours)], axis=1)
    weights /= np.linalg.norm(weights, axis=1, keepdims=True)
    parts = np.abs((weights * v).sum(axis=1))
    rough = float(np.median(parts)) / _MEDIAN
    return float(np.sqrt(np.mean(parts[parts <= _OUTLYING * rough] ** 2)))


def neighbour_correlation(residuals: Floats) -> float:
    """Return the correlation of neighbouring residuals: near 0 for independent ones, near 1 for a model that is wrong.

    Parameters
    ----------
    residuals : ndarray, shape (n,) or (n, m)
        Residuals in the order of time; NaN marks a gap.

    Returns
    -------
    float
        Correlation; 0 where there are no neighbours, or nothing is left.
    """
    now, later = residuals[:-1], residuals[1:]
    both = np.isfinite(now) & np.isfinite(later)
    scale = float(np.nanmean(residuals**2))
    return float(np.mean(now[both] * later[both])) / scale if both.any() and scale > 0.0 else 0.0


def widening(residuals: Floats) -> float:
    """Return by what factor standard errors widen for residuals that follow each other.

    They hold less than as many independent ones, by the factor of a first-order autoregression with their correlation.

    Parameters
    ----------
    residuals : ndarray, shape (n,) or (n, m)
        Residuals in the order of time; NaN marks a gap.

    Returns
    -------
    float
        Factor, at least 1.

    Examples
    --------
    >>> widening(np.array([1.0, -1.0, 1.0, -1.0]))
    1.0
    """
    correlation = max(neighbour_correlation(residuals), 0.0)
    return sqrt((1.0 + correlation) / max(1.0 - correlation, 1e-6))


def undetermined(values: Mapping[str, float], errors: Mapping[str, float]) -> tuple[str, ...]:
    """Return the names of values that their standard errors exceed: a measurement does not tell them from zero.

    Examples
    --------
    >>> undetermined({"damping": 1.05, "length": 0.069}, {"damping": 30.0, "length": 0.001})
    ('damping',)
    """
    return tuple(name for name, value in values.items() if not errors[name] <= abs(value))


def warn_of_undetermined(
    values: Mapping[str, float], errors: Mapping[str, float], names: tuple[str, ...], remedy: str
) -> None:
    """Warn the caller of a public function, from which this is called, of names that its fit leaves undetermined."""
    if names:
        said = ", ".join(f"{name}={values[name]:.4g} +- {errors[name]:.2g}" for name in names)
        warnings.warn(f"{said}: what was measured does not tell it from zero; {remedy}", stacklevel=3)


def akaike_criterion(count: int, total: float, free: int) -> float:
    """Return the criterion of a fit by least squares.

    Parameters
    ----------
    count : int
        Number of values.
    total : float
        Sum of their squared residuals.
    free : int
        Number of fitted parameters, the variance of the residuals among them.

    Returns
    -------
    float
        Criterion; the smaller the better.

    References
    ----------
    Burnham, Anderson, *Model Selection and Multimodel Inference* (2002), section 2.4.
    """
    return count * log(max(total, 1e-300) / count) + 2.0 * free * count / max(count - free - 1, 1)


def akaike_weights(criteria: Mapping[str, float]) -> dict[str, float]:
    """Return how likely each model is the best of some, by the data, from their criteria.

    Examples
    --------
    >>> akaike_weights({"line": 10.0, "parabola": 10.0})
    {'line': 0.5, 'parabola': 0.5}
    """
    least = min(criteria.values())
    likely = {name: exp(-0.5 * (value - least)) for name, value in criteria.items()}
    total = sum(likely.values())
    return {name: value / total for name, value in likely.items()}
