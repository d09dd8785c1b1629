"""Maps of unforced systems, against closed forms and SciPy's events."""

import pickle
from dataclasses import replace
from math import exp, pi, sin, sqrt

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from two_tiers import at_once

from cellmap import CellGrid, ForcedSystem, Status, angle, find_basins, load_basins, save_basins, section_map
from cellmap.basins.final_states import final_states
from cellmap.maps import flow_map, jacobian, swept_map
from cellmap.sets import generalized_cell_mapping, simple_cell_mapping
from systems import magnetic_pendulum


def lorenz(t, x, p):
    return p.s * (x[1] - x[0]), x[0] * (p.r - x[2]) - x[1], x[0] * x[1] - p.b * x[2]


LORENZ = ForcedSystem(lorenz, {"s": 10.0, "r": 28.0, "b": 8 / 3}, 0.7, ("x", "y", "z"))
SPIRAL = ForcedSystem(lambda t, x, p: (x[1], -x[0] - 2 * p.d * x[1]), {"d": 0.1}, 6.0, ("q", "v"))
TORQUE = ForcedSystem(
    lambda t, x, p: (x[1], p.torque - sin(x[0]) - 0.2 * x[1]), {"torque": 1.5}, 2.0, (angle("theta"), "v")
)
ROTATING = ForcedSystem(lambda t, x, p: (p.w, sin(x[0]) - x[1]), {"w": 1.0}, 2.0, (angle("theta"), "v"))
PENDULUM = ForcedSystem(lambda t, x, p: (x[1], -sin(x[0]) - p.d * x[1]), {"d": 0.02}, 2.0, (angle("theta"), "v"))
CENTRED = ForcedSystem(lambda t, x, p: (x[1], p.c - x[0] - 0.4 * x[1]), {"c": 0.0}, 6.0, ("q", "v"))


@pytest.mark.parametrize("direction", [-1, 0, 1])
def test_damped_oscillator_in_closed_form(direction):
    """Half a period or a whole one, of the damped frequency."""
    frequency = sqrt(1 - 0.01)
    time = (pi if direction == 0 else 2 * pi) / frequency
    back = section_map(SPIRAL, ("q", 0.0, direction), rtol=1e-12, atol=1e-12)
    factor = (-1 if direction == 0 else 1) * exp(-0.1 * time)
    initial_conditions = np.array([[0.3], [2.0]]) * (direction or 1)
    returns = back.returns(initial_conditions)
    np.testing.assert_allclose(returns.times, time, rtol=1e-11)
    np.testing.assert_allclose(returns.points, factor * initial_conditions, rtol=1e-10)
    np.testing.assert_allclose(jacobian(back, initial_conditions)[:, 0, 0], factor, rtol=1e-9)
    # One that begins on the way through in the other direction needs half a period.
    if direction:
        half = back.returns(-initial_conditions)
        np.testing.assert_allclose(half.times, pi / frequency, rtol=1e-11)
        np.testing.assert_allclose(half.points, initial_conditions * exp(-0.1 * pi / frequency), rtol=1e-10)


@pytest.mark.parametrize("value", at_once([pi], later=[0.4, 7.0]))
def test_an_angle_that_only_grows_never_falls_through_its_section(value):
    """theta' = w: a rotation takes 2 pi / w, in the direction of w alone."""
    for w in (1.0, -1.0):
        for direction in (-1, 0, 1):
            back = section_map(ROTATING.with_params(w=w), ("theta", value, direction), max_time=20.0)
            time = back.returns([[0.3]]).times[0]
            assert np.isnan(time) if direction == -w else time == pytest.approx(2 * pi, rel=1e-12)


def test_rotations_of_another_angle_are_counted():
    """It turns by 3 in a unit of time, and an oscillation takes 2 pi."""
    system = ForcedSystem(lambda t, x, p: (x[1], -x[0], 3.0 + 0.0 * x[2]), {}, 1.0, ("q", "v", angle("a")))
    images = section_map(system, ("q", 0.0, 1)).iterate([[1.0, 0.5]], 2)
    assert images.rotations.tolist() == [[0, 6]]
    assert images.points == pytest.approx(np.array([[1.0, 0.5]]), abs=1e-8)


def test_pendulum_swings_through_both_ways_and_rotates_through_one():
    """Energy is kept: it comes back as fast as it went, on the way asked for."""
    pendulum = PENDULUM.with_params(d=0.0)
    initial_conditions = [[1.0], [-1.0], [3.0], [-3.0]]
    for direction, expected in ((1, [1, 1, 3, np.nan]), (-1, [-1, -1, np.nan, -3]), (0, [-1, 1, 3, -3])):
        images = section_map(pendulum, ("theta", 0.0, direction)).returns(initial_conditions)
        np.testing.assert_allclose(images.points[:, 0], expected, rtol=1e-7)


@pytest.mark.parametrize("value", at_once([5.0], later=[0.0]))
def test_orbits_that_come_to_rest_on_the_section_do_not_return(value):
    """A spiral around a point of the section: no speed is left to go through it."""
    back = section_map(CENTRED.with_params(c=value), ("q", value, 1))
    assert back.iterate([[0.0], [1.0]], 100).status.tolist() == [Status.NO_RETURN, Status.NO_RETURN]
    assert (find_basins(back, CellGrid((-1.0,), (1.0,), (4,))).labels == -4).all()


