"""The table of forms on the page of own systems: each is run, and the table says what becomes of it."""

import math
import re
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy

from cellmap._compiled.codegen.expression import UntraceableError, in_order
from cellmap._compiled.codegen.trace import Trace, is_faithful, parameter_record, trace

PAGE = Path(__file__).parents[2] / "docs" / "own-system.md"
ROWS = re.findall(r"^\| `(.+)` \| (formulas|refused) \| ([\d.]*) \|$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
NAMES, VALUES = ("delta", "gamma", "omega"), (0.15, 0.2, 1.0)
TUPLE = "return v, a"


def function_of(body: str) -> Any:
    """Return the right-hand side of a row, with the acceleration written out by a helper."""
    text = f"def rhs(t, x, p):\n    q, v = x\n    a = acceleration(t, x, p)\n    {body}"
    scope = {"np": np, "math": math, "scipy": scipy, "M0": np.eye(2), "acceleration": acceleration, "model": Model()}
    scope["spline"] = scipy.interpolate.CubicSpline([-2.0, 0.0, 2.0], [-2.0, 0.0, 2.0])
    exec(text, scope)
    return scope["rhs"]


def acceleration(t: float, x: Any, p: Any) -> Any:
    return x[0] - x[0] ** 3 - p.delta * x[1] + p.gamma * math.cos(p.omega * t)


class Model:
    def spring(self, q: Any) -> Any:
        return q - np.power(q, 3)

    def rhs(self, t: float, x: Any, p: Any) -> Any:
        return x[1], self.spring(x[0]) - p.delta * x[1] + p.gamma * np.cos(p.omega * t)


def operations(traced: Trace) -> int:
    return sum(bool(node.arguments) for node in in_order(traced.outputs))


@pytest.mark.parametrize(("body", "verdict", "ratio"), ROWS)
def test_each_form_of_the_page_has_its_verdict(body: str, verdict: str, ratio: str) -> None:
    rhs, began = function_of(body), time.process_time()
    try:
        traced = trace(rhs, 2, NAMES)
    except UntraceableError:
        found = ("refused", "")
    else:
        assert is_faithful(traced, rhs, VALUES, parameter_record(NAMES)(*VALUES))
        found = ("formulas", f"{operations(traced) / operations(trace(function_of(TUPLE), 2, NAMES)):.2f}")
    assert time.process_time() - began < 1.0
    assert found == (verdict, ratio)


def test_there_are_sixty_forms() -> None:
    assert len(ROWS) == 60
