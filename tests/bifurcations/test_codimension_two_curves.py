"""Points of codimension two followed in a third parameter, against their conditions in closed form."""

from __future__ import annotations

from math import pi, sin
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from test_codimension_two_in_segments import alternating, coupled

from cellmap import PointMap, angle, continue_orbit, discrete_map, periodic_orbit
from cellmap.bifurcations import (
    BifurcationCurve,
    BifurcationKind,
    CodimensionTwoCurve,
    CodimensionTwoKind,
    continue_bifurcation,
    continue_codimension_two,
)

FOLD, DOUBLING = BifurcationKind.FOLD, BifurcationKind.PERIOD_DOUBLING
PITCHFORK, NEIMARK_SACKER = BifurcationKind.PITCHFORK, BifurcationKind.NEIMARK_SACKER
POINT = CodimensionTwoKind
UNIT = (-1.0, 1.0)
EDGES = ("left the intervals", "left the intervals")


def assert_equal(found: Any, expected: Any) -> None:
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-11)


def curve_of(
    exact: PointMap,
    start: list[float],
    kind: BifurcationKind,
    names: str,
    box: Any = (UNIT, UNIT),
    period: int = 1,
    step: float = 0.2,
) -> BifurcationCurve:
    branch = continue_orbit(exact, periodic_orbit(exact, start, period), names[0], *box[0], step=step)
    return continue_bifurcation(branch, branch.of_kind(kind)[0], names[1], *box, step=0.2)


def followed(
    curve: BifurcationCurve, kind: CodimensionTwoKind, third: str, *box: Any, step: float = 0.5
) -> CodimensionTwoCurve:
    point = next(p for p in curve.codimension_two() if p.kind is kind)
    found = continue_codimension_two(curve, point, third, *(box or (UNIT, UNIT, UNIT)), step=step)
    assert found.kind is kind
    assert found.parameters == (*curve.parameters, third)
    assert len(found.values) == len(found.points) == len(found.multipliers)
    return found


def test_cusps_go_through_a_swallowtail() -> None:
    """x + a + b x + c x^2 + x^4 has the cusps (a, b, c) = (-3 x^4, 8 x^3, -6 x^2), with a tip where x = 0."""
    exact = discrete_map(
        lambda x, p: (x[0] + p.a + p.b * x[0] + p.c * x[0] ** 2 + x[0] ** 4,), {"a": -0.5, "b": -0.1, "c": -0.4}, ("x",)
    )
    found = followed(curve_of(exact, [-0.8], FOLD, "ab"), POINT.CUSP, "c", UNIT, UNIT, (-1.5, 0.5))
    x = found.points[:, 0]
    assert_equal(found.values, np.stack([-3 * x**4, 8 * x**3, -6 * x**2], axis=-1))
    assert_equal(sorted(x[[0, -1]]), [-0.5, 0.5])
    assert found.ends == EDGES
    assert found.orbit(2).params == dict(zip("abc", found.values[2].tolist(), strict=True))


def test_generalised_flips() -> None:
    """f = a + b x + c x^2 - x^3: f' = -1 and f''^2 / 4 + f''' / 6 = 0, so that c - 3 x = 1 or -1."""
    exact = discrete_map(
        lambda x, p: (p.a + p.b * x[0] + p.c * x[0] ** 2 - x[0] ** 3,), {"a": 0.0, "b": -0.5, "c": 0.3}, ("x",)
    )
    found = followed(curve_of(exact, [0.0], DOUBLING, "ba"), POINT.GENERALISED_FLIP, "c", UNIT, UNIT, (0.0, 0.6))
    (b, a, c), x = found.values.T, found.points[:, 0]
    assert_equal(x, (c - np.sign(c - 3 * x)) / 3)
    assert_equal(b, -1 - 2 * c * x + 3 * x**2)
    assert_equal(a, x - b * x - c * x**2 + x**3)
    assert np.ptp(c) > 0.3


