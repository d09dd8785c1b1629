"""Branches of periodic orbits and their bifurcations: exact values, figures of the report, equilibria by Floquet."""

from __future__ import annotations

from math import cos, pi, sqrt
from typing import Any

import numpy as np
import pytest

from cellmap import (
    CellGrid,
    ForcedSystem,
    PointMap,
    angle,
    continue_orbit,
    discrete_map,
    find_attractors,
    find_periodic_orbits,
    periodic_orbit,
    set_threads,
    stroboscopic_map,
)
from cellmap.bifurcations import (
    BifurcationKind,
    Branch,
    continue_bifurcation,
    critical_values,
    period_doubling_cascade,
    switch_branch,
)
from cellmap.orbits import PeriodicOrbit
from systems import double_pendulum, driven_pendulum, henon_map, logistic_map, standard_map

FOLD, DOUBLING = BifurcationKind.FOLD, BifurcationKind.PERIOD_DOUBLING
PITCHFORK, TRANSCRITICAL = BifurcationKind.PITCHFORK, BifurcationKind.TRANSCRITICAL
NEIMARK_SACKER = BifurcationKind.NEIMARK_SACKER


@pytest.fixture(scope="module")
def pendulum() -> PointMap:
    return stroboscopic_map(driven_pendulum(amplitude=0.003), rtol=1e-12, atol=1e-12)


@pytest.fixture(scope="module")
def inverted(pendulum: PointMap) -> Branch:
    return continue_orbit(pendulum, periodic_orbit(pendulum, [pi, 0.0]), "amplitude", 0.001, 0.014)


@pytest.fixture(scope="module")
def henon() -> Branch:
    exact = henon_map(0.2, 0.3)
    return continue_orbit(exact, periodic_orbit(exact, [0.5, 0.2]), "a", -1.0, 1.4, max_points=300)


def kinds(branch: Branch) -> list[BifurcationKind]:
    return [b.kind for b in branch.bifurcations]


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


def test_the_inverted_state(inverted: Branch) -> None:
    gained, lost = inverted.bifurcations
    assert (gained.kind, lost.kind) == (PITCHFORK, DOUBLING)
    assert 1e3 * gained.value == pytest.approx(2.329021135978, abs=1e-9)
    assert 1e3 * lost.value == pytest.approx(12.542910208, abs=1e-9)
    np.testing.assert_allclose(np.abs(inverted.points[:, 0]), pi, atol=1e-10)


def test_rotations_are_born_in_a_fold(pendulum: PointMap) -> None:
    for sign in (1.0, -1.0):
        rotation = periodic_orbit(pendulum, [sign * 2.52, sign * 320.4])
        branch = continue_orbit(pendulum, rotation, "amplitude", 0.001, 0.006)
        (fold,) = branch.bifurcations
        assert fold.kind is FOLD
        assert 1e3 * fold.value == pytest.approx(1.731758671939, abs=1e-9)
        saddle, focus = branch.orbits_at(0.003)
        assert (saddle.name, focus.name) == ("saddle", "stable focus")
        np.testing.assert_allclose(
            focus.points[0] / [1.0, 100 * pi], [sign * 2.520339579944, sign * 1.019933227842], rtol=1e-10
        )


def test_the_critical_angle_is_a_branch_of_saddles(pendulum: PointMap, inverted: Branch) -> None:
    arm = switch_branch(inverted, inverted.bifurcations[0], 0.001, 0.005)
    (saddle,) = arm.orbits_at(0.003)
    found = find_periodic_orbits(pendulum, CellGrid((1.5, -50.0), (3.0, 50.0), (30, 30)))
    assert saddle.kind == "saddle"
    place = saddle.points[0] * np.sign(saddle.points[0, 0])
    assert any(np.allclose(place, o.points[0], rtol=1e-9) for o in found)


