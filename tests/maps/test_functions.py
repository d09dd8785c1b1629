"""Functions of users that raise exceptions, have a memory, or take longer the larger the state is."""

import itertools
import math
import random
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from two_tiers import at_once

from cellmap import ForcedSystem, discrete_map, stroboscopic_map
from cellmap.maps import Impact, Status, jacobian

TABLE, ARRAY = (1.0, 2.0, 3.0), np.array([1.0, 2.0, 3.0])


def raises(x: Any, p: Any) -> Any:
    if x[0] > 0.5:
        raise ValueError("too big")
    return x[1], -x[0] - x[1]


def asks(x: Any) -> Any:
    if x > 0.5:
        raise LookupError(f"{x} is not there")
    return x


def of(part: Callable[[Any], Any]) -> Callable[[Any, Any], Any]:
    return lambda x, p: (x[1], -x[0] - x[1] + 0.0 * part(x[0]))


FUNCTIONS = {
    "raises": raises,
    "divides": lambda x, p: ((x[1] if x[0] <= 0.5 else 1 / 0), -x[0] - x[1]),
    "leaves a domain": of(lambda x: math.log(1.0 if x <= 0.5 else -1.0)),
    "asks another": of(asks),
    "indexes": of(lambda x: TABLE[int(5.9 * x)]),
    "indexes an array": of(lambda x: ARRAY[int(5.9 * x)]),
    "divides whole numbers": of(lambda x: 6 // (1 - int(x > 0.5))),
    # Python's whole numbers have no end, compiled ones have.
    "rounds huge numbers": of(lambda x: TABLE[int(x * (1e300 if x > 0.5 else 1.0)) % 2]),
}


def points() -> NDArray[np.float64]:
    rng = np.random.default_rng(0)
    return np.concatenate([[[0.9, 0.3], [0.3, 0.0], [0.5, 0.1]], rng.uniform(-0.1, 1.2, (37, 2))])


def by_python(function: Callable[..., Any], x: Any) -> Any:
    try:
        return function(tuple(x.tolist()), None)
    except (ArithmeticError, AssertionError, LookupError, RuntimeError, ValueError):
        return math.nan, math.nan


@pytest.mark.parametrize("name", at_once(["raises", "divides", "leaves a domain", "asks another"], later=FUNCTIONS))
def test_images_of_a_map_are_those_of_python(name: str) -> None:
    images = discrete_map(FUNCTIONS[name], {}, ("q", "v")).iterate(points(), 1)
    expected = np.array([by_python(FUNCTIONS[name], x) for x in points()])
    if name == "rounds huge numbers":
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


@pytest.mark.parametrize("rhs", at_once([in_nested_branches], later=[in_a_flow, in_a_list]))
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


@pytest.mark.thorough
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


def test_a_function_that_always_raises_says_so() -> None:
    def fails(x: Any, p: Any) -> Any:
        raise ValueError("too big")

    with pytest.raises((TypeError, ValueError), match=r"too big|cannot be compiled"):
        discrete_map(fails, {}, ("q",))([1.0])


GENERATOR, CALLS = np.random.default_rng(0), list[int]()
COUNT = itertools.count()


class Counter:
    """A function with a memory."""

    calls = 0

    def __call__(self) -> float:
        self.calls += 1
        return float(self.calls)


def growing() -> float:
    CALLS.append(1)
    return float(len(CALLS))


SOURCES = [random.random, GENERATOR.normal, time.perf_counter, Counter(), growing, lambda: next(COUNT)]


@pytest.mark.parametrize("source", SOURCES)
def test_values_from_elsewhere(source: Callable[[], float]) -> None:
    with pytest.raises(ValueError, match="not a pure function of its arguments"):
        discrete_map(lambda x, p: (0.5 * x[0] + source(),), {}, ("q",))
    with pytest.raises(ValueError, match="not a pure function of its arguments"):
        ForcedSystem(lambda t, x, p: (math.cos(t) - x[0] + source(),), {}, 2 * math.pi, ("q",))
    wall = Impact(lambda t, x, p: x[0] + source(), lambda t, x, p: (x[0], -x[1]))
    with pytest.raises(ValueError, match=r"impacts\[0\]\.guard .* not a pure function"):
        ForcedSystem(lambda t, x, p: (x[1], -x[0]), {}, 1.0, ("q", "v"), impacts=[wall])


def test_random_numbers_in_a_branch_that_no_trial_visits() -> None:
    def kicked(x: Any, p: Any) -> Any:
        return (x[0] + random.random() if x[0] > 3.0 else 0.5 * x[0],)

    with pytest.raises(ValueError, match="not a pure function of its arguments"):
        discrete_map(kicked, {}, ("q",))
    with pytest.raises(ValueError, match="not a pure function of its arguments"):
        stroboscopic_map(ForcedSystem(lambda t, x, p: kicked(x, p), {}, 1.0, ("q",)))


def test_what_happens_once_is_no_period() -> None:
    with pytest.raises(ValueError, match="at one time only"):
        ForcedSystem(lambda t, x, p: ((1.0 if t < 1 else 0.0) - x[0],), {}, 2 * math.pi, ("q",))


def test_not_a_number_is_the_same_when_it_is_computed_again() -> None:
    assert discrete_map(lambda x, p: (0.5 * x[0], 0.0 * math.inf), {}, ("q", "v")).name == "<lambda>"


def ranges(x: float) -> float:
    total = 0.0
    for k in range(int(abs(x) * 3)):
        total += k
    return total


def waits(x: float) -> float:
    total = 0.0
    while total < x:
        total += 0.25
    return total


def recurs(x: float) -> float:
    return 0.0 if abs(x) < 1.0 else 1.0 + recurs(abs(x) - 1.0)


def lists(x: float) -> float:
    return sum([0.5] * int(abs(x)))


@pytest.mark.parametrize("growing", [ranges, waits, recurs, lists, lambda x: float(np.zeros(int(abs(x))).sum())])
def test_what_grows_with_the_state_is_refused_at_once(growing: Callable[[float], float]) -> None:
    began = time.process_time()
    with pytest.raises(TypeError, match=r"longer the larger the state is .*fixed length"):
        stroboscopic_map(ForcedSystem(lambda t, x, p: (growing(x[0]), x[1]), {}, 1.0, ("q", "v")))
    with pytest.raises(TypeError, match=r"longer the larger the state is .*fixed length"):
        discrete_map(lambda x, p: (growing(x[0]), x[1]), {}, ("q", "v"))
    assert time.process_time() - began < 2.0


def test_loops_as_long_as_a_parameter_says_are_kept() -> None:
    """The sum of 0, 1, ..., 14 is 105."""
    image = discrete_map(lambda x, p: (ranges(p.n) + 0.0 * x[0],), {"n": 5.0}, ("x",))
    assert image([0.5])[0] == 105.0