WIDE = (-2.0, 6.0), (-2.0, 4.0)


@pytest.fixture(scope="module")
def henon() -> dict[BifurcationKind, BifurcationCurve]:
    """(y, a - b x - y^2 + R x y): at the fixed point x the trace is (R - 2) x, the determinant b - R x."""
    exact = discrete_map(
        lambda x, p: (x[1], p.a - p.b * x[0] - x[1] ** 2 + p.R * x[0] * x[1]),
        {"a": 0.3, "b": 0.99, "R": 0.3},
        ("x", "y"),
    )
    branch = continue_orbit(exact, periodic_orbit(exact, [0.2, 0.2]), "a", *WIDE[0], step=0.2)
    return {b.kind: continue_bifurcation(branch, b, "b", *WIDE, step=0.2) for b in branch.bifurcations}


def assert_resonances(found: CodimensionTwoCurve, trace: float) -> None:
    (a, b, r), x = found.values.T, found.points[:, 0]
    assert_equal(x, trace / (r - 2.0))
    assert_equal(b, 1.0 + r * x)
    assert_equal(a, x + b * x + x**2 - r * x**2)
    assert np.ptp(r) > 1.0
    assert found.ends == EDGES


@pytest.mark.parametrize(
    ("kind", "curve", "trace"),
    [
        (POINT.RESONANCE_1_1, FOLD, 2.0),
        (POINT.RESONANCE_1_2, DOUBLING, -2.0),
        (POINT.RESONANCE_1_3, NEIMARK_SACKER, -1.0),
        (POINT.RESONANCE_1_4, NEIMARK_SACKER, 0.0),
    ],
)
def test_resonances(
    henon: dict[BifurcationKind, BifurcationCurve], kind: CodimensionTwoKind, curve: BifurcationKind, trace: float
) -> None:
    found = followed(henon[curve], kind, "R", *WIDE, UNIT)
    (a, b, r), x = found.values.T, found.points[:, 0]
    assert_equal(x, trace / (r - 2.0))
    assert_equal(b, 1.0 + r * x)
    assert_equal(a, x + b * x + x**2 - r * x**2)
    assert np.ptp(r) > 1.0
    assert found.ends == EDGES


def pair(x: Any, p: Any) -> tuple[Any, Any]:
    """Return the image of (y, z) that has the determinant 1 + b + x and the trace 1 + 2 c."""
    size = x[1] ** 2 + x[2] ** 2
    return (1.0 + 2.0 * p.c) * x[1] - (1.0 + p.b + x[0]) * x[2] - size * x[1], x[1]


def test_folds_with_a_further_multiplier() -> None:
    """x + a + c x - x^3 has folds at c = 3 x^2, a = -2 x^3, and the further multiplier is -1 at b = -x."""
    exact = discrete_map(
        lambda x, p: (x[0] + p.a + p.c * x[0] - x[0] ** 3 + x[1] ** 2, -(1.0 + p.b + x[0]) * x[1] + x[1] ** 3),
        {"a": -0.5, "b": 0.3, "c": 0.5},
        ("x", "y"),
    )
    found = followed(curve_of(exact, [-1.0, 0.0], FOLD, "ab"), POINT.FOLD_FLIP, "c")
    x = found.points[:, 0]
    assert_equal(found.values, np.stack([-2 * x**3, -x, 3 * x**2], axis=-1))
    assert found.ends == EDGES


def test_folds_with_a_pair_end_where_it_meets() -> None:
    exact = discrete_map(
        lambda x, p: (x[0] + p.a + p.c * x[0] - x[0] ** 3 + x[1] ** 2, *pair(x, p)),
        {"a": -0.5, "b": 0.3, "c": 0.3},
        ("x", "y", "z"),
    )
    found = followed(curve_of(exact, [-1.0, 0.0, 0.0], FOLD, "ab"), POINT.FOLD_NEIMARK_SACKER, "c", step=0.1)
    x, c = found.points[:, 0], found.values[:, 2]
    assert_equal(found.values, np.stack([-2 * x**3, -x, 3 * x**2], axis=-1))
    # On both sides of x = 0 the trace comes to 2 at c = 1/2.
    assert found.ends == ("multipliers met on the real axis",) * 2
    assert ((c[[0, -1]] > 0.49) & (c < 0.5).all()).all()
    np.testing.assert_allclose(np.sort(np.abs(found.multipliers), axis=1), 1.0, atol=1e-9)


