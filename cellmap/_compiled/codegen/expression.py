"""Expressions: the arithmetic of a right-hand side as a graph without repeated nodes."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

ANALYTIC = frozenset(
    {
        "add",
        "sub",
        "mul",
        "div",
        "neg",
        "sin",
        "cos",
        "exp",
        "log",
        "sqrt",
        "pow",
        "tan",
        "sinh",
        "cosh",
        "tanh",
        "atan",
    }
)
"""Operations with a power series wherever they are defined."""

_FOLD: dict[str, Callable[..., float]] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": lambda a, b: a / b,
    "neg": lambda a: -a,
    "pow": lambda a, b: a**b,
    "fmin": min,
    "fmax": max,
}

_OF_ANY_NUMBER = {"fmin", "fmax", "hypot"}

FUNCTIONS = (
    "sin cos tan exp log sqrt sinh cosh tanh fabs floor copysign fmin fmax asin acos atan atan2 log10 log2 log1p expm1 "
    "hypot ceil asinh acosh atanh erf"
).split()
"""Elementary functions that a traced right-hand side may call, by their names in :mod:`math`."""


def operation_on_numbers(name: str) -> Callable[..., float]:
    """Return an operation on numbers by its name."""
    fold: Callable[..., float] = _FOLD.get(name) or getattr(math, name)
    return fold


class UntraceableError(TypeError):
    """A right-hand side does with a state variable what no expression can hold, such as branching on its value."""


class Expression:
    """One node: an operation on other nodes, an input (state, time, parameter) or a constant."""

    __slots__ = ("arguments", "graph", "operation", "value")

    def __init__(self, graph: Graph, operation: str, arguments: tuple[Expression, ...], value: Any) -> None:
        self.graph, self.operation, self.arguments, self.value = graph, operation, arguments, value

    def __repr__(self) -> str:
        if self.operation == "constant":
            return repr(self.value)
        if not self.arguments:
            return self.operation if self.value is None else f"{self.operation}[{self.value}]"
        return f"{self.operation}({', '.join(map(repr, self.arguments))})"

    @property
    def vanishes(self) -> bool:
        """Whether it is the constant zero."""
        return bool(self.operation == "constant" and self.value == 0.0)

    def _refuse(self, *_: object) -> Any:
        raise UntraceableError("the value of a state variable, of time or of a parameter decides a branch")

    __bool__ = __float__ = __int__ = __index__ = __iter__ = __len__ = _refuse
    __lt__ = __le__ = __gt__ = __ge__ = __eq__ = __ne__ = _refuse
    __mod__ = __rmod__ = __floordiv__ = __rfloordiv__ = __round__ = _refuse

    def __hash__(self) -> int:
        return id(self)

    def __add__(self, other: Any) -> Expression:
        return self.graph.apply("add", self, other)

    def __radd__(self, other: Any) -> Expression:
        return self.graph.apply("add", other, self)

    def __sub__(self, other: Any) -> Expression:
        return self.graph.apply("sub", self, other)

    def __rsub__(self, other: Any) -> Expression:
        return self.graph.apply("sub", other, self)

    def __mul__(self, other: Any) -> Expression:
        return self.graph.apply("mul", self, other)

    def __rmul__(self, other: Any) -> Expression:
        return self.graph.apply("mul", other, self)

    def __truediv__(self, other: Any) -> Expression:
        return self.graph.apply("div", self, other)

    def __rtruediv__(self, other: Any) -> Expression:
        return self.graph.apply("div", other, self)

    def __neg__(self) -> Expression:
        return self.graph.apply("neg", self)

    def __pos__(self) -> Expression:
        return self

    def __abs__(self) -> Expression:
        return self.graph.apply("fabs", self)

    def __pow__(self, other: Any) -> Expression:
        return self.graph.power(self, other)

    def __rpow__(self, other: Any) -> Expression:
        return self.graph.power(self.graph.lift(other), self)


class Graph:
    """Maker of expressions.  The same operation on the same nodes is one node, so common terms are computed once."""

    def __init__(self) -> None:
        self._nodes: dict[tuple[Any, ...], Expression] = {}

    def node(self, operation: str, arguments: tuple[Expression, ...] = (), value: Any = None) -> Expression:
        """Return the one node with this content."""
        token = value.hex() if isinstance(value, float) else value
        key = (operation, *map(id, arguments), token)
        if key not in self._nodes:
            self._nodes[key] = Expression(self, operation, arguments, value)
        return self._nodes[key]

    def constant(self, value: float) -> Expression:
        """Return a literal number."""
        return self.node("constant", value=float(value))

    def lift(self, value: Any) -> Expression:
        """Turn a number into a constant and leave an expression as it is."""
        if isinstance(value, Expression):
            return value
        try:
            return self.constant(value)
        except (TypeError, ValueError) as error:
            raise UntraceableError(f"{value!r} is neither a number nor an expression") from error

    def apply(self, operation: str, *operands: Any) -> Expression:
        """Apply an operation; constants are folded, and factors and summands without effect vanish."""
        arguments = tuple(self.lift(a) for a in operands)
        if all(a.operation == "constant" for a in arguments):
            try:
                return self.constant(operation_on_numbers(operation)(*(a.value for a in arguments)))
            except (ValueError, ZeroDivisionError, OverflowError):
                pass
        values = [a.value if a.operation == "constant" else None for a in arguments]
        match operation, values:
            case ("add", [0.0, None]) | ("mul", [1.0, None]):
                return arguments[1]
            case ("add" | "sub", [None, 0.0]) | ("mul" | "div", [None, 1.0]):
                return arguments[0]
            case ("mul", [-1.0, None]):
                return self.apply("neg", arguments[1])
            case ("neg", _) if arguments[0].operation == "neg":
                return arguments[0].arguments[0]
        return self.node(operation, arguments)

    def times(self, a: Expression, b: Expression) -> Expression:
        """Multiply; nothing is left of a factor of zero."""
        return self.constant(0.0) if a.vanishes or b.vanishes else self.apply("mul", a, b)

    def minus(self, a: Expression, b: Expression) -> Expression:
        """Subtract; a minuend of zero, and a difference of equals, vanish."""
        if a.vanishes:
            return self.apply("neg", b)
        return self.constant(0.0) if a is b else self.apply("sub", a, b)

    def substituted(
        self,
        outputs: Sequence[Expression],
        values: Mapping[Expression, Expression],
        apply: Callable[..., Expression] | None = None,
    ) -> tuple[Expression, ...]:
        """Return expressions with some nodes replaced; `apply` makes the nodes anew, by default as they were."""
        rule = apply or self.apply
        known = dict(values)
        for node in in_order(outputs):
            if node not in known:
                known[node] = rule(node.operation, *(known[a] for a in node.arguments)) if node.arguments else node
        return tuple(known[e] for e in outputs)

    def power(self, base: Expression, exponent: Any) -> Expression:
        """Raise to a power; small whole exponents become products, halves become square roots."""
        number = exponent
        if isinstance(exponent, Expression):
            number = exponent.value if exponent.operation == "constant" else None
        if isinstance(number, int | float) and number == int(number) and abs(number) <= 16:
            whole = self._whole_power(base, abs(int(number)))
            return whole if number >= 0 else self.apply("div", 1.0, whole)
        if isinstance(number, int | float) and number == 0.5:
            return self.apply("sqrt", base)
        return self.apply("pow", base, exponent)

    def _whole_power(self, base: Expression, exponent: int) -> Expression:
        if exponent == 0:
            return self.constant(1.0)
        if exponent % 2:
            return self.apply("mul", self._whole_power(base, exponent - 1), base)
        half = self._whole_power(base, exponent // 2)
        return self.apply("mul", half, half)


def elementary_functions() -> dict[str, Callable[..., Any]]:
    """Return functions by their names in :mod:`math` that build expressions when an argument is one."""

    def make(name: str) -> Callable[..., Any]:
        def function(*arguments: Any) -> Any:
            if name in _OF_ANY_NUMBER:
                several = tuple(arguments[0]) if len(arguments) == 1 else arguments
                if len(several) != 2:
                    return functools.reduce(function, several)
                arguments = several
            for argument in arguments:
                if isinstance(argument, Expression):
                    return argument.graph.apply(name, *arguments)
            return operation_on_numbers(name)(*arguments)

        return function

    table = {name: make(name) for name in FUNCTIONS}
    table["pow"] = lambda base, exponent: base**exponent
    return table


def in_order(outputs: Iterable[Expression]) -> list[Expression]:
    """Return every node that the outputs need, arguments before the nodes that use them."""
    order: list[Expression] = []
    seen: set[Expression] = set()
    stack: list[tuple[Expression, bool]] = [(e, False) for e in reversed(list(outputs))]
    while stack:
        expression, ready = stack.pop()
        if ready:
            order.append(expression)
        elif expression not in seen:
            seen.add(expression)
            stack.append((expression, True))
            stack.extend((a, False) for a in reversed(expression.arguments))
    return order


def is_analytic(outputs: Sequence[Expression]) -> bool:
    """Tell whether every operation has a power series."""
    return all(e.operation in ANALYTIC or not e.arguments for e in in_order(outputs))
