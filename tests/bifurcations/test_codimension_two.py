"""Bifurcations of codimension two: closed forms of discrete maps, and a cusp of a flow against SciPy."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, pi, sin, sqrt
from typing import Any

import numpy as np
import pytest
from differences import Differences
from scipy.integrate import solve_ivp

from cellmap import PointMap, continue_orbit, discrete_map, periodic_orbit, stroboscopic_map
from cellmap._lib.stopping import Stop, Stopped, heeding
from cellmap.bifurcations import (
    BifurcationCurve,
    BifurcationKind,
    CodimensionTwo,
    CodimensionTwoKind,
    NewCurve,
    continue_bifurcation,
    switch_curve,
)
from cellmap.maps import swept_map
from cellmap.maps.parameters_as_states import Swept
from systems import duffing_oscillator, van_der_pol_oscillator

FOLD, DOUBLING = BifurcationKind.FOLD, BifurcationKind.PERIOD_DOUBLING
PITCHFORK, NEIMARK_SACKER = BifurcationKind.PITCHFORK, BifurcationKind.NEIMARK_SACKER
POINT = CodimensionTwoKind

WIDE = (-2.0, 4.0), (-2.0, 2.0)
UNIT = (-1.0, 1.0), (-1.0, 1.0)
THETA = 0.46 * pi


def curve_of(
    exact: PointMap, state: list[float], kind: BifurcationKind, box: Any = UNIT, names: tuple[str, str] = ("p", "q")
) -> BifurcationCurve:
    branch = continue_orbit(exact, periodic_orbit(exact, state), names[0], *box[0], step=0.03)
    return continue_bifurcation(branch, branch.of_kind(kind)[0], names[1], *box, step=0.03)


def of_two(function: Callable[..., Any], p: float, q: float, *names: str) -> PointMap:
    return discrete_map(function, {"p": p, "q": q}, names)


def only(curve: BifurcationCurve, kind: CodimensionTwoKind) -> CodimensionTwo:
    (found,) = (c for c in curve.codimension_two() if c.kind is kind)
    return found


# The generalised Henon map (y, alpha - beta x - y^2 + R x y): at the fixed point x the determinant is beta - R x and
# the trace (R - 2) x, so that alpha and beta follow from both.

R = -0.1


def generalised_henon(trace: float, determinant: float) -> tuple[float, float]:
    x = trace / (R - 2.0)
    beta = determinant + R * x
    return x + beta * x + x * x - R * x * x, beta


@pytest.fixture(scope="module")
def henon() -> dict[BifurcationKind, BifurcationCurve]:
    exact = discrete_map(
        lambda x, p: (x[1], p.alpha - p.beta * x[0] - x[1] ** 2 + p.R * x[0] * x[1]),
        {"alpha": 0.3, "beta": 1.03, "R": R},
        ("x", "y"),
    )
    branch = continue_orbit(exact, periodic_orbit(exact, [0.2, 0.2]), "alpha", *WIDE[0])
    return {b.kind: continue_bifurcation(branch, b, "beta", *WIDE, step=0.02) for b in branch.bifurcations}


RESONANCES = {
    POINT.RESONANCE_1_1: generalised_henon(2.0, 1.0),
    POINT.RESONANCE_1_4: generalised_henon(0.0, 1.0),
    POINT.RESONANCE_1_3: generalised_henon(-1.0, 1.0),
    POINT.RESONANCE_1_2: generalised_henon(-2.0, 1.0),
}


def test_strong_resonances_of_the_generalised_henon_map(henon: dict[BifurcationKind, BifurcationCurve]) -> None:
    curve = henon[NEIMARK_SACKER]
    assert curve.ends == ("multipliers met on the real axis",) * 2
    assert {p.kind for p in curve.codimension_two()} == set(RESONANCES)
    assert len(curve.codimension_two()) == 4
    for point in curve.codimension_two():
        np.testing.assert_allclose(point.values, RESONANCES[point.kind], atol=1e-11)
    assert curve.codimension_two()[0].place == 0
    np.testing.assert_array_equal(curve.values[0], curve.codimension_two()[0].values)
    # The trace of the multipliers is (R - 2) x all along the curve.
    x = curve.points[:, 0]
    np.testing.assert_allclose(curve.values, np.transpose(generalised_henon((R - 2.0) * x, 1.0)), atol=1e-10)


def test_fold_flip_and_resonances_from_both_curves(henon: dict[BifurcationKind, BifurcationCurve]) -> None:
    for kind, resonance in ((FOLD, POINT.RESONANCE_1_1), (DOUBLING, POINT.RESONANCE_1_2)):
        assert {p.kind for p in henon[kind].codimension_two()} == {POINT.FOLD_FLIP, resonance}
        found = only(henon[kind], resonance)
        np.testing.assert_allclose(found.values, RESONANCES[resonance], atol=1e-11)
        assert found.new_curves[0] == NewCurve(NEIMARK_SACKER)
        both = only(henon[kind], POINT.FOLD_FLIP)
        np.testing.assert_allclose(both.values, generalised_henon(0.0, -1.0), atol=1e-11)
        other = switch_curve(henon[kind], both, *WIDE, step=0.05)
        assert other.kind is both.new_curves[0].kind
        assert other.kind is ({FOLD, DOUBLING} - {kind}).pop()
        assert {p.kind for p in other.codimension_two()} >= {POINT.FOLD_FLIP}


def test_the_curve_that_leaves_a_resonance(henon: dict[BifurcationKind, BifurcationCurve]) -> None:
    start = only(henon[DOUBLING], POINT.RESONANCE_1_2)
    curve = switch_curve(henon[DOUBLING], start, *WIDE, step=0.05)
    assert curve.kind is NEIMARK_SACKER
    assert curve.ends == ("multipliers met on the real axis",) * 2
    assert {p.kind for p in curve.codimension_two()} == set(RESONANCES)
    np.testing.assert_allclose(np.abs(curve.multipliers), 1.0, atol=1e-7)
    x = curve.points[:, 0]
    np.testing.assert_allclose(curve.values, np.transpose(generalised_henon((R - 2.0) * x, 1.0)), atol=1e-10)


def test_the_doublings_of_the_henon_map_have_a_resonance() -> None:
    # Period doubling at a = 3 (1 - b)^2/4, multipliers -1 and b: 1:2 resonance at b = -1.
    exact = discrete_map(lambda x, p: (1 - p.a * x[0] ** 2 + x[1], p.b * x[0]), {"a": 0.2, "b": 0.3}, ("x", "y"))
    curve = curve_of(exact, [0.5, 0.2], DOUBLING, ((0.0, 4.0), (-1.5, 0.9)), ("a", "b"))
    (found,) = curve.codimension_two()
    assert found.kind is POINT.RESONANCE_1_2
    np.testing.assert_allclose(found.values, [3.0, -1.0], atol=1e-11)


def test_a_cusp() -> None:
    exact = of_two(lambda x, p: (x[0] + p.p + p.q * x[0] - x[0] ** 3,), 0.0, 0.7, "x")
    curve = curve_of(exact, [sqrt(0.7)], FOLD)
    (found,) = curve.codimension_two()
    assert found.kind is POINT.CUSP
    assert found.new_curves == ()
    np.testing.assert_allclose(found.values, 0.0, atol=1e-11)
    np.testing.assert_allclose(27.0 * curve.values[:, 0] ** 2, 4.0 * curve.values[:, 1] ** 3, atol=1e-11)


@pytest.mark.parametrize("bend", [0.0, 0.1])
def test_a_generalised_flip_and_the_folds_that_begin_there(bend: float) -> None:
    # x -> -(1 + p) x + bend x^2 + q x^3 + x^5: b = q + bend^2, and without bend folds x = -f(x) at p = -q^2/4.
    exact = of_two(lambda x, p: (-(1 + p.p) * x[0] + bend * x[0] ** 2 + p.q * x[0] ** 3 + x[0] ** 5,), -0.5, 0.7, "x")
    curve = curve_of(exact, [0.0], DOUBLING)
    (found,) = curve.codimension_two()
    assert found.kind is POINT.GENERALISED_FLIP
    np.testing.assert_allclose(found.values, [0.0, -(bend**2)], atol=1e-11)
    folds = switch_curve(curve, found, *UNIT, step=0.05)
    assert (folds.kind, folds.period, folds.ends[0]) == (FOLD, 2, "generalised flip")
    if not bend:
        np.testing.assert_allclose(folds.values[:, 0], -(folds.values[:, 1] ** 2) / 4.0, atol=1e-11)
    images = exact.with_params(p=float(folds.values[-1, 0]), q=float(folds.values[-1, 1])).iterate(folds.points[-1], 2)
    np.testing.assert_allclose(images.points, folds.points[-1], atol=1e-11)


def test_a_degenerate_pitchfork_and_the_folds_that_begin_there() -> None:
    exact = of_two(lambda x, p: ((1 + p.p) * x[0] + p.q * x[0] ** 3 + x[0] ** 5,), -0.5, 0.7, "x")
    curve = curve_of(exact, [0.0], PITCHFORK)
    (found,) = curve.codimension_two()
    assert found.kind is POINT.DEGENERATE_PITCHFORK
    folds = switch_curve(curve, found, *UNIT, step=0.05)
    assert (folds.period, folds.ends[0]) == (1, "degenerate pitchfork")
    np.testing.assert_allclose(folds.values[:, 0], folds.values[:, 1] ** 2 / 4.0, atol=1e-11)


def rotated(x: Any, factor: Any) -> tuple[Any, Any]:
    return factor * (cos(THETA) * x[0] - sin(THETA) * x[1]), factor * (sin(THETA) * x[0] + cos(THETA) * x[1])


def test_a_chenciner_bifurcation() -> None:
    def ring(x: Any, p: Any) -> Any:
        r = x[0] ** 2 + x[1] ** 2
        return rotated(x, 1 + p.p + p.q * r - r**2)

    (found,) = curve_of(of_two(ring, -0.2, 0.33, "x", "y"), [0.0, 0.0], NEIMARK_SACKER).codimension_two()
    assert found.kind is POINT.CHENCINER
    np.testing.assert_allclose(found.values, 0.0, atol=1e-11)


@pytest.mark.parametrize("apart", [0.02, 1e-4])
def test_two_chenciner_bifurcations_within_a_step(apart: float) -> None:
    def ring(x: Any, p: Any) -> Any:
        r = x[0] ** 2 + x[1] ** 2
        return rotated(x, 1 + p.p + ((p.q - 0.013) ** 2 - apart**2) * r - r**2)

    points = curve_of(of_two(ring, -0.2, 0.33, "x", "y"), [0.0, 0.0], NEIMARK_SACKER).codimension_two()
    assert {p.kind for p in points} == {POINT.CHENCINER}
    np.testing.assert_allclose(sorted(p.values[1] for p in points), [0.013 - apart, 0.013 + apart], atol=1e-11)


def test_fold_and_flip_with_neimark_sacker() -> None:
    # u = sqrt(q) has the multiplier 1 - 2 u, and the plane 1 + p + u/2: p = -u/2 on the curve.  The coefficient is
    # -1 + 0.3/(4 u), zero at u = 0.075.
    def fold_and_pair(x: Any, p: Any) -> Any:
        r, u = x[0] ** 2 + x[1] ** 2, x[2]
        return *rotated(x, 1 + p.p + 0.5 * u - r), u + p.q - u * u + 0.3 * r

    exact = of_two(fold_and_pair, -0.4, 0.25, "x", "y", "u")
    curve = curve_of(exact, [0.0, 0.0, 0.5], NEIMARK_SACKER, ((-1.0, 0.5), (-0.5, 1.5)))
    expected = {
        POINT.FOLD_NEIMARK_SACKER: (0.0, 0.0),
        POINT.CHENCINER: (-0.0375, 0.005625),
        POINT.FLIP_NEIMARK_SACKER: (-0.5, 1.0),
    }
    assert {p.kind for p in curve.codimension_two()} == set(expected)
    for point in curve.codimension_two():
        np.testing.assert_allclose(point.values, expected[point.kind], atol=1e-10)
    folds = switch_curve(curve, only(curve, POINT.FOLD_NEIMARK_SACKER), (-1.0, 0.5), (-0.5, 1.5), step=0.1)
    np.testing.assert_allclose(folds.values[:, 1], 0.0, atol=1e-11)
    assert [p.kind for p in folds.codimension_two()] == [POINT.FOLD_NEIMARK_SACKER]
    flips = switch_curve(curve, only(curve, POINT.FLIP_NEIMARK_SACKER), (-1.0, 0.5), (-0.5, 1.5), step=0.1)
    np.testing.assert_allclose(flips.values[:, 1], 1.0, atol=1e-11)


def test_the_cusp_of_the_duffing_oscillator() -> None:
    """Where the resonance curve begins to hang over, its quadratic coefficient by SciPy's integration is zero."""
    exact = stroboscopic_map(duffing_oscillator(damping=0.1, forcing=0.3, frequency=1.5), rtol=1e-12, atol=1e-12)
    box = (1.0, 2.0), (0.01, 0.4)
    curve = curve_of(exact, [0.0, 0.0], FOLD, box, ("frequency", "forcing"))
    cusp = only(curve, POINT.CUSP)
    frequency, forcing = cusp.values.tolist()
    system = duffing_oscillator(damping=0.1, forcing=forcing, frequency=frequency)
    assert abs(Differences(system, cusp.point, (1.0, 1.0), 0.02).coefficient(FOLD)) < 1e-6
    assert np.abs(curve.values[:, 0] - frequency).min() > 1e-6
    assert cusp.normal_form is not None
    cubic = Differences(system, cusp.point, (1.0, 1.0), 0.02).coefficient(PITCHFORK)
    assert cusp.normal_form.coefficients["c"] == pytest.approx(cubic, rel=1e-5)


