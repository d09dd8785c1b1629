"""Balls that grow in three dimensions: where they may end is known in closed form."""

from __future__ import annotations

from math import cos, sin

import numpy as np

from cellmap import CellGrid, discrete_map, find_basins
from cellmap.basins import prove

RADIUS = 0.5
"""Of the sphere of unstable points: inside all orbits come to 0, outside all go away."""


def spiral(x, p):
    """Turn about two axes, and multiply by 0.4 + 0.6 r^2, with r in units of RADIUS, which is 1 at r = 1 exactly."""
    a, b, c = x
    r = p.least + (1.0 - p.least) * (a * a + b * b + c * c) / RADIUS**2
    u, v = cos(0.7) * a - sin(0.7) * b, sin(0.7) * a + cos(0.7) * b
    return r * u, r * (cos(0.4) * v - sin(0.4) * c), r * (sin(0.4) * v + cos(0.4) * c)


def test_no_ball_in_three_dimensions_grows_beyond_the_basin():
    """The witness is r -> r (0.4 + 0.6 r^2): it decreases exactly where r < 1."""
    image = discrete_map(spiral, {"least": 0.4}, ("a", "b", "c"))
    basins = find_basins(image, CellGrid((-1.5, -1.5, -1.5), (1.5, 1.5, 1.5), (6, 6, 6)))
    proof = prove(basins, splits=0)
    balls = next(iter(proof.attractors.values()))
    rng = np.random.default_rng(0)
    surface = rng.normal(size=(4000, 3))
    surface *= balls.reach / np.linalg.norm(surface, axis=1, keepdims=True)
    points = balls.centres[0] + np.linalg.solve(balls.frames[0], surface.T).T
    distances = np.linalg.norm(points, axis=1)
    assert balls.reach > 1.4 * balls.radius  # it has grown
    assert distances.min() > 0.4 * RADIUS and distances.max() < RADIUS
