"""What a search remembers of points, and what regions become of orbits that are followed."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest
from small_maps import logistic

from cellmap import CellGrid, angle, discrete_map, find_attractors, interpolated_map
from cellmap.attractors import search
from cellmap.attractors.continued import orbits_followed
from cellmap.attractors.examined import Examined
from cellmap.attractors.settling import Catalogue, settle
from cellmap.maps.orbit_batch import Orbits


def test_a_point_is_known_if_all_its_coordinates_are():
    """Within 1e-8 of the extent, on the circle for an angle."""
    halves = discrete_map(lambda x, p: (0.5 * x[0], 0.5 * x[1]), {}, (angle("a"), "y"))
    examined = Examined.nothing_yet(halves, np.array([2 * pi, 2.0]))
    assert np.array([0.0, 0.0]) not in examined
    examined.refuse(np.array([[pi, 0.5], [1.0, -0.5]]))
    assert np.array([-pi, 0.5]) in examined
    assert np.array([1.0 + 1e-9, -0.5 - 1e-9]) in examined
    assert np.array([1.0, 0.5]) not in examined
    assert np.array([1.0, -0.5 + 1e-6]) not in examined


def test_an_orbit_whose_period_has_halved_has_no_region():
    """The cycle of period two of the logistic map at 3.02 is the fixed point at 2.98."""
    cycle = find_attractors(logistic(3.02), np.linspace(0.1, 0.9, 9)[:, None], 3000)
    assert [a.period for a in cycle] == [2]
    (followed,) = orbits_followed(logistic(2.98), cycle, np.ones(1)).values()
    assert followed.period == 1 and followed.neighbourhood is None
    (shifted,) = orbits_followed(logistic(3.04), cycle, np.ones(1)).values()
    assert shifted.period == 2
    assert np.array_equal(shifted.neighbourhood.centres, shifted.points)
    assert np.array_equal(shifted.neighbourhood.metrics, cycle[0].neighbourhood.metrics)


def test_settling_times_do_not_depend_on_multi_period_steps():
    """An interpolated map with steps of up to eight periods, on whose cubic splines the map is exact."""
    cubic = discrete_map(lambda x, p: (x[0] + 0.1 * (x[0] - x[0] ** 3), 0.9 * x[1]), {}, ("x", "y"))
    window = CellGrid((-1.5, -1.0), (1.5, 1.0), (64, 64))
    points = CellGrid((-1.4, -0.9), (1.4, 0.9), (30, 11)).centres().reshape(-1, 2)
    found = []
    for step in (1, 8):
        table = interpolated_map(cubic, window, 3, max_step=step)
        attractors = find_attractors(table, points)
        assert len(attractors) == 2
        found.append(settle(table, Orbits.starting(points.copy()), Catalogue.of(attractors, table), 200))
    one, eight = found
    assert np.array_equal(one.labels, eight.labels)
    assert np.abs(one.times - eight.times).max() <= 1  # of orbits that come to the very edge of a region
    assert (one.times == eight.times).mean() > 0.98
    assert one.times.max() > 16


def test_boxes_around_a_continuum_are_listed_once():
    line = discrete_map(lambda x, p: (x[0], 0.5 * x[1] + 0.3 * x[0]), {}, ("x", "y"))
    (found,) = find_attractors(line, CellGrid((-1, -1), (1, 1), (12, 12)).centres())
    assert np.array_equal(found.cover.boxes, np.unique(found.cover.boxes, axis=0))


@pytest.mark.parametrize(
    ("age", "patient", "looked_for"), [(63, True, False), (64, True, True), (63, False, True), (1, False, True)]
)
def test_curves_are_looked_for_at_the_end_or_where_orbits_are_mature(monkeypatch, age, patient, looked_for):
    """A rigid rotation, of which no orbit settles: a search that goes on waits for 64 periods."""
    calls = []
    monkeypatch.setattr(search, "curves_and_cycles", lambda *_, slow: calls.append(f"slow {slow}") or [])
    monkeypatch.setattr(search, "continua", lambda *_: calls.append("continua") or [])
    turning = discrete_map(lambda x, p: (x[0] + 1.0,), {}, (angle("a"),))
    orbits, extent = Orbits.starting(np.array([[0.1], [2.0]])), np.array([2 * pi])
    examined = Examined.nothing_yet(turning, extent)
    for last in (False, True):
        calls.clear()
        left, found, *_ = search.sort_out(turning, orbits, [], 4, extent, age, examined, patient=patient, last=last)
        assert calls == ([f"slow {last}", "continua"] if looked_for else [])
        assert len(left) == 2 and found == []


def test_each_closed_orbit_is_looked_at():
    """Behind those that are known, that are refused, and that do not attract, comes one that is new."""
    wells = discrete_map(lambda x, p: (1.5 * x[0] - 0.5 * x[0] ** 3,), {}, ("x",))
    (known,) = find_attractors(wells, [[0.5]])
    examined = Examined.nothing_yet(wells, np.ones(1))
    examined.refuse(np.array([[0.0]]))
    closed = [(np.array([x]), 1) for x in (1.0, 0.0, 3.0, -1.0, -1.0)]
    found = search.verified_cycles(wells, closed, [known], np.ones(1), examined)
    assert [a.points.tolist() for a in found] == [[[-1.0]]]
    assert found[0].neighbourhood is not None
