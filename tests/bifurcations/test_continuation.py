"""Branches of periodic orbits and their bifurcations: exact values, figures of the report, equilibria by Floquet."""

from __future__ import annotations

from math import pi, sqrt
from typing import Any

import numpy as np
import pytest
from branch_kinds import DOUBLING, FOLD, NEIMARK_SACKER, PITCHFORK, TRANSCRITICAL, kinds

from cellmap import PointMap, continue_orbit, discrete_map, find_attractors, periodic_orbit, set_threads
from cellmap.bifurcations import Branch, continue_bifurcation, period_doubling_cascade, switch_branch
from cellmap.orbits import PeriodicOrbit
from systems import henon_map, logistic_map

# Discrete maps, whose branches are known in closed form.


def test_the_logistic_map() -> None:
    exact = logistic_map(2.0)
    branch = continue_orbit(exact, periodic_orbit(exact, [0.5]), "mu", 0.5, 4.0)
    assert kinds(branch) == [TRANSCRITICAL, DOUBLING]
    np.testing.assert_allclose([b.value for b in branch.bifurcations], [1.0, 3.0], rtol=1e-12)
    np.testing.assert_allclose(branch.points[:, 0], 1.0 - 1.0 / branch.values, atol=1e-12)
    np.testing.assert_allclose(branch.multipliers[:, 0].real, 2.0 - branch.values, atol=1e-11)
    assert [(b.before, b.after) for b in branch.bifurcations] == [(1, 0), (0, 1)]
    assert branch.ends == ("left the interval", "left the interval")
    assert branch.values[0] == pytest.approx(0.5, rel=1e-13)
    assert branch.values[-1] == pytest.approx(4.0, rel=1e-13)

    doubled = switch_branch(branch, branch.bifurcations[1], 2.5, 4.0)
    assert doubled.period == 2
    assert doubled.bifurcations[0].value == pytest.approx(1.0 + sqrt(6.0), rel=1e-12)
    mu = doubled.values
    split = np.sqrt((mu - 3.0) * (mu + 1.0))
    exact_points = np.stack([mu + 1.0 + split, mu + 1.0 - split]) / (2.0 * mu)
    assert np.abs(doubled.points[:, 0] - exact_points).min(axis=0).max() < 1e-12

    other = switch_branch(branch, branch.bifurcations[0], 0.5, 4.0)
    np.testing.assert_allclose(other.points, 0.0, atol=1e-13)


def test_both_sides_of_a_doubling_are_one_orbit() -> None:
    exact = logistic_map(2.8)
    branch = continue_orbit(exact, periodic_orbit(exact, [0.5]), "mu", 2.0, 3.4)
    (doubling,) = branch.bifurcations
    orbits = [switch_branch(branch, doubling, 2.0, 3.4, side=side).orbits_at(3.3)[0] for side in (1, -1)]
    np.testing.assert_allclose(orbits[0].points, orbits[1].points, rtol=1e-12)


def test_the_henon_map(henon: Branch) -> None:
    # Fixed points exist from a = -(1 - b)^2/4 on; the stable one doubles at a = 3 (1 - b)^2/4.
    fold, doubling = henon.bifurcations
    assert (fold.kind, doubling.kind) == (FOLD, DOUBLING)
    assert fold.value == pytest.approx(-(0.7**2) / 4.0, rel=1e-13)
    assert doubling.value == pytest.approx(3.0 * 0.7**2 / 4.0, rel=1e-13)
    assert [o.kind for o in henon.orbits_at(-0.11)] == ["saddle", "node"]
    x = (-0.7 + sqrt(0.49 + 4.0 * 0.3)) / 0.6
    np.testing.assert_allclose(henon.orbits_at(0.3)[-1].points, [[x, 0.3 * x]], rtol=1e-12)
    assert henon.orbits_at(2.0) == ()


