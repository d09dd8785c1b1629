"""Whether a step resolves functions that change in a narrow layer and vanish, or stay constant, beyond it.

Steps that pass over the layer of a steep tanh, or over a narrow bell, see nothing of it: neither the stages of a method
nor its estimate of the error.  The arguments of such functions tell.  Where an argument moves by more than a few units
from one place of a step to the next, and by so much that it may have been near zero in between, the step is too long.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise

from .expression import Expression, in_order
from .trace import CONSTANT

SATURATED = 30.0
"""Size of an argument from which on its exponential counts for nothing, or is infinite for what it divides."""

UNRESOLVED = 1e200
"""Error of a step that is too long; the part by which it is too long, to the power ROOT, is its factor."""

ROOT = 8

Scale = tuple[float, float]

_SCALES: dict[str, Scale] = {
    "exp": (1.0, 8.0), "exp2": (0.7, 8.0), "expm1": (1.0, 8.0), "sinh": (1.0, 8.0), "cosh": (1.0, 8.0),
    "tanh": (2.0, 3.0), "erf": (2.0, 3.0),
}  # fmt: skip
"""Rate at which a function grows, or approaches a constant, and by how much its logarithm may move between two places.

It is less for a function with two constants: between them there is little to see."""


def layers(outputs: Sequence[Expression], levels: Mapping[Expression, int]) -> list[tuple[Expression, Scale]]:
    """Return arguments of functions with layers, other than constants, and their scales."""
    found = [(n.arguments[0], _SCALES[n.operation]) for n in in_order(outputs) if n.operation in _SCALES]
    return [(argument, scale) for argument, scale in dict(found).items() if levels.get(argument, CONSTANT) != CONSTANT]


def excess(name: str, places: Sequence[str], scale: Scale) -> Iterator[str]:
    """Write by what factor a step is too long for an argument with the values `places`, one after the other."""
    moves = [f"abs({b} - {a})" for a, b in pairwise(places)]
    yield from limited(name, largest(moves), largest(places), largest(places, "fmin"), scale)


def limited(name: str, moved: str, upper: str, lower: str, scale: Scale) -> Iterator[str]:
    """Write by what factor a step is too long in which an argument moves by so much between such bounds."""
    rate, most = scale
    yield f"far{name} = simd_math.fmax({-SATURATED!r} - {rate!r} * ({upper}), {rate!r} * ({lower}) - {SATURATED!r})"
    yield f"sharp{name} = {rate!r} * ({moved}) / simd_math.fmax({most!r}, far{name})"


def largest(values: Sequence[str], function: str = "fmax") -> str:
    """Return the text of the largest value, or of the smallest."""
    return functools.reduce(lambda a, b: f"simd_math.{function}({a}, {b})", values)


def as_error(sharp: str, error: str) -> Iterator[str]:
    """Write an error as what it is, or as UNRESOLVED where a step is too long."""
    yield f"sharp = simd_math.fmin({sharp}, 1e5)"
    yield "sharp2 = sharp * sharp; sharp4 = sharp2 * sharp2"
    yield f"{error} = {UNRESOLVED!r} * (sharp4 * sharp4) if sharp > 1.0 else {error}"
