"""Broken symmetries, edges that are not found, resonances at ends of curves, and conditions that hold everywhere."""

from math import cos, pi, sin

import numpy as np
import pytest
from branch_kinds import DEGENERATE, DOUBLING, FOLD, NEIMARK_SACKER, PITCHFORK, POINT, kinds, values
from cases import branch_at_rest, branch_of, curve_of, thorough

from cellmap import ForcedSystem, discrete_map, periodic_orbit, section_map, stroboscopic_map
from cellmap.bifurcations import Criticality, arnold_tongue, connecting_orbits, switch_branch

# Pitchforks, and parameters that keep or break their symmetry.


@pytest.mark.parametrize(
    "broken", [lambda x, p: p.T, thorough(lambda x, p: p.T * x**2), thorough(lambda x, p: p.T * (1.0 - cos(x)))]
)
def test_a_pitchfork_is_one_point_where_a_parameter_breaks_the_symmetry(broken):
    # T alone makes it the cusp of the folds 27 T^2 = 4 q^3; with even terms it is transcritical beside T = 0.
    cubic = discrete_map(
        lambda x, p: (x[0] + p.q * x[0] - x[0] ** 3 + broken(x[0], p),), {"q": -0.25, "T": 0.0}, ("x",)
    )
    curve = curve_of(cubic, [0.0], PITCHFORK, "qT", ((-1.0, 1.0), (-0.3, 0.3)))
    assert curve.ends == ("symmetry broken", "symmetry broken")
    np.testing.assert_allclose(curve.values, [[0.0, 0.0]], atol=1e-12)


# Ends of curves, and conditions along them.


@pytest.mark.parametrize("lower", [0.0, *map(thorough, (1e-14, -1e-3))])
def test_a_curve_ends_at_an_edge_at_which_its_orbits_are_not_isolated(lower):
    # At F = 0 and q = 0 every state is a fixed point; for all other F the fold is at q = 0.
    parabola = discrete_map(lambda x, p: (x[0] + p.q - p.F * x[0] ** 2,), {"q": 0.25, "F": 1.0}, ("x",))
    curve = curve_of(parabola, [0.5], FOLD, "qF", ((-1.0, 1.0), (lower, 3.0)))
    assert curve.values[:, 1].min() >= lower and curve.values[:, 1].max() == 3.0
    assert len(curve.values) < 200
    np.testing.assert_allclose(curve.values[:, 0], 0.0, atol=1e-12)


def test_conditions_that_hold_along_a_curve_are_named_once():
    # The square of the map is a product of maps of one variable: multipliers are +-i all along the curve.
    shifted = discrete_map(
        lambda x, p: (-(1.0 + p.q) * (1.0 + p.s) * x[1] + x[1] ** 3, x[0]), {"q": -0.1, "s": 0.0}, ("x", "y")
    )
    curve = curve_of(shifted, [0.0, 0.0], NEIMARK_SACKER, "qs", ((-0.3, 0.3), (-0.2, 0.2)), step=0.1)
    assert curve.codimension_two() == () and curve.degeneracies() == {POINT.RESONANCE_1_4}


# Manifolds that coincide.


def test_one_branch_of_manifolds_that_coincides_is_named():
    # McMillan's map, perturbed in the half-plane of one of its two homoclinic loops.
    exact = discrete_map(
        lambda x, p: (x[1], -x[0] + 2.0 * p.mu * x[1] / (1.0 + x[1] ** 2) + p.e * max(x[1], 0.0) ** 3),
        {"mu": 1.5, "e": 1e-3},
        ("x", "y"),
    )
    with pytest.warns(UserWarning, match="coincide within 1e-09 rad along 1 of 2 branches"):
        found = connecting_orbits(exact, periodic_orbit(exact, [0.0, 0.0]), max_steps=24)
    assert found and all(orbit.points.min() > -1e-9 and abs(orbit.angle) > 1e-4 for orbit in found)


@pytest.mark.parametrize(
    ("a", "steps", "bent"), [(1.99, 40, False), thorough(0.5, 40, False), thorough(0.5, 100, True), (1.3, 40, True)]
)
def test_a_curve_of_connecting_orbits_is_named(a, steps, bent):
    # The graph y = h(x) is invariant, and joins the saddles at 0 and 1: every one of its points is on both manifolds.
    def h(x):
        return sin(x) if bent else 0.0 * x

    def image(x, p):
        following = x[0] + p.a * x[0] * (1.0 - x[0])
        return following, 0.5 * (x[1] - h(x[0])) * (1.0 + 3.0 * x[0]) + h(following)

    exact = discrete_map(image, {"a": a}, ("x", "y"))
    one, other = (periodic_orbit(exact, [x, h(x)]) for x in (0.0, 1.0))
    with pytest.raises(ValueError, match="manifolds coincide"):
        connecting_orbits(exact, one, other, max_steps=steps)