def test_slow_motion_is_no_rest():
    """Rates of 1e-13, in units in which a rotation takes 2 pi 1e13."""
    slow = ForcedSystem(lambda t, x, p: (1e-13 * x[1], -1e-13 * x[0]), {}, 6e13, ("q", "v"))
    assert section_map(slow, ("q", 0.0, 1)).returns([[1.0]]).times == pytest.approx(2e13 * pi, rel=1e-9)


def test_cells_of_a_section_whose_orbits_do_not_return(tmp_path):
    """A pendulum with friction passes the top some times, and then no more."""
    top = section_map(TORQUE.with_params(torque=0.0), ("theta", pi, 1), max_time=50.0)
    grid = CellGrid((0.05,), (5.0,), (4,))
    mapping, chain = simple_cell_mapping(top, grid), generalized_cell_mapping(top, grid)
    direct = find_basins(top, grid).labels
    assert (direct == -4).all()
    for basins in (mapping.basins(), chain.basins()):
        np.testing.assert_array_equal(basins.labels, direct)
        assert basins.verify(100).wrong == 0
        np.testing.assert_array_equal(load_basins(save_basins(basins, tmp_path / "cells.h5")).labels, direct)


def test_maps_travel():
    back = section_map(LORENZ, ("z", 27.0, -1), max_time=20.0)
    initial_conditions = [[-10.0, -12.0], [6.0, 2.0]]
    same = pickle.loads(pickle.dumps(back))
    np.testing.assert_array_equal(same(initial_conditions), back(initial_conditions))
    np.testing.assert_array_equal(same.returns(initial_conditions).times, back.returns(initial_conditions).times)
    rotating = section_map(TORQUE, ("theta", 1.0, 1))
    basins = find_basins(rotating, CellGrid((3.0,), (9.0,), (10,)))
    # Of the rotation the multiplier is exp(-damping * time): Liouville.
    (attractor,), time = basins.attractors, rotating.returns(basins.attractors[0].points).times[0]
    assert attractor.multipliers[0].real == pytest.approx(exp(-0.2 * time), rel=1e-6)
    assert basins.fractions[0].fraction == 1.0


def test_orbits_that_do_not_return_say_so():
    """Without torque a pendulum comes to rest below, and theta = pi is not crossed again."""
    rest = section_map(TORQUE.with_params(torque=0.0), ("theta", pi, 0), max_time=50.0)
    images = rest.iterate([[0.0], [0.5], [9.0]], 1)
    assert images.status.tolist() == [Status.NO_RETURN, Status.NO_RETURN, Status.OK]
    assert np.isnan(images.points[:2]).all()
    basins = find_basins(rest, CellGrid((0.1,), (1.0,), (9,)))
    assert (basins.labels == -4).all() and basins.label_name(-4) == "did not return"
    unended = final_states(rest, basins.grid, (), lambda points: np.full(len(points), -1), max_periods=3)
    assert (unended.label(basins.grid.centres()) == -4).all()
    returns = rest.returns([[0.5], [9.0]])
    assert np.isnan(returns.times[0]) and returns.times[1] > 0


def test_image_does_not_depend_on_its_neighbours():
    back = section_map(LORENZ, ("z", 27.0, -1))
    initial_conditions = np.random.default_rng(0).uniform(-12, 12, (70, 2))
    together = back(initial_conditions)
    np.testing.assert_array_equal(np.concatenate([back(s[None]) for s in initial_conditions[:5]]), together[:5])
    np.testing.assert_array_equal(back(initial_conditions[::-1])[::-1], together)


def test_fixed_time_map_is_the_flow():
    pendulum = magnetic_pendulum()
    ic = np.array([[0.4, 0.3, 0.0, 0.1]])
    done = solve_ivp(pendulum.fun, (0.0, 2.5), ic[0], method="DOP853", rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(flow_map(pendulum, 2.5)(ic)[0], done.y[:, -1], atol=1e-8)
    half = flow_map(pendulum, 1.25, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(half(half(ic)), flow_map(pendulum, 2.5, 1e-12, 1e-12)(ic), atol=1e-10)


def test_derivatives_by_a_parameter():
    """A return of the spiral multiplies v by exp(-2 pi d / sqrt(1 - d^2)), in lanes as in one map after the other."""
    swept = swept_map(section_map(SPIRAL, ("q", 0.0, 1), rtol=1e-12, atol=1e-12), "d")
    assert swept.dimension == 2
    for d in (0.1, 0.3):
        factor = exp(-2 * pi * d / sqrt(1 - d * d))
        np.testing.assert_allclose(swept([1.5, d]), [1.5 * factor, d], rtol=1e-11)
        slope = -2 * pi * (1 - d * d) ** -1.5 * 1.5 * factor
        np.testing.assert_allclose(jacobian(swept, [1.5, d]), [[factor, slope], [0.0, 1.0]], rtol=1e-9, atol=1e-12)


def test_a_period_that_is_a_function_is_no_parameter_of_a_section():
    system = replace(SPIRAL, period=lambda p: 6.0 + p.d)
    swept = swept_map(section_map(system, ("q", 0.0, 1)), "d")
    np.testing.assert_allclose(swept([1.5, 0.3]), [1.5 * exp(-0.6 * pi / sqrt(0.91)), 0.3], rtol=1e-8)
