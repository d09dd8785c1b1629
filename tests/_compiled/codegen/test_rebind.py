"""Copies of functions that see other elementary functions."""

from __future__ import annotations

import functools
import math
from math import cos
from typing import Any

import numpy as np
import pytest

from cellmap._compiled.codegen.rebind import rebind

TABLE = {
    "sin": lambda x: ("sin", x),
    "cos": lambda x: ("cos", x),
    "fabs": lambda x: ("fabs", x),
    "atan2": lambda y, x: ("atan2", y, x),
}
HALF = 0.5


def helper(x: float) -> Any:
    return math.sin(x)


def test_functions_of_math_however_they_are_imported() -> None:
    import math as maths
    from math import sin as sine

    assert rebind(lambda x: (math.sin(x), maths.sin(x), sine(x), cos(x)), TABLE)(1.0) == (
        ("sin", 1.0),
        ("sin", 1.0),
        ("sin", 1.0),
        ("cos", 1.0),
    )


def test_synonyms_of_numpy_and_the_built_ins() -> None:
    twin = rebind(lambda x: (np.sin(x), np.abs(x), np.absolute(x), abs(x), np.arctan2(x, 2.0), math.fabs(x)), TABLE)
    assert twin(1.0) == (("sin", 1.0), ("fabs", 1.0), ("fabs", 1.0), ("fabs", 1.0), ("atan2", 1.0, 2.0), ("fabs", 1.0))


def test_what_is_not_in_the_table_stays() -> None:
    assert rebind(lambda x: (math.exp(x), math.pi, HALF, np.pi), TABLE)(0.0) == (1.0, math.pi, 0.5, np.pi)


def test_the_original_is_left_as_it_is() -> None:
    def f(x: float) -> Any:
        return helper(x)

    assert rebind(f, TABLE)(1.0) == ("sin", 1.0)
    assert f(1.0) == helper(1.0) == math.sin(1.0)


def test_helpers_closures_and_defaults_are_copied() -> None:
    def inner(x: float) -> Any:
        return cos(x)

    def f(x: float, g: Any = inner, *, h: Any = inner) -> Any:
        return helper(x), inner(x), g(x), h(x)

    assert rebind(f, TABLE)(1.0) == (("sin", 1.0), ("cos", 1.0), ("cos", 1.0), ("cos", 1.0))


def test_nested_functions_and_comprehensions() -> None:
    def f(x: float) -> Any:
        def inside(y: float) -> Any:
            return math.sin(y)

        return [inside(y) for y in (x, 2 * x)], [math.cos(y) for y in (x,)]

    assert rebind(f, TABLE)(1.0) == ([("sin", 1.0), ("sin", 2.0)], [("cos", 1.0)])


def test_partials_methods_and_callable_objects() -> None:
    class Oscillator:
        scale = 3.0

        def rhs(self, x: float) -> Any:
            return self.scale, math.sin(x)

        def __call__(self, x: float) -> Any:
            return self.scale, cos(x)

    assert rebind(functools.partial(lambda a, x: (a, math.sin(x)), 2.0), TABLE)(1.0) == (2.0, ("sin", 1.0))
    assert rebind(Oscillator().rhs, TABLE)(1.0) == (3.0, ("sin", 1.0))
    assert rebind(Oscillator(), TABLE)(1.0) == (3.0, ("cos", 1.0))


def test_compiled_functions_are_copied_from_their_source() -> None:
    from numba import njit

    @njit
    def compiled(x):  # type: ignore[no-untyped-def]
        return math.sin(x)

    assert rebind(lambda x: compiled(x), TABLE)(1.0) == ("sin", 1.0)
    assert rebind(compiled, TABLE)(1.0) == ("sin", 1.0)


def test_a_name_that_shadows_a_function_of_math_is_not_replaced() -> None:
    def sin(x: float) -> Any:
        return ("mine", x)

    assert rebind(lambda x: sin(x), TABLE)(1.0) == ("mine", 1.0)


def countdown(n: int, x: float) -> Any:
    return math.sin(x) if n == 0 else countdown(n - 1, x)


def test_a_function_may_call_itself() -> None:
    assert rebind(countdown, TABLE)(3, 1.0) == ("sin", 1.0)


def test_each_copy_is_finished_innermost_first() -> None:
    finished: list[str] = []

    def finish(f: Any) -> Any:
        finished.append(f.__name__)
        return f

    def outer(x: float) -> Any:
        return helper(x) + helper(2 * x)

    rebind(outer, {}, finish)
    assert finished == ["helper", "outer"]


@pytest.mark.parametrize("name", ["min", "max", "pow"])
def test_built_ins_by_name(name: str) -> None:
    f = {"min": lambda x: min(x, 1.0), "max": lambda x: max(x, 1.0), "pow": lambda x: pow(x, 1.0)}[name]
    assert rebind(f, {name: lambda a, b: (name, a, b)})(2.0) == (name, 2.0, 1.0)


def test_a_closure_may_call_itself() -> None:
    def down(n: int, x: float) -> Any:
        return cos(x) if n == 0 else down(n - 1, x)

    assert rebind(down, TABLE)(3, 1.0) == ("cos", 1.0)


def test_a_copy_that_calls_itself_calls_its_finished_self() -> None:
    calls: list[int] = []

    def finish(f: Any) -> Any:
        def finished(n: int, x: float) -> Any:
            calls.append(n)
            return f(n, x)

        return finished

    rebind(countdown, TABLE, finish)(2, 1.0)
    assert calls == [2, 1, 0]
