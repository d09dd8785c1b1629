"""The same question has the same labels: threads, order, grids and points, known attractors."""

from math import exp

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from known_basins import LINE, circle_grid, counts, pendulum

import systems
from cellmap import (
    CellGrid,
    Label,
    discrete_map,
    find_attractors,
    find_basins,
    interpolated_map,
    set_threads,
)

# Initial conditions of more than one tile each.
DETERMINISTIC = {
    "pendulum": (pendulum, circle_grid(500.0, 130)),
    "table": (lambda: interpolated_map(pendulum(), circle_grid(300.0, 64), outside="escape"), circle_grid(300.0, 130)),
    "Henon": (systems.henon_map, CellGrid((-2.0, -2.0), (2.0, 2.0), (130, 130))),
}


@pytest.mark.parametrize(
    "name", ["Henon", *(pytest.param(k, marks=pytest.mark.thorough) for k in ("pendulum", "table"))]
)
def test_labels_do_not_depend_on_threads_or_the_order_of_initial_conditions(name):
    make, grid = DETERMINISTIC[name]
    initial_conditions = grid.centres().reshape(-1, 2)
    order = np.random.default_rng(0).permutation(len(initial_conditions))
    set_threads(1)
    straight = find_basins(make(), initial_conditions, max_periods=500)
    set_threads(3)
    shuffled = find_basins(straight.point_map, initial_conditions[order], max_periods=500)
    assert [a.name for a in shuffled.attractors] == [a.name for a in straight.attractors]
    assert np.array_equal(shuffled.labels, straight.labels[order])


def test_initial_conditions_that_are_settled_are_not_followed_again_for_an_attractor_that_is_found_late():
    """Five of 40,001 initial conditions belong to an attractor of their own, and the sample holds none of them."""
    point_map = discrete_map(tiny, {}, ("x",))
    initial_conditions = np.linspace(-10.0, 10.0, 40_001)[:, None]
    first = find_basins(point_map, initial_conditions)
    assert sorted(counts(first))[0] < 10
    again = find_basins(point_map, initial_conditions, attractors=first.attractors)
    assert np.array_equal(first.labels, again.labels)
    assert np.array_equal(first.settling_time, again.settling_time)
    assert first.cost.steps < again.cost.steps + 10 * 1000


def tiny(x, p):
    """Halve the distance to 0, but at 5 to 5."""
    return (0.5 * x[0] + 2.5 * exp(-(((x[0] - 5.0) / 1e-3) ** 2)),)


@pytest.fixture(scope="module")
def both_wells():
    return find_attractors(LINE, [[0.5], [-0.5]])


@given(
    cells=st.integers(1, 40),
    lower=st.floats(-3, 3).map(lambda v: round(v, 3)),
    length=st.floats(0.01, 5).map(lambda v: round(v, 3)),
)
def test_labels_of_any_grid_are_those_of_its_centres(both_wells, cells, lower, length):
    """Two wells: the sign of the centre, and on the boundary itself no attractor."""
    grid = CellGrid((lower,), (lower + length,), (cells,))
    basins = find_basins(LINE, grid, max_periods=100, attractors=both_wells)
    sign = np.sign(grid.axis(0))
    for label, place in zip(basins.labels, sign, strict=True):
        if place == 0:
            assert label == Label.UNDECIDED
        else:
            assert np.sign(basins.attractors[label].points[0, 0]) == place
