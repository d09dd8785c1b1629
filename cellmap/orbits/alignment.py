"""Generalized alignment index: a test for chaos in volume-preserving maps (Skokos, Bountis, Antonopoulos 2007)."""

from __future__ import annotations

from math import log

import numpy as np
from numpy.typing import ArrayLike

from .._lib.arrays import Bools, Floats
from .._lib.checks import finite_number, whole_number
from .._lib.fit import student_factor
from .._lib.randomness import Rng, random_numbers
from .._lib.signatures import checked
from .._lib.threads import run_over, slices
from ..maps.coordinates import state_points, wrap
from ..maps.orbit_batch import CHUNK, Orbits, Status
from ..maps.point_map import PointMap
from ..maps.tangent import tangent
from .chaos_tests import FOLDS, UNDECIDED, ChaosTest, settle_verdicts
from .lyapunov import GROUPS

_PARTS = GROUPS + 2  # of an orbit; the rate comes from the last half of them
_PRESERVED = 1e-6  # mean logarithm of the factor by which volumes change in a step


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
    """Distinguish chaotic from regular orbits by the generalized alignment index of deviation vectors (GALI, SALI).

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
    points = state_points("initial_conditions", initial_conditions, exact.coordinates)
    if not points.size:
        raise ValueError("initial_conditions is empty: give at least one initial condition")
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
    rates = -np.diff(logs[_PARTS // 2 :], axis=0) / length
    value = rates.mean(axis=0)
    error = rates.std(axis=0, ddof=1) / np.sqrt(len(rates))
    reach = student_factor(confidence, len(rates) - 1) * error
    half = length * len(rates)
    below, above = FOLDS / half, (d + 1.0) * log(2.0) / half
    ends = np.where(ended[:, None], np.nan, states)
    verdict = settle_verdicts(exact, ends, ended, value - reach, value + reach, below, above)
    verdict[np.abs(volumes) > _PRESERVED] = UNDECIDED
    at = np.asarray(before + length * (np.arange(_PARTS) + 0.5) + 0.5, dtype=float)
    return ChaosTest(
        verdict.reshape(shape),
        value.reshape(shape),
        (value - reach).reshape(shape),
        (value + reach).reshape(shape),
        confidence,
        below,
        above,
        "rate of alignment per step",
        periods,
        (-logs / at[:, None]).reshape(-1, *shape),
        at,
    )


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
        images, matrices = tangent(exact, places)
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
