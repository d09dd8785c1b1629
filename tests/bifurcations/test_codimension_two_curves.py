"""Points of codimension two followed in a third parameter, against their conditions in closed form."""

import numpy as np
import pytest
from branch_kinds import BOTH_LEFT, DOUBLING, FOLD, NEIMARK_SACKER, PITCHFORK, POINT
from cases import branch_of

from cellmap import discrete_map
from cellmap.bifurcations import continue_bifurcation, continue_codimension_two

UNIT = (-1.0, 1.0)


def assert_equal(found, expected):
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-11)


def curve_of(exact, start, kind, names, box=(UNIT, UNIT), period=1, step=0.2):
    branch = branch_of(exact, start, names[0], *box[0], period, step=step)
    return continue_bifurcation(branch, branch.of_kind(kind)[0], names[1], *box, step=0.2)


def followed(curve, kind, third, *box, step=0.5):
    point = next(p for p in curve.codimension_two() if p.kind is kind)
    found = continue_codimension_two(curve, point, third, *(box or (UNIT, UNIT, UNIT)), step=step)
    assert found.kind is kind
    assert found.parameters == (*curve.parameters, third)
    assert len(found.values) == len(found.points) == len(found.multipliers)
    return found


def test_cusps_go_through_a_swallowtail():
    """x + a + b x + c x^2 + x^4 has the cusps (a, b, c) = (-3 x^4, 8 x^3, -6 x^2), with a tip where x = 0."""
    exact = discrete_map(
        lambda x, p: (x[0] + p.a + p.b * x[0] + p.c * x[0] ** 2 + x[0] ** 4,), {"a": -0.5, "b": -0.1, "c": -0.4}, ("x",)
    )
    found = followed(curve_of(exact, [-0.8], FOLD, "ab"), POINT.CUSP, "c", UNIT, UNIT, (-1.5, 0.5))
    x = found.points[:, 0]
    assert_equal(found.values, np.stack([-3 * x**4, 8 * x**3, -6 * x**2], axis=-1))
    assert_equal(sorted(x[[0, -1]]), [-0.5, 0.5])
    assert found.ends == BOTH_LEFT
    assert found.orbit(2).params == dict(zip("abc", found.values[2].tolist(), strict=True))


WIDE = (-2.0, 6.0), (-2.0, 4.0)


@pytest.mark.parametrize(
    ("kind", "curve", "trace"),
    [
        (POINT.RESONANCE_1_1, FOLD, 2.0),
        (POINT.RESONANCE_1_2, DOUBLING, -2.0),
        (POINT.RESONANCE_1_3, NEIMARK_SACKER, -1.0),
        (POINT.RESONANCE_1_4, NEIMARK_SACKER, 0.0),
    ],
)
def test_resonances(henon_curves, kind, curve, trace):
    """(y, a - b x - y^2 + R x y): at the fixed point x the trace is (R - 2) x, the determinant b - R x."""
    found = followed(henon_curves[curve], kind, "R", *WIDE, UNIT)
    (a, b, r), x = found.values.T, found.points[:, 0]
    assert_equal(x, trace / (r - 2.0))
    assert_equal(b, 1.0 + r * x)
    assert_equal(a, x + b * x + x**2 - r * x**2)
    assert np.ptp(r) > 1.0
    assert found.ends == BOTH_LEFT


def pair(x, p):
    """Return the image of (y, z) that has the determinant 1 + b + x and the trace 1 + 2 c."""
    size = x[1] ** 2 + x[2] ** 2
    return (1.0 + 2.0 * p.c) * x[1] - (1.0 + p.b + x[0]) * x[2] - size * x[1], x[1]


@pytest.mark.thorough
def test_folds_with_a_pair_end_where_it_meets():
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


@pytest.mark.thorough
def test_degenerate_pitchforks_with_and_without_the_symmetry():
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


def test_what_is_no_point_of_the_curve_or_no_third_parameter_is_refused(henon_curves):
    point = next(p for p in henon_curves[FOLD].codimension_two() if p.kind is POINT.RESONANCE_1_1)
    for kind, name, third, message in (
        (DOUBLING, "R", UNIT, r"point=.*is not on .*codimension_two\(\)"),
        (FOLD, "beta", UNIT, r"parameter='beta': .*\['R'\]"),
        (FOLD, "unknown", UNIT, r"parameter='unknown': .*\['R'\]"),
        (FOLD, "R", (0.4, 1.0), "third=.*present value -0.1"),
    ):
        with pytest.raises(ValueError, match=message):
            continue_codimension_two(henon_curves[kind], point, name, *WIDE, third)
