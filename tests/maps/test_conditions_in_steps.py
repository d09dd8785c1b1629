"""Conditions that are zero for a time, as those of whole numbers, and several jumps at one surface: closed forms."""

from __future__ import annotations

from math import asin, ceil, cos, exp, expm1, floor, pi, sqrt

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cellmap import ForcedSystem, Status, discrete_map, stroboscopic_map
from cellmap.maps import Impact, ToleranceWarning, jacobian


def image(rhs, period, place):
    names = ("x", "v")[: len(place)]
    orbits = stroboscopic_map(ForcedSystem(rhs, {}, period, names), rtol=1e-9, atol=1e-9).iterate(place, 1)
    assert orbits.status == Status.OK
    return orbits.points


def contact(t, x, p):
    """A force that is there where the depth of the contact, which is never negative, is positive."""
    depth = max(x[0] - 1.0, 0.0)
    force = 20.0 * depth + 0.8 * x[1] if depth > 0 else 0.0
    return x[1], -x[0] - 0.1 * x[1] - force + 0.8 * cos(t)


def test_a_depth_that_is_zero_outside_of_the_contact():
    def rhs(t, x):
        force = 20.0 * (x[0] - 1.0) + 0.8 * x[1] if x[0] > 1.0 else 0.0
        return x[1], -x[0] - 0.1 * x[1] - force + 0.8 * cos(t)

    place = [0.5, 0.0]
    by_scipy = solve_ivp(rhs, (0, 2 * pi), place, "DOP853", rtol=1e-12, atol=1e-13, max_step=2 * pi / 8000)
    assert image(contact, 2 * pi, place) == pytest.approx(by_scipy.y[:, -1], abs=2e-6)


@pytest.mark.parametrize(
    "first",
    [
        lambda t: floor(2.0 * t) % 2 < 1,
        lambda t: not floor(2.0 * t) % 2 >= 1,
        lambda t: int(2.0 * t) % 2 < 1,
        lambda t: int(2.0 * t) % 2 <= 0,
        lambda t: not int(2.0 * t) % 2 > 0,
        lambda t: np.sign(floor(2.0 * t) - 2.0 * floor(t)) < 0.5,
        lambda t: (-1.0) ** floor(2.0 * t) > 0,
    ],
)
def test_a_square_wave_of_whole_numbers(first):
    """x' = 1 in the first half of the unit of time, -x in the second."""
    found = image(lambda t, x, p: (1.0 if first(t) else -x[0],), 1.0, [0.2])
    assert found == pytest.approx(0.7 * exp(-0.5), abs=1e-9)


@pytest.mark.parametrize(
    ("rate", "place", "expected"),
    [
        (lambda x: 1.0 if floor(x) < 0 else 0.0, 0.2, 0.2),
        (lambda x: 1.0 if floor(x) < 0 else 0.0, -0.3, 0.0),
        (lambda x: 0.5 + np.sign(max(x, 0.0)), -1.7, -1.2),
        (lambda x: 0.5 + np.sign(max(x, 0.0)), -0.25, 0.75),
        (lambda x: 1.0 if min(x, 0.0) < 0 else 0.25, -0.5, 0.125),
        (lambda x: 0.5 + np.sign(floor(x)), 0.2, 0.7),
        (lambda x: 0.4 - int(x), -0.1, 0.3),
        (lambda x: 0.4 - int(x), -1.1, (1.0 - 0.1 / 1.4) * 0.4 - 1.0),
        (lambda x: 0.5 - np.trunc(x), 0.8, 1.0),
    ],
)
def test_conditions_on_whole_numbers_of_the_state(rate, place, expected):
    assert image(lambda t, x, p: (rate(x[0]),), 1.0, [place]) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("nearest", [round, np.round, np.rint])
def test_a_state_is_held_where_it_is_rounded_the_other_way(nearest):
    assert image(lambda t, x, p: (0.3 - nearest(x[0]),), 2.0, [1.7]) == pytest.approx(0.5, abs=1e-9)
    found = image(lambda t, x, p: (0.03 - np.round(x[0], 1),), 4.0, [0.0])
    assert found == pytest.approx(0.05, abs=1e-9)


def test_of_two_numbers_that_are_as_near_the_even_one():
    rounded = discrete_map(lambda x, p: (round(x[0]) + 0.0, np.round(x[1])), {}, ("x", "y"))
    places = np.array([[0.5, 1.5], [2.5, -0.5], [-1.5, 3.5], [0.49, 1.51]])
    np.testing.assert_array_equal(rounded(places), np.round(places))


