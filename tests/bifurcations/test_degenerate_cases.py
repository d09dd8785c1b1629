"""Broken symmetries, edges that are not found, resonances at ends of curves, and conditions that hold everywhere."""

from math import cos, pi, sin, sqrt

import numpy as np
import pytest

from cellmap import (
    ForcedSystem,
    PointMap,
    angle,
    continue_orbit,
    discrete_map,
    periodic_orbit,
    section_map,
    stroboscopic_map,
)
from cellmap.bifurcations import (
    BifurcationCurve,
    BifurcationKind,
    CodimensionTwoKind,
    Criticality,
    arnold_tongue,
    connecting_orbits,
    continue_bifurcation,
    switch_branch,
)

Interval = tuple[float, float]


def curve_of(
    point_map: PointMap,
    guess: list[float],
    first: str,
    second: str,
    box: tuple[Interval, Interval],
    kind: BifurcationKind,
) -> BifurcationCurve:
    branch = continue_orbit(point_map, periodic_orbit(point_map, guess), first, *box[0])
    return continue_bifurcation(branch, branch.of_kind(kind)[0], second, *box)


@pytest.mark.parametrize("broken", [lambda x, p: p.T, lambda x, p: p.T * x**2, lambda x, p: p.T * (1.0 - cos(x))])
def test_a_pitchfork_is_one_point_where_a_parameter_breaks_the_symmetry(broken) -> None:  # type: ignore[no-untyped-def]
    # T alone makes it the cusp of the folds 27 T^2 = 4 q^3; with even terms it is transcritical beside T = 0.
    cubic = discrete_map(
        lambda x, p: (x[0] + p.q * x[0] - x[0] ** 3 + broken(x[0], p),), {"q": -0.25, "T": 0.0}, ("x",)
    )
    curve = curve_of(cubic, [0.0], "q", "T", ((-1.0, 1.0), (-0.3, 0.3)), BifurcationKind.PITCHFORK)
    assert curve.ends == ("symmetry broken", "symmetry broken")
    np.testing.assert_allclose(curve.values, [[0.0, 0.0]], atol=1e-12)


def test_a_pitchfork_is_followed_where_a_parameter_keeps_the_symmetry() -> None:
    cubic = discrete_map(
        lambda x, p: (x[0] + (p.q - p.T**2) * x[0] - x[0] ** 3 + p.T * x[0] ** 5,), {"q": -0.25, "T": 0.0}, ("x",)
    )
    curve = curve_of(cubic, [0.0], "q", "T", ((-1.0, 1.0), (-0.3, 0.3)), BifurcationKind.PITCHFORK)
    assert curve.ends == ("left the intervals", "left the intervals")
    np.testing.assert_allclose(curve.values[:, 0], curve.values[:, 1] ** 2, atol=1e-12)


def test_a_pitchfork_is_followed_where_the_centre_of_its_symmetry_moves() -> None:
    # In y = x - sin(3 e) the map is y (1 + q - e^2) - y^3, odd whatever e, with the pitchfork at q = e^2.
    def step(x, p):  # type: ignore[no-untyped-def]
        y = x[0] - sin(3.0 * p.e)
        return y * (1.0 + p.q - p.e**2) - y**3 + sin(3.0 * p.e), 0.5 * x[1] + p.e

    moved = discrete_map(step, {"q": -0.25, "e": 0.0}, ("x", "y"))
    curve = curve_of(moved, [0.0, 0.0], "q", "e", ((-0.3, 0.3), (-0.1, 0.1)), BifurcationKind.PITCHFORK)
    assert curve.ends == ("left the intervals", "left the intervals")
    q, e = curve.values.T
    assert (e.min(), e.max()) == (-0.1, 0.1)
    np.testing.assert_allclose(q, e**2, atol=1e-10)
    np.testing.assert_allclose(curve.points, np.column_stack([np.sin(3.0 * e), 2.0 * e]), atol=1e-9)


def test_a_constant_torque_ends_a_curve_of_pitchforks_of_the_pendulum() -> None:
    def rhs(t, x, p):  # type: ignore[no-untyped-def]
        theta, omega = x
        return omega, -omega / p.quality - sin(theta) + p.amplitude * cos(p.frequency * t) + p.torque

    pendulum = ForcedSystem(
        rhs,
        {"quality": 2.0, "amplitude": 0.9, "frequency": 2.0 / 3.0, "torque": 0.0},
        period=lambda p: 2.0 * pi / p.frequency,
        coordinates=(angle("theta"), "omega"),
    )
    exact = stroboscopic_map(pendulum)
    box = ((0.9, 1.1), (-0.2, 0.2))
    curve = curve_of(exact, [-0.5, 1.5], "amplitude", "torque", box, BifurcationKind.PITCHFORK)
    assert curve.ends == ("symmetry broken", "symmetry broken") and len(curve.values) == 1
    there = exact.with_params(amplitude=curve.values[0, 0], torque=curve.values[0, 1])
    np.testing.assert_allclose(there(curve.points[0]), curve.points[0], atol=1e-9)


