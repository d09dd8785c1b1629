"""Arithmetic of comparisons: what Python makes of it, or an error that says what to write."""

from collections.abc import Callable
from math import cos, sin
from typing import Any

import numpy as np
import pytest

from cellmap import ForcedSystem, Status, discrete_map, stroboscopic_map

PLACE = (1.5, 2.0)
"""Where both comparisons hold, as at no state that is tried when a map is made."""

RIGHT: list[Callable[[Any], Any]] = [
    lambda x: (sin(x[0]) > 0.9) + (cos(x[1] - 2) > 0.9) + 0.0,
    lambda x: (sin(x[0]) > 0.9) * (x[0] > 0) + (cos(x[1] - 2) > 0.9) * (x[1] > 0) + 0.0,
    lambda x: (sin(x[0]) > 0.9) - (cos(x[1] - 2) > 0.9) + 0.5,
    lambda x: ~(sin(x[0]) > 0.9) + 0.5,
    lambda x: ((sin(x[0]) > 0.9) == (cos(x[1] - 2) > 0.9)) + 0.5,
    lambda x: ((np.sin(x[0]) > 0.9) | (np.cos(x[1] - 2) > 0.9)) + 0.0,
    lambda x: ((np.sin(x[0]) > 0.9) ^ (np.cos(x[1] - 2) > 0.9)) + 0.5,
    lambda x: sum([np.sin(x[0]) > 0.9, np.cos(x[1] - 2) > 0.9]) + 0.0,
    lambda x: float(np.sin(x[0]) > 0.9) + float(np.cos(x[1] - 2) > 0.9),
    lambda x: (np.sin(x[0]) > 0.9) * 2.0 + 3 * (np.cos(x[1] - 2) > 0.9),
    lambda x: (np.sin(x[0]) > 0.9) * (x[1] > 1.0) * 3.0,
    lambda x: np.where((x[0] > 1) * (x[1] < 2.5), 4.0, 5.0) * 1.0,
]
REFUSED: list[Callable[[Any], Any]] = [
    lambda x: (np.sin(x[0]) > 0.9) + (np.cos(x[1] - 2) > 0.9) + 0.0,
    lambda x: (np.sin(x[0]) > 0.9) * (x[0] > 0) + (np.cos(x[1] - 2) > 0.9) * (x[1] > 0) + 0.0,
    lambda x: ((np.sin(x[0]) > 0.9) & (x[0] > 0)) + ((np.cos(x[1] - 2) > 0.9) & (x[1] > 0)) + 0.0,
    lambda x: np.sum([np.sin(x[0]) > 0.9, np.cos(x[1] - 2) > 0.9]) + 0.0,
    lambda x: np.where(~(np.sin(x[0]) > 0.9), 1.0, 2.0) * 1.0,
]


@pytest.mark.parametrize("number", range(len(RIGHT)))
def test_truth_values_count_as_they_do_in_python(number: int) -> None:
    f = RIGHT[number]
    image = discrete_map(lambda x, p: (f(x), x[1]), {}, ("x", "y"))
    assert not image.unknown_formulas
    assert image(PLACE)[0] == float(f(PLACE))


@pytest.mark.parametrize("number", range(len(REFUSED)))
def test_a_sum_that_is_another_one_for_numbers_of_numpy_is_refused(number: int) -> None:
    f = REFUSED[number]
    with pytest.raises(TypeError, match=r"uses NumPy adds comparisons.*Write 1.0 \* \(a > b\) \+ 1.0 \* \(c > d\)"):
        discrete_map(lambda x, p: (f(x), x[1]), {}, ("x", "y"))
    with pytest.raises(TypeError, match=r"uses NumPy adds comparisons.*Write 1.0 \* \(a > b\) \+ 1.0 \* \(c > d\)"):
        stroboscopic_map(ForcedSystem(lambda t, x, p: (f(x), -x[1]), {}, 1.0, ("x", "y")))


def untraced(x: Any) -> Any:
    """Return how many hold, of a function whose formulas are not known: a count decides how long the loop is."""
    k = 0
    while k * k < 9.0 * abs(np.tanh(x[0])):
        k += 1
    return k


def test_sums_in_functions_that_are_compiled_as_they_are() -> None:
    def adds(x: Any, p: Any) -> Any:
        return untraced(x) + (np.sin(x[0]) > 0.9) + 0.0, ((x[0] > 1) + (np.sin(x[0]) > 0.9)) * 1.0

    def counts(x: Any, p: Any) -> Any:
        return untraced(x) + 0.0, 1.0 * (x[0] > 1) + 1.0 * (np.sin(x[0]) > 0.9)

    with pytest.raises(TypeError, match="uses NumPy adds comparisons"):
        discrete_map(adds, {}, ("x", "y"))
    image = discrete_map(counts, {}, ("x", "y"))
    assert image.unknown_formulas
    assert image(PLACE).tolist() == [3.0, 2.0]  # the smallest k with k^2 >= 9 tanh(1.5) = 8.1


@pytest.mark.parametrize(
    "f",
    [
        lambda v: 1.0 if v**1.5 > 0.1 else 2.0,
        lambda v: (v**1.5 >= 0.1) + 0.0,
        lambda v: max(0.0, v**1.5),
        lambda v: np.sign(v**1.5),
    ],
)
def test_complex_powers_are_compared_with_nothing(f: Callable[[Any], Any]) -> None:
    """Python's (-0.9)**1.5 is complex: it has no order."""
    image = discrete_map(lambda x, p: (f(x[0]),), {}, ("x",))
    assert image([0.9])[0] == pytest.approx(float(f(0.9)), rel=1e-15)
    assert image.iterate([[-0.9]], 1).status[0] == Status.DIVERGED
