"""Trajectories: SciPy's solutions as witness, the stroboscopic map at whole periods, failures as data."""

from collections.abc import Callable
from math import cos, pi, sin

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from two_tiers import at_once

import systems
from cellmap import ForcedSystem, Status, angle, set_threads, stroboscopic_map, trajectory
from cellmap.maps import ToleranceWarning, integrate

OSCILLATOR = ForcedSystem(
    lambda t, x, p: (x[1], -x[0]),
    {},
    2 * pi,
    ("q", "v"),
    "oscillator",
    outputs={"energy": lambda t, x, p: (0.5 * (x[0] ** 2 + x[1] ** 2),), "phase": lambda t, x, p: (cos(t), sin(t))},
)
ROTATION = ForcedSystem(lambda t, x, p: (3.0 + cos(t),), {}, 2 * pi, (angle("theta"),))
BLOW_UP = ForcedSystem(lambda t, x, p: (x[0] ** 2,), {}, 1.0, ("x",))  # x = 1 / (1/x0 - t)


def solution(system, ic, times):
    """SciPy's DOP853 with steps short enough for its dense output to have 11 digits."""
    made = solve_ivp(
        system.fun,
        (times[0], times[-1]),
        ic,
        "DOP853",
        times,
        rtol=1e-13,
        atol=1e-15,
        max_step=(times[1] - times[0]) / 2,
    )
    assert made.success
    return made.y.T


@pytest.mark.parametrize("tolerance", at_once([1e-9], later=[1e-6, 1e-11]))
@pytest.mark.parametrize("method", ["auto", "DOP853"])
@pytest.mark.parametrize(
    "factory", at_once([systems.two_well_duffing, systems.driven_pendulum], later=[systems.forced_pendulum])
)
def test_samples_meet_the_tolerance_within_every_period(factory, method, tolerance, allowance):
    system = factory()
    initial_conditions = [[0.5, 0.3], [2.0, -40.0 if factory is systems.driven_pendulum else -1.0]]
    motion = trajectory(
        system, initial_conditions, 4, samples_per_period=40, phase=0.3, rtol=tolerance, atol=tolerance, method=method
    )
    for k in (0, 3):
        part = slice(40 * k, 40 * k + 41)
        for i in range(2):
            states = motion.states[part, i]
            error = np.abs(solution(system, states[0], motion.times[part]) - states)
            assert (error <= allowance(system, states, tolerance, tolerance)).all()


def test_every_period_ends_where_the_map_leads():
    strobe = stroboscopic_map(systems.forced_pendulum(), phase=0.25)
    orbit = strobe.orbit([[0.5, 0.3], [3.0, 2.5]], 30)
    motion = trajectory(systems.forced_pendulum(), [[0.5, 0.3], [3.0, 2.5]], 30, phase=0.25)
    assert motion.strobe == pytest.approx(orbit.points, abs=1e-13)
    assert motion.states[::64] == pytest.approx(orbit.unwrapped, abs=1e-12)


def test_shapes_and_times():
    motion = trajectory(OSCILLATOR, np.zeros((3, 4, 2)), 5, samples_per_period=7, phase=0.5)
    assert motion.states.shape == motion.wrapped.shape == (36, 3, 4, 2)
    assert motion.strobe.shape == (6, 3, 4, 2)
    assert motion.status.shape == (3, 4)
    assert motion.output("phase").shape == (36, 3, 4, 2)
    assert motion.times == pytest.approx(pi + np.arange(36) * 2 * pi / 7)
    assert (motion.periods, motion.samples) == (5, 7)
    none = trajectory(OSCILLATOR, np.zeros((0, 2)), 3)
    assert (none.states.shape, none.output("energy").shape) == ((193, 0, 2), (193, 0, 1))
    assert repr(motion) == "Trajectory(oscillator: 12 initial conditions, 5 periods of 7 samples)"


