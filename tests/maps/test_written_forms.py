"""The table of forms on the page of own systems: each is run, and the table says what becomes of it.

``python tests/maps/test_written_forms.py`` prints the table with the times of this machine.
"""

import functools
import math
import re
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy

from cellmap import ForcedSystem, stroboscopic_map
from cellmap._compiled.codegen.expression import UntraceableError, in_order
from cellmap._compiled.codegen.trace import is_faithful, parameter_record, trace

PAGE = Path(__file__).parents[2] / "docs" / "own-system.md"
ROWS = re.findall(r"^\| `(.+)` \| (formulas|refused) \| (\d+) \| ([\d.]*) \|$", PAGE.read_text("utf-8"), re.MULTILINE)
NAMES, VALUES = ("delta", "gamma", "omega"), (0.15, 0.2, 1.0)
TUPLE = "return v, a"
MOST = 1.2
"""Ratio of times up to which a form costs what the same formulas as tuples do; the page names those beyond."""

AS_TUPLES = {
    "return v, a * np.outer(x, x)[0, 1]": "return v, a * (q * v)",
    "return v, a * np.prod(x)": "return v, a * (q * v)",
    "return v, a + np.mean(x)": "return v, a + (q + v) / 2.0",
    "return v, a - np.linalg.norm(x)": "return v, a - math.sqrt(q * q + v * v)",
    "return v, a * abs(q + 1j * v) ** 2": "return v, a * (q * q + v * v)",
    "return v, np.polyval([-1.0, 0.0, 1.0, 0.0], q)": "return v, (-q * q + 1.0) * q",
    "return np.linalg.inv(np.diag([2.0, 4.0])) @ [2 * v, 4 * a]": "return 0.5 * (2 * v), 0.25 * (4 * a)",
    "return v, sum(c * q**k for k, c in enumerate((0.0, 1.0, 0.0, -1.0)))": "return v, q - q**3",
    "return v, np.interp(q, [-2.0, 0.0, 2.0], [-2.0, 0.0, 2.0])": "return v, min(max(q, -2.0), 2.0)",
    "return v, a - q * spline(q)": "return v, a - q * (q**3 if q > 0.0 else -(q**3))",
    "return v, scipy.special.erf(q)": "return v, math.erf(q)",
    "return v, scipy.special.expit(q)": "return v, 1.0 / (1.0 + math.exp(-q))",
    "return np.clip([v, a], -9.0, 9.0)": "return max(min(v, 9.0), -9.0), max(min(a, 9.0), -9.0)",
    "return np.where(np.array(x) > 9.0, 0.0, [v, a])": "return 0.0 if q > 9.0 else v, 0.0 if v > 9.0 else a",
    "dx = np.array([v, a]); dx[dx > 9.0] = 0.0; return dx": "return 0.0 if v > 9.0 else v, 0.0 if a > 9.0 else a",
    "return v, np.maximum(a, -9.0)": "return v, max(a, -9.0)",
    "return v, max(a, -9.0)": "return v, max(a, -9.0)",
    "return np.linalg.solve([[2.0, q], [q, 3.0]], [v, a])": (
        "d = 6.0 - q * q; return (3.0 * v - q * a) / d, (2.0 * a - q * v) / d"
    ),
    "return v, math.gamma(3.0 + math.sin(q))": "return v, math.exp(3.0 + math.sin(q))",
}
"""The same formulas as tuples, of forms that do not have those of the first row; of one without formulas, others."""


def function_of(body: str) -> Any:
    """Return the right-hand side of a row, with the acceleration written out by a helper."""
    text = f"def rhs(t, x, p):\n    q, v = x\n    a = acceleration(t, x, p)\n    {body}"
    scope = {"np": np, "math": math, "scipy": scipy, "M0": np.eye(2), "acceleration": acceleration, "model": Model()}
    scope |= {"functools": functools, "B": np.array([[0.0, 1.0], [1.0, -0.15]])}
    scope["spline"] = scipy.interpolate.CubicSpline([-1.0, 0.0, 1.0], [1.0, 0.0, 1.0], bc_type=((1, -3.0), (1, 3.0)))
    exec(text, scope)
    return scope["rhs"]


def acceleration(t: float, x: Any, p: Any) -> Any:
    return x[0] - x[0] ** 3 - p.delta * x[1] + p.gamma * math.cos(p.omega * t)


class Model:
    def spring(self, q: Any) -> Any:
        return q - np.power(q, 3)

    def rhs(self, t: float, x: Any, p: Any) -> Any:
        return x[1], self.spring(x[0]) - p.delta * x[1] + p.gamma * np.cos(p.omega * t)


def verdict_of(body: str) -> tuple[str, int, int]:
    """Return what becomes of a form, the milliseconds until that is known, and the number of operations."""
    rhs, began = function_of(body), time.process_time()
    try:
        traced = trace(rhs, 2, NAMES)
        known = is_faithful(traced, rhs, VALUES, parameter_record(NAMES)(*VALUES))
        operations = sum(bool(node.arguments) for node in in_order(traced.outputs))
    except UntraceableError:
        known, operations = False, 0
    return "formulas" if known else "refused", math.ceil(1e3 * (time.process_time() - began)), operations


@pytest.mark.parametrize(("body", "verdict", "taken", "ratio"), ROWS)
def test_each_form_of_the_page_has_its_verdict(body: str, verdict: str, taken: str, ratio: str) -> None:
    found, milliseconds, operations = verdict_of(body)
    assert found == verdict and max(milliseconds, int(taken)) < 1000
    if verdict == "formulas" and float(ratio) <= MOST:
        assert operations <= 2 * verdict_of(AS_TUPLES.get(body, TUPLE))[2]  # some cost nothing: those of parameters


def test_there_are_sixty_forms_and_those_that_cost_more_are_named() -> None:
    assert len(ROWS) == 60
    text = PAGE.read_text("utf-8").partition("| form |")[0].rpartition("\n\n")[0]
    dear = [body for body, verdict, _, ratio in ROWS if verdict == "formulas" and float(ratio) > MOST]
    assert all(f"`{body}`" in text for body in dear)


def seconds(body: str) -> float:
    """Return the least time that a map takes for some states; not a number where there is no map."""
    states = np.random.default_rng(0).normal(size=(4096, 2))
    try:
        image = stroboscopic_map(
            ForcedSystem(function_of(body), dict(zip(NAMES, VALUES, strict=True)), 2 * math.pi, ("q", "v"))
        )
    except (TypeError, ValueError):
        return math.nan
    taken = []
    for _ in range(9):
        began = time.process_time()
        image(states)
        taken.append(time.process_time() - began)
    return min(taken)


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    for body, *_ in ROWS:
        verdict, milliseconds, _ = verdict_of(body)
        ratio = seconds(body) / seconds(AS_TUPLES.get(body, TUPLE))
        print(f"| `{body}` | {verdict} | {milliseconds} | {'' if math.isnan(ratio) else format(ratio, '.2f')} |")
