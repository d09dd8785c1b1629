"""Boxes of chaotic attractors that lie in a neighbourhood which no orbit leaves."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from cellmap import CellGrid, angle, discrete_map, find_basins, stroboscopic_map
from cellmap.attractors.settling import Catalogue, classify
from cellmap.attractors.trapping_boxes import is_trapped, trapped_boxes
from cellmap.orbits.attractor import Cover
from systems import ueda_oscillator

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
    return point_map, find_basins(point_map, CellGrid((-4.0, -6.0), (4.0, 6.0), (96, 96)))


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
    points = basins.grid.centres().reshape(-1, 2)[::7]
    full = classify(point_map, Catalogue.of(waiting, point_map), points, 2000)
    times = basins.settling_time.ravel()[::7]
    assert np.array_equal(full.labels, basins.labels.ravel()[::7])
    assert (times <= full.times).all() and (times == full.times).mean() > 0.8
