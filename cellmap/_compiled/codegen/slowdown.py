"""How much longer a function without formulas takes than its formulas would: one step of both, beside one state."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from ..._lib.arrays import Floats
from ..kernels.blocks import LANES
from .branches import BranchingGraph
from .evaluation import evaluated
from .expression import Expression, UntraceableError
from .kernel import application, compiled_steps
from .methods import LARGE, choose_method
from .period import CompiledPeriod, compiled_period
from .trace import Trace, empty_trace

_BLOCKS, _TIMES = 64, 5  # of lanes that take one step, and how often they do: some microseconds each


class _AtPlace(BranchingGraph):
    """A graph of formulas as they are at one place, where everything that decides has a value."""

    def __init__(self) -> None:
        super().__init__(modes=False)
        self.place: dict[Expression, float] = {}

    def number(self, expression: Expression, refusal: UntraceableError | None = None) -> float:
        return float(evaluated([expression], self.place)[0])

    def answer(self, function: Expression, strictly: bool = True) -> bool:
        value = self.number(function)
        return value > 0.0 or (value == 0.0 and not strictly)

    def choose(self, function: Expression, a: Any, b: Any, *, strictly: bool = True) -> Expression:
        return self.lift(a if self.answer(function, strictly) else b)

    def whole_part(self, a: Expression) -> Expression:
        return self.plain("floor", a)


_FACTORS: WeakKeyDictionary[CompiledPeriod, float] = WeakKeyDictionary()


def slowdown(
    function: Callable[..., Any],
    names: tuple[str, ...],
    place: tuple[float, ...],
    compiled: CompiledPeriod,
    method: str,
) -> float:
    """Return how many times as long a step of a compiled function ``f(t, x, p)`` takes as one of its formulas.

    These are the formulas of the branches and loops that it takes at a `place`, state and parameters one after the
    other.  NaN where there are none either.  Steps are those of a method, or "" for a map.  Measured once.
    """
    if compiled in _FACTORS:
        return _FACTORS[compiled]
    _FACTORS[compiled] = np.nan
    graph, dimension = _AtPlace(), len(place) - len(names)
    inputs = empty_trace(dimension, len(names), graph)
    graph.place = dict(zip((*inputs.states, *inputs.parameters, inputs.time), (*place, 0.0), strict=True))
    try:
        formulas = _compiled(replace(inputs, outputs=tuple(inputs.run(function, names)())), method)
    except (UntraceableError, TypeError):
        return _FACTORS[compiled]
    state, parameters = np.array(place[:dimension]), np.array(place[dimension:])
    slow, fast = (_seconds(advance, state, parameters) for advance in (compiled, formulas))
    _FACTORS[compiled] = slow / fast
    return _FACTORS[compiled]


def _compiled(traced: Trace, method: str) -> CompiledPeriod:
    count, large = len(traced.parameters), len(traced.states) > LARGE
    if not method:
        return compiled_period(application(traced), len(traced.states), count)
    return compiled_steps(choose_method(method, traced, 1e-9, large), traced, count, large)


def _seconds(advance: CompiledPeriod, state: Floats, parameters: Floats) -> float:
    """Return the least time in which blocks of lanes take one step."""
    taken, errors = [], np.zeros((_BLOCKS, len(state), LANES))
    for _ in range(_TIMES):
        x = np.broadcast_to(state[:, np.newaxis], (_BLOCKS, len(state), LANES)).copy()
        begin = time.perf_counter()
        advance(x, np.ones(_BLOCKS, np.int64), 0.0, 1.0, parameters, errors)
        taken.append(time.perf_counter() - begin)
    return min(taken)
