"""Fits of straight lines to scaling data, with the range in which the data scale."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from math import ceil, floor, log, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .checks import finite_number, real_array, whole_number
from .signatures import checked
from .student import student_factor

_FEWEST = 3
_SWING = (
    0.02  # by which slopes over an octave swing on self-similar sets, and may agree by chance where octaves are few
)


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

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    fit_range: tuple[int, int]
    slope: float
    intercept: float
    standard_error: float
    errors: NDArray[np.float64] | None = None
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

    def __call__(self, x: ArrayLike) -> NDArray[np.float64]:
        """Return the line at some places."""
        return np.asarray(self.intercept + self.slope * np.asarray(x, dtype=float))


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


def scaling_window(
    x: NDArray[np.float64], y: NDArray[np.float64], tolerance: float = 0.05, fewest: int = _FEWEST
) -> tuple[int, int]:
    """Return the largest window in which points are on a line: the numbers of its first and last point.

    A window counts if the slopes between all neighbours in it differ from the slope of its line by no more than
    `tolerance` (times that slope where this is above 1).  Of the windows that are longest in x, of `fewest` points at
    least, the one with the steepest line is taken, since saturation, at either end, makes lines flat.  If there is
    none, the tolerance is doubled.
    """
    allowed = finite_number("tolerance", tolerance, above=0.0)
    usable = np.isfinite(x) & np.isfinite(y)
    if np.count_nonzero(usable) < fewest:
        raise ValueError(f"x, y: {np.count_nonzero(usable)} points are finite; give at least {fewest}")
    with np.errstate(all="ignore"):
        slopes = np.diff(y) / np.diff(x)
    for _ in range(30):
        best: tuple[float, float, int, int] | None = None
        for first in range(len(x)):
            for last in range(first + fewest - 1, len(x)):
                inner = slopes[first:last]
                if not np.isfinite(inner).all():
                    break
                slope = _least_squares(x[first : last + 1], y[first : last + 1], None)[0]
                if np.abs(inner - slope).max() <= allowed * max(1.0, abs(slope)):
                    key = (abs(x[last] - x[first]), abs(slope), first, last)
                    best = max(best, key) if best is not None else key
        if best is not None:
            return best[2], best[3]
        allowed *= 2.0
    raise ValueError("x, y: no window of neighbouring finite points; give more points")


def steady_window(
    x: NDArray[np.float64], y: NDArray[np.float64], fewest: int = 4, to_the_end: bool = False
) -> tuple[int, int]:
    """Return the window in which a slope is known best: the numbers of its first and last point.

    The error of a slope is its standard error from the scatter about the line, as the half of a 95 % interval
    (Student), and its drift: half of what the slopes of the lower and of the upper half of the window differ by; both
    in squares.  As long as points are on a line, a longer window has a smaller error, and where they bend away it has a
    larger one; so this is the largest linear region.  Oscillations about the line, such as the counts of self-similar
    sets have, do not shorten it, and bends are found that are too slow to be seen between neighbours.

    Points that are not finite are outside every window.  A window has `fewest` points, or half of those that are finite
    if these are fewer, but 3 at least; `to_the_end` takes windows alone that end at the last finite point: a law for
    small sizes that are known to be free of saturation.
    """
    finite = int(np.count_nonzero(np.isfinite(x) & np.isfinite(y)))
    if finite < _FEWEST:
        raise ValueError(f"x, y: {finite} points are finite; give at least {_FEWEST}")
    fewest = max(_FEWEST, min(fewest, (finite + 1) // 2))
    found = [
        (last - first + 1 < fewest, round(error, 9), first - last, first, last)
        for first, last, _, error in _windows(x, y, to_the_end)
    ]
    if not found:
        raise ValueError("x, y: no three neighbouring points are finite; give more points")
    return min(found)[3:]


def window_spread(x: NDArray[np.float64], y: NDArray[np.float64], slope: float, to_the_end: bool = False) -> float:
    """Return by how much a slope depends on the choice of the window.

    This is the root of the mean squared distance between the slopes of all windows and a given one, weighted by the
    inverse squares of the errors by which :func:`steady_window` chooses.
    """
    _, _, slopes, errors = np.array(_windows(x, y, to_the_end)).T
    weights = 1.0 / np.maximum(errors, 1e-9) ** 2
    return float(np.sqrt((weights @ (slopes - slope) ** 2) / weights.sum()))


def _windows(x: NDArray[np.float64], y: NDArray[np.float64], to_the_end: bool) -> list[tuple[int, int, float, float]]:
    """Return all windows of three finite points or more: first, last, slope and its error."""
    from scipy.special import stdtrit

    usable = np.isfinite(x) & np.isfinite(y)
    found = []
    for first in range(len(x)):
        for last in range(first + _FEWEST - 1, len(x)):
            if not usable[first : last + 1].all():
                break
            if to_the_end and usable[last + 1 :].any():
                continue
            slope, _, scatter = _least_squares(x[first : last + 1], y[first : last + 1], None)
            reach = float(stdtrit(last - first - 1, 0.975)) * scatter
            found.append(
                (first, last, slope, float(np.hypot(reach, np.ptp(_slopes_of_parts(x, y, first, last, 2)) / 2.0)))
            )
    return found


def with_drift(fit: Fit) -> Fit:
    """Return a fit whose standard error counts the unsteadiness of the slope within its window as well.

    Scatter about a line tells the error of its slope only where the points are independent.  Counts of boxes are not:
    a box of one size is made of those of another.  So what the slopes of halves and thirds of the window differ by is
    added in squares, and where they happen to agree what slopes of self-similar sets swing by.
    """
    if fit.fit_range[1] - fit.fit_range[0] < _FEWEST - 1:
        return fit
    return replace(fit, standard_error=float(np.hypot(fit.standard_error, _unsteadiness(fit.x, fit.y, *fit.fit_range))))


def _unsteadiness(x: NDArray[np.float64], y: NDArray[np.float64], first: int, last: int) -> float:
    """Return by how much the slope of a window may differ from that of octaves that it does not hold.

    Its halves and its thirds tell; they may agree by chance, the more easily the fewer octaves there are, so that the
    swings of self-similar sets are a least value.
    """
    octaves = abs(x[last] - x[first]) / log(2.0)
    drift = max(np.ptp(_slopes_of_parts(x, y, first, last, parts)) / sqrt(parts) for parts in (2, 3))
    return float(np.hypot(drift, _SWING / sqrt(octaves)))


def _slopes_of_parts(x: NDArray[np.float64], y: NDArray[np.float64], first: int, last: int, parts: int) -> list[float]:
    """Return the slopes of equal parts of a window; parts that are no whole numbers of points overlap."""
    ends = first + (last - first) * np.arange(parts + 1) / parts
    pieces = [slice(floor(a), ceil(b) + 1) for a, b in pairwise(ends)]
    return [_least_squares(x[p], y[p], None)[0] for p in pieces]


def _least_squares(
    x: NDArray[np.float64], y: NDArray[np.float64], sigma: NDArray[np.float64] | None
) -> tuple[float, float, float]:
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
