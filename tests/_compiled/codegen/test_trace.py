"""Right-hand sides run once on symbols."""

import itertools
import math
import operator
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from cellmap._compiled.codegen.branches import BranchingGraph
from cellmap._compiled.codegen.derivative import frame_traces, jet_trace
from cellmap._compiled.codegen.expression import UntraceableError, in_order
from cellmap._compiled.codegen.methods import series_work
from cellmap._compiled.codegen.trace import (
    CONSTANT,
    STATEFUL,
    TIMED,
    Trace,
    empty_trace,
    parameter_record,
    trace,
)


def operations(traced: Trace, level: int | None = None) -> Counter[str]:
    levels = traced.levels()
    return Counter(n.operation for n in levels if n.arguments and level in (None, levels[n]))


def driven(t: float, x: Any, p: Any) -> tuple[float, float]:
    theta, v = x
    return v, -p.gamma * v - (p.alpha - p.beta * math.cos(t)) * math.sin(theta)


def test_every_node_knows_what_it_depends_on() -> None:
    traced = trace(driven, 2, ("alpha", "beta", "gamma"))
    assert operations(traced, CONSTANT) == {"neg": 1}
    assert operations(traced, TIMED) == {"cos": 1, "mul": 1, "sub": 1}
    assert operations(traced, STATEFUL) == {"sin": 1, "mul": 2, "sub": 1}
    assert traced.is_analytic
    assert repr(traced) == "Trace(2 components, 14 nodes)"


def test_common_terms_are_computed_once() -> None:
    def rhs(t: float, x: Any, p: Any) -> tuple[float, float]:
        return math.sin(x[0]) * math.cos(x[1]), math.sin(x[0]) - math.cos(x[1])

    traced = trace(rhs, 2, ())
    assert operations(traced) == {"sin": 1, "cos": 1, "mul": 1, "sub": 1}


UNTRACEABLE: list[Callable[..., Any]] = [
    lambda t, x, p: (math.gamma(x[0]),),
    lambda t, x, p: (np.linalg.eigvals([[x[0], 1.0], [1.0, x[0]]])[0],),
    lambda t, x, p: (math.remainder(x[0], 1.0),),
    lambda t, x, p: (next(k for k in itertools.count() if k > x[0]),),
    lambda t, x, p: (p.absent * x[0],),
]


@pytest.mark.parametrize("rhs", UNTRACEABLE)
def test_what_cannot_be_traced_says_why(rhs: Callable[..., Any]) -> None:
    with pytest.raises(UntraceableError, match=r"\w+ \w+"):
        trace(rhs, 1, ("k",))


def test_loops_and_branches_on_numbers_unroll() -> None:
    def rhs(t: float, x: Any, p: Any) -> tuple[float, ...]:
        n = len(x)
        return tuple(x[(i + 1) % n] - 2.0 * x[i] if i else p.k * x[i] for i in range(n))

    traced = trace(rhs, 4, ("k",))
    assert operations(traced) == {"mul": 4, "sub": 3}


ARITHMETIC: dict[str, Callable[..., float]] = {
    "add": operator.add,
    "sub": operator.sub,
    "mul": operator.mul,
    "div": operator.truediv,
    "neg": operator.neg,
    "pow": operator.pow,
    "side": lambda a: 1.0 if a > 0.0 else -1.0,
    "defined": lambda a: 1.0,
    "select": lambda sign, a, b: a if sign > 0.0 else b,
}


def evaluate(traced: Trace, t: float, x: list[float], p: list[float]) -> list[float]:
    """Value of a trace, by plain floats."""
    values: dict[Any, float] = {traced.time: t}
    values.update(zip(traced.states, x, strict=True))
    values.update(zip(traced.parameters, p, strict=True))
    for node in in_order(traced.outputs):
        if node.operation == "constant":
            values[node] = node.value
        elif node.arguments:
            function = ARITHMETIC.get(node.operation) or getattr(math, node.operation)
            values[node] = function(*(values[a] for a in node.arguments))
    return [values[e] for e in traced.outputs]