def test_curves_over_both_parameters_of_henon(henon: Branch) -> None:
    for bifurcation, factor in zip(henon.bifurcations, (-0.25, 0.75), strict=True):
        curve = continue_bifurcation(henon, bifurcation, "b", (-1.0, 2.0), (-0.95, 0.95), step=0.02, max_points=200)
        a, b = curve.values.T
        np.testing.assert_allclose(a, factor * (1.0 - b) ** 2, atol=1e-12)
        assert np.ptp(b) > 1.0
        unit = 1.0 if bifurcation.kind is FOLD else -1.0
        np.testing.assert_allclose(np.abs(curve.multipliers - unit).min(axis=1), 0.0, atol=1e-6)


def test_a_neimark_sacker_bifurcation() -> None:
    # Delayed logistic map: at r = 2 the multipliers of x = y/c = (1 - 1/r)/c are exp(+-i pi/3), for every c.
    exact = discrete_map(
        lambda x, p: (p.r * x[0] * (1.0 - x[1]), p.c * x[0]), {"r": 1.7, "c": 1.0}, ("x", "y"), name="delayed logistic"
    )
    branch = continue_orbit(exact, periodic_orbit(exact, [0.4, 0.4]), "r", 1.5, 2.3)
    (found,) = branch.bifurcations
    assert (found.kind, found.before, found.after) == (NEIMARK_SACKER, 0, 2)
    assert found.value == pytest.approx(2.0, rel=1e-12)
    assert np.angle(found.multipliers[0]) == pytest.approx(pi / 3.0, rel=1e-10)
    with pytest.raises(ValueError, match="no branch of periodic orbits"):
        switch_branch(branch, found, 1.5, 2.3)
    curve = continue_bifurcation(branch, found, "c", (1.5, 2.3), (0.5, 2.0))
    np.testing.assert_allclose(curve.values[:, 0], 2.0, rtol=1e-12)
    np.testing.assert_allclose(curve.points[:, 1], 0.5, rtol=1e-12)
    assert np.ptp(curve.values[:, 1]) > 1.4


def test_neutral_saddles_are_no_bifurcation() -> None:
    # Multipliers m and 2 - m of a linear map: their product is 1 only where both are.
    linear = discrete_map(lambda x, p: (p.m * x[0], x[1] / 3.0), {"m": 2.0}, ("x", "y"))
    branch = continue_orbit(linear, periodic_orbit(linear, [0.0, 0.0]), "m", 1.5, 4.0)
    assert branch.bifurcations == ()
    assert (branch.unstable == 1).all()


def test_a_pitchfork_and_its_branches() -> None:
    cubic = discrete_map(lambda x, p: (p.m * x[0] - x[0] ** 3,), {"m": 0.5}, ("x",))
    branch = continue_orbit(cubic, periodic_orbit(cubic, [0.1]), "m", -0.5, 3.0)
    (pitchfork,) = branch.bifurcations
    assert pitchfork.kind is PITCHFORK
    assert pitchfork.value == pytest.approx(1.0, rel=1e-13)
    for side in (1, -1):
        arm = switch_branch(branch, pitchfork, -0.5, 3.0, side=side)
        np.testing.assert_allclose(arm.points[:, 0] ** 2, arm.values - 1.0, atol=1e-11)
        assert kinds(arm) == [DOUBLING]
        assert arm.bifurcations[0].value == pytest.approx(2.0, rel=1e-12)
        assert len(np.unique(np.sign(arm.points))) == 1


@pytest.mark.parametrize("half", [1e-3, 1e-4])
def test_doublings_that_are_close_together_change_the_stability(half: float) -> None:
    """The multiplier q^2 - half^2 - 1 is outside the unit circle by half^2 at most, down to 1e-8."""
    pair = discrete_map(
        lambda x, p: (x[0] * (p.q**2 - p.half**2 - 1.0) + x[0] ** 3,), {"q": -0.5, "half": half}, ("x",)
    )
    found = continue_orbit(pair, periodic_orbit(pair, [0.0]), "q", -0.9, 0.9).bifurcations
    assert [(b.kind, b.before, b.after) for b in found] == [(DOUBLING, 0, 1), (DOUBLING, 1, 0)]
    np.testing.assert_allclose([b.value for b in found], [-half, half], rtol=1e-6)


