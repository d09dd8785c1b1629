"""Formulas may call what the compiler knows, by the names of math and of NumPy."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cellmap import PointMap, discrete_map
from cellmap._compiled.codegen.functions import OF_MATH
from cellmap.explorer.equations import typed_system
from cellmap.explorer.formulas import IN_NUMPY, LONGEST_TEXT, EquationError

OF_TWO = {"atan2", "copysign", "fmod", "hypot", "pow"}
NAMES = sorted(OF_MATH)


def test_there_are_those_that_were_missing() -> None:
    assert set("acosh asinh atanh cbrt ceil copysign erf exp2 expm1 fmod log10 log1p log2 pow trunc".split()) < set(
        NAMES
    )


@pytest.mark.parametrize("name", NAMES)
def test_a_function_of_math(name: str) -> None:
    place = 1.3 if name == "acosh" else 0.7
    arguments = (place, 0.3)[: 1 + (name in OF_TWO)]
    call = f"{name}({', '.join('xy'[: len(arguments)])})"
    point_map = typed_system(f"x -> {call}\ny -> y\n").system
    assert isinstance(point_map, PointMap)
    assert not point_map.unknown_formulas
    assert point_map([place, 0.3])[0] == pytest.approx(getattr(math, name)(*arguments), rel=1e-15)


@pytest.mark.parametrize("name", IN_NUMPY)
def test_a_function_of_numpy(name: str) -> None:
    function, count = getattr(np, name), getattr(np, name).nin
    place = 1.3 if name == "arccosh" else 0.7
    call = f"{name}({', '.join('xy'[:count])})"
    expected = function(*(place, 0.3)[:count])
    typed = typed_system(f"x -> {call}\ny -> y\n").system
    assert isinstance(typed, PointMap)
    assert typed([place, 0.3])[0] == pytest.approx(expected, rel=1e-15)
    traced = discrete_map(lambda x, p: (function(*x[:count]), x[1]), {}, ("x", "y"))
    assert not traced.unknown_formulas


LONG = [
    *(
        "{n} = 1",
        "{n}' = 1",
        "x' = {n}",
        "x{p} = 1",
        "x{p} -> 1",
        "x' = y{p}",
        "x -> {n}(x)",
        "x -> sin {n}",
        "angle {n}",
    ),
    *("x -> x\n{n} = {n}", "x -> {n}(x + 1)", "1{n}", "x -> x.{n}", "x -> '{n}'", "x -> f({w})", "x -> sin {n}*{n}"),
    *(
        "x -> a\na = b + {w}",
        "x' = 1\nperiod = {n}",
        "{n} -> 1\n{n} -> 1",
        "x -> {d}",
        "x -> 0x{h}",
        "x -> 1{d}",
        "x -> {n}=1",
        "θ{p} = {g}",
    ),
    *(
        "a{n} = {n}\nx' = a{n}",
        "def {n}",
        "x -> x[{n}]",
        "x -> {n}**{n}",
        "x -> min({w})",
        "{w}",
        "x = {d}e{d}",
        "x -> 1 if {n}",
    ),
]


@pytest.mark.parametrize("text", LONG)
def test_messages_are_short_whatever_is_typed(text: str) -> None:
    """And they say where, and keep what to write."""
    for size in (400, 9000):
        long = {"n": "n" * size, "w": "x + " * (size // 4) + "x", "d": "9" * size, "g": "ω" * size}
        long |= {"h": "f" * size, "p": "'" * min(size, 1000)}
        written = text
        for letter, value in long.items():
            written = written.replace("{" + letter + "}", value)
        with pytest.raises(EquationError, match=r"line \d+, column \d+: .*\w") as found:
            typed_system(written[:LONGEST_TEXT])
        assert len(str(found.value)) < 1000