@pytest.mark.parametrize("lower", [0.0, 1e-14, -1e-3])
def test_a_curve_ends_at_an_edge_at_which_its_orbits_are_not_isolated(lower: float) -> None:
    # At F = 0 and q = 0 every state is a fixed point; for all other F the fold is at q = 0.
    parabola = discrete_map(lambda x, p: (x[0] + p.q - p.F * x[0] ** 2,), {"q": 0.25, "F": 1.0}, ("x",))
    curve = curve_of(parabola, [0.5], "q", "F", ((-1.0, 1.0), (lower, 3.0)), BifurcationKind.FOLD)
    assert curve.values[:, 1].min() >= lower and curve.values[:, 1].max() == 3.0
    assert len(curve.values) < 200
    np.testing.assert_allclose(curve.values[:, 0], 0.0, atol=1e-12)


@pytest.mark.parametrize("highest", [7.0, 7.5])
def test_a_resonance_at_the_end_of_a_curve_makes_no_other_point(highest: float) -> None:
    # The Jacobian matrix at (1/d, r (1 - 1/d) - 1) has the determinant r (1 - 2/d) and the trace 2 - r/d: the curve is
    # r = d/(d - 2), with the 1:4 resonance at d = 5/2, r = 5 and the 1:3 resonance at d = 7/3, r = 7.
    prey = discrete_map(
        lambda x, p: (p.r * x[0] * (1.0 - x[0]) - x[0] * x[1], p.d * x[0] * x[1]), {"r": 3.0, "d": 1.8}, ("x", "y")
    )
    box = ((1.5, 4.0), (1.5, highest))
    curve = curve_of(prey, [1.0 / 1.8, 3.0 * (1.0 - 1.0 / 1.8) - 1.0], "d", "r", box, BifurcationKind.NEIMARK_SACKER)
    d, r = curve.values.T
    np.testing.assert_allclose(r, d / (d - 2.0), rtol=1e-9)
    assert {p.kind: tuple(p.values.round(9)) for p in curve.codimension_two()} == {
        CodimensionTwoKind.RESONANCE_1_4: (2.5, 5.0),
        CodimensionTwoKind.RESONANCE_1_3: (round(7.0 / 3.0, 9), 7.0),
    }


def test_conditions_that_hold_along_a_curve_are_named_once() -> None:
    # Both maps square to products of maps of one variable: multipliers are +-i all along the curve.
    duopoly = discrete_map(
        lambda x, p: (sqrt(x[1] / p.a) - x[1], sqrt(x[0] / p.b) - x[0]), {"a": 1.0, "b": 5.0}, ("x", "y")
    )
    curve = curve_of(
        duopoly, [5.0 / 36.0, 1.0 / 36.0], "b", "a", ((4.0, 6.2), (0.8, 1.1)), BifurcationKind.NEIMARK_SACKER
    )
    np.testing.assert_allclose(curve.values[:, 0] / curve.values[:, 1], 3.0 + 2.0 * sqrt(2.0), rtol=1e-12)
    assert curve.codimension_two() == () and CodimensionTwoKind.RESONANCE_1_4 in curve.degeneracies()

    shifted = discrete_map(
        lambda x, p: (-(1.0 + p.q) * (1.0 + p.s) * x[1] + x[1] ** 3, x[0]), {"q": -0.1, "s": 0.0}, ("x", "y")
    )
    curve = curve_of(shifted, [0.0, 0.0], "q", "s", ((-0.3, 0.3), (-0.2, 0.2)), BifurcationKind.NEIMARK_SACKER)
    assert curve.codimension_two() == () and curve.degeneracies() == {CodimensionTwoKind.RESONANCE_1_4}


def test_a_line_of_orbits_is_no_pitchfork() -> None:
    # The adaptive control map: the branch (1, 1, 1 - b - k) meets at k = 0 the fixed points (0, 0, z) for all z.
    control = discrete_map(
        lambda x, p: (
            x[1],
            p.b * x[0] + p.k + x[1] * x[2],
            x[2] - p.k * x[1] / (p.c + x[1] ** 2) * (p.b * x[0] + p.k + x[2] * x[1] - 1.0),
        ),
        {"b": -0.2, "k": 0.5, "c": 0.1},
        ("x", "y", "z"),
    )
    branch = continue_orbit(control, periodic_orbit(control, [1.0, 1.0, 0.7]), "k", -0.5, 1.0)
    (found,) = branch.bifurcations
    assert found.kind is BifurcationKind.DEGENERATE and found.value == pytest.approx(0.0, abs=1e-12)


