"""Expressions: the arithmetic of a right-hand side as a graph without repeated nodes."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache, reduce
from typing import Any

import numpy as np

from .functions import TABLE

JUMPING = frozenset({"side", "reached", "floor", "fabs", "trunc", "copysign", "mod", "fmod", "floordiv"})
"""Operations with kinks or jumps that are no selections."""

ARITHMETIC: dict[str, Callable[..., Any]] = {
    "add": operator.add,
    "sub": operator.sub,
    "mul": operator.mul,
    "div": operator.truediv,
    "neg": operator.neg,
}
"""Operations of numbers, arrays and values in machine code alike."""

_FOLD: dict[str, Callable[..., float]] = {
    **ARITHMETIC,
    "pow": operator.pow,
    "min": min,
    "max": max,
    **{name: getattr(np, name) for name in ("minimum", "maximum", "fmin", "fmax", "sign", "heaviside")},
    "mod": operator.mod,
    "floordiv": operator.floordiv,
    "side": lambda a: 1.0 if a > 0.0 else -1.0,
    "reached": lambda a: 1.0 if a >= 0.0 else -1.0,
    "defined": lambda a: 1.0 if a == a else -1.0,
    "select": lambda sign, a, b: a if sign > 0.0 else b,
}
"""Operations without their like in :mod:`math`.

