"""Uncertainty exponents from counts of uncertain pairs, with a verdict on the boundary."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..._lib.binomial import binomial_interval
from ..._lib.fit import Fit, fit_line
from ...maps.orbit_batch import Cost
from ...orbits.attractor import Attractor

SMOOTH, FRACTAL, UNDETERMINED, NO_BOUNDARY = "consistent with smooth", "fractal", "undetermined", "no boundary"
"""Verdicts on a boundary.  Smoothness cannot be proved: the dimension may be larger by less than the error."""

_FEWEST = 20  # uncertain pairs at a distance that is used
_UNDECIDED = 0.1  # undecided pairs, relative to uncertain ones, from which a distance is not used
_OSCILLATION = 0.03  # relative, of fractions about the power law on self-similar boundaries
_REJECTED = 0.05  # probability of the scatter about a line below which it is none
_ALIKE = 1.25  # ratio of errors up to which a longer window is preferred
_DECADE = 10.0  # range of distances below which nothing is called fractal
_RISE = 2.0  # times that from the coarser to the finer half of the distances: as far again as these reach
_VAGUE = 0.1  # standard error above which nothing is called consistent with smooth


@dataclass(frozen=True, eq=False)
class UncertaintyExponent:
    """Uncertainty exponent, with the counts of uncertain pairs of initial conditions at several distances.

    Parameters
    ----------
    fit : Fit or None
        Fit of the logarithm of the fraction against that of the distance; None if fewer than three distances have
        uncertain pairs.
    distances : ndarray, shape (n,)
        Distances of the pairs, decreasing.
    pairs, uncertain : ndarray of int, shape (n,)
        Number of pairs in which both initial conditions have a basin, and of those in which the basins differ.
    left_out, undecided : ndarray of int, shape (n,)
        Number of pairs that were excluded because an initial condition has no basin, and of those among them with an
        undecided one.
    dimension : int
        Dimension D of the region of the initial conditions.
    floor : float
        Smallest distance that the accuracy of the map, or the resolution of the image, allows.
    unit : str
        Unit of the distances.
    attractors : tuple of Attractor
        Attractors whose basins were distinguished.
    cost : Cost
        Wall time and number of initial conditions.
    name : str
        Name of the system.
    """

    fit: Fit | None
    distances: NDArray[np.float64]
    pairs: NDArray[np.int64]
    uncertain: NDArray[np.int64]
    left_out: NDArray[np.int64]
    undecided: NDArray[np.int64]
    dimension: int
    floor: float
    unit: str
    attractors: tuple[Attractor, ...] = ()
    cost: Cost = Cost()
    name: str = ""

    def __repr__(self) -> str:
        if self.fit is None:
            return (
                f"UncertaintyExponent({self.verdict}, {self.uncertain.sum()} of {self.pairs.sum():,} pairs uncertain)"
            )
        return (
            f"UncertaintyExponent({self.exponent:.4f} +- {self.standard_error:.2g} from {self.decades:.1f} decades, "
            f"{self.pairs.sum():,} pairs: {self.verdict})"
        )

    @property
    def exponent(self) -> float:
        """Uncertainty exponent: slope of the fit, NaN without one."""
        return self.fit.slope if self.fit is not None else np.nan

    @property
    def standard_error(self) -> float:
        """Standard error of the exponent, NaN without a fit."""
        return self.fit.standard_error if self.fit is not None else np.nan

    @property
    def boundary_dimension(self) -> float:
        """Box-counting dimension of the boundary, D - exponent; its standard error is that of the exponent."""
        return self.dimension - self.exponent

    @property
    def fractions(self) -> NDArray[np.float64]:
        """Fraction of uncertain pairs at each distance."""
        return np.asarray(self.uncertain / np.maximum(self.pairs, 1))

    @property
    def intervals(self) -> NDArray[np.float64]:
        """95 % confidence interval of each fraction (Wilson 1927), shape (n, 2); pairs are taken as independent."""
        return np.stack(binomial_interval(self.uncertain, self.pairs, method="Wilson"), axis=-1)

    @property
    def decades(self) -> float:
        """Number of decades between the largest and the smallest distance of the fit."""
        return 0.0 if self.fit is None else float(np.ptp(self.fit.x[self.fit.inside]) / np.log(10.0))

    @property
    def verdict(self) -> str:
        """Verdict on the boundary: "fractal", "consistent with smooth", "undetermined" or "no boundary".

        Consistent with smooth: 1 lies within two standard errors of the exponent, which is known to 0.1.  This includes
        fractal boundaries whose dimension is as close to that of a smooth one, such as many Julia sets.  Fractal: the
        exponent is more than three standard errors below 1, over at least a decade; and so is that of the finer half of
        the distances, even if it continued to rise by twice as much as it has risen from the coarser half, as it does
        where adjacent smooth pieces begin to be resolved.  The statistical uncertainty of that rise counts as error.
        Everything else is undetermined.
        """
        if self.fit is None:
            return UNDETERMINED if self.uncertain.any() or not self.pairs.any() else NO_BOUNDARY
        slope, error = self.exponent, self.standard_error
        if slope > 1.0 - 2.0 * error:
            return SMOOTH if error <= _VAGUE and slope < 1.0 + max(3.0 * error, _VAGUE) else UNDETERMINED
        halves = _halves(self.fit)
        if slope > 1.0 - 3.0 * error or self.decades < np.log10(_DECADE) - 1e-9 or halves is None:
            return UNDETERMINED
        (coarse, coarse_error), (fine, fine_error) = halves
        ahead = fine + _RISE * max(fine - coarse, 0.0)
        doubt = float(np.hypot((1.0 + _RISE) * fine_error, _RISE * coarse_error))
        return FRACTAL if ahead < 1.0 - 3.0 * doubt else UNDETERMINED


def fit_exponent(
    distances: NDArray[np.float64],
    pairs: NDArray[np.int64],
    uncertain: NDArray[np.int64],
    left_out: NDArray[np.int64],
    undecided: NDArray[np.int64],
    dimension: int,
    floor: float,
    unit: str,
    window: tuple[int, int] | None,
    attractors: tuple[Attractor, ...] = (),
    cost: Cost = Cost(),
    name: str = "",
) -> UncertaintyExponent:
    """Fit the exponent to counts of independent pairs."""
    empty = UncertaintyExponent(
        None, distances, pairs, uncertain, left_out, undecided, dimension, floor, unit, attractors, cost, name
    )
    usable = (uncertain >= _FEWEST) & (uncertain < pairs) & (undecided <= _UNDECIDED * uncertain)
    if window is None and _run(usable) < 3:
        return empty
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y = np.log(distances), np.log(uncertain / pairs)
        errors = np.sqrt((pairs - uncertain) / (1.0 * pairs * uncertain))
    chosen = fit_range(x, np.where(usable, y, np.nan), errors) if window is None else window
    labels = (f"ln distance ({unit})", "ln fraction of uncertain pairs")
    fit = fit_line(x, y, chosen, errors, labels=labels)
    return replace(empty, fit=_with_halves(_with_choice(fit)) if window is None else fit)


def _with_choice(fit: Fit) -> Fit:
    """Return a fit whose standard error counts how its slope depends on where the window begins.

    Points at the large end are taken in or left out by tests that scatter decides as well; what beginning one distance
    earlier or later changes is added, in squares.
    """
    first, last = fit.fit_range
    changes = [
        fit_line(fit.x, fit.y, (begin, last), fit.errors).slope - fit.slope
        for begin in (first - 1, first + 1)
        if begin >= 0 and last - begin >= 2 and np.isfinite(fit.y[begin])
    ]
    added = float(np.sqrt(np.mean(np.square(changes)))) if changes else 0.0
    return replace(fit, standard_error=float(np.hypot(fit.standard_error, added)))


def _with_halves(fit: Fit) -> Fit:
    """Return a fit whose standard error counts half of what the slopes of both halves of its window differ by."""
    first, last = fit.fit_range
    middle = (first + last) // 2
    coarse, fine = (fit_line(fit.x, fit.y, part, fit.errors).slope for part in ((first, middle), (middle, last)))
    return replace(fit, standard_error=float(np.hypot(fit.standard_error, 0.5 * (coarse - fine))))


def _run(usable: NDArray[np.bool_]) -> int:
    """Return how many usable distances follow each other up to the smallest one."""
    finite = np.flatnonzero(usable)
    if not len(finite):
        return 0
    breaks = np.flatnonzero(~usable[: finite[-1]])
    return int(finite[-1] - (breaks[-1] if len(breaks) else -1))


def fit_range(x: NDArray[np.float64], y: NDArray[np.float64], errors: NDArray[np.float64]) -> tuple[int, int]:
    """Choose the distances for a fit of the exponent: the numbers of the first and of the last point.

    The law holds in the limit of small distances, and at large ones the fraction saturates.  So a window always ends at
    the smallest usable distance.  It may begin where the scatter of the points about the weighted line is what their
    errors let expect (chi-square, 5 %) and neither of its two largest distances lies more than two standard errors off
    the line through the others.  Fractions oscillate about the law on boundaries that are self-similar, by some
    percent; 3 % are therefore added to the error of each point for these tests.  Where pairs are few such tests let
    saturated distances pass.  So of these windows the longest is taken in which the slope is known about as well as in
    the best one (to a quarter), by its standard error and half of what the slopes of both halves differ by, in squares.
    Where no window of four or more passes, it is the last three or four.

    ``x`` and ``y`` (n,) are logarithms of decreasing distances and of fractions, NaN in y where a distance is not
    usable.
    """
    finite = np.flatnonzero(np.isfinite(y))
    last = first = int(finite[-1])
    while first > 0 and np.isfinite(y[first - 1]):
        first -= 1
    allowed = np.hypot(errors, _OSCILLATION)
    straight = [begin for begin in range(first, last - 2) if _is_straight(x, y, allowed, begin, last)]
    if straight:
        found = np.array([_with_halves(fit_line(x, y, (k, last), allowed)).standard_error for k in straight])
        return straight[int(np.argmax(found <= _ALIKE * found.min()))], last
    if last - first < 2:
        raise ValueError("fewer than three neighbouring distances have enough uncertain pairs: draw more pairs")
    return max(first, last - 3), last


def _is_straight(
    x: NDArray[np.float64], y: NDArray[np.float64], errors: NDArray[np.float64], begin: int, last: int
) -> bool:
    """Return whether a window holds no more than scatter, and its two largest distances follow the others."""
    from scipy.special import chdtrc

    inside = slice(begin, last + 1)
    line = fit_line(x, y, (begin, last), errors)
    chi = float((((y - line(x)) / errors)[inside] ** 2).sum())
    if chdtrc(last - begin - 1, chi) < _REJECTED:
        return False
    return all(_agrees(x, y, errors, k, last) for k in range(begin, min(begin + 2, last - 2)))


def _agrees(x: NDArray[np.float64], y: NDArray[np.float64], errors: NDArray[np.float64], k: int, last: int) -> bool:
    """Return whether a point lies within two standard errors of the line through those after it."""
    rest = slice(k + 1, last + 1)
    weights = 1.0 / errors[rest] ** 2
    mean = float(weights @ x[rest] / weights.sum())
    spread = float(weights @ (x[rest] - mean) ** 2)
    line = fit_line(x, y, (k + 1, last), errors)
    variance = errors[k] ** 2 + 1.0 / weights.sum() + (x[k] - mean) ** 2 / spread
    return bool(abs(y[k] - float(line(x[k]))) <= 2.0 * np.sqrt(variance))


def _halves(fit: Fit) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """Return slope and error of the coarser and of the finer half of a window."""
    order = np.argsort(-fit.x[fit.inside]) + fit.fit_range[0]
    if len(order) < 6:
        return None
    parts = []
    for part in (order[: len(order) // 2], order[len(order) // 2 :]):
        errors = None if fit.errors is None else fit.errors[part]
        line = fit_line(fit.x[part], fit.y[part], (0, len(part) - 1), errors)
        parts.append((line.slope, line.standard_error))
    return parts[0], parts[1]
