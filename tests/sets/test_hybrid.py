"""Attractors that a uniform grid of initial conditions misses."""

from __future__ import annotations

import numpy as np
import pytest

from cellmap import CellGrid, discrete_map, find_attractors, find_basins
from cellmap.maps import flow_map
from cellmap.sets import find_attractors_by_subdivision
from systems import magnetic_pendulum

CENTRE, SIZE = 0.36, 4e-3


def with_a_small_one(x, p):
    """Attracting at 0 and 1, and at the centre of a notch in the crest between them."""
    u = x[0]
    s = (u - CENTRE) / SIZE
    return (u + 0.01 * u * (1.0 - u) * s * (s * s - 1.0) / (1.0 + s**4) ** 0.75,)


def test_attractor_with_a_tiny_basin_is_found():
    """Its basin is the notch, 0.008 wide, between two nodes of a grid that is 0.028 wide."""
    point_map = discrete_map(with_a_small_one, {}, ("x",))
    initial_conditions = CellGrid((-0.2,), (1.2,), (50,))
    by_grid = find_attractors(point_map, initial_conditions.centres())
    assert sorted(round(float(a.points[0, 0]), 6) + 0.0 for a in by_grid) == [0.0, 1.0]
    found = find_attractors_by_subdivision(point_map, CellGrid((-0.2,), (1.2,), (50,)), 8)
    assert sorted(round(float(a.points[0, 0]), 6) + 0.0 for a in found.attractors) == [0.0, CENTRE, 1.0]
    assert any(boxes.contains([CENTRE - SIZE]) for boxes in found.saddles)
    assert any(boxes.contains([CENTRE + SIZE]) for boxes in found.saddles)
    basins = find_basins(point_map, CellGrid((0.3,), (0.42,), (600,)), attractors=found.attractors)
    label = [round(float(a.points[0, 0]), 6) for a in basins.attractors].index(CENTRE)
    assert abs(basins.fractions[label].fraction - 2 * SIZE / 0.12) < 0.01


@pytest.mark.thorough
def test_magnetic_pendulum_in_four_dimensions():
    """Only boxes near recurrent sets are stored: less than a thousandth of 64^4."""
    point_map = flow_map(magnetic_pendulum(), 2.0, rtol=1e-6, atol=1e-6)
    window = CellGrid((-1.6, -1.6, -1.5, -1.5), (1.61, 1.61, 1.52, 1.52), (4,) * 4)
    found = find_attractors_by_subdivision(point_map, window, 2, samples=2, max_initial_conditions=200)
    assert len(found.attractors) == 3
    radii = [float(np.hypot(*a.points[0, :2])) for a in found.attractors]
    assert np.ptp(radii) < 1e-6 and found.graph.sets[0].grid.size == 16**4
