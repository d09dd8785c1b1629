"""Discontinuous right-hand sides against exact solutions, and from initial conditions on a surface."""

from collections.abc import Callable
from math import asin, cos, floor, inf, pi, sin, sqrt
from typing import Any

import numpy as np
import pytest
from discontinuous_systems import table
from scipy.optimize import brentq

from cellmap import ForcedSystem, Status, stroboscopic_map, trajectory
from cellmap.maps import jacobian
from systems import dimensionless_pendulum


def tilted_line(t: float, x: Any, p: Any) -> tuple[float]:
    return (x[0] + p.tilt * x[1],)


def parabolas(x: float, v: float, tilt: float, left: float) -> tuple[float, float] | None:
    """Motion x'' = -sign(x + tilt v) after a time, parabola by parabola; None where it begins to slide."""
    sign = 1.0 if x + tilt * v > 0.0 else -1.0
    height = x + tilt * v
    while True:
        # sign h = sign (height + slope t) - t^2/2
        slope = v - tilt * sign
        stay = sign * slope + sqrt(slope * slope + 2.0 * abs(height))
        stay = stay if stay > 0.0 else inf
        if stay >= left:
            return x + v * left - 0.5 * sign * left**2, v - sign * left
        x, v, left = x + v * stay - 0.5 * sign * stay**2, v - sign * stay, left - stay
        height, sign = 0.0, -sign
        if abs(v) < abs(tilt):
            return None


def test_thrust_towards_a_tilted_line() -> None:
    """Ten crossings and more, between which the distance from the line is a parabola and the series ends early."""
    rng, count = np.random.default_rng(0), 0
    system = ForcedSystem(lambda t, x, p, s: (x[1], -s[0]), {"tilt": 0.0}, 12.0, ("x", "v"), switches=tilted_line)
    for tilt in (-0.037, 0.0, 0.01, 0.041):
        initial_conditions = rng.uniform(-1.0, 1.0, (300, 2)) * (1.0, 2.0)
        images = stroboscopic_map(system.with_params(tilt=tilt)).iterate(initial_conditions, 1)
        for ic, image, status in zip(initial_conditions.tolist(), images.unwrapped, images.status, strict=True):
            if (exact := parabolas(*ic, tilt, 12.0)) is not None:
                assert image == pytest.approx(exact, abs=1e-10)
                assert status == Status.OK
                count += 1
    assert count > 900


def test_a_trajectory_rests_between_samples() -> None:
    """From speed 1, x'' = -sign x': at x = 1/2 from t = 1 on."""
    motion = trajectory(table(stiffness=0.0, friction=1.0), [0.0, 1.0], 1)
    t = np.minimum(motion.times, 1.0)
    assert motion.states == pytest.approx(np.transpose([t - 0.5 * t * t, 1.0 - t]), abs=1e-9)


def swings(x: float, friction: float, time: float) -> tuple[float, float]:
    """Free motion from rest: half circles about +-friction, one pi of time each, until the spring is held."""
    while time > 0.0 and abs(x) > friction:
        centre, left = (friction if x > 0.0 else -friction), min(time, pi)
        if left < pi:
            return centre + (x - centre) * cos(left), -(x - centre) * sin(left)
        x, time = 2.0 * centre - x, time - pi
    return x, 0.0


@pytest.mark.parametrize("tolerance", [1e-6, 1e-12])
def test_amplitudes_fall_by_twice_the_friction_each_half_swing(tolerance: float) -> None:
    """Lorenz (1924): steps of 2 mu, and rest inside abs(x) <= mu after the number of half swings that this takes."""
    mu, time = 0.1, 9.3
    strobe = stroboscopic_map(table(friction=mu, frequency=2.0 * pi / time), rtol=tolerance, atol=tolerance)
    initial_conditions = np.random.default_rng(0).uniform(-1.2, 1.2, 2000)
    images = strobe.iterate(np.column_stack([initial_conditions, np.zeros(2000)]), 1)
    exact = np.array([swings(x, mu, time) for x in initial_conditions.tolist()])
    assert (images.status == Status.OK).all()
    assert (np.abs(images.points - exact) <= tolerance * (1.0 + np.abs(exact))).all()
    assert 0.1 < (images.points[:, 1] == 0.0).mean() < 0.9


