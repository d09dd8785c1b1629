"""Formulas whose numbers are exact: in terms of the functions that are enclosed, and with no number rounded."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from math import isfinite
from operator import add, mul, neg, sub, truediv
from typing import Any

from .expression import Expression, Graph, UntraceableError, in_order
from .functions import TABLE
from .interval_functions import ENCLOSED
from .trace import Trace

EXACT: dict[str, Callable[..., Any]] = {"add": add, "sub": sub, "mul": mul, "div": truediv, "neg": neg}
"""Operations of fractions."""

LARGEST_POWER = 1024


class ExactGraph(Graph):
    """Maker of expressions that folds numbers only where the result is a float, so that no derivative is rounded.

    Other operations on numbers alone remain, and are enclosed once, before all boxes.
    """

    def apply(self, operation: str, *operands: Any) -> Expression:
        """Apply an operation, as any graph does."""
        arguments = tuple(self.lift(a) for a in operands)
        if all(a.operation == "constant" for a in arguments) and not _is_exact(operation, [a.value for a in arguments]):
            return self.node(operation, arguments)
        return super().apply(operation, *arguments)


def _is_exact(operation: str, values: list[float]) -> bool:
    """Tell whether an operation on floats is not rounded."""
    if operation not in EXACT:
        return False
    try:
        found = EXACT[operation](*values)
        return isfinite(found) and bool(EXACT[operation](*map(Fraction, values)) == Fraction(found))
    except (ArithmeticError, ValueError):
        return False


def enclosable(trace: Trace) -> Trace:
    """Return a trace in terms of the functions that are enclosed, by exact identities, on a graph of exact numbers.

    Raises
    ------
    UntraceableError
        For functions that are not enclosed, among them all that are not analytic.
    """
    graph: Any = ExactGraph()
    inputs = {n: graph.node(n.operation, value=n.value) for n in in_order(trace.outputs) if not n.arguments}
    inputs |= {n: graph.node(n.operation, value=n.value) for n in (*trace.states, trace.time, *trace.parameters)}

    def unfolded(name: str, value: float) -> Expression:  # a number that no float is
        return graph.node(name, (graph.constant(value),))

    def apply(operation: str, *arguments: Expression) -> Expression:
        if operation in EXACT or operation in ENCLOSED:
            return graph.apply(operation, *arguments)
        a = arguments[0]
        match operation:
            case "exp2":
                return graph.apply("exp", unfolded("log", 2.0) * a)
            case "log2" | "log10":
                return graph.apply("log", a) / unfolded("log", 2.0 if operation == "log2" else 10.0)
            case "acos":
                return 2.0 * unfolded("atan", 1.0) - apply("asin", a)
            case "acosh":
                return graph.apply("log", a + graph.apply("sqrt", (a - 1.0) * (a + 1.0)))
            case "pow":
                return _power(graph, a, arguments[1])
            case "asin" | "asinh" | "atanh" | "expm1" | "log1p" | "hypot":
                parts = TABLE[operation].in_parts
                assert parts is not None, "the table has them"
                found: Expression = parts(*arguments)
                return found
        what = "a branch" if operation in {"select", "side"} else operation
        raise UntraceableError(f"{what} is not enclosed, for it is not analytic or its error is not bounded here")

    return Trace(
        graph,
        tuple(inputs[e] for e in trace.states),
        inputs[trace.time],
        tuple(inputs[e] for e in trace.parameters),
        graph.substituted(trace.outputs, inputs, apply),
    )


def _power(graph: Any, base: Expression, exponent: Expression) -> Expression:
    value = exponent.value if exponent.operation == "constant" else 0.5
    if value == int(value) and abs(value) <= LARGEST_POWER:
        whole: Expression = graph._whole_power(base, abs(int(value)))
        return whole if value >= 0 else 1.0 / whole
    power: Expression = graph.apply("exp", exponent * graph.apply("log", base))
    return power
