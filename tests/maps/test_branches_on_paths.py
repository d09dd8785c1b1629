"""Branches inside branches, and series that do not see what lies ahead: closed forms, and SciPy in short steps."""

from __future__ import annotations

from math import asin, ceil, cos, exp, floor, log, pi, sin, tanh

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from cellmap import ForcedSystem, Status, stroboscopic_map
from cellmap._compiled.codegen.rebind import ARRAY_FUNCTIONS, rebind
from cellmap.maps import jacobian


def image(rhs, period, place, tolerance=1e-9):
    names = ("x", "v")[: len(place)]
    orbits = stroboscopic_map(ForcedSystem(rhs, {}, period, names), rtol=tolerance, atol=tolerance).iterate(place, 1)
    assert orbits.status == Status.OK
    return orbits.points


def by_scipy(rhs, period, places):
    """Integrate what is smooth or has kinks in 4,000 steps, all orbits as one system."""
    of_arrays, states = rebind(rhs, ARRAY_FUNCTIONS), np.transpose(places)

    def fun(t, y):
        return np.concatenate(of_arrays(t, y.reshape(states.shape), None))

    kept = {"rtol": 1e-12, "atol": 1e-13, "max_step": period / 4000}
    return solve_ivp(fun, (0, period), states.ravel(), "DOP853", **kept).y[:, -1].reshape(states.shape).T


def test_a_ramp_that_only_one_side_uses():
    """It falls at t = 1 while x < 2, where it does not count; from x = 2 at t = 1.25 on it is t - 1."""
    found = image(lambda t, x, p: ((t % 1.0) if x[0] > 2.0 else 1.6,), 2.0, [0.0])
    assert found == pytest.approx(2.0 + 0.5 * (1.0 - 0.25**2), abs=1e-9)


def test_a_staircase_that_only_one_side_uses():
    """x grows by 1 up to x = 2.5; from there on x' = floor(x), which is 2 up to x = 3 and then 3."""
    found = image(lambda t, x, p: (float(floor(x[0])) if x[0] > 2.5 else 1.0,), 3.0, [0.0])
    assert found == pytest.approx(3.0 + 3.0 * (3.0 - 2.5 - 0.25), abs=1e-9)


def test_an_inner_branch_is_where_it_is_when_the_outer_one_is_entered():
    """v' = 1 below v = -1, and above -clip(-1.1 v, -0.5, 0.75) - v: 1/4 there, and no sliding motion."""

    def rhs(t, x, p):
        return (-x[0] - (np.clip(-1.1 * x[0], -0.5, 0.75) if x[0] > -1.0 else 0.0),)

    # v' = -v from -1.7 to -1; then v' = -v - 0.75 grows from 1/4 at -1, up to v = -0.75/1.1; then v' = 0.1 v.
    first = log(1.7)
    second = log(0.25 / (0.75 / 1.1 - 0.75)) if 0.75 / 1.1 > 0.75 else log(0.25 / (0.75 - 0.75 / 1.1))
    assert image(rhs, first, [-1.7]) == pytest.approx(-1.0, abs=1e-9)
    found = image(rhs, first + 0.5, [-1.7])
    assert second > 0.5
    assert found == pytest.approx(-0.75 - 0.25 * exp(-0.5), abs=1e-9)


def test_a_branch_within_the_smaller_of_two_numbers():
    """x falls by 0.8 down to the root -5 of x + x^2/5, and by 0.809 below it."""

    def rhs(t, x, p):
        return (-0.8 + min(-x[0], -0.009 if x[0] + 0.2 * x[0] ** 2 > 0 else 0.0),)

    time = (5.0 - 1.5) / 0.8
    assert image(rhs, 8.0, [-1.5]) == pytest.approx(-5.0 - 0.809 * (8.0 - time), abs=1e-8)


def bell(t, x, p):
    """A short push where x passes zero, beside a kink far away."""
    return x[1], -x[0] + 3.0 * exp(-400.0 * x[0] ** 2) - 0.3 * abs(x[0] - 0.9) + 0.2 * cos(t)


def step(t, x, p):
    """A force that changes its sign within a tenth."""
    return x[1], -tanh(40.0 * x[0]) - 0.1 * max(x[1], -0.2) + 0.3 * cos(t)


def hidden_in_the_condition(t, x, p):
    """A kink at x = tanh(30 v), whose series are those of a constant where v is far from zero."""
    return x[1], -x[0] - 0.4 * abs(x[0] - 0.9 * tanh(30.0 * x[1])) + 0.5 * cos(t)


@pytest.mark.parametrize("rhs", [bell, step, hidden_in_the_condition])
def test_what_a_series_does_not_see(rhs):
    places = [[-1.7, 1.3], [1.2, -0.9], [0.4, 2.0]]
    for place, exact in zip(places, by_scipy(rhs, 2 * pi, places), strict=True):
        assert image(rhs, 2 * pi, place) == pytest.approx(exact, abs=2e-8)