``side`` is a sign, -1 at zero, and ``reached`` one that is 1 there; of NaN both are -1, and ``defined`` is for nothing
else.  ``select`` chooses by a sign.
"""


def operation_on_numbers(name: str) -> Callable[..., float]:
    """Return an operation on numbers by its name."""
    fold: Callable[..., float] = _FOLD.get(name) or getattr(math, name)
    return fold


class UntraceableError(TypeError):
    """A right-hand side does with a state variable what no expression can hold, such as branching on its value."""


class UndefinedError(UntraceableError):
    """A function raises an exception of its own: where it does so it has no value."""


SUM_OF_COMPARISONS = (
    "a function that uses NumPy adds comparisons, subtracts or inverts them: of Python's numbers "
    "(a > b) + (c > d) counts, and of NumPy's it is `or`. Write 1.0 * (a > b) + 1.0 * (c > d) to count, "
    "a > b or c > d for one of both, and `not` for ~"
)


class ComparisonError(TypeError):
    """Arithmetic of truth values, which is another one for Python's numbers than for NumPy's."""


class ImpureError(ValueError):
    """A function gives other values when it is called again."""

    def __init__(self, name: str, difference: str) -> None:
        super().__init__(
            f"{name} {difference}: it is not a pure function of its arguments. Random numbers, clocks, and values that "
            "change from call to call cannot be used in it; for noise that acts once a period iterate the map, and add "
            "the noise between two calls"
        )


def _operator(operation: str, swapped: bool = False) -> Callable[..., Any]:
    """Return the method of an expression that applies an operation to it and other operands."""

    def apply(self: Expression, *others: Any) -> Expression:
        return self.graph.apply(operation, *((*others, self) if swapped else (self, *others)))

    return apply


def _refusing(what: str, kind: type[Any] | None = None) -> Callable[..., Any]:
    """Return a method of an expression that no formula has; a number of some kind where the graph knows values."""

    def refuse(self: Any, *_: object) -> Any:
        refusal = UntraceableError(f"the value of a state variable, of time or of a parameter {what}")
        if kind is None:
            raise refusal
        return kind(self.graph.number(self, refusal))

    return refuse


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

    def __format__(self, _: str) -> str:
        """Return what stands in a text that a function prints: its value is not known, and its formula may be long."""
        return self.operation

    @property
    def real(self) -> Expression:
        """The number: it is real."""
        return self

    @property
    def imag(self) -> Expression:
        """Nought."""
        return self.graph.constant(0.0)

    def conjugate(self) -> Expression:
        """Return the number."""
        return self

    @property
    def vanishes(self) -> bool:
        """Whether it is the constant zero."""
        return bool(self.operation == "constant" and self.value == 0.0)

    __float__ = _refusing(
        "goes to a function that takes plain floats, which has no formula here: write it with functions of math, or "
        "interpolate it before, by scipy.interpolate.CubicSpline at some 200 equal distances",
        float,
    )
    __int__ = __index__ = _refusing(
        "counts: it is an index, the length of a loop, or goes to an array of integers. Give loops a fixed length, "
        "choose by np.where, look tables up by np.interp, and give arrays dtype=float",
        int,
    )
    __iter__ = __len__ = _refusing("is taken for several: it is one number")
    __hash__ = object.__hash__

    def __bool__(self) -> bool:
        return bool(self != 0.0)

    def __eq__(self, other: Any) -> Any:
        return self.graph.equal(self, other) if isinstance(other, _COMPARABLE) else NotImplemented

    def __ne__(self, other: Any) -> Any:
        return self.graph.equal(self, other, inverted=True) if isinstance(other, _COMPARABLE) else NotImplemented

    def __gt__(self, other: Any) -> Any:
        return self.graph.compare(self, other, strictly=True)

    def __ge__(self, other: Any) -> Any:
        return self.graph.compare(self, other, strictly=False)

    def __lt__(self, other: Any) -> Any:
        return self.graph.compare(other, self, strictly=True)

    def __le__(self, other: Any) -> Any:
        return self.graph.compare(other, self, strictly=False)

    __add__, __radd__ = _operator("add"), _operator("add", swapped=True)
    __sub__, __rsub__ = _operator("sub"), _operator("sub", swapped=True)
    __mul__, __rmul__ = _operator("mul"), _operator("mul", swapped=True)
    __truediv__, __rtruediv__ = _operator("div"), _operator("div", swapped=True)
    __mod__, __rmod__ = _operator("mod"), _operator("mod", swapped=True)
    __floordiv__, __rfloordiv__ = _operator("floordiv"), _operator("floordiv", swapped=True)
    __neg__, __abs__, __floor__ = _operator("neg"), _operator("fabs"), _operator("floor")
    __ceil__, __trunc__ = _operator("ceil"), _operator("trunc")

    def __divmod__(self, other: Any) -> tuple[Expression, Expression]:
        return self // other, self % other

    def __rdivmod__(self, other: Any) -> tuple[Expression, Expression]:
        return other // self, other % self

    def __round__(self, digits: int | None = None) -> Expression:
        raise UntraceableError("it rounds a number: write floor(a + 0.5)")

    def __pos__(self) -> Expression:
        return self

    def __pow__(self, other: Any) -> Expression:
        return self.graph.power(self, other)

    def __rpow__(self, other: Any) -> Expression:
        return self.graph.power(self.graph.lift(other), self)

    __array_ufunc__: Callable[..., Any]  # of the module that knows arrays
    as_complex: Callable[..., Any]  # of the one that knows complex numbers
    complex_kinds: tuple[type[Any], ...]


def leaving_arrays(method: Callable[..., Any]) -> Callable[..., Any]:
    """Leave operations with arrays to these."""
    return lambda self, *others: (
        NotImplemented if any(isinstance(o, np.ndarray | tuple) for o in others) else method(self, *others)
    )


def _of_any(name: str) -> Callable[..., Any]:
    """Leave operations with complex numbers to pairs."""
    method = getattr(Expression, name)

    def apply(self: Expression, *others: Any) -> Any:
        if any(isinstance(o, self.complex_kinds) for o in others):
            return getattr(self.as_complex(), name)(*others)
        return method(self, *others)

    return apply


for (
    _name
) in "add radd sub rsub mul rmul truediv rtruediv mod rmod floordiv rfloordiv pow rpow eq ne gt ge lt le".split():
    setattr(Expression, f"__{_name}__", leaving_arrays(_of_any(f"__{_name}__")))


class Comparison:
    """A comparison a > b, or a >= b, of expressions: a branch that asks for its truth, or one or nought as a number.

    Neither holds of NaN; one that is `inverted` then does.
    """

    __slots__ = ("difference", "graph", "inverted", "strictly")

    def __init__(self, graph: Any, difference: Expression, strictly: bool, inverted: bool = False) -> None:
        self.graph, self.difference, self.strictly, self.inverted = graph, difference, strictly, inverted

    def __bool__(self) -> bool:
        return self.graph.answer(self.difference, self.strictly) is not self.inverted

    def __and__(self, other: Any) -> Answer:
        return Answer(self.graph, bool(self) and bool(other))

    def __or__(self, other: Any) -> Answer:
        return Answer(self.graph, bool(self) or bool(other))

    def __xor__(self, other: Any) -> Answer:
        return Answer(self.graph, bool(self) is not bool(other))

    def __eq__(self, other: Any) -> Any:
        return Answer(self.graph, bool(self) == other)

    def __ne__(self, other: Any) -> Any:
        return Answer(self.graph, bool(self) != other)

    __rand__, __ror__, __rxor__, __hash__ = __and__, __or__, __xor__, object.__hash__

    def number(self) -> Expression:
        """Return one where the comparison holds, else nought."""
        return self.choose(1.0, 0.0)

    def choose(self, a: Any, b: Any) -> Expression:
        """Return a where the comparison holds, else b."""
        sides = (b, a) if self.inverted else (a, b)
        chosen: Expression = self.graph.choose(self.difference, *sides, strictly=self.strictly)
        return chosen


class Both(Comparison):
    """A product of comparisons, which is a truth value of NumPy's if they are; `inverted`, that not both hold."""

    __slots__ = ("factors",)

    def __init__(self, *factors: Comparison, inverted: bool = False) -> None:
        self.graph, self.factors, self.inverted = factors[0].graph, factors, inverted

    def __bool__(self) -> bool:
        return all(map(bool, self.factors)) is not self.inverted

    def number(self) -> Expression:
        """Return one where both hold, else nought."""
        product: Expression = reduce(operator.mul, (factor.number() for factor in self.factors))
        return 1.0 - product if self.inverted else product

    def choose(self, a: Any, b: Any) -> Expression:
        """Return a where both hold, else b."""
        a, b = (b, a) if self.inverted else (a, b)
        return reduce(lambda chosen, factor: factor.choose(chosen, b), self.factors, self.graph.lift(a))


