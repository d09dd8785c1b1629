"""Formulas may call what the compiler knows, by the names of math and of NumPy."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cellmap import PointMap, discrete_map
from cellmap._compiled.codegen.functions import OF_MATH
from cellmap.explorer.equations import typed_system
from cellmap.explorer.formulas import IN_NUMPY

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
