"""Loops that are longer the larger the states are: orbits that grow would make a compiled function run for ever.

A function without formulas is called in Python at states of several sizes, and what the interpreter does is counted.
"""

from __future__ import annotations

import sys
import tracemalloc
from collections.abc import Callable
from types import FrameType
from typing import Any

import numpy as np

from .trace import as_state

_SIZES = (1.0, 1e3, 1e6)
_MOST_STEPS = 100_000  # steps of the interpreter that are counted: more would take a second
_MOST_BYTES = 2**20  # bytes of lists and arrays that a call makes
_TIMES = 4  # factor over the steps at small states that is no growth: a branch may do that


class LoopError(TypeError):
    """A function whose loops or lists are longer the larger the states are."""


class _TooMany(BaseException):
    """More steps than are counted, which no ``except Exception`` of a user holds back."""


def check_lengths(name: str, function: Callable[..., Any], dimension: int, record: Any) -> None:
    """Refuse a function ``f(t, x, p)`` whose loops, recursion or lists grow with the states.

    Raises
    ------
    LoopError
        With the states at which both have been seen.
    """
    for sign in (1.0, -1.0):
        least: tuple[int, int] | None = None
        for size in _SIZES:
            state = as_state(function, (sign * size * (0.9 + 0.07 * j) for j in range(dimension)))
            work = _work(function, state, record)
            least = least or work
            for most, few, many in zip((_MOST_STEPS, _MOST_BYTES), least, work, strict=True):
                if many >= most and many > _TIMES * few:
                    raise LoopError(
                        f"{name} takes longer the larger the state is (a loop, a recursion or a list has more than "
                        f"{_TIMES} times the length at x = {_shown(state)} that it has at states near 1): give loops a "
                        "fixed length, such as `for k in range(20)` with a `break`, and count with floor() or %"
                    )


def _shown(state: tuple[float, ...]) -> str:
    return f"({', '.join(f'{v:.3g}' for v in state)})"


def _work(function: Callable[..., Any], state: tuple[float, ...], record: Any) -> tuple[int, int]:
    """Return how many steps the interpreter takes in a call, up to the most, and how many bytes are taken at once."""
    steps = 0

    def count(frame: FrameType, event: str, _: Any) -> Any:
        nonlocal steps
        frame.f_trace_opcodes, frame.f_trace_lines = True, False
        steps += event == "opcode"
        if steps >= _MOST_STEPS:
            raise _TooMany
        return count

    before, traced = sys.gettrace(), tracemalloc.is_tracing()
    if not traced:
        tracemalloc.start()
    tracemalloc.reset_peak()
    held = tracemalloc.get_traced_memory()[0]
    sys.settrace(count)
    try:
        with np.errstate(all="ignore"):
            function(0.0, state, record)
    except RecursionError:
        steps = _MOST_STEPS
    except (Exception, _TooMany):
        pass  # outside of its domain, or counted
    finally:
        sys.settrace(before)
        peak = tracemalloc.get_traced_memory()[1] - held
        if not traced:
            tracemalloc.stop()
    return steps, peak
