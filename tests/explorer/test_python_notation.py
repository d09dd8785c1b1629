"""Equations as programs in Python: what is read, what is refused and where, and that nothing is executed."""

from __future__ import annotations

import ast
import random
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cellmap import ForcedSystem, PointMap
from cellmap.explorer.equations import typed_file, typed_system
from cellmap.explorer.formulas import EquationError
from cellmap.explorer.python_notation import translated

PENDULUM = '''"""A pendulum whose pivot is driven."""
import numpy as np
from math import cos, pi, sin as sine
from cellmap import ForcedSystem, angle

g = -9.8 / 2  # a constant

def weight(t, p):
    """Effective gravity."""
    return 1 - p.a * p.w**2 * cos(p.w * t)

def friction(rate, p):
    if rate > 0.5 and not rate > 3:
        extra = 0.1
    elif -4 < rate < -1:
        extra = -0.1
    else:
        extra = abs(rate) if rate > 7 else np.arctan2(rate, 1)
    return p.c * rate + extra * rate

def rhs(t, x, p) -> tuple:
    theta, omega = x
    total: float = -weight(t, p) * sine(theta) * (g / -4.9)**2
    total -= friction(x[-1], p)
    return omega, total

params = {"c": 0.2, "a": 1 / 8, "w": 2.0}
swing = ForcedSystem(rhs, params, period=lambda p: 2 * np.pi / p.w, coordinates=(angle("theta"), "omega"), name="swing")
'''


def test_a_program_is_the_system_that_python_makes_of_it() -> None:
    explored = typed_system(PENDULUM, "file")
    system = explored.system
    names: dict[str, Any] = {}
    exec(PENDULUM, names)
    expected = names["swing"]
    assert isinstance(system, ForcedSystem)
    assert repr(system) == repr(expected)
    assert [str(c) for c in system.axes] == [str(c) for c in expected.axes]
    for theta, omega in np.random.default_rng(0).uniform(-9, 9, (20, 2)):
        assert system.derivative(0.3, (theta, omega)) == expected.derivative(0.3, (theta, omega))
    assert system.with_params(w=4.0).length == expected.with_params(w=4.0).length
    assert typed_system(explored.source).source == explored.source


def test_arguments_may_have_their_names_alone(tmp_path: Path) -> None:
    path = tmp_path / "spring.py"
    path.write_text("def rhs(t, x, p):\n  q, v = x\n  return v, -q - p.c*v\nparams = {'c': 0.1}\nperiod = 1.5\n")
    spring = typed_file(path)
    assert (spring.title, [c.name for c in spring.coordinates]) == ("spring", ["q", "v"])
    text = "import numpy as np\ndef function(x, p):\n  return np.array([1 - p.a*x[0]**2 + x[1], 0.3*x[0]])\n"
    henon = typed_system(f"{text}params = {{'a': 1.4}}\ncoordinates = ['x', 'y']").system
    assert isinstance(henon, PointMap)
    assert henon([0.5, 0.1]) == pytest.approx([1 - 1.4 * 0.25 + 0.1, 0.15])
    calls = "from cellmap import discrete_map\n"
    assert typed_system(f"{calls}discrete_map(lambda x, p: (x[0]/2,), {{}}, ('x',))").system([1.0]) == pytest.approx(
        [0.5]
    )


BODY = "def rhs(t, x, p):\n  q, v = x\n  {}\n  return v, -q {}\nparams = {{'c': 0.1}}\nperiod = 1.0\n{}"
IN_BODY = [
    "import os", "__import__('os')", "while True: pass", "for i in range(3): q += 1", "global q", "del q", "yield q",
    "try: pass\n  except: pass", "with q: pass", "def f(): return 1", "raise q", "q @= v", "x[0] = 1", "q = w = 1",
    "return", "(q := 1)", "q.a = 1", "rhs = 1", "pi2 += 1", "a, b, c = x", "a, b = q", "match q:\n    case 1: pass",
]  # fmt: skip
IN_FORMULA = [
    "p.__class__", "p.d", "q.real", "x[2]", "x[q]", "x[0:1]", "(lambda: 1)()", "rhs(t, x, p)[0]", "u", "(q and v)",
    "(q if q == 1 else 2)", "sin(q)", "sin", "open('f')", "[y for y in x]", "f'{q}'", "'a'", "1e999", "1j", "True",
    "max(x)", "max(*x)", "max(q, key=v)", "x", "p", "(q, v)", "(q := 1)", "getattr(p, 'c')", "().__class__", "q // 2",
    "~q", "{}", "...",
]  # fmt: skip
AT_THE_END = [
    "import os", "from os import system", "from cellmap import *\nf()", "print(1)", "y = __builtins__",
    "class A: pass", "@rhs\ndef f(a): return a", "f = lambda a=1: a", "if rhs: pass", "rhs = 1", "period = 2.0",
    "a = b = 1", "a, b = 1, 2", "from math import gamma", "import numpy as np\ny = np.load('f')", "async def f(): pass",
]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "line"),
    [(BODY.format(part, "", ""), 3) for part in IN_BODY]
    + [(BODY.format("", f"+ {part}", ""), 4) for part in IN_FORMULA]
    + [(BODY.format("", "", part), None) for part in AT_THE_END],
)
def test_all_else_is_refused_at_its_place(text: str, line: int | None) -> None:
    with pytest.raises(EquationError) as found:
        typed_system(text)
    assert found.value.line >= 7 if line is None else found.value.line == line


