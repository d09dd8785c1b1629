"""Sweeps over a parameter with tables and states over it: the labels of each value alone, audited."""

from math import exp

import numpy as np
import pytest

from cellmap import CellGrid, discrete_map, find_basins, interpolated_map
from cellmap.basins import continuation, continuation_states, continue_basins
from cellmap.basins.initial_conditions import InitialConditions

WINDOW = CellGrid((-2.0, -2.0), (2.0, 2.0), (64, 64))
PLACES = CellGrid((-1.5, -1.5), (1.5, 1.5), (40, 40))


def wells(x, p):
    """A damped step in x^4/4 - x^2/2 - tilt x: two wells where abs(tilt) < 2/sqrt(27) = 0.385."""
    y = 0.8 * x[1] + p.h * (x[0] - x[0] ** 3 + p.tilt)
    return x[0] + y, y


def switched(x, p):
    """The same with a tilt at h = 0.0862 +- 0.0001 only, between the nodes of all tables over the interval."""
    y = 0.8 * x[1] + p.h * (x[0] - x[0] ** 3 + p.tilt + 0.6 * exp(-(((p.h - 0.0862) / 1e-4) ** 2)))
    return x[0] + y, y


def table(function=wells, **params):
    return interpolated_map(discrete_map(function, {"h": 0.08, "tilt": 0.0, **params}, ("x", "y")), WINDOW)


def by_side(count, attractors):
    """Return the counts of the attractors on the left and on the right, by labels of all attractors."""
    sides = {k: int(a.points[0, 0] > 0) for k, a in attractors.items()}
    return [sum(count[k] for k, s in sides.items() if s == side) for side in (0, 1)]


def alone(point_map, name, values):
    """Return the same counts at each value, from a search at that value."""
    found = [find_basins(point_map.with_params(**{name: value}), PLACES) for value in values]
    return [by_side({k: f.count for k, f in b.fractions.items()}, dict(enumerate(b.attractors))) for b in found]


def counts_by_side(sweep):
    rows = zip(sweep.counts.tolist(), sweep.attractors, strict=True)
    return [by_side(dict(zip(sweep.labels, row, strict=True)), attractors) for row, attractors in rows]


VALUES = np.linspace(0.08, 0.088, 40)


@pytest.fixture(scope="module")
def sweep():
    return continue_basins(table(), "h", VALUES, PLACES)


def test_labels_from_states_are_those_of_each_value_alone(sweep) -> None:
    assert counts_by_side(sweep)[::6] == alone(table(), "h", VALUES[::6])
    # All but the first value by states, each with the audit of one in 64, and no difference.
    assert (sweep.audited[0] == 0).all()
    assert (sweep.audited[1:, 0] == PLACES.size // 64).all()
    assert (sweep.audited[:, 1] == 0).all()
    assert sweep.cost.steps < 0.7 * find_basins(table(), PLACES).cost.steps * len(VALUES)


def test_each_label_is_that_of_the_whole_orbit() -> None:
    icm, places = table(), InitialConditions.of(PLACES, table())
    maps = continuation.MapsOverValues(icm, "h", VALUES)
    window = maps.window(0)
    first = find_basins(maps.at(0), PLACES).attractors
    plan = continuation_states.plan_of(window.table, VALUES, places, first)
    states = continuation_states.states_over(window.table, maps.interval(0, 40), places, plan)
    assert states.periods.mean() > 4
    for number in (3, 21):
        point_map = maps.at(number)
        basins = find_basins(point_map, PLACES)
        found = continuation_states.labels_from(
            states, VALUES[number], number, point_map, places, basins.attractors, 256
        )
        assert np.array_equal(found.labels, basins.labels.ravel())
        # The states themselves are those to which the map leads.
        rows = np.flatnonzero(states.periods == plan.steps[-1])[::50]
        exact = point_map.iterate(places.points(rows), plan.steps[-1]).points
        np.testing.assert_allclose(states.at(VALUES[number], slice(0, PLACES.size))[rows], exact, atol=1e-8)


def test_what_a_parameter_does_between_the_nodes_of_tables() -> None:
    icm, maps = table(switched), continuation.MapsOverValues(table(switched), "h", VALUES)
    tilted = np.abs(VALUES - 0.0862) < 2.8e-4
    served = [maps.window(number).table.serves(maps.window(number).table.at(VALUES[number])) for number in range(40)]
    assert np.array_equal(served, ~tilted)
    sweep = continue_basins(icm, "h", VALUES, PLACES)
    assert counts_by_side(sweep)[26:36] == alone(icm, "h", VALUES[26:36])
    assert (sweep.audited[tilted, 0] == 0).all()


@pytest.mark.thorough
def test_an_audit_that_finds_a_difference_has_all_labels_found_again(monkeypatch, sweep) -> None:
    before = continuation_states.StatesOverParameter.at

    def wrong(self, value, part):
        states = before(self, value, part)
        return states[::-1] if value > VALUES[32] else states

    monkeypatch.setattr(continuation_states.StatesOverParameter, "at", wrong)
    again = continue_basins(table(), "h", VALUES, PLACES)
    assert np.array_equal(again.counts, sweep.counts)
    assert (again.audited[33:, 1] > 0).all()
    assert (again.audited[:33, 1] == 0).all()