def test_a_clockwise_rotation_is_named():
    oscillator = ForcedSystem(
        lambda t, x, p: (x[1], -x[0] + (1.0 - x[0] ** 2) * x[1] + p.F * cos(p.w * t)),
        {"F": 1.0, "w": 2.85},
        period=lambda p: 2.0 * pi / p.w,
        coordinates=("x", "v"),
    )
    exact = stroboscopic_map(oscillator)
    with pytest.raises(ValueError, match=r"clockwise, with the rotation number 0\.666666667: give rotations=period"):
        arnold_tongue(exact, 1, 3, ("w", "F"), (2.6, 3.1), (0.5, 1.5), [1.0, 0.0], transient=200, periods=400)


# Multipliers on the circle, flat folds and families.


@pytest.mark.parametrize("bent", [False, True])
def test_no_branch_leaves_a_flip_at_which_all_orbits_double(bent):
    # x -> -q x, also in the coordinate y = x + x^3: at q = 1 every point returns after two steps.
    exact = discrete_map(lambda x, p: (-p.q * x[0], 0.5 * x[1] + (x[0] ** 3 if bent else 0.0)), {"q": 0.5}, ("x", "y"))
    branch = branch_at_rest(exact, "q", 0.0, 1.5)
    assert kinds(branch) == [DOUBLING]
    assert values(branch) == pytest.approx([1.0], abs=1e-12)
    with pytest.raises(ValueError, match="orbits of twice the period fill a curve there"):
        switch_branch(branch, branch.bifurcations[0], 0.0, 1.5)


@pytest.mark.parametrize("power", [4, thorough(8)])
def test_a_flat_fold_is_one_fold_whose_coefficient_is_zero_within_its_error(power):
    """Fixed points of x + q - x^n are q = x^n: one fold at 0 for even n, with the quadratic coefficient 0."""
    flat = discrete_map(lambda x, p: (x[0] + p.q - x[0] ** power,), {"q": 0.5}, ("x",))
    branch = branch_of(flat, [0.5 ** (1 / power)], "q", -1.0, 0.6)
    assert kinds(branch)[0] is FOLD and not {FOLD, DEGENERATE} & set(kinds(branch)[1:])
    fold = branch.bifurcations[0]
    assert abs(fold.value) < 1e-15 and {fold.before, fold.after} == {0, 1}
    assert fold.normal_form.criticality is Criticality.DEGENERATE
    assert abs(fold.normal_form.coefficient) < fold.normal_form.error < 1e-8


@pytest.mark.thorough
def test_an_inflection_is_no_fold_and_a_weakly_curved_fold_keeps_its_digits():
    """Fixed points of x + q - x^3 are q = x^3, which grows throughout; those of x + q - 1e-6 x^2 - x^4 have a fold."""
    cubic = discrete_map(lambda x, p: (x[0] + p.q - x[0] ** 3,), {"q": 0.3}, ("x",))
    assert branch_of(cubic, [0.3 ** (1 / 3)], "q", -0.5, 0.5).bifurcations == ()
    flat = discrete_map(lambda x, p: (x[0] + p.q - 1e-6 * x[0] ** 2 - x[0] ** 4,), {"q": 0.1}, ("x",))
    form = branch_of(flat, [0.1**0.25], "q", -0.1, 0.2).bifurcations[0].normal_form
    assert form.criticality is Criticality.GENERIC and abs(form.coefficient + 1e-6) <= 3 * form.error < 1e-14


def test_a_family_of_conservative_orbits_has_no_folds():
    """Without damping (d = 0) all orbits of an oscillator are periodic, and rounding decides how d moves along them."""
    free = ForcedSystem(lambda t, x, p: (x[1], -x[0] - x[0] ** 3 + p.d * x[1]), {"d": 0.0}, 2.0, ("x", "v"))
    until = {"top": lambda t, x, p: 0.5 * x[0] ** 2 + 0.25 * x[0] ** 4 + 0.5 * x[1] ** 2 - 6.0}
    section = section_map(free, ("v", 0.0, -1))
    family = branch_of(section, [1.0], "d", -0.1, 0.1, step=0.1, max_points=8, until=until)
    assert family.is_family and family.bifurcations == () and float(np.abs(family.values).max()) < 1e-13
    # The energy of x = 2 at rest is 6.
    assert "top" in family.ends and family.points.max() == pytest.approx(2.0, abs=1e-12)
    assert family.points.min() < 0.3
