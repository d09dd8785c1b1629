"""How long orbits have to stay on a chaotic attractor, and how many of them are followed for long."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from cellmap import CellGrid, angle, discrete_map, find_basins, stroboscopic_map
from cellmap.attractors.kinds import chaos
from cellmap.attractors.regions.boxes import RESIDENCE
from cellmap.attractors.regions.trapping_boxes import is_trapped, trapped_boxes
from cellmap.attractors.settling.residence import with_full_residence
from cellmap.attractors.settling.settle import Catalogue, classify
from cellmap.attractors.shortcuts.wandering import are_chaotic, representatives
from cellmap.basins import load_basins, save_basins
from cellmap.maps.point_map import PointMap
from cellmap.orbits.attractor import Cover
from systems import henon_map, ueda_oscillator

HENON = henon_map()
CUBIC = discrete_map(lambda x, p: (p.a * x[0] - x[0] ** 3 - 0.1 * x[1], x[0]), {"a": 2.61}, ("x", "y"))
ODD = discrete_map(lambda x, p: (2.598 * x[0] - x[0] ** 3,), {}, ("x",))
SIX = discrete_map(lambda x, p: (1 - 1.07 * x[0] ** 2 + x[1], 0.3 * x[0]), {}, ("x", "y"))
CASES = {
    "a pair on a line": (ODD, CellGrid((-1.8,), (1.8,), (8192,))),
    "beside a cycle": (SIX, CellGrid((-0.9, -0.3), (0.9, 0.3), (96, 96))),
}


@pytest.mark.parametrize(
    "name", ["a pair on a line", *(pytest.param(n, marks=pytest.mark.thorough) for n in CASES if "line" not in n)]
)
def test_labels_and_times_are_those_after_64_periods(name, tmp_path):
    point_map, grid = CASES[name]
    basins = find_basins(point_map, grid)
    covers = [a.cover for a in basins.attractors if a.cover is not None]
    assert all(8 <= cover.residence < RESIDENCE for cover in covers) and covers
    catalogue = Catalogue.of(with_full_residence(basins.attractors), point_map)
    full = classify(point_map, catalogue, grid.centres().reshape(-1, grid.dimension), 2000)
    assert np.array_equal(full.labels, basins.labels.ravel())
    assert np.array_equal(full.times, basins.settling_time.ravel())
    again = load_basins(save_basins(basins, tmp_path / "chaotic.h5"))
    assert [a.cover.residence for a in again.attractors if a.cover is not None] == [c.residence for c in covers]


def wandering(point_map: PointMap, number: int) -> np.ndarray:
    begin = np.random.default_rng(0).uniform(-0.5, 0.5, (number, 2))
    return point_map.iterate(begin, 500).points


def test_of_the_orbits_on_each_chaotic_set_as_many_are_kept():
    points = wandering(CUBIC, 800)
    kept = representatives(CUBIC, points, np.ones(2))
    assert are_chaotic(CUBIC, points, np.ones(2)) and len(kept) == 2 * 256
    assert np.count_nonzero(points[kept, 0] > 0) in range(200, 312)  # each orbit stays on its side
    away = np.concatenate([points, [[1.9, -1.7]]])  # an orbit that diverges
    assert not are_chaotic(CUBIC, away, np.ones(2)) or 800 in representatives(CUBIC, away, np.ones(2))


# --- boxes in a neighbourhood that no orbit leaves


# A line that is folded: x -> 4 a x (1 - x) has the trapping interval [f(f(1/2)), f(1/2)], and y halves.
FOLD = discrete_map(lambda x, p: (4.0 * p.a * x[0] * (1.0 - x[0]), 0.5 * x[1]), {"a": 0.95}, ("x", "y"))
BOXES = Cover(
    np.array([0.0, -0.5]),
    np.array([1.0 / 64, 1.0 / 64]),
    np.array([(i, j) for i in range(10, 62) for j in range(30, 34)], np.int64),
)
ORBIT = FOLD.orbit([0.3, 0.0], 400).points[100:]


@pytest.fixture(scope="module")
def ueda():
    point_map = stroboscopic_map(ueda_oscillator())
    return point_map, find_basins(point_map, CellGrid((-4.0, -6.0), (4.0, 6.0), (24, 24)))


def test_boxes_around_a_folded_line_are_trapped_while_it_maps_into_itself():
    """At a = 0.95 images of (0, 1) stay in [0, 0.95]; at a = 1.02 a part of them leaves it for good."""
    assert trapped_boxes(FOLD, BOXES, ORBIT).all()
    assert not trapped_boxes(FOLD.with_params(a=1.02), BOXES, ORBIT).any()


def test_no_box_is_trapped_beside_another_attractor_or_without_the_points(ueda):
    _, basins = ueda
    (chaotic,) = basins.attractors
    other = replace(chaotic, points=np.array([[0.5, 0.1]]), coordinates=FOLD.coordinates)
    assert not trapped_boxes(FOLD, BOXES, ORBIT, [other]).any()
    assert trapped_boxes(FOLD, BOXES, ORBIT, [replace(other, points=np.array([[0.5, 9.0]]))]).all()
    assert not trapped_boxes(FOLD, BOXES, np.array([[0.5, 0.0], [2.0, 0.0]])).any()


def test_a_jump_narrower_than_boxes_is_seen():
    """Orbits from a part of a box are thrown out, as corners of cells or random points in them show."""

    def rule(x, p):
        return (2.0 if abs(x[0] - 0.6101) < 3e-3 else 3.8 * x[0] * (1.0 - x[0])), 0.5 * x[1]

    assert not trapped_boxes(discrete_map(rule, {}, ("x", "y")), BOXES, ORBIT).any()


def test_circle_is_covered_by_boxes_all_around():
    """theta -> 2 theta on the circle, where all boxes are trapped; and theta -> theta + 1 with a rise in y."""
    doubled = discrete_map(lambda x, p: (2.0 * x[0], 0.5 * x[1]), {}, (angle("theta"), "y"))
    boxes = np.array([(i, j) for i in range(64) for j in (-1, 0)], np.int64)
    cover = Cover(np.array([-pi, 0.0]), np.array([2.0 * pi / 64, 0.1]), boxes)
    points = np.stack([np.linspace(-3.0, 3.0, 64), np.zeros(64)], axis=1)
    assert trapped_boxes(doubled, cover, points).all()
    rising = discrete_map(lambda x, p: (x[0] + 1.0, x[1] + 0.05), {}, (angle("theta"), "y"))
    assert not trapped_boxes(rising, cover, points).any()


def test_labels_are_those_after_64_periods_and_times_not_later(ueda):
    """An orbit in a trapped box stays, so that to wait for 64 periods in a row changes no label."""
    point_map, basins = ueda
    assert [is_trapped(a) for a in basins.attractors] == [True]
    waiting = [replace(a, cover=replace(a.cover, trapped=None)) for a in basins.attractors]
    points = basins.grid.centres().reshape(-1, 2)[::3]
    full = classify(point_map, Catalogue.of(waiting, point_map), points, 2000)
    times = basins.settling_time.ravel()[::3]
    assert np.array_equal(full.labels, basins.labels.ravel()[::3])
    assert (times <= full.times).all() and (times == full.times).mean() > 0.8


def test_all_orbits_are_kept_where_some_are_not_chaotic_or_they_are_few(monkeypatch):
    points = wandering(HENON, 600)
    points[300:] = [0.631354477089505, 0.18940634312685142]  # the fixed point
    monkeypatch.setattr(chaos, "growth_along", None)  # no exponents are needed: it comes back to where it is
    assert not are_chaotic(HENON, points, np.ones(2))
    assert representatives(HENON, points[:300], np.ones(2)).tolist() == list(range(300))
