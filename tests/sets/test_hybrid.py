"""Attractors that a uniform grid of starts misses."""

from __future__ import annotations

import numpy as np

from cellmap import CellGrid, discrete_map, find_attractors, find_attractors_by_subdivision, find_basins, flow_map
from systems import magnetic_pendulum

SIZE = 4e-4


def with_a_small_one(x, p):
    """A line that goes to 1, with a well of half width p.size around 0.37123 (and the crests beside it)."""
    u = x[0]
    s = (u - 0.37123) / p.size
    plain = u + 0.2 * (1.0 - u)
    return (plain - (plain - 0.37123 - 0.5 * p.size * s) / (1.0 + s * s * s * s * s * s * s * s),)


def test_attractor_with_a_tiny_basin_is_found():
    point_map = discrete_map(with_a_small_one, {"size": SIZE}, ("x",))
    window = CellGrid((-0.5,), (1.5,), (64,))
    by_grid = find_attractors(point_map, CellGrid((-0.5,), (1.5,), (100,)).centres())
    assert len(by_grid) == 1
    found = find_attractors_by_subdivision(point_map, window, 9, steps=2)
    assert sorted(round(float(a.points[0, 0]), 4) for a in found.attractors) == [0.3712, 1.0]
    # The crest from which orbits go either way.
    assert any(boxes.contains([[0.37123 - 1.1 * SIZE]]).any() or len(boxes) < 20 for boxes in found.saddles)
    basins = find_basins(point_map, CellGrid((0.3705,), (0.3720,), (100,)), attractors=found.attractors)
    assert all(0.1 < f.share < 0.9 for f in basins.fractions.values())


def test_magnetic_pendulum_in_four_dimensions():
    """Only boxes near what recurs are stored: a share of less than a thousandth of 64^4."""
    point_map = flow_map(magnetic_pendulum(), 2.0, rtol=1e-6, atol=1e-6)
    window = CellGrid((-1.6, -1.6, -1.5, -1.5), (1.61, 1.61, 1.52, 1.52), (4,) * 4)
    found = find_attractors_by_subdivision(point_map, window, 2, samples=2, max_starts=200)
    assert len(found.attractors) == 3
    radii = [float(np.hypot(*a.points[0, :2])) for a in found.attractors]
    assert np.ptp(radii) < 1e-6 and found.graph.sets[0].grid.size == 16**4
