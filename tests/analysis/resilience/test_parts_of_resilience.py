"""Integrity and tipping: which window a ball meets, and how attractors are matched."""

from __future__ import annotations

from math import sqrt

import numpy as np
import pytest

from cellmap import CellGrid, discrete_map, find_basins
from cellmap.analysis.resilience import local_integrity, minimal_fatal_shock, shocks, tipping_probabilities

CUBIC = discrete_map(lambda x, p: (1.5 * x[0] - p.c * x[0] ** 3,), {"c": 0.5}, ("x",))


def test_a_ball_that_the_map_has_confirmed_ends_at_the_boundary_and_not_at_the_window():
    """From 1 to the edge of the window it is 0.6, to the boundary at sqrt(3) 0.732, and to that at 0 it is 1."""
    basins = find_basins(CUBIC, CellGrid((-1.5,), (1.6,), (62,)))
    upper = next(k for k, a in enumerate(basins.attractors) if a.points[0, 0] > 0)
    image, refined = (local_integrity(basins, upper, scale=1.0, refine=r) for r in (False, True))
    assert image.meets_window and image.shock is None
    assert image.radius == image.image_radius == pytest.approx(1.0, abs=0.05)
    assert refined.shock is not None and not refined.meets_window
    assert refined.radius == pytest.approx(sqrt(3) - 1, abs=1e-6)


def test_arrays_of_labels_are_matched_by_their_numbers():
    """Distances of attractors need basins on both sides."""
    grid = CellGrid((-1.5,), (1.5,), (30,))
    before, after = find_basins(CUBIC, grid), find_basins(CUBIC.with_params(c=0.49), grid)
    assert tipping_probabilities(before, after).match == "distance"
    for pair in ((before.labels, after), (before, after.labels), (before.labels, after.labels)):
        assert tipping_probabilities(*pair).match == "labels"
        with pytest.raises(ValueError, match="match='distance'"):
            tipping_probabilities(*pair, match="distance")
    assert np.array_equal(tipping_probabilities(before, after).counts, 15 * np.eye(2))


def test_as_many_shocks_are_counted_as_were_tried(monkeypatch):
    """In the last round, from some points of the attractor; all are inside of the ball, and none is fatal."""
    tried = []

    def inside(fatal, shock, number, rng):
        tried.append(number)
        return np.empty((0, 1))

    monkeypatch.setattr(shocks, "fatal_inside", inside)
    basins = find_basins(CUBIC, CellGrid((-1.5,), (1.5,), (60,)))
    found = minimal_fatal_shock(basins, 0, scale=1.0, n_trials=1000)
    assert found.tested == sum(tried) >= 1000
    assert found.inside_fatal == 0