class Answer(int):
    """The answer of a comparison that has been asked, or of several."""

    graph: Any

    def __new__(cls, graph: Any, value: bool) -> Answer:
        """Keep the graph of the comparison."""
        answer = super().__new__(cls, value)
        answer.graph = graph
        return answer

    __and__, __or__, __xor__ = Comparison.__and__, Comparison.__or__, Comparison.__xor__
    __rand__, __ror__, __rxor__ = __and__, __or__, __xor__

    def number(self) -> Expression:
        """Return the number."""
        found: Expression = self.graph.constant(float(self))
        return found


def _truth_arithmetic(kind: type[Any], name: str) -> None:
    """Give comparisons an operation of numbers, where Python and NumPy agree about that."""
    method, counts = f"__{name}__", name.removeprefix("r") in {"add", "sub", "neg", "pos", "invert"}

    def apply(self: Any, *operands: Any) -> Any:
        if counts and self.graph.of_numpy and all(isinstance(o, Comparison | Answer) for o in operands):
            raise ComparisonError(SUM_OF_COMPARISONS)
        if name == "mul" and self.graph.of_numpy and isinstance(operands[0], Comparison):
            return Both(self, operands[0]) if isinstance(self, Comparison) else operands[0] & self
        if name == "mul" and self.graph.of_numpy and isinstance(operands[0], Answer):
            return self & operands[0]
        return -1.0 - self.number() if name == "invert" else getattr(self.number(), method)(*operands)

    setattr(kind, method, apply)


for _name in "add radd sub rsub mul rmul truediv rtruediv neg pos pow rpow invert".split():
    for _kind in (Comparison, Answer):
        _truth_arithmetic(_kind, _name)


_COMPARABLE = (int, float, np.generic, Expression, Comparison)


