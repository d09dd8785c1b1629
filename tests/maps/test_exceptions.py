"""Where a function raises an exception the orbit ends there, and its neighbours are those that it has alone."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from cellmap import ForcedSystem, PointMap, discrete_map, stroboscopic_map
from cellmap.maps import Impact, Status, jacobian

TABLE, ARRAY = (1.0, 2.0, 3.0), np.array([1.0, 2.0, 3.0])


def raises(x: Any, p: Any) -> Any:
    if x[0] > 0.5:
        raise ValueError("too big")
    return x[1], -x[0] - x[1]


def asserts(x: Any, p: Any) -> Any:
    if not x[0] <= 0.5:  # what an assertion is, but for pytest, which writes assertions in its own way
        raise AssertionError("too big")
    return x[1], -x[0] - x[1]


def divides(x: Any, p: Any) -> Any:
    return (x[1] if x[0] <= 0.5 else 1 / 0), -x[0] - x[1]


def leaves_a_domain(x: Any, p: Any) -> Any:
    return x[1], -x[0] - x[1] + 0.0 * math.log(1.0 if x[0] <= 0.5 else -1.0)


def asks(x: Any) -> Any:
    if x > 0.5:
        raise LookupError(f"{x} is not there")
    return x


def asks_another(x: Any, p: Any) -> Any:
    return x[1], -asks(x[0]) - x[1]


def loops(x: Any, p: Any) -> Any:
    value, count = x[0], 0
    while value > 1e-3:
        value, count = 0.5 * value, count + 1
        if count > 9:
            raise RuntimeError(f"after {count}")
    return x[1], -x[0] - x[1] + 0.0 * count


def indexes(x: Any, p: Any) -> Any:
    return x[1], -x[0] - x[1] + 0.0 * TABLE[int(5.9 * x[0])]


def indexes_an_array(x: Any, p: Any) -> Any:
    return x[1], -x[0] - x[1] + 0.0 * ARRAY[int(5.9 * x[0])]


def divides_whole_numbers(x: Any, p: Any) -> Any:
    return x[1], -x[0] - x[1] + 0.0 * (6 // (1 - int(x[0] > 0.5)))


def rounds_huge_numbers(x: Any, p: Any) -> Any:
    return x[1], -x[0] - x[1] + 0.0 * TABLE[int(x[0] * (1e300 if x[0] > 0.5 else 1.0)) % 2]


FUNCTIONS = [
    raises,
    asserts,
    divides,
    leaves_a_domain,
    asks_another,
    loops,
    indexes,
    indexes_an_array,
    divides_whole_numbers,
]


def points() -> NDArray[np.float64]:
    rng = np.random.default_rng(0)
    return np.concatenate([[[0.9, 0.3], [0.3, 0.0], [0.5, 0.1]], rng.uniform(-0.1, 1.2, (37, 2))])


def by_python(function: Callable[..., Any], x: Any) -> Any:
    try:
        return function(tuple(x.tolist()), None)
    except (ArithmeticError, AssertionError, LookupError, RuntimeError, ValueError):
        return math.nan, math.nan


@pytest.mark.parametrize("function", [*FUNCTIONS, rounds_huge_numbers])
def test_images_of_a_map_are_those_of_python(function: Callable[..., Any]) -> None:
    images = discrete_map(function, {}, ("q", "v")).iterate(points(), 1)
    expected = np.array([by_python(function, x) for x in points()])
    if function is rounds_huge_numbers:  # Python's whole numbers have no end, compiled ones have
        expected[points()[:, 0] > 0.5] = np.nan
    assert np.array_equal(images.points, expected, equal_nan=True)
    assert np.array_equal(images.status == Status.DIVERGED, np.isnan(expected[:, 0]))
    assert 3 < np.count_nonzero(images.status) < 37


def in_a_flow(t: float, x: Any, p: Any) -> Any:
    return raises(x, p)


def in_nested_branches(t: float, x: Any, p: Any) -> Any:
    if x[0] > 0.5 and x[1] > 0.0:
        raise ValueError("too fast")
    return x[1], -x[0] + 0.1 * abs(x[1])


def in_a_list(t: float, x: Any, p: Any) -> Any:
    return x[1], -x[0] - x[1] + 0.0 * TABLE[int(4.0 * abs(x[0]))]


@pytest.mark.parametrize("rhs", [in_a_flow, in_nested_branches, in_a_list])
def test_images_of_a_flow_are_those_of_scipy(rhs: Callable[..., Any]) -> None:
    images = stroboscopic_map(ForcedSystem(rhs, {}, 1.0, ("q", "v"))).iterate(points(), 1)
    for x, image, status in zip(points(), images.points, images.status, strict=True):
        try:
            exact = solve_ivp(lambda t, x: rhs(t, x, None), (0.0, 1.0), x, rtol=1e-10, atol=1e-10, max_step=0.01).y
        except (LookupError, ValueError):
            assert status == Status.DIVERGED
        else:
            assert status == Status.OK
            assert image == pytest.approx(exact[:, -1], abs=1e-7)
    assert 3 < np.count_nonzero(images.status) < 37


def test_events_of_a_function_that_raises_are_refused_with_its_message() -> None:
    def rhs(t: float, x: Any, p: Any, s: Any) -> Any:
        return in_a_flow(t, x, p)

    with pytest.raises(TypeError, match="too big"):
        stroboscopic_map(ForcedSystem(rhs, {}, 1.0, ("q", "v"), switches=lambda t, x, p: (x[1],)))
    wall = Impact(lambda t, x, p: asks(x[0]) + 1.0, lambda t, x, p: (x[0], -x[1]))
    with pytest.raises(TypeError, match="is not there"):
        stroboscopic_map(ForcedSystem(lambda t, x, p: (x[1], -x[0]), {}, 1.0, ("q", "v"), impacts=[wall]))


def test_where_there_is_no_image_there_is_no_derivative() -> None:
    found = jacobian(discrete_map(raises, {}, ("q", "v")), [[0.3, 0.0], [0.9, 0.3]])
    assert found[0].tolist() == [[0.0, 1.0], [-1.0, -1.0]]
    assert np.isnan(found[1]).all()


def test_whole_numbers_that_are_larger_once_compiled_are_refused() -> None:
    def factorial(x: Any, p: Any) -> Any:
        product = 1
        for k in range(1, 25):
            product *= k
        return (1e-25 * product * x[0] + TABLE[int(abs(x[0])) % 3],)

    with pytest.raises(TypeError, match="compute with floats"):
        discrete_map(factorial, {}, ("q",))
    with pytest.raises(TypeError, match="compute with floats"):
        stroboscopic_map(ForcedSystem(lambda t, x, p: factorial(x, p), {}, 1.0, ("q",)))


def image_of_one(point_map: PointMap) -> Any:
    return point_map([1.0])


def test_a_function_that_always_raises_says_so() -> None:
    def fails(x: Any, p: Any) -> Any:
        raise ValueError("too big")

    with pytest.raises((TypeError, ValueError), match=r"too big|cannot be compiled"):
        image_of_one(discrete_map(fails, {}, ("q",)))