@pytest.mark.parametrize("radius", [1e-3, 1e-2])
def test_a_small_isola_in_a_wide_interval_is_closed(radius: float) -> None:
    """The circle x^2 + q^2 = radius^2, in the natural size of x an ellipse with ends as sharp as radius^2."""
    ring = discrete_map(
        lambda x, p: (x[0] + 0.3 * (p.radius**2 - x[0] ** 2 - p.q**2),), {"q": 0.0, "radius": radius}, ("x",)
    )
    branch = continue_orbit(ring, periodic_orbit(ring, [radius]), "q", -2.0, 2.0)
    assert branch.ends == ("closed", "closed")
    np.testing.assert_allclose(branch.points[:, 0] ** 2 + branch.values**2, radius**2, rtol=1e-9)
    np.testing.assert_allclose(sorted(b.value for b in branch.of_kind(FOLD)), [-radius, radius], rtol=1e-9)


def test_an_isola_is_closed() -> None:
    # Fixed points on the circle x^2 + q^2 = 1, traced once around.
    ring = discrete_map(lambda x, p: (x[0] + 0.3 * (1.0 - x[0] ** 2 - p.q**2),), {"q": 0.0}, ("x",))
    branch = continue_orbit(ring, periodic_orbit(ring, [0.9]), "q", -2.0, 2.0)
    assert "closed" in branch.ends
    np.testing.assert_allclose(branch.points[:, 0] ** 2 + branch.values**2, 1.0, atol=1e-12)
    np.testing.assert_allclose(sorted(b.value for b in branch.of_kind(FOLD)), [-1.0, 1.0], rtol=1e-12)


@pytest.mark.parametrize("exact", [logistic_map(2.8), henon_map(0.2, 0.3)], ids=["logistic", "henon"])
def test_feigenbaum(exact: PointMap) -> None:
    name, limit = ("mu", 4.0) if exact.dimension == 1 else ("a", 1.4)
    start = periodic_orbit(exact, [0.6] * exact.dimension)
    cascade = period_doubling_cascade(exact, start, name, limit, doublings=7)
    assert cascade.periods.tolist() == [2, 4, 8, 16, 32, 64, 128]
    assert cascade.ratios[-1] == pytest.approx(4.669201609, rel=0.01)
    # Accumulation points: Feigenbaum 1978; Derrida, Gervois, Pomeau, Journal of Physics A 12 (1979) 269.
    assert cascade.accumulation == pytest.approx(3.569945672 if name == "mu" else 1.058049, rel=1e-6)


# The driven pendulum.


def test_threads_change_no_bit(pendulum: PointMap) -> None:
    rotation = periodic_orbit(pendulum, [2.52, 320.4])
    branches = []
    for threads in (1, 2):
        set_threads(threads)
        branches.append(continue_orbit(pendulum, rotation, "amplitude", 0.001, 0.004, step=0.05))
    assert branches[0].values.tobytes() == branches[1].values.tobytes()
    assert branches[0].points.tobytes() == branches[1].points.tobytes()


def test_a_longer_step_finds_the_same(pendulum: PointMap) -> None:
    hanging = periodic_orbit(pendulum, [0.0, 0.0])
    values = [
        [b.value for b in continue_orbit(pendulum, hanging, "amplitude", 0.0, 0.014, step=step).bifurcations]
        for step in (0.2, 0.003)
    ]
    np.testing.assert_allclose(values[0], values[1], rtol=1e-11)


