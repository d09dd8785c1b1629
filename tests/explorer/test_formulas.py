"""Typed equations are systems; formulas call what the compiler knows; mistakes are shown where they are."""

import math
from math import cos, pi
from pathlib import Path

import numpy as np
import pytest

import systems
from cellmap import ForcedSystem, PointMap, discrete_map
from cellmap._compiled.codegen.functions import OF_MATH
from cellmap.explorer.equations import typed_file, typed_system
from cellmap.explorer.formulas import IN_NUMPY, LONGEST_TEXT, EquationError

PENDULUM = """
# a pendulum whose pivot is driven, with an abbreviation and a period from a parameter
theta' = omega
omega' = -c*omega - weight*sin(theta)
weight = 1 - a*w**2*cos(w*t)   # effective gravity
angle theta
c = 0.2
a = 1/8
w = 2.0
period = 2*pi/w
"""


def test_typed_equations_are_a_system() -> None:
    system = typed_system(PENDULUM).system
    assert isinstance(system, ForcedSystem)
    assert dict(system.params) == {"c": 0.2, "a": 0.125, "w": 2.0}
    assert [c.is_angle for c in system.axes] == [True, False]
    assert system.length == pytest.approx(pi)
    t, theta, omega = 0.3, 0.7, -1.1
    weight = 1 - 0.5 * cos(2 * t)
    assert system.derivative(t, (theta, omega)) == pytest.approx((omega, -0.2 * omega - weight * np.sin(theta)))
    assert system.with_params(w=4.0).length == pytest.approx(pi / 2)


@pytest.mark.parametrize(
    "text",
    [
        "θ̈ = -c θ̇ - (1 - aω²cos(ωt))·sin(θ)\nc = 0.2\na = 1/8\nω = 2\nperiod = 2π/ω",
        "theta'' = -c theta' - (1 - a w^2 cos(w t)) sin(theta)\nc = 0.2\na = 1/8\nw = 2.0\nperiod = 2pi/w",
        "d²θ/dt² = −c*θ′ − (1 − a*ω**2*cos(ω*t))*sin(θ)\nc = 0.2\na = 1/8\nω = 2\nperiod = 2*pi/ω",
    ],
)
def test_equations_are_typed_as_students_write_them(text: str) -> None:
    system = typed_system(text).system
    assert isinstance(system, ForcedSystem)
    assert [(c.name, c.is_angle) for c in system.axes] == [("theta", True), ("theta'", False)]
    reference = typed_system(PENDULUM).system
    assert isinstance(reference, ForcedSystem)
    for state in ((0.7, -1.1), (-2.0, 0.3)):
        assert system.derivative(0.3, state) == pytest.approx(reference.derivative(0.3, state), rel=1e-14)
    assert typed_system("theta'' = -theta\nperiod = 1").coordinates[0].period is None
    assert typed_system("phi -> phi + 0.3 + sin(phi)/2").coordinates[0].is_angle


def test_equations_are_read_from_a_file(tmp_path: Path) -> None:
    path = tmp_path / "swing.txt"
    path.write_text(PENDULUM, encoding="utf-8")
    explored = typed_file(path)
    assert (explored.name, explored.title) == ("swing", "swing")
    assert repr(explored.system) == repr(typed_system(PENDULUM, "swing").system)
    with pytest.raises(FileNotFoundError):
        typed_file(tmp_path / "none.txt")


def test_typed_images_are_a_map() -> None:
    henon = typed_system("x -> 1 - a*x**2 + y\ny -> b*x\na = 1.4\nb = 0.3").system
    assert isinstance(henon, PointMap)
    assert henon([[0.5, 0.1]]) == pytest.approx(systems.henon_map()([[0.5, 0.1]]))
    assert typed_system("x -> max(0, x) if x < 1 else min(x, 0.5)").system([[0.25]]) == pytest.approx(0.25)


MISTAKES = [
    ("", 1, 1, "no equation"),
    ("x' = v\nv' = -x + \nperiod = 1", 2, None, "no formula"),
    ("x' = -3sin^2(x)\nperiod = 1", 1, 8, r"write  sin\(x\)\^2"),
    ("x' = sin 2x\nperiod = 1", 1, 6, r"write  sin\(2\*x\)"),
    ("x'' = x'(1 - x)\nperiod = 1", 1, 7, "unknown function"),
    ("x -> a x(1 - x)\na = 3", 1, 8, r"x is no function: write  x\*\(1 - x\)"),
    ("x' = cos(2t + w t)*cos(w t)\nw = 2", 1, 1, r"a line such as  period = 2\*pi/w"),
    ("θ̈ = -γθ̇ + φ̇\nγ = 1\nperiod = 1", 1, 1, "phi' is no coordinate"),
    ("x' = 1\nx'' = 2\nperiod = 1", 2, 1, "x has a line already"),
    ("x' -> 2\n", 1, 1, "the image of x has no prime: write  x -> 2"),
    ("# a program\ndef f(x):\n    return x", 2, 1, "this is a program: write equations"),
    ("x' = -x", 1, 1, "period is missing"),
    ("x' = y\nperiod = 1", 1, 1, "y is not defined here"),
    ("x' = 1\nx' = 2\nperiod = 1", 2, 1, "x has a line already"),
    ("x' = a\na = b\nb = 2\nperiod = 1", 2, 1, "write a number"),
    ("x' = p*x\np = q*x\nq = p*t\nperiod = 1", 2, 1, "defined by itself"),
    ("x' = 1/x0\nx0 = 1/0\nperiod = 1", 2, 1, "x0 has no value"),
    ("sin' = 1\nperiod = 1", 1, 1, "sin means something already"),
    ("_x' = 1\nperiod = 1", 1, 1, "begin it with a letter"),
    ("x' = 1\ny -> x\nperiod = 1", 1, 1, "mixed"),
    ("x' = 1\nangle y\nperiod = 1", 2, 1, "y is no coordinate"),
    ("x' = cos(t)\n\nperiod = 3", 3, 1, "give the period"),
    ("what is this?", 1, 1, "write  name' = formula"),
    ("x' = t if x == 1 else 2\nperiod = 1", 1, 11, "compare two numbers"),
    ("x' = 'text'\nperiod = 1", 1, 6, "no formula"),
    ('x\' = "text"\nperiod = 1', 1, 6, "no number"),
    ("x' = 1e999*x\nperiod = 1", 1, 6, "no number"),
    ("x' = " + "(" * 3000 + "x\nperiod = 1", 1, None, "no formula"),
    ("x' = " + "9**" * 40 + "9\nperiod = 1", 1, 1, "rhs fails"),
    ("c = 9**9**9**9\nx' = c*x\nperiod = 1", 1, 1, "c has no value"),
    ("x' = 1\n" * 5000, 1, 1, "at most 10000"),
]


