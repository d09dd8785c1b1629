"""Operations with kinks and jumps as selections, and others in terms of those that have recurrences of series."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from .expression import Expression, in_order
from .functions import TABLE

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


def _copysign(graph: BranchingGraph, a: Expression, b: Expression) -> Expression:
    size = graph.apply("fabs", a)
    return graph.choose(graph.apply("neg", b), graph.apply("neg", size), size)  # positive at zero


def _sign(graph: BranchingGraph, a: Expression) -> Expression:
    at_most_zero = -1.0 if graph.modes and not is_made_of_steps(a) else graph.choose(graph.apply("neg", a), -1.0, 0.0)
    return graph.choose(a, 1.0, at_most_zero)


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
    """Return the rule of an operation whose jumps are located, where its arguments move."""

    def chosen(graph: BranchingGraph, *arguments: Expression) -> Expression:
        return rule(graph, *arguments) if any(map(moves, arguments)) else graph.plain(operation, *arguments)

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
    "fmax": lambda graph, a, b: graph.choose(graph.difference(a, b), a, b),
    "fmin": lambda graph, a, b: graph.choose(graph.difference(b, a), a, b),
    "sign": _sign,
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
