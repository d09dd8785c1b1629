"""Higher derivatives of traced functions: a function along a curve, and its derivatives by the curve's parameter."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

from .derivative import along
from .trace import Trace


def jet_trace(trace: Trace, order: int) -> Trace:
    """Return the trace of a function along a curve x(s): of (x, x', x'', ...) -> (f(x), f(x)', f(x)'', ...).

    Derivatives by s go up to `order`.  For a right-hand side these are the variational equations of that order, for a
    discrete map the derivatives of the image curve (Faa di Bruno).

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
