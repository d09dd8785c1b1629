"""Complex numbers in a traced function: pairs of expressions."""

from __future__ import annotations

import cmath
from collections.abc import Callable
from typing import Any

from .expression import Expression, UntraceableError, leaving_arrays


class ComplexExpression:
    """A complex number whose real and imaginary part are expressions."""

    __slots__ = ("imag", "real")
    __array_ufunc__: Callable[..., Any]  # of the module that knows arrays

    def __init__(self, real: Expression, imag: Expression) -> None:
        self.real, self.imag = real, imag

    def __repr__(self) -> str:
        return f"complex({self.real!r}, {self.imag!r})"

    @property
    def graph(self) -> Any:
        """The graph of both expressions."""
        return self.real.graph

    @property
    def vanishes(self) -> bool:
        """Whether it is the constant zero."""
        return self.real.vanishes and self.imag.vanishes

    def conjugate(self) -> ComplexExpression:
        """Return the number with the other sign of its imaginary part."""
        return ComplexExpression(self.real, -self.imag)

    def lifted(self, other: Any) -> ComplexExpression:
        """Return a complex or real number as a pair on the same graph."""
        return other if isinstance(other, ComplexExpression) else paired(self.graph, other)

    def __add__(self, other: Any) -> ComplexExpression:
        w = self.lifted(other)
        return ComplexExpression(self.real + w.real, self.imag + w.imag)

    def __neg__(self) -> ComplexExpression:
        return ComplexExpression(-self.real, -self.imag)

    def __pos__(self) -> ComplexExpression:
        return self

    def __sub__(self, other: Any) -> ComplexExpression:
        return self + -self.lifted(other)

    def __rsub__(self, other: Any) -> ComplexExpression:
        return -self + other

    def __mul__(self, other: Any) -> ComplexExpression:
        w, g = self.lifted(other), self.graph
        if w.real is self.real and w.imag is -self.imag:  # the square of a size is real
            return self.lifted(w.real * w.real + self.imag * self.imag)
        across = g.apply("add", g.times(self.real, w.imag), g.times(self.imag, w.real))
        return ComplexExpression(g.minus(g.times(self.real, w.real), g.times(self.imag, w.imag)), across)

    __radd__, __rmul__ = __add__, __mul__

    def __truediv__(self, other: Any) -> ComplexExpression:
        w = self.lifted(other)
        if w.imag.vanishes:
            return ComplexExpression(self.real / w.real, self.imag / w.real)
        product, size = self * w.conjugate(), w.real * w.real + w.imag * w.imag
        return ComplexExpression(product.real / size, product.imag / size)

    def __rtruediv__(self, other: Any) -> ComplexExpression:
        return self.lifted(other) / self

    def __pow__(self, exponent: Any) -> ComplexExpression:
        if isinstance(exponent, int | float) and exponent == int(exponent) and abs(exponent) <= 16:
            power = self._whole_power(abs(int(exponent)))
            return power if exponent >= 0 else 1.0 / power
        return exponential(logarithm(self) * exponent)

    def __rpow__(self, base: Any) -> ComplexExpression:
        return exponential(self * (cmath.log(base) if isinstance(base, int | float | complex) else logarithm(base)))

    def _whole_power(self, exponent: int) -> ComplexExpression:
        if exponent == 0:
            return self.lifted(1.0)
        half = self._whole_power(exponent // 2)
        square = half * half if exponent > 1 else half
        return square * self if exponent % 2 else square

    def __abs__(self) -> Any:
        return abs(self.real) if self.imag.vanishes else self.graph.apply("hypot", self.real, self.imag)

    def __eq__(self, other: Any) -> Any:
        w = self.lifted(other)
        return (self.real == w.real) & (self.imag == w.imag)

    def __ne__(self, other: Any) -> Any:
        w = self.lifted(other)
        return (self.real != w.real) | (self.imag != w.imag)

    def __bool__(self) -> bool:
        return bool(self != 0.0)

    __hash__ = object.__hash__

    def __float__(self) -> float:
        raise UntraceableError("a complex number is taken for a real one: take its .real, .imag or abs()")

    __int__ = __complex__ = __float__


for _name in "add radd sub rsub mul rmul truediv rtruediv pow rpow eq ne".split():
    setattr(ComplexExpression, f"__{_name}__", leaving_arrays(getattr(ComplexExpression, f"__{_name}__")))


def paired(graph: Any, value: Any) -> ComplexExpression:
    """Return a number as a pair of expressions."""
    if isinstance(value, Expression):
        return ComplexExpression(value, graph.constant(0.0))
    whole = complex(value)
    return ComplexExpression(graph.constant(whole.real), graph.constant(whole.imag))


def phase(z: Any) -> Any:
    """Return the angle of a number."""
    known = isinstance(z, ComplexExpression | Expression)
    return z.graph.apply("atan2", z.imag, z.real) if known else cmath.phase(z)


def _of_parts(first: str, second: str, third: str, fourth: str, sign: float = 1.0) -> Callable[..., ComplexExpression]:
    """Return the function of a + ib with the real part f1(a) f2(b) and the imaginary part f3(a) f4(b) times a sign."""

    def function(z: ComplexExpression) -> ComplexExpression:
        g = z.graph
        real, imag = (
            g.times(g.apply(of_real, z.real), g.apply(of_imag, z.imag))
            for of_real, of_imag in ((first, second), (third, fourth))
        )
        return ComplexExpression(real, imag if sign > 0.0 else -imag)

    return function


def logarithm(z: Any) -> ComplexExpression:
    """Return the principal value of the logarithm."""
    return ComplexExpression(z.graph.apply("log", abs(z)), phase(z))


exponential = _of_parts("exp", "cos", "exp", "sin")
_sine, _cosine = _of_parts("sin", "cosh", "cos", "sinh"), _of_parts("cos", "cosh", "sin", "sinh", -1.0)
_of_hyperbola = _of_parts("sinh", "cos", "cosh", "sin"), _of_parts("cosh", "cos", "sinh", "sin")

OF_COMPLEX: dict[str, Callable[[ComplexExpression], Any]] = {
    "exp": exponential,
    "log": logarithm,
    "sqrt": lambda z: exponential(0.5 * logarithm(z)),
    "fabs": abs,
    "sin": _sine,
    "cos": _cosine,
    "tan": lambda z: _sine(z) / _cosine(z),
    "sinh": _of_hyperbola[0],
    "cosh": _of_hyperbola[1],
    "tanh": lambda z: _of_hyperbola[0](z) / _of_hyperbola[1](z),
}
"""Functions of complex numbers by their names in :mod:`cmath`."""

Expression.as_complex = lambda self: paired(self.graph, self)
Expression.complex_kinds = (complex, ComplexExpression)
