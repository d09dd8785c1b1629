"""Continuation where bifurcations hide: at ends of steps, close together, on circles, and in other units."""

from __future__ import annotations

from math import cos, pi, sin, sqrt
from typing import Any

import numpy as np
import pytest
from branch_kinds import DOUBLING, FOLD, NEIMARK_SACKER, PITCHFORK, TRANSCRITICAL, kinds

from cellmap import (
    ForcedSystem,
    PointMap,
    angle,
    continue_orbit,
    discrete_map,
    periodic_orbit,
    stroboscopic_map,
)
from cellmap.bifurcations import BifurcationKind, Branch, continue_bifurcation, switch_branch
from cellmap.orbits import PeriodicOrbit
from systems import logistic_map, standard_map


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


@pytest.mark.parametrize("rate", [1.0, 3.0])
def test_a_fold_of_a_system_that_is_driven_by_another(rate: float) -> None:
    """x drives y, and y does not act back: their sizes have nothing to do with each other.

    x = cos t has the multiplier exp(2 pi rate); y = sqrt(q) ends in a fold at 0, with exp(-4 pi sqrt(q)).
    """

    def rhs(t: float, x: Any, p: Any) -> Any:
        return p.rate * (x[0] - cos(t)) - sin(t), p.q - x[1] ** 2 + 0.1 * (x[0] - cos(t))

    exact = stroboscopic_map(ForcedSystem(rhs, {"rate": rate, "q": 1.0}, 2.0 * pi, ("x", "y")), rtol=1e-11, atol=1e-11)
    branch = continue_orbit(exact, periodic_orbit(exact, [1.0, 1.0]), "q", -1.0, 2.0, step=0.1)
    (fold,) = branch.bifurcations
    assert fold.kind is BifurcationKind.FOLD
    assert fold.value == pytest.approx(0.0, abs=1e-9)
    assert branch.values.min() > -1e-9
    np.testing.assert_allclose(branch.points[:, 1] ** 2, branch.values, atol=1e-8)


@pytest.mark.parametrize(("gap", "bend", "step"), [(0.05, 4.0, 0.2), (0.2, 1.0, 0.5), (0.02, 1.0, 0.5)])
def test_a_curve_beside_one_of_neutral_saddles_goes_on_whatever_the_step(gap, bend, step):
    """Multipliers of modulus 1 + r with r = q - bend s^2; the product of -2 and -(1 + r + gap)/2 is 1 for r = -gap."""

    def f(x, p):
        r, a = p.q - p.bend * p.s**2, 2.0 + 0.3 * p.s
        size = 1.0 + r - x[0] ** 2 - x[1] ** 2
        turned = size * (cos(a) * x[0] - sin(a) * x[1]), size * (sin(a) * x[0] + cos(a) * x[1])
        return *turned, -2.0 * x[2] + x[0] * x[3], -0.5 * (1.0 + r + p.gap) * x[3] + 0.1 * x[0] ** 2

    params = {"q": -0.1, "s": -0.3, "gap": gap, "bend": bend}
    beside = discrete_map(f, params, ("u", "v", "y", "z"))
    branch = continue_orbit(beside, periodic_orbit(beside, [0.0] * 4), "q", -0.5, 4.5)
    (torus,) = branch.of_kind(BifurcationKind.NEIMARK_SACKER)
    curve = continue_bifurcation(branch, torus, "s", (-0.5, 4.5), (-1.0, 1.0), step=step)
    assert curve.ends == ("left the intervals", "left the intervals")
    q, s = curve.values.T
    np.testing.assert_allclose(q, bend * s**2, atol=1e-11)
    assert np.ptp(s) == pytest.approx(2.0)


# Bifurcations on the branch that is born there.

BORN = {
    # Map, initial orbit, interval, where the pitchfork is, and the number of unstable multipliers beside it.
    "Kopel": (
        lambda x, p: tuple((x[i] + p.q * x[1 - i] * (1 - x[1 - i])) / 2 for i in range(2)),
        (3.2, [0.5, 0.8], (2.5, 3.4)), 3.0, 0,
    ),
    "moving centre": (
        lambda x, p: (x[0] + 0.5 * (p.q * (x[0] - 0.84 * p.q) - (x[0] - 0.84 * p.q) ** 3), 0.2 * x[1]),
        (0.25, [0.71, 0.0], (-1.0, 1.0)), 0.0, 0,
    ),
    "subcritical": (lambda x, p: (x[0] + p.q * x[0] + x[0] ** 3, 0.2 * x[1]), (-0.1, [0.3, 0.0], (-0.3, 0.2)), 0.0, 1),
    "areas kept": (
        lambda x, p: (x[0] + x[1] + p.q * x[0] - x[0] ** 3, x[1] + p.q * x[0] - x[0] ** 3),
        (0.25, [0.5, 0.0], (-0.5, 0.9)), 0.0, 0,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BORN)
def test_a_pitchfork_is_one_on_the_branch_that_is_born_there(name: str) -> None:
    step, (value, guess, interval), there, unstable = BORN[name]
    exact = discrete_map(step, {"q": value}, ("x", "y"))
    branch = continue_orbit(exact, periodic_orbit(exact, guess), "q", *interval)
    (found,) = (b for b in branch.bifurcations if abs(b.value - there) < 0.05)
    assert (found.kind, found.before, found.after) == (PITCHFORK, unstable, unstable)
    assert found.value == pytest.approx(there, abs=1e-12)
    symmetric = switch_branch(branch, found, *interval)
    assert np.ptp(symmetric.values) > 0.1
    assert [b.kind for b in symmetric.bifurcations if abs(b.value - there) < 0.05] == []


def test_a_fold_beside_a_crossing_is_no_pitchfork() -> None:
    # x = 0 is crossed by x (e - x) = -q, which turns back at x = e/2.
    exact = discrete_map(lambda x, p: (x[0] * (1.0 + p.q + 1e-3 * x[0] - x[0] ** 2),), {"q": 0.25}, ("x",))
    branch = continue_orbit(exact, periodic_orbit(exact, [0.5]), "q", -0.5, 0.5)
    assert kinds(branch) == [TRANSCRITICAL, FOLD]
    np.testing.assert_allclose([b.value for b in branch.bifurcations], [0.0, -2.5e-7], atol=1e-14)


@pytest.mark.parametrize("imperfection", [1e-6, 1e-8])
def test_no_step_jumps_to_a_branch_that_comes_close(imperfection: float) -> None:
    # q = x**2 - e / x turns back at x = -(e / 2)**(1 / 3), next to the branch on which x is positive.
    exact = discrete_map(lambda x, p: (x[0] * (1.0 + p.q) - x[0] ** 3 + p.e,), {"q": 0.3, "e": imperfection}, ("x",))
    branch = continue_orbit(exact, periodic_orbit(exact, [-0.5]), "q", -0.5, 0.5)
    assert kinds(branch) == [FOLD]
    assert branch.bifurcations[0].value == pytest.approx(3.0 * (0.5 * imperfection) ** (2.0 / 3.0), rel=1e-8)
    assert branch.values[0] == branch.values[-1] == 0.5
    assert branch.points.max() < 0.0


def test_doubled_orbits_are_born_in_a_pitchfork_of_two_steps() -> None:
    exact = logistic_map(3.3)
    branch = continue_orbit(exact, periodic_orbit(exact, [0.48], 2), "mu", 2.5, 3.5)
    assert kinds(branch) == [DOUBLING, PITCHFORK, DOUBLING]
    edge = 1.0 + sqrt(6.0)
    np.testing.assert_allclose([b.value for b in branch.bifurcations], [edge, 3.0, edge], rtol=1e-11)