class Graph:
    """Maker of expressions.  The same operation on the same nodes is one node, so common terms are computed once."""

    modes = False
    """Whether the sides of conditions are inputs, as they are for a motion."""

    of_numpy = True
    """Whether comparisons in the function may be those of NumPy's numbers."""

    def __init__(self) -> None:
        self._nodes: dict[tuple[Any, ...], Expression] = {}

    def node(self, operation: str, arguments: tuple[Expression, ...] = (), value: Any = None) -> Expression:
        """Return the one node with this content."""
        token = value.hex() if isinstance(value, float) else value
        key = (operation, *map(id, arguments), token)
        if key not in self._nodes:
            self._nodes[key] = Expression(self, operation, arguments, value)
        return self._nodes[key]

    def compare(self, a: Any, b: Any, *, strictly: bool) -> Any:
        """Return the comparison a > b, or a >= b; here there is none."""
        raise UntraceableError("the value of a state variable, of time or of a parameter decides a branch")

    def equal(self, a: Any, b: Any, *, inverted: bool = False) -> Any:
        """Return whether two expressions are equal: neither is less than the other."""
        factors = [self.compare(*pair, strictly=False) for pair in ((a, b), (b, a))]
        return Both(*factors, inverted=inverted)

    def number(self, expression: Expression, refusal: UntraceableError) -> float:
        """Return the value of an expression; here there is none."""
        raise refusal

    def constant(self, value: float) -> Expression:
        """Return a literal number."""
        return self.node("constant", value=float(value))

    def lift(self, value: Any) -> Expression:
        """Turn a number into a constant and leave an expression as it is."""
        if isinstance(value, Expression):
            return value
        if isinstance(value, Comparison):
            return value.number()
        if isinstance(value, np.ndarray) and value.ndim == 0:
            return self.lift(value.item())
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
            case ("select", [float(sign), _, _]):
                return arguments[1] if sign > 0.0 else arguments[2]
            case ("select", _) if arguments[1] is arguments[2]:
                return arguments[1]
            case ("add", [0.0, None]) | ("mul", [1.0, None]):
                return arguments[1]
            case ("add" | "sub", [None, 0.0]) | ("mul" | "div", [None, 1.0]):
                return arguments[0]
            case ("mod", [None, 1.0]):
                return self.apply("sub", arguments[0], self.apply("floor", arguments[0]))
            case ("mul", [-1.0, None]):
                return self.apply("neg", arguments[1])
            case ("neg", _) if arguments[0].operation == "neg":
                return arguments[0].arguments[0]
        return self.node(operation, arguments)

    def times(self, a: Expression, b: Expression) -> Expression:
        """Multiply; nothing is left of a factor of zero."""
        return self.constant(0.0) if a.vanishes or b.vanishes else self.apply("mul", a, b)

    def dot(self, a: Iterable[Expression], b: Iterable[Expression]) -> Expression:
        """Sum products; nothing is left of those with a factor of zero."""
        products = (self.times(u, v) for u, v in zip(a, b, strict=True))
        return reduce(lambda total, product: self.apply("add", total, product), products, self.constant(0.0))

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
        """Return expressions with some nodes replaced; `apply` rebuilds the nodes, by default unchanged."""
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
            base, whole_number = self._squared(base, abs(int(number)))
            whole = self._whole_power(base, whole_number)
            return whole if number >= 0 else self.apply("div", 1.0, whole)
        if isinstance(number, int | float) and number == 0.5:
            return self.apply("sqrt", base)
        return self.apply("pow", base, exponent)

    def _squared(self, base: Expression, exponent: int) -> tuple[Expression, int]:
        """Return the radicand of a length and half of an even exponent, which has no kink where the length vanishes."""
        if exponent % 2 or not exponent:
            return base, exponent
        if base.operation == "hypot":
            a, b = base.arguments
            return self.apply("add", self.power(a, 2), self.power(b, 2)), exponent // 2
        is_length = base.operation == "sqrt" and _adds_squares(base.arguments[0])
        return (base.arguments[0], exponent // 2) if is_length else (base, exponent)

    def _whole_power(self, base: Expression, exponent: int) -> Expression:
        if exponent == 0:
            return self.constant(1.0)
        if exponent % 2:
            return self.apply("mul", self._whole_power(base, exponent - 1), base)
        half = self._whole_power(base, exponent // 2)
        return self.apply("mul", half, half)


def _adds_squares(e: Expression) -> bool:
    """Tell whether an expression is a square, or a sum of squares."""
    if e.operation == "add":
        return all(map(_adds_squares, e.arguments))
    return e.operation == "mul" and e.arguments[0] is e.arguments[1]


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


@lru_cache(maxsize=8)
def ordered(outputs: tuple[Expression, ...]) -> tuple[Expression, ...]:
    """Return the expressions in order, kept for evaluation again and again."""
    return tuple(in_order(outputs))


def has_series(operation: str) -> bool:
    """Tell whether an operation has a power series wherever it is defined."""
    known = TABLE.get(operation)
    written = operation in ARITHMETIC or operation in {"pow", "select", "defined"}
    return written if known is None else known.domain is not None


def is_analytic(outputs: Sequence[Expression]) -> bool:
    """Tell whether every operation on state or time has a power series."""
    moving: set[Expression] = set()
    for node in in_order(outputs):
        if node.operation in {"state", "time"} or not moving.isdisjoint(node.arguments):
            moving.add(node)
            if node.arguments and not has_series(node.operation):
                return False
            if node.operation == "pow" and node.arguments[1] in moving:
                return False
    return True
