"""Curves of bifurcations of orbits that are born at points of codimension two: closed forms, and SciPy."""

from __future__ import annotations

from math import cos, sin
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import root

from cellmap import PointMap, continue_orbit, discrete_map, periodic_orbit
from cellmap.bifurcations import (
    BifurcationCurve,
    BifurcationKind,
    CodimensionTwo,
    CodimensionTwoKind,
    NewCurve,
    continue_bifurcation,
    switch_curve,
)

FOLD, DOUBLING = BifurcationKind.FOLD, BifurcationKind.PERIOD_DOUBLING
NEIMARK_SACKER = BifurcationKind.NEIMARK_SACKER
POINT = CodimensionTwoKind


def curve_of(exact: PointMap, state: list[float], kind: BifurcationKind, first: Any, second: Any) -> BifurcationCurve:
    (name, *low_high), (other, *interval) = first, second
    branch = continue_orbit(exact, periodic_orbit(exact, state), name, *low_high, step=0.03)
    return continue_bifurcation(branch, branch.of_kind(kind)[0], other, tuple(low_high), tuple(interval), step=0.03)


def only(curve: BifurcationCurve, kind: CodimensionTwoKind) -> CodimensionTwo:
    (found,) = (c for c in curve.codimension_two() if c.kind is kind)
    return found


# The generalised Henon map u'' = alpha - beta u - u'^2 + R u u'.  A cycle of two states has the sum S = 1 + beta, the
# product (S^2 - alpha)/(1 + R), and the determinants beta - R u.

R = -0.1
ALPHA, BETA = ("alpha", -2.0, 4.0), ("beta", -2.0, 2.0)


@pytest.fixture(scope="module")
def henon() -> PointMap:
    return discrete_map(
        lambda x, p: (x[1], p.alpha - p.beta * x[0] - x[1] ** 2 + R * x[0] * x[1]),
        {"alpha": 0.3, "beta": 1.03},
        ("x", "y"),
    )


@pytest.fixture(scope="module")
def circles(henon: PointMap) -> BifurcationCurve:
    return curve_of(henon, [0.2, 0.2], NEIMARK_SACKER, ALPHA, BETA)


def test_points_of_other_curves_are_refused(henon: PointMap, circles: BifurcationCurve) -> None:
    doublings = curve_of(henon, [0.2, 0.2], DOUBLING, ALPHA, BETA)
    with pytest.raises(ValueError, match="is not on"):
        switch_curve(doublings, only(circles, POINT.RESONANCE_1_4), ALPHA[1:], BETA[1:])


@pytest.mark.parametrize(
    ("kind", "point"), [(NEIMARK_SACKER, POINT.RESONANCE_1_2), (DOUBLING, POINT.RESONANCE_1_2), (FOLD, POINT.FOLD_FLIP)]
)
def test_neimark_sacker_bifurcations_of_the_doubled_orbit(
    henon: PointMap, circles: BifurcationCurve, kind: BifurcationKind, point: CodimensionTwoKind
) -> None:
    curve = circles if kind is NEIMARK_SACKER else curve_of(henon, [0.2, 0.2], kind, ALPHA, BETA)
    start = only(curve, point)
    assert NewCurve(NEIMARK_SACKER, 2) in start.new_curves
    found = switch_curve(curve, start, ALPHA[1:], BETA[1:], step=0.05, new_curve=NewCurve(NEIMARK_SACKER, 2))
    assert (found.kind, found.period, found.ends[0]) == (NEIMARK_SACKER, 2, str(point))
    alpha, beta = found.values.T
    np.testing.assert_allclose(
        alpha, (1 + beta) ** 2 - (1 + R) * (1 - beta**2 + R * beta * (1 + beta)) / R**2, atol=1e-9
    )
    assert np.abs(found.values[0] - start.values).max() < 0.02
    assert {p.kind for p in found.codimension_two()} == {POINT.RESONANCE_1_2, POINT.RESONANCE_1_3, POINT.RESONANCE_1_4}


