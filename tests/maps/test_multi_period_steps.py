"""Interpolated maps that take several periods in one step."""

from __future__ import annotations

import json
from math import pi, sin

import numpy as np
import pytest
from maps_to_interpolate import NONSMOOTH, SMOOTH, interpolated

import systems
from cellmap import (
    CellGrid,
    PointMap,
    Status,
    angle,
    discrete_map,
    find_basins,
    interpolated_map,
    set_threads,
    stroboscopic_map,
)
from cellmap.maps import rebuild_map
from cellmap.maps.interpolation.interpolated import table_memory

GRID = CellGrid((-pi, -100.0), (pi, 100.0), (16, 16))


@pytest.fixture(scope="module")
def multiple(pendulum) -> PointMap:
    """The pendulum whose cells take up to eight periods at once."""
    return interpolated_map(pendulum, CellGrid((-pi, -100.0), (pi, 100.0), (128, 128)), outside="integrate", max_step=8)


@pytest.fixture(scope="module")
def single(pendulum) -> PointMap:
    return interpolated_map(pendulum, CellGrid((-pi, -100.0), (pi, 100.0), (128, 128)), outside="integrate")


PLACES = np.random.default_rng(11).uniform([-pi, -130.0], [pi, 130.0], (3000, 2))


@pytest.mark.parametrize("periods", [1, 2, 3, 7, 8, 9, 31, 50])
def test_multi_period_steps_end_where_single_periods_end(multiple, single, periods):
    ours, theirs = multiple.iterate(PLACES, periods), single.iterate(PLACES, periods)
    difference = np.abs(ours.unwrapped - theirs.unwrapped) / [1.0, 100.0]
    assert np.median(difference) < 5e-9  # a tenth of what is allowed at the centre of a cell
    assert (difference > 1e-6).mean() < 0.01  # orbits that separate exponentially
    assert np.array_equal(ours.status, theirs.status)


def test_the_map_of_one_period_is_the_same_with_multi_period_steps(multiple, single):
    assert np.array_equal(multiple.iterate(PLACES, 1).points, single.iterate(PLACES, 1).points)
    assert np.array_equal(multiple.orbit(PLACES[:50], 6).points, single.orbit(PLACES[:50], 6).points)
    assert np.array_equal(multiple.table.coefficients, single.table.coefficients)
    assert np.array_equal(multiple.table.fallback, single.table.fallback)


def test_multi_period_steps_agree_with_the_exact_map_to_the_tolerance(pendulum):
    """Cells whose multi-period step errs by more at their centres take shorter ones."""
    grid = CellGrid((-pi, -100.0), (pi, 100.0), (64, 64))
    single, tight, lax = (
        interpolated_map(pendulum, grid, 5, "integrate", tolerance, max_step=max_step)
        for tolerance, max_step in ((1e-6, 1), (1e-6, 8), (1e3, 8))
    )
    exact = pendulum.iterate(PLACES, 8).unwrapped
    off = [np.median(np.abs(m.iterate(PLACES, 8).unwrapped - exact).max(axis=-1)) for m in (single, tight, lax)]
    assert off[1] < off[0] + 1e-6
    assert off[2] > 1e-4


@pytest.mark.parametrize("name", NONSMOOTH)
@pytest.mark.filterwarnings("ignore:.* of the cells are fallback cells:UserWarning")
def test_multi_period_steps_across_what_is_not_smooth(name):
    exact = discrete_map(NONSMOOTH[name], {}, ("x",))
    grid = CellGrid((-1.0,), (1.0,), (200,))
    places = np.linspace(-1.0, 1.0, 5003)[:, None]
    single, multiple = (interpolated_map(exact, grid, 5, "integrate", 1e-6, max_step=max_step) for max_step in (1, 4))
    difference = np.abs(multiple.iterate(places, 4).points - single.iterate(places, 4).points)
    assert np.median(difference) < 1e-6
    assert (difference > 1e-4).mean() < 0.01


@pytest.mark.parametrize("name", ["cylinder", "plane", "torus"])
def test_orbits_escape_in_multi_period_steps_as_in_single_periods(name):
    shape = tuple(2 * n for n in SMOOTH[name][3][5])
    single, multiple = (
        interpolated(name, shape, outside="escape", tolerance=1e-3, max_step=max_step) for max_step in (1, 4)
    )
    initial_conditions = np.random.default_rng(12).uniform(*SMOOTH[name][2], (5000, 2))
    for periods in (4, 12):
        ours, theirs = multiple.iterate(initial_conditions, periods), single.iterate(initial_conditions, periods)
        assert (ours.status == theirs.status).mean() > 0.999
        assert np.array_equal(ours.status == Status.ESCAPED, np.isnan(ours.points).all(axis=-1))


