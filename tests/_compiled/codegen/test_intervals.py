"""Intervals in lanes: exact bounds of arithmetic, values of mpmath for functions, and every rounding term needed."""

import ctypes
import math
import re
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import mpmath
import numpy as np
import pytest

from cellmap._compiled.codegen.enclosures import Lanes
from cellmap._compiled.codegen.exact_formulas import enclosable
from cellmap._compiled.codegen.flow_enclosures import flow_text
from cellmap._compiled.codegen.interval_functions import ENCLOSED
from cellmap._compiled.codegen.intervals import LONGEST, ROUNDING, Interval
from cellmap._compiled.codegen.trace import trace
from cellmap._compiled.machine_code import _host, _optimised, machine_code, vector_width

FLAGS = re.compile(r"\b(fast|reassoc|nnan|ninf|nsz|arcp|contract|afn)\b")


def over_intervals(formula: Callable[..., Interval], *arguments: tuple[Any, Any]) -> tuple[Any, Any]:
    """Return midpoints and radii of a formula over intervals, given as midpoints and radii."""
    lanes, columns = Lanes(vector_width(), 0), [np.broadcast_to(a, 64) for pair in arguments for a in pair]
    state = np.array([*columns, np.zeros(64), np.zeros(64)])
    with lanes.boxes() as box:
        given = [lanes.interval(box, 2 * i, 2 * i + 1) for i in range(len(arguments))]
        lanes.store(formula(*given), box, len(columns), len(columns) + 1)
    text = lanes.module("ptr noalias %state, i64 %count, i64 %stride, ptr noalias %p")
    assert not FLAGS.search(text)
    assert not FLAGS.search(str(_optimised(text, *_host())))
    types = [ctypes.c_void_p, ctypes.c_int64, ctypes.c_int64, ctypes.c_void_p]
    code = machine_code(text)
    ctypes.CFUNCTYPE(None, *types)(code.address("enclose"))(state.ctypes.data, 64, 64, None)
    return state[-2], state[-1]


def corners(*arguments: tuple[Any, Any]) -> list[list[tuple[Fraction, ...]]]:
    """Return the corners of boxes, exactly."""
    found = []
    for lane in range(64):
        points: list[tuple[Fraction, ...]] = [()]
        for m, r in arguments:
            middle, radius = (Fraction(float(np.broadcast_to(a, 64)[lane])) for a in (m, r))
            points = [(*p, middle + s * radius) for p in points for s in (-1, 1)]
        found.append(points)
    return found


def worst(formula: Callable[..., Interval], exact: Callable[..., Any], *arguments: tuple[Any, Any]) -> Fraction:
    """Return the largest distance of a value at a corner from the midpoint, divided by the radius."""
    m, r = over_intervals(formula, *arguments)
    ratios = [Fraction(0)]
    for lane, points in enumerate(corners(*arguments)):
        farthest = max(abs(exact(*p) - Fraction(float(m[lane]))) for p in points)
        ratios.append(farthest / Fraction(float(r[lane])) if r[lane] > 0.0 else Fraction(2 if farthest else 0))
    return max(ratios)


rng = np.random.default_rng(0)
WIDE, NEAR, SMALL = (
    (rng.normal(size=64) * s, np.abs(rng.normal(size=64)) * t) for s, t in ((1, 1), (1, 1e-17), (2, 1e-9))
)
AWAY = (np.sign(rng.normal(size=64)) * rng.uniform(2.0, 9.0, 64), rng.uniform(0.0, 1e-16, 64))
NOUGHT = (0.0, np.abs(rng.normal(size=64)))
UNDER = (rng.uniform(1.0, 2.0, 64) * 1e-160, 0.0)