def test_a_force_that_grows_beyond_the_friction_and_falls_below_it() -> None:
    """x'' = f sin t - mu sign x': slips from asin(mu/f) on, until the impulses balance; then back alike."""
    force, mu = 1.0, 0.8
    begin = asin(mu / force)

    def velocity(t: float) -> float:
        return force * (cos(begin) - cos(t)) - mu * (t - begin)

    end = brentq(velocity, pi - begin, pi, xtol=1e-15)
    slip = force * (cos(begin) * (end - begin) + sin(begin) - sin(end)) - 0.5 * mu * (end - begin) ** 2
    system = table(stiffness=0.0, friction=mu, force=force, phase=-0.5 * pi)
    motion = trajectory(system, [0.2, 0.0], 2, samples_per_period=8, rtol=1e-12, atol=1e-12)
    assert motion.strobe == pytest.approx(np.array([[0.2, 0.0]] * 3), abs=1e-12)
    assert motion.states[4] == pytest.approx([0.2 + slip, 0.0], abs=1e-12)
    assert motion.states[2, 1] == pytest.approx(velocity(0.5 * pi), abs=1e-12)
    assert np.array_equal(motion.states[1], [0.2, 0.0])
    assert np.array_equal(motion.states[4], motion.states[5])


@pytest.mark.parametrize("excess", [0.0, 1e-15, 1e-12, 1e-9, 1e-6])
def test_a_force_that_only_just_reaches_the_friction(excess: float) -> None:
    """Touched, the limit lets nothing go; passed by a little, the mass slips by the order of its square."""
    system = table(stiffness=0.0, friction=0.5, force=0.5 * (1.0 + excess), phase=-0.5 * pi)
    images = stroboscopic_map(system).iterate([0.2, 0.0], 3)
    assert images.status == Status.OK
    assert images.points == pytest.approx([0.2, 0.0], abs=1e-12 + 10.0 * excess)


def two_springs(t: float, x: Any, p: Any, s: Any) -> tuple[float, float]:
    return x[1], -(1.5 + 0.5 * s[0]) * x[0] - 0.1 * x[1] + p.force * cos(t)


def position(t: float, x: Any, p: Any) -> tuple[float]:
    return (x[0],)


@pytest.mark.parametrize("force", [-1.0, 1.0])
def test_an_initial_condition_that_touches_a_surface_leaves_it_on_the_right_side(force: float) -> None:
    """Position and velocity zero where one spring meets another: only the acceleration tells where it goes."""
    system = ForcedSystem(two_springs, {"force": force}, 2.0 * pi, ("x", "v"), switches=position)
    images = stroboscopic_map(system, rtol=1e-12, atol=1e-12).iterate([[0.0, 0.0], [1e-14, 0.0], [-1e-14, 0.0]], 1)
    assert (images.status == Status.OK).all()
    assert images.unwrapped == pytest.approx(np.tile(images.unwrapped[1], (3, 1)), abs=1e-11)


def test_rest_on_a_surface_is_rest() -> None:
    """Nothing moves, so the switching function is zero throughout."""
    system = ForcedSystem(two_springs, {"force": 0.0}, 2.0 * pi, ("x", "v"), switches=position)
    images = stroboscopic_map(system, rtol=1e-12, atol=1e-12).iterate([[0.0, 0.0], [1e-305, 0.0]], 3)
    assert (images.status == Status.OK).all()
    assert np.abs(images.points).max() <= 1e-305


