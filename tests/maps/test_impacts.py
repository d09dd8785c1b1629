"""Impacts: against closed forms, against SciPy with events, and what is refused."""

from dataclasses import replace
from math import cos, pi, sin, sqrt

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cellmap import ForcedSystem, stroboscopic_map
from cellmap.maps import Impact, Status, ToleranceWarning, flow_map, jacobian, swept_map, swept_system, trajectory


def falling(t, x, p):
    return x[1], -p.g


def table(t, p):
    return p.amplitude * cos(p.omega * t), -p.amplitude * p.omega * sin(p.omega * t)


def thrown_by_table(t, x, p):
    speed = table(t, p)[1]
    return x[0], speed - p.e * (x[1] - speed)


FLOOR = Impact(lambda t, x, p: x[0], lambda t, x, p: (x[0], -p.e * x[1]))
WALL = Impact(lambda t, x, p: x[0] - p.wall, lambda t, x, p: (x[0], -p.e * x[1]), direction=1)
BALL = ForcedSystem(falling, {"g": 9.81, "e": 0.8}, 1.0, ("h", "v"), impacts=[FLOOR])
TABLE = ForcedSystem(
    falling,
    {"g": 1.0, "e": 0.5, "amplitude": 2.0, "omega": 1.0},
    lambda p: 2 * pi / p.omega,
    ("h", "v"),
    impacts=[Impact(lambda t, x, p: x[0] - table(t, p)[0], thrown_by_table)],
)
STRUCK = ForcedSystem(
    lambda t, x, p: (x[1], -x[0] - 2 * p.damping * x[1] + p.force * cos(p.omega * t)),
    {"damping": 0.05, "force": 1.0, "omega": 0.8, "e": 0.7, "wall": 0.5},
    lambda p: 2 * pi / p.omega,
    ("q", "v"),
    impacts=[WALL],
)

SLIDING = ForcedSystem(
    lambda t, x, p, s: (x[1], -9.81, -s[0]),
    {"e": 0.5},
    5.0,
    ("h", "v", "u"),
    switches=lambda t, x, p: (x[2],),
    impacts=[Impact(lambda t, x, p: x[0], lambda t, x, p: (x[0], -p.e * x[1], x[2]))],
)


def bounced(h: float, v: float, time: float, g: float, e: float) -> tuple[float, float]:
    """Height and velocity of a ball on a floor at rest, flight by flight."""
    while True:
        landing = (v + sqrt(v * v + 2 * g * h)) / g
        if landing > time:
            return h + v * time - g * time * time / 2, v - g * time
        h, v, time = 0.0, e * sqrt(v * v + 2 * g * h), time - landing
        if v < 1e-9:
            return 0.0, 0.0


def by_scipy(system: ForcedSystem, place, most: int = 60):
    """One period by SciPy, stopped at each impact of the only guard; None after too many."""
    (impact,) = system.impacts
    p, t, x = system.parameters, 0.0, np.array(place, float)

    def guard(t, x):
        return impact.guard(t, x, p)

    guard.terminal, guard.direction = True, impact.direction
    for _ in range(most):
        part = solve_ivp(system.fun, (t, system.length), x, "DOP853", events=guard, rtol=1e-12, atol=1e-13)
        t, x = part.t[-1], part.y[:, -1]
        if part.status == 0:
            return x
        x = np.array(impact.reset(t, x, p))
    return None


@pytest.mark.parametrize("periods", [1, 3, 7])
@pytest.mark.parametrize("e", [0.0, 0.3, 0.8, 0.95, 1.0])
def test_ball_on_a_floor(e, periods):
    """Closed form, through the accumulation of impacts to rest."""
    places = [(1.0, 0.0), (2.0, 3.0), (0.01, 0.0), (0.0, 5.0), (0.0, 0.0), (0.3, -4.0)]
    found = stroboscopic_map(BALL.with_params(e=e), rtol=1e-11, atol=1e-11).iterate(places, periods)
    assert (found.status == Status.OK).all()
    assert found.points == pytest.approx(np.array([bounced(*p, periods, 9.81, e) for p in places]), abs=1e-10)