def test_a_surface_that_all_but_depends_on_time():
    """sin(w t) + tanh(x) touches zero where tanh'(x) is 1e-13: no displacement brings the state onto it."""

    def rhs(t, x, p):
        return x[1], abs(sin(4.233 * t) + tanh(x[0]))

    place, period = [1.5820062840014977, 1.1642603715907947], 2 * pi / 4.233 * 3
    (exact,) = by_scipy(rhs, period, [place])
    for tolerance in (1e-6, 1e-9, 1e-11):
        assert image(rhs, period, place, tolerance) == pytest.approx(exact, abs=30 * tolerance + 1e-10)


def test_a_sliding_motion_with_a_branch_on_one_side():
    """x' = -1 above zero; below, 2 or 1/2 as y passes 1; Filippov's y' = a y-rate of either side, weighted.

    Both sides push back onto x = 0: with the part p of the upper side, -p + (1 - p) r = 0, p = r/(1 + r).  y' is 1
    above and 0 below, so y grows by p: by 2/3 up to y = 1, and by 1/3 from there on.
    """

    def rhs(t, x, p):
        return (-1.0, 1.0) if x[0] > 0.0 else ((2.0 if x[1] < 1.0 else 0.5), 0.0)

    found = image(rhs, 3.0, [0.5, 0.0])
    # On the surface from t = 1/2, y = 1/2; at y = 1 after another 3/4.
    assert found == pytest.approx([0.0, 1.0 + (3.0 - 1.25) / 3.0], abs=1e-9)


def test_a_sliding_motion_with_a_branch_on_the_other_side():
    """The mirror image."""

    def rhs(t, x, p):
        return ((-2.0 if x[1] < 1.0 else -0.5), 0.0) if x[0] > 0.0 else (1.0, 1.0)

    found = image(rhs, 3.0, [-0.5, 0.0])
    assert found == pytest.approx([0.0, 1.0 + (3.0 - 1.25) / 3.0], abs=1e-9)


def test_derivatives_where_an_inner_branch_wakes():
    """Against differences of images."""

    def rhs(t, x, p):
        return x[1], -x[0] + ((0.8 if x[1] < 0.5 else -0.3 * x[0]) if x[0] > 0.2 else 0.1) + 0.4 * sin(t)

    strobe = stroboscopic_map(ForcedSystem(rhs, {}, 2 * pi, ("x", "v")), rtol=1e-12, atol=1e-12)
    points = np.array([[-0.7, 1.4], [0.9, -0.8], [-1.2, 0.3]])
    step = 1e-6
    columns = [(strobe(points + step * e) - strobe(points - step * e)) / (2.0 * step) for e in np.eye(2)]
    np.testing.assert_allclose(jacobian(strobe, points), np.stack(columns, axis=-1), rtol=1e-4, atol=1e-4)


def test_a_staircase_has_moved_on_when_its_side_is_entered():
    """It counts where v > 0; x falls by three steps before that, from then on SciPy's short steps are good to 1e-5."""

    def rhs(t, x, p):
        return x[1], -1.8 * x[0] + (0.0 if x[1] < 0.0 else floor(-0.34 - 1.819 * x[0]))

    def in_arrays(t, x, p):
        return x[1], -1.8 * x[0] + np.where(x[1] < 0.0, 0.0, np.floor(-0.34 - 1.819 * x[0]))

    place, period = [-1.2671640964227877, 1.0968864044205793], 3.92208820672883
    (exact,) = by_scipy(in_arrays, period, [place])
    for tolerance in (1e-6, 1e-9):
        assert image(rhs, period, place, tolerance) == pytest.approx(exact, abs=1e-4)


def test_a_surface_pushes_off_both_sides_when_a_branch_behind_it_jumps():
    """x' = 1 below zero; above, -1 below the ramp t - 1 and 2 above it, which falls from 1 to -1 at t = 2.

    From -5/4 to the surface at t = 5/4, at rest there up to t = 2, and from then on x = 2 (t - 2).
    """

    def rhs(t, x, p):
        return ((2.0 if x[0] > t % 2.0 - 1.0 else -1.0) if x[0] > 0.0 else 1.0,)

    assert image(rhs, 4.0, [-1.25]) == pytest.approx(4.0, abs=1e-9)


def test_a_surface_jumps_away_from_what_slides_along_it():
    """x' = -2 above the ramp t - 1, which falls from 1 to -1 at t = 2, and 2 below it: x slides with it twice."""

    def rhs(t, x, p):
        return (-2.0 if x[0] > t % 2.0 - 1.0 else 2.0,)

    assert image(rhs, 4.0, [-0.5]) == pytest.approx(1.0, abs=1e-9)
    assert image(rhs, 6.0, [-0.5]) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("place", [[0.2, 0.0], [1.8, 0.0], [1.0, 0.0], [-1.3, 0.0]])
