"""Loops, recursions and lists that grow with the state are refused before anything is compiled; others are kept."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import pytest

from cellmap import ForcedSystem, discrete_map, stroboscopic_map


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


def arrays(x: float) -> float:
    return float(np.zeros(int(abs(x))).sum())


def newton(x: float) -> float:
    """Return the root of y + y^3 = x: as many steps as Newton's method takes."""
    y = 0.0
    while abs(y + y**3 - x) > 1e-12 * (1.0 + abs(x)):
        y -= (y + y**3 - x) / (1.0 + 3.0 * y * y)
    return y


@pytest.mark.parametrize("growing", [ranges, waits, recurs, lists, arrays])
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


def test_a_loop_that_ends_wherever_it_begins_is_kept() -> None:
    """y + y^3 = 10 has the root 2, and y + y^3 = -130 the root -5."""
    image = discrete_map(lambda x, p: (newton(x[0]),), {}, ("x",))
    assert image([[10.0], [-130.0]])[:, 0] == pytest.approx([2.0, -5.0], rel=1e-11)