@pytest.mark.parametrize("place", [(4.0, -1.0), (2.0, 0.0)])
def test_rest_ends_where_the_table_falls_away(place):
    """Chattering, rest, and lift-off where the table's acceleration is -g: at cos t = 1/2, t = 5 pi/3."""
    left, speed = pi / 3, sqrt(3.0)
    exact = stroboscopic_map(TABLE, rtol=1e-11, atol=1e-11)
    assert exact(place) == pytest.approx((1.0 + speed * left - left**2 / 2, speed - left), abs=1e-9)
    assert jacobian(exact, place) == pytest.approx(np.zeros((2, 2)), abs=1e-12)  # rest forgets where it came from


@pytest.mark.parametrize(
    ("system", "places"),
    [
        (STRUCK, np.random.default_rng(0).uniform((-1.5, -2.0), (0.45, 2.0), (10, 2))),
        (TABLE, [(2.5, 0.0), (3.0, 1.0), (2.0, 1.0)]),  # four impacts in a period, and one
    ],
)
def test_impacts_are_those_of_scipy(system, places):
    found = stroboscopic_map(system, rtol=1e-11, atol=1e-11).iterate(places, 1)
    assert (found.status == Status.OK).all()
    assert found.points == pytest.approx(np.array([by_scipy(system, place) for place in places]), abs=1e-9)


@pytest.mark.parametrize(
    ("system", "place", "error"), [(STRUCK, (0.1, 0.3), 1e-7), (STRUCK, (-1.0, 0.7), 1e-7), (TABLE, (2.5, 0.0), 1e-5)]
)
def test_derivative_is_that_of_differences(system, place, error):
    exact, step = stroboscopic_map(system, rtol=1e-12, atol=1e-12), 1e-6
    shifts = step * np.eye(2)
    differences = (exact(place + shifts) - exact(place - shifts)).T / (2 * step)
    assert jacobian(exact, place) == pytest.approx(differences, abs=error)


def test_thin_wall_has_two_sides():
    """Free motion at speed 1 beside a wall at 0, elastic, from either side."""
    walls = [Impact(lambda t, x, p: x[0], lambda t, x, p: (x[0], -x[1]), direction=d, solid=False) for d in (-1, 1)]
    free = ForcedSystem(lambda t, x, p: (x[1], 0.0 * x[1]), {}, 3.0, ("q", "v"), impacts=walls)
    exact = stroboscopic_map(free)
    assert exact([[1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]]) == pytest.approx(np.array([[2, 1], [-2, -1], [4, 1]]))


def test_zeno_that_cannot_rest_is_reported():
    """The force of the floor would act on a surface on which orbits slide, which is not the floor's own."""
    system = replace(SLIDING, switches=lambda t, x, p: (x[2] + x[1],))
    with pytest.warns(ToleranceWarning, match="out of steps"):
        assert stroboscopic_map(system).iterate([1.0, 0.0, 1.0], 1).status == Status.OUT_OF_STEPS


def test_rows_of_a_swept_map_are_those_of_maps_and_keep_their_parameters():
    """One state begins behind the wall, whose place is a parameter: it is put on it, and not the wall on it."""
    swept = swept_map(stroboscopic_map(STRUCK, rtol=1e-12, atol=1e-12), "wall", "force")
    rows = np.array([[0.1, 0.3, 0.5, 1.0], [-1.0, 0.7, 0.6, 0.9], [0.9, 0.3, 0.6, 1.0]])
    images = swept(rows)
    assert (images[:, 2:] == rows[:, 2:]).all()
    for row, image in zip(rows, images, strict=True):
        direct = stroboscopic_map(STRUCK.with_params(wall=row[2], force=row[3]), rtol=1e-12, atol=1e-12)
        assert image[:2] == pytest.approx(direct(row[:2]), rel=1e-11, abs=1e-11)
    assert swept_system(STRUCK, "wall").impacts[0].reset(0.0, (0.5, 2.0, 0.5), STRUCK.parameters) == (0.5, -1.4, 0.5)


