"""Linearised systems with parameters that differ from lane to lane.

About an equilibrium the right-hand side becomes dv/dt = A(t, p) v.  Time is counted in periods, t = T(p) tau, so that
lanes with different periods take their steps together.  The state of a lane is (v, L, q): a direction, the logarithm L
of the determinant of the flow, dL/dtau = T trace A (Liouville), and the swept parameters q, which rest.

A swept parameter is a state of zero derivative.  Where A has power series, a lane expands what depends on its own
parameters and on time; series common to all lanes are expanded once a step.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from math import cos, sin, ulp
from typing import Any

from ..._lib.arrays import Floats
from .arrays import in_a_trace
from .captured import kept
from .derivative import along
from .elementary import elementary_functions
from .evaluation import evaluated
from .expression import Expression, Graph, UntraceableError, ordered
from .kernel import PeriodKernel, compiled_steps, finished, traced_function
from .methods import choose_method, taylor_order
from .rebind import rebind
from .taylor import taylor_steps
from .trace import Trace, parameter_record


@dataclass(frozen=True, eq=False)
class LinearKernel:
    """A compiled linearised period, and the expressions behind it.

    ``motion`` has the derivatives of (v, L, q); ``rates`` are the components of the right-hand side at the equilibrium,
    in the same time (all zero where it is one), functions of time, of q and of the parameters.  Of these the last is
    the period, where that is a number.
    """

    kernel: PeriodKernel
    motion: Trace
    rates: tuple[Expression, ...]


@kept
def linear_kernel(
    functions: tuple[Callable[..., Any], Callable[..., Any] | None],
    equilibrium: tuple[float, ...],
    names: tuple[str, ...],
    swept: tuple[str, ...],
    rtol: float,
) -> LinearKernel | None:
    """Compile the linearised period of a right-hand side, given with its period if that is a function.

    None where they cannot be traced or differentiated.
    """
    rhs, period = functions
    d = len(equilibrium)
    traced = traced_function(rhs, d, names)
    if traced is None or traced.has_branches:
        return None
    graph = traced.graph
    try:
        length = graph.node("parameter", value=len(names))
        if period is not None:
            record = parameter_record(names)(*traced.parameters)
            length = graph.lift(rebind(period, elementary_functions(), inside=in_a_trace)(record))
        directions = tuple(graph.node("state", value=d + j) for j in range(d))
        slopes = along(graph, traced.outputs, dict(zip(traced.states, directions, strict=True)))
        one = graph.constant(1.0)
        diagonal = [along(graph, traced.outputs, {state: one})[j] for j, state in enumerate(traced.states)]
    except (UntraceableError, TypeError, AttributeError):
        return None
    spread = reduce(lambda a, b: graph.apply("add", a, b), diagonal)
    inputs = {traced.time: graph.apply("mul", length, traced.time)}
    inputs |= {state: graph.constant(x) for state, x in zip(traced.states, equilibrium, strict=True)}
    resting = [graph.node("state", value=d + 1 + k) for k in range(len(swept))]
    lanes = {traced.parameters[names.index(name)]: node for name, node in zip(swept, resting, strict=True)}
    sparse = _sparse(graph)
    (length,) = graph.substituted([length], lanes, sparse)
    inputs[traced.time] = graph.apply("mul", length, traced.time)
    inputs |= {direction: graph.node("state", value=j) for j, direction in enumerate(directions)}
    settled = graph.substituted([*slopes, spread, *traced.outputs], {**lanes, **inputs}, sparse)
    scaled = [graph.times(length, e) for e in settled]
    states = tuple(graph.node("state", value=j) for j in range(d + 1))
    zeros = (graph.constant(0.0),) * len(swept)
    motion = replace(traced, states=(*states, *resting), outputs=(*scaled[: d + 1], *zeros))
    method = choose_method("auto", motion, rtol)
    if method.name == "Taylor":
        method = replace(method, write=lambda trace: taylor_steps(trace, taylor_order(rtol)))
    advance = compiled_steps(method, motion, len(names) + 1)
    return LinearKernel(finished(advance, method), motion, tuple(scaled[d + 1 :]))


def values(
    expressions: Sequence[Expression], time: Any, states: Sequence[Any], parameters: Floats, signs: Sequence[float] = ()
) -> list[Floats]:
    """Return the values of expressions over arrays that broadcast; not finite where an operation is not defined."""
    inputs: dict[str, Callable[[int], Any]] = {
        "time": lambda _: time,
        "state": states.__getitem__,
        "parameter": lambda i: parameters[i],
        "sign": signs.__getitem__,
    }
    given = [e for e in ordered(tuple(expressions)) if e.operation in inputs]
    return evaluated(expressions, {e: inputs[e.operation](e.value) for e in given})


def _sparse(graph: Graph) -> Callable[..., Expression]:
    """Return how to apply an operation such that all that vanishes is left out, so that A is as sparse as it can be."""
    zero = graph.constant(0.0)

    def apply(operation: str, *arguments: Expression) -> Expression:
        a, b = arguments[0], arguments[-1]
        match operation:
            case "mul":
                return graph.times(a, b)
            case "div" | "neg" if a.vanishes:
                return zero
            case "add" if a.vanishes or b.vanishes:
                return b if a.vanishes else a
            case "sub":
                return a if b.vanishes else graph.minus(a, b)
            case "sin" | "cos" if a.operation == "constant":
                # An angle such as pi is known to half a unit of its last digit: what is smaller is none.
                value = sin(a.value) if operation == "sin" else cos(a.value)
                return zero if abs(value) <= ulp(a.value) else graph.constant(value)
        return graph.apply(operation, *arguments)

    return apply
