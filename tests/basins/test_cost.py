"""The cost that maps and basins report, counted in other ways."""

from __future__ import annotations

from dataclasses import replace

import pytest

from cellmap import CellGrid, discrete_map, find_basins, interpolated_map, stroboscopic_map
from systems import two_well_duffing

TABLE = CellGrid((-3.0, -3.0), (3.0, 3.0), (40, 40))
INITIAL_CONDITIONS = CellGrid((-1.5, -1.5), (1.5, 1.5), (30, 30))


def counted(calls):
    """Return a contraction whose applications to single points are counted."""
    exact = discrete_map(lambda x, p: (0.5 * x[0] - 0.1 * x[0] ** 3, 0.4 * x[1]), {}, ("x", "y"))

    def advance(orbits, periods):
        calls.append(int(orbits.alive.sum()) * periods)
        exact.advance(orbits, periods)

    return replace(exact, advance=advance)


def test_every_step_is_a_look_up_or_an_image():
    calls = []
    exact = counted(calls)
    direct = find_basins(exact, INITIAL_CONDITIONS)
    assert direct.cost.evaluations == direct.cost.steps > 0
    calls.clear()
    icm = interpolated_map(exact, TABLE, order=1, outside="integrate")  # coarse: some cells are left to the map
    assert icm.cost.evaluations == icm.cost.steps == sum(calls)
    assert icm.cost.look_ups == 0 < icm.cost.tabulation == icm.cost.seconds
    basins = find_basins(icm, CellGrid((-3.6, -3.6), (3.6, 3.6), (50, 50)))
    assert basins.cost.look_ups > 0
    assert basins.cost.evaluations > 0
    assert basins.cost.look_ups + basins.cost.evaluations == basins.cost.steps
    assert basins.cost.tabulation == icm.cost.tabulation
    assert 0 < basins.cost.iteration < basins.cost.seconds


@pytest.mark.parametrize(("method", "stages"), [("RK45", 7), ("DOP853", 12), ("Taylor", 1)])
def test_right_hand_sides_of_methods(method, stages):
    exact = stroboscopic_map(two_well_duffing(), method=method)
    basins = find_basins(exact, CellGrid((-1.5, -1.5), (1.5, 1.5), (12, 12)))
    cost = basins.cost
    assert cost.evaluations % stages == 0
    assert cost.evaluations > 4 * stages * cost.steps
    assert cost.look_ups == cost.tabulation == 0


def test_multi_period_steps_take_fewer_look_ups():
    exact = discrete_map(lambda x, p: (0.995 * x[0] - 0.001 * x[0] ** 3, 0.99 * x[1]), {}, ("x", "y"))
    costs = [
        find_basins(interpolated_map(exact, TABLE, max_step=max_step), INITIAL_CONDITIONS).cost for max_step in (1, 8)
    ]
    assert costs[1].look_ups < costs[0].look_ups
