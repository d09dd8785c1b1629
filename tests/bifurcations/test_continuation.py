"""Branches of periodic orbits and their bifurcations: maps in closed form, and the driven pendulum."""

from math import pi, sqrt

import numpy as np
import pytest
from branch_kinds import DOUBLING, FOLD, LEFT, PITCHFORK, TRANSCRITICAL, kinds, values
from cases import branch_at_rest, branch_of, thorough

from cellmap import discrete_map, periodic_orbit, set_threads
from cellmap.bifurcations import continue_bifurcation, critical_values, period_doubling_cascade, switch_branch
from systems import driven_pendulum, henon_map, logistic_map

# Discrete maps.


def test_the_logistic_map():
    branch = branch_of(logistic_map(2.0), [0.5], "mu", 0.5, 4.0)
    assert kinds(branch) == [TRANSCRITICAL, DOUBLING] and branch.ends == LEFT
    np.testing.assert_allclose([*values(branch), *branch.values[[0, -1]]], [1.0, 3.0, 0.5, 4.0], rtol=1e-12)
    np.testing.assert_allclose(branch.points[:, 0], 1.0 - 1.0 / branch.values, atol=1e-12)
    np.testing.assert_allclose(branch.multipliers[:, 0].real, 2.0 - branch.values, atol=1e-11)
    assert [(b.before, b.after) for b in branch.bifurcations] == [(1, 0), (0, 1)]

    doubled, other_side = (switch_branch(branch, branch.bifurcations[1], 2.5, 4.0, side=side) for side in (1, -1))
    assert doubled.period == 2
    assert doubled.bifurcations[0].value == pytest.approx(1.0 + sqrt(6.0), rel=1e-12)
    mu = doubled.values
    split = np.sqrt((mu - 3.0) * (mu + 1.0))
    exact_points = np.stack([mu + 1.0 + split, mu + 1.0 - split]) / (2.0 * mu)
    assert np.abs(doubled.points[:, 0] - exact_points).min(axis=0).max() < 1e-12
    np.testing.assert_allclose(*(b.orbits_at(3.3)[0].points for b in (doubled, other_side)), rtol=1e-12)

    other = switch_branch(branch, branch.bifurcations[0], 0.5, 4.0)
    np.testing.assert_allclose(other.points, 0.0, atol=1e-13)
    short = branch_of(logistic_map(2.0), [0.5], "mu", 0.5, 4.0, max_points=5)
    assert short.ends == ("most points", "most points") and len(short.values) == 11


def test_the_henon_map_and_its_curves(henon):
    # Fixed points exist from a = -(1 - b)^2/4 on; the stable one doubles at a = 3 (1 - b)^2/4.
    assert kinds(henon) == [FOLD, DOUBLING]
    assert values(henon) == pytest.approx([-(0.7**2) / 4.0, 3.0 * 0.7**2 / 4.0], rel=1e-13)
    assert [o.kind for o in henon.orbits_at(-0.11)] == ["saddle", "node"]
    x = (-0.7 + sqrt(0.49 + 4.0 * 0.3)) / 0.6
    np.testing.assert_allclose(henon.orbits_at(0.3)[-1].points, [[x, 0.3 * x]], rtol=1e-12)
    assert henon.orbits_at(2.0) == ()
    np.testing.assert_array_equal(henon.orbit(3).points, henon.points[3:4])
    for bifurcation, factor in zip(henon.bifurcations, (-0.25, 0.75), strict=True):
        curve = continue_bifurcation(henon, bifurcation, "b", (-1.0, 2.0), (-0.95, 0.95), step=0.02, max_points=200)
        a, b = curve.values.T
        np.testing.assert_allclose(a, factor * (1.0 - b) ** 2, atol=1e-12)
        assert np.ptp(b) > 1.0
        unit = 1.0 if bifurcation.kind is FOLD else -1.0
        np.testing.assert_allclose(np.abs(curve.multipliers - unit).min(axis=1), 0.0, atol=1e-6)
    edges = continue_bifurcation(henon, henon.bifurcations[1], "b", (-1.0, 1.0), (0.0, 0.9)).values[:, 1]
    assert (edges.min(), edges.max()) == pytest.approx((0.0, 0.9), abs=1e-13)


