"""Exact derivatives of traced functions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

from .expression import Expression, Graph, UntraceableError, in_order
from .functions import TABLE
from .trace import Trace


def jet_trace(trace: Trace, order: int) -> Trace:
    """Return the trace of a function along a curve x(s): of (x, x', x'', ...) -> (f(x), f(x)', f(x)'', ...).

    Derivatives by s go up to `order`; of order 1 they are those along one direction, (x, v) -> (f(x), Df(x) v).  For a
    right-hand side these are the variational equations of that order, for a discrete map the tangent map, or the
    derivatives of the image curve (Faa di Bruno).

    Raises
    ------
    UntraceableError
        For an operation whose derivative is not known here.
    """
    graph, d = trace.graph, len(trace.states)
    rows = [trace.states]
    rows += [tuple(graph.node("state", value=k * d + j) for j in range(d)) for k in range(1, order + 1)]
    outputs = [trace.outputs]
    for k in range(order):
        slopes = {x: dx for row, below in pairwise(rows[: k + 2]) for x, dx in zip(row, below, strict=True)}
        outputs.append(along(graph, outputs[-1], slopes))
    return replace(trace, states=sum(rows, ()), outputs=sum(outputs, ()))


def frame_traces(trace: Trace, directions: int) -> list[Trace]:
    """Return traces of a function with derivatives along directions: (x, v, ...) -> (f(x), Df(x) v, ...).

    There are two, and either may be less work: with the entries of Df(x) computed once for all directions, or with the
    chain rule along each, which shares what depends on x alone.

    Raises
    ------
    UntraceableError
        For an operation whose derivative is not known here.
    """
    graph, d = trace.graph, len(trace.states)
    vectors = [[graph.node("state", value=k * d + j) for j in range(d)] for k in range(1, directions + 1)]
    one = graph.constant(1.0)
    columns = [_simplified(graph, along(graph, trace.outputs, {x: one})) for x in trace.states]
    by_entries = [graph.dot(row, v) for v in vectors for row in zip(*columns, strict=True)]
    by_chains = [e for v in vectors for e in along(graph, trace.outputs, dict(zip(trace.states, v, strict=True)))]
    states = (*trace.states, *(node for v in vectors for node in v))
    return [replace(trace, states=states, outputs=(*trace.outputs, *e)) for e in (by_entries, by_chains)]


def _simplified(graph: Graph, outputs: Sequence[Expression]) -> tuple[Expression, ...]:
    """Return expressions with numbers drawn out of products, so that (2 x) x becomes a multiple of the square x x."""

    def parts(e: Expression) -> tuple[float, Expression | None]:
        if e.operation == "constant":
            return e.value, None
        number = next((a for a in e.arguments if a.operation == "constant"), None) if e.operation == "mul" else None
        if number is None:
            return (-1.0, e.arguments[0]) if e.operation == "neg" else (1.0, e)
        return number.value, e.arguments[1] if e.arguments[0] is number else e.arguments[0]

    def apply(operation: str, *arguments: Expression) -> Expression:
        if operation in {"mul", "add"}:
            (a, x), (b, y) = map(parts, arguments)
            if operation == "mul" and x is not None and y is not None:
                return graph.apply("mul", graph.apply("mul", a, b), graph.apply("mul", x, y))
            if operation == "add" and x is y and x is not None:
                return graph.apply("mul", graph.apply("add", a, b), x)
        return graph.apply(operation, *arguments)

    return graph.substituted(outputs, {}, apply)


def along(
    graph: Graph, outputs: Sequence[Expression], seeds: Mapping[Expression, Expression]
) -> tuple[Expression, ...]:
    """Return the derivatives of expressions along a direction, given those of the inputs (others rest)."""
    zero = graph.constant(0.0)
    known: dict[Expression, Expression | None] = dict(seeds)
    for node in in_order(outputs):
        if node not in known:
            known[node] = _rule(graph, node, [known[a] for a in node.arguments]) if node.arguments else None
            if node.operation == "constant" and node.value != node.value:
                known[node] = node  # where a function is not defined its derivative is not either
    return tuple(zero if (slope := known[e]) is None else slope for e in outputs)


def _sum(graph: Graph, terms: Sequence[Expression | None]) -> Expression | None:
    total: Expression | None = None
    for term in terms:
        if term is not None:
            total = term if total is None else graph.apply("add", total, term)
    return total


def _rule(graph: Graph, node: Expression, inner: list[Expression | None]) -> Expression | None:
    """Derivative of a node, given those of its arguments (None: zero)."""
    if all(d is None for d in inner):
        return None
    if node.operation == "select" and inner[1] is None and inner[2] is None:
        return None
    a = node.arguments[0]
    da = inner[0]
    apply = graph.apply

    def times(slope: Expression | None, factor: Expression) -> Expression | None:
        return None if slope is None else apply("mul", slope, factor)

    match node.operation:
        case "add":
            return _sum(graph, inner)
        case "sub":
            return da if inner[1] is None else apply("neg", inner[1]) if da is None else apply("sub", da, inner[1])
        case "mul":
            b = node.arguments[1]
            return _sum(graph, [times(inner[0], b), times(inner[1], a)])
        case "div":
            b = node.arguments[1]
            first = None if da is None else apply("div", da, b)
            second = None if inner[1] is None else apply("neg", apply("div", apply("mul", node, inner[1]), b))
            return _sum(graph, [first, second])
        case "select":
            sides = (graph.constant(0.0) if slope is None else slope for slope in inner[1:])
            return apply("select", a, *sides)
        case "neg":
            return None if da is None else apply("mul", -1.0, da)
        case "side" | "reached" | "defined" | "floor" | "trunc" | "sign" | "floordiv":
            return None
        case "fabs":
            return None if da is None else apply("mul", da, apply("copysign", 1.0, a))
        case "copysign":
            ones = (apply("copysign", 1.0, e) for e in node.arguments)
            return None if da is None else apply("mul", da, apply("mul", *ones))
        case "mod" | "fmod":
            if inner[1] is None:
                return da
            b = node.arguments[1]
            quotient = apply("floor", apply("add", apply("div", apply("sub", a, node), b), 0.5))
            return _sum(graph, [da, apply("neg", apply("mul", quotient, inner[1]))])
        case "hypot":
            products = _sum(graph, [times(slope, x) for slope, x in zip(inner, node.arguments, strict=True)])
            return None if products is None else apply("div", products, node)
        case "atan2":
            b = node.arguments[1]
            first, second = times(da, b), times(inner[1], a)
            turned = first if second is None else apply("sub", 0.0 if first is None else first, second)
            square = apply("add", apply("mul", a, a), apply("mul", b, b))
            return None if turned is None else apply("div", turned, square)
        case "pow":
            b = node.arguments[1]
            grown = None if inner[1] is None else apply("mul", apply("mul", node, apply("log", a)), inner[1])
            moved = times(da, apply("mul", b, apply("pow", a, apply("sub", b, 1.0))))
            return _sum(graph, [moved, grown])
    known = TABLE.get(node.operation)
    if da is None or known is None or known.slope is None:
        raise UntraceableError(f"no derivative of {node.operation}")
    return apply("mul", known.slope(a, node), da)