def test_points_are_computed_once_and_in_parts_that_can_be_stopped() -> None:
    exact = of_two(lambda x, p: (x[0] + p.p + p.q * x[0] - x[0] ** 3,), 0.0, 0.7, "x")
    curve = curve_of(exact, [sqrt(0.7)], FOLD)
    with pytest.raises(Stopped), heeding(Stop(0.0)):
        curve.codimension_two()
    found = curve.codimension_two(progress=True)
    assert curve.codimension_two() is found
    assert curve.with_zeros({"none": lambda t, x, p: x[0] - 9.0}).codimension_two() is found
    assert curve.degeneracies() == frozenset()


def test_a_map_with_parameters_in_its_state_is_specified_once() -> None:
    """Derivatives of a higher order are integrated by a method that is chosen once, not at each point."""
    swept = swept_map(stroboscopic_map(duffing_oscillator()), "frequency", "forcing").specified
    assert isinstance(swept, Swept)
    assert swept.vectorised is swept.vectorised


def test_points_without_another_curve_are_refused(henon: dict[BifurcationKind, BifurcationCurve]) -> None:
    with pytest.raises(ValueError, match=r"1:3 resonance at .* no other curve"):
        switch_curve(henon[NEIMARK_SACKER], only(henon[NEIMARK_SACKER], POINT.RESONANCE_1_3), *WIDE)
    with pytest.raises(ValueError, match="second="):
        switch_curve(henon[FOLD], only(henon[FOLD], POINT.RESONANCE_1_1), WIDE[0], (-2.0, 0.0))


