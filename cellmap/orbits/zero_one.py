"""The 0-1 test for chaos, a test without derivatives (Gottwald, Melbourne 2009)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import pi

import numpy as np
from numpy.typing import ArrayLike

from .._lib.arrays import Floats
from .._lib.checks import affordable_number, finite_number, of_the_user, real_array, shown, whole_number
from .._lib.randomness import Rng, random_numbers
from .._lib.signatures import checked
from .._lib.threads import run_over
from ..maps.coordinates import Coordinate, state_points
from ..maps.orbit_batch import Status
from ..maps.point_map import PointMap
from .chaos_tests import UNDECIDED, ChaosTest, verdicts

_LOW, _HIGH = 0.2, 0.8  # K is 0 for regular and 1 for chaotic motion
_ROUNDING = 1e-12  # rounding, relative to an orbit's size
_FREQUENCIES = (pi / 5.0, 4.0 * pi / 5.0)


@checked
def zero_one_test(
    point_map: PointMap,
    initial_conditions: ArrayLike,
    periods: int = 2000,
    transient: int = 500,
    observable: Callable[[Floats], Floats] | None = None,
    n_frequencies: int = 100,
    confidence: float = 0.95,
    *,
    rng: Rng = 0,
) -> ChaosTest:
    r"""Distinguish chaotic from regular orbits by the 0-1 test, without derivatives.

    It measures the growth of the distances of :math:`p_n = \sum_{j \le n} \phi_j \cos(j c)` from their beginnings:
    linear in n for chaos (K = 1), bounded otherwise (K = 0).

    Parameters
    ----------
    point_map : PointMap
        Any map.  One step should be about as long as the correlation time: orbits that are sampled much more finely
        appear regular.
    initial_conditions : array_like, shape (..., d)
        Initial conditions of the orbits.
    periods : int, optional
        Length of the orbits after the transient, at least 200.
    transient : int, optional
        Periods of the transient.
    observable : callable, optional
        ``observable(points)`` returns a number for each of the points (..., d).  By default the sum of all coordinates
        in units of their standard deviations, with the sine and cosine of each angle.
    n_frequencies, confidence, rng
        See :func:`zero_one_test_of_series`.

    Returns
    -------
    ChaosTest
        Values are K, which tends to 0 for regular and to 1 for chaotic motion.

    Raises
    ------
    TypeError, ValueError
        For arguments out of range.

    References
    ----------
    Gottwald, Melbourne, SIAM Journal on Applied Dynamical Systems 8 (2009) 129.

    Examples
    --------
    >>> from cellmap import discrete_map
    >>> logistic = discrete_map(lambda x, p: (p.mu * x[0] * (1 - x[0]),), {"mu": 4.0}, ("x",))
    >>> zero_one_test(logistic, [0.3])
    ChaosTest(K over 2000 periods: 1 chaotic)
    """
    points = state_points("initial_conditions", initial_conditions, point_map.coordinates, some=True)
    periods = whole_number("periods", periods, at_least=200)
    begin = point_map.iterate(points, whole_number("transient", transient))
    ended = begin.status >= Status.ESCAPED
    orbit = point_map.orbit(np.where(ended[..., None], points, begin.points), periods - 1)
    ended |= orbit.status[-1] >= Status.ESCAPED
    path = np.where(ended[..., None], 0.0, orbit.points)
    series = _standardised(path, point_map.coordinates) if observable is None else _observed(observable, path)
    if series.shape != path.shape[:-1]:
        raise ValueError(f"observable returns the shape {series.shape} for points of {path.shape}: one number for each")
    test = zero_one_test_of_series(series, n_frequencies, confidence, rng=rng)
    for values in (test.value, test.low, test.high):
        values[ended] = np.nan
    test.verdict[ended] = UNDECIDED
    test.evidence[:, ended] = np.nan
    return test


@checked
def zero_one_test_of_series(
    series: ArrayLike, n_frequencies: int = 100, confidence: float = 0.95, *, rng: Rng = 0
) -> ChaosTest:
    """Distinguish chaotic from regular time series by the 0-1 test.

    The series drives a point in the plane with a frequency c; the point remains bounded for regular motion and diffuses
    for chaotic motion.  K is the correlation of its mean square displacement with time (lags up to a tenth of the
    length), the median over random c between pi/5 and 4 pi/5.

    Parameters
    ----------
    series : array_like, shape (n, ...)
        Time series along the first axis, at least 200 long.
    n_frequencies : int, optional
        Number of random frequencies c, at least 20.
    confidence : float, optional
        Confidence level of the interval of the median, from order statistics (distribution-free).
    rng : int, numpy.random.Generator or None, optional
        Seed or generator of the random frequencies.

    Returns
    -------
    ChaosTest
        "chaotic" if the interval lies above 0.8, "regular" if it lies below 0.2, otherwise "undecided".  A constant
        series has K = 0.

    Raises
    ------
    TypeError, ValueError
        For arguments out of range.

    References
    ----------
    Gottwald, Melbourne, SIAM Journal on Applied Dynamical Systems 8 (2009) 129.

    Examples
    --------
    >>> zero_one_test_of_series(np.cos(2.0 * np.arange(1000.0)))
    ChaosTest(K over 1000 periods: 1 regular)
    """
    given = real_array("series", series)
    if given.ndim == 0 or len(given) < 200:
        raise ValueError(f"series has the shape {given.shape}: give at least 200 values along the first axis")
    if not np.isfinite(given).all():
        raise ValueError("series has values that are not finite: leave out the orbits that terminated")
    confidence = finite_number("confidence", confidence, above=0.0, at_most=1.0 - 1e-12)
    length, shape = len(given), given.shape[1:]
    columns = given.reshape(length, -1)
    if not columns.shape[1]:
        raise ValueError(f"series has the shape {given.shape}: give at least one series")
    count = affordable_number("n_frequencies", n_frequencies, 200 * length, at_least=20)
    chosen = np.sort(random_numbers(rng).uniform(*_FREQUENCIES, count))
    growth = np.stack(run_over(list(columns.T), lambda column: np.sort(_correlations(column, chosen))), axis=1)
    from scipy.stats import binom

    rank = int(binom.ppf(0.5 * (1.0 - confidence), count, 0.5))
    value = np.median(growth, axis=0).reshape(shape)
    low, high = (growth[r].reshape(shape).copy() for r in (max(rank - 1, 0), min(count - rank, count - 1)))
    return ChaosTest(
        verdicts(low, high, _LOW, _HIGH),
        value,
        low,
        high,
        confidence,
        _LOW,
        _HIGH,
        "K",
        length,
        growth.reshape(count, *shape),
        (np.arange(count) + 0.5) / count,
    )


def _correlations(series: Floats, frequencies: Floats) -> Floats:
    """Correlation of mean square displacement and time for each frequency; 0 for a constant."""
    swing = series - series.mean()  # so that no oscillating term has to be taken out of the displacement
    if np.abs(swing).max() <= _ROUNDING * max(np.abs(series).max(), 1e-300):
        return np.zeros(len(frequencies))
    n = len(series)
    lags = n // 10
    kept = n - lags
    walk = np.cumsum(swing / swing.std() * np.exp(1j * frequencies[:, None] * np.arange(1, n + 1)), axis=1)
    size = 1 << (n + kept - 1).bit_length()
    cut = np.where(np.arange(n) < kept, walk, 0.0)
    together = np.fft.ifft(np.fft.fft(walk, size) * np.conj(np.fft.fft(cut, size)))[:, 1 : lags + 1].real
    square = np.cumsum(np.pad(np.abs(walk) ** 2, ((0, 0), (1, 0))), axis=1)
    later = square[:, kept + 1 : kept + lags + 1] - square[:, 1 : lags + 1]
    spread = (later + square[:, kept : kept + 1] - 2.0 * together) / kept
    time = np.arange(lags) - 0.5 * (lags - 1)
    around = spread - spread.mean(axis=1, keepdims=True)
    norm = np.sqrt((time @ time) * (around**2).sum(axis=1))
    return np.asarray(np.where(norm > 0.0, around @ time / np.where(norm > 0.0, norm, 1.0), 0.0))


def _observed(observable: Callable[..., object], path: Floats) -> Floats:
    if not callable(observable):
        raise TypeError(f"observable={shown(observable)}: give a function of points (..., d)")
    return real_array("observable", of_the_user("observable", observable, path), "a function that returns numbers")


def _standardised(path: Floats, coordinates: Sequence[Coordinate]) -> Floats:
    """Sum of all coordinates in units of their standard deviations; those that rest count nothing."""
    total = np.zeros(path.shape[:-1])
    for j, c in enumerate(coordinates):
        x = path[..., j]
        values = np.sin(2.0 * pi * x / c.period) + np.cos(2.0 * pi * x / c.period) if c.period else x
        deviation = values.std(axis=0)
        moves = deviation > _ROUNDING * np.abs(values).max(axis=0, initial=0.0)
        total += np.where(moves, (values - values.mean(axis=0)) / np.where(moves, deviation, 1.0), 0.0)
    return total
