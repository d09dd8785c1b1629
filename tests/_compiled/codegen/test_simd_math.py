"""Elementary functions of the lanes, against mpmath."""

import math
from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np
import pytest

from cellmap import discrete_map
from cellmap._compiled.codegen.kernel import discrete_kernel
from cellmap._compiled.kernels.blocks import LANES


def over_array(name: str) -> Callable[[Any], Any]:
    """Return a function of :mod:`math` as lanes compute it, over arrays."""
    kernel = discrete_kernel(lambda t, x, p: (getattr(math, name)(x[0]),), 1, (), 0)

    def call(values: Any) -> Any:
        values = np.array(values, dtype=float)
        blocks = np.zeros((-(-len(values) // LANES), 1, LANES))
        blocks.ravel()[: len(values)] = values
        kernel(blocks, np.ones(len(blocks), np.int64), 0.0, 1.0, np.zeros(1), np.empty_like(blocks))
        return blocks.ravel()[: len(values)]

    return call


def largest_error(name: str, values: Any, results: Any, floor: float = 0.0) -> float:
    """Largest error in units of the last place of the exact value, or of `floor` where that is larger."""
    worst = 0.0
    with mpmath.workdps(40):
        for x, y in zip(values, results, strict=True):
            exact = getattr(mpmath, name)(mpmath.mpf(float(x)))
            unit = math.ulp(max(abs(float(exact)), floor))
            worst = max(worst, float(abs(mpmath.mpf(float(y)) - exact) / unit))
    return worst


RANGES = """sin -10 10 2.5|cos -10 10 2.5|tan -10 10 4|sin -3e6 3e6 2.5|cos -3e6 3e6 2.5|exp -708 709 2|exp -1 1 2
sinh -20 20 2|sinh -1 1 4|cosh -20 20 2|tanh -2 2 4|tanh -30 30 4|atan -3 3 3|atan -1e6 1e6 3|sqrt 0 1e6 0.5"""


@pytest.mark.parametrize("case", RANGES.replace("\n", "|").split("|"))
def test_values_are_right_to_the_last_places(case: str) -> None:
    name, (low, high, units) = case.split()[0], map(float, case.split()[1:])
    values = np.random.default_rng(0).uniform(low, high, 1500)
    assert largest_error(name, values, over_array(name)(values)) <= units


@pytest.mark.parametrize("name", ["sin", "cos", "tan", "sinh", "tanh", "exp", "atan"])
def test_small_arguments(name: str) -> None:
    values = np.concatenate([10.0 ** np.arange(-300, 0, 7.0), -(10.0 ** np.arange(-300, 0, 7.0))])
    assert largest_error(name, values, over_array(name)(values)) <= 4.0


@pytest.mark.parametrize("name", ["sin", "cos"])
def test_near_their_zeros_hardly_a_digit_is_lost(name: str) -> None:
    rotations = np.random.default_rng(1).integers(-900_000, 900_000, 2000)
    values = np.concatenate([rotations * math.pi, (rotations + 0.5) * math.pi, np.arange(-8, 9) * 0.5 * math.pi])
    assert largest_error(name, values, over_array(name)(values), floor=1e-9) <= 2.5


def test_sine_is_odd_and_cosine_even_to_the_bit() -> None:
    values = np.random.default_rng(2).uniform(-1000.0, 1000.0, 10_000)
    sine, cosine = over_array("sin"), over_array("cos")
    assert np.array_equal(sine(values), -sine(-values))
    assert np.array_equal(cosine(values), cosine(-values))


@pytest.mark.parametrize("name", ["sin", "cos", "tan"])
def test_large_angles(name: str) -> None:
    values = np.concatenate([10.0 ** np.random.default_rng(3).uniform(6.0, 300.0, 1000), [2.9999e6, 3e6, 1e22]])
    values = np.concatenate([values, -values])
    assert largest_error(name, values, over_array(name)(values)) <= 4.0
    assert np.isnan(over_array(name)([math.nan])).all()
    images = discrete_map(lambda x, p: (getattr(math, name)(x[0]),), {}, ("q",))
    inside = np.abs(values) < 1e100
    found = images(values[inside, np.newaxis])[:, 0]  # large ones and usual ones beside one another in vectors
    assert largest_error(name, values[inside], found) <= 4.0


@pytest.mark.parametrize("name", ["exp", "sinh", "cosh", "tanh"])
def test_exponentials_up_to_the_ends_of_the_range_of_numbers(name: str) -> None:
    last = 709.7827 if name == "exp" else 710.4758
    values = np.concatenate([np.linspace(-last, last, 999), [-708.4, -720.0, -745.1, last]])
    values = values[values > -745.2] if name == "exp" else values[np.abs(values) <= last]
    assert largest_error(name, values, over_array(name)(values)) <= 4.0


def test_limits_of_exponentials_and_square_roots() -> None:
    values = [0.0, -0.0, 709.0, 709.8, 1e300, math.inf, -708.4, -745.13, -745.2, -1e300, -math.inf, math.nan]
    expected = [1.0, 1.0, math.exp(709.0), math.inf, math.inf, math.inf, 2.2e-308, 5e-324, 0.0, 0.0, 0.0, math.nan]
    assert over_array("exp")(values) == pytest.approx(expected, rel=0.02, abs=0.0, nan_ok=True)
    assert over_array("exp")([-708.4]) == pytest.approx(math.exp(-708.4), rel=2e-16, abs=0.0)
    assert np.array_equal(over_array("tanh")([math.inf, -math.inf, 0.0]), [1.0, -1.0, 0.0])
    assert np.array_equal(over_array("cosh")([math.inf, -math.inf, 0.0]), [math.inf, math.inf, 1.0])
    assert np.array_equal(over_array("sinh")([math.inf, -math.inf, 0.0]), [math.inf, -math.inf, 0.0])
    assert np.isnan(over_array("tanh")([math.nan])).all()
    assert np.isnan(over_array("sqrt")([-1.0, math.nan])).all()
    assert np.array_equal(over_array("sqrt")([0.0, 4.0, math.inf]), [0.0, 2.0, math.inf])


def test_functions_that_keep_their_exact_meaning() -> None:
    values = [-2.5, -0.5, 0.0, 0.5, 3.0]
    assert np.array_equal(over_array("fabs")(values), np.abs(values))
    assert np.array_equal(over_array("floor")(values), np.floor(values))
    two = discrete_map(lambda x, p: (math.copysign(x[0], x[1]), min(x), max(x)), {}, ("a", "b", "c"))
    assert two([2.0, -1.0, 0.0]).tolist() == [-2.0, -1.0, 2.0]
