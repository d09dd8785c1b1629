"""Maps and flows whose curves of bifurcations, points of codimension two and coefficients have closed forms."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import cos, exp, pi, sin, sqrt, tanh
from types import SimpleNamespace
from typing import Any

import mpmath
import numpy as np
import pytest

from cellmap import ForcedSystem, angle, continue_orbit, discrete_map, periodic_orbit, stroboscopic_map
from cellmap.bifurcations import BifurcationKind, CodimensionTwoKind, continue_bifurcation

FOLD, DOUBLING = BifurcationKind.FOLD, BifurcationKind.PERIOD_DOUBLING
PITCHFORK, TORUS = BifurcationKind.PITCHFORK, BifurcationKind.NEIMARK_SACKER
POINT = CodimensionTwoKind
LEFT, MET = "left the intervals", "multipliers met on the real axis"

Function = Callable[..., Any]


@dataclass(frozen=True)
class Case:
    """A system with two parameters p and q, and what is known of a curve of bifurcations.

    `relation` of p, q and a point of the orbit vanishes on the curve.  A `coefficient` is that of the normal form at
    the first bifurcation on the branch over p, given p and a point; "1" for maps of one variable, whose derivatives
    mpmath knows.
    """

    function: Function
    start: tuple[float, ...]
    state: tuple[float, ...]
    kind: BifurcationKind
    first: tuple[float, float]
    second: tuple[float, float]
    relation: Function
    coefficient: Function | str | None = None
    points: dict[CodimensionTwoKind, tuple[float, float]] = field(default_factory=dict)
    forms: dict[str, complex] = field(default_factory=dict)
    ends: tuple[str, str] = (LEFT, LEFT)
    degenerate: frozenset[CodimensionTwoKind] = frozenset()
    flow: bool = False
    angles: bool = False


def in_one_variable(case: Case, value: float, point: float) -> float:
    """Return the coefficient of the normal form of a map of one variable, from derivatives with 30 digits."""

    parameters = SimpleNamespace(p=mpmath.mpf(value), q=mpmath.mpf(case.start[1]))
    with mpmath.workdps(30), pytest.MonkeyPatch.context() as patch:
        for function in (exp, sin, tanh):
            patch.setitem(globals(), function.__name__, getattr(mpmath, function.__name__))
        two, three = (mpmath.diff(lambda x: case.function([x], parameters)[0], point, n) for n in (2, 3))
        both = {FOLD: two / 2, PITCHFORK: three / 6, DOUBLING: three / 6 + two**2 / 4}
    return float(both[case.kind])


def ring(x: Any, p: Any) -> Any:
    return tuple(p.p * x[k] * (1 - x[k]) + p.q * (x[(k + 1) % 3] - x[k]) for k in range(3))


def half_turned(t: float, x: Any, p: Any) -> Any:
    """u' = p u + q u^3 - u^5 and v' = -v, in a frame that turns by half the circle in a period."""
    c, s = cos(t / 2), sin(t / 2)
    u, v = c * x[0] + s * x[1], c * x[1] - s * x[0]
    du, dv = p.p * u + p.q * u**3 - u**5, -v
    return c * du - s * dv - 0.5 * x[1], s * du + c * dv + 0.5 * x[0]


def spiral(t: float, x: Any, p: Any) -> Any:
    """r' = p r - r^3 and theta' = q (1 + cos(t)/2)."""
    growth, rotation = p.p - x[0] ** 2 - x[1] ** 2, p.q * (1 + 0.5 * cos(t))
    return growth * x[0] - rotation * x[1], growth * x[1] + rotation * x[0]


SINE = float(mpmath.findroot(lambda y: mpmath.tan(y) + y, 2.0)) / pi
BESSEL = float(mpmath.besseli(0, 2.0)), float(mpmath.besseli(0, 4.0))

CASES = {
    "Ricker, with immigration": Case(
        lambda x, p: (x[0] * exp(p.p * (1 - x[0])) + p.q,),
        *((1.5, 0.0), (1.0,), DOUBLING, (1.2, 3.0), (-0.02, 0.1)),
        lambda p, q, x: (1 - p * x) * (x - q) + x,
        "1",
    ),
    "cubic, with a bias": Case(
        lambda x, p: (p.p * x[0] * (1 - x[0] ** 2) + p.q,),
        *((1.6, 0.0), (0.6,), DOUBLING, (1.3, 2.6), (-0.1, 0.1)),
        lambda p, q, x: p * (1 - 3 * x * x) + 1,
        "1",
    ),
    "sine": Case(
        lambda x, p: (p.p * sin(pi * x[0]) + p.q,),
        *((0.6, 0.0), (0.55,), DOUBLING, (0.5, 0.9), (-0.05, 0.05)),
        lambda p, q, x: pi * p * np.cos(pi * x) + 1,
        "1",
    ),
    "Gauss": Case(
        lambda x, p: (exp(-p.p * x[0] ** 2) + p.q,),
        *((1.0, 0.0), (0.65,), DOUBLING, (0.7, 2.5), (-0.1, 0.2)),
        lambda p, q, x: 2 * p * x * (x - q) - 1,
        lambda p, x: (4 * p**2 * x[0] ** 2 + 3 / x[0] ** 2) / 12,
    ),
    "Hassell": Case(
        lambda x, p: (p.p * x[0] / (1 + x[0]) ** p.q,),
        *((10.0, 4.0), (0.78,), DOUBLING, (6.0, 30.0), (3.5, 5.0)),
        lambda p, q, x: q * (1 - p ** (-1 / q)) - 2,
        "1",
    ),
    "Maynard Smith and Slatkin": Case(
        lambda x, p: (p.p * x[0] / (1 + x[0] ** p.q),),
        *((2.0, 3.0), (1.0,), DOUBLING, (1.6, 4.0), (2.7, 5.0)),
        lambda p, q, x: q * (1 - 1 / p) - 2,
        "1",
    ),
    "circle map, locked": Case(
        lambda x, p: (x[0] + p.p - p.q * sin(x[0]),),
        *((0.0, 0.9), (0.0,), FOLD, (-2.5, 2.5), (0.3, 1.8)),
        lambda p, q, x: abs(p) - q,
        "1",
        angles=True,
    ),
    "circle map, doubled": Case(
        lambda x, p: (x[0] + p.q - p.p * sin(x[0]),),
        *((1.5, 0.6), (0.4,), DOUBLING, (1.3, 3.5), (-2.0, 2.0)),
        lambda p, q, x: p**2 - 4 - q**2,
        "1",
        angles=True,
    ),
    "neuron": Case(
        lambda x, p: (p.q * tanh(x[0]) + p.p,),
        *((0.0, 2.0), (1.9,), FOLD, (-0.8, 0.8), (0.5, 2.5)),
        lambda p, q, x: q - np.cosh(x) ** 2,
        "1",
        {POINT.CUSP: (0.0, 1.0)},
        {"c": -1 / 3},
    ),
    "Beverton and Holt, harvested": Case(
        lambda x, p: (p.q * x[0] / (1 + x[0]) - p.p,),
        *((0.0, 2.0), (1.0,), FOLD, (-0.2, 1.0), (1.2, 3.0)),
        lambda p, q, x: p - (np.sqrt(q) - 1) ** 2,
        "1",
    ),
    "Allee": Case(
        lambda x, p: (p.p * x[0] ** 2 / (p.q + x[0] ** 2),),
        *((2.5, 1.0), (2.0,), FOLD, (1.0, 3.0), (0.4, 2.0)),
        lambda p, q, x: p**2 - 4 * q,
        "1",
    ),
    "Burgers": Case(
        lambda x, p: (p.q * x[0] - x[1] ** 2, p.p * x[1] + x[0] * x[1]),
        *((1.3, -0.5), (-0.3, sqrt(0.45)), TORUS, (1.2, 1.9), (-2.5, 0.5)),
        lambda p, q, x, y: p - 1.5,
        None,
        {POINT.RESONANCE_1_4: (1.5, -1.0), POINT.RESONANCE_1_3: (1.5, -2.0)},
    ),
    "Tinkerbell": Case(
        lambda x, p: (*(x[0] ** 2 - x[1] ** 2 + 0.9 * x[0] - 0.6 * x[1], 2 * x[0] * x[1] + p.q * x[0] + p.p * x[1]),),
        *((-0.4, 1.5), (0.0, 0.0), TORUS, (-2.5, 1.0), (0.9, 5.0)),
        lambda p, q, x, y: 0.9 * p + 0.6 * q - 1,
        None,
        {POINT.RESONANCE_1_4: (-0.9, 1.81 / 0.6), POINT.RESONANCE_1_3: (-1.9, 2.71 / 0.6)},
    ),
    "Holmes, area preserved": Case(
        lambda x, p: (x[1], -p.p * x[0] + p.q * x[1] - x[1] ** 3),
        *((0.8, 0.5), (0.0, 0.0), TORUS, (0.6, 1.2), (-3.0, 3.0)),
        lambda p, q, x, y: p - 1,
        lambda p, x: 0.0,
        {
            **{POINT.RESONANCE_1_1: (1.0, 2.0), POINT.RESONANCE_1_4: (1.0, 0.0)},
            **{POINT.RESONANCE_1_3: (1.0, -1.0), POINT.RESONANCE_1_2: (1.0, -2.0)},
        },
        ends=(MET, MET),
        degenerate=frozenset({POINT.CHENCINER}),
    ),
    "Holmes, asymmetric": Case(
        lambda x, p: (x[1], -p.q * x[0] + p.p * x[1] - x[1] ** 3),
        *((1.0, 0.3), (0.0, 0.0), PITCHFORK, (0.5, 1.9), (0.0, 0.8)),
        lambda p, q, x, y: p - 1 - q,
        lambda p, x: -1 / (2 * (1 - 0.3)),
    ),
    "Holmes, doubled": Case(
        lambda x, p: (x[1], -p.q * x[0] + p.p * x[1] - x[1] ** 3),
        *((-1.0, 0.3), (0.0, 0.0), DOUBLING, (-2.5, -0.5), (0.0, 1.4)),
        lambda p, q, x, y: p + 1 + q,
        lambda p, x: -1 / (2 * (1 - 0.3)),
        {POINT.RESONANCE_1_2: (-2.0, 1.0)},
    ),
    "coupled logistic maps": Case(
        lambda x, p: (
            p.p * x[0] * (1 - x[0]) + p.q * (x[1] - x[0]),
            p.p * x[1] * (1 - x[1]) + p.q * (x[0] - x[1]),
        ),
        *((2.0, 0.2), (0.5, 0.5), DOUBLING, (1.6, 2.9), (0.1, 0.5)),
        lambda p, q, x, y: p - 3 + 2 * q,
        lambda p, x: p**2 / (p - 1),
    ),
    "Zaslavsky": Case(
        lambda x, p: (
            x[0] + p.q * x[1] + p.p * sin(x[0]),
            p.q * x[1] + p.p * sin(x[0]),
        ),
        *((2.0, 0.3), (pi, 0.0), DOUBLING, (1.5, 4.5), (0.1, 1.2)),
        lambda p, q, x, y: p - 2 * (1 + q),
        lambda p, x: 1.3 / (15 * 0.7),
        {POINT.RESONANCE_1_2: (4.0, 1.0)},
    ),
    "Bogdanov": Case(
        lambda x, p: (
            x[0] + x[1] + p.p * x[1] + p.q * x[0] * (x[0] - 1) - 0.4 * x[0] * x[1],
            x[1] + p.p * x[1] + p.q * x[0] * (x[0] - 1) - 0.4 * x[0] * x[1],
        ),
        *((-0.2, 1.2), (0.0, 0.0), TORUS, (-0.4, 0.3), (0.5, 3.6)),
        lambda p, q, x, y: p,
        None,
        {POINT.RESONANCE_1_4: (0.0, 2.0), POINT.RESONANCE_1_3: (0.0, 3.0)},
    ),
    "Lorenz 1989": Case(
        lambda x, p: ((1 + p.p * p.q) * x[0] - p.q * x[0] * x[1], (1 - p.q) * x[1] + p.q * x[0] ** 2),
        *((0.35, 1.2), (sqrt(0.35), 0.35), TORUS, (0.1, 0.8), (1.0, 3.5)),
        lambda p, q, x, y: 2 * p * q - 1,
        None,
        {POINT.RESONANCE_1_4: (0.25, 2.0), POINT.RESONANCE_1_3: (1 / 6, 3.0)},
    ),
    "Kopel": Case(
        lambda x, p: (
            (1 - p.q) * x[0] + p.q * p.p * x[1] * (1 - x[1]),
            (1 - p.q) * x[1] + p.q * p.p * x[0] * (1 - x[0]),
        ),
        *((2.5, 0.4), (0.6, 0.6), PITCHFORK, (2.2, 3.5), (0.2, 0.7)),
        lambda p, q, x, y: p - 3,
        lambda p, x: -4.5 * 0.4,
    ),
    "ring of logistic maps": Case(
        ring,
        *((2.2, 0.3), (1.2 / 2.2,) * 3, TORUS, (1.3, 3.0), (0.1, 0.9)),
        lambda p, q, *x: (2 - p - 1.5 * q) ** 2 + 0.75 * q**2 - 1,
    ),
    "logistic map with a delay of two": Case(
        lambda x, p: (p.p * x[0] * (1 - (1 - p.q) * x[0] - p.q * x[2]), x[0], x[1]),
        *((1.4, 1.0), (0.4 / 1.4,) * 3, TORUS, (1.2, 4.0), (0.3, 1.1)),
        lambda p, q, *x: q * (p - 1) * (1 - (p - 1) * (1 - 2 * q)) - 1,
        None,
        {POINT.FLIP_NEIMARK_SACKER: (3.0, 0.5)},
    ),
    "Lotka and Volterra, by Euler's method": Case(
        lambda x, p: (
            x[0] + p.q * x[0] * (1 - x[0] - p.p * x[1]),
            x[1] + p.q * x[1] * (p.p * x[0] - 1),
        ),
        *((1.3, 2.0), (1 / 1.3, 0.3 / 1.69), TORUS, (1.15, 1.9), (1.3, 4.0)),
        lambda p, q, x, y: q * (p - 1) - 1,
        None,
        {
            POINT.RESONANCE_1_4: ((1 + sqrt(3)) / 2, 1 + sqrt(3)),
            POINT.RESONANCE_1_3: ((3 + sqrt(21)) / 6, (3 + sqrt(21)) / 2),
        },
    ),
    "Bernoulli": Case(
        lambda t, x, p: ((p.p + cos(t)) * x[0] + p.q * x[0] ** 3 - x[0] ** 5,),
        *((-0.2, -1.0), (0.0,), PITCHFORK, (-0.3, 0.3), (-1.2, 0.6)),
        lambda p, q, x: p,
        lambda p, x: -2 * pi * BESSEL[0],
        {POINT.DEGENERATE_PITCHFORK: (0.0, 0.0)},
        {"e": -2 * pi * BESSEL[1]},
        flow=True,
    ),
    "spiral": Case(
        spiral,
        *((-0.1, 0.2), (0.0, 0.0), TORUS, (-0.15, 0.2), (0.1, 0.7)),
        lambda p, q, x, y: p,
        lambda p, x: -4 * pi,
        {
            **{POINT.RESONANCE_1_4: (0.0, 0.25), POINT.RESONANCE_1_3: (0.0, 1 / 3)},
            **{POINT.RESONANCE_1_2: (0.0, 0.5)},
        },
        ends=(LEFT, MET),
        flow=True,
    ),
    "forced fold": Case(
        lambda t, x, p: (p.p - p.q * (x[0] - sin(t)) ** 2 + cos(t),),
        *((0.25, 1.0), (0.5,), FOLD, (-0.3, 0.5), (0.5, 2.0)),
        lambda p, q, x: p,
        lambda p, x: -2 * pi,
        flow=True,
    ),
    "flow on a Moebius strip": Case(
        half_turned,
        *((-0.2, -0.5), (0.0, 0.0), DOUBLING, (-0.3, 0.3), (-0.7, 0.4)),
        lambda p, q, x, y: p,
        lambda p, x: pi,
        {POINT.GENERALISED_FLIP: (0.0, 0.0)},
        flow=True,
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_a_curve_with_a_closed_form(name: str) -> None:
    case = CASES[name]
    params, names = dict(zip("pq", case.start, strict=True)), tuple("xyz"[: len(case.state)])
    names = (angle("x"),) if case.angles else names
    if case.flow:
        system = ForcedSystem(case.function, params, 2 * pi, names)
        exact = stroboscopic_map(system, rtol=1e-12, atol=1e-12)
    else:
        exact = discrete_map(case.function, params, names)
    branch = continue_orbit(exact, periodic_orbit(exact, case.state), "p", *case.first, step=0.1)
    found = branch.of_kind(case.kind)[0]
    assert found.normal_form is not None
    if case.coefficient is not None:
        one = case.coefficient == "1"
        known = (
            in_one_variable(case, found.value, found.point[0]) if one else case.coefficient(found.value, found.point)
        )
        assert found.normal_form.coefficient == pytest.approx(known, rel=1e-9, abs=1e-12)
    curve = continue_bifurcation(branch, found, "q", case.first, case.second, step=0.1)
    residual = case.relation(*curve.values.T, *curve.points.T)
    np.testing.assert_allclose(residual, 0.0, atol=1e-9)
    assert sorted(curve.ends) == sorted(case.ends)
    points = curve.codimension_two()
    assert {p.kind for p in points} == set(case.points)
    assert len(points) == len(case.points)
    for point in points:
        np.testing.assert_allclose(point.values, case.points[point.kind], atol=1e-9)
        for coefficient, value in case.forms.items():
            assert point.normal_form is not None
            assert point.normal_form.coefficients[coefficient] == pytest.approx(value, rel=1e-8)
    assert curve.degeneracies() == case.degenerate
