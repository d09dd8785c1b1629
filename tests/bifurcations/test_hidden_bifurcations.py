"""Continuation where bifurcations hide: at ends of steps, close together, on circles, and in other units."""

from math import cos, pi, sin

import numpy as np
import pytest
from branch_kinds import (
    BOTH_LEFT,
    DEGENERATE,
    DOUBLING,
    FOLD,
    LEFT,
    NEIMARK_SACKER,
    PITCHFORK,
    TRANSCRITICAL,
    kinds,
    values,
)
from cases import branch_at_rest, branch_of, quick_and_thorough, thorough

from cellmap import discrete_map
from cellmap.bifurcations import continue_bifurcation, switch_branch
from systems import standard_map


@pytest.mark.parametrize("upper", [2.0, *map(thorough, (1.5, 3.0))])
@pytest.mark.parametrize("begin", [0.1, 1.0, *map(thorough, (0.6, 0.7))])
def test_a_step_may_end_on_a_bifurcation(begin, upper):
    branch = branch_at_rest(
        discrete_map(lambda x, p: (-p.q * x[0] + x[0] ** 3,), {"q": begin}, ("x",)), "q", 0.0, upper
    )
    assert kinds(branch) == [DOUBLING]
    assert values(branch) == pytest.approx([1.0], rel=1e-12)


def bogdanov(x, p):
    y = x[1] + p.q * x[1] + 1.2 * x[0] * (x[0] - 1.0)
    return x[0] + y, y


def coupled(x, p):
    """Froeschle's map with different kicks, coupled antisymmetrically."""
    a = x[2] - np.sin(x[0]) + p.q * np.sin(x[1])
    b = x[3] - 1.3 * np.sin(x[1]) - p.q * np.sin(x[0])
    return x[0] + a, x[1] + b, a, b


def beside_a_pair(x, p):
    c, s = 0.99 * cos(1.0), 0.99 * sin(1.0)
    return p.q * x[0], 2.0 * x[1], c * x[2] - s * x[3], s * x[2] + c * x[3]


def control(x, p):
    """The adaptive control map: the branch (1, 1, 1.2 - q) meets at q = 0 the fixed points (0, 0, z) for all z."""
    y = -0.2 * x[0] + p.q + x[1] * x[2]
    return x[1], y, x[2] - p.q * x[1] / (0.1 + x[1] ** 2) * (y - 1.0)


def logistic(x, p):
    return p.q * x * (1.0 - x)


