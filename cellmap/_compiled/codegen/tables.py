"""Tables that are interpolated linearly, as :func:`numpy.interp` does, located at their kinks.

Of a motion a table at equal distances has one switch, which counts the kinks below; another one has a switch for each.
In one application of a discrete map the piece is looked for by halving.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..._lib.arrays import Floats
from .expression import Expression

MOST_POINTS = 1024
MOST_KINKS = 20
"""Of a table at distances that differ, for each is a switch."""

_EQUAL = 1e-9  # of the distance, by which distances of equal ones may differ
_STRAIGHT = 1e-12  # of the largest slope, by which the slopes on both sides of no kink may differ


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
    places, values = np.array(xp, dtype=float), np.array(fp, dtype=float)
    if period is not None:
        x, places = x % abs(period), places % abs(period)
        places, order = np.unique(places, return_index=True)
        values, left, right = values[order], None, None
        places = np.concatenate([places[-1:] - abs(period), places, places[:1] + abs(period)])
        values = np.concatenate([values[-1:], values, values[:1]])
    if len(places) > MOST_POINTS:
        raise TableError(
            f"np.interp: {len(places)} points are more than {MOST_POINTS}: take fewer, or write a periodic forcing "
            "with systems.sampled_drive"
        )
    if (np.diff(places) <= 0.0).any():
        raise TableError("np.interp: the places of a table must increase")
    found: Expression = x.graph.where_defined(x, _of_number(x, places, values, left, right), x)
    return found


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


def _halved(below: Callable[[int], Any], pieces: Sequence[Any], first: int) -> Any:
    """Return the piece in which a number lies: piece i if it is below bound i, and below none before."""
    if len(pieces) == 1:
        return pieces[0]
    middle = len(pieces) // 2
    lower, upper = _halved(below, pieces[:middle], first), _halved(below, pieces[middle:], first + middle)
    condition = below(first + middle - 1)
    return condition.graph.selection(condition, condition.graph.lift(lower), condition.graph.lift(upper))
