"""Tables that are interpolated linearly, as by :func:`numpy.interp`, and splines, located where pieces meet.

Of a motion a table at equal distances has one switch, which counts the kinks below; another one has a switch for each.
In one application of a discrete map the piece is looked for by halving.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..._lib.arrays import Floats
from .expression import Expression

MOST_POINTS = 1024
MOST_KINKS = 20
"""Of a table at distances that differ, for each is a switch."""

_EQUAL = 1e-9  # relative difference of distances that count as equal
_SMOOTH = 1e-9  # difference of coefficients on both sides of a knot, relative to the largest, that is no jump
_STRAIGHT = 1e-12  # difference of slopes on both sides of a knot, relative to the largest, that is no kink


class TableError(TypeError):
    """A table that cannot be compiled."""


def interpolated(
    x: Any, xp: Sequence[float], fp: Sequence[float], left: Any = None, right: Any = None, period: float | None = None
) -> Any:
    """Return the value of a table at a place, as :func:`numpy.interp` does.

    Raises
    ------
    TableError
        For a table of a flow that has too many kinks at distances that differ, and for one that is too long.
    """
    if not isinstance(x, Expression):
        return np.interp(x, xp, fp, left, right, period)
    graph: Any = x.graph
    places, values = np.array(xp, dtype=float), np.array(fp, dtype=float)
    if len(places) > MOST_POINTS:
        raise TableError(
            f"np.interp: {len(places)} points are more than {MOST_POINTS}: take fewer, or write a periodic forcing "
            "with systems.sampled_drive"
        )
    if period is not None:
        places, order = np.unique(places % abs(period), return_index=True)
        places, values = np.append(places, places[0] + abs(period)), values[[*order, order[0]]]
        pieces = np.stack([np.diff(values) / np.diff(places), values[:-1]])
        return graph.where_defined(x, piecewise(x, places, pieces, repeats=True), x)
    if (np.diff(places) <= 0.0).any():
        raise TableError("np.interp: the places of a table must increase")
    return graph.where_defined(x, _of_number(x, places, values, left, right), x)


def _of_number(x: Any, places: Floats, values: Floats, left: Any, right: Any) -> Any:
    """Return the value of a table at a place that is a number."""
    graph: Any = x.graph
    ends = (values[0] if left is None else left, values[-1] if right is None else right)
    if len(places) == 1:
        return graph.choose(places[0] - x, ends[0], graph.choose(x - places[0], ends[1], values[0]))
    slopes = np.diff(values) / np.diff(places)
    pieces = [ends[0], *(v + s * (x - a) for a, v, s in zip(places, values, slopes, strict=False)), ends[1]]
    if not graph.modes:
        at_end = graph.plain("neg", graph.plain("side", x - places[-1]))  # the last point belongs to the table
        below = [*(graph.plain("side", a - x) for a in places[:-1]), at_end]
        return _halved(below.__getitem__, pieces, 0)
    steps = np.diff(places)
    if np.ptp(steps) <= _EQUAL * steps.min():
        step = float(places[-1] - places[0]) / len(steps)
        number = graph.whole_part((x - places[0]) / step)
        base, slope = (_halved(lambda i: i + 0.5 - number, row, 0) for row in ([*values[:-1]], [*slopes]))
        inside = base + slope * (x - (places[0] + step * number))
        return _halved(lambda i: (i and len(steps)) - 0.5 - number, [ends[0], inside, ends[1]], 0)
    if left is None and right is None:
        changes = np.diff(slopes, prepend=0.0, append=0.0)
        kinks = np.flatnonzero(np.abs(changes) > _STRAIGHT * np.abs(slopes).max())
        if len(kinks) <= MOST_KINKS:
            ramps = (changes[k] * graph.apply("maximum", x - places[k], 0.0) for k in kinks)
            return values[0] + sum(ramps, graph.constant(0.0))
    raise TableError(
        "np.interp: a table of a right-hand side has a switch for each kink where its points are at distances that "
        f"differ, and at most {MOST_KINKS} of them: give values at equal distances, which need one, or write a "
        "periodic forcing with systems.sampled_drive"
    )


def piecewise(x: Any, places: Floats, coefficients: Floats, *, repeats: bool) -> Any:
    """Return the value of a piecewise polynomial that repeats, or whose first and last piece go on.

    ``coefficients`` (degree + 1, pieces) are those of powers of the distance from the beginning of each piece, the
    highest first.

    Raises
    ------
    TableError
        For one of a flow that has too many places at distances that differ, and for one that has too many at all.
    """
    graph, steps = x.graph, np.diff(places)
    if len(places) > MOST_POINTS:
        raise TableError(f"a spline with {len(places)} knots has more than {MOST_POINTS}: take fewer")
    if not graph.modes:
        x = places[0] + (x - places[0]) % float(places[-1] - places[0]) if repeats else x
        pieces = [np.polyval(c, x - a) for c, a in zip(coefficients.T, places, strict=False)]
        return _halved(lambda i: graph.plain("side", places[i + 1] - x), pieces, 0)
    if np.ptp(steps) <= _EQUAL * steps.min():
        step, count = float(steps.mean()), len(steps)
        number = piece = graph.whole_part((x - places[0]) / step)
        if repeats:  # one switch counts all pieces: two of them would meet where a period begins
            piece = number - count * graph.plain("floor", number / count)
        factors = [_halved(lambda i: i + 0.5 - piece, [*row], 0) for row in coefficients]
        begin = places[0] + step * number if repeats else _halved(lambda i: i + 0.5 - piece, [*places[:-1]], 0)
        return functools.reduce(lambda total, factor: total * (x - begin) + factor, factors)
    if repeats:
        whole = float(places[-1] - places[0])
        x = x - whole * graph.whole_part((x - places[0]) / whole)
    powers = np.arange(len(coefficients))[::-1]
    found, kinks = np.polyval(coefficients[:, 0], x - places[0]), 0
    for k, (before, after) in enumerate(zip(coefficients.T, coefficients.T[1:], strict=False)):
        carried = np.array([np.polyval(np.polyder(before, int(m)), steps[k]) / math.factorial(m) for m in powers])
        jumps = np.where(np.abs(after - carried) > _SMOOTH * np.abs(coefficients).max(axis=1), after - carried, 0.0)
        if jumps.any():
            kinks += 1
            found = found + np.polyval(jumps, graph.apply("maximum", x - places[k + 1], 0.0))
    if kinks <= MOST_KINKS:
        return found
    raise TableError(
        "a spline of a right-hand side has a switch for each knot where these are at distances that differ, and at "
        f"most {MOST_KINKS} of them: give it at equal distances, which need one"
    )


def _halved(below: Callable[[int], Any], pieces: Sequence[Any], first: int) -> Any:
    """Return the piece in which a number lies: piece i if it is below bound i, and below none before."""
    if len(pieces) == 1:
        return pieces[0]
    middle = len(pieces) // 2
    lower, upper = _halved(below, pieces[:middle], first), _halved(below, pieces[middle:], first + middle)
    condition = below(first + middle - 1)
    return condition.graph.selection(condition, condition.graph.lift(lower), condition.graph.lift(upper))
