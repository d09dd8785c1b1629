"""Whether a step resolves functions that change in a narrow layer and vanish, or stay constant, beyond it.

Steps that pass over the layer of a steep tanh, or over a narrow bell, see nothing of it: neither the stages of a method
nor its estimate of the error.  The arguments of such functions tell.  Where an argument moves by more than a few units
from one place of a step to the next, and by so much that it may have been near zero in between, the step is too long.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import pairwise

from . import simd_math
from .expression import Expression, in_order
from .functions import TABLE
from .instructions import Value, number, where
from .trace import CONSTANT

SATURATED = 30.0
"""Size of an argument from which on its exponential counts for nothing, or is infinite for what it divides."""

UNRESOLVED = 1e200
"""Error of a step that is too long; the part by which it is too long, to the power ROOT, is its factor."""

ROOT = 8

Scale = tuple[float, float]


def layers(outputs: Sequence[Expression], levels: Mapping[Expression, int]) -> list[tuple[Expression, Scale]]:
    """Return arguments of functions with layers, other than constants, and their scales."""
    known = [
        (n.arguments[0], TABLE[n.operation].layer) for n in in_order(outputs) if n.arguments and n.operation in TABLE
    ]
    found = {argument: scale for argument, scale in known if scale is not None}
    return [(argument, scale) for argument, scale in found.items() if levels.get(argument, CONSTANT) != CONSTANT]


def excess(places: Sequence[Value], scale: Scale) -> Value:
    """Write by what factor a step is too long for an argument with the values `places`, one after the other."""
    return limited(places, lambda: largest(abs(b - a) for a, b in pairwise(places)), scale)


def limited(places: Sequence[Value], moved: Callable[[], Value], scale: Scale) -> Value:
    """Write by what factor a step is too long in which an argument moves by so much, with such values."""
    rate, most = scale
    far = simd_math.fmax(-SATURATED - rate * largest(places), rate * largest(places, simd_math.fmin) - SATURATED)
    return rate * moved() / simd_math.fmax(most, far)


def largest(values: Iterable[Value], function: Callable[..., Value] = simd_math.fmax) -> Value:
    """Return the largest value, or the smallest."""
    return functools.reduce(function, values)


def as_error(sharp: Sequence[Value], error: Value) -> Value:
    """Return an error as what it is, or as UNRESOLVED where a step is too long by one of these factors."""
    if not sharp:
        return error
    factor = simd_math.fmin(largest(sharp), number(1e5))
    square = factor * factor
    fourth = square * square
    return where(factor > 1.0, UNRESOLVED * (fourth * fourth), error)
