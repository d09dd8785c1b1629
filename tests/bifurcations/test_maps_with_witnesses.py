"""Maps and flows whose curves of bifurcations, points of codimension two and coefficients have closed forms."""

from collections.abc import Callable
from dataclasses import dataclass, field
from math import cos, pi, sin, sqrt, tanh
from typing import Any

import mpmath
import numpy as np
import pytest
from branch_kinds import DOUBLING, FOLD, PITCHFORK, POINT
from branch_kinds import NEIMARK_SACKER as TORUS
from cases import branch_of, quick_and_thorough

from cellmap import ForcedSystem, angle, discrete_map, stroboscopic_map
from cellmap.bifurcations import BifurcationKind, CodimensionTwoKind, continue_bifurcation

LEFT, MET = "left the intervals", "multipliers met on the real axis"

Function = Callable[..., Any]


@dataclass(frozen=True)
class Case:
    """A system with two parameters p and q, and what is known of a curve of bifurcations.

    `relation` of p, q and a point of the orbit vanishes on the curve.  A `coefficient` is that of the normal form at
    the first bifurcation on the branch over p, given p and a point.
    """

    function: Function
    start: tuple[float, ...]
    state: tuple[float, ...]
    kind: BifurcationKind
    first: tuple[float, float]
    second: tuple[float, float]
    relation: Function
    coefficient: Function | None = None
    points: dict[CodimensionTwoKind, tuple[float, float]] = field(default_factory=dict)
    forms: dict[str, complex] = field(default_factory=dict)
    ends: tuple[str, str] = (LEFT, LEFT)
    degenerate: frozenset[CodimensionTwoKind] = frozenset()
    flow: bool = False
    angles: bool = False


def with_immigration(x, r, eps):
    """The delayed logistic map: trace r (1 - x), determinant r x; a fold where x = (r - 1)/(2 r)."""
    return r * x[0] * (1 - x[1]) + eps, x[0]


def partly_delayed(x, p):
    """The delay is in a part q: at x = 1 - 1/p, with s = p - 1, the trace is 1 - (1 - q) s, the determinant q s."""
    return p.p * x[0] * (1 - (1 - p.q) * x[0] - p.q * x[1]), x[0]


def turned(x, p):
    size, r = x[0] ** 2 + x[1] ** 2, 0.46 * pi
    grown = 1 + p.p + p.q * size - size**2
    return grown * (cos(r) * x[0] - sin(r) * x[1]), grown * (sin(r) * x[0] + cos(r) * x[1])


def half_turned(t, x, p):
    """u' = p u + q u^3 - u^5 and v' = -v, in a frame that turns by half the circle in a period."""
    c, s = cos(t / 2), sin(t / 2)
    u, v = c * x[0] + s * x[1], c * x[1] - s * x[0]
    du, dv = p.p * u + p.q * u**3 - u**5, -v
    return c * du - s * dv - 0.5 * x[1], s * du + c * dv + 0.5 * x[0]


def spiral(t, x, p):
    """r' = p r - r^3 and theta' = q (1 + cos(t)/2)."""
    growth, rotation = p.p - x[0] ** 2 - x[1] ** 2, p.q * (1 + 0.5 * cos(t))
    return growth * x[0] - rotation * x[1], growth * x[1] + rotation * x[0]


BESSEL = float(mpmath.besseli(0, 2.0)), float(mpmath.besseli(0, 4.0))

