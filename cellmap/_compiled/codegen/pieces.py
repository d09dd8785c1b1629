"""Operations with kinks and jumps as selections, and others in terms of those that have recurrences of series."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from .expression import Expression, in_order
from .functions import ANYWHERE, TABLE

BranchingGraph = Any
"""That of :mod:`cellmap._compiled.codegen.branches`, which reads what is here."""

MOVING = frozenset({"state", "time", "sign"})
_ABOVE_ZERO = 1e-12


def moves(function: Expression) -> bool:
    """Whether an expression depends on time, the state, or the sides of switches."""
    return any(e.operation in MOVING for e in in_order([function]))


def is_made_of_steps(function: Expression) -> bool:
    """Whether an expression depends on the sides of switches, and otherwise on neither state nor time."""
    return {e.operation for e in in_order([function])} & MOVING == {"sign"}


_EVERYWHERE = frozenset({"add", "sub", "mul", "neg", "select", "side", "reached", "defined", "fabs", "copysign"})


def is_number(function: Expression, modes: bool) -> bool:
    """Whether an expression has a value at all states: an input does, and in a motion what is defined everywhere.

    A motion ends before its states are so large that sums and products of them are not finite.
    """
    for e in in_order([function]):
        known = TABLE.get(e.operation)
        everywhere = e.operation in _EVERYWHERE or (known is not None and known.domain == ANYWHERE)
        if e.value != e.value or (e.arguments and not (modes and everywhere)):
            return False
    return True


def _python_rule(larger: bool) -> Rule:
    """Return Python's choice: the second operand if it is larger, or smaller, else the first."""
    return lambda graph, a, b: graph.choose(graph.ordered(graph.difference(*((b, a) if larger else (a, b)))), b, a)


def _numpy_rule(larger: bool, keep: bool) -> Rule:
    """Return NumPy's choice: of NaN and a number the NaN, if it is to be kept, else the number."""

    def chosen(graph: BranchingGraph, a: Expression, b: Expression) -> Expression:
        if not is_number(a if keep else b, graph.modes):
            a, b = b, a  # a comparison with NaN takes the second
        found = graph.choose(graph.difference(*((a, b) if larger else (b, a))), a, b)
        return graph.where_defined(a, found, a) if keep else graph.where_defined(b, found, a)

    return chosen


def _copysign(graph: BranchingGraph, a: Expression, b: Expression) -> Expression:
    size = graph.apply("fabs", a)
    chosen = graph.choose(graph.apply("neg", b), graph.apply("neg", size), size)  # positive at zero
    return graph.where_defined(b, chosen, b)  # the sign bit of NaN is a matter of the processor


def _sign(graph: BranchingGraph, a: Expression) -> Expression:
    return _heaviside(graph, a, graph.constant(0.0), -1.0)


def _heaviside(graph: BranchingGraph, a: Expression, at_zero: Expression, below: float = 0.0) -> Expression:
    passes = graph.modes and not is_made_of_steps(a)  # a motion only passes through zero
    at_most_zero = below if passes else graph.choose(graph.apply("neg", a), below, at_zero)
    return graph.where_defined(a, graph.choose(a, 1.0, at_most_zero), a)


def _negative_of_whole_part(graph: BranchingGraph, a: Expression) -> Expression:
    return graph.apply("neg", graph.whole_part(graph.apply("neg", a)))


def _truncated(graph: BranchingGraph, a: Expression) -> Expression:
    # It touches the step at zero, where rounding must not pass it.
    size = graph.whole_part(graph.apply("add", graph.apply("fabs", a), _ABOVE_ZERO))
    return graph.choose(a, size, graph.apply("neg", size))


Rule = Callable[..., Expression]


def _remainder(whole: Rule) -> Rule:
    """Return a - b whole(a/b)."""
    return lambda graph, a, b: graph.apply("sub", a, graph.apply("mul", b, whole(graph, graph.apply("div", a, b))))


def _located(operation: str, rule: Rule) -> Rule:
    """Return the rule of an operation whose jumps are located, where its arguments move other than in steps."""

    def chosen(graph: BranchingGraph, *arguments: Expression) -> Expression:
        located = any(moves(a) and not is_made_of_steps(a) for a in arguments)
        return rule(graph, *arguments) if located else graph.plain(operation, *arguments)

    return chosen


def _in_parts(rule: Callable[..., Expression]) -> Rule:
    return lambda graph, *arguments: rule(*arguments)


def _power(graph: BranchingGraph, a: Expression, b: Expression) -> Expression:
    if not any(e.operation in {"state", "time"} for e in in_order([b])):
        return graph.plain("pow", a, b)
    return graph.apply("exp", graph.apply("mul", b, graph.apply("log", a)))


BY_SERIES: dict[str, Rule] = {name: _in_parts(known.in_parts) for name, known in TABLE.items() if known.in_parts}
BY_SERIES["pow"] = _power
"""Operations in terms of those that have recurrences of series."""

PIECES: dict[str, Rule] = {
    "max": _python_rule(larger=True),
    "min": _python_rule(larger=False),
    "maximum": _numpy_rule(larger=True, keep=True),
    "minimum": _numpy_rule(larger=False, keep=True),
    "fmax": _numpy_rule(larger=True, keep=False),
    "fmin": _numpy_rule(larger=False, keep=False),
    "sign": _sign,
    "heaviside": _heaviside,
    "floor": lambda graph, a: graph.whole_part(a),
    "ceil": _negative_of_whole_part,
}
"""How operations with kinks and jumps are written."""

_JUMPS: dict[str, Rule] = {
    "fabs": lambda graph, a: graph.choose(a, a, graph.apply("neg", a)),
    "copysign": _copysign,
    "trunc": _truncated,
    "mod": _remainder(lambda graph, a: graph.whole_part(a)),
    "fmod": _remainder(_truncated),
    "floordiv": lambda graph, a, b: graph.whole_part(graph.apply("div", a, b)),
}
LOCATED = {operation: _located(operation, rule) for operation, rule in _JUMPS.items()}
"""How those are written for a motion that meets their jumps as events; for one application of a map they stay."""
