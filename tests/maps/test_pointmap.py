"""What all point maps share: images, orbits, status."""

import time
from collections.abc import Callable, Mapping
from math import nan
from threading import get_ident
from typing import Any

import numpy as np
import pytest

import cellmap._lib.checks
from cellmap import ForcedSystem, PointMap, Status, angle, discrete_map, set_threads, stroboscopic_map
from cellmap.maps import jacobian
from cellmap.maps.orbit_batch import Orbits
from cellmap.maps.side_by_side import advance_on_threads, parts_of


def of_henon(x: Any, p: Any) -> tuple[float, float]:
    return 1.0 - p.a * x[0] ** 2 + x[1], p.b * x[0]


@pytest.fixture(scope="module")
def henon() -> PointMap:
    return discrete_map(of_henon, {"a": 1.4, "b": 0.3}, ("x", "y"), name="Henon")


@pytest.fixture(scope="module")
def rotation() -> PointMap:

    return discrete_map(lambda x, p: (x[0] + x[1], x[1]), {}, (angle("phase", "turns", period=1.0, lower=0.0), "rate"))


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


def test_memory_is_refused_before_it_is_taken(henon: PointMap, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cellmap._lib.checks, "memory_available", lambda: 10**6)
    monkeypatch.setattr(cellmap._lib.checks, "_ALWAYS_FREE", 0)
    with pytest.raises(MemoryError, match=r"iterating 200,000 numbers needs 4.8 MB and 1 MB are free"):
        henon(np.zeros((100_000, 2)))
    with pytest.raises(MemoryError, match="orbits of 10 points over 100,000 periods needs"):
        henon.orbit(np.zeros((10, 2)), 100_000)


POINTS = np.random.default_rng(0).uniform(-0.5, 0.5, (203, 2))


def test_parts_have_the_bits_of_the_whole(henon: PointMap) -> None:
    """A map that takes long is applied by both threads, one that takes no time by one; the work is counted once."""
    whole = Orbits.starting(POINTS.copy())
    henon.advance(whole, 5)
    for seconds, workers in ((0.0, 1), (1e-3, 2)):
        seen = set()

        def slowly(orbits: Orbits, periods: int, seconds: float = seconds, seen: set[int] = seen) -> None:
            seen.add(get_ident())
            time.sleep(seconds)
            henon.advance(orbits, periods)

        set_threads(2)
        orbits = Orbits.starting(POINTS.copy())
        advance_on_threads(slowly, orbits, 5)
        set_threads(None)
        assert np.array_equal(orbits.points, whole.points, equal_nan=True)
        assert np.array_equal(orbits.status, whole.status)
        assert orbits.work.evaluations == whole.work.evaluations == 5 * len(POINTS)
        assert len(seen) >= workers


def test_a_single_batch_of_many_periods_is_iterated_by_all_threads(henon: PointMap) -> None:
    states = np.random.default_rng(1).uniform(-0.5, 0.5, (1000, 2))
    found = []
    for threads in (1, 3):
        set_threads(threads)
        assert len(parts_of(states.shape, 1)) == 1
        assert len(parts_of(states.shape, 100)) == (1 if threads == 1 else 4)
        found.append([henon.iterate(states, 100), henon.orbit(states, 100)])
    set_threads(None)
    for one, other in zip(*found, strict=True):
        assert one.points.tobytes() == other.points.tobytes()
        assert np.array_equal(one.status, other.status)


def test_the_derivative_is_exact(henon: PointMap) -> None:
    initial_conditions = np.random.default_rng(1).uniform(-2.0, 2.0, (100, 2))
    matrices = jacobian(henon, initial_conditions)
    assert np.array_equal(matrices[:, 0, 0], -2.8 * initial_conditions[:, 0])
    assert (matrices[:, 0, 1] == 1.0).all() and (matrices[:, 1, 0] == 0.3).all() and (matrices[:, 1, 1] == 0.0).all()
    assert np.linalg.det(jacobian(henon, initial_conditions[:5] * 0.1, 3)) == pytest.approx((-0.3) ** 3, rel=1e-13)


@pytest.mark.parametrize(
    ("function", "message"),
    [(lambda x, p: (x[0] + 1.0, nan * x[1]), "not a number"), (lambda x, p: (x[0], x[1] ** 3), "beyond 1e100")],
)
def test_orbits_without_an_image_have_diverged(function: Callable[..., Any], message: str) -> None:
    images = discrete_map(function, {}, ("x", "y")).iterate([[1.0, 100.0], [1.0, 50.0]], 5)
    assert (images.status == Status.DIVERGED).all(), message
    assert np.isnan(images.points).all()