def test_rotations_are_counted_in_multi_period_steps():
    exact = discrete_map(lambda x, p: (x[0] + 2 * pi * p.rate + 0.1 * sin(x[0]),), {"rate": 2.6}, (angle("a"),))
    icm = interpolated_map(exact, CellGrid((-pi,), (pi,), (64,)), max_step=4)
    initial_conditions = np.linspace(-3, 3, 41)[:, None]
    ours, theirs = icm.iterate(initial_conditions, 51), exact.iterate(initial_conditions, 51)
    assert np.array_equal(ours.rotations, theirs.rotations)
    assert ours.unwrapped == pytest.approx(theirs.unwrapped, abs=1e-9)


def test_bits_of_multi_period_steps_do_not_depend_on_threads_or_neighbours(pendulum):
    results = []
    for threads in (1, 2, 3):
        set_threads(threads)
        icm = interpolated_map(pendulum, CellGrid((-pi, -60.0), (pi, 60.0), (64, 64)), outside="integrate", max_step=4)
        results.append(icm.iterate(np.tile(PLACES, (6, 1)), 11).points)
    assert np.array_equal(results[0], results[1])
    assert np.array_equal(results[0], results[2])
    for i in (0, 77, 2999):
        assert np.array_equal(icm.iterate(PLACES[i], 11).points, results[0][i])


@pytest.mark.parametrize("damping", [10.0, 2.0])
@pytest.mark.slow
def test_multi_period_steps_settle_initial_conditions_in_the_same_period(damping):
    """Within a multi-period step an orbit can enter a neighbourhood and not leave it, for that is trapping."""
    exact = stroboscopic_map(systems.driven_pendulum(amplitude=0.003, damping=damping))
    nodes, grid = (CellGrid((-pi, -v), (pi, v), (n, n)) for v, n in ((130.0, 128), (100.0, 120)))
    single, multiple = (
        find_basins(interpolated_map(exact, nodes, outside="integrate", max_step=max_step), grid) for max_step in (1, 8)
    )
    assert len(multiple.attractors) == len(single.attractors) == 2
    assert (multiple.labels != single.labels).mean() <= 1e-3
    assert (multiple.settling_time != single.settling_time).mean() <= 1e-3
    assert multiple.settling_time.min() == single.settling_time.min()


def test_initial_conditions_that_leave_the_window_or_do_not_settle_in_multi_period_steps():
    exact = stroboscopic_map(systems.driven_pendulum(amplitude=0.003))
    grid = CellGrid((-pi, -100.0), (pi, 100.0), (96, 96))
    for limit in (5, 11, 2000):
        single, multiple = (
            find_basins(interpolated_map(exact, grid, outside="escape", max_step=max_step), grid, limit)
            for max_step in (1, 4)
        )
        assert (multiple.labels != single.labels).mean() <= 2e-3
        assert (multiple.settling_time != single.settling_time).mean() <= 2e-3
        assert set(np.unique(multiple.labels)) == set(np.unique(single.labels))


def test_a_chaotic_attractor_is_looked_at_in_single_periods():
    """Its cover is entered and left again, and no multi-period step may hide a visit: the same labels and times."""
    exact = systems.henon_map()
    nodes, grid = (CellGrid((-2.0, -2.0), (2.0, 2.0), (n, n)) for n in (64, 20))
    single, multiple = (interpolated_map(exact, nodes, outside="integrate", max_step=max_step) for max_step in (1, 4))
    expected = find_basins(single, grid, 500)
    assert expected.attractors[0].cover is not None
    # Of the same cover: one that is sampled from orbits of other rounding has other boxes.
    found = find_basins(multiple, grid, 500, attractors=expected.attractors)
    assert found.attractors == expected.attractors
    assert np.array_equal(found.settling_time, expected.settling_time)
    assert np.array_equal(found.labels, expected.labels)


def test_the_step_is_kept_by_the_recipe_and_the_family(multiple, pendulum):
    assert multiple.recipe["leap"] == 8
    again = rebuild_map(systems.driven_pendulum(), json.loads(json.dumps(multiple.recipe)))
    assert np.array_equal(again.iterate(PLACES, 13).points, multiple.iterate(PLACES, 13).points)
    other = multiple.with_params(amplitude=0.0025)
    assert other.recipe["leap"] == 8


def test_tables_of_several_periods_need_their_memory(pendulum, monkeypatch):
    grid = CellGrid((-pi, -100.0), (pi, 100.0), (128, 64)).on(pendulum.coordinates)
    assert table_memory(grid, 5, 4) == 3 * table_memory(grid, 5)
    monkeypatch.setattr("cellmap._lib.checks._ALWAYS_FREE", 0)
    monkeypatch.setattr("cellmap._lib.checks.memory_available", lambda: table_memory(grid, 5))
    interpolated_map(pendulum, grid)
    with pytest.raises(MemoryError, match="an interpolation grid of 128 x 64 cells"):
        interpolated_map(pendulum, grid, max_step=4)


@pytest.mark.parametrize("max_step", [0, -2, 3, 6, 2.5, "two"], ids=repr)
def test_multi_period_steps_that_are_none(pendulum, max_step):
    with pytest.raises((ValueError, TypeError), match="max_step"):
        interpolated_map(pendulum, GRID, max_step=max_step)
