"""Elementary functions of expressions: what a traced right-hand side sees in the place of those of :mod:`math`."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from .expression import Comparison, Expression, operation_on_numbers
from .functions import TABLE
from .tables import interpolated

_OF_ANY_NUMBER = {"fmin", "fmax", "hypot"}


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
                if isinstance(argument, np.ndarray) and argument.ndim:
                    return np.vectorize(function, otypes=[object])(*arguments)
            return operation_on_numbers(name)(*arguments)

        return function

    table = {name: make(name) for name in TABLE}
    table["pow"] = lambda base, exponent: base**exponent

    def where(condition: Any, a: Any, b: Any) -> Any:
        return condition.choose(a, b) if isinstance(condition, Comparison) else a if condition else b

    table["clip"] = lambda value, low, high: table["fmin"](table["fmax"](value, low), high)
    table["heaviside"] = lambda value, at_zero: where(value > 0.0, 1.0, where(value < 0.0, 0.0, at_zero))

    def norm(vector: Any) -> Any:
        return table["sqrt"](sum(v * v for v in vector))

    def select(conditions: Any, choices: Any, default: Any = 0.0) -> Any:
        chosen = default
        for condition, choice in reversed(list(zip(conditions, choices, strict=True))):
            chosen = where(condition, choice, chosen)
        return chosen

    def nearest(value: Any, digits: int = 0) -> Any:
        if not isinstance(value, Expression):
            return round(value, digits) if digits else round(value)
        scale = 10.0**digits
        scaled = value * scale
        if value.graph.modes:  # a flow only passes through places where two numbers are as near
            return table["floor"](scaled + 0.5) / scale
        whole = table["floor"](scaled)
        part = scaled - whole
        return (whole + where(part > 0.5, 1.0, where(part < 0.5, 0.0, whole % 2.0))) / scale

    def polynomial(coefficients: Any, value: Any) -> Any:
        return functools.reduce(lambda total, c: total * value + c, coefficients, 0.0)

    def log_of_sum(a: Any, b: Any) -> Any:
        return table["fmax"](a, b) + table["log1p"](table["exp"](-table["fabs"](a - b)))

    table["norm"], table["select"], table["round"] = norm, select, nearest
    table["interp"], table["polyval"], table["logaddexp"], table["fsum"] = interpolated, polynomial, log_of_sum, sum
    table["degrees"] = lambda angle: angle * (180.0 / math.pi)
    table["radians"] = lambda angle: angle * (math.pi / 180.0)
    table["signbit"] = lambda value: where(value < 0.0, 1.0, 0.0)
    table["dist"] = lambda a, b: norm([u - v for u, v in zip(a, b, strict=True)])
    return {**table, "where": where, "float": _Float, "int": _Int}


class _Float(float):
    """What ``float`` is to a traced function: expressions are numbers already."""

    def __new__(cls, value: Any = 0.0) -> Any:
        return value if isinstance(value, Expression | Comparison) else float(value)


class _Int(int):
    """What ``int`` is to a traced function: the whole part of an expression, towards zero."""

    def __new__(cls, value: Any = 0, *base: Any) -> Any:
        return value.graph.apply("trunc", value) if isinstance(value, Expression | Comparison) else int(value, *base)
