"""Bifurcations of codimension two: closed forms of discrete maps, a cusp and resonances of flows against SciPy."""

from math import cos, pi, sin, sqrt

import numpy as np
import pytest
from branch_kinds import DOUBLING, FOLD, NEIMARK_SACKER, PITCHFORK, POINT
from cases import curve_of, henon_parameters, only, thorough

from cellmap import discrete_map, stroboscopic_map
from cellmap._lib.stopping import Stop, Stopped, heeding
from cellmap.bifurcations import NewCurve, switch_curve
from cellmap.maps import swept_map
from cellmap.maps.parameters_as_states import Swept
from systems import duffing_oscillator

WIDE = (-2.0, 4.0), (-2.0, 2.0)
UNIT = (-1.0, 1.0), (-1.0, 1.0)
MET = ("multipliers met on the real axis",) * 2
TRACES = {POINT.RESONANCE_1_1: 2.0, POINT.RESONANCE_1_4: 0.0, POINT.RESONANCE_1_3: -1.0, POINT.RESONANCE_1_2: -2.0}


def of_two(function, p, q, *names):
    return discrete_map(function, {"p": p, "q": q}, names)


def curve_over_both(exact, guess, kind, box=UNIT):
    return curve_of(exact, guess, kind, ("p", "q"), box, step=0.03)


# The generalised Henon map (y, alpha - beta x - y^2 + R x y): at the fixed point x the determinant is beta - R x and
# the trace (R - 2) x, so that alpha and beta follow from both.


def assert_strong_resonances(curve):
    """All four are on it, and the trace of the multipliers is (R - 2) x all along the curve."""
    points = curve.codimension_two()
    assert (curve.ends, len(points), {p.kind for p in points}) == (MET, 4, set(TRACES))
    for point in points:
        np.testing.assert_allclose(point.values, henon_parameters(TRACES[point.kind], 1.0), atol=1e-11)
    trace = -2.1 * curve.points[:, 0]
    np.testing.assert_allclose(curve.values, np.transpose(henon_parameters(trace, 1.0)), atol=1e-10)


def test_strong_resonances_of_the_generalised_henon_map(henon_curves):
    curve = henon_curves[NEIMARK_SACKER]
    assert_strong_resonances(curve)
    assert curve.codimension_two()[0].place == 0
    np.testing.assert_array_equal(curve.values[0], curve.codimension_two()[0].values)


def test_fold_flip_and_resonances_from_both_curves(henon_curves):
    for kind, resonance in ((FOLD, POINT.RESONANCE_1_1), (DOUBLING, POINT.RESONANCE_1_2)):
        assert {p.kind for p in henon_curves[kind].codimension_two()} == {POINT.FOLD_FLIP, resonance}
        found = only(henon_curves[kind], resonance)
        np.testing.assert_allclose(found.values, henon_parameters(TRACES[resonance], 1.0), atol=1e-11)
        assert found.new_curves[0] == NewCurve(NEIMARK_SACKER)
        both = only(henon_curves[kind], POINT.FOLD_FLIP)
        np.testing.assert_allclose(both.values, henon_parameters(0.0, -1.0), atol=1e-11)
        other = switch_curve(henon_curves[kind], both, *WIDE, step=0.05)
        assert other.kind is both.new_curves[0].kind is ({FOLD, DOUBLING} - {kind}).pop()
        assert {p.kind for p in other.codimension_two()} >= {POINT.FOLD_FLIP}


def test_the_curve_that_leaves_a_resonance(henon_curves):
    start = only(henon_curves[DOUBLING], POINT.RESONANCE_1_2)
    curve = switch_curve(henon_curves[DOUBLING], start, *WIDE, step=0.05)
    assert curve.kind is NEIMARK_SACKER
    assert_strong_resonances(curve)
    np.testing.assert_allclose(np.abs(curve.multipliers), 1.0, atol=1e-7)


def test_points_that_are_refused_and_shown(henon_curves):
    with pytest.raises(ValueError, match=r"1:3 resonance at .* no other curve"):
        switch_curve(henon_curves[NEIMARK_SACKER], only(henon_curves[NEIMARK_SACKER], POINT.RESONANCE_1_3), *WIDE)
    with pytest.raises(ValueError, match="second="):
        switch_curve(henon_curves[FOLD], only(henon_curves[FOLD], POINT.RESONANCE_1_1), WIDE[0], (-2.0, 0.0))
    assert repr(only(henon_curves[FOLD], POINT.FOLD_FLIP)).startswith("CodimensionTwo(fold-flip at alpha=")