@pytest.mark.parametrize(("text", "line", "column", "message"), MISTAKES)
def test_mistakes_are_shown_where_they_are(text: str, line: int, column: int | None, message: str) -> None:
    with pytest.raises(EquationError, match=message) as found:
        typed_system(text)
    assert found.value.line == line
    assert column in (None, found.value.column)


@pytest.mark.parametrize(
    "formula",
    [
        *("__import__('os').system('true')", "open('/etc/passwd')", "exec('1')", "1; import os", "(lambda: 1)()"),
        *(
            "x.__class__",
            "sin.__self__",
            "p.c",
            "f'{x}'",
            "x[0]",
            "[x for x in (1, 2)]",
            "(y := x)",
            "x and x",
            "x @ x",
        ),
        *("x and x", "sin", "sin(x, *[1])", "max(x, key=sin)", "True", "1j", "x if (x, 1) else 2"),
    ],
)
def test_nothing_but_formulas_is_executed(formula: str) -> None:
    with pytest.raises(EquationError):
        typed_system(f"x' = {formula}\nperiod = 1")


def test_functions_of_math_and_of_numpy() -> None:
    """All in one map, which is compiled once; acosh at c."""
    wanted = "acosh asinh atanh cbrt ceil copysign erf exp2 expm1 fmod log10 log1p log2 pow trunc"
    assert set(wanted.split()) < set(OF_MATH)
    of_two = {"atan2", "copysign", "fmod", "hypot", "pow"}
    functions = [(name, getattr(math, name), 1 + (name in of_two)) for name in sorted(OF_MATH)]
    functions += [(name, getattr(np, name), getattr(np, name).nin) for name in IN_NUMPY]
    state = {"a": 0.7, "b": 0.3, "c": 1.3}
    lines, expected = [f"{name} -> {name}" for name in state], [*state.values()]
    for k, (name, function, count) in enumerate(functions):
        names = "c" if name in ("acosh", "arccosh") else "ab"[:count]
        lines.append(f"f{k} -> {name}({', '.join(names)})")
        expected.append(function(*(state[one] for one in names)))
    typed = typed_system("\n".join(lines)).system
    assert isinstance(typed, PointMap)
    assert not typed.unknown_formulas
    images = typed([*state.values(), *len(functions) * [0.0]])
    np.testing.assert_allclose(images, expected, rtol=1e-15)
    for _, function, count in functions[len(OF_MATH) :]:
        assert not discrete_map(lambda x, p, f=function, n=count: (f(*x[:n]), x[1]), {}, ("x", "y")).unknown_formulas


LONG = [
    *("{n} = 1", "{n}' = 1", "x' = {n}", "x{p} = 1", "x{p} -> 1", "x' = y{p}", "x -> {n}(x)", "x -> sin {n}"),
    *("angle {n}", "x -> x\n{n} = {n}", "x -> {n}(x + 1)", "1{n}", "x -> x.{n}", "x -> '{n}'", "x -> f({w})"),
    *("x -> sin {n}*{n}", "x -> a\na = b + {w}", "x' = 1\nperiod = {n}", "{n} -> 1\n{n} -> 1", "x -> {d}"),
    *("x -> 0x{h}", "x -> 1{d}", "x -> {n}=1", "θ{p} = {g}", "a{n} = {n}\nx' = a{n}", "def {n}", "x -> x[{n}]"),
    *("x -> {n}**{n}", "x -> min({w})", "{w}", "x = {d}e{d}", "x -> 1 if {n}"),
]


@pytest.mark.parametrize("size", [400, pytest.param(5000, marks=pytest.mark.thorough)])
def test_messages_are_short_whatever_is_typed(size: int) -> None:
    """And they say where, and keep what to write."""
    long = {"n": "n" * size, "w": "x + " * (size // 4) + "x", "d": "9" * size, "g": "ω" * size}
    long |= {"h": "f" * size, "p": "'" * min(size, 1000)}
    for text in LONG:
        written = text
        for letter, value in long.items():
            written = written.replace("{" + letter + "}", value)
        with pytest.raises(EquationError, match=r"line \d+, column \d+: .*\w") as found:
            typed_system(written[:LONGEST_TEXT])
        assert len(str(found.value)) < 1000, text