def test_period_doublings_with_a_pair() -> None:
    """a - (1 + c) x + x^2 - x^3 has the multiplier -1 where c = 2 x - 3 x^2."""
    exact = discrete_map(
        lambda x, p: (p.a - (1.0 + p.c) * x[0] + x[0] ** 2 - x[0] ** 3 + x[1] ** 2, *pair(x, p)),
        {"a": 0.1, "b": -0.3, "c": -0.1},
        ("x", "y", "z"),
    )
    curve = curve_of(exact, [0.0, 0.0, 0.0], DOUBLING, "cb", ((-0.6, 0.4), UNIT))
    found = followed(curve, POINT.FLIP_NEIMARK_SACKER, "a", (-0.6, 0.4), UNIT, (-0.2, 0.5))
    (c, b, a), x = found.values.T, found.points[:, 0]
    assert_equal(b, -x)
    assert_equal(c, 2 * x - 3 * x**2)
    assert_equal(a, 2 * x + c * x - x**2 + x**3)


def test_degenerate_pitchforks_with_and_without_the_symmetry() -> None:
    exact = discrete_map(
        lambda x, p: (x[0] + p.a * x[0] + (p.b - p.c**2) * x[0] ** 3 - x[0] ** 5 + p.d,),
        {"a": -0.1, "b": -0.4, "c": 0.3, "d": 0.0},
        ("x",),
    )
    curve = curve_of(exact, [0.0], PITCHFORK, "ab")
    a, b, c = followed(curve, POINT.DEGENERATE_PITCHFORK, "c").values.T
    assert_equal(b, c**2)
    assert_equal(a, 0.0)
    broken = followed(curve, POINT.DEGENERATE_PITCHFORK, "d")
    assert_equal(broken.values, [[0.0, 0.09, 0.0]])
    assert broken.ends == ("symmetry broken", "symmetry broken")


def test_chenciner_points() -> None:
    """r -> r (1 + a + (b - c^2) r^2 - r^4), with an angle 1 + 0.6 c, in coordinates that are bent and moved."""

    def image(x: Any, p: Any) -> tuple[Any, Any]:
        u = x[0] - p.c / 4
        v = x[1] + 0.7 * u**2 - 0.3 * u**3
        size = u**2 + v**2
        growth, turn = 1.0 + p.a + (p.b - p.c**2) * size - size**2, 1.0 + 0.6 * p.c
        u, v = growth * (np.cos(turn) * u - np.sin(turn) * v), growth * (np.sin(turn) * u + np.cos(turn) * v)
        return u + p.c / 4, v - 0.7 * u**2 + 0.3 * u**3

    exact = discrete_map(image, {"a": -0.1, "b": -0.2, "c": 0.2}, ("x", "y"))
    found = followed(curve_of(exact, [0.05, 0.0], NEIMARK_SACKER, "ab"), POINT.CHENCINER, "c", UNIT, UNIT, (-0.2, 0.4))
    a, b, c = found.values.T
    assert_equal(b, c**2)
    assert_equal(a, 0.0)
    assert found.ends == EDGES


