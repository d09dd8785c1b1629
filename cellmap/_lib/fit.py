"""Fits of straight lines to scaling data, with the range in which the data scale."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from math import ceil, floor, log, sqrt

import numpy as np
from numpy.typing import ArrayLike

from .arrays import Floats
from .checks import finite_number, label, pair_of, real_array, whole_number
from .signatures import checked

_FEWEST = 3
_SWING = 0.02  # slopes over one octave of a self-similar set may agree by chance: error of such a slope
_CHANCE = {2: 2.0, 3: 2.8}  # variances: what slopes of so many parts differ by where only given errors scatter them
_RANGE = {2: 1.128, 3: 1.693}  # expected range of 2 and of 3 independent normal numbers, in standard deviations
_UNIFORM = 12.0**-0.5  # standard deviation of a slope that may be anything between two values which are 1 apart


@dataclass(frozen=True, eq=False)
class Fit:
    """A straight line through points, within a range of them.

    Parameters
    ----------
    x, y : ndarray, shape (n,)
        All points, also those outside the range; for a power law their logarithms.
    fit_range : tuple of int
        Numbers of the first and of the last point to which the line is fitted.
    slope, intercept : float
        Of the line of least squares.
    standard_error : float
        Of the slope: from given errors of the points and from the scatter about the line, whichever is larger.
    errors : ndarray, shape (n,), or None
        Standard errors of y.
    labels : tuple of str
        What x and y are.
    """

    x: Floats
    y: Floats
    fit_range: tuple[int, int]
    slope: float
    intercept: float
    standard_error: float
    errors: Floats | None = None
    labels: tuple[str, str] = ("x", "y")

    def __repr__(self) -> str:
        first, last = self.fit_range
        return f"Fit(slope {self.slope:.6g} +- {self.standard_error:.2g}, {last - first + 1} of {len(self.x)} points)"

    @property
    def inside(self) -> slice:
        """The points to which the line is fitted."""
        return slice(self.fit_range[0], self.fit_range[1] + 1)

    @checked
    def interval(self, confidence: float = 0.95) -> tuple[float, float]:
        """Return an interval for the slope (Student's distribution), NaN for two points without errors."""
        confidence = finite_number("confidence", confidence, above=0.0, at_most=1.0 - 1e-12)
        freedom = self.fit_range[1] - self.fit_range[0] - 1
        reach = student_factor(confidence, max(freedom, 1)) * self.standard_error
        return self.slope - reach, self.slope + reach

    def __call__(self, x: ArrayLike) -> Floats:
        """Return the line at some places."""
        return np.asarray(self.intercept + self.slope * np.asarray(x, dtype=float))


def student_factor(confidence: float, freedom: int) -> float:
    """Return the standard errors to either side of a mean that an interval of a confidence reaches.

    Source: Student, Biometrika 6 (1908) 1.

    Examples
    --------
    >>> student_factor(0.95, 10)
    2.228
    """
    from scipy.special import stdtrit

    return float(stdtrit(freedom, 0.5 + 0.5 * confidence))


@checked
def fit_line(
    x: ArrayLike,
    y: ArrayLike,
    fit_range: tuple[int, int] | None = None,
    errors: ArrayLike | None = None,
    tolerance: float = 0.05,
    labels: tuple[str, str] = ("x", "y"),
) -> Fit:
    """Fit a straight line, in a given window or in the largest one in which the points are straight.

    Parameters
    ----------
    x, y : array_like, shape (n,)
        Points in the order of x, at least 3; those that are not finite are outside every window.
    fit_range : tuple of int, optional
        Numbers of the first and of the last point.  By default the longest window in which the points are on a line.
    errors : array_like, shape (n,), optional
        Standard errors of y, which weigh the points.
    tolerance : float, optional
        Largest difference between neighbouring slopes in the window and that of the line, relative where above 1.
    labels : tuple of str, optional
        What x and y are.

    Returns
    -------
    Fit
        The line.

    Raises
    ------
    ValueError
        For too few points, or a range that is empty or outside the points.

    Examples
    --------
    >>> fit_line([0, 1, 2, 3, 4, 5], [0.0, 2.0, 4.0, 6.0, 6.1, 6.1])
    Fit(slope 2 +- 0, 4 of 6 points)
    """
    px, py = real_array("x", x), real_array("y", y)
    for axis in pair_of("labels", labels, "what x and y are"):
        label("labels", axis)
    sigma = None if errors is None else real_array("errors", errors)
    if px.ndim != 1 or px.shape != py.shape or (sigma is not None and sigma.shape != px.shape):
        raise ValueError(f"x, y have the shapes {px.shape}, {py.shape}: give two arrays of one length")
    if fit_range is None:
        first, last = scaling_window(px, py, tolerance)
    else:
        first, last = (whole_number(f"fit_range[{k}]", v, at_most=len(px) - 1) for k, v in enumerate(fit_range))
        if last - first < 1:
            raise ValueError(f"fit_range={fit_range!r}: give the numbers of two points, the smaller one first")
    part = slice(first, last + 1)
    if not (np.isfinite(px[part]).all() and np.isfinite(py[part]).all()):
        raise ValueError(f"fit_range={fit_range!r} holds points that are not finite: give a range of finite points")
    slope, intercept, error = _least_squares(px[part], py[part], None if sigma is None else sigma[part])
    return Fit(px, py, (first, last), slope, intercept, error, sigma, labels)


def scaling_window(x: Floats, y: Floats, tolerance: float = 0.05) -> tuple[int, int]:
    """Return the largest window in which points are on a line: the numbers of its first and last point.

    A window counts if the slopes between all neighbours in it differ from the slope of its line by no more than
    `tolerance` (times that slope where this is above 1).  Of the windows that are longest in x, of three points at
    least, the one with the steepest line is taken, since saturation, at either end, makes lines flat.  If there is
    none, the tolerance is doubled.
    """
    allowed = finite_number("tolerance", tolerance, above=0.0)
    with np.errstate(all="ignore"):
        slopes = np.diff(y) / np.diff(x)
    found = []
    for first, last in _runs(x, y):
        slope = _least_squares(x[first : last + 1], y[first : last + 1], None)[0]
        bent = float(np.abs(slopes[first:last] - slope).max())
        if np.isfinite(bent):
            found.append((bent, max(1.0, abs(slope)), (abs(x[last] - x[first]), abs(slope), first, last)))
    if not found:
        raise ValueError("x, y: no window of neighbouring finite points; give more points")
    while True:
        straight = [key for bent, size, key in found if bent <= allowed * size]
        if straight:
            return max(straight)[2:]
        allowed *= 2.0


def _runs(x: Floats, y: Floats) -> list[tuple[int, int]]:
    """Return the first and the last point of all runs of three finite points or more."""
    usable = np.isfinite(x) & np.isfinite(y)
    finite = int(np.count_nonzero(usable))
    if finite < _FEWEST:
        raise ValueError(f"x, y: {finite} points are finite; give at least {_FEWEST}")
    gaps = np.append(np.flatnonzero(~usable), len(x))
    ends = gaps[np.searchsorted(gaps, np.arange(len(x)))]
    return [(first, last) for first, end in enumerate(ends.tolist()) for last in range(first + _FEWEST - 1, end)]


def scaling_fit(
    x: Floats,
    y: Floats,
    fit_range: tuple[int, int] | None = None,
    errors: Floats | None = None,
    labels: tuple[str, str] = ("x", "y"),
    to_the_end: bool = False,
) -> Fit:
    """Fit a power law to logarithms, with a standard error of the exponent that holds for self-similar sets.

    Without a given range the window is the first of :func:`scaling_windows`.  Besides the scatter about the line the
    error counts, in squares, how unsteady the slope is within the window (:func:`with_drift`) and how it depends on the
    choice of the window (:func:`window_spread`).
    """
    if fit_range is not None:
        return with_drift(fit_line(x, y, fit_range, errors, labels=labels))
    windows = scaling_windows(x, y, to_the_end, errors)
    fit = with_drift(fit_line(x, y, windows[0][:2], errors, labels=labels))
    return replace(fit, standard_error=float(np.hypot(fit.standard_error, window_spread(windows, fit.slope))))


Windows = list[tuple[int, int, float, float]]
"""Windows of points: their first and last point, the slope of the line through them and its error."""


def scaling_windows(x: Floats, y: Floats, to_the_end: bool = False, errors: Floats | None = None) -> Windows:
    """Return all windows of three finite neighbours or more, the one in which the slope is known best first.

    The error of a slope is its standard error from the scatter about the line, as the half of a 95 % interval
    (Student), or from given errors of the points if that is larger; its drift: half of what the slopes of the lower
    and of the upper half of the window differ by; and what a window of less than a decade cannot show (see
    :func:`with_drift`); all in squares.  As long as points are on a line, a longer window has a smaller error, and
    where they bend away it has a larger one; so the first window is the largest linear region.  Oscillations about the
    line, such as the counts of self-similar sets have, do not shorten it, and bends are found that are too slow to be
    seen between neighbours.

    Points that are not finite are outside every window.  The first one has four points, or half of those that are
    finite if these are fewer, but 3 at least; `to_the_end` takes windows alone that end at the last finite point: a law
    for small sizes that are known to be free of saturation.
    """
    finite = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    found: Windows = []
    for first, last in _runs(x, y):
        if to_the_end and last < finite[-1]:
            continue
        part = slice(first, last + 1)
        slope, _, scatter = _least_squares(x[part], y[part], None if errors is None else errors[part])
        reach = student_factor(0.95, last - first - 1) * scatter
        drift = _drift(x, y, first, last, 2, errors, 1.0) / 2.0
        found.append((first, last, slope, float(np.linalg.norm([reach, drift, unseen_error(x, first, last)]))))
    if not found:
        raise ValueError("x, y: no three neighbouring points are finite; give more points")
    fewest = max(_FEWEST, min(4, (len(finite) + 1) // 2))
    return sorted(found, key=lambda one: (one[1] - one[0] + 1 < fewest, round(one[3], 9), one[0] - one[1]))


def window_spread(windows: Windows, slope: float) -> float:
    """Return by how much a slope depends on the choice of the window.

    This is the root of the mean squared distance between the slopes of all windows and a given one, weighted by the
    inverse squares of their errors.
    """
    _, _, slopes, errors = np.array(windows).T
    weights = 1.0 / np.maximum(errors, 1e-9) ** 2
    return float(np.sqrt((weights @ (slopes - slope) ** 2) / weights.sum()))


def with_drift(fit: Fit) -> Fit:
    """Return a fit whose standard error counts the unsteadiness of the slope within its window as well.

    Scatter about a line tells the error of its slope only where the points are independent.  Counts of boxes are not:
    a box of one size is made of those of another.  So what the slopes of halves and thirds of the window differ by is
    added in squares; where points are independent, with errors of their own, as the range of so many normal numbers.
    They may agree by chance, the more easily the fewer octaves there are, so that what slopes of self-similar sets
    swing by is a least value. Within less than a decade such a set may show any slope between those of its gaps and
    of its clusters, which are 1 apart: for the part of a decade that is missing, the slope counts as one of that
    uniform distribution.
    """
    first, last = fit.fit_range
    unseen = unseen_error(fit.x, first, last)
    if last - first < _FEWEST - 1:
        return replace(fit, standard_error=float(np.hypot(fit.standard_error, unseen)))
    ranges = dict.fromkeys(_RANGE, 1.0) if fit.errors is None else _RANGE
    drift = max(
        _drift(fit.x, fit.y, first, last, parts, fit.errors, _CHANCE[parts]) / (ranges[parts] * sqrt(parts))
        for parts in (2, 3)
    )
    swing = _SWING / sqrt(abs(fit.x[last] - fit.x[first]) / log(2.0))
    return replace(fit, standard_error=float(np.linalg.norm([fit.standard_error, drift, swing, unseen])))


def unseen_error(x: Floats, first: int, last: int) -> float:
    """Return the error of a slope for the part of a decade that its window lacks."""
    return _UNIFORM * max(0.0, 1.0 - abs(x[last] - x[first]) / log(10.0))


def _drift(
    x: Floats, y: Floats, first: int, last: int, parts: int, errors: Floats | None, chance: float = 0.0
) -> float:
    """Return by how much the slopes of equal parts of a window differ, without so many variances by given errors.

    Parts that are no whole numbers of points overlap.
    """
    ends = first + (last - first) * np.arange(parts + 1) / parts
    pieces = [slice(floor(a), ceil(b) + 1) for a, b in pairwise(ends)]
    slopes = [_least_squares(x[p], y[p], None if errors is None else errors[p])[0] for p in pieces]
    low, high = np.argmin(slopes), np.argmax(slopes)
    noise = 0.0 if errors is None else sum(_given_variance(x[pieces[k]], errors[pieces[k]]) for k in (low, high))
    return sqrt(max((slopes[high] - slopes[low]) ** 2 - chance * noise, 0.0))


def _given_variance(x: Floats, errors: Floats) -> float:
    """Return the variance of a weighted slope that independent errors of the points explain."""
    weights = 1.0 / np.maximum(errors, 1e-150) ** 2
    return float(1.0 / (weights @ (x - (weights @ x) / weights.sum()) ** 2))


def _least_squares(x: Floats, y: Floats, sigma: Floats | None) -> tuple[float, float, float]:
    """Return slope, intercept and standard error of the slope."""
    weights = np.ones(len(x)) if sigma is None else 1.0 / np.maximum(sigma, 1e-150) ** 2
    if sigma is not None and not (sigma > 0.0).all():
        floor = sigma[sigma > 0.0].min(initial=np.inf)
        weights = np.where(sigma > 0.0, weights, 1.0 / floor**2 if np.isfinite(floor) else 1.0)
    total = weights.sum()
    mx, my = (weights @ x) / total, (weights @ y) / total
    spread = weights @ (x - mx) ** 2
    slope = float(weights @ ((x - mx) * (y - my)) / spread)
    intercept = float(my - slope * mx)
    rest = weights @ (y - intercept - slope * x) ** 2
    scatter = float(np.sqrt(rest / max(len(x) - 2, 1) / spread))
    given = 0.0 if sigma is None else float(np.sqrt(1.0 / spread))
    return slope, intercept, max(scatter, given) if len(x) > 2 else given
