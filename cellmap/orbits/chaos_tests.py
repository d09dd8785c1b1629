"""Tests for chaos with a confidence interval and a verdict, by Lyapunov exponents and by alignment of deviations."""

from __future__ import annotations

from dataclasses import dataclass
from math import log
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._lib.arrays import Bools, Floats
from .._lib.checks import finite_number, whole_number
from .._lib.fit import student_factor
from .._lib.randomness import Rng, random_numbers
from .._lib.signatures import checked
from .._lib.threads import run_over, slices
from ..maps.coordinates import difference, state_points, turns_of, wrap
from ..maps.orbit_batch import CHUNK, Orbits, Status
from ..maps.point_map import PointMap
from ..maps.tangent import tangent
from .lyapunov import GROUPS, lyapunov_spectrum

CHAOTIC, REGULAR, UNDECIDED = "chaotic", "regular", "undecided"

FOLDS = 10.0
"""E-folds in half an orbit, up to which growth is not seen to be exponential."""

_PARTS = GROUPS + 2  # parts of an orbit; the rate of alignment comes from the last half of them
_PRESERVED = 1e-6  # mean logarithm of the factor by which volumes change in a step
_POWER = 3.0  # growth as this power of time might still be regular; plain shear gives 1
_ROUNDING = 1e-12  # rounding, relative to an orbit's size
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
    r"""Distinguish chaotic from regular orbits by the largest Lyapunov exponent over the second half of each orbit.

    It is :math:`\lambda = \frac{2}{n} \ln (|v_n| / |v_{n/2}|)` for a displacement :math:`v_k` after k of n periods.

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
    return _test_of_rates(
        point_map.without_table,
        found.ends,
        found.ended,
        found.growth[late][..., 0].sum(axis=0) / length,
        rates,
        length,
        _POWER,
        confidence,
        quantity="largest exponent per step",
        periods=periods,
        evidence=found.convergence[..., 0],
        at=found.steps.astype(float),
    )


def _test_of_rates(
    exact: PointMap,
    ends: Floats,
    ended: Bools,
    value: Floats,
    rates: Floats,
    length: int,
    power: float,
    confidence: float,
    **record: Any,
) -> ChaosTest:
    """Judge rates of growth over a stretch of orbits by those of its parts; an orbit whose end closes is "regular".

    ``power`` is that of time with which a regular orbit may grow; ``record`` are the other fields of the result.
    """
    with np.errstate(invalid="ignore"):  # a direction that vanishes is known without an error
        error = np.nan_to_num(rates.std(axis=0, ddof=1) / np.sqrt(len(rates)))
    reach = student_factor(confidence, len(rates) - 1) * error
    below, above = FOLDS / length, power * log(2.0) / length
    low, high = value - reach, value + reach
    verdict = verdicts(low, high, below, above)
    verdict[_closed(exact, ends, ended)] = REGULAR
    return ChaosTest(verdict, value, low, high, confidence, below, above, **record)


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


@checked
def alignment_test(
    point_map: PointMap,
    initial_conditions: ArrayLike,
    periods: int = 2000,
    transient: int = 0,
    order: int = 2,
    confidence: float = 0.999,
    *,
    rng: Rng = 0,
) -> ChaosTest:
    r"""Distinguish chaotic from regular orbits by the generalized alignment index of deviation vectors (GALI, SALI).

    It is :math:`G_k(n) = \lVert \hat w_1 \wedge \dots \wedge \hat w_k \rVert` for k unit vectors along the
    deviations after n steps.

    The index is the volume spanned by unit vectors along the deviations; with two deviations it is the smaller
    alignment index (SALI).  Along a chaotic orbit all deviations align with one direction, and the index decreases
    exponentially, at the rate (order - 1) L1 - L2 - ... of the exponents; along a regular orbit it stays constant, or
    decreases like a power of time that is at most the dimension.  Its logarithm is computed, which has no limit in
    double precision.  The verdict is that of :func:`exponent_test`, applied to the rate over the second half.

    Parameters
    ----------
    point_map : PointMap
        Volume-preserving map; for an interpolated map, the exact map behind it is used.
    initial_conditions : array_like, shape (..., d)
        Initial conditions of the orbits.
    periods : int, optional
        Length of the orbits after the transient, at least 44.
    transient : int, optional
        Periods of the transient.
    order : int, optional
        Number of deviations, from 2 to d.
    confidence : float, optional
        Confidence level of the interval, from the spread between 11 parts of the second half.
    rng : int, numpy.random.Generator or None, optional
        Seed or generator of the initial deviations.

    Returns
    -------
    ChaosTest
        Values are the rates per step at which the logarithm of the index decreases.  If the map does not preserve
        volumes, deviations align along regular orbits too, and the verdict is "undecided".

    Raises
    ------
    TypeError, ValueError
        For arguments out of range.

    References
    ----------
    Skokos, Journal of Physics A 34 (2001) 10029; Skokos, Bountis, Antonopoulos, Physica D 231 (2007) 30.

    Examples
    --------
    >>> from cellmap import discrete_map
    >>> cat = discrete_map(lambda x, p: (2 * x[0] + x[1], x[0] + x[1]), {}, ("x", "y"))
    >>> float(alignment_test(cat, [0.0, 0.0]).value / (2.0 * np.log(1.5 + 1.25**0.5)))
    1.0
    """
    exact = point_map.without_table
    points = state_points("initial_conditions", initial_conditions, exact.coordinates, some=True)
    periods = whole_number("periods", periods, at_least=2 * _PARTS)
    transient = whole_number("transient", transient)
    number = whole_number("order", order, at_least=2, at_most=exact.dimension)
    confidence = finite_number("confidence", confidence, above=0.0, at_most=1.0 - 1e-12)
    shape, d = points.shape[:-1], exact.dimension
    states = points.reshape(-1, d)
    # Means over parts, since along regular orbits the index swings; what is left over comes before the first.
    length = periods // _PARTS
    before = periods - length * _PARTS
    first = np.linalg.qr(random_numbers(rng).standard_normal((d, d)))[0][:, :number]
    logs = np.empty((_PARTS, len(states)))
    volumes, ended = np.empty(len(states)), np.empty(len(states), bool)

    def work(part: slice) -> None:
        states[part], volumes[part], ended[part] = _follow(
            exact, states[part], transient, first, before, length, logs[:, part]
        )

    run_over(slices(len(states), CHUNK // 16), work)
    logs[:, ended] = np.nan
    logs = logs.reshape(-1, *shape)
    rates = -np.diff(logs[_PARTS // 2 :], axis=0) / length
    at = np.asarray(before + length * (np.arange(_PARTS) + 0.5) + 0.5, dtype=float)
    test = _test_of_rates(
        exact,
        np.where(ended[:, None], np.nan, states).reshape(points.shape),
        ended.reshape(shape),
        rates.mean(axis=0),
        rates,
        length * len(rates),
        d + 1.0,
        confidence,
        quantity="rate of alignment per step",
        periods=periods,
        evidence=-logs / at.reshape(-1, *(1,) * len(shape)),
        at=at,
    )
    test.verdict[np.abs(volumes.reshape(shape)) > _PRESERVED] = UNDECIDED
    return test


def _follow(
    exact: PointMap, begin: Floats, transient: int, first: Floats, before: int, length: int, logs: Floats
) -> tuple[Floats, Floats, Bools]:
    """Fill in mean logarithms of the index in each part; return last points, mean change of volume, what has ended."""
    orbits = Orbits.starting(wrap(begin, exact.coordinates))
    exact.advance(orbits, transient)
    ended = np.asarray(orbits.status >= Status.ESCAPED)
    places = np.where(ended[:, None], begin, orbits.points)
    frames = np.broadcast_to(first, (len(begin), *first.shape)).copy()
    vectors = frames.copy()
    index, volume = np.zeros(len(begin)), np.zeros(len(begin))
    logs[:] = 0.0
    for step in range(-before, length * len(logs)):
        images, matrices = tangent(exact, places, coarse=True)
        ended |= ~(np.isfinite(images).all(axis=-1) & np.isfinite(matrices).all(axis=(-2, -1)))
        places = wrap(np.where(ended[:, None], places, images), exact.coordinates)
        matrices = np.where(ended[:, None, None], np.eye(places.shape[1]), matrices)
        # The volume of all deviations by an orthonormal frame, each of their lengths by itself: no difference of
        # vectors that have become the same is ever taken.
        frames, upper = np.linalg.qr(matrices @ frames)
        vectors = matrices @ vectors
        lengths = np.linalg.norm(vectors, axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            vectors /= lengths[:, None, :]
            spanned = np.abs(np.diagonal(upper, axis1=-2, axis2=-1))
            index += (np.log(spanned) - np.log(lengths)).sum(axis=-1)
        volume += np.linalg.slogdet(matrices)[1]
        if step >= 0:
            logs[step // length] += index / length
    return places, volume / (before + length * len(logs)), ended
