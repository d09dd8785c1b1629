"""Elementary functions of expressions: what a traced right-hand side sees in the place of those of :mod:`math`."""

from __future__ import annotations

import cmath
import functools
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ..._lib.checks import warn_caller
from .complex_numbers import OF_COMPLEX, ComplexExpression, phase
from .expression import Comparison, Expression, UntraceableError, operation_on_numbers
from .functions import TABLE

_OF_ANY_NUMBER = {"min", "max", "hypot"}


def elementary_functions() -> dict[str, Callable[..., Any]]:
    """Return functions by their names in :mod:`math` that build expressions when an argument is one."""
    return {**_KNOWN, **_COMPOSED, "float": _Float, "int": _Int, "complex": _Complex}


def _elementary(name: str) -> Callable[..., Any]:
    def function(*arguments: Any) -> Any:
        if name in _OF_ANY_NUMBER:
            several = tuple(arguments[0]) if len(arguments) == 1 else arguments
            if len(several) != 2:
                return functools.reduce(function, several)
            arguments = several
        for argument in arguments:
            if isinstance(argument, Expression.complex_kinds):
                return _of_complex(name, argument)
            if isinstance(argument, Expression):
                return argument.graph.apply(name, *arguments)
            if isinstance(argument, np.ndarray) and argument.ndim > 0 and name not in _OF_ANY_NUMBER:
                return np.vectorize(function, otypes=[object])(*arguments)
        return operation_on_numbers(name)(*arguments)

    return function


def _of_complex(name: str, z: Any) -> Any:
    """Apply a function to a complex number."""
    of_numbers: dict[str, Callable[..., Any]] = {**vars(cmath), "fabs": abs}
    rules = OF_COMPLEX if isinstance(z, ComplexExpression) else of_numbers
    if name not in rules:
        raise UntraceableError(f"{name} of a complex number has no formula here")
    return rules[name](z)


_KNOWN = {name: _elementary(name) for name in TABLE}


def where(condition: Any, a: Any, b: Any) -> Any:
    """Return a where a condition holds, else b."""
    if not isinstance(condition, Comparison):
        return a if condition else b
    if any(isinstance(v, Expression.complex_kinds) for v in (a, b)):
        return condition.choose(a.real, b.real) + 1j * condition.choose(a.imag, b.imag)
    return condition.choose(a, b)


def sinc(value: Any) -> Any:
    """Return sin(pi x) / (pi x), and one at zero."""
    angle = math.pi * value
    return where(angle == 0.0, 1.0, _KNOWN["sin"](angle) / angle)


def clip(value: Any, low: Any = None, high: Any = None) -> Any:
    """Return a number between two others, either of which may be none."""
    raised = value if low is None else _KNOWN["maximum"](value, low)
    return raised if high is None else _KNOWN["minimum"](raised, high)


def nearest(value: Any, digits: int = 0) -> Any:
    """Return the nearest number of so many digits after the point."""
    if not isinstance(value, Expression):
        return round(value, digits) if digits else round(value)
    scale = 10.0**digits
    scaled = value * scale
    if value.graph.modes:  # a flow only passes through places where two numbers are as near
        return _KNOWN["floor"](scaled + 0.5) / scale
    whole = _KNOWN["floor"](scaled)
    part = scaled - whole
    return (whole + where(part > 0.5, 1.0, where(part < 0.5, 0.0, whole % 2.0))) / scale


def _printed(*_: Any, **__: Any) -> None:
    warn_caller(
        "a print in a function that is compiled shows the few values that are tried while a system or map is made, and "
        "nothing afterwards: trajectory(system, ...) has the values along an orbit, system.derivative(t, x) one"
    )


_COMPOSED: dict[str, Callable[..., Any]] = {
    "round": nearest,
    "print": _printed,
    "fsum": sum,
    "pow": lambda base, exponent: base**exponent,
    "logaddexp": lambda a, b: _KNOWN["maximum"](a, b) + _KNOWN["log1p"](_KNOWN["exp"](-_KNOWN["fabs"](a - b))),
    "expit": lambda a: 1.0 / (1.0 + _KNOWN["exp"](-a)),
    "logit": lambda a: _KNOWN["log"](a / (1.0 - a)),
    "exp10": lambda a: _KNOWN["exp"](math.log(10.0) * a),
    "ndtr": lambda a: 0.5 + 0.5 * _KNOWN["erf"](a / math.sqrt(2.0)),
    "degrees": lambda angle: angle * (180.0 / math.pi),
    "radians": lambda angle: angle * (math.pi / 180.0),
    "phase": phase,
    "polar": lambda z: (abs(z), phase(z)),
    "rect": lambda size, angle: _Complex(size * _KNOWN["cos"](angle), size * _KNOWN["sin"](angle)),
    "signbit": lambda value: where(_KNOWN["copysign"](1.0, value) < 0.0, 1.0, 0.0),
    "dist": lambda a, b: _KNOWN["sqrt"](sum((u - v) * (u - v) for u, v in zip(a, b, strict=True))),
}
"""Functions that are written with elementary ones."""


class _Float(float):
    """What ``float`` is to a traced function: expressions are numbers already."""

    def __new__(cls, value: Any = 0.0) -> Any:
        if isinstance(value, Comparison):
            return value.number()
        return value if isinstance(value, Expression) else float(value)


class _Int(int):
    """What ``int`` is to a traced function: the whole part of an expression, towards zero."""

    def __new__(cls, value: Any = 0, *base: Any) -> Any:
        return value.graph.apply("trunc", value) if isinstance(value, Expression | Comparison) else int(value, *base)


class _Complex(complex):
    """What ``complex`` is to a traced function: a pair, where a part is an expression."""

    def __new__(cls, real: Any = 0.0, imag: Any = 0.0) -> Any:
        if isinstance(real, ComplexExpression) or not any(isinstance(v, Expression) for v in (real, imag)):
            return real if isinstance(real, ComplexExpression) else complex(real, imag)
        return real + 1j * imag