def test_curves_of_the_inverted_state_are_those_of_floquet(inverted: Branch) -> None:
    for bifurcation in inverted.bifurcations:
        curve = continue_bifurcation(inverted, bifurcation, "frequency", (0.0005, 0.05), (20.0, 100.0), step=0.05)
        for amplitude, frequency in curve.values[:: max(1, len(curve.values) // 6)]:
            system = driven_pendulum(frequency=frequency)
            (expected,) = critical_values(system, [pi, 0.0], "amplitude", 0.9 * amplitude, 1.1 * amplitude)
            assert amplitude == pytest.approx(expected.value, rel=1e-10)


def test_symmetric_orbits_lose_their_symmetry_before_they_double(pendulum: PointMap) -> None:
    hanging = periodic_orbit(pendulum, [0.1, 0.0])
    cascade = period_doubling_cascade(pendulum, hanging, "amplitude", 0.016, doublings=4)
    assert [b.kind for b in cascade.bifurcations] == [DOUBLING, PITCHFORK, DOUBLING, DOUBLING, DOUBLING]
    assert 1e3 * cascade.values[0] == pytest.approx(12.210173235, abs=1e-9)
    # What the branches say is what orbits do: a little before the last doubling the attractor has half its period.
    value = cascade.values[2] + 0.3 * (cascade.values[3] - cascade.values[2])
    exact = pendulum.with_params(amplitude=float(value))
    (orbit,) = cascade.branches[-1].orbits_at(float(value))
    attractors = find_attractors(exact, orbit.points[:1] + np.array([1e-6, 0.0]))
    assert attractors[0].period == cascade.periods[2] == 8


def test_the_swing_of_period_four_loses_its_symmetry(pendulum: PointMap) -> None:
    """At 10.637657006 mm, by an independent program: one multiplier is 1 there, and the swing its own mirror image."""
    at_ten = pendulum.with_params(amplitude=0.010)
    branch = continue_orbit(at_ten, periodic_orbit(at_ten, [0.536, -10.731], 4), "amplitude", 0.0099, 0.0108, step=0.1)
    (pitchfork,) = branch.bifurcations
    assert (pitchfork.kind, pitchfork.before, pitchfork.after) == (PITCHFORK, 0, 1)
    assert 1e3 * pitchfork.value == pytest.approx(10.637657006, abs=1e-9)
    points = branch.orbits_at(0.0105)[0].points
    np.testing.assert_allclose(points[2:], -points[:2], atol=1e-9 * np.abs(points).max())


def test_a_fold_of_the_duffing_oscillator() -> None:
    # Weak damping and drive: amplitudes from harmonic balance with two harmonics are near; the folds are those between
    # which two responses are found by direct search.
    def rhs(t: float, x: Any, p: Any) -> tuple[float, float]:
        q, v = x
        return v, -q - 0.05 * q**3 - 0.2 * v + 2.5 * cos(p.omega * t)

    system = ForcedSystem(rhs, {"omega": 1.0}, lambda p: 2 * pi / p.omega, ("q", "v"))
    exact = stroboscopic_map(system, rtol=1e-12, atol=1e-12)
    branch = continue_orbit(exact, periodic_orbit(exact, [2.0, 4.0]), "omega", 0.8, 2.5)
    upper, lower = branch.bifurcations
    assert kinds(branch) == [FOLD, FOLD]
    assert lower.value < upper.value
    for value, count in (
        (lower.value - 1e-4, 1),
        (lower.value + 1e-4, 3),
        (upper.value - 1e-4, 3),
        (upper.value + 1e-4, 1),
    ):
        assert len(branch.orbits_at(value)) == count
        window = CellGrid((-9.0, -16.0), (9.0, 16.0), (80, 80))
        assert len(find_periodic_orbits(exact.with_params(omega=value), window)) == count


@pytest.mark.slow
def test_neimark_sacker_of_the_double_pendulum() -> None:
    exact = stroboscopic_map(double_pendulum(), rtol=1e-12, atol=1e-12)
    state = periodic_orbit(exact, [0.0, pi, 0.0, 0.0])
    branch = continue_orbit(exact, state, "amplitude", 0.005, 0.0128)
    (found,) = branch.of_kind(NEIMARK_SACKER)
    assert 1e3 * found.value == pytest.approx(12.532158062, abs=1e-9)
    assert (found.before, found.after) == (0, 2)


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


# Cases in which bifurcations hide.


def at_rest(exact: PointMap) -> PeriodicOrbit:
    return periodic_orbit(exact, [0.0] * exact.dimension)


@pytest.mark.parametrize("upper", [1.5, 2.0, 3.0])
@pytest.mark.parametrize("begin", [0.1, 0.6, 0.7, 1.0])
def test_a_step_may_end_on_a_bifurcation(begin: float, upper: float) -> None:
    exact = discrete_map(lambda x, p: (-p.q * x[0] + x[0] ** 3,), {"q": begin}, ("x",))
    (doubling,) = continue_orbit(exact, at_rest(exact), "q", 0.0, upper).bifurcations
    assert doubling.kind is DOUBLING
    assert doubling.value == pytest.approx(1.0, rel=1e-12)


def test_a_neimark_sacker_bifurcation_at_a_round_number() -> None:
    # Bogdanov map: det = 1 + e at the origin.
    def bogdanov(x: Any, p: Any) -> tuple[float, float]:
        y = x[1] + p.e * x[1] + 1.2 * x[0] * (x[0] - 1.0)
        return x[0] + y, y

    for begin in (-0.1, 0.0):
        exact = discrete_map(bogdanov, {"e": begin}, ("x", "y"))
        (found,) = continue_orbit(exact, at_rest(exact), "e", -0.5, 0.5).bifurcations
        assert (found.kind, found.before, found.after) == (NEIMARK_SACKER, 0, 2)
        assert found.value == pytest.approx(0.0, abs=1e-12)


def test_the_start_may_be_a_bifurcation() -> None:
    (doubling,) = continue_orbit(
        logistic_map(3.0), periodic_orbit(logistic_map(3.0), [0.66]), "mu", 2.5, 3.3
    ).bifurcations
    assert doubling.value == pytest.approx(3.0, rel=1e-12)
    folding = discrete_map(lambda x, p: (x[0] + p.m - x[0] ** 2,), {"m": 0.0}, ("x",))
    found = continue_orbit(folding, at_rest(folding), "m", -1.0, 0.5).bifurcations
    assert [b.kind for b in found] == [FOLD]
    assert found[0].value == pytest.approx(0.0, abs=1e-12)


def test_pairs_within_a_step_are_seen() -> None:
    for e in (1e-4, 1e-5, 1e-6):
        exact = discrete_map(
            lambda x, p: ((-1 - p.e + (p.m - 0.3037) ** 2) * x[0] + x[0] ** 3,), {"e": e, "m": 0.0}, ("x",)
        )
        found = continue_orbit(exact, at_rest(exact), "m", -1.0, 1.0).bifurcations
        assert [b.kind for b in found] == [DOUBLING, DOUBLING]
        np.testing.assert_allclose([b.value for b in found], 0.3037 + np.sqrt(e) * np.array([-1, 1]), rtol=1e-11)


def test_multipliers_that_cross_together_are_reported() -> None:
    twins = discrete_map(lambda x, p: tuple(p.r * q * (1.0 - q) for q in x), {"r": 2.5}, ("x", "y"))
    branch = continue_orbit(twins, periodic_orbit(twins, [0.6, 0.6]), "r", 2.0, 3.6)
    (found,) = branch.bifurcations
    assert (found.kind, found.before, found.after) == (BifurcationKind.DEGENERATE, 0, 2)
    assert found.value == pytest.approx(3.0, rel=1e-7)
    assert branch.ends == ("left the interval", "left the interval")


def test_a_neutral_saddle_beside_a_pair_near_the_circle() -> None:
    c, s = 0.99 * cos(1.0), 0.99 * np.sin(1.0)
    exact = discrete_map(
        lambda x, p: (p.a * x[0], 2.0 * x[1], c * x[2] - s * x[3], s * x[2] + c * x[3]), {"a": 0.3}, tuple("wxyz")
    )
    branch = continue_orbit(exact, at_rest(exact), "a", 0.1, 0.837)
    assert branch.bifurcations == ()
    assert branch.ends == ("left the interval", "left the interval")


def test_krein_collisions() -> None:
    # Froeschle's map with different kicks, coupled antisymmetrically: pairs collide on the circle at |c| = 0.15.
    def coupled(x: Any, p: Any) -> tuple[float, ...]:
        a = x[2] - np.sin(x[0]) + p.c * np.sin(x[1])
        b = x[3] - 1.3 * np.sin(x[1]) - p.c * np.sin(x[0])
        return x[0] + a, x[1] + b, a, b

    exact = discrete_map(coupled, {"c": 0.01}, tuple("wxyz"))
    branch = continue_orbit(exact, at_rest(exact), "c", -0.5, 0.5)
    assert kinds(branch) == [NEIMARK_SACKER, NEIMARK_SACKER]
    np.testing.assert_allclose([b.value for b in branch.bifurcations], [-0.15, 0.15], rtol=1e-6)


def test_angles_that_enter_other_images() -> None:
    # The elliptic orbit of period two of the standard map, theta = pi/2 with p = pi there, loses its symmetry at 2 pi.
    exact = standard_map(1.0)
    branch = continue_orbit(exact, periodic_orbit(exact, [pi, 0.0]), "k", 0.5, 9.0)
    assert kinds(branch) == [DOUBLING]
    assert branch.bifurcations[0].value == pytest.approx(4.0, rel=1e-12)
    (pitchfork,) = switch_branch(branch, branch.bifurcations[0], 0.5, 9.0).bifurcations
    assert pitchfork.kind is PITCHFORK
    assert pitchfork.value == pytest.approx(2.0 * pi, rel=1e-12)


def test_a_branch_around_a_circle_is_traced_once() -> None:
    circle = discrete_map(lambda x, p: (x[0] + p.w - 0.5 * np.sin(x[0]),), {"w": 0.0}, (angle("x"),))
    branch = continue_orbit(circle, at_rest(circle), "w", -1.0, 1.0)
    assert branch.ends == ("closed", "closed")
    np.testing.assert_allclose(sorted(b.value for b in branch.bifurcations), [-0.5, 0.5], rtol=1e-12)


def test_a_closed_curve_over_two_parameters() -> None:
    exact = discrete_map(lambda x, p: (-(2.0 - p.q**2 - p.s**2) * x[0] - x[0] ** 3,), {"q": 0.1, "s": 0.1}, ("x",))
    branch = continue_orbit(exact, at_rest(exact), "q", -1.5, 1.5)
    curve = continue_bifurcation(branch, branch.bifurcations[0], "s", (-1.5, 1.5), (-1.5, 1.5))
    assert curve.ends == ("closed", "closed")
    np.testing.assert_allclose((curve.values**2).sum(axis=1), 1.0, rtol=1e-12)
    angles = np.unwrap(np.arctan2(*curve.values.T))
    assert 6.2 < abs(angles[-1] - angles[0]) < 6.4


def test_curves_end_on_the_edge(henon: Branch) -> None:
    curve = continue_bifurcation(henon, henon.bifurcations[1], "b", (-1.0, 1.0), (0.0, 0.9))
    assert curve.values[:, 1].min() == pytest.approx(0.0, abs=1e-13)
    assert curve.values[:, 1].max() == pytest.approx(0.9, abs=1e-13)


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_units_of_the_state(unit: float) -> None:
    cubic = discrete_map(lambda x, p: (p.m * x[0] - x[0] ** 3 / unit**2,), {"m": 0.5}, ("x",))
    branch = continue_orbit(cubic, at_rest(cubic), "m", -0.5, 3.0, sizes=[unit])
    arm = switch_branch(branch, branch.bifurcations[0], -0.5, 3.0)
    np.testing.assert_allclose(arm.points[:, 0] ** 2 / unit**2, arm.values - 1.0, atol=1e-11)
    assert arm.bifurcations[0].value == pytest.approx(2.0, rel=1e-12)
    with pytest.raises(ValueError, match="positive numbers"):
        continue_orbit(cubic, at_rest(cubic), "m", -0.5, 3.0, sizes=[0.0])


def test_the_orbits_at_the_ends(inverted: Branch) -> None:
    for end in (0, -1):
        (orbit,) = inverted.orbits_at(float(inverted.values[end]))
        np.testing.assert_allclose(np.abs(orbit.points[0, 0]), pi, rtol=1e-12)


def test_an_interval_beyond_the_system_is_refused(pendulum: PointMap) -> None:
    with pytest.raises(ValueError, match="period"):
        continue_orbit(pendulum, periodic_orbit(pendulum, [pi, 0.0]), "frequency", -10.0, 100.0)