def test_the_number_of_points_is_kept(pendulum: PointMap) -> None:
    branch = continue_orbit(pendulum, periodic_orbit(pendulum, [0.0, 0.0]), "amplitude", 0.0, 0.014, max_points=5)
    assert branch.ends == ("most points", "most points")
    assert len(branch.values) == 11


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"parameter": "depth"}, ValueError, "parameter='depth'"),
        ({"lower": 0.005}, ValueError, "must contain amplitude=0.003"),
        ({"lower": 0.01, "upper": 0.002}, ValueError, "upper=0.002: give a number above"),
        ({"step": 0.0}, ValueError, "step=0.0"),
        ({"max_points": 0}, ValueError, "max_points=0"),
        ({"upper": float("nan")}, ValueError, "upper=nan"),
        ({"orbit": [0.0, 0.0]}, TypeError, "give a PeriodicOrbit or an Attractor"),
        ({"point_map": "map"}, TypeError, "give a PointMap"),
    ],
)
def test_bad_input_is_refused(pendulum: PointMap, change: Any, error: type[Exception], message: str) -> None:
    arguments = {
        "point_map": pendulum,
        "orbit": periodic_orbit(pendulum, [0.0, 0.0]),
        "parameter": "amplitude",
        "lower": 0.0,
        "upper": 0.01,
    }
    with pytest.raises(error, match=message):
        continue_orbit(**{**arguments, **change})


def test_an_orbit_of_other_parameters_is_refused(pendulum: PointMap) -> None:
    rotation = periodic_orbit(pendulum, [2.52, 320.4])
    with pytest.raises(ValueError, match="is no orbit of period 1"):
        continue_orbit(pendulum.with_params(amplitude=0.004), rotation, "amplitude", 0.0, 0.01)


def test_bad_bifurcations_are_refused(inverted: Branch, henon: Branch) -> None:
    pitchfork = inverted.bifurcations[0]
    with pytest.raises(ValueError, match="must contain the bifurcation"):
        switch_branch(inverted, pitchfork, 0.004, 0.01)
    with pytest.raises(ValueError, match="side=2"):
        switch_branch(inverted, pitchfork, 0.001, 0.01, side=2)
    with pytest.raises(ValueError, match="no branch of periodic orbits"):
        switch_branch(henon, henon.bifurcations[0], -1.0, 1.0)
    with pytest.raises(ValueError, match="parameter='depth'"):
        continue_bifurcation(inverted, pitchfork, "depth", (0.001, 0.01), (0.0, 1.0))
    with pytest.raises(ValueError, match="second="):
        continue_bifurcation(inverted, pitchfork, "frequency", (0.001, 0.01), (60.0, 80.0))
    with pytest.raises(TypeError, match="two numbers"):
        continue_bifurcation(inverted, pitchfork, "frequency", 0.01, (40.0, 80.0))
    with pytest.raises(TypeError, match="give a Branch"):
        continue_bifurcation(pitchfork, inverted, "frequency", (0.001, 0.01), (40.0, 80.0))


def test_a_cascade_needs_a_stable_orbit(pendulum: PointMap) -> None:
    saddle = periodic_orbit(pendulum, [2.13, 0.9])
    with pytest.raises(ValueError, match="give a stable orbit"):
        period_doubling_cascade(pendulum, saddle, "amplitude", 0.016)
    with pytest.raises(ValueError, match=r"limit=0\.003"):
        period_doubling_cascade(pendulum, saddle, "amplitude", 0.003)
    with pytest.raises(ValueError, match="give a periodic orbit"):
        chaotic = find_attractors(henon_map(), [[0.1, 0.1]])[0]
        period_doubling_cascade(henon_map(), chaotic, "a", 1.2)


def test_a_record_is_shown_in_a_line(inverted: Branch) -> None:
    assert repr(inverted.bifurcations[0]) == "Bifurcation(pitchfork at 0.00232902113598, 1 -> 0 unstable)"
    assert repr(inverted).startswith("Branch(period 1, ")
    orbits = inverted.orbits_at(0.004)
    assert len(orbits) == 1
    assert isinstance(orbits[0], PeriodicOrbit)