@pytest.mark.parametrize("bend", [0.0, thorough(0.1)])
def test_a_generalised_flip_and_the_folds_that_begin_there(bend):
    # x -> -(1 + p) x + bend x^2 + q x^3 + x^5: b = q + bend^2, and without bend folds x = -f(x) at p = -q^2/4.
    exact = of_two(lambda x, p: (-(1 + p.p) * x[0] + bend * x[0] ** 2 + p.q * x[0] ** 3 + x[0] ** 5,), -0.5, 0.7, "x")
    curve = curve_over_both(exact, [0.0], DOUBLING)
    (found,) = curve.codimension_two()
    assert found.kind is POINT.GENERALISED_FLIP
    np.testing.assert_allclose(found.values, [0.0, -(bend**2)], atol=1e-11)
    folds = switch_curve(curve, found, *UNIT, step=0.05)
    assert (folds.kind, folds.period, folds.ends[0]) == (FOLD, 2, "generalised flip")
    if not bend:
        np.testing.assert_allclose(folds.values[:, 0], -(folds.values[:, 1] ** 2) / 4.0, atol=1e-11)
    images = exact.with_params(p=float(folds.values[-1, 0]), q=float(folds.values[-1, 1])).iterate(folds.points[-1], 2)
    np.testing.assert_allclose(images.points, folds.points[-1], atol=1e-11)


def test_a_degenerate_pitchfork_and_the_folds_that_begin_there():
    exact = of_two(lambda x, p: ((1 + p.p) * x[0] + p.q * x[0] ** 3 + x[0] ** 5,), -0.5, 0.7, "x")
    curve = curve_over_both(exact, [0.0], PITCHFORK)
    (found,) = curve.codimension_two()
    assert found.kind is POINT.DEGENERATE_PITCHFORK
    folds = switch_curve(curve, found, *UNIT, step=0.05)
    assert (folds.period, folds.ends[0]) == (1, "degenerate pitchfork")
    np.testing.assert_allclose(folds.values[:, 0], folds.values[:, 1] ** 2 / 4.0, atol=1e-11)


def rotated(x, factor):
    return factor * (cos(0.46 * pi) * x[0] - sin(0.46 * pi) * x[1]), factor * (
        sin(0.46 * pi) * x[0] + cos(0.46 * pi) * x[1]
    )


@pytest.mark.parametrize("apart", [thorough(0.02), 1e-4])
def test_two_chenciner_bifurcations_within_a_step(apart):
    def ring(x, p):
        r = x[0] ** 2 + x[1] ** 2
        return rotated(x, 1 + p.p + ((p.q - 0.013) ** 2 - apart**2) * r - r**2)

    points = curve_over_both(of_two(ring, -0.2, 0.33, "x", "y"), [0.0, 0.0], NEIMARK_SACKER).codimension_two()
    assert {p.kind for p in points} == {POINT.CHENCINER}
    np.testing.assert_allclose(sorted(p.values[1] for p in points), [0.013 - apart, 0.013 + apart], atol=1e-11)


def test_a_neutral_saddle_beside_a_fold_is_no_point():
    # The multipliers 2 and 1/2 + q/5 have the product 1 at q = 0.
    saddle = of_two(lambda x, p: (x[0] + p.p - x[0] ** 2, 2.0 * x[1], (0.5 + 0.2 * p.q) * x[2]), 0.25, 0.3, *"xyz")
    assert curve_over_both(saddle, [0.5, 0.0, 0.0], FOLD).codimension_two() == ()


def test_points_are_computed_once_and_in_parts_that_can_be_stopped():
    exact = of_two(lambda x, p: (x[0] + p.p + p.q * x[0] - x[0] ** 3,), 0.0, 0.7, "x")
    curve = curve_over_both(exact, [sqrt(0.7)], FOLD)
    with pytest.raises(Stopped), heeding(Stop(0.0)):
        curve.codimension_two()
    found = curve.codimension_two(progress=True)
    assert curve.codimension_two() is found
    assert curve.with_zeros({"none": lambda t, x, p: x[0] - 9.0}).codimension_two() is found
    assert curve.degeneracies() == frozenset()


def test_a_map_with_parameters_in_its_state_is_specified_once():
    """Derivatives of a higher order are integrated by a method that is chosen once, not at each point."""
    swept = swept_map(stroboscopic_map(duffing_oscillator()), "frequency", "forcing").specified
    assert isinstance(swept, Swept)
    assert swept.vectorised is swept.vectorised