@pytest.mark.parametrize(
    ("text", "line", "column", "message"),
    [
        (BODY.format("θθ = 1; w = qq", "", ""), 3, 15, "qq is not defined"),
        (BODY.format("if q > 0: u = 1\n  ", "+ u", ""), 5, 18, "u is not defined"),
        (BODY.format("", "+ cos(t)", "from math import cos"), 6, 1, "give the period"),
        ("def rhs(t, x, p):\n  q, v = x\n  if q > 0:\n    return v, 1\nperiod = 1", 1, 1, "every path"),
        ("def rhs(t, x, p):\n  return x[0]\nperiod = 1\ncoordinates = ('x',)", 1, 1, "returns one number"),
        ("def rhs(t, x, p):\n  q, v = x\n  return v, q\n", 1, 1, "period is missing"),
        ("def f(t, x, p):\n  q, v = x\n  return v, q\n", 1, 1, "no system: add a line"),
        ("def rhs(t, x):\n  q, v = x\n  return v, q\nperiod = 1", 1, 1, "2 arguments and is called with 3"),
        ("def rhs(t, x, p):\n  q, v = x\n  return v, = q\n", 3, None, "no Python"),
        ("from cellmap import ForcedSystem\ns = ForcedSystem(rhs, {}, 1.0, ('q',), switches=3)", 2, None, "takes rhs"),
        (BODY.format("", "+ " + "-" * 3000 + "q", ""), 1, 1, "no Python"),
        ("from math import pi\n" * 600, 1, 1, "at most 10000"),
    ],
)
def test_mistakes_have_a_place_and_a_remedy(text: str, line: int, column: int | None, message: str) -> None:
    with pytest.raises(EquationError, match=message) as found:
        typed_system(text)
    assert found.value.line == line
    assert column in (None, found.value.column)


def test_the_work_of_a_program_is_bounded() -> None:
    """Sixty functions that call the one before twice would take 2^60 calls."""
    text = "def f0(a): return a\n" + "".join(f"def f{k}(a): return f{k - 1}(a) + f{k - 1}(a)\n" for k in range(1, 60))
    with pytest.raises(EquationError, match="more than 5000 operations"):
        typed_system(f"{text}def rhs(t, x, p):\n  q, v = x\n  return v, f59(q)\nperiod = 1")


def test_what_is_written_has_no_other_names() -> None:
    """Programs put together from pieces at random: what is accepted calls nothing but what it defines and math."""
    pieces = [*PENDULUM.split("\n"), *IN_BODY, *IN_FORMULA, *AT_THE_END, "open", "exec", "()", "os", ".", "[0]"]
    events: list[str] = []
    watching = True
    sys.addaudithook(lambda event, _: events.append(event) if watching else None)
    numbers, accepted = random.Random(0), 0
    for _ in range(400):
        lines = PENDULUM.split("\n")
        for _ in range(numbers.randint(1, 3)):
            k = numbers.randrange(len(lines))
            kept = numbers.randint(0, len(lines[k]))
            lines[k] = lines[k][:kept] + numbers.choice(pieces) + lines[k][kept + numbers.randint(0, 4) :]
        try:
            source = translated("\n".join(lines), "mixed").source
        except EquationError:
            continue
        accepted += 1
        tree = ast.parse(source)
        defined = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
        known = defined | {a.name for node in tree.body if isinstance(node, ast.ImportFrom) for a in node.names}
        for node in ast.walk(tree):
            if isinstance(node, ast.Call):
                assert isinstance(node.func, ast.Name) and node.func.id in known | {"abs", "min", "max"}, source
            if isinstance(node, ast.Attribute):
                assert isinstance(node.value, ast.Name) and not node.attr.startswith("_"), source
    watching = False
    assert accepted > 10
    assert not [event for event in events if event.startswith(("os.", "subprocess.", "socket."))]