@pytest.mark.parametrize("steps", [floor, lambda x: ceil(x) - 1.0, lambda x: x - x % 1.0])
def test_a_quantised_feedback_holds_the_state_at_a_step(place, steps):
    """x' = 1/2 - floor(x) pushes back onto x = 1 from both sides, where y' is the mean of 0 and 1 (Filippov)."""
    found = image(lambda t, x, p: (0.5 - steps(x[0]), steps(x[0])), 4.0, place)
    time, y = {0.2: (1.6, 0.0), 1.8: (1.6, 1.6), 1.0: (0.0, 0.0)}.get(place[0], (0.0, 0.0))
    if place[0] == -1.3:  # 0.3 at the speed 2.5, then 1 at 1.5, 1 at 0.5
        time, y = 0.3 / 2.5 + 1.0 / 1.5 + 1.0 / 0.5, -2.0 * 0.3 / 2.5 - 1.0 / 1.5
    assert found == pytest.approx([1.0, y + 0.5 * (4.0 - time)], abs=1e-9)


def forced_steps(t, x, p):
    return 0.5 + 0.8 * sin(t) - floor(x[0]), floor(x[0])


def test_a_force_takes_the_state_off_a_step():
    """It stays at x = 1 while the force a is between 0 and 1, is above while t1 < t < t2, and below from t3 on."""
    integral = lambda t: 0.5 * t + 0.8 * (1.0 - cos(t))  # noqa: E731
    t1, t3 = asin(0.625), pi + asin(0.625)
    t2 = brentq(lambda t: integral(t) - integral(t1) - (t - t1), pi / 2, t3, xtol=1e-14)
    y = integral(t1) + (t2 - t1) + integral(t3) - integral(t2)
    expected = [1.0 + integral(2 * pi) - integral(t3), y]
    assert image(forced_steps, 2 * pi, [1.0, 0.0]) == pytest.approx(expected, abs=1e-9)


def test_derivatives_beside_steps():
    """Against differences of images; neighbours of a state that has come to a step are on it as well."""
    strobe = stroboscopic_map(ForcedSystem(forced_steps, {}, 2 * pi, ("x", "v")), rtol=1e-11, atol=1e-11)
    points = np.array([[0.2, 0.0], [1.5, 0.0], [2.7, 0.1]])
    size = 1e-5
    columns = [(strobe(points + size * e) - strobe(points - size * e)) / (2.0 * size) for e in np.eye(2)]
    np.testing.assert_allclose(jacobian(strobe, points), np.stack(columns, axis=-1), atol=1e-5)


def harvest(t, x, p):
    """A quarter of each year a population is harvested, down to a threshold, below which it recovers."""
    return (x[0] * (1.5 - 2.0 * x[0]) - (1.5 * x[0] if t % 1.0 < 0.25 and x[0] > 0.4 else 0.0),)


def test_a_surface_that_ends_while_the_state_slides_along_it():
    """The population falls to the threshold by x' = -2 x^2, stays there, and grows by the logistic law from t = 1/4."""

    def grown(x, time):
        return 0.75 / (1.0 + (0.75 / x - 1.0) * exp(-1.5 * time))

    time = (1.0 / 0.4 - 1.0 / 0.45) / 2.0
    assert time < 0.25
    once = grown(0.4, 0.75)
    assert image(harvest, 1.0, [0.45]) == pytest.approx(once, abs=1e-9)
    assert image(harvest, 0.25, [0.45]) == pytest.approx(0.4, abs=1e-9)
    again = 1.0 / (1.0 / once + 2.0 * 0.25)
    assert again > 0.4
    assert image(harvest, 2.0, [0.45]) == pytest.approx(grown(again, 0.75), abs=1e-9)


@pytest.mark.parametrize(
    "larger", [max, np.maximum, lambda a, b: -min(-a, -b), lambda a, b: 0.5 * (a + b + abs(a - b))]
)
def test_the_larger_of_a_number_and_a_sign(larger):
    """x' = -1 above zero and a = 0.2 + 0.1 sin t below; at rest y' is the weight of the side above, a/(1 + a).

    The mean of 1/(1 + a) over a period is 1/sqrt(1.2^2 - 0.1^2).
    """

    def rhs(t, x, p):
        return -larger(-0.2 - 0.1 * sin(t), np.sign(x[0])), (1.0 if x[0] > 0.0 else 0.0)

    found = image(rhs, 2 * pi, [0.0, 0.0])
    assert found == pytest.approx([0.0, 2 * pi * (1.0 - 1.0 / (1.2**2 - 0.1**2) ** 0.5)], abs=1e-9)
