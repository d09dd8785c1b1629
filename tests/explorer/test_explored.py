"""What the explorer offers: every reference system, typed equations, and nothing that others have to load."""

from __future__ import annotations

import inspect
import json
import re
import subprocess
import sys
from math import cos, pi
from pathlib import Path
from typing import get_type_hints

import numpy as np
import pytest
from matplotlib.colors import to_rgb

import systems
from cellmap import ForcedSystem, PointMap
from cellmap.explorer import Explored, ExploredScene
from cellmap.explorer.equations import typed_file, typed_system
from cellmap.explorer.explored import load_gallery
from cellmap.explorer.formulas import EquationError
from cellmap.explorer.protocol import LOWEST, pixels
from cellmap.explorer.server import PAGE
from cellmap.explorer.view import SCHEMA, View
from cellmap.plot._colours import CODE_COLOURS, COLOURS


def test_the_gallery_offers_every_reference_system() -> None:
    found = set()
    for name in systems.__all__:
        function = getattr(systems, name)
        if not inspect.isfunction(function) or get_type_hints(function).get("return") not in (ForcedSystem, PointMap):
            continue
        if all(a.default is not a.empty for a in inspect.signature(function).parameters.values()):
            found.add(name)
    gallery = [e for e in load_gallery("systems.gallery") if isinstance(e, Explored)]
    assert {e.name for e in gallery} == found
    for explored in gallery:
        first = View.first(explored)
        assert View.of({}, explored).params == first.params
        assert np.prod(first.cells) <= 250_000
        names: dict[str, object] = {}
        exec(explored.source, names)
        assert repr(names["system"]) == repr(explored.system)
    with pytest.raises(ValueError, match="gallery='math': give a module with a list GALLERY"):
        load_gallery("math")


def test_the_scene_has_the_parameters_of_its_parts_alone() -> None:
    (scene,) = (e for e in load_gallery("systems.gallery") if isinstance(e, ExploredScene))
    for body in scene.bodies:
        for effects in ((), scene.effects[:2], *((effect,) for effect in scene.effects)):
            explored = scene.explored((body, *effects))
            assert explored.parts == (body, *effects)
            names: dict[str, object] = {}
            exec(explored.source, names)
            assert repr(names["system"]) == repr(explored.system)
            assert View.of({}, explored).others == View.first(explored).others
            for effect in ("damping", "friction", "stiffness", "torque"):
                has = any(name.startswith(effect) for name in explored.system.params)
                assert has == any(
                    effect in part.replace("spring", "stiffness") for part in effects if "constant" not in part
                )


def test_the_library_loads_no_server() -> None:
    code = """
import sys, cellmap, cellmap.explorer
from cellmap.explorer import Explored, explore
assert not {"starlette", "uvicorn", "websockets", "asyncio", "systems"} & set(sys.modules)
"""
    subprocess.run([sys.executable, "-c", code], check=True)


def test_colours_and_codes_of_the_page_are_those_of_the_figures() -> None:
    text = (PAGE / "colours.js").read_text(encoding="utf-8")
    (listed,) = re.findall(r"const COLOURS = \[(.*?)\]", text, re.DOTALL)
    assert tuple(re.findall(r'"(#\w+)"', listed)) == COLOURS
    codes = {int(code): json.loads(rgb) for code, rgb in re.findall(r'"(-\d)": (\[.*?\])', text)}
    figures = {int(code): [round(255 * part) for part in to_rgb(colour)] for code, colour in CODE_COLOURS.items()}
    assert codes == figures
    assert f"const SCHEMA = {SCHEMA};" in (PAGE / "address.js").read_text(encoding="utf-8")


def test_modules_of_the_page_are_short() -> None:
    for path in PAGE.glob("*.js"):
        assert len(path.read_text(encoding="utf-8").splitlines()) <= 350, path.name


def test_labels_beyond_a_byte_are_sent_in_two() -> None:
    for highest, kind in ((255 + LOWEST, "uint8"), (256 + LOWEST, "uint16")):
        raster = np.array([[LOWEST, highest]], np.int16)
        name, data = pixels(raster)
        assert name == kind
        assert (np.frombuffer(data, kind).astype(int) + LOWEST).tolist() == raster.ravel().tolist()


# --- typed equations

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
        "theta'' = -c theta' - (1 - a omega^2 cos(omega t)) sin(theta)\n"
        "c = 0.2\na = 1/8\nomega = 2.0\nperiod = 2pi/omega",
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
        "__import__('os').system('true')",
        "x.__class__",
        "(lambda: 1)()",
        "[x for x in (1, 2)]",
        "open('/etc/passwd')",
        "exec('1')",
        "f'{x}'",
        "x[0]",
        "(y := x)",
        "sin.__self__",
        "sin(x, *[1])",
        "max(x, key=sin)",
        "x and x",
        "sin",
        "1; import os",
        "x @ x",
        "True",
        "1j",
        "x if (x, 1) else 2",
        "p.c",
    ],
)
def test_nothing_but_formulas_is_executed(formula: str) -> None:
    with pytest.raises(EquationError):
        typed_system(f"x' = {formula}\nperiod = 1")
