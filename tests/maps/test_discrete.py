"""Discrete maps."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, erf, nan, pi, sin, sqrt
from typing import Any

import numpy as np
import pytest

from cellmap import PointMap, Status, angle, discrete_map, set_threads
from cellmap._compiled.machine_code import machine_code
from cellmap.maps import jacobian


def henon(x: Any, p: Any) -> tuple[float, float]:
    return 1.0 - p.a * x[0] ** 2 + x[1], p.b * x[0]


def tent(x: Any, p: Any) -> tuple[float]:
    return (p.slope * x[0],) if x[0] < 0.5 else (p.slope * (1.0 - x[0]),)


@pytest.fixture(scope="module")
def henon_map() -> PointMap:
    return discrete_map(henon, {"a": 1.4, "b": 0.3}, ("x", "y"))


def test_the_map_is_the_function(henon_map: PointMap) -> None:
    initial_conditions = np.random.default_rng(0).uniform(-2.0, 2.0, (1000, 2))
    x, y = initial_conditions.T
    assert henon_map(initial_conditions) == pytest.approx(
        np.column_stack([1.0 - 1.4 * x * x + y, 0.3 * x]), rel=1e-15, abs=1e-15
    )
    assert henon_map.name == "henon"


def test_the_fixed_point_stays(henon_map: PointMap) -> None:
    x = (-0.7 + sqrt(0.49 + 5.6)) / 2.8
    assert henon_map([x, 0.3 * x]) == pytest.approx([x, 0.3 * x], abs=1e-15)


def test_the_derivative_is_exact(henon_map: PointMap) -> None:
    initial_conditions = np.random.default_rng(1).uniform(-2.0, 2.0, (100, 2))
    matrices = jacobian(henon_map, initial_conditions)
    assert np.array_equal(matrices[:, 0, 0], -2.8 * initial_conditions[:, 0])
    assert (matrices[:, 0, 1] == 1.0).all() and (matrices[:, 1, 0] == 0.3).all() and (matrices[:, 1, 1] == 0.0).all()
    assert np.linalg.det(jacobian(henon_map, initial_conditions[:5] * 0.1, 3)) == pytest.approx((-0.3) ** 3, rel=1e-13)


@pytest.mark.parametrize(
    ("function", "message"),
    [(lambda x, p: (x[0] + 1.0, nan * x[1]), "not a number"), (lambda x, p: (x[0], x[1] ** 3), "beyond 1e100")],
)
def test_orbits_without_an_image_have_diverged(function: Callable[..., Any], message: str) -> None:
    images = discrete_map(function, {}, ("x", "y")).iterate([[1.0, 100.0], [1.0, 50.0]], 5)
    assert (images.status == Status.DIVERGED).all(), message
    assert np.isnan(images.points).all()


def test_values_that_are_not_finite_spoil_no_neighbour() -> None:
    def function(x: Any, p: Any) -> tuple[float, float]:
        return sqrt(1.0 - x[0] ** 2), 0.5 * x[1]

    some = discrete_map(function, {}, ("x", "y"))
    initial_conditions = np.random.default_rng(2).uniform(-1.1, 1.1, (500, 2))
    images = some.iterate(initial_conditions, 1)
    bad = np.abs(initial_conditions[:, 0]) > 1.0
    assert 20 < bad.sum() < 100
    assert np.array_equal(images.status == Status.DIVERGED, bad)
    assert np.array_equal(images.points[~bad], some(initial_conditions[~bad]))


def test_a_map_that_branches() -> None:
    some = discrete_map(tent, {"slope": 2.0}, ("x",))
    initial_conditions = np.array([[0.0], [0.25], [0.375], [0.5], [0.75], [1.0]])
    assert some(initial_conditions)[:, 0].tolist() == [0.0, 0.5, 0.75, 1.0, 0.5, 0.0]
    # Its derivatives come from differences, of a function that is linear where they are taken.
    assert jacobian(some, [[0.25], [0.75]])[:, 0, 0] == pytest.approx([2.0, -2.0], rel=1e-10)


def test_functions_without_vector_form() -> None:
    from math import atan2

    some = discrete_map(lambda x, p: (erf(x[0]), atan2(x[0], x[1])), {}, ("x", "y"))
    assert some([0.5, 2.0]).tolist() == [erf(0.5), atan2(0.5, 2.0)]


def test_angles_are_wrapped_and_rotations_counted() -> None:
    def standard(x: Any, p: Any) -> tuple[float, float]:
        momentum = x[1] + p.k * sin(x[0])
        return x[0] + momentum, momentum

    some = discrete_map(standard, {"k": 0.5}, (angle("theta"), "p"))
    theta, momentum = 1.0, 6.0
    for _ in range(20):
        momentum += 0.5 * sin(theta)
        theta += momentum
    images = some.iterate([1.0, 6.0], 20)
    assert images.unwrapped == pytest.approx([theta, momentum], rel=1e-11)
    assert -pi <= images.points[0] < pi
    assert images.rotations[1] == 0


def test_an_image_does_not_depend_on_its_neighbours(henon_map: PointMap) -> None:
    rng = np.random.default_rng(3)
    initial_conditions = rng.uniform(-1.0, 1.0, (10_000, 2))
    images = henon_map.iterate(initial_conditions, 20).points
    order = rng.permutation(len(initial_conditions))
    assert np.array_equal(henon_map.iterate(initial_conditions[order], 20).points, images[order], equal_nan=True)
    for threads in (1, 2, 3):
        set_threads(threads)
        assert np.array_equal(henon_map.iterate(initial_conditions, 20).points, images, equal_nan=True)
    assert np.array_equal(henon_map.iterate(initial_conditions[4321], 20).points, images[4321], equal_nan=True)


def test_other_parameters_compile_nothing(henon_map: PointMap) -> None:
    henon_map([0.0, 0.0])
    compiled = machine_code.cache_info().misses
    for a in (0.9, 1.0, 1.1):
        assert discrete_map(henon, {"a": a, "b": 0.2}, ("x", "y"))([2.0, 0.0])[0] == pytest.approx(1.0 - 4.0 * a)
    assert machine_code.cache_info().misses == compiled


def test_the_bounded_fraction_of_henons_map(henon_map: PointMap) -> None:
    """Fraction of 1000^2 orbits from edge to edge of [-2, 2]^2 that stay: 0.4319 (REFERENCES.md)."""
    axis = np.linspace(-2.0, 2.0, 1000)
    initial_conditions = np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1)
    bounded = henon_map.iterate(initial_conditions, 50).status == Status.OK
    assert bounded.mean() == pytest.approx(0.4319, abs=5e-5)


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"function": 3}, TypeError, r"function=3: give a function of \(x, p\)"),
        ({"function": lambda x: x}, TypeError, r"function must be callable as function\(x, p\)"),
        ({"function": lambda x, p: p.a * x}, TypeError, r"x and p are tuples: write x\[0\]"),
        ({"function": lambda x, p: None}, TypeError, "function returns None: return a tuple"),
        ({"function": lambda x, p: 1.0}, TypeError, "function returns 1.0: return a tuple"),
        ({"function": lambda x, p: (x[0],)}, ValueError, "function returns 1 components for 2 coordinates"),
        ({"function": lambda x, p: (x[0], p.c)}, ValueError, "function asks for a parameter that params lacks"),
        (
            {"function": lambda p, x: (p.a, x[0])},
            ValueError,
            "reads a parameter a of the state, .* before the parameters",
        ),
        ({"params": {"a": nan, "b": 0.3}}, ValueError, r"params\['a'\]=nan: give a finite number"),
        ({"params": (1.4, 0.3)}, TypeError, "params=.*: give a mapping"),
        ({"coordinates": ()}, ValueError, "one different name for each state variable"),
    ],
)
def test_bad_maps_are_refused(changes: dict[str, Any], error: type[Exception], message: str) -> None:
    arguments: dict[str, Any] = {"function": henon, "params": {"a": 1.4, "b": 0.3}, "coordinates": ("x", "y")}
    with pytest.raises(error, match=message):
        discrete_map(**{**arguments, **changes})


def test_a_forced_map_of_the_literature() -> None:
    """Grebogi, Ott, Yorke (1983): fixed points (0, -0.3) and (pi, 0.3)."""

    def function(x: Any, p: Any) -> tuple[float, float]:
        theta, r = x
        return theta + 1.32 * sin(2.0 * theta) - 0.9 * sin(4.0 * theta) - r * sin(theta), -0.3 * cos(theta)

    some = discrete_map(function, {}, (angle("theta", lower=0.0), "x"))
    points = np.array([[0.0, -0.3], [pi, 0.3]])
    assert some(points) == pytest.approx(points, abs=1e-14)
    assert np.abs(np.linalg.eigvals(jacobian(some, points))).max() < 1.0
