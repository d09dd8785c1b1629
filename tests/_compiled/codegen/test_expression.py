"""Graphs of expressions: nothing twice, nothing without effect."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cellmap._compiled.codegen.elementary import elementary_functions
from cellmap._compiled.codegen.expression import (
    Expression,
    Graph,
    UntraceableError,
    in_order,
    is_analytic,
)
from cellmap._compiled.codegen.functions import TABLE


@pytest.fixture
def graph() -> Graph:
    return Graph()


@pytest.fixture
def x(graph: Graph) -> Expression:
    return graph.node("state", value=0)


def test_the_same_operation_on_the_same_nodes_is_one_node(graph: Graph, x: Expression) -> None:
    assert x * x + 1.0 is x * x + 1.0
    assert graph.constant(0.0) is not graph.constant(-0.0)
    first, second = x * x + 1.0, (x * x) * 3.0
    assert Counter(n.operation for n in in_order([first, second]))["mul"] == 2


@pytest.mark.parametrize(
    "simplified",
    [
        lambda x: x + 0.0,
        lambda x: 0.0 + x,
        lambda x: x - 0.0,
        lambda x: 1.0 * x,
        lambda x: x * 1,
        lambda x: x / 1.0,
        lambda x: -(-x),  # noqa: B002
        lambda x: +x,
        lambda x: x**1,
    ],
)
def test_operations_without_effect_vanish(x: Expression, simplified: Callable[[Expression], Expression]) -> None:
    assert simplified(x) is x


def test_a_product_with_zero_stays(x: Expression) -> None:
    # 0 * x is not 0 where x is not finite.
    assert (0.0 * x).operation == "mul"


def test_constants_are_folded(graph: Graph, x: Expression) -> None:
    assert (graph.constant(2.0) * math.pi + 1.0).value == 2.0 * math.pi + 1.0
    assert graph.apply("sin", 0.5).value == math.sin(0.5)
    assert graph.apply("div", 1.0, 0.0).operation == "div"
    assert graph.apply("log", -1.0).operation == "log"


@pytest.mark.parametrize("exponent", range(-16, 17))
def test_whole_powers_are_products(x: Expression, exponent: int) -> None:
    nodes = in_order([x**exponent])
    assert {n.operation for n in nodes} <= {"state", "mul", "div", "constant"}
    assert sum(n.operation == "mul" for n in nodes) <= 6
    assert evaluate(x**exponent, 1.25) == pytest.approx(1.25**exponent, rel=1e-14)


def test_other_powers(x: Expression) -> None:
    assert (x**0.5).operation == "sqrt"
    assert (x**2.5).operation == "pow"
    assert (x**17).operation == "pow"
    assert (x**0).value == 1.0
    assert (2.0**x).operation == "pow"
    assert (x**x).operation == "pow"


@pytest.mark.parametrize(
    "use",
    [
        bool,
        float,
        int,
        iter,
        len,
        round,
        lambda x: x > 0,
        lambda x: x <= 1,
        lambda x: x == 0,
        lambda x: x != 0,
        lambda x: [1, 2, 3][x],
        lambda x: 1.0 if x else 2.0,
        lambda x: math.sin(x),
        lambda x: x + None,
    ],
)
def test_what_no_expression_can_hold_is_refused(x: Expression, use: Callable[[Any], Any]) -> None:
    with pytest.raises(UntraceableError):
        use(x)


def test_elementary_functions_build_expressions_or_compute(x: Expression) -> None:
    table = elementary_functions()
    assert set(table) == {
        *TABLE,
        "pow",
        "print",
        "clip",
        "where",
        "heaviside",
        "float",
        "int",
        "select",
        "norm",
        "dist",
        "round",
        "interp",
        "polyval",
        "logaddexp",
        "fsum",
        "degrees",
        "radians",
        "signbit",
    }
    assert table["sin"](x).operation == "sin"
    assert table["atan2"](1.0, x).operation == "atan2"
    assert table["sin"](0.5) == math.sin(0.5)
    assert table["fmax"](1.0, 2.0) == 2.0
    assert table["pow"](x, 2) is x * x


def test_arguments_come_before_the_nodes_that_use_them(x: Expression) -> None:
    table = elementary_functions()
    y = table["sin"](x * x + 1.0) / (x * x)
    order = in_order([y, x])
    assert len(order) == len(set(order))
    for place, node in enumerate(order):
        assert {id(a) for a in node.arguments} <= {id(n) for n in order[:place]}


def test_a_long_sum_does_not_exhaust_the_stack(x: Expression) -> None:
    total = x
    for k in range(5000):
        total = total + float(k + 1)
    assert len(in_order([total])) == 10001


def test_analytic(x: Expression) -> None:
    table = elementary_functions()
    assert is_analytic([table["sin"](x) / table["exp"](x), x])
    assert not is_analytic([abs(x)])
    assert not is_analytic([table["atan2"](x, 1.0)])


def evaluate(expression: Expression, value: float) -> float:
    """Value of an expression of one state variable."""
    values: dict[Expression, float] = {}
    for node in in_order([expression]):
        if node.operation == "state":
            values[node] = value
        elif node.operation == "constant":
            values[node] = node.value
        else:
            a = [values[n] for n in node.arguments]
            operations: dict[str, Callable[..., float]] = {
                "add": lambda p, q: p + q,
                "sub": lambda p, q: p - q,
                "mul": lambda p, q: p * q,
                "div": lambda p, q: p / q,
                "neg": lambda p: -p,
            }
            values[node] = operations[node.operation](*a)
    return values[expression]


@given(
    st.lists(st.tuples(st.sampled_from(["+", "-", "*", "/"]), st.floats(-4.0, 4.0), st.booleans()), max_size=12),
    st.floats(-3.0, 3.0),
)
def test_arithmetic_means_what_python_means(steps: list[tuple[str, float, bool]], value: float) -> None:
    """Any chain of operations with constants, either way round, has the bits of plain floats."""
    graph = Graph()
    symbol: Any = graph.node("state", value=0)
    number = value
    for sign, constant, swapped in steps:
        pairs = [(constant, symbol), (constant, number)] if swapped else [(symbol, constant), (number, constant)]
        if sign == "/" and pairs[1][1] == 0.0:
            continue
        symbol, number = (
            {"+": lambda a, b: a + b, "-": lambda a, b: a - b, "*": lambda a, b: a * b, "/": lambda a, b: a / b}[sign](
                *p
            )
            for p in pairs
        )
    # The sum of -0.0 and 0.0 is 0.0: the graph drops that addition, so zeros may differ in sign.
    assert evaluate(graph.lift(symbol), value) == pytest.approx(number, rel=0, abs=0, nan_ok=True)
