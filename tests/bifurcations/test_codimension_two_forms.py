"""Normal forms of bifurcations of codimension two, against closed forms."""

from cmath import exp
from dataclasses import replace
from math import pi
from typing import Any

import numpy as np
import pytest
from branch_kinds import NEIMARK_SACKER, POINT

from cellmap import discrete_map
from cellmap.bifurcations import CodimensionTwoKind, NewCurve, codimension_two_form
from cellmap.bifurcations.orbit_births import born_curves


def assert_meets(found, expected):
    """Compare coefficients with closed forms, to three of the errors that are stated, which are small."""
    for name, value in expected.items():
        assert abs(found.coefficients[name] - value) <= 3.0 * found.errors[name] <= 1e-11 * (1.0 + abs(value)), name


# Maps that are normal forms, in other coordinates: two shears of the fourth degree, whose inverse is known, and units.
# Coefficients that do not change with coordinates are those of the normal form; with z = sqrt(2) w for complex ones.

P, Q = (0.3, -0.2, 0.15), (-0.25, 0.4, 0.1)
UNITS = 10.0, 10.0


def bend(c, u):
    return u * u * (c[0] + u * (c[1] + u * c[2]))


def seen_elsewhere(form):
    def image(x, p):
        u, y = x[0] / UNITS[0], x[1] / UNITS[1]
        u = u - bend(Q, y)
        u, v = form(u, y - bend(P, u))
        v = v + bend(P, u)
        return UNITS[0] * (u + bend(Q, v)), UNITS[1] * v

    return discrete_map(image, {"s": 0.0}, ("x", "y"))


def times(a, b):
    return a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]


def turned(multiplier, c=0.0, c5=0.0, b2=0.0, b3=0.0):
    """Map z -> mu (z + c z abs(z)^2 + c5 z abs(z)^4 + b2 conj(z)^2 + b3 conj(z)^3)."""

    def form(u, v):
        r, bar = u * u + v * v, (u, -v)
        two = times(bar, bar)
        three = times(two, bar)
        parts = [
            (u, v),
            times((c.real * r, c.imag * r), (u, v)),
            times((c5.real * r * r, c5.imag * r * r), (u, v)),
            times((b2.real, b2.imag), two),
            times((b3.real, b3.imag), three),
        ]
        total = sum(p[0] for p in parts), sum(p[1] for p in parts)
        return times((multiplier.real, multiplier.imag), total)

    return form


ANGLE, THIRD = exp(1.1j), exp(2j * pi / 3)
CASES: list[tuple[CodimensionTwoKind, Any, dict[str, complex], dict[str, int]]] = [
    (POINT.CUSP, lambda u, v: (u + 0.7 * u**3, 0.5 * v), {"c": 0.7}, {"c": 2}),
    (POINT.GENERALISED_FLIP, lambda u, v: (-u + 0.7 * u**5, 0.5 * v), {"e": 0.7}, {"e": 4}),
    (POINT.DEGENERATE_PITCHFORK, lambda u, v: (u - 0.7 * u**5, 0.5 * v), {"e": -0.7}, {"e": 4}),
    (POINT.RESONANCE_1_1, lambda u, v: (u + v, v + 0.7 * u * u - 0.3 * u * v), {"a": 0.7, "b": -0.3}, {"a": 1, "b": 1}),
    (
        POINT.RESONANCE_1_2,
        lambda u, v: (-u + v, -v + 0.7 * u**3 - 0.3 * u * u * v),
        {"c": 0.7, "d": -0.3, "s": 1.8},
        {"c": 2, "d": 2, "s": 2},
    ),
    (POINT.CHENCINER, turned(ANGLE, 0.6j, 0.3 + 0.2j), {"d1": 1.2j, "l2": 1.2 + 0.5 * 1.2**2}, {"d1": 2, "l2": 4}),
    (POINT.RESONANCE_1_3, turned(THIRD, -0.5 + 0.1j, b2=0.4 + 0.3j), {"a": -1.0 - 2.0 * 0.25}, {"a": 2}),
    (POINT.RESONANCE_1_4, turned(1j, -0.5 + 0.1j, b3=0.4 + 0.3j), {"c": -0.2 - 1j, "a": -1.0 + 0.2j}, {"c": 2, "a": 0}),
    (
        POINT.FOLD_FLIP,
        lambda u, v: (u + 0.7 * u * u - 0.4 * v * v, -v + 0.6 * u * v),
        {"a": 0.7, "b": -0.4, "e": 0.6},
        {"a": 1, "b": 1, "e": 1},
    ),
]


