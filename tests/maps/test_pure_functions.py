"""Functions that give other values when they are called again are refused as such."""

from __future__ import annotations

import itertools
import math
import random
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from cellmap import ForcedSystem, discrete_map, stroboscopic_map
from cellmap.maps import Impact

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
        if x[0] > 3.0:
            return (x[0] + random.random(),)
        return (0.5 * x[0],)

    with pytest.raises(ValueError, match="not a pure function of its arguments"):
        discrete_map(kicked, {}, ("q",))
    with pytest.raises(ValueError, match="not a pure function of its arguments"):
        stroboscopic_map(ForcedSystem(lambda t, x, p: kicked(x, p), {}, 1.0, ("q",)))


def test_what_happens_once_is_no_period() -> None:
    def pushed_once(t: float, x: Any, p: Any) -> Any:
        return ((1.0 if t < 1 else 0.0) - x[0],)

    with pytest.raises(ValueError, match="at one time only"):
        ForcedSystem(pushed_once, {}, 2 * math.pi, ("q",))


def test_not_a_number_is_the_same_when_it_is_computed_again() -> None:
    assert discrete_map(lambda x, p: (0.5 * x[0], 0.0 * math.inf), {}, ("q", "v")).name == "<lambda>"