def dot_of(*pairs: Interval) -> Interval:
    return Interval.dot([(pairs[0], pairs[1])] * (LONGEST // 2) + [(pairs[0], -pairs[2])] * (LONGEST // 2))


def exact_dot(a: Fraction, b: Fraction, c: Fraction) -> Fraction:
    return LONGEST // 2 * (a * b - a * c)


CLOSE = (WIDE[0] * (1.0 + 1e-13), NEAR[1])
SUM = (lambda a, b: a + b, lambda a, b: a + b)
PRODUCT = (lambda a, b: a * b, lambda a, b: a * b)
ARITHMETIC: dict[str, tuple[Any, ...]] = {
    "sum": (*SUM, (WIDE[0], 0.0), (rng.normal(size=64), 0.0)),
    "inflation": (*SUM, NOUGHT, (0.0, NEAR[1] * 1e15)),
    "product": (*PRODUCT, (WIDE[0], 0.0), (AWAY[0], 0.0)),
    "underflow": (*PRODUCT, UNDER, (UNDER[0] * 1.1, 0.0)),
    "quotient": (lambda a, b: a / b, lambda a, b: a / b, (WIDE[0], 0.0), (AWAY[0], 0.0)),
    "reciprocal": (lambda a: a + a.code.reciprocal(10), lambda a: a + Fraction(1, 10), (np.zeros(64), 0.0)),
    "dot": (dot_of, exact_dot, (AWAY[0], 0.0), (WIDE[0], 0.0), (CLOSE[0], 0.0)),
}


@pytest.mark.parametrize("name", ARITHMETIC)
def test_each_rounding_term_of_arithmetic_is_needed(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    formula, exact, *arguments = ARITHMETIC[name]
    assert worst(formula, exact, *arguments) <= 1.0
    for other in (set(ROUNDING) & set(ARITHMETIC)) - {name} if name in {"inflation", "underflow", "reciprocal"} else ():
        monkeypatch.setitem(ROUNDING, other, 0.0)  # what others would cover
    monkeypatch.setitem(ROUNDING, name, 0.0)
    assert worst(formula, exact, *arguments) > 1.0


@pytest.mark.parametrize(("first", "second"), [(WIDE, AWAY), (NEAR, NEAR), (SMALL, AWAY)])
def test_arithmetic_encloses_all_corners(first: Any, second: Any) -> None:
    for formula, exact in (SUM, PRODUCT, (lambda a, b: a - b, lambda a, b: a - b)):
        assert worst(formula, exact, first, second) <= 1.0
    assert worst(*ARITHMETIC["quotient"][:2], first, AWAY) <= 1.0
    assert worst(dot_of, exact_dot, first, second, SMALL) <= 1.0


FUNCTIONS = dict.fromkeys(("sin", "cos", "tan"), "sine") | dict.fromkeys(("tanh", "sinh", "cosh"), "hyperbolic")
FUNCTIONS |= {"exp": "exponential", "log": "logarithm", "sqrt": "root", "atan": "arc tangent"}
POINTS = np.concatenate([rng.uniform(-4.0, 4.0, 44), rng.normal(size=10) * 1e-4, rng.normal(size=10) * 100.0])


def distance(name: str, m: Any, r: Any) -> float:
    """Return the largest distance of a function by mpmath from the midpoint of its enclosure, divided by the radius."""
    found, radii = over_intervals(ENCLOSED[name], (m, r))
    ratios = [0.0]
    with mpmath.workdps(50):
        for x, w, y, bound in zip(m, np.broadcast_to(r, 64), found, radii, strict=True):
            if np.isfinite(bound):
                places = [mpmath.mpf(float(x)) + mpmath.mpf(float(w)) * s for s in (-1, -0.7, 0, 0.4, 1)]
                off = max(abs(getattr(mpmath, name)(p) - mpmath.mpf(float(y))) for p in places)
                ratios.append(float(off / mpmath.mpf(float(bound))) if bound else np.inf)
    assert len(ratios) > 30
    return max(ratios)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_functions_are_enclosed_and_their_rounding_terms_are_needed(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    assert FUNCTIONS.keys() == ENCLOSED.keys()
    m = np.abs(POINTS) if name in {"log", "sqrt"} else POINTS
    for r in (0.0, 1e-15, 1e-3 * np.abs(m), 0.3 * np.abs(m)):
        assert distance(name, m, r) <= 1.0, r
    monkeypatch.setitem(ROUNDING, FUNCTIONS[name], 0.0)
    monkeypatch.setitem(ROUNDING, "quotient", 0.0)
    assert distance(name, m, 0.0) > 1.0


@pytest.mark.parametrize("second", [False, True])
def test_no_flag_and_no_function_of_the_c_library_is_in_the_code_of_flows(second: bool) -> None:
    def rhs(t: float, x: Any, p: Any) -> Any:
        return x[1], math.sin(x[0]) * math.cos(t) - math.tanh(x[1]) / (1.0 + math.exp(p.a * x[0]))

    text = flow_text(enclosable(trace(rhs, 2, ("a",))), 1, 2, vector_width(), second)
    optimised = str(_optimised(text, *_host()))
    for code in (text, optimised):
        assert not FLAGS.search(code)
        called = set(re.findall(r"call [^@]*@([\w.]+)", code))
        assert called
        assert all(name.startswith("llvm.") for name in called), called
        assert not any(name.startswith(("llvm.sin", "llvm.cos", "llvm.exp", "llvm.log", "llvm.pow")) for name in called)


def test_constants_of_reductions() -> None:
    from cellmap._compiled.codegen import simd_math as c

    with mpmath.workdps(60):
        assert abs(sum(map(mpmath.mpf, (c.PI_1, c.PI_2, c.PI_3))) - mpmath.pi) < 1e-36
        assert abs(sum(map(mpmath.mpf, (c.LN2_1, c.LN2_2))) - mpmath.log(2)) < 1e-26
        assert abs(mpmath.mpf(1.5707963267948966) + mpmath.mpf(6.123233995736766e-17) - mpmath.pi / 2) < 1e-32
    for part, bits in ((c.PI_1, 33), (c.PI_2, 33), (c.LN2_1, 42)):
        mantissa = Fraction(part).numerator
        assert (mantissa // (mantissa & -mantissa)).bit_length() <= bits


def inverse(a: Interval) -> Interval:
    return 1.0 / a


FAILURES: dict[Any, list[tuple[float, float]]] = {
    inverse: [(0.5, 0.5), (0.0, 0.0)],
    ENCLOSED["log"]: [(1.0, 1.0), (-1.0, 0.0)],
    ENCLOSED["sqrt"]: [(1.0, 1.5)],
    ENCLOSED["exp"]: [(800.0, 0.0), (1.0, 100.0)],
    ENCLOSED["sin"]: [(1e9, 0.0)],
    ENCLOSED["tan"]: [(1.5, 0.1)],
    (lambda a: a * a): [(1e200, 0.0)],
}
FAILED = [(formula, argument) for formula, arguments in FAILURES.items() for argument in arguments]
FAILED += [(formula, argument) for formula in ENCLOSED.values() for argument in ((np.nan, 0.0), (0.5, np.nan))]


@pytest.mark.parametrize(("formula", "argument"), FAILED)
def test_a_failure_stays_one(formula: Any, argument: Any) -> None:
    known = ENCLOSED["sin"], ENCLOSED["tanh"], ENCLOSED["atan"]
    for further in (lambda a: a, *known, inverse, lambda a: a * 0.0):
        m, r = over_intervals(lambda a, f=further: f(formula(a)), argument)
        assert not (np.isfinite(m) & np.isfinite(r)).any()