def residual(kind: BifurcationKind, v: NDArray[np.float64], beta: float) -> list[float]:
    """Return the defects of an orbit of period 4 and of its bifurcation, from Jacobian matrices in formulas."""
    (x, y), matrix = v[:2], np.eye(2)
    for _ in range(4):
        matrix = np.array([[0.0, 1.0], [-beta + R * y, -2.0 * y + R * x]]) @ matrix
        x, y = y, v[2] - beta * x - y * y + R * x * y
    determinant = float(np.linalg.det(matrix))
    test = 1.0 - float(np.trace(matrix)) + determinant if kind is FOLD else determinant - 1.0
    return [x - v[0], y - v[1], test]


@pytest.mark.parametrize("new", [NewCurve(FOLD, 4), NewCurve(FOLD, 4, 1), NewCurve(NEIMARK_SACKER, 4)])
def test_orbits_of_four_times_the_period(circles: BifurcationCurve, new: NewCurve) -> None:
    start = only(circles, POINT.RESONANCE_1_4)
    assert new in start.new_curves
    found = switch_curve(circles, start, ALPHA[1:], BETA[1:], step=0.05, new_curve=new)
    assert (found.kind, found.period, found.ends[0]) == (new.kind, 4, "1:4 resonance")
    assert np.abs(found.values[0] - start.values).max() < 0.02
    for k in (len(found.values) // 3, len(found.values) // 2, -1):
        alpha, beta = found.values[k]
        guess = np.append(found.points[k], alpha)
        other = root(lambda v, beta=beta: residual(new.kind, v, beta), guess + 1e-6, tol=1e-14)  # type: ignore[misc]
        np.testing.assert_allclose(other.x, guess, atol=2e-8)


def test_the_two_curves_of_folds_differ(circles: BifurcationCurve) -> None:
    start = only(circles, POINT.RESONANCE_1_4)
    folds = [switch_curve(circles, start, (-0.1, 0.1), (0.9, 1.1), new_curve=NewCurve(FOLD, 4, k)) for k in (0, 1)]
    assert np.abs(folds[0].values[-1] - folds[1].values[-1]).max() > 0.01


def test_folds_of_the_delayed_logistic_map_end_in_the_window_of_the_logistic_map() -> None:
    """The delay is in a part c; without it the window of period 4 of the logistic map begins at the fold found here."""
    exact = discrete_map(
        lambda x, p: (p.r * x[0] * (1 - (1 - p.c) * x[0] - p.c * x[1]), x[0]), {"r": 2.5, "c": 0.4}, ("x", "y")
    )
    curve = curve_of(exact, [0.6, 0.6], NEIMARK_SACKER, ("r", 1.2, 8.0), ("c", 0.0, 1.2))
    start = only(curve, POINT.RESONANCE_1_4)
    assert start.new_curves == (NewCurve(FOLD, 4), NewCurve(FOLD, 4, 1))
    ends = []
    for new in start.new_curves:
        found = switch_curve(curve, start, (1.2, 8.0), (0.0, 1.2), step=0.03, new_curve=new)
        assert found.ends == ("1:4 resonance", "left the intervals")
        ends.append(found.values[-1])
    (window,) = (r for r, c in ends if c == 0.0)

    def fold(v: NDArray[np.float64]) -> list[float]:
        x, slope = v[0], 1.0
        for _ in range(4):
            x, slope = v[1] * x * (1.0 - x), v[1] * (1.0 - 2.0 * x) * slope
        return [x - v[0], slope - 1.0]

    assert window == pytest.approx(root(fold, [0.5, 3.96], tol=1e-14).x[1], abs=1e-8)


def test_the_doubled_orbit_of_a_flip_and_a_neimark_sacker_bifurcation() -> None:
    # Doubled orbits have u^2 = q + u-independent terms of the plane: its multiplier is 1 + p + 0.5 q there.
    def image(x: Any, p: Any) -> Any:
        r, u = x[0] ** 2 + x[1] ** 2, x[2]
        factor = 1 + p.p + 0.5 * u * u - r
        plane = cos(1.1) * x[0] - sin(1.1) * x[1], sin(1.1) * x[0] + cos(1.1) * x[1]
        return factor * plane[0], factor * plane[1], -(1 + p.q) * u + u**3

    exact = discrete_map(image, {"p": -0.2, "q": -0.3}, ("x", "y", "u"))
    curve = curve_of(exact, [0.0, 0.0, 0.0], NEIMARK_SACKER, ("p", -0.5, 0.5), ("q", -0.6, 0.6))
    start = only(curve, POINT.FLIP_NEIMARK_SACKER)
    assert start.new_curves == (NewCurve(DOUBLING), NewCurve(NEIMARK_SACKER, 2))
    found = switch_curve(curve, start, (-0.5, 0.5), (-0.6, 0.6), step=0.05, new_curve=NewCurve(NEIMARK_SACKER, 2))
    p, q = found.values.T
    np.testing.assert_allclose(p, -0.5 * q, atol=1e-9)
    np.testing.assert_allclose(found.points[:, 2] ** 2, q, atol=1e-9)
    assert found.ends == ("flip-Neimark-Sacker", "left the intervals")


def test_curves_that_do_not_leave_a_point_are_refused(circles: BifurcationCurve) -> None:
    start = only(circles, POINT.RESONANCE_1_4)
    with pytest.raises(ValueError, match=r"new_curve=NewCurve\(fold, period times 2\): .* has NewCurve\(fold"):
        switch_curve(circles, start, ALPHA[1:], BETA[1:], new_curve=NewCurve(FOLD, 2))


@pytest.mark.slow
def test_curves_of_random_maps_are_found() -> None:
    """Whatever the normal form says to leave a point is found beside it, and ends there."""
    rng, ends = np.random.default_rng(3), list[bool]()
    for _ in range(12):
        two, three = rng.normal(size=3).tolist(), (0.5 * rng.normal(size=4)).tolist()

        def image(x: Any, p: Any, two: list[float] = two, three: list[float] = three) -> Any:
            u, v = x
            square = two[0] * u * u + two[1] * u * v + two[2] * v * v
            cube = three[0] * u**3 + three[1] * u * u * v + three[2] * u * v * v + three[3] * v**3
            return v, p.a - p.b * u + square + cube

        exact = discrete_map(lambda x, p, image=image: image(x, p), {"a": 0.0, "b": 0.9}, ("x", "y"))
        branch = continue_orbit(exact, periodic_orbit(exact, [0.0, 0.0]), "a", -3.0, 3.0, step=0.03, max_points=100)
        for bifurcation in branch.of_kind(NEIMARK_SACKER)[:1]:
            curve = continue_bifurcation(branch, bifurcation, "b", (-3.0, 3.0), (-2.5, 2.5), 0.03, 100)
            for point in curve.codimension_two():
                for new in point.new_curves:
                    if new.times > 1:
                        box = (-3.0, 3.0), (-2.5, 2.5)
                        found = switch_curve(curve, point, *box, step=0.03, max_points=30, new_curve=new)
                        ends.append(found.ends[0] == str(point.kind))
    assert len(ends) >= 15
    assert np.mean(ends) > 0.9


@pytest.mark.parametrize(("e", "step"), [(8e-4, 0.05), (8e-4, 0.2), (8e-4, 1.0), (-1e-2, 0.2), (0.1, 1.0)])
def test_folds_of_doubled_orbits_begin_where_these_are_born_whatever_the_step(e, step):
    """x -> -x maps -(1 + q) x + s x^3 + e x^5 to itself: orbits of period 2 have q = s w + e w^2 with w = x^2."""
    flip = discrete_map(
        lambda x, p: (-(1 + p.q) * x[0] + p.s * x[0] ** 3 + p.e * x[0] ** 5,), {"q": -0.1, "s": 0.5, "e": e}, ("x",)
    )
    branch = continue_orbit(flip, periodic_orbit(flip, [0.0]), "q", -0.5, 0.5)
    (doubling,) = branch.of_kind(BifurcationKind.PERIOD_DOUBLING)
    curve = continue_bifurcation(branch, doubling, "s", (-0.5, 0.5), (-1.0, 1.0))
    (point,) = curve.codimension_two()
    folds = switch_curve(curve, point, (-5.0, 5.0), (-10.0, 10.0), step=step)
    assert folds.ends == ("generalised flip", "left the intervals")
    q, s = folds.values.T
    np.testing.assert_allclose(q, -(s**2) / (4.0 * e), rtol=1e-9, atol=1e-12)
    assert folds.codimension_two() == ()
