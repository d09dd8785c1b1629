"""The table of elementary functions: each entry in maps, derivatives, series and branches, against mpmath."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest

import cellmap
from cellmap import ForcedSystem, discrete_map, stroboscopic_map
from cellmap._compiled.codegen.branches import BranchingGraph
from cellmap._compiled.codegen.evaluation import evaluated
from cellmap._compiled.codegen.expression import is_analytic
from cellmap._compiled.codegen.functions import TABLE
from cellmap._compiled.codegen.period import compiled_period
from cellmap._compiled.codegen.taylor import taylor_steps
from cellmap._compiled.codegen.trace import empty_trace, trace
from cellmap._compiled.kernels.blocks import LANES
from cellmap.maps import jacobian

EXACT: dict[str, Callable[..., Any]] = {
    "log2": lambda x: mpmath.log(x, 2),
    "exp2": lambda x: mpmath.mpf(2) ** x,
    "cbrt": lambda x: mpmath.sign(x) * mpmath.cbrt(abs(x)),
    "mod": lambda x, y: x % y,
    "fmod": math.fmod,
    "copysign": math.copysign,
    "trunc": math.trunc,
    "heaviside": lambda x, y: float(x > 0),
    **dict.fromkeys(("min", "minimum", "fmin"), min),
    **dict.fromkeys(("max", "maximum", "fmax"), max),
}
OF_TWO = {"min", "max", "minimum", "maximum", "fmin", "fmax", "heaviside", "mod", "fmod", "copysign", "hypot", "atan2"}
ANALYTIC = [name for name, known in TABLE.items() if known.domain is not None]
DIFFERENTIABLE = [name for name, known in TABLE.items() if known.slope is not None]


def exact(name: str) -> Callable[..., Any]:
    return EXACT.get(name) or getattr(mpmath, name)


def function_of(name: str) -> Callable[..., Any]:
    found: Callable[..., Any] = {"min": min, "max": max}.get(name) or getattr(math, name, None) or getattr(np, name)
    return found


def place_in(name: str) -> float:
    low, high = TABLE[name].domain or (-math.inf, math.inf)
    return 0.4 if low < 0.4 < high else max(low, 0.0) + 0.3


@pytest.mark.parametrize("name", TABLE)
def test_values(name: str) -> None:
    places = (place_in(name), -0.7)[: 1 + (name in OF_TWO)]
    image = discrete_map(lambda x, p: (function_of(name)(*x[: len(places)]), x[1]), {}, ("x", "y"))
    assert not image.unknown_formulas
    assert image([places[0], -0.7])[0] == pytest.approx(float(exact(name)(*places)), rel=1e-15)


@pytest.mark.parametrize("name", DIFFERENTIABLE)
def test_derivatives(name: str) -> None:
    place = place_in(name)
    slope = jacobian(discrete_map(lambda x, p: (function_of(name)(x[0]),), {}, ("x",)), [place])[0, 0]
    assert slope == pytest.approx(float(mpmath.diff(exact(name), place)), rel=1e-13)


@pytest.mark.parametrize("name", ANALYTIC)
def test_series(name: str) -> None:
    """Of x' = 2, y' = f(x), z' = f(z) the second is an integral; the third adds products of series."""

    def rhs(t: float, x: Any, p: Any) -> tuple[Any, ...]:
        return 2.0, function_of(name)(x[0]), function_of(name)(x[2])

    traced, place, h = trace(rhs, 3, ()), place_in(name), 0.04
    assert traced.is_analytic
    block = np.repeat(np.array([place, 0.0, place])[None, :, None], LANES, axis=2)
    step = compiled_period(taylor_steps(traced, 14), 3, 0)
    step(block, np.array([1]), 0.0, h, np.zeros(1), np.empty_like(block))
    integral = mpmath.quad(exact(name), [place, place + 2.0 * h]) / 2
    assert block[0, 1, 0] == pytest.approx(float(integral), rel=1e-14)
    solution = mpmath.odefun(lambda t, z: exact(name)(z), 0, place)(h)
    assert block[0, 2, 0] == pytest.approx(float(solution), rel=1e-14)


@pytest.mark.parametrize("name", [*ANALYTIC, "cbrt", "hypot"])
def test_beside_branches_all_have_series(name: str) -> None:
    base, count = empty_trace(2, 0, BranchingGraph(modes=True)), 1 + (name in OF_TWO)
    (twin,) = base.run(lambda t, x, p: (function_of(name)(*x[:count]),), ())()
    low, high = TABLE[name].domain or (-math.inf, math.inf)
    several = [*np.linspace(0.0, 0.2, 5) + place_in(name), -40.0, -0.9, -0.2, -0.001, 0.3, 0.8, 1.3, 300.0]
    places = np.array([place for place in several if low < place < high])
    (sign,) = [s.sign for s in base.graph.switches] or [base.time]
    (seen,) = evaluated([twin], {base.states[0]: places, base.states[1]: 0.5, sign: np.sign(places)})
    assert is_analytic([twin])
    expected = [float(exact(name)(*(u, 0.5)[:count])) for u in places]
    assert seen == pytest.approx(expected, rel=1e-13)


def test_the_error_function_beside_a_branch_is_located_at_its_jump() -> None:
    """x' = 1 - erf(2 (x - 1/4))/2 before x = 1/2 and 2 beyond: an integral, and a straight line."""
    shift = 0.25
    system = ForcedSystem(
        lambda t, x, p: (1.0 - 0.5 * math.erf(2.0 * (x[0] - shift)) if x[0] < 0.5 else 2.0,), {}, 1.0, ("x",)
    )
    image = stroboscopic_map(system, rtol=1e-11, atol=1e-11)([0.0])[0]
    until = mpmath.quad(lambda x: 1 / (1 - mpmath.erf(2 * (x - shift)) / 2), [0, 0.5])
    assert image == pytest.approx(float(0.5 + 2 * (1 - until)), abs=1e-10)


def test_a_new_function_is_written_in_one_place() -> None:
    """The complementary error function is in maps, derivatives, series and typed programs, and in one file."""
    folder = Path(cellmap.__file__).parent
    assert [path.name for path in folder.rglob("*.py") if "erfc" in path.read_text(encoding="utf-8")] == [
        "functions.py"
    ]