@pytest.mark.thorough
def test_derivatives_by_parameters_of_guard_reset_and_period_are_those_of_scipy():
    """Four impacts on a table that moves with its amplitude and frequency, by differences of SciPy's orbits."""
    values, step = np.array([2.0, 1.0]), 1e-4
    moved = {
        (j, k): by_scipy(
            TABLE.with_params(dict(zip(("amplitude", "omega"), values + k * step * unit, strict=True))), (2.5, 0.0)
        )
        for j, unit in enumerate(np.eye(2))
        for k in (-2, -1, 1, 2)
    }
    slopes = [(moved[j, -2] - moved[j, 2] + 8 * (moved[j, 1] - moved[j, -1])) / (12 * step) for j in range(2)]
    found = jacobian(swept_map(stroboscopic_map(TABLE), "amplitude", "omega"), [2.5, 0.0, *values])
    assert found[:2, 2:] == pytest.approx(np.stack(slopes, axis=1), rel=1e-6)
    assert (found[2:] == np.eye(4)[2:]).all()


@pytest.mark.parametrize("along", [7.0, -3.0])
def test_rest_on_a_floor_while_friction_slides_and_sticks(along):
    """Bounces end at 2.26; friction decelerates by 1 all the time, until it holds."""
    exact = stroboscopic_map(SLIDING)
    found = exact.iterate([1.0, 0.0, along], 1)
    left = np.sign(along) * max(abs(along) - 5.0, 0.0)
    assert found.status == Status.OK
    assert found.points == pytest.approx((0.0, 0.0, left), abs=1e-12)
    forgets = np.zeros((3, 3))
    forgets[2, 2] = 1.0 if left else 0.0
    assert jacobian(exact, [1.0, 0.0, along]) == pytest.approx(forgets, abs=1e-9)


def test_a_kick_releases_what_sticks():
    kick = Impact(lambda t, x, p: sin(2 * pi * (0.5 - t)), lambda t, x, p: (x[0], x[1], x[2] + 1.0))
    body = replace(SLIDING, rhs=lambda t, x, p, s: (x[1], 0.0 * x[1], -s[0]), period=1.0, impacts=[kick])
    assert stroboscopic_map(body)([1.0, 0.0, 0.0]) == pytest.approx((1.0, 0.0, 0.5))


PRESSED = ForcedSystem(
    lambda t, x, p, s: (x[1], p.force * cos(p.omega * t) - p.friction * s[0]),
    {"force": 2.0, "friction": 0.7, "e": 0.5, "wall": 1.0, "omega": 1.0},
    2 * pi,
    ("q", "v"),
    switches=lambda t, x, p: (x[1],),
    impacts=[WALL],
)


@pytest.mark.parametrize(("begin", "place"), [(0.0, (0.9, 0.0)), (1.4, (1.0, 0.0))])
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
    steady = PRESSED.with_params(omega=0.0)
    first = sqrt(2 * 1.3 * 0.1)
    ratio = 0.5 * sqrt(1.3 / 2.7)
    flight = 0.5 * first * (1 / 2.7 + 1 / sqrt(1.3 * 2.7))
    end = first / 1.3 + flight / (1 - ratio)
    for length, at_rest in ((0.999 * end, False), (1.001 * end, True)):
        found = flow_map(steady, length, rtol=1e-11, atol=1e-11).iterate([0.9, 0.0], 1)
        assert found.status == Status.OK
        assert bool(np.abs(found.points - (1.0, 0.0)).max() < 1e-15) is at_rest
