"""Attractors distinguished by features of orbits."""

from math import pi, sin, sqrt
from typing import Any

import numpy as np
import pytest

from cellmap import Label, PointMap, angle, discrete_map
from cellmap.attractors import cluster_orbits
from cellmap.attractors.features.feature_groups import check_clusterer, grouped


def between_circles(x: Any, p: Any) -> tuple[float, float]:
    """Rigid rotations on the circles r = 1 and r = 3, which attract; r = 2 repels."""
    a, r = x
    return a + pi * (sqrt(5.0) - 1.0), r - 0.2 * (r - 1.0) * (r - 2.0) * (r - 3.0)


@pytest.fixture(scope="module")
def circles() -> PointMap:
    return discrete_map(between_circles, {}, (angle("a"), "r"))


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


# --- groups of feature vectors


RNG = np.random.default_rng(2)
SIZES, CENTRES = (300, 200, 100), np.array([[0.0, 0.0], [5.0, 0.0], [0.0, 5.0]])
BLOBS = np.concatenate([c + 0.05 * RNG.standard_normal((n, 2)) for n, c in zip(SIZES, CENTRES, strict=True)])
OWNERS = np.repeat([0, 1, 2], SIZES)


class Halves:
    """An estimator that looks at one coordinate only."""

    def fit_predict(self, values):
        return (values[:, 0] > 0.5).astype(int)


def test_blobs_are_groups_and_the_largest_is_the_first():
    found = grouped(BLOBS, None, 0.02, 10)
    assert found.count == 3
    assert found.nearest(np.array([[4.8, 0.1], [0.1, 4.9], [0.1, 0.1]])).tolist() == [1, 2, 0]
    assert np.array_equal(found.labels, OWNERS)
    again = grouped(BLOBS[::-1].copy(), None, 0.02, 10)
    assert np.array_equal(again.labels[::-1], OWNERS)


def test_a_chain_is_never_divided():
    """Vectors 0.01 apart in a row that the estimator would cut at 0.5."""
    row = np.stack([np.arange(0.0, 1.0, 0.01), np.zeros(100)], axis=-1)
    assert grouped(row, Halves(), 0.015, 5).count == 1
    parts = grouped(np.concatenate([row[:40], row[60:]]), Halves(), 0.015, 5)
    assert parts.count == 2
    assert parts.labels.tolist() == [0] * 40 + [1] * 40


def test_many_vectors_are_labelled_by_those_that_are_fitted():
    """5,000 vectors, of which 2,000 are fitted; the others are in the group of their neighbours."""
    first, second = RNG.uniform(0, 1, (3000, 2)), RNG.uniform([3, 0], [4, 1], (2000, 2))
    values = np.concatenate([first, second, [[1.9, 0.5]]])
    found = grouped(values, None, 1e-4, 10)
    assert found.count == 2
    assert (found.labels[:3000] == 0).mean() > 0.99 and (found.labels[3000:5000] == 1).mean() > 0.99
    assert not (found.labels[:3000] == 1).any() and not (found.labels[3000:5000] == 0).any()
    assert found.labels[-1] == -1


def test_estimators_that_do_not_group():
    with pytest.raises(TypeError, match="give an estimator with a method fit_predict"):
        check_clusterer(Halves)
    with pytest.raises(TypeError, match="fit_predict"):
        check_clusterer(3)
    check_clusterer(Halves())

    class Drawn(Halves):
        def __init__(self, random_state):
            self.random_state = random_state

        def get_params(self):
            return {"random_state": self.random_state}

        def fit_predict(self, values):
            return np.zeros(len(values) + 1, int)

    with pytest.raises(ValueError, match="give it a seed"):
        check_clusterer(Drawn(None))
    check_clusterer(Drawn(3))
    with pytest.raises(ValueError, match=r"returned the shape \(601,\) for 600 orbits"):
        grouped(BLOBS, Drawn(3), 1e-9, 10)
