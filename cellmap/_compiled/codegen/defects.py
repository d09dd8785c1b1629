"""How far a Taylor step is from its equation where its series were not made: in the middle and at the end of the step.

A series sees a function at one point.  Where tanh is saturated, or at the foot of a narrow bell, all of its
coefficients vanish, and no estimate from them tells what lies ahead.  Sums and products of states, and sines of them,
hide nothing.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence

from . import simd_math
from .emit import evaluate
from .expression import Expression, in_order
from .functions import TABLE
from .instructions import Value, total
from .taylor import Series, Structure
from .trace import STATEFUL

_WEIGHT = 0.25
"""Of the defect of a step in the estimate of its error: where series converge, that of the series remains larger."""

_PLACES = (0.5, 1.0)
_INPUTS = ("state", "time")


def hides(structure: Structure, expression: Expression) -> bool:
    """Whether the series of an expression may vanish at one point and not in its neighbourhood."""
    return expression in _with_result(structure, _hides)


def is_affine(structure: Structure, expression: Expression) -> bool:
    """Whether an expression is a sum of multiples of states and time, so that its series are as good as theirs."""
    return expression not in _with_result(structure, _bends)


def _hides(structure: Structure, n: Expression) -> bool:
    if n.operation == "div":
        return structure.moves(n.arguments[1])
    hiding = n.operation == "pow" or (n.operation in TABLE and not TABLE[n.operation].is_entire)
    return hiding and structure.moves(n)


def _bends(structure: Structure, n: Expression) -> bool:
    moving = [structure.moves(a) for a in n.arguments]
    multiple = (n.operation == "mul" and sum(moving) == 1) or (n.operation == "div" and not moving[1])
    return any(moving) and n.operation not in {"add", "sub", "neg"} and not multiple


@functools.lru_cache(maxsize=8)
def _with_result(structure: Structure, rule: Callable[[Structure, Expression], bool]) -> frozenset[Expression]:
    """Return the expressions of which a rule holds for one node at least that they need."""
    found: set[Expression] = set()
    for node in structure.nodes:
        if not found.isdisjoint(node.arguments) or rule(structure, node):
            found.add(node)
    return frozenset(found)


def elsewhere(series: Series, events: Sequence[Sequence[Value]]) -> tuple[dict[int, Value], list[Value]]:
    """Write the defects of states, by their numbers, of those that may hide something, and those of all events.

    Events that hide nothing are as good as the last coefficients of their series, which are given.
    """
    structure, order, (t, h) = series.structure, series.order, series.clock
    rates, functions = structure.trace.outputs, structure.extra
    chosen = [j for j, rate in enumerate(rates) if hides(structure, rate)]
    hidden = [e for e, event in enumerate(functions) if hides(structure, event)]
    wanted = in_order([*(rates[j] for j in chosen), *(functions[e] for e in hidden)])
    moving = [n for n in wanted if n.arguments and structure.moves(n)]
    defects: dict[int, list[Value]] = {j: [] for j in chosen}
    gaps: dict[int, list[Value]] = {e: [] for e in hidden}
    for at in _PLACES if any(n.arguments for n in wanted) else ():
        time = t + at * h
        states = [_sum([(1.0, c) for c in series.states[j]], at) for j in range(len(rates))]
        start = {n: series.first(n) for n in wanted if not structure.moves(n)}
        start |= {n: time if n.operation == "time" else states[n.value] for n in wanted if n.operation in _INPUTS}
        known = evaluate(series.out, moving, start, STATEFUL)
        for j in chosen:
            slope = _sum([(float(k), c) for k, c in enumerate(series.states[j]) if k], at)
            defects[j].append(abs(slope - h * known[rates[j]]))
        # Events of a function without a value, where a step begins, are looked for in the next one.
        if fixed := {n: series.first(n) for n in moving if n.operation == "defined"}:
            known = evaluate(series.out, [n for n in moving if n not in fixed], start | fixed, STATEFUL)
        for e in hidden:
            gaps[e].append(abs(_sum([(1.0, c) for c in events[e]], at) - known[functions[e]]))
    found = {j: _WEIGHT * simd_math.fmax(*both) for j, both in defects.items()}
    unseen = []
    for e, event in enumerate(functions):
        is_exact = is_affine(structure, event)
        tail = series.out.number(0.0) if is_exact else abs(events[e][order]) + 0.5 * abs(events[e][order - 1])
        unseen.append(simd_math.fmax(tail, simd_math.fmax(*gaps[e])) if e in gaps else tail)
    return found, unseen


def _sum(terms: Sequence[tuple[float, Value]], at: float) -> Value:
    """Sum of a series, with a factor of each term, at a fraction of the step."""
    factors = [(at**k * factor, term) for k, (factor, term) in enumerate(terms)]
    return total(term if at == factor == 1.0 else factor * term for factor, term in reversed(factors))
