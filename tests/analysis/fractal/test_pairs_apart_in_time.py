"""Theiler's correction on a circle: pairs near in time are left out at their distance across the branch cut."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

from cellmap import angle
from cellmap.analysis.fractal import correlation_dimension


@pytest.mark.parametrize("norm", [2.0, np.inf])
@pytest.mark.parametrize("theiler", [1, 9])
def test_pairs_of_a_circle_are_counted_exactly(theiler, norm):
    """All distances one by one, those of the angle along the shorter arc; neighbours in time often cross the cut."""
    n, radii = 1100, np.array([0.5, 0.25, 0.12])
    time = np.arange(n)
    points = np.column_stack([np.mod(0.07 * time + 0.3 * np.sin(time) + pi, 2 * pi) - pi, 0.2 * np.cos(0.4 * time)])
    found = correlation_dimension(
        points,
        radii,
        theiler=theiler,
        norm=norm,
        coordinates=(angle("a"), "x"),
        scale=(1.0, 1.0),
        fit_range=(0.12, 0.5),
    )
    between = np.abs(points[:, None] - points[None])
    between[..., 0] = np.minimum(between[..., 0], 2 * pi - between[..., 0])
    distance = np.linalg.norm(between, ord=norm, axis=-1)
    apart = np.abs(time[:, None] - time) > theiler
    np.testing.assert_allclose(found.fractions, [(distance[apart] <= r).mean() for r in radii], rtol=1e-12)