@pytest.mark.parametrize("half", [1e-2, 1e-4])
def test_doublings_that_are_close_together_change_the_stability(half):
    """The multiplier (q - 0.3037)^2 - half^2 - 1 is outside the unit circle by half^2 at most, down to 1e-8."""
    pair = discrete_map(
        lambda x, p: (x[0] * ((p.q - 0.3037) ** 2 - p.half**2 - 1.0) + x[0] ** 3,), {"q": 0.0, "half": half}, ("x",)
    )
    found = branch_at_rest(pair, "q", -1.0, 1.0).bifurcations
    assert [(b.kind, b.before, b.after) for b in found] == [(DOUBLING, 0, 1), (DOUBLING, 1, 0)]
    np.testing.assert_allclose([b.value - 0.3037 for b in found], [-half, half], rtol=1e-6)


def test_a_branch_ends_at_the_first_of_several_functions():
    fold = discrete_map(lambda x, p: (x[0] + p.q - x[0] ** 2,), {"q": 0.25}, ("x",))
    until = {"far": lambda t, x, p: p.q - 0.6001, "near": lambda t, x, p: p.q - 0.6}
    branch = branch_of(fold, [0.5], "q", -0.3, 0.8, until=until)
    assert branch.ends == ("near", "near") and branch.values[[0, -1]] == pytest.approx(0.6, abs=1e-13)


@pytest.mark.parametrize("exact", [logistic_map(2.8), thorough(henon_map(0.2, 0.3))], ids=["logistic", "henon"])
def test_feigenbaum(exact):
    name, limit = ("mu", 4.0) if exact.dimension == 1 else ("a", 1.4)
    cascade = period_doubling_cascade(exact, periodic_orbit(exact, [0.6] * exact.dimension), name, limit, doublings=7)
    assert cascade.periods.tolist() == [2, 4, 8, 16, 32, 64, 128]
    assert cascade.ratios[-1] == pytest.approx(4.669201609, rel=0.01)
    # Accumulation points: Feigenbaum 1978; Derrida, Gervois, Pomeau, Journal of Physics A 12 (1979) 269.
    assert cascade.accumulation == pytest.approx(3.569945672 if name == "mu" else 1.058049, rel=1e-6)


# The driven pendulum, against the numbers of tests/REFERENCES.md, and equilibria against Floquet's theory.


def test_the_inverted_state(inverted):
    gained, lost = inverted.bifurcations
    assert (gained.kind, lost.kind) == (PITCHFORK, DOUBLING)
    assert [1e3 * gained.value, 1e3 * lost.value] == pytest.approx([2.329021135978, 12.542910208], abs=1e-9)
    np.testing.assert_allclose(np.abs(inverted.points[:, 0]), pi, atol=1e-10)
    assert repr(gained) == "Bifurcation(pitchfork at 0.00232902113598, 1 -> 0 unstable)"
    assert repr(inverted).startswith("Branch(period 1, ")
    for value in (0.004, *inverted.values[[0, -1]].tolist()):
        (orbit,) = inverted.orbits_at(value)
        np.testing.assert_allclose(np.abs(orbit.points[0, 0]), pi, rtol=1e-12)


@pytest.mark.thorough
def test_curves_of_the_inverted_state_are_those_of_floquet(inverted):
    for bifurcation in inverted.bifurcations:
        curve = continue_bifurcation(inverted, bifurcation, "frequency", (0.0005, 0.05), (20.0, 100.0), step=0.05)
        for amplitude, frequency in curve.values[:: max(1, len(curve.values) // 3)]:
            system = driven_pendulum(frequency=frequency)
            (expected,) = critical_values(system, [pi, 0.0], "amplitude", 0.9 * amplitude, 1.1 * amplitude)
            assert amplitude == pytest.approx(expected.value, rel=1e-10)


@pytest.mark.parametrize("sign", [1.0, thorough(-1.0)])
def test_rotations_are_born_in_a_fold(pendulum, sign):
    branch = branch_of(pendulum, [sign * 2.52, sign * 320.4], "amplitude", 0.001, 0.006)
    assert kinds(branch) == [FOLD]
    assert 1e3 * branch.bifurcations[0].value == pytest.approx(1.731758671939, abs=1e-9)
    saddle, focus = branch.orbits_at(0.003)
    assert (saddle.name, focus.name) == ("saddle", "stable focus")
    known = [sign * 2.520339579944, sign * 1.019933227842]
    np.testing.assert_allclose(focus.points[0] / [1.0, 100 * pi], known, rtol=1e-10)


def test_threads_change_no_bit(pendulum):
    branches = []
    for threads in (1, 2):
        set_threads(threads)
        branches.append(branch_of(pendulum, [2.52, 320.4], "amplitude", 0.001, 0.004, step=0.05))
    assert branches[0].values.tobytes() == branches[1].values.tobytes()
    assert branches[0].points.tobytes() == branches[1].points.tobytes()
