"""How far a Taylor step is from its equation where its series were not made: in the middle and at the end of the step.

A series sees a function at one point.  Where tanh is saturated, or at the foot of a narrow bell, all of its
coefficients vanish, and no estimate from them tells what lies ahead.  Sums and products of states, and sines of them,
hide nothing.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator

from .emit import assignment, input_name
from .expression import Expression, in_order
from .taylor import MODES, Series
from .trace import CONSTANT, STATEFUL

_WEIGHT = 0.25
"""Of the defect of a step in the estimate of its error: where series converge, that of the series remains larger."""

_HIDING = frozenset({"tanh", "tan", "atan", "exp", "log", "sqrt", "sinh", "cosh", "pow", "div"})
_PLACES = (("half", 0.5), ("full", 1.0))


def hides(series: Series, expression: Expression) -> bool:
    """Whether the series of an expression may vanish at one point and not in its neighbourhood."""
    return expression in _with_result(series, _hides)


def is_affine(series: Series, expression: Expression) -> bool:
    """Whether an expression is a sum of multiples of states and time, so that its series are as good as theirs."""
    return expression not in _with_result(series, _bends)


def _hides(series: Series, n: Expression) -> bool:
    moving = series.levels[n] != CONSTANT
    return moving and n.operation in _HIDING and (n.operation != "div" or series.levels[n.arguments[1]] != CONSTANT)


def _bends(series: Series, n: Expression) -> bool:
    moving = [series.levels.get(a, CONSTANT) != CONSTANT for a in n.arguments]
    multiple = (n.operation == "mul" and sum(moving) == 1) or (n.operation == "div" and not moving[1])
    return any(moving) and n.operation not in {"add", "sub", "neg"} and not multiple


@functools.lru_cache(maxsize=8)
def _with_result(series: Series, rule: Callable[[Series, Expression], bool]) -> frozenset[Expression]:
    """Return the expressions of which a rule holds for one node at least that they need."""
    found: set[Expression] = set()
    for node in series.nodes:
        if not found.isdisjoint(node.arguments) or rule(series, node):
            found.add(node)
    return frozenset(found)


def elsewhere(series: Series) -> Iterator[str]:
    """Write the defects of states, ``defect{j}``, and of events, ``gap{e}``, of those that may hide something.

    Events that hide nothing are as good as the last coefficients of their series.
    """
    rates, order = series.trace.outputs, series.order
    chosen = [j for j, rate in enumerate(rates) if hides(series, rate)]
    events = [e for e, event in enumerate(series.extra) if hides(series, event)]
    wanted = [n for n in in_order([*(rates[j] for j in chosen), *(series.extra[e] for e in events)]) if n.arguments]
    for place, at in _PLACES if wanted else ():
        name = _names(series, place)
        yield f"{place}_t = t0 + {at!r} * h"
        for j in range(len(rates)):
            yield f"{place}_s{j} = {_sum([series_name(j, k) for k in range(order + 1)], at)}"
        yield from (assignment(n, name, STATEFUL) for n in wanted if series.levels[n] != CONSTANT)
        for j in chosen:
            slope = [f"{k}.0 * {series_name(j, k)}" for k in range(1, order + 1)]
            yield f"{place}_d{j} = abs({_sum(slope, at)} - h * {name(rates[j])})"
        for e in events:
            terms = [f"event{e}_{k}" for k in range(order + 1)]
            yield f"{place}_g{e} = abs({_sum(terms, at)} - {name(series.extra[e])})"
    for j in chosen:
        yield f"defect{j} = {_WEIGHT!r} * simd_math.fmax(half_d{j}, full_d{j})"
    for e, event in enumerate(series.extra):
        last, before = (f"event{e}_{k}" for k in (order, order - 1))
        tail = "0.0" if is_affine(series, event) else f"abs({last}) + 0.5 * abs({before})"
        seen = f"simd_math.fmax(half_g{e}, full_g{e})"
        yield f"gap{e} = {f'simd_math.fmax({tail}, {seen})' if e in events else tail}"


def series_name(j: int, k: int) -> str:
    """Name of coefficient k of a state."""
    return f"s{j}_{k}"


def _names(series: Series, place: str) -> Callable[[Expression], str]:
    """Return how nodes are called in some place of a step; constants are what they are."""

    def name(node: Expression) -> str:
        if node.operation == "time":
            return f"{place}_t"
        if node.operation == "state":
            return f"{place}_s{node.value}"
        if series.levels.get(node, CONSTANT) == CONSTANT:
            return series.name(node, 0)
        return input_name(node, MODES) or f"{place}{series.numbers[node]}"

    return name


def _sum(terms: list[str], at: float) -> str:
    """Sum of a series at a fraction of the step."""
    if at == 1.0:
        return " + ".join(reversed(terms))
    return " + ".join(f"{at**k!r} * {term}" for k, term in reversed(list(enumerate(terms))))
