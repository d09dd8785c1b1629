"""Tests for chaos with a confidence interval and a verdict: the record, and the test by Lyapunov exponents."""

from __future__ import annotations

from dataclasses import dataclass
from math import log

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._lib.arrays import Bools, Floats
from .._lib.checks import finite_number, whole_number
from .._lib.fit import student_factor
from .._lib.signatures import checked
from ..maps.coordinates import difference, turns_of
from ..maps.point_map import PointMap
from .lyapunov import GROUPS, lyapunov_spectrum

CHAOTIC, REGULAR, UNDECIDED = "chaotic", "regular", "undecided"

FOLDS = 10.0
"""E-folds in half an orbit, up to which growth is not seen to be exponential."""

_POWER = 3.0  # of time: growth that might still be regular; plain shear gives 1
_ROUNDING = 1e-12  # of an orbit's size
_LONGEST_RETURN = 128


@dataclass(frozen=True, eq=False)
class ChaosTest:
    """Result of a test for chaos, for one or several orbits.

    Parameters
    ----------
    verdict : ndarray of str, shape (...)
        "chaotic", "regular" or "undecided", for each orbit.
    value : ndarray, shape (...)
        The tested quantity: the largest Lyapunov exponent per step, the K of the 0-1 test, or the rate of alignment;
        NaN for an orbit that terminated.
    low, high : ndarray, shape (...)
        Confidence interval of the value.
    confidence : float
        Confidence level of the interval.
    below, above : float
        The verdict is "chaotic" if the interval lies above `above`, otherwise "regular" if it lies below `below`.
    quantity : str
        Name of the tested quantity.
    periods : int
        Length of the orbits.
    evidence : ndarray, shape (k, ...)
        Data behind the value: the exponent or rate after each part of the orbit, or the K of each frequency, sorted.
    at : ndarray, shape (k,)
        Steps of the map after which the evidence was recorded, or fractions of the frequencies.
    """

    verdict: NDArray[np.str_]
    value: Floats
    low: Floats
    high: Floats
    confidence: float
    below: float
    above: float
    quantity: str
    periods: int
    evidence: Floats
    at: Floats

    def __repr__(self) -> str:
        counts = ", ".join(
            f"{np.count_nonzero(self.verdict == v)} {v}"
            for v in (CHAOTIC, REGULAR, UNDECIDED)
            if (self.verdict == v).any()
        )
        return f"ChaosTest({self.quantity} over {self.periods} periods: {counts})"

    @property
    def chaotic(self) -> Bools:
        """Whether each orbit is found to be chaotic, shape (...)."""
        return np.asarray(self.verdict == CHAOTIC)

    @property
    def regular(self) -> Bools:
        """Whether each orbit is found to be regular within the resolution of the test, shape (...)."""
        return np.asarray(self.verdict == REGULAR)