def test_manifolds_that_coincide_are_named() -> None:
    # McMillan's map is integrable, and its saddle's manifolds are one curve; a perturbation makes them cross.
    mcmillan = discrete_map(
        lambda x, p: (x[1], -x[0] + 2.0 * p.mu * x[1] / (1.0 + x[1] ** 2) + p.e * x[1] ** 3),
        {"mu": 1.5, "e": 0.0},
        ("x", "y"),
    )
    saddle = periodic_orbit(mcmillan, [0.0, 0.0])
    for steps in (24, 30):
        with pytest.raises(ValueError, match="manifolds coincide"):
            connecting_orbits(mcmillan, saddle, max_steps=steps)
    perturbed = mcmillan.with_params(e=1e-6)
    angles = [
        orbit.angle for orbit in connecting_orbits(perturbed, periodic_orbit(perturbed, [0.0, 0.0]), max_steps=24)
    ]
    assert len(angles) == 4 and 1e-7 < min(map(abs, angles)) < max(map(abs, angles)) < 1e-5


@pytest.mark.parametrize(
    ("a", "steps", "bent"), [(0.5, 40, False), (1.99, 40, False), (0.5, 100, True), (1.3, 40, True)]
)
def test_a_curve_of_connecting_orbits_is_named(a: float, steps: int, bent: bool) -> None:
    # The graph y = h(x) is invariant, and joins the saddles at 0 and 1: every one of its points is on both manifolds.
    def h(x):  # type: ignore[no-untyped-def]
        return sin(x) if bent else 0.0 * x

    def image(x, p):  # type: ignore[no-untyped-def]
        following = x[0] + p.a * x[0] * (1.0 - x[0])
        return following, 0.5 * (x[1] - h(x[0])) * (1.0 + 3.0 * x[0]) + h(following)

    exact = discrete_map(image, {"a": a}, ("x", "y"))
    one, other = (periodic_orbit(exact, [x, h(x)]) for x in (0.0, 1.0))
    with pytest.raises(ValueError, match="manifolds coincide"):
        connecting_orbits(exact, one, other, max_steps=steps)


@pytest.mark.parametrize(
    ("rhs", "ends"),
    [
        # Saddles on a line, and on the unit circle, where the angle obeys q' = sin(q).
        (lambda t, x, p: (x[0] * (1.0 - x[0]), p.k * x[1] * (2.0 * x[0] - 1.0)), ([0.0, 0.0], [1.0, 0.0])),
        (
            lambda t, x, p: (
                p.k * x[0] ** 2 * (1.0 - x[0] ** 2 - x[1] ** 2) - x[1] ** 2,
                p.k * x[0] * x[1] * (1.0 - x[0] ** 2 - x[1] ** 2) + x[0] * x[1],
            ),
            ([1.0, 0.0], [-1.0, 0.0]),
        ),
        # Duffing's oscillator without damping: x^4 = 2 (x^2 - v^2).
        (lambda t, x, p: (x[1], x[0] - p.k * x[0] ** 3), ([0.0, 0.0], [0.0, 0.0])),
    ],
)
def test_orbits_of_flows_that_connect_saddles_are_named(rhs, ends) -> None:  # type: ignore[no-untyped-def]
    exact = stroboscopic_map(ForcedSystem(rhs, {"k": 1.0}, period=2.0, coordinates=("x", "y")))
    with pytest.raises(ValueError, match="manifolds coincide"):
        connecting_orbits(exact, *(periodic_orbit(exact, end) for end in ends), n_samples=2048)


def test_one_branch_of_manifolds_that_coincides_is_named() -> None:
    # McMillan's map, perturbed in the half-plane of one of its two homoclinic loops.
    exact = discrete_map(
        lambda x, p: (x[1], -x[0] + 2.0 * p.mu * x[1] / (1.0 + x[1] ** 2) + p.e * max(x[1], 0.0) ** 3),
        {"mu": 1.5, "e": 1e-3},
        ("x", "y"),
    )
    with pytest.warns(UserWarning, match="coincide within 1e-09 rad along 1 of 2 branches"):
        found = connecting_orbits(exact, periodic_orbit(exact, [0.0, 0.0]), max_steps=24)
    assert found and all(orbit.points.min() > -1e-9 and abs(orbit.angle) > 1e-4 for orbit in found)


