"""Groups of feature vectors: blobs that are known, points between them, chains, and estimators."""

from __future__ import annotations

import numpy as np
import pytest

from cellmap.attractors.feature_groups import FeatureGroups, check_clusterer, grouped

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
    assert np.array_equal(found.labels, OWNERS)
    again = grouped(BLOBS[::-1].copy(), None, 0.02, 10)
    assert np.array_equal(again.labels[::-1], OWNERS)


def test_what_lies_apart_is_in_no_group_and_nearest_to_one():
    lonely = np.array([[2.0, 0.0], [2.1, 0.0], [-9.0, -9.0]])
    found = grouped(np.concatenate([BLOBS, lonely]), None, 0.02, 10)
    assert found.labels[-3:].tolist() == [-1, -1, -1]
    assert np.array_equal(found.labels[:-3], OWNERS)
    assert isinstance(found, FeatureGroups)
    assert found.nearest(np.array([[4.8, 0.1], [0.1, 4.9], [0.1, 0.1]])).tolist() == [1, 2, 0]


def test_few_that_are_alike_are_a_group_from_a_size_on():
    """Ten equal vectors among six hundred others: a group if ten are enough, none if eleven are needed."""
    values = np.concatenate([BLOBS, np.full((10, 2), 9.0)])
    assert grouped(values, None, 0.02, 10).labels[-10:].tolist() == [3] * 10
    assert grouped(values, None, 0.02, 11).labels[-10:].tolist() == [-1] * 10


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
