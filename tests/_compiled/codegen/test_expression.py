"""Graphs of expressions: nothing twice, nothing without effect."""

import math
import operator
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

TABLE_OF_FUNCTIONS = elementary_functions()


@pytest.fixture
def x() -> Expression:
    return Graph().node("state", value=0)


def test_the_same_operation_on_the_same_nodes_is_one_node(x: Expression) -> None:
    assert x * x + 1.0 is x * x + 1.0
    assert x.graph.constant(0.0) is not x.graph.constant(-0.0)
    first, second = x * x + 1.0, (x * x) * 3.0
    assert Counter(n.operation for n in in_order([first, second]))["mul"] == 2


def test_operations_without_effect_vanish(x: Expression) -> None:
    for simplified in (x + 0.0, 0.0 + x, x - 0.0, 1.0 * x, x * 1, x / 1.0, -(-x), +x, x**1):  # noqa: B002
        assert simplified is x


def test_constants_are_folded(x: Expression) -> None:
    apply = x.graph.apply
    assert (x.graph.constant(2.0) * math.pi + 1.0).value == 2.0 * math.pi + 1.0
    assert (apply("sin", 0.5).value, (x**0).value) == (math.sin(0.5), 1.0)
    # 0 * x is not 0 where x is not finite.
    kept = [(apply("div", 1.0, 0.0), "div"), (apply("log", -1.0), "log"), (0.0 * x, "mul"), (x**0.5, "sqrt")]
    for node, operation in [*kept, *((power, "pow") for power in (x**2.5, x**17, 2.0**x, x**x))]:
        assert node.operation == operation


@pytest.mark.parametrize("exponent", range(-16, 17))
def test_whole_powers_are_products(x: Expression, exponent: int) -> None:
    nodes = in_order([x**exponent])
    assert {n.operation for n in nodes} <= {"state", "mul", "div", "constant"}
    assert sum(n.operation == "mul" for n in nodes) <= 6
    assert evaluate(x**exponent, 1.25) == pytest.approx(1.25**exponent, rel=1e-14)


REFUSED: list[Callable[[Any], Any]] = [
    bool, float, int, iter, len, round, math.sin, lambda x: x > 0, lambda x: x <= 1, lambda x: x == 0, lambda x: x != 0,
    lambda x: [1, 2, 3][x], lambda x: 1.0 if x else 2.0, lambda x: x + None,
]  # fmt: skip


@pytest.mark.parametrize("use", REFUSED)
def test_what_no_expression_can_hold_is_refused(x: Expression, use: Callable[[Any], Any]) -> None:
    with pytest.raises(UntraceableError):
        use(x)


def test_elementary_functions_build_expressions_or_compute(x: Expression) -> None:
    table = TABLE_OF_FUNCTIONS
    others = "pow print heaviside float int dist round logaddexp fsum degrees complex phase polar rect"
    assert set(table) == {*TABLE, *others.split(), "radians", "signbit", "expit", "logit", "exp10", "ndtr"}
    assert table["sin"](x).operation == "sin"
    assert table["atan2"](1.0, x).operation == "atan2"
    assert table["sin"](0.5) == math.sin(0.5)
    assert table["fmax"](1.0, 2.0) == 2.0
    assert table["pow"](x, 2) is x * x


def test_arguments_come_before_the_nodes_that_use_them(x: Expression) -> None:
    y = TABLE_OF_FUNCTIONS["sin"](x * x + 1.0) / (x * x)
    order = in_order([y, x])
    assert len(order) == len(set(order))
    for place, node in enumerate(order):
        assert {id(a) for a in node.arguments} <= {id(n) for n in order[:place]}
    total = sum((float(k + 1) for k in range(5000)), x)  # so many exhaust the stack of what calls itself
    assert len(in_order([total])) == 10001


def test_analytic(x: Expression) -> None:
    table = TABLE_OF_FUNCTIONS
    assert is_analytic([table["sin"](x) / table["exp"](x), x])
    assert not is_analytic([abs(x)])
    assert not is_analytic([table["atan2"](x, 1.0)])


OPERATIONS: dict[str, Callable[..., Any]] = {
    "add": operator.add,
    "sub": operator.sub,
    "mul": operator.mul,
    "div": operator.truediv,
    "neg": operator.neg,
}


def evaluate(expression: Expression, value: float) -> float:
    """Value of an expression of one state variable."""
    values: dict[Expression, float] = {}
    for node in in_order([expression]):
        if node.arguments:
            values[node] = OPERATIONS[node.operation](*(values[n] for n in node.arguments))
        else:
            values[node] = value if node.operation == "state" else node.value
    return values[expression]


@given(
    st.lists(st.tuples(st.sampled_from(list(OPERATIONS)[:4]), st.floats(-4.0, 4.0), st.booleans()), max_size=12),
    st.floats(-3.0, 3.0),
)
def test_arithmetic_means_what_python_means(steps: list[tuple[str, float, bool]], value: float) -> None:
    """Any chain of operations with constants, either way round, has the bits of plain floats."""
    graph = Graph()
    symbol: Any = graph.node("state", value=0)
    number = value
    for operation, constant, swapped in steps:
        pairs = [(constant, symbol), (constant, number)] if swapped else [(symbol, constant), (number, constant)]
        if operation == "div" and pairs[1][1] == 0.0:
            continue
        symbol, number = (OPERATIONS[operation](*pair) for pair in pairs)
    # The sum of -0.0 and 0.0 is 0.0: the graph drops that addition, so zeros may differ in sign.
    assert evaluate(graph.lift(symbol), value) == pytest.approx(number, rel=0, abs=0, nan_ok=True)
