"""Attractors distinguished by features of orbits."""

from __future__ import annotations

import subprocess
import sys
from math import pi, sin, sqrt
from typing import Any

import numpy as np
import pytest

from cellmap import Label, PointMap, angle, discrete_map, find_basins
from cellmap.attractors import cluster_orbits
from cellmap.orbits import Kind


def between_circles(x: Any, p: Any) -> tuple[float, float]:
    """Rigid rotations on the circles r = 1 and r = 3, which attract; r = 2 repels."""
    a, r = x
    return a + pi * (sqrt(5.0) - 1.0), r - 0.2 * (r - 1.0) * (r - 2.0) * (r - 3.0)


@pytest.fixture(scope="module")
def circles() -> PointMap:
    return discrete_map(between_circles, {}, (angle("a"), "r"))


def test_invariant_circles_are_two_clusters(circles: PointMap) -> None:
    rng = np.random.default_rng(0)
    initial_conditions = np.stack([rng.uniform(-pi, pi, 300), rng.uniform(0.5, 3.5, 300)], axis=-1)
    initial_conditions = initial_conditions[np.abs(initial_conditions[:, 1] - 2.0) > 0.01]
    basins = find_basins(circles, initial_conditions, max_periods=500)
    assert [a.kind for a in basins.attractors] == 2 * [Kind.QUASIPERIODIC]
    innermost = basins.labels[np.argmin(initial_conditions[:, 1])]
    assert np.array_equal(basins.labels == innermost, initial_conditions[:, 1] < 2.0)
    found = cluster_orbits(circles, initial_conditions)
    assert len(found.samples) == 2
    inner = found.labels[np.argmin(initial_conditions[:, 1])]
    assert np.array_equal(found.labels == inner, initial_conditions[:, 1] < 2.0)
    assert found.samples[inner][:, 1] == pytest.approx(1.0)
    assert found.samples[1 - inner][:, 1] == pytest.approx(3.0)
    assert np.count_nonzero(found.labels == 0) >= np.count_nonzero(found.labels == 1)
    # The order of the initial conditions decides nothing but the order of the labels.
    again = cluster_orbits(circles, initial_conditions[::-1].copy())
    assert np.array_equal(again.labels[::-1], found.labels)


def test_a_branch_cut_parts_no_attractor() -> None:
    """The attracting point of this map of the circle is at pi, where the angle has its branch cut."""
    circle = discrete_map(lambda x, p: (x[0] + 0.3 * sin(x[0]),), {}, (angle("a"),))
    initial_conditions = np.linspace(-3.0, 3.0, 40)[:, None]
    ends = circle.iterate(initial_conditions, 60).points
    assert ends.min() < -3.1 and ends.max() > 3.1
    found = cluster_orbits(circle, initial_conditions, transient=60)
    assert len(found.samples) == 1 and (found.labels == 0).all()


def test_orbits_that_end_and_outliers_have_labels_of_their_own() -> None:
    cubic = discrete_map(lambda x, p: (1.5 * x[0] - 0.5 * x[0] ** 3,), {}, ("x",))
    initial_conditions = np.concatenate([np.linspace(0.2, 1.2, 30), [-0.5, 5.0]])[:, None].reshape(2, 16, 1)
    found = cluster_orbits(cubic, initial_conditions)
    assert found.labels.shape == (2, 16)
    assert found.labels[-1, -2:].tolist() == [Label.UNDECIDED, Label.DIVERGED]
    assert (found.labels.ravel()[:-2] == 0).all()
    assert np.isnan(found.features[-1, -1]).all()
    assert len(cluster_orbits(cubic, initial_conditions, min_size=1).samples) == 2


def test_features_of_ones_own(circles: PointMap) -> None:
    initial_conditions = np.stack([np.zeros(40), np.linspace(0.6, 3.4, 40)], axis=-1)
    found = cluster_orbits(circles, initial_conditions, features=lambda orbit: orbit.points[-1][:, 1:] ** 2)
    assert found.features.shape == (40, 1)
    assert found.features[found.labels == found.labels[0]] == pytest.approx(1.0)
    with pytest.raises(ValueError, match=r"features returned the shape \(40,\): return one of \(40, features\)"):
        cluster_orbits(circles, initial_conditions, features=lambda orbit: orbit.points[-1][:, 1])


def test_basins_do_not_wait_for_the_library_of_clusters() -> None:
    code = "import sys, cellmap.basins.finding, cellmap.attractors.clustering; sys.exit('sklearn' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