def test_a_clockwise_rotation_is_named() -> None:
    def rhs(t, x, p):  # type: ignore[no-untyped-def]
        return x[1], -x[0] + (1.0 - x[0] ** 2) * x[1] + p.F * cos(p.w * t)

    oscillator = ForcedSystem(rhs, {"F": 1.0, "w": 2.85}, period=lambda p: 2.0 * pi / p.w, coordinates=("x", "v"))
    exact = stroboscopic_map(oscillator)
    with pytest.raises(ValueError, match=r"clockwise, with the rotation number 0\.666666667: give rotations=period"):
        arnold_tongue(exact, 1, 3, ("w", "F"), (2.6, 3.1), (0.5, 1.5), [1.0, 0.0], transient=200, periods=400)


@pytest.mark.parametrize(
    ("equations", "names", "guess", "interval", "expected"),
    [
        # The logistic map, x = 1 - 1 / q, has the multiplier 2 - q.
        (lambda x, p: (p.q * x[0] * (1.0 - x[0]), -x[1]), "xu", [0.6, 0.0], (1.5, 3.5), {"period doubling": 3.0}),
        (lambda x, p: (p.q * x[0] * (1.0 - x[0]), -x[1], -x[2]), "xuv", [0.6, 0.0, 0.0], (1.5, 3.5),
         {"period doubling": 3.0}),
        # The delayed one has mu^2 - mu + q - 1 = 0 there; (u, v) rotate.
        (lambda x, p: (x[1], p.q * x[1] * (1.0 - x[0]), 0.6 * x[2] - 0.8 * x[3], 0.8 * x[2] + 0.6 * x[3]), "xyuv",
         [0.6, 0.6, 0.0, 0.0], (1.5, 2.7), {"Neimark-Sacker": 2.0}),
        # The map of Henon without dissipation, x = -1 + sqrt(1 + q), has the trace -2 x.
        (lambda x, p: (p.q - x[0] ** 2 - x[1], x[0], 0.5 * x[2]), "xyu", [0.87, 0.87, 0.0], (-2.0, 4.0),
         {"fold": -1.0, "period doubling": 3.0}),
    ],
    ids=["-1", "-1 twice", "rotation", "conservative"],
)  # fmt: skip
def test_a_multiplier_that_holds_on_the_circle_hides_no_other(equations, names, guess, interval, expected) -> None:  # type: ignore[no-untyped-def]
    point_map = discrete_map(equations, {"q": 2.5}, tuple(names))
    branch = continue_orbit(point_map, periodic_orbit(point_map, guess), "q", *interval)
    assert branch.ends == ("left the interval", "left the interval")
    assert {str(b.kind): b.value for b in branch.bifurcations} == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("bent", [False, True])
def test_no_branch_leaves_a_flip_at_which_all_orbits_double(bent: bool) -> None:
    # x -> -q x, also in the coordinate y = x + x^3: at q = 1 every point returns after two steps.
    def image(x, p):  # type: ignore[no-untyped-def]
        return (-p.q * x[0], 0.5 * x[1] + (x[0] ** 3 if bent else 0.0))

    exact = discrete_map(image, {"q": 0.5}, ("x", "y"))
    branch = continue_orbit(exact, periodic_orbit(exact, [0.0, 0.0]), "q", 0.0, 1.5)
    (flip,) = branch.bifurcations
    assert flip.kind is BifurcationKind.PERIOD_DOUBLING and flip.value == pytest.approx(1.0, abs=1e-12)
    with pytest.raises(ValueError, match="orbits of twice the period fill a curve there"):
        switch_branch(branch, flip, 0.0, 1.5)


@pytest.mark.parametrize("power", [4, 6, 8])
def test_a_flat_fold_is_one_fold_whose_coefficient_is_zero_within_its_error(power: int) -> None:
    """Fixed points of x + q - x^n are q = x^n: one fold at 0 for even n, with the quadratic coefficient 0."""
    flat = discrete_map(lambda x, p: (x[0] + p.q - x[0] ** power,), {"q": 0.5}, ("x",))
    branch = continue_orbit(flat, periodic_orbit(flat, [0.5 ** (1 / power)]), "q", -1.0, 0.6)
    assert [b.kind for b in branch.bifurcations[:1]] == [BifurcationKind.FOLD]
    assert not {BifurcationKind.FOLD, BifurcationKind.DEGENERATE} & {b.kind for b in branch.bifurcations[1:]}
    fold = branch.bifurcations[0]
    assert abs(fold.value) < 1e-15 and {fold.before, fold.after} == {0, 1}
    assert fold.normal_form.criticality is Criticality.DEGENERATE
    assert abs(fold.normal_form.coefficient) < fold.normal_form.error < 1e-8


