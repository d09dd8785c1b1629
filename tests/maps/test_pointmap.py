"""What all point maps share: images, orbits, status."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf, nan
from typing import Any

import numpy as np
import pytest

import cellmap._lib.checks
from cellmap import ForcedSystem, PointMap, Status, angle, discrete_map, stroboscopic_map


@pytest.fixture(scope="module")
def henon() -> PointMap:
    def function(x: Any, p: Any) -> tuple[float, float]:
        return 1.0 - p.a * x[0] ** 2 + x[1], p.b * x[0]

    return discrete_map(function, {"a": 1.4, "b": 0.3}, ("x", "y"), name="Henon")


@pytest.fixture(scope="module")
def rotation() -> PointMap:
    def function(x: Any, p: Any) -> tuple[float, float]:
        return x[0] + x[1], x[1]

    return discrete_map(function, {}, (angle("phase", "turns", period=1.0, lower=0.0), "rate"))


@pytest.fixture(scope="module")
def pendulum(problems: Mapping[str, ForcedSystem]) -> PointMap:
    return stroboscopic_map(problems["vertically driven"])


def test_images_have_the_shape_of_the_points(henon: PointMap) -> None:
    for shape in ((2,), (1, 2), (5, 2), (3, 4, 2), (0, 2), (3, 0, 2)):
        points = np.full(shape, 0.1)
        assert henon(points).shape == shape
        images = henon.iterate(points, 3)
        assert images.points.shape == images.rotations.shape == images.unwrapped.shape == shape
        assert images.status.shape == shape[:-1]
        assert henon.orbit(points, 3).points.shape == (4, *shape)


def test_points_are_not_changed(henon: PointMap) -> None:
    points = np.array([[0.1, 0.2], [0.3, 0.4]])
    before = points.copy()
    henon(points)
    henon.orbit(points, 2)
    assert np.array_equal(points, before)
    assert henon([[0, 0]]).tolist() == [[1.0, 0.0]]


@pytest.mark.parametrize("name", ["henon", "pendulum"])
def test_an_orbit_is_the_images_one_by_one(name: str, request: pytest.FixtureRequest) -> None:
    point_map: PointMap = request.getfixturevalue(name)
    initial_conditions = np.random.default_rng(0).uniform(-1.0, 1.0, (50, 2))
    orbit = point_map.orbit(initial_conditions, 5)
    for k in range(6):
        images = point_map.iterate(initial_conditions, k)
        assert np.array_equal(orbit.points[k], images.points, equal_nan=True)
        assert np.array_equal(orbit.rotations[k], images.rotations)
        assert np.array_equal(orbit.status[k], images.status)


def test_iterating_is_a_semigroup(pendulum: PointMap) -> None:
    initial_conditions = np.random.default_rng(1).uniform(-3.0, 3.0, (50, 2))
    first = pendulum.iterate(initial_conditions, 3)
    second = pendulum.iterate(first.points, 4)
    at_once = pendulum.iterate(initial_conditions, 7)
    assert np.array_equal(second.points, at_once.points)
    assert np.array_equal(first.rotations + second.rotations, at_once.rotations)


def test_no_period_wraps_and_nothing_else(rotation: PointMap) -> None:
    images = rotation.iterate([[2.25, 0.5], [-0.25, 0.5]], 0)
    assert images.points.tolist() == [[0.25, 0.5], [0.75, 0.5]]
    assert not images.rotations.any()


def test_rotations_are_counted_from_the_initial_condition(rotation: PointMap) -> None:
    # Dyadic numbers: every sum is exact.
    initial_conditions = [[0.25, 3.5], [0.25, -2.75], [7.25, 0.125], [0.0, 0.0]]
    images = rotation.iterate(initial_conditions, 10)
    assert images.unwrapped[:, 0].tolist() == [35.25, -27.25, 1.5, 0.0]
    assert images.rotations.tolist() == [[35, 0], [-28, 0], [1, 0], [0, 0]]


def test_full_rotations_of_an_initial_condition_do_not_matter(pendulum: PointMap) -> None:
    ic = np.array([1.0, 0.5])
    images = pendulum.iterate(ic + 2 * np.pi * np.array([[0, 0], [1, 0], [-3, 0]]), 3)
    assert images.points == pytest.approx(np.broadcast_to(images.points[0], (3, 2)), abs=1e-9)
    assert np.ptp(images.rotations, axis=0).tolist() == [0, 0]


def test_an_orbit_that_has_ended_stays_ended(henon: PointMap) -> None:
    orbit = henon.orbit([[100.0, 0.0], [0.1, 0.1]], 30)
    ended = orbit.status[:, 0] == Status.DIVERGED
    first = int(np.argmax(ended))
    assert 0 < first < 30 and ended[first:].all()
    assert np.isnan(orbit.points[first:, 0]).all() and np.isfinite(orbit.points[:first, 0]).all()
    assert (orbit.status[:, 1] == Status.OK).all() and np.isfinite(orbit.points[:, 1]).all()


def test_iterates_say_what_they_are(henon: PointMap) -> None:
    images = henon.iterate([[1e9, 0.0], [0.1, 0.1], [0.2, 0.1]], 50)
    assert repr(images) == "Iterate(2 ok, 1 diverged)"
    assert np.array_equal(np.asarray(images), images.points, equal_nan=True)
    assert np.asarray(images, dtype=np.float32).dtype == np.float32
    assert repr(henon) == "PointMap(discrete of Henon: a=1.4, b=0.3)"


@pytest.mark.parametrize(
    ("points", "error", "message"),
    [
        (0.5, ValueError, r"points has shape \(\): its last axis must hold the 2 state variables"),
        ([0.5], ValueError, r"points has shape \(1,\)"),
        ([[1.0, 2.0, 3.0]], ValueError, r"points has shape \(1, 3\)"),
        ([[1.0, nan]], ValueError, r"points\[0, 1\] = nan: remove points that are not finite"),
        ([[1.0, 2.0], [inf, 0.0]], ValueError, r"points\[1, 0\] = inf: remove points that are not finite"),
        ([[1.0, 2.0], [1.0]], TypeError, "points=.*: give real numbers in an array"),
        ("points", TypeError, "points=.*: give real numbers in an array"),
        ([[1j, 0.0]], TypeError, "points=.*: give real numbers in an array"),
        (None, (TypeError, ValueError), "points"),
    ],
)
def test_bad_points_are_refused(
    henon: PointMap, points: Any, error: type[Exception] | tuple[type[Exception], ...], message: str
) -> None:
    for use in (henon, lambda x: henon.iterate(x, 1), lambda x: henon.orbit(x, 1)):
        with pytest.raises(error, match=message):
            use(points)


@pytest.mark.parametrize(
    ("periods", "error"),
    [(-1, ValueError), (1.5, TypeError), (1.0, TypeError), (True, TypeError), ("3", TypeError), (None, TypeError)],
)
def test_bad_numbers_of_periods_are_refused(henon: PointMap, periods: Any, error: type[Exception]) -> None:
    for use in (henon.iterate, henon.orbit):
        with pytest.raises(error, match=r"periods=.*: give a whole number"):
            use([0.1, 0.1], periods)


def test_numpy_integers_are_numbers_of_periods(henon: PointMap) -> None:
    assert np.array_equal(henon.iterate([0.1, 0.1], np.int32(3)).points, henon.iterate([0.1, 0.1], 3).points)


def test_memory_is_refused_before_it_is_taken(henon: PointMap, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cellmap._lib.checks, "memory_available", lambda: 10**6)
    monkeypatch.setattr(cellmap._lib.checks, "_ALWAYS_FREE", 0)
    with pytest.raises(MemoryError, match=r"iterating 200,000 numbers needs 4.8 MB and 1 MB are free"):
        henon(np.zeros((100_000, 2)))
    with pytest.raises(MemoryError, match="orbits of 10 points over 100,000 periods needs"):
        henon.orbit(np.zeros((10, 2)), 100_000)


def test_an_exact_map_has_no_error_to_measure(henon: PointMap) -> None:
    with pytest.raises(ValueError, match="is exact; only an interpolated map has an error"):
        henon.error()