def test_a_step_that_falls_lets_go_of_what_slides():
    """x is held at 1, or at 0, by a step or a relay until y passes zero at t = 1/2; then the surface moves by 1/2."""
    found = image(lambda t, x, p: (0.3 - floor(x[0] + 0.5 * floor(x[1])), -1.0), 1.0, [1.2, 0.5])
    assert found == pytest.approx([1.15, -0.5], abs=1e-9)
    found = image(lambda t, x, p: (0.3 - np.sign(x[0] + 0.5 * floor(x[1])), -1.0), 1.0, [0.0, 0.5])
    assert found == pytest.approx([0.5, -0.5], abs=1e-9)


@pytest.mark.parametrize("other", [lambda y: np.sign(2.0 * y), lambda y: 1.0 if y / 2.0 > 0 else -1.0])
def test_multiples_of_a_condition_are_one_surface(other):
    """y rests at zero from t = 0.1 on, where both signs are 0.3: x' = -0.3 after x' = -1."""
    found = image(lambda t, x, p: (-np.sign(x[1]), 0.3 - other(x[1])), 1.0, [0.0, 0.07])
    assert found == pytest.approx([-0.37, 0.0], abs=1e-9)


@pytest.mark.parametrize("first", [ceil, lambda y: floor(2.0 * y)])
def test_several_jumps_at_one_surface_are_reported(first):
    """Filippov's solution has one weight for both, which the equivalent control of each does not give."""
    system = ForcedSystem(lambda t, x, p: (-first(x[1]), -0.3 - floor(x[1])), {}, 1.0, ("x", "y"))
    with pytest.warns(UserWarning, match="did not meet the tolerance"):
        assert stroboscopic_map(system).iterate([0.0, 0.07], 1).status == Status.INACCURATE


def test_jumps_that_hold_an_orbit_are_no_singularity():
    """Signs and whole parts jump where y comes to rest: more steps change the first digit of x, which is finite."""
    system = ForcedSystem(lambda t, x, p: (-np.sign(x[1]), -0.3 - floor(x[1])), {}, 1.0, ("x", "y"))
    with pytest.warns(ToleranceWarning, match="out of steps"):
        assert stroboscopic_map(system).iterate([0.0, 0.07], 1).status == Status.OUT_OF_STEPS


def test_a_whole_part_that_differs_on_both_sides_of_a_step_is_reported():
    """y rests at 1, where floor(x + floor(y)/2) is 0 below the step and 1 above: a mode has one of them."""

    def rhs(t, x, p):
        return -1.0, 0.5 - floor(x[1]) + 0.4 * floor(x[0] + 0.5 * floor(x[1])), floor(x[1])

    system = ForcedSystem(rhs, {}, 0.4, ("x", "y", "z"))
    with pytest.warns(UserWarning, match="did not meet the tolerance"):
        assert stroboscopic_map(system).iterate([0.95, 0.9, 0.0], 1).status == Status.INACCURATE


def test_functions_up_to_the_end_of_their_domain():
    """The arc sine at 1, a power of zero, and small numbers whose exponential is nearly 1."""
    found = image(lambda t, x, p: (-asin(min(x[0], 1.0)),), 0.4 / asin(1.0), [1.4])
    assert found == pytest.approx(1.0, abs=1e-9)
    found = image(lambda t, x, p: (-1e9 * expm1(1e-9 * x[0]) + 0.1 * abs(x[0] + 5.0),), 1.0, [1.0])
    exact = solve_ivp(lambda t, x: -1e9 * np.expm1(1e-9 * x) + 0.1 * (x + 5.0), (0, 1), [1.0], rtol=1e-12, atol=1e-13)
    assert found == pytest.approx(exact.y[0, -1], abs=1e-9)


def test_a_branch_that_changes_at_an_impact():
    """A body falls with a = 0.7 and rises with a = 1.3, as dry friction has it, and bounces once."""
    bounce = Impact(lambda t, x, p: x[0], lambda t, x, p: (x[0], -0.7 * x[1]))
    system = ForcedSystem(lambda t, x, p: (x[1], -1.0 - 0.3 * np.sign(x[1])), {}, 1.0, ("x", "v"), impacts=[bounce])

    def exact(x, v):
        speed = sqrt(v * v + 1.4 * x)
        fall, rise = (v + speed) / 0.7, 0.7 * speed
        rest = 1.0 - fall
        assert 0 < rest < rise / 1.3
        return np.array([rise * rest - 0.65 * rest**2, rise - 1.3 * rest])

    place, step = np.array([0.5, -1.0]), 1e-6
    strobe = stroboscopic_map(system, rtol=1e-12, atol=1e-12)
    assert strobe(place) == pytest.approx(exact(*place), abs=1e-12)
    columns = [(exact(*(place + e)) - exact(*(place - e))) / (2 * step) for e in step * np.eye(2)]
    np.testing.assert_allclose(jacobian(strobe, place), np.stack(columns, axis=-1), atol=1e-8)