def test_a_point_is_shown_in_a_line(henon: dict[BifurcationKind, BifurcationCurve]) -> None:
    assert repr(only(henon[FOLD], POINT.FOLD_FLIP)).startswith("CodimensionTwo(fold-flip at alpha=")


def monodromy(frequency: float, forcing: float, state: Any) -> tuple[Any, Any]:
    """Return the image of a state of van der Pol's oscillator after a period, and its derivative, by SciPy."""

    def rhs(t: float, s: Any) -> Any:
        x, v, rest = s[0], s[1], s[2:].reshape(2, 2)
        slope = np.array([[0.0, 1.0], [-2.0 * x * v - 1.0, 1.0 - x * x]])
        return [v, (1.0 - x * x) * v - x + forcing * cos(frequency * t), *(slope @ rest).ravel()]

    start = [*state, 1.0, 0.0, 0.0, 1.0]
    end = solve_ivp(rhs, (0.0, 2.0 * pi / frequency), start, "DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    return end[:2], end[2:].reshape(2, 2)


def test_resonances_of_the_forced_van_der_pol_oscillator() -> None:
    """Points of codimension two on both borders of entrainment have the trace and the determinant of their kind."""
    exact = stroboscopic_map(van_der_pol_oscillator(1.0, 1.0, 1.1), rtol=1e-11, atol=1e-11)
    start = periodic_orbit(exact, exact.iterate([2.0, 0.0], 60).points)
    branch = continue_orbit(exact, start, "frequency", 0.6, 1.6, step=0.05)
    box = (0.6, 1.6), (0.05, 2.5)
    folds = continue_bifurcation(branch, branch.of_kind(FOLD)[0], "forcing", *box, step=0.05)
    turned = next(p for p in folds.codimension_two() if p.kind is POINT.RESONANCE_1_1 and p.values[0] > 1.0)
    tori = switch_curve(folds, turned, *box, step=0.1)
    traces = {POINT.RESONANCE_1_1: 2.0, POINT.RESONANCE_1_4: 0.0, POINT.RESONANCE_1_3: -1.0}
    assert [p.kind for p in folds.codimension_two()].count(POINT.CUSP) == 2
    assert {p.kind for p in tori.codimension_two()} == set(traces)
    for point in tori.codimension_two():
        image, matrix = monodromy(*point.values, point.point)
        np.testing.assert_allclose(image, point.point, atol=1e-9)
        assert np.trace(matrix) == pytest.approx(traces[point.kind], abs=1e-8)
        assert np.linalg.det(matrix) == pytest.approx(1.0, abs=1e-8)
