"""Periods of flows over boxes: the order of the series, the number of steps, and the times at which they begin.

The number of steps follows from the remainders of the series.  Their sum over a period is held to a small part of the
size of the set that is carried along, so that they add little to what a mean-value form over a box loses anyway.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction
from math import ceil, inf
from typing import Any

import numpy as np

from .._compiled.codegen.kernel import map_enclosure, why_untraced
from .._lib.arrays import Floats, Ints
from .system import ForcedSystem

Pass = Callable[[Ints, int], Floats]
"""Enclosures of some boxes with a number of steps, one in each row, with its remainder in the last column."""

_REMAINDER = 0.005
_ORDERS: tuple[int, ...] = (8, 12)
_FIRST, _FEWEST, _MOST = 8, 4, 4096
_MORE = 1.2  # factor in the number of steps that is worth another pass
_HOPE = 8  # boxes without an enclosure are given up if this many times the steps enclose no sample of them
_SAMPLE = 64
_ROUNDS = 8
_GOLDEN = 0.6180339887498949  # golden ratio: its multiples are nowhere near fractions of small numbers (Hurwitz 1891)
_CLIMB = 32  # largest number of steps, in those of most boxes


def best_order(centres: Floats, half_widths: Floats) -> int:
    """Return the order of least work for boxes (n, d).

    With coefficients that fall like those of a geometric series, the number of steps is proportional to
    (size/(half-width remainder))^(1/order), and the work of each to the square of the order.

    Examples
    --------
    >>> best_order(np.array([[3.0]]), np.array([[1e-3]])), best_order(np.array([[3.0]]), np.array([[0.0]]))
    (8, 12)
    """
    if not len(centres):
        return _ORDERS[0]
    sizes = np.abs(centres).max(axis=0)
    with np.errstate(all="ignore"):
        ratios = sizes / np.maximum(np.median(half_widths, axis=0), 2.0**-44 * sizes)
    ratio = float(np.max(ratios, where=np.isfinite(ratios), initial=1.0))
    return min(_ORDERS, key=lambda order: order**2 * (ratio / _REMAINDER) ** (1.0 / order))


def units_of(centres: Floats, half_widths: Floats) -> Floats:
    """Return a unit for each coordinate of boxes (n, d), a power of two near their half-widths, and its inverse.

    Examples
    --------
    >>> units_of(np.zeros((1, 2)), np.array([[0.25, 3.0]]))
    array([0.25, 4.  , 4.  , 0.25])
    """
    found = np.ones(centres.shape[1])
    for sizes in (np.abs(centres), half_widths):
        usual = np.median(np.where(sizes > 0.0, sizes, 0.0), axis=0) if len(centres) else np.zeros_like(found)
        if (known := (usual > 2.0**-500) & (usual < 2.0**500)).all():
            found = np.where(known, 2.0 ** np.round(np.log2(usual)), found)
    return np.stack([found, 1.0 / found], axis=1).ravel()


def with_steps(pass_over: Pass, boxes: int, rows: int, order: int, steps: int = 0) -> tuple[Floats, int]:
    """Return the rows of enclosures of a period, each with as many steps as its remainder asks for; NaN without one.

    Most need a number of steps that is returned too, and need not be sought again for another period.
    """
    found, left = np.full((boxes, rows), np.nan), np.arange(boxes)
    usual = steps = steps or _first_steps(pass_over, boxes, order)
    most = min(_MOST, _CLIMB * steps)
    while left.size and steps <= most:
        new = pass_over(left, steps)
        enclosed = np.isfinite(new).all(axis=1)
        better = enclosed & ~(found[left, -1] <= new[:, -1])
        found[left[better]] = new[better]
        again = _needed(new[:, -1], steps, order) > _MORE * steps
        if not enclosed.all():
            some = sample(left[~enclosed])
            again &= enclosed | np.isfinite(pass_over(some, min(_HOPE * steps, most))).all(axis=1).any()
        left = left[again]
        if left.size:
            typical = float(np.quantile(_needed(new[again, -1], steps, order), 0.75))
            steps = ceil(max(typical, _MORE * steps))
    return found, usual


def _first_steps(pass_over: Pass, boxes: int, order: int) -> int:
    """Return the number of steps that three in four of a sample of boxes need at most.

    Where more of them have no enclosure whatever the number of steps, it is the smallest with which the fewest fail.
    """
    some, steps, least = sample(np.arange(boxes)), _FIRST, _FEWEST
    fewest, best = 1.0, _FIRST
    for _ in range(_ROUNDS if boxes else 0):
        new = pass_over(some, steps)
        typical = float(np.quantile(_needed(new[:, -1], steps, order), 0.75))
        failed = float(np.isnan(new).any(axis=1).mean())
        if failed <= 0.25 and 0.8 * steps <= max(least, typical) <= _MORE * steps:
            return steps
        if failed < fewest or failed <= 0.25:
            fewest, best = failed, steps
        if failed > 0.25:
            least = ceil(_MORE * steps)
        steps = max(least, ceil(typical))
    if fewest == 1.0 and boxes and np.isfinite(pass_over(some, _MOST)).all(axis=1).any():
        return min(steps, _MOST)
    return best if best <= _MOST else _FIRST


def _needed(remainders: Floats, steps: int, order: int) -> Floats:
    """Return the numbers of steps with which the remainders would be small enough; twice as many for NaN."""
    with np.errstate(all="ignore"):
        needed = steps * (remainders / _REMAINDER) ** (1.0 / order)
    return np.where(np.isfinite(needed), np.clip(needed, 0.5 * steps, 4.0 * steps), 2.0 * steps)


def sample(members: Ints) -> Ints:
    """Return some of the members, evenly spread."""
    return members[np.unique(np.linspace(0, len(members) - 1, min(len(members), _SAMPLE)).astype(np.int64))]


@functools.lru_cache(maxsize=256)
def times_of_steps(
    begin: tuple[float, float], length: tuple[float, float], steps: int
) -> tuple[Floats, tuple[float, float]]:
    """Return enclosures of the times at which equal steps begin (steps, 2), and of their length: (m, r)."""
    (t, dt), (period, spread) = (tuple(map(Fraction, pair)) for pair in (begin, length))
    times = np.array([_nearest(t + period * k / steps, dt + spread * k / steps) for k in range(steps)])
    times.flags.writeable = False  # all who ask are given this array
    return times, _nearest(period / steps, spread / steps)


def _nearest(exact: Fraction, radius: Fraction) -> tuple[float, float]:
    """Return the nearest float and the distance from it, rounded up, within which all lies that is so near a number."""
    m = float(exact)
    r = abs(exact - Fraction(m)) + radius
    return m, float(np.nextafter(float(r), inf)) if r else 0.0


def period_of(system: ForcedSystem, phase: float, parameters: Floats, exact: bool) -> tuple[tuple[float, float], ...]:
    """Return enclosures of the time at which a period begins, and of its length, each a midpoint and a radius.

    The parameters (n, 2) are midpoints and radii.  If they are `exact` so are both numbers: those that the map has.
    Else the length encloses the numbers that its formula has over the intervals, and those that floats make of it.

    Raises
    ------
    UntraceableError, ValueError
        For a period whose formula is not known, or a number that is not the period for all of these parameters.
    """
    length = system.length
    if not exact and not callable(system.period):
        _hold_to_period(system, tuple(map(tuple, np.reshape(parameters, (-1, 2)).tolist())))
    if exact or not callable(system.period):
        return (phase * length, 0.0), (length, 0.0)
    function, names = period_as_map(system.period), tuple(system.params)
    if reason := why_untraced(function, 1, system.params):
        raise ValueError(
            f"parameters: the formula of the period {system.period!r} is not known, {reason}; give them as numbers"
        )
    kernel = map_enclosure(function, 1, names)
    state = np.zeros((kernel.rows.count, 8))
    kernel(state, 8, np.ascontiguousarray(parameters))
    middle, spread = (float(state[rows[0], 0]) for rows in (kernel.rows.images, kernel.rows.image_radii))
    if not np.isfinite(middle + spread) or middle - spread <= 0.0:
        raise ValueError(f"parameters: the period {system.period!r} is not bounded above zero over these intervals")
    spread = spread * (1.0 + 1e-12) + 2.0**-48 * middle
    return (phase * middle, abs(phase) * spread * (1.0 + 1e-12) + 2.0**-50 * abs(phase * middle)), (middle, spread)


@functools.lru_cache(maxsize=64)
def _hold_to_period(system: ForcedSystem, parameters: tuple[tuple[float, float], ...]) -> None:
    """Refuse intervals of parameters, given by midpoints and radii, that change the period of a right-hand side.

    Ends and middles may be whole numbers, which leave a period as it is: places that are none of these are held to it
    as well, the other parameters always at such a place.
    """
    places = {
        n: m + (_GOLDEN * k % 1.0) * r for k, (n, (m, r)) in enumerate(zip(system.params, parameters, strict=True), 1)
    }
    for (name, own), (m, r) in zip(system.params.items(), parameters, strict=True):
        for value in (m - r, m, m + r, places[name]) if (m, r) != (own, 0.0) else ():
            try:
                replace(system, params=places | {name: value})
            except ValueError as error:
                if "period" not in str(error):
                    raise
                raise ValueError(
                    f"parameters={{{name!r}: ({m - r:g}, {m + r:g})}}: the period of the right-hand side changes with "
                    f"{name}, and period={system.period!r} is a number; give ForcedSystem a function, such as "
                    f"period=lambda p: 2 * pi / p.{name}"
                ) from error


@functools.lru_cache(maxsize=64)
def period_as_map(period: Callable[[Any], float]) -> Callable[..., Sequence[float]]:
    """Return a period as a map; the same object for the same function."""

    def function(t: float, x: Sequence[float], p: Any) -> Sequence[float]:
        return (period(p),)

    return function