@pytest.mark.parametrize(("kind", "form", "expected", "powers"), CASES, ids=[str(c[0]) for c in CASES])
def test_normal_forms_in_other_coordinates(kind, form, expected, powers):
    found = codimension_two_form(seen_elsewhere(form), [0.0, 0.0], kind)
    assert_meets(found, {name: value / UNITS[0] ** powers[name] for name, value in expected.items()})
    assert found.degenerate == ()
    assert found.exact


def test_all_terms_of_three_critical_multipliers():
    def both(x, p):
        r, u = x[0] ** 2 + x[1] ** 2, x[2]
        plane = times((1.0 + 0.2 * u + 0.3 * u * u - 0.4 * r, 0.1 * u + 0.25 * r), (x[0], x[1]))
        return *times((ANGLE.real, ANGLE.imag), plane), p.sign * u + p.a * u * u + p.b * r - 0.6 * u**3 + 0.8 * u * r

    exact = discrete_map(both, {"sign": 1.0, "a": 0.5, "b": -0.7}, ("x", "y", "u"))
    fold = codimension_two_form(exact, [0.0] * 3, POINT.FOLD_NEIMARK_SACKER)
    quadratic = {"a": 0.5, "b": -1.4, "e": ANGLE * (0.2 + 0.1j)}
    assert_meets(fold, quadratic | {"c1": -0.6, "c2": 1.6, "c3": ANGLE * 0.3, "c4": ANGLE * (-0.8 + 0.5j)})
    flip = codimension_two_form(exact.with_params(sign=-1.0, a=0.0, b=0.0), [0.0] * 3, POINT.FLIP_NEIMARK_SACKER)
    # The term u w is not resonant: h = (0.2 + 0.1 i) mu/(-mu - mu) u w, which changes u^2 w only.
    e = ANGLE * (0.2 + 0.1j)
    c = ANGLE * 0.3 - e * e / (2.0 * ANGLE)
    assert_meets(flip, {"a": -0.6, "b": 1.6, "c": c, "d": ANGLE * (-0.8 + 0.5j)})


def test_the_fifth_order_of_a_flip():
    # The second iterate of -x + a2 x^2 - a2^2 x^3 + a4 x^4 + a5 x^5 is x - 2 e x^5, by inserting the series.
    a2, a4, a5 = 0.7, 0.3, -0.4
    exact = discrete_map(
        lambda x, p: (-x[0] + a2 * x[0] ** 2 - a2**2 * x[0] ** 3 + a4 * x[0] ** 4 + a5 * x[0] ** 5,), {"s": 0.0}, ("x",)
    )
    series = np.polynomial.Polynomial([0.0, -1.0, a2, -(a2**2), a4, a5])
    twice = series(series).coef
    assert_meets(codimension_two_form(exact, [0.0], POINT.GENERALISED_FLIP), {"e": -0.5 * float(twice[5])})


# What is not known, and what is not there.


def test_coefficients_that_vanish_are_named():
    exact = discrete_map(lambda x, p: (x[0] + p.s * x[0] ** 3 + x[0] ** 4,), {"s": 0.0}, ("x",))
    assert codimension_two_form(exact, [0.0], POINT.CUSP).degenerate == ("c",)
    shown = repr(codimension_two_form(exact.with_params(s=-1.0), [0.0], POINT.CUSP))
    assert shown.startswith("CodimensionTwoForm(cusp, c=-1 +- ")


def test_nothing_is_said_of_orbits_born_at_degenerate_points():
    found = codimension_two_form(seen_elsewhere(CASES[4][1]), [0.0, 0.0], POINT.RESONANCE_1_2)
    negative = replace(found, coefficients=found.coefficients | {"c": -0.7 + 0j})
    assert born_curves(POINT.RESONANCE_1_2, negative) == (NewCurve(NEIMARK_SACKER, 2),)
    assert born_curves(POINT.RESONANCE_1_2, found) == born_curves(POINT.RESONANCE_1_2, None) == ()
    assert born_curves(POINT.RESONANCE_1_2, replace(negative, degenerate=("s",))) == ()