def test_an_inflection_is_no_fold() -> None:
    """Fixed points of x + q - x^3 are q = x^3, which grows throughout."""
    flat = discrete_map(lambda x, p: (x[0] + p.q - x[0] ** 3,), {"q": 0.3}, ("x",))
    assert continue_orbit(flat, periodic_orbit(flat, [0.3 ** (1 / 3)]), "q", -0.5, 0.5).bifurcations == ()


def test_a_weakly_curved_fold_keeps_its_digits() -> None:
    """The quadratic coefficient of x + q - 1e-6 x^2 - x^4 at 0 is -1e-6."""
    flat = discrete_map(lambda x, p: (x[0] + p.q - 1e-6 * x[0] ** 2 - x[0] ** 4,), {"q": 0.1}, ("x",))
    form = continue_orbit(flat, periodic_orbit(flat, [0.1**0.25]), "q", -0.1, 0.2).bifurcations[0].normal_form
    assert form.criticality is Criticality.GENERIC and abs(form.coefficient + 1e-6) <= 3 * form.error < 1e-14


def test_a_flat_fold_of_a_flow() -> None:
    """Equilibria of x' = q - x^4, as fixed points of the map over a time."""
    flow = stroboscopic_map(ForcedSystem(lambda t, x, p: (p.q - x[0] ** 4,), {"q": 0.1}, 6.0, ("x",)))
    branch = continue_orbit(flow, periodic_orbit(flow, [0.1**0.25]), "q", -0.1, 0.2, step=0.03)
    (fold,) = branch.bifurcations
    assert fold.kind is BifurcationKind.FOLD and abs(fold.value) < 1e-13
    assert abs(fold.normal_form.coefficient) < fold.normal_form.error < 1e-7


def test_a_family_of_conservative_orbits_has_no_folds() -> None:
    """Without damping (d = 0) all orbits of an oscillator are periodic, and rounding decides how d moves along them."""
    free = ForcedSystem(lambda t, x, p: (x[1], -x[0] - x[0] ** 3 + p.d * x[1]), {"d": 0.0}, 2.0, ("x", "v"))
    section = section_map(free, ("v", 0.0, -1))
    family = continue_orbit(section, periodic_orbit(section, [1.0]), "d", -0.1, 0.1, step=0.1, max_points=8)
    assert family.bifurcations == () and float(np.abs(family.values).max()) < 1e-13
    assert family.points.min() < 0.3 and family.points.max() > 1.8


@pytest.mark.parametrize("broken", [1e-11, 1e-10, 1e-7, 1e-4])
def test_a_nearly_broken_symmetry_does_not_end_a_branch(broken: float) -> None:
    """Fixed points of x + q x - x^3 + e are q = x^2 - e / x: at q = 1 the branch has left 0 for 1 + e / 2."""
    cubic = discrete_map(lambda x, p: (x[0] + p.q * x[0] - x[0] ** 3 + p.e,), {"q": -0.25, "e": broken}, ("x",))
    branch = continue_orbit(cubic, periodic_orbit(cubic, [0.0]), "q", -1.0, 0.9)
    assert branch.ends == ("left the interval", "left the interval") and branch.bifurcations == ()
    x = branch.points[:, 0]
    np.testing.assert_allclose(x**2 - broken / x, branch.values, rtol=0.0, atol=1e-12)
    assert (np.diff(x) > 0.0).all() and len(x) < 800


@pytest.mark.parametrize("e", [1e-10, 1e-7])
def test_a_nearly_symmetric_beam_is_followed_past_buckling(e: float) -> None:
    """Equilibria of x'' + d x' + (k - 1) x + x^3 = e are k = 1 - x^2 + e / x."""
    beam = ForcedSystem(
        lambda t, x, p: (x[1], -0.5 * x[1] - (p.k - 1.0) * x[0] - x[0] ** 3 + e), {"k": 1.3}, 2.0 * pi, ("x", "v")
    )
    strobe = stroboscopic_map(beam)
    branch = continue_orbit(strobe, periodic_orbit(strobe, [0.0, 0.0]), "k", 0.7, 1.3)
    assert branch.ends == ("left the interval", "left the interval") and branch.bifurcations == ()
    x = branch.points[:, 0]
    np.testing.assert_allclose(1.0 - x**2 + e / x, branch.values, rtol=0.0, atol=1e-8)
    assert abs(x[0] - sqrt(0.3)) < 1e-6