def test_the_derivative_at_an_initial_condition_that_sticks() -> None:
    """Neighbours of the start with a small velocity stop at once: their image does not depend on it."""
    strobe = stroboscopic_map(dimensionless_pendulum(0.5, 0.3, 0.03, 1.0))
    assert jacobian(strobe, [0.3, 0.0]) == pytest.approx(np.diag([1.0, 0.0]), abs=1e-15)
    slope = (strobe([0.3, 1e-5]) - strobe([0.3, -1e-5])) / 2e-5
    assert slope == pytest.approx([0.0, 0.0], abs=1e-4)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_surface_that_repels_is_left_to_the_side_of_the_smooth_part(side: float) -> None:
    """x' = sign x + 0.5 side: both sides lead away from 0; what decides is f_0, and + where it is zero."""

    system = ForcedSystem(lambda t, x, p, s: (s[0] + p.drift,), {"drift": 0.5 * side}, 1.0, ("x",), switches=position)
    strobe = stroboscopic_map(system, rtol=1e-4, atol=1e-4)
    assert strobe([[0.0], [1e-13], [-1e-13]]) == pytest.approx(
        np.array([[1.5 * side], [1.0 + 0.5 * side], [-1.0 + 0.5 * side]]), abs=1e-11
    )
    still = stroboscopic_map(system.with_params(drift=0.0), rtol=1e-4, atol=1e-4)
    assert still([0.0]) == pytest.approx([1.0])


@pytest.mark.parametrize("miss", [0.0, 1e-12, -1e-12, 1e-6, -1e-6])
def test_grazing(miss: float) -> None:
    """An orbit that touches the surface between two springs, or all but: the jump of the force there vanishes."""

    def rhs(t: float, x: Any, p: Any, s: Any) -> tuple[float, float]:
        return x[1], -x[0] - 0.5 * p.extra * (1.0 - s[0]) * (x[0] + 1.0)

    system = ForcedSystem(rhs, {"extra": 5.0}, 2.0 * pi, ("x", "v"), switches=lambda t, x, p: (x[0] + 1.0,))
    ic = [1.0 - miss, 0.0]
    images = stroboscopic_map(system).iterate(ic, 1)
    assert images.status == Status.OK
    assert images.points == pytest.approx(ic, abs=1e-8 + 20.0 * max(-miss, 0.0))


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize(
    "steps",
    [
        lambda q: floor(3 * ((q + 0.1) % 1)),
        lambda q: np.ceil(3 * (q % 1)) * floor(q),
        lambda q: cos(floor(5 * ((2 * ((q + 0.1) % 1)) % 1))),
        lambda q: floor(floor(3 * ((q + 0.1) % 1)) / 2) + floor(2 * (q % 1)),
        lambda q: floor(10 * ((q % 1) % 0.3)),
        lambda q: sin(pi * ((q + 0.2) % 1)) > 0.5 > (q + 0.2) % 1,
        lambda q: floor(3 * max((q + 0.1) % 1, (q + 0.4) % 1)),
        lambda q: max(q % 0.5, np.ceil(q)) % 1,
    ],
)
def test_steps_that_meet_the_wrap_of_an_angle(steps: Callable[[float], float], way: float) -> None:
    """q' = +-1, v' = f(q), with steps of f at multiples of 1/30: v is a sum over pieces, dv/dq the change of f."""
    m = stroboscopic_map(ForcedSystem(lambda t, x, p: (way, steps(x[0])), {}, period=1.5, coordinates=("q", "v")))
    start = np.array([[-0.55, 0.0], [1 / 60, 0.0], [0.25, 0.0]])
    pieces = [start[:, 0] + way * (k + 0.5) / 180 for k in range(270)]
    exact = sum(np.vectorize(steps, otypes=[float])(q) for q in pieces) / 180
    found = m.iterate(start, 1)
    assert (found.status == 0).all()
    np.testing.assert_allclose(found.points[:, 1], exact, atol=1e-10)
    change = [float(steps(q + 1.5 * way)) - float(steps(q)) for q in start[:, 0]]
    np.testing.assert_allclose(way * jacobian(m, start)[:, 1, 0], change, atol=1e-8)
