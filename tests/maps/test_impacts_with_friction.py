"""Impacts and rest on a surface, beside dry friction."""

from __future__ import annotations

from math import cos, pi, sin, sqrt

import numpy as np
import pytest

from cellmap import ForcedSystem, stroboscopic_map
from cellmap.maps import (
    Impact,
    Status,
    flow_map,
    jacobian,
    swept_map,
    trajectory,
)

WALL = Impact(lambda t, x, p: x[0] - p.wall, lambda t, x, p: (x[0], -p.e * x[1]), direction=1)


def slides_along(t, x, p, s):
    return x[1], -9.81, -s[0]


@pytest.mark.parametrize("along", [1.0, 7.0, -3.0])
def test_rest_on_a_floor_while_friction_slides_and_sticks(along):
    """Bounces end at 2.26; friction decelerates by 1 all the time, until it holds."""
    floor = Impact(lambda t, x, p: x[0], lambda t, x, p: (x[0], -p.e * x[1], x[2]))
    body = ForcedSystem(
        slides_along, {"e": 0.5}, 5.0, ("h", "v", "u"), switches=lambda t, x, p: (x[2],), impacts=[floor]
    )
    exact = stroboscopic_map(body)
    found = exact.iterate([1.0, 0.0, along], 1)
    left = np.sign(along) * max(abs(along) - 5.0, 0.0)
    assert found.status == Status.OK
    assert found.points == pytest.approx((0.0, 0.0, left), abs=1e-12)
    forgets = np.zeros((3, 3))
    forgets[2, 2] = 1.0 if left else 0.0
    assert jacobian(exact, [1.0, 0.0, along]) == pytest.approx(forgets, abs=1e-9)


def test_a_kick_releases_what_sticks():
    kick = Impact(lambda t, x, p: sin(2 * pi * (0.5 - t)), lambda t, x, p: (x[0], x[1], x[2] + 1.0))
    body = ForcedSystem(
        lambda t, x, p, s: (x[1], 0.0 * x[1], -s[0]),
        {},
        1.0,
        ("h", "v", "u"),
        switches=lambda t, x, p: (x[2],),
        impacts=[kick],
    )
    assert stroboscopic_map(body)([1.0, 0.0, 0.0]) == pytest.approx((1.0, 0.0, 0.5))


PRESSED = ForcedSystem(
    lambda t, x, p, s: (x[1], p.force * cos(t) - p.friction * s[0]),
    {"force": 2.0, "friction": 0.7, "e": 0.5, "wall": 1.0},
    2 * pi,
    ("q", "v"),
    switches=lambda t, x, p: (x[1],),
    impacts=[WALL],
)


@pytest.mark.parametrize(("begin", "place"), [(0.0, (0.9, 0.0)), (0.0, (1.0, 0.0)), (1.4, (1.0, 0.0))])
def test_rest_on_a_wall_against_friction(begin, place):
    """The wall lets go where the force away from it exceeds friction; at 1.4 either could hold the mass alone."""
    free = np.arccos(-0.35)
    found = trajectory(PRESSED, place, periods=1, phase=begin / (2 * pi), samples_per_period=64, rtol=1e-11, atol=1e-11)
    after = stroboscopic_map(PRESSED, begin / (2 * pi), rtol=1e-11, atol=1e-11)
    resting = (found.times < free - 0.05) & (found.times > begin + 0.75 * (place[0] < 1.0))
    assert np.abs(found.states[resting] - (1.0, 0.0)).max() < 1e-12
    moving = (found.times > free) & (found.times < 5.7)
    t = found.times[moving]
    speeds = 2 * (np.sin(t) - sin(free)) + 0.7 * (t - free)
    ways = 2 * (cos(free) - np.cos(t)) - 2 * sin(free) * (t - free) + 0.35 * (t - free) ** 2
    assert found.states[moving] == pytest.approx(np.stack([1.0 + ways, speeds], axis=1), abs=1e-8)
    assert after.iterate(place, 1).status == Status.OK
    assert jacobian(after, place) == pytest.approx(np.zeros((2, 2)), abs=1e-9)


def test_impacts_against_friction_accumulate():
    """Under a constant force towards the wall each flight is shorter by the factor e sqrt((F - m) / (F + m))."""
    steady = ForcedSystem(
        lambda t, x, p, s: (x[1], p.force - p.friction * s[0]),
        {"force": 2.0, "friction": 0.7, "e": 0.5, "wall": 1.0},
        1.0,
        ("q", "v"),
        switches=lambda t, x, p: (x[1],),
        impacts=[WALL],
    )
    first = sqrt(2 * 1.3 * 0.1)
    ratio = 0.5 * sqrt(1.3 / 2.7)
    flight = 0.5 * first * (1 / 2.7 + 1 / sqrt(1.3 * 2.7))
    end = first / 1.3 + flight / (1 - ratio)
    for length, at_rest in ((0.999 * end, False), (1.001 * end, True)):
        found = flow_map(steady, length, rtol=1e-11, atol=1e-11).iterate([0.9, 0.0], 1)
        assert found.status == Status.OK
        assert bool(np.abs(found.points - (1.0, 0.0)).max() < 1e-15) is at_rest


def test_derivatives_by_a_parameter_of_a_rest_on_a_wall_with_friction_are_differences_of_maps():
    """The period is a function of parameters, of which the rate of the guard then is a multiple."""
    wall = Impact(lambda t, x, p: 0.9 - x[0], lambda t, x, p: (x[0], -0.5 * x[1]))
    system = ForcedSystem(
        lambda t, x, p, s: (x[1], p.force * cos(p.omega * t) + 1.0 - x[0] - 0.2 * s[0]),
        {"force": 1.5, "omega": 0.7},
        lambda p: 2 * pi / p.omega,
        ("x", "v"),
        switches=lambda t, x, p: (x[1],),
        impacts=[wall],
    )
    exact, place, step = stroboscopic_map(system, rtol=1e-12, atol=1e-12), [0.792, 1.023], 1e-4
    above, below = (exact.with_params(force=1.5 + h)(place) for h in (step, -step))
    found = jacobian(swept_map(exact, "force"), [*place, 1.5])
    assert found[:2, 2] == pytest.approx((above - below) / (2 * step), abs=1e-7)
