"""Copies of functions that see other elementary functions."""

import functools
import math
import math as maths
from math import cos
from math import sin as sine
from typing import Any

import numpy as np
import pytest

from cellmap._compiled.codegen.rebind import rebind

TABLE = {
    **{name: lambda x, name=name: (name, x) for name in ("sin", "cos", "fabs")},
    **{name: lambda x, y, name=name: (name, x, y) for name in ("atan2", "min", "max", "pow")},
}
HALF = 0.5


def helper(x: float) -> Any:
    return math.sin(x)


def inner(x: float) -> Any:
    return cos(x)


def outer(x: float, g: Any = inner, *, h: Any = inner) -> Any:
    closure = inner
    return helper(x), (lambda y: closure(y))(x), g(x), h(x)


def nested(x: float) -> Any:
    def inside(y: float) -> Any:
        return math.sin(y)

    return [inside(y) for y in (x, 2 * x)], [math.cos(y) for y in (x,)]


class Oscillator:
    scale = 3.0

    def rhs(self, x: float) -> Any:
        return self.scale, math.sin(x)

    def __call__(self, x: float) -> Any:
        return self.scale, cos(x)


def around(f: Any) -> Any:
    return lambda x: f(x)


def shadowed() -> Any:
    def sin(x: float) -> Any:
        return ("mine", x)

    return lambda x: sin(x)


def countdown(n: int, x: float) -> Any:
    return math.sin(x) if n == 0 else countdown(n - 1, x)


def closed_countdown() -> Any:
    def down(x: float, n: int = 3) -> Any:
        return cos(x) if n == 0 else down(x, n - 1)

    return down


SIN, COS, FABS = (("sin", 1.0), ("cos", 1.0), ("fabs", 1.0))
COPIES: dict[str, tuple[Any, Any]] = {
    "however imported": (lambda x: (math.sin(x), maths.sin(x), sine(x), cos(x)), (SIN, SIN, SIN, COS)),
    "synonyms": (
        lambda x: (np.sin(x), np.abs(x), np.absolute(x), abs(x), np.arctan2(x, 2.0), math.fabs(x)),
        (SIN, FABS, FABS, FABS, ("atan2", 1.0, 2.0), FABS),
    ),
    "built-ins": (
        lambda x: (min(x, 2.0), max(x, 2.0), pow(x, 2.0)),
        (("min", 1.0, 2.0), ("max", 1.0, 2.0), ("pow", 1.0, 2.0)),
    ),
    "not in the table": (lambda x: (math.exp(0 * x), math.pi, HALF, np.pi), (1.0, math.pi, 0.5, np.pi)),
    "helpers and defaults": (outer, (SIN, COS, COS, COS)),
    "a closure": (around(inner), COS),
    "nested functions": (nested, ([("sin", 1.0), ("sin", 2.0)], [COS])),
    "a partial": (functools.partial(lambda a, x: (a, math.sin(x)), 2.0), (2.0, SIN)),
    "a method": (Oscillator().rhs, (3.0, SIN)),
    "an object": (Oscillator(), (3.0, COS)),
    "a name that shadows": (shadowed(), ("mine", 1.0)),
    "one that calls itself": (functools.partial(countdown, 3), SIN),
    "a closure that calls itself": (closed_countdown(), COS),
}


@pytest.mark.parametrize("case", COPIES)
def test_copies_call_what_is_in_the_table(case: str) -> None:
    function, expected = COPIES[case]
    assert rebind(function, TABLE)(1.0) == expected
    assert case != "helpers and defaults" or function(1.0) == (math.sin(1.0), *3 * [math.cos(1.0)])


def test_copies_of_compiled_functions_are_of_what_was_compiled() -> None:
    import numba

    compiled = numba.njit(helper)
    for function in (compiled, lambda x: compiled(x)):
        assert rebind(function, TABLE)(1.0) == SIN


def test_each_copy_is_finished_innermost_first_and_calls_its_finished_self() -> None:
    finished: list[str] = []
    calls: list[int] = []

    def finish(f: Any) -> Any:
        finished.append(f.__name__)
        return lambda *given: calls.append(given[0]) or f(*given)

    rebind(lambda x: helper(x) + helper(2 * x), {}, finish)
    assert finished == ["helper", "<lambda>"]
    rebind(countdown, TABLE, finish)(2, 1.0)
    assert calls == [2, 1, 0]
