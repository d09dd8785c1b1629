"""From a plain right-hand side to its expressions, by running it once on symbols."""

from __future__ import annotations

import functools
from collections import namedtuple
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from .expression import Expression, Graph, UntraceableError, elementary_functions, in_order, is_analytic
from .rebind import rebind

CONSTANT, TIMED, STATEFUL = range(3)
"""What an expression depends on: parameters alone, time as well, or the state."""


@dataclass(frozen=True, eq=False)
class Trace:
    """Expressions of the components of a function of time, state and parameters."""

    graph: Graph
    states: tuple[Expression, ...]
    time: Expression
    parameters: tuple[Expression, ...]
    outputs: tuple[Expression, ...]

    def __repr__(self) -> str:
        return f"Trace({len(self.outputs)} components, {len(in_order(self.outputs))} nodes)"

    @property
    def is_analytic(self) -> bool:
        """Whether the components have power series."""
        return is_analytic(self.outputs)

    def levels(self) -> dict[Expression, int]:
        """Return for each node whether it depends on parameters alone, on time, or on the state."""
        inputs = {"state": STATEFUL, "time": TIMED}
        levels: dict[Expression, int] = {}
        for node in in_order(self.outputs):
            own = inputs.get(node.operation, CONSTANT)
            levels[node] = max([own, *(levels[a] for a in node.arguments)])
        return levels


@functools.lru_cache(maxsize=256)
def parameter_record(names: tuple[str, ...]) -> Any:
    """Return the named tuple for parameters of these names, always the same one."""
    return namedtuple("Parameters", names)


def trace(function: Callable[..., Sequence[Any]], dimension: int, parameters: Sequence[str]) -> Trace | None:
    """Run ``function(t, x, p)`` on symbols; None where it cannot be traced (it branches on a value, say)."""
    graph = Graph()
    states = tuple(graph.node("state", value=i) for i in range(dimension))
    symbols = tuple(graph.node("parameter", value=i) for i in range(len(parameters)))
    time = graph.node("time")
    record = parameter_record(tuple(parameters))
    try:
        twin = rebind(function, elementary_functions())
        outputs = tuple(graph.lift(e) for e in twin(time, states, record(*symbols)))
    except (UntraceableError, TypeError, AttributeError):
        return None
    return Trace(graph, states, time, symbols, outputs)
