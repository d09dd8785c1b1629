"""Basins by features of orbits, against verified basins, SciPy and closed forms."""

from math import pi
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import systems
from cellmap import CellGrid, Label, PointMap, discrete_map, find_basins, plot, set_threads, stroboscopic_map
from cellmap.attractors.features.feature_groups import grouped
from cellmap.basins import classify_by_features
from cellmap.maps import Iterate


def two_wells() -> PointMap:
    return stroboscopic_map(systems.two_well_duffing(damping=0.25, forcing=0.05), rtol=1e-6, atol=1e-6)


def pendulum() -> PointMap:
    return stroboscopic_map(systems.driven_pendulum(amplitude=0.003), rtol=1e-6, atol=1e-6)


def henon() -> PointMap:
    return systems.henon_map(1.07, 0.3)


@pytest.mark.parametrize(
    ("build", "window", "transient", "periods"),
    [
        (two_wells, CellGrid((-2, -2), (2, 2), (30, 30)), 100, 20),
        (pendulum, CellGrid((-pi, -40), (pi, 40), (20, 20)), 600, 20),
        pytest.param(henon, CellGrid((-2, -2), (2, 2), (120, 120)), 1000, 200, marks=pytest.mark.thorough),
    ],
)
def test_the_partition_is_that_of_verified_basins(build: Any, window: CellGrid, transient: int, periods: int) -> None:
    """Fixed points of both wells; the hanging and the inverted pendulum; period 6 beside chaos and divergence."""
    point_map = build()
    verified = find_basins(point_map, window)
    found = classify_by_features(point_map, window, transient=transient, periods=periods)
    assert len(found.representatives) == len(verified.attractors) == 2 and not found.doubts
    pairs = set(zip(verified.labels.ravel().tolist(), found.labels.ravel().tolist(), strict=True))
    assert len(pairs) == len(found.fractions) == len(verified.fractions)  # no initial condition differs
    assert all(a == b for a, b in pairs if a < 0 or b < 0)
    assert sorted(f.count for f in found.fractions.values()) == sorted(f.count for f in verified.fractions.values())
    largest = found.fractions[0]
    assert largest.standard_error == pytest.approx(
        (largest.fraction * (1.0 - largest.fraction) / found.labels.size) ** 0.5
    )


def mean(orbit: Iterate) -> NDArray[np.float64]:
    return orbit.points.mean(axis=0)


def test_orbits_that_have_not_settled_are_doubtful() -> None:
    """x' = 1.01 x - 0.01 x^3 stays near 0 for long, and halves of an orbit that leaves it speak differently."""
    slow = discrete_map(lambda x, p: (1.01 * x[0] - 0.01 * x[0] ** 3,), {}, ("x",))
    logarithms = np.repeat([-12.0, -4.0, 0.0], (30, 4, 30))
    found = classify_by_features(slow, np.exp(logarithms)[:, None], mean, transient=100, periods=1000)
    assert found.labels[:30].max() == found.labels[:30].min() >= 0
    assert found.labels[34:].max() == found.labels[34:].min() >= 0
    assert found.labels[0] != found.labels[-1] and (found.labels[30:34] == Label.DOUBTFUL).all()
    assert sum(found.doubts.values()) == 4 and found.inaccurate == 0


def cubic() -> PointMap:
    return discrete_map(lambda x, p: (1.5 * x[0] - 0.5 * x[0] ** 3,), {}, ("x",))


def test_terminated_orbits_keep_their_labels_and_estimators_are_ones_own() -> None:
    from sklearn.cluster import DBSCAN, KMeans

    grid = CellGrid((-3,), (3,), (60,))
    # From within (-sqrt 3, sqrt 3) orbits come to -1 or 1; from beyond sqrt 5 they diverge.
    for clusterer in (None, DBSCAN(eps=0.5), KMeans(2, random_state=0)):
        found = classify_by_features(cubic(), grid, mean, clusterer)
        x = grid.axis(0)
        assert (found.labels[np.abs(x) > 5**0.5] == Label.DIVERGED).all()
        assert np.array_equal(found.labels < 0, np.abs(x) > 5**0.5)
        inner = np.abs(x) < 3**0.5
        assert len(set(found.labels[inner & (x > 0)])) == len(set(found.labels[inner & (x < 0)])) == 1
        assert sorted(points[-1, 0] for points in found.representatives) == pytest.approx([-1.0, 1.0])
        assert np.isnan(found.features[0]).all() and found.features.shape == (60, 1)
    with pytest.raises(ValueError, match="give it a seed, random_state=0"):
        classify_by_features(cubic(), grid, mean, KMeans(2))
    nothing = classify_by_features(cubic(), [[5.0], [9.0]], mean, min_size=2)
    assert nothing.labels.tolist() == [Label.DIVERGED] * 2 and not nothing.representatives


def test_results_do_not_depend_on_threads_and_can_be_drawn() -> None:
    window = CellGrid((-2, -2), (2, 2), (160, 160))
    halves = discrete_map(lambda x, p: (x[0] - 0.1 * x[0] ** 3 + 0.1 * x[0], 0.5 * x[1]), {}, ("x", "y"))
    runs = []
    for count in (1, 2):
        set_threads(count)
        runs.append(classify_by_features(halves, window, mean, transient=200, periods=10))
    set_threads(None)
    assert runs[0].labels.tobytes() == runs[1].labels.tobytes()
    assert runs[0].features.tobytes() == runs[1].features.tobytes()
    axes = plot.draw(runs[0])
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["group 0: 50.00 %", "group 1: 50.00 %"]
    assert repr(runs[0]) == "FeatureBasins(<lambda>, 25,600 initial conditions: group 0 50 %; group 1 50 %)"


def test_more_features_than_an_estimator_sees() -> None:
    """Two normal distributions at a distance of 12 standard deviations, and one vector far from both."""
    rng = np.random.default_rng(0)
    values = np.concatenate([rng.normal(0.0, 1.0, (4000, 2)), rng.normal(12.0, 1.0, (2000, 2)), [[40.0, 0.0]]])
    groups = grouped(values, None, 0.05, 10)
    assert groups.count == 2 and groups.labels[-1] == -1
    assert np.isin(groups.labels[:4000], (0, -1)).all() and np.isin(groups.labels[4000:], (1, -1)).all()
    assert np.count_nonzero(groups.labels == -1) < 60  # 1 %, in the outskirts; HDBSCAN of all vectors leaves 1 out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"features": lambda orbit: orbit.points[-1][:, 0]}, r"features returned the shape \(20,\): return one of"),
        ({"features": lambda orbit: orbit.points[-1] - orbit.points[-1].mean()}, "depend on its own points only"),
        ({"features": lambda orbit: 1 / 0}, "features=.* fails, ZeroDivisionError"),
    ],
)
def test_contracts_are_checked(arguments: Any, message: str) -> None:
    with pytest.raises((TypeError, ValueError), match=message):
        classify_by_features(cubic(), CellGrid((-2,), (2,), (20,)), **arguments)