def test_two_pairs_on_the_unit_circle() -> None:
    exact = discrete_map(
        lambda x, p: coupled(x, SimpleNamespace(p=p.p - p.c**2, q=p.q + 0.5 * p.c)),
        {"p": -0.2, "q": -0.3, "c": 0.1},
        ("x", "y", "u", "v"),
    )
    box = (-0.5, 0.4), (-0.5, 0.4)
    found = followed(
        curve_of(exact, [0.0] * 4, NEIMARK_SACKER, "pq", box), POINT.DOUBLE_NEIMARK_SACKER, "c", *box, (-0.5, 0.5)
    )
    p, q, c = found.values.T
    assert_equal(p, c**2)
    assert_equal(q, -0.5 * c)
    np.testing.assert_allclose(np.abs(found.multipliers), 1.0, atol=1e-11)


def test_generalised_flips_beside_a_multiplier_of_1e8() -> None:
    """F(y) = (1 + p) y + (q - r^2) y^3 + y^5 as -F(F(y)), for an orbit in segments."""
    exact = alternating(lambda y, p: (1.0 + p.p) * y + (p.q - p.r**2) * y**3 + y**5, r=0.2)
    curve = curve_of(exact, [0.0, 0.0, 1.0], DOUBLING, "pq", ((-0.4, 0.6), UNIT), 2, 0.1)
    found = followed(curve, POINT.GENERALISED_FLIP, "r", (-0.4, 0.6), UNIT, (-0.5, 0.5))
    assert found._problem.bifurcation.orbits.nodes > 1
    p, q, r = found.values.T
    assert_equal(q, r**2)
    assert_equal(p, 0.0)
    np.testing.assert_allclose(found.multipliers[:, 0].real, 1e8, rtol=1e-9)


def test_what_is_no_point_of_the_curve_or_no_third_parameter_is_refused(
    henon: dict[BifurcationKind, BifurcationCurve],
) -> None:
    curve = henon[FOLD]
    point = next(p for p in curve.codimension_two() if p.kind is POINT.RESONANCE_1_1)
    with pytest.raises(ValueError, match=r"point=.*is not on .*codimension_two\(\)"):
        continue_codimension_two(henon[DOUBLING], point, "R", *WIDE, UNIT)
    for name in ("b", "unknown"):
        with pytest.raises(ValueError, match=rf"parameter='{name}': .*\['R'\]"):
            continue_codimension_two(curve, point, name, *WIDE, UNIT)
    with pytest.raises(ValueError, match=r"third=.*present value 0.3"):
        continue_codimension_two(curve, point, "R", *WIDE, (0.4, 1.0))


def test_cusps_on_a_circle_go_around_it() -> None:
    # w + a sin(x) + b sin(u) with u = 2 x + p vanishes with two derivatives: a cos(x) = -2 b cos(u) and a sin(x) = -4 b
    # sin(u), so that a is from 2 b to 4 b, and x goes around once while u does, and p does backwards.
    b = 0.3
    circle = discrete_map(
        lambda x, p: (x[0] + p.w + p.a * sin(x[0]) + b * sin(2.0 * x[0] + p.p),),
        {"w": -0.3, "a": 0.2, "p": 0.3},
        (angle("x"),),
    )
    branch = continue_orbit(circle, periodic_orbit(circle, [0.3]), "w", -2.0, 2.0)
    fold = branch.of_kind(FOLD)[1]
    folds = continue_bifurcation(branch, fold, "a", (-2.0, 2.0), (0.1, 2.0), step=0.05)
    (cusp,) = folds.codimension_two()
    cusps = continue_codimension_two(folds, cusp, "p", (-2.0, 2.0), (0.1, 2.0), (-2.0, 2.0 * pi), step=0.2)
    (w, a, p), x = cusps.values.T, cusps.points[:, 0]
    u = 2.0 * x + p
    assert np.abs(w + a * np.sin(x) + b * np.sin(u)).max() < 1e-10
    assert np.abs(a * np.cos(x) + 2.0 * b * np.cos(u)).max() < 1e-9
    assert np.abs(a * np.sin(x) + 4.0 * b * np.sin(u)).max() < 1e-8
    assert np.ptp(p) > 2.0 * pi and np.abs(np.diff(x)).max() > pi and cusps.ends == EDGES
