"""Integration in extended precision (64 bits of mantissa), which shares nothing with the library.

Extrapolated midpoint rule (Gragg 1965; Bulirsch and Stoer 1966): plain arithmetic on arrays of long doubles.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

LONG = np.longdouble
Vector = Sequence[Any]


def extrapolated(
    rhs: Callable[[Any, Vector], Vector], begin: Any, state: Vector, length: Any, steps: int, columns: int = 12
) -> list[Any]:
    """Return the state after a length of time, for numbers or arrays of any kind that have arithmetic."""
    size, now = length / steps, list(state)
    numbers = [2 * (j + 1) for j in range(columns)]
    for step in range(steps):
        t = begin + step * size
        rows = [_midpoint(rhs, t, now, size, n) for n in numbers]
        for j in range(1, columns):
            ratios = [(type(size)(numbers[i + j]) / numbers[i]) ** 2 for i in range(columns - j)]
            rows = [
                [b + (b - a) / (ratio - 1) for a, b in zip(rows[i], rows[i + 1], strict=True)]
                for i, ratio in enumerate(ratios)
            ]
        now = rows[0]
    return now


def _midpoint(rhs: Callable[[Any, Vector], Vector], t: Any, state: Vector, size: Any, count: int) -> list[Any]:
    """Return the state after a step by Gragg's rule with some substeps."""
    h = size / count
    before, now = list(state), [u + h * v for u, v in zip(state, rhs(t, state), strict=True)]
    for k in range(1, count):
        before, now = now, [u + 2 * h * v for u, v in zip(before, rhs(t + k * h, now), strict=True)]
    last = rhs(t + size, now)
    return [(u + w + h * v) / 2 for u, w, v in zip(before, now, last, strict=True)]