def test_a_trace_computes_what_the_function_computes() -> None:
    traced = trace(driven, 2, ("alpha", "beta", "gamma"))
    p = [0.5, 0.1, 0.03]
    record_of = parameter_record(("alpha", "beta", "gamma"))
    assert record_of is parameter_record(("alpha", "beta", "gamma"))
    record = record_of(*p)
    for t, x in ((0.0, [1.0, 2.0]), (4.0, [-3.0, 0.5])):
        assert evaluate(traced, t, x, p) == list(driven(t, tuple(x), record))


def test_a_print_warns_where_it_stands_and_prints_nothing_of_symbols(capsys: pytest.CaptureFixture[str]) -> None:
    def talkative(t: float, x: Any, p: Any) -> tuple[float]:
        print(f"{x[0]:.3f}", t)
        return (2.0 * x[0],)

    with pytest.warns(UserWarning, match="a print in a function that is compiled") as told:
        traced = trace(talkative, 1, ())
    assert (told[0].filename, told[0].lineno) == (__file__, talkative.__code__.co_firstlineno + 1)
    assert evaluate(traced, 0.0, [3.0], []) == [6.0]
    assert capsys.readouterr().out == ""


def test_the_tangent_of_a_time_dependent_coupled_system() -> None:
    def rhs(t: float, x: Any, p: Any) -> tuple[float, float]:
        return x[1] * math.cos(t) + p.k, p.k * x[0] * x[1]

    traced = trace(rhs, 2, ("k",))
    t, a, b, u, v, k = 0.7, 2.0, 3.0, 5.0, 7.0, 11.0
    assert evaluate(jet_trace(traced, 1), t, [a, b, u, v], [k]) == pytest.approx(
        [b * math.cos(t) + k, k * a * b, math.cos(t) * v, k * (a * v + b * u)]
    )


def test_several_directions_share_what_belongs_to_the_state() -> None:
    """Both ways to a product with the derivative give it; entries of a cubic force are computed once for all."""

    def rhs(t: float, x: Any, p: Any) -> tuple[float, float]:
        return x[1], p.k * math.cos(t) * x[0] - 2.0 * x[0] ** 3 + x[0] * x[1]

    traced = trace(rhs, 2, ("k",))
    t, a, b, k, vectors = 0.7, 2.0, 3.0, 11.0, (5.0, 7.0, -1.0, 2.0)
    row = k * math.cos(t) - 6.0 * a * a + b
    expected = [b, k * math.cos(t) * a - 2.0 * a**3 + a * b]
    expected += [e for u, v in (vectors[:2], vectors[2:]) for e in (v, row * u + a * v)]
    by_entries, by_chains = frame_traces(traced, 2)
    for found in (by_entries, by_chains):
        assert evaluate(found, t, [a, b, *vectors], [k]) == pytest.approx(expected, rel=1e-14)
    assert series_work(by_entries) < series_work(by_chains)


def test_tangents_that_are_not_known_are_refused() -> None:
    traced = empty_trace(1, 0, BranchingGraph(modes=False))
    unknown = replace(traced, outputs=(traced.graph.node("gamma", traced.states),))
    with pytest.raises(UntraceableError, match="no derivative of gamma"):
        jet_trace(unknown, 1)


def test_lengths_and_choices_are_those_of_numpy() -> None:
    def rhs(t: float, x: Any, p: Any) -> tuple[Any, ...]:
        chosen = np.select([x[0] > 1.0, x[1] > 0.0], [x[1], 3.0], -x[0])
        return np.linalg.norm([x[0], x[1]]), math.dist(x, (1.0, 2.0)), chosen

    traced = trace(rhs, 2, ())
    for x in ((0.3, -0.4), (2.0, 5.0), (0.5, 0.1)):
        assert evaluate(traced, 0.0, list(x), []) == pytest.approx([float(v) for v in rhs(0.0, x, ())], rel=1e-14)