BRANCHES = {
    # Map, value, initial orbit, interval, kinds and values of bifurcations with unstable multipliers, tolerance.
    "at a round number": (bogdanov, -0.1, [0, 0], (-0.5, 0.5), [(NEIMARK_SACKER, 0.0, 0, 2)], 1e-12),
    "at the start, torus": (bogdanov, 0.0, [0, 0], (-0.5, 0.5), [(NEIMARK_SACKER, 0.0, 0, 2)], 1e-12),
    "at the start, flip": (lambda x, p: (logistic(x[0], p),), 3.0, [0.66], (2.5, 3.3), [(DOUBLING, 3.0, 0, 1)], 1e-12),
    "at the lower end": (lambda x, p: (-p.q * x[0] + x[0] ** 3,), 1.0, [0], (1.0, 2.0), [(DOUBLING, 1.0, 0, 1)], 1e-12),
    "at the upper end": (lambda x, p: (-p.q * x[0] + x[0] ** 3,), 1.0, [0], (0.0, 1.0), [(DOUBLING, 1.0, 0, 1)], 1e-12),
    "at the start, fold": (lambda x, p: (x[0] + p.q - x[0] ** 2,), 0.0, [0], (-1, 0.5), [(FOLD, 0.0, 0, 1)], 1e-12),
    "two together": (
        lambda x, p: tuple(logistic(v, p) for v in x), 2.5, [0.6, 0.6], (2.0, 3.6), [(DEGENERATE, 3.0, 0, 2)], 1e-6,
    ),
    "neutral saddle beside a pair near the circle": (beside_a_pair, 0.3, [0] * 4, (0.1, 0.837), [], 0.0),
    "pairs that collide at |c| = 0.15": (
        coupled, 0.01, [0] * 4, (-0.5, 0.5), [(NEIMARK_SACKER, -0.15, 2, 0), (NEIMARK_SACKER, 0.15, 0, 2)], 1e-7,
    ),
    # x = 0 is crossed by x (e - x) = -q, which turns back at x = e/2.
    "fold beside a crossing": (
        lambda x, p: (x[0] * (1.0 + p.q + 1e-3 * x[0] - x[0] ** 2),), 0.25, [0.5], (-0.5, 0.5),
        [(TRANSCRITICAL, 0.0, 0, 1), (FOLD, -2.5e-7, 1, 0)], 1e-14,
    ),
    "line of orbits": (control, 0.5, [1.0, 1.0, 0.7], (-0.5, 1.0), [(DEGENERATE, 0.0, None, None)], 1e-12),
    # Multipliers that stay on the circle hide no others.  The logistic map, x = 1 - 1 / q, has the multiplier 2 - q.
    "beside -1": (
        lambda x, p: (logistic(x[0], p), -x[1]), 2.5, [0.6, 0.0], (1.5, 3.5), [(DOUBLING, 3.0, None, None)], 1e-9,
    ),
    # The map of Henon without dissipation, x = -1 + sqrt(1 + q), has the trace -2 x.
    "conservative": (
        lambda x, p: (p.q - x[0] ** 2 - x[1], x[0], 0.5 * x[2]), 2.5, [0.87, 0.87, 0.0], (-2.0, 4.0),
        [(FOLD, -1.0, None, None), (DOUBLING, 3.0, None, None)], 1e-9,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BRANCHES)
def test_all_bifurcations_of_a_branch(name):
    step, value, guess, interval, expected, tolerance = BRANCHES[name]
    branch = branch_of(discrete_map(step, {"q": value}, tuple("wxyz"[: len(guess)])), guess, "q", *interval)
    assert kinds(branch) == [e[0] for e in expected]
    assert interval[0] <= branch.values.min() and branch.values.max() <= interval[1]
    np.testing.assert_allclose(values(branch), [e[1] for e in expected], rtol=0.0, atol=tolerance)
    for found, (_, _, before, after) in zip(branch.bifurcations, expected, strict=True):
        assert before is None or (found.before, found.after) == (before, after)
    if FOLD not in kinds(branch):
        assert branch.ends == LEFT


@pytest.mark.thorough
def test_angles_that_enter_other_images():
    # The elliptic orbit of period two of the standard map, theta = pi/2 with p = pi there, loses its symmetry at 2 pi.
    branch = branch_of(standard_map(1.0), [pi, 0.0], "k", 0.5, 9.0)
    assert kinds(branch) == [DOUBLING]
    assert values(branch) == pytest.approx([4.0], rel=1e-12)
    doubled = switch_branch(branch, branch.bifurcations[0], 0.5, 9.0)
    assert kinds(doubled) == [PITCHFORK]
    assert values(doubled) == pytest.approx([2.0 * pi], rel=1e-12)


@pytest.mark.parametrize("unit", [1.0, thorough(1e-6), thorough(1e6)])
def test_a_pitchfork_and_its_branches_in_any_unit(unit):
    cubic = discrete_map(lambda x, p: (p.m * x[0] - x[0] ** 3 / unit**2,), {"m": 0.5}, ("x",))
    branch = branch_at_rest(cubic, "m", -0.5, 3.0, sizes=[unit])
    assert kinds(branch) == [PITCHFORK]
    assert values(branch) == pytest.approx([1.0], rel=1e-13)
    for side in (1, -1):
        arm = switch_branch(branch, branch.bifurcations[0], -0.5, 3.0, side=side)
        np.testing.assert_allclose(arm.points[:, 0] ** 2 / unit**2, arm.values - 1.0, atol=1e-11)
        assert kinds(arm) == [DOUBLING]
        assert values(arm) == pytest.approx([2.0], rel=1e-12)
        assert len(np.unique(np.sign(arm.points))) == 1


@pytest.mark.parametrize(("gap", "bend", "step"), [(0.2, 1.0, 0.5), thorough(0.02, 1.0, 0.5)])
def test_a_curve_beside_one_of_neutral_saddles_goes_on_whatever_the_step(gap, bend, step):
    """Multipliers of modulus 1 + r with r = q - bend s^2; the product of -2 and -(1 + r + gap)/2 is 1 for r = -gap."""

    def f(x, p):
        r, a = p.q - p.bend * p.s**2, 2.0 + 0.3 * p.s
        size = 1.0 + r - x[0] ** 2 - x[1] ** 2
        turned = size * (cos(a) * x[0] - sin(a) * x[1]), size * (sin(a) * x[0] + cos(a) * x[1])
        return *turned, -2.0 * x[2] + x[0] * x[3], -0.5 * (1.0 + r + p.gap) * x[3] + 0.1 * x[0] ** 2

    params = {"q": -0.1, "s": -0.3, "gap": gap, "bend": bend}
    beside = discrete_map(f, params, ("u", "v", "y", "z"))
    branch = branch_at_rest(beside, "q", -0.5, 4.5)
    (torus,) = branch.of_kind(NEIMARK_SACKER)
    curve = continue_bifurcation(branch, torus, "s", (-0.5, 4.5), (-1.0, 1.0), step=step)
    assert curve.ends == BOTH_LEFT
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
}  # fmt: skip


@pytest.mark.parametrize("name", quick_and_thorough(BORN, ("subcritical",)))
def test_a_pitchfork_is_one_on_the_branch_that_is_born_there(name):
    step, (value, guess, interval), there, unstable = BORN[name]
    exact = discrete_map(step, {"q": value}, ("x", "y"))
    branch = branch_of(exact, guess, "q", *interval)
    (found,) = (b for b in branch.bifurcations if abs(b.value - there) < 0.05)
    assert (found.kind, found.before, found.after) == (PITCHFORK, unstable, unstable)
    assert found.value == pytest.approx(there, abs=1e-12)
    symmetric = switch_branch(branch, found, *interval)
    assert np.ptp(symmetric.values) > 0.1
    assert not [v for v in values(symmetric) if abs(v - there) < 0.05]


@pytest.mark.parametrize("imperfection", [1e-6, thorough(1e-8)])
def test_no_step_jumps_to_a_branch_that_comes_close(imperfection):
    # q = x**2 - e / x turns back at x = -(e / 2)**(1 / 3), next to the branch on which x is positive.
    exact = discrete_map(lambda x, p: (x[0] * (1.0 + p.q) - x[0] ** 3 + p.e,), {"q": 0.3, "e": imperfection}, ("x",))
    branch = branch_of(exact, [-0.5], "q", -0.5, 0.5)
    assert kinds(branch) == [FOLD]
    assert values(branch) == pytest.approx([3.0 * (0.5 * imperfection) ** (2.0 / 3.0)], rel=1e-8)
    assert branch.values[0] == branch.values[-1] == 0.5
    assert branch.points.max() < 0.0