CASES = {
    "circle map, doubled": Case(
        lambda x, p: (x[0] + p.q - p.p * sin(x[0]),),
        *((1.5, 0.6), (0.4,), DOUBLING, (1.3, 3.5), (-2.0, 2.0)),
        lambda p, q, x: p**2 - 4 - q**2,
        lambda p, x: 1 / 3 + 0.6**2 / 4,
        angles=True,
    ),
    "neuron": Case(
        lambda x, p: (p.q * tanh(x[0]) + p.p,),
        *((0.0, 2.0), (1.9,), FOLD, (-0.8, 0.8), (0.5, 2.5)),
        lambda p, q, x: q - np.cosh(x) ** 2,
        lambda p, x: -tanh(x[0]),
        {POINT.CUSP: (0.0, 1.0)},
        {"c": -1 / 3},
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
    "Holmes, doubled": Case(
        lambda x, p: (x[1], -p.q * x[0] + p.p * x[1] - x[1] ** 3),
        *((-1.0, 0.3), (0.0, 0.0), DOUBLING, (-2.5, -0.5), (0.0, 1.4)),
        lambda p, q, x, y: p + 1 + q,
        lambda p, x: -1 / (2 * (1 - 0.3)),
        {POINT.RESONANCE_1_2: (-2.0, 1.0)},
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
    "logistic map with a delay of two": Case(
        lambda x, p: (p.p * x[0] * (1 - (1 - p.q) * x[0] - p.q * x[2]), x[0], x[1]),
        *((1.4, 1.0), (0.4 / 1.4,) * 3, TORUS, (1.2, 4.0), (0.3, 1.1)),
        lambda p, q, *x: q * (p - 1) * (1 - (p - 1) * (1 - 2 * q)) - 1,
        None,
        {POINT.FLIP_NEIMARK_SACKER: (3.0, 0.5)},
    ),
    "immigration and period doublings": Case(
        lambda x, p: with_immigration(x, p.p, p.q),
        *((-0.5, 0.625), (0.5, 0.5), DOUBLING, (-3.0, -0.1), (-4.0, 3.0)),
        lambda p, q, x, y: p + 1,
        None,
        {POINT.FOLD_FLIP: (-1.0, 1.0), POINT.RESONANCE_1_2: (-1.0, -3.0)},
        degenerate=frozenset({POINT.GENERALISED_FLIP}),  # at p = -1 all x + y = x y + q are orbits of period 2
    ),
    "logistic map with a partial delay": Case(
        partly_delayed,
        *((2.5, 0.4), (0.6, 0.6), TORUS, (1.2, 8.0), (0.0, 1.2)),
        lambda p, q, x, y: q * (p - 1) - 1,
        None,
        {
            **{POINT.RESONANCE_1_2: (5.0, 1 / 4), POINT.RESONANCE_1_3: (4.0, 1 / 3)},
            **{POINT.RESONANCE_1_4: (3.0, 1 / 2)},
        },
        ends=(LEFT, MET),
    ),
    "Chenciner's normal form": Case(
        turned,
        *((-0.2, 0.33), (0.0, 0.0), TORUS, (-1.0, 1.0), (-1.0, 1.0)),
        lambda p, q, x, y: p,
        None,
        {POINT.CHENCINER: (0.0, 0.0)},
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
        {**{POINT.RESONANCE_1_4: (0.0, 0.25), POINT.RESONANCE_1_3: (0.0, 1 / 3)}, **{POINT.RESONANCE_1_2: (0.0, 0.5)}},
        ends=(LEFT, MET),
        flow=True,
    ),
    "forced cusp": Case(
        lambda t, x, p: (p.p + p.q * (x[0] - sin(t)) - (x[0] - sin(t)) ** 3 + cos(t),),
        *((0.0, 0.3), (sqrt(0.3),), FOLD, (-0.3, 0.3), (-0.2, 0.4)),
        lambda p, q, x: 27 * p**2 - 4 * q**3,
        lambda p, x: -6 * pi * x[0],
        {POINT.CUSP: (0.0, 0.0)},
        {"c": -2 * pi},
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


QUICK = "neuron", "Holmes, doubled", "Kopel", "logistic map with a delay of two", "Chenciner's normal form"
"""One of each kind of curve."""


@pytest.mark.parametrize("name", quick_and_thorough(CASES, QUICK))
def test_a_curve_with_a_closed_form(name):
    case = CASES[name]
    params, names = dict(zip("pq", case.start, strict=True)), tuple("xyz"[: len(case.state)])
    names = (angle("x"),) if case.angles else names
    if case.flow:
        system = ForcedSystem(case.function, params, 2 * pi, names)
        exact = stroboscopic_map(system, rtol=1e-12, atol=1e-12)
    else:
        exact = discrete_map(case.function, params, names)
    branch = branch_of(exact, case.state, "p", *case.first, step=0.1)
    found = branch.of_kind(case.kind)[0]
    assert found.normal_form is not None
    if case.coefficient is not None:
        known = case.coefficient(found.value, found.point)
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