def test_angles_are_unwrapped_from_the_given_initial_condition():
    """Exactly theta = theta0 + 3 t + sin t, three turns a period."""
    motion = trajectory(ROTATION, [[1.0], [1.0 + 20 * pi]], 5)
    for i, ic in enumerate((1.0, 1.0 + 20 * pi)):
        exact = ic + 3 * motion.times + np.sin(motion.times)
        assert motion.states[:, i, 0] == pytest.approx(exact, abs=1e-8)
        assert motion.states[0, i, 0] == ic
    assert (motion.wrapped >= -pi).all() and (motion.wrapped < pi).all()
    assert np.cos(motion.wrapped) == pytest.approx(np.cos(motion.states), abs=1e-12)


def test_outputs_follow_the_motion():
    motion = trajectory(OSCILLATOR, [[1.0, 0.0], [0.0, 2.0]], 2, phase=0.25)
    assert motion.output("energy")[..., 0] == pytest.approx(np.tile([0.5, 2.0], (129, 1)), abs=1e-8)
    assert OSCILLATOR.output("energy", 0.3, np.full((3, 4, 2), 0.5)).tolist() == [[[0.25]] * 4] * 3
    assert motion.output("phase")[:, 1] == pytest.approx(np.transpose([np.cos(motion.times), np.sin(motion.times)]))


def test_an_orbit_that_diverges_is_followed_to_its_end():
    system = ForcedSystem(BLOW_UP.rhs, {}, 1.0, ("x",), outputs={"square": lambda t, x, p: (x[0] ** 2,)})
    motion = trajectory(system, [[0.1], [0.41]], 4, samples_per_period=8)  # the second one ends at t = 2.44
    assert motion.status.tolist() == [Status.OK, Status.DIVERGED]
    early = motion.times < 1 / 0.41
    exact = 1 / (1 / 0.41 - motion.times[early])
    assert motion.states[early, 1, 0] == pytest.approx(exact, rel=1e-7)
    assert np.isnan(motion.states[~early, 1]).all()
    assert np.isfinite(motion.states[:, 0]).all()
    assert np.array_equal(np.isnan(motion.output("square")), np.isnan(motion.states))


def test_a_missed_tolerance_is_told():
    system = ForcedSystem(lambda t, x, p: (x[1], -4e4 * x[0]), {}, 2 * pi, ("q", "v"))
    with pytest.warns(ToleranceWarning, match="1 of 2 orbits"):
        motion = trajectory(system, [[1.0, 0.0], [0.0, 0.0]], 2, samples_per_period=4, max_steps=800)
    assert motion.status.tolist() == [Status.INACCURATE, Status.OK]


def test_same_bits_for_any_number_of_threads_and_neighbours():
    initial_conditions = np.random.default_rng(1).uniform(-2, 2, (700, 2))
    set_threads(1)
    one = trajectory(systems.two_well_duffing(), initial_conditions, 30, samples_per_period=4)
    set_threads(2)
    assert np.array_equal(
        trajectory(systems.two_well_duffing(), initial_conditions, 30, samples_per_period=4).states, one.states
    )
    assert np.array_equal(
        trajectory(systems.two_well_duffing(), initial_conditions[5], 30, samples_per_period=4).states, one.states[:, 5]
    )


def test_integration_over_any_time_agrees_with_scipy(scipy_images: Callable[..., NDArray[np.float64]]) -> None:
    system = systems.driven_pendulum()
    initial_conditions = [[0.5, 10.0], [3.0, -40.0]]
    begin, duration = 0.3 * system.length, 1.7 * system.length
    found = integrate(system, initial_conditions, begin, duration, rtol=1e-12, atol=1e-12)
    expected = scipy_images(system, initial_conditions, phase=0.3, periods=1.7)
    assert found.unwrapped == pytest.approx(expected, rel=1e-9, abs=1e-9)
    assert np.abs(found.points[:, 0]).max() <= pi