@checked
def exponent_test(
    point_map: PointMap,
    initial_conditions: ArrayLike,
    periods: int = 2000,
    transient: int = 500,
    confidence: float = 0.999,
    progress: bool = False,
) -> ChaosTest:
    """Distinguish chaotic from regular orbits by the largest Lyapunov exponent over the second half of each orbit.

    Near a regular orbit displacements grow linearly in time by shear, so that a finite orbit has a positive exponent
    without chaos.  Over the second half of an orbit a growth like t^p multiplies displacements by 2^p, however long the
    orbit is; chaos multiplies them by a factor that grows with its length.  The verdict is "chaotic" if the confidence
    interval of that factor lies above the factor of t^3, otherwise "regular" if it lies below e^10.  A periodic orbit
    is "regular", stable or not.

    Parameters
    ----------
    point_map : PointMap
        Stroboscopic or discrete map; for an interpolated map, the exact map behind it is used.
    initial_conditions : array_like, shape (..., d)
        Initial conditions of the orbits.
    periods : int, optional
        Length of the orbits after the transient, at least 40.
    transient : int, optional
        Periods of the transient.
    confidence : float, optional
        Confidence level of the interval, from the spread of the means over 10 parts of the second half.
    progress : bool, optional
        Show a bar on a terminal for work of more than two seconds.

    Returns
    -------
    ChaosTest
        Values are exponents per step.  A "regular" orbit may be chaotic with an exponent below ``below``, 20/periods.

    Raises
    ------
    TypeError, ValueError
        For arguments out of range.

    References
    ----------
    Benettin, Galgani, Giorgilli, Strelcyn, Meccanica 15 (1980) 9.

    Examples
    --------
    >>> from cellmap import discrete_map
    >>> logistic = discrete_map(lambda x, p: (p.mu * x[0] * (1 - x[0]),), {"mu": 4.0}, ("x",))
    >>> exponent_test(logistic, [0.3])
    ChaosTest(largest exponent per step over 2000 periods: 1 chaotic)
    """
    periods = whole_number("periods", periods, at_least=2 * GROUPS)
    confidence = finite_number("confidence", confidence, above=0.0, at_most=1.0 - 1e-12)
    found = lyapunov_spectrum(point_map, initial_conditions, periods, transient, progress)
    late = np.flatnonzero(found.steps > periods // 2)
    length = int(found.steps[-1] - found.steps[late[0] - 1])
    first = np.linspace(0, len(late), GROUPS // 2 + 1).round().astype(int)[:-1]
    lengths = np.add.reduceat(np.diff(found.steps, prepend=0)[late], first)
    rates = np.add.reduceat(found.growth[late][..., 0], first, axis=0)
    rates = rates / lengths.reshape(-1, *(1,) * (rates.ndim - 1))
    value = found.growth[late][..., 0].sum(axis=0) / length
    with np.errstate(invalid="ignore"):  # a direction that vanishes is known without an error
        error = np.nan_to_num(rates.std(axis=0, ddof=1) / np.sqrt(len(first)))
        reach = student_factor(confidence, len(first) - 1) * error
    below, above = FOLDS / length, _POWER * log(2.0) / length
    low, high = value - reach, value + reach
    verdict = settle_verdicts(point_map.without_table, found.ends, found.ended, low, high, below, above)
    return ChaosTest(
        verdict,
        value,
        low,
        high,
        confidence,
        below,
        above,
        "largest exponent per step",
        periods,
        found.convergence[..., 0],
        found.steps.astype(float),
    )


def settle_verdicts(
    exact: PointMap, ends: Floats, ended: Bools, low: Floats, high: Floats, below: float, above: float
) -> NDArray[np.str_]:
    """Return a verdict for each interval of a rate; "regular" for an orbit whose end closes, stable or not."""
    verdict = verdicts(low, high, below, above)
    verdict[_closed(exact, ends, ended)] = REGULAR
    return verdict


def _closed(exact: PointMap, ends: Floats, ended: Bools) -> Bools:
    """Tell which orbits come back to within rounding of where they were."""
    points = exact.orbit(np.where(ended[..., None], 0.0, ends), _LONGEST_RETURN).points
    turn = turns_of(exact.coordinates)[1]
    scale = np.where(turn > 0.0, turn, np.maximum(np.nan_to_num(np.abs(points)).max(axis=0), 1e-300))
    apart = np.abs(difference(points[1:], points[0], exact.coordinates))
    with np.errstate(invalid="ignore"):
        return np.asarray((apart <= _ROUNDING * scale).all(axis=-1).any(axis=0) & ~ended)


def verdicts(low: Floats, high: Floats, below: float, above: float) -> NDArray[np.str_]:
    """Return a verdict for each interval; "undecided" where it is NaN."""
    verdict = np.full(low.shape, UNDECIDED)
    with np.errstate(invalid="ignore"):
        verdict[high < below] = REGULAR
        verdict[low > above] = CHAOTIC
    return verdict
