"""Linearised systems with parameters that differ from lane to lane.

About an equilibrium the right-hand side becomes dv/dt = A(t, p) v.  Time is counted in periods, t = T(p) tau, so that
lanes with different periods take their steps together.  The state of a lane is (v, L, q): a direction, the logarithm L
of the determinant of the flow, dL/dtau = T trace A (Liouville), and the swept parameters q, which rest.

Where A has power series, a lane expands what depends on its own parameters and on time; what all lanes share is
expanded once a step.  In the expressions a swept parameter is then an input "sign": a number that differs from lane
to lane and stays as it is.  Elsewhere it is a state of zero derivative.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from math import cos, sin, ulp
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .captured import kept
from .derivative import along
from .expression import Expression, Graph, UntraceableError, elementary_functions, in_order, operation_on_numbers
from .filippov import substitute
from .kernel import PeriodKernel, traced_function
from .lanes import StepCode, lane_module
from .methods import Method, choose_method, taylor_order
from .module import generated_module
from .rebind import CANONICAL_NAMES, rebind
from .taylor import Series
from .trace import CONSTANT, STATEFUL, TIMED, Trace, parameter_record

_OF_ARRAYS: dict[str, Callable[..., Any]] = {
    **{name: f for f, name in CANONICAL_NAMES.items() if isinstance(f, np.ufunc)},
    **{"add": np.add, "sub": np.subtract, "mul": np.multiply, "div": np.divide, "neg": np.negative},
}
_RATIONAL = frozenset({"add", "sub", "mul", "div", "neg", "sqrt"})


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
    if traced is None:
        return None
    graph = traced.graph
    try:
        length = graph.node("parameter", value=len(names))
        if period is not None:
            record = parameter_record(names)(*traced.parameters)
            length = graph.lift(rebind(period, elementary_functions())(record))
        directions = tuple(graph.node("state", value=d + j) for j in range(d))
        slopes = along(graph, traced.outputs, dict(zip(traced.states, directions, strict=True)))
        one = graph.constant(1.0)
        diagonal = [along(graph, traced.outputs, {state: one})[j] for j, state in enumerate(traced.states)]
    except (UntraceableError, TypeError, AttributeError):
        return None
    spread = reduce(lambda a, b: graph.apply("add", a, b), diagonal)
    inputs = {traced.time: graph.apply("mul", length, traced.time)}
    inputs |= {state: graph.constant(x) for state, x in zip(traced.states, equilibrium, strict=True)}
    lanes = {traced.parameters[names.index(name)]: graph.node("sign", value=k) for k, name in enumerate(swept)}
    (length,) = _settled(graph, [length], lanes)
    inputs[traced.time] = graph.apply("mul", length, traced.time)
    inputs |= {direction: graph.node("state", value=j) for j, direction in enumerate(directions)}
    settled = _settled(graph, [*slopes, spread, *traced.outputs], {**lanes, **inputs})
    scaled = tuple(_product(graph, length, e) for e in settled[: d + 1])
    states = tuple(graph.node("state", value=j) for j in range(d + 1))
    linear = replace(traced, states=states, outputs=scaled)

    method = choose_method("auto", linear, rtol)
    resting = {node: graph.node("state", value=d + 1 + k) for k, node in enumerate(lanes.values())}
    zeros = (graph.constant(0.0),) * len(swept)
    motion = replace(linear, states=(*states, *resting.values()), outputs=(*substitute(graph, scaled, resting), *zeros))
    series = method.name == "Taylor"
    code = _taylor_steps(linear, taylor_order(rtol), len(swept)) if series else method.write(motion)
    advance = generated_module(lane_module(code, len(motion.states), len(names) + 1)).advance
    rates = substitute(graph, [_product(graph, length, e) for e in settled[d + 1 :]], resting)
    return LinearKernel(_finished(advance, method), motion, rates)


def values(
    expressions: Sequence[Expression], time: Any, states: Sequence[Any], parameters: NDArray[np.float64]
) -> list[NDArray[np.float64]]:
    """Return the values of expressions over arrays that broadcast; not finite where an operation is not defined."""
    inputs: dict[str, Callable[[Any], Any]] = {
        "time": lambda _: time,
        "state": states.__getitem__,
        "parameter": lambda i: parameters[i],
        "constant": np.float64,
    }
    known: dict[Expression, Any] = {}
    with np.errstate(all="ignore"):
        for node in in_order(expressions):
            if node.operation in inputs:
                known[node] = np.asarray(inputs[node.operation](node.value), dtype=float)
            else:
                function = _OF_ARRAYS.get(node.operation) or np.vectorize(operation_on_numbers(node.operation))
                known[node] = function(*(known[a] for a in node.arguments))
    return [known[e] for e in expressions]


def _settled(
    graph: Graph, outputs: Sequence[Expression], inputs: Mapping[Expression, Expression]
) -> tuple[Expression, ...]:
    """Return expressions with inputs replaced and all that vanishes left out, so that A is as sparse as it can be."""
    known = dict(inputs)
    zero = graph.constant(0.0)
    for node in in_order(outputs):
        if node not in known:
            known[node] = _simplest(graph, node, [known[a] for a in node.arguments], zero) if node.arguments else node
    return tuple(known[e] for e in outputs)


def _simplest(graph: Graph, node: Expression, arguments: list[Expression], zero: Expression) -> Expression:
    a, b = arguments[0], arguments[-1]
    a_rests, b_rests = _vanishes(a), _vanishes(b)
    match node.operation:
        case "mul" if a_rests or b_rests:
            return zero
        case "div" if a_rests:
            return zero
        case "add" if a_rests or b_rests:
            return b if a_rests else a
        case "sub" if b_rests or a is b:
            return zero if a is b else a
        case "sub" if a_rests:
            return graph.apply("neg", b)
        case "neg" if a_rests:
            return zero
        case "sin" | "cos" if a.operation == "constant":
            # An angle such as pi is known to half a unit of its last digit: what is smaller is none.
            value = sin(a.value) if node.operation == "sin" else cos(a.value)
            return zero if abs(value) <= ulp(a.value) else graph.constant(value)
    return graph.apply(node.operation, *arguments)


def _vanishes(e: Expression) -> bool:
    return e.operation == "constant" and e.value == 0.0


def _product(graph: Graph, a: Expression, b: Expression) -> Expression:
    return graph.constant(0.0) if _vanishes(b) else graph.apply("mul", a, b)


def _taylor_steps(trace: Trace, order: int, swept: int) -> StepCode:
    """Write one Taylor step of (v, L); inputs "sign" follow them in the state and rest.

    Of the nodes that depend on no direction, those with a swept parameter belong to the lane, the others to all.
    """
    series = Series(trace, order)
    levels = series.levels
    for node in in_order(trace.outputs):
        if node in series.modal and node.arguments:
            moving = levels[node] == TIMED or any(levels[a] == STATEFUL for a in node.arguments)
            if moving or node.operation not in _RATIONAL:
                levels[node] = STATEFUL
    count = len(trace.states)
    once = series.at_order(CONSTANT, 0, of_lanes=False)
    per_step = ["t0 = t", *(f"h{k} = h / {k}.0" for k in range(1, order + 1))]
    per_lane = [f"s{j}_0 = x{j}" for j in range(count)]
    per_lane += [f"g{k} = x{count + k}; y{count + k} = x{count + k}; e{count + k} = 0.0" for k in range(swept)]
    per_lane += series.at_order(CONSTANT, 0, of_lanes=True)
    for k in range(order):
        per_step += series.at_order(TIMED, k)
        per_lane += series.at_order(STATEFUL, k)
        per_lane += [
            f"s{j}_{k + 1} = h{k + 1} * {term}" if (term := series.name(e, k)) else f"s{j}_{k + 1} = 0.0"
            for j, e in enumerate(trace.outputs)
        ]
    for j in range(count):
        tail = " + ".join(f"s{j}_{k}" for k in range(order, 0, -1))
        per_lane += [f"y{j} = x{j} + ({tail})", f"e{j} = abs(s{j}_{order}) + 0.5 * abs(s{j}_{order - 1})"]
    return StepCode(tuple(once), tuple(per_step), tuple(per_lane))


def _finished(advance: Callable[..., Any], method: Method) -> PeriodKernel:
    stages = len(method.tableau.nodes) if method.tableau else 1
    return PeriodKernel(advance, method.name, method.estimate_order, stages, method.margin)
