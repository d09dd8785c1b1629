"""Curves of bifurcations of orbits that are born at points of codimension two: closed forms, and SciPy."""

from math import cos, sin

import numpy as np
import pytest
from branch_kinds import DOUBLING, FOLD, NEIMARK_SACKER, POINT
from cases import curve_of, only
from scipy.optimize import root

from cellmap import discrete_map
from cellmap.bifurcations import NewCurve, switch_curve

# The generalised Henon map u'' = alpha - beta u - u'^2 + R u u'.  A cycle of two states has the sum S = 1 + beta, the
# product (S^2 - alpha)/(1 + R), and the determinants beta - R u.

R = -0.1
WIDE = (-2.0, 4.0), (-2.0, 2.0)


def test_curves_that_do_not_leave_a_point_are_refused(henon_curves):
    start = only(henon_curves[NEIMARK_SACKER], POINT.RESONANCE_1_4)
    with pytest.raises(ValueError, match="is not on"):
        switch_curve(henon_curves[DOUBLING], start, *WIDE)
    with pytest.raises(ValueError, match=r"new_curve=NewCurve\(fold, period times 2\): .* has NewCurve\(fold"):
        switch_curve(henon_curves[NEIMARK_SACKER], start, *WIDE, new_curve=NewCurve(FOLD, 2))


@pytest.mark.parametrize(
    ("kind", "point"), [(NEIMARK_SACKER, POINT.RESONANCE_1_2), (DOUBLING, POINT.RESONANCE_1_2), (FOLD, POINT.FOLD_FLIP)]
)
def test_neimark_sacker_bifurcations_of_the_doubled_orbit(henon_curves, kind, point):
    curve = henon_curves[kind]
    start = only(curve, point)
    assert NewCurve(NEIMARK_SACKER, 2) in start.new_curves
    found = switch_curve(curve, start, *WIDE, step=0.05, new_curve=NewCurve(NEIMARK_SACKER, 2))
    assert (found.kind, found.period, found.ends[0]) == (NEIMARK_SACKER, 2, str(point))
    alpha, beta = found.values.T
    np.testing.assert_allclose(
        alpha, (1 + beta) ** 2 - (1 + R) * (1 - beta**2 + R * beta * (1 + beta)) / R**2, atol=1e-9
    )
    assert np.abs(found.values[0] - start.values).max() < 0.02
    assert {p.kind for p in found.codimension_two()} == {POINT.RESONANCE_1_2, POINT.RESONANCE_1_3, POINT.RESONANCE_1_4}


def residual(kind, v, beta):
    """Return the defects of an orbit of period 4 and of its bifurcation, from Jacobian matrices in formulas."""
    (x, y), matrix = v[:2], np.eye(2)
    for _ in range(4):
        matrix = np.array([[0.0, 1.0], [-beta + R * y, -2.0 * y + R * x]]) @ matrix
        x, y = y, v[2] - beta * x - y * y + R * x * y
    determinant = float(np.linalg.det(matrix))
    test = 1.0 - float(np.trace(matrix)) + determinant if kind is FOLD else determinant - 1.0
    return [x - v[0], y - v[1], test]


@pytest.mark.parametrize("new", [NewCurve(FOLD, 4), NewCurve(FOLD, 4, 1), NewCurve(NEIMARK_SACKER, 4)])
def test_orbits_of_four_times_the_period(henon_curves, new):
    circles = henon_curves[NEIMARK_SACKER]
    start = only(circles, POINT.RESONANCE_1_4)
    assert new in start.new_curves
    found = switch_curve(circles, start, *WIDE, step=0.05, new_curve=new)
    assert (found.kind, found.period, found.ends[0]) == (new.kind, 4, "1:4 resonance")
    assert np.abs(found.values[0] - start.values).max() < 0.02
    for k in (len(found.values) // 3, len(found.values) // 2, -1):
        alpha, beta = found.values[k]
        guess = np.append(found.points[k], alpha)
        other = root(lambda v, beta=beta: residual(new.kind, v, beta), guess + 1e-6, tol=1e-14)
        np.testing.assert_allclose(other.x, guess, atol=2e-8)


@pytest.mark.thorough
def test_the_doubled_orbit_of_a_flip_and_a_neimark_sacker_bifurcation():
    # Doubled orbits have u^2 = q + u-independent terms of the plane: its multiplier is 1 + p + 0.5 q there.
    def image(x, p):
        r, u = x[0] ** 2 + x[1] ** 2, x[2]
        factor = 1 + p.p + 0.5 * u * u - r
        plane = cos(1.1) * x[0] - sin(1.1) * x[1], sin(1.1) * x[0] + cos(1.1) * x[1]
        return factor * plane[0], factor * plane[1], -(1 + p.q) * u + u**3

    exact = discrete_map(image, {"p": -0.2, "q": -0.3}, ("x", "y", "u"))
    box = (-0.5, 0.5), (-0.6, 0.6)
    curve = curve_of(exact, [0.0, 0.0, 0.0], NEIMARK_SACKER, "pq", box, step=0.03)
    start = only(curve, POINT.FLIP_NEIMARK_SACKER)
    assert start.new_curves == (NewCurve(DOUBLING), NewCurve(NEIMARK_SACKER, 2))
    found = switch_curve(curve, start, *box, step=0.05, new_curve=NewCurve(NEIMARK_SACKER, 2))
    p, q = found.values.T
    np.testing.assert_allclose(p, -0.5 * q, atol=1e-9)
    np.testing.assert_allclose(found.points[:, 2] ** 2, q, atol=1e-9)
    assert found.ends == ("flip-Neimark-Sacker", "left the intervals")
