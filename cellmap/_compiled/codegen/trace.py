"""From a plain right-hand side to its expressions, by running it once on symbols."""

from __future__ import annotations

import functools
import math
import random
from collections import namedtuple
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from .expression import (
    Expression,
    Graph,
    UntraceableError,
    elementary_functions,
    in_order,
    is_analytic,
    operation_on_numbers,
)
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

    @functools.cached_property
    def nodes(self) -> list[Expression]:
        """Every node that the components need, arguments before the nodes that use them."""
        return in_order(self.outputs)

    @property
    def is_analytic(self) -> bool:
        """Whether the components have power series."""
        return is_analytic(self.outputs)

    @property
    def resting(self) -> tuple[int, ...]:
        """Numbers of the states whose derivative is zero."""
        return tuple(j for j, e in enumerate(self.outputs) if e.vanishes)

    def with_resting_inputs(self) -> Trace:
        """Return the trace with each resting state as an input "sign": a number of a lane that stays as it is."""
        inputs = {self.states[j]: self.graph.node("sign", value=j) for j in self.resting}
        return replace(self, outputs=self.graph.substituted(self.outputs, inputs)) if inputs else self

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


def trace(function: Callable[..., Sequence[Any]], dimension: int, parameters: Sequence[str]) -> Trace:
    """Run ``function(t, x, p)`` on symbols.

    Raises
    ------
    UntraceableError
        Where that fails, with the reason: the function branches on a value, say, or has an error of its own.
    """
    graph = Graph()
    states = tuple(graph.node("state", value=i) for i in range(dimension))
    symbols = tuple(graph.node("parameter", value=i) for i in range(len(parameters)))
    time = graph.node("time")
    record = parameter_record(tuple(parameters))
    outputs = on_symbols(graph, function, time, states, record(*symbols))
    return Trace(graph, states, time, symbols, outputs)


def on_symbols(graph: Graph, function: Callable[..., Sequence[Any]], *arguments: Any) -> tuple[Expression, ...]:
    """Run a function on expressions; whatever it raises becomes the reason of an UntraceableError."""
    try:
        return tuple(graph.lift(e) for e in rebind(function, elementary_functions())(*arguments))
    except UntraceableError:
        raise
    except Exception as error:
        raise UntraceableError(f"{type(error).__name__}: {error}") from error


def is_faithful(
    traced: Trace, function: Callable[..., Sequence[Any]], parameters: tuple[float, ...], record: Any
) -> bool:
    """Compare a trace with its function, in plain Python, at a few places of several sizes.

    A function may do what its trace does not show: catch exceptions, or ask for the type of a number.
    """
    rng = random.Random(0)
    for size in (0.0, 0.1, 1.0, 1.0, 10.0):
        state = tuple(size * rng.uniform(-1.0, 1.0) for _ in traced.states)
        t = rng.uniform(0.0, 10.0)
        try:
            expected = [float(v) for v in function(t, state, record)]
        except (ArithmeticError, ValueError):
            continue  # outside the domain of the function
        if len(expected) != len(traced.outputs):
            return False
        seen = evaluate(traced, t, state, parameters)
        scale = max([1e-300, *(abs(v) for v in expected if v == v)])
        if any(
            not abs(a - b) <= 1e-9 * scale for a, b in zip(expected, seen, strict=True) if a == a and abs(a) < 1e300
        ):
            return False
    return True


def evaluate(traced: Trace, t: float, state: Sequence[float], parameters: Sequence[float]) -> list[float]:
    """Return the values of the expressions of a trace; NaN where an operation is not defined."""
    inputs = {"time": lambda _: t, "state": state.__getitem__, "parameter": parameters.__getitem__, "constant": float}
    values: dict[Expression, float] = {}
    for node in traced.nodes:
        if node.operation in inputs:
            values[node] = inputs[node.operation](node.value)
            continue
        try:
            values[node] = float(operation_on_numbers(node.operation)(*(values[a] for a in node.arguments)))
        except (ArithmeticError, ValueError, TypeError):
            values[node] = math.nan
    return [values[e] for e in traced.outputs]
