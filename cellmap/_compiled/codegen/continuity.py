"""Whether a right-hand side jumps at a switching surface, or only has a kink there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from .branches import Switch
from .evaluation import evaluated
from .expression import Expression, in_order

_SAMPLES = 64
_HALVINGS = 60
_OFFSETS = tuple(1e-15 * k for k in range(9))
"""Places beside a surface, so close that values differ by rounding alone, as beside a removable pole."""


def is_continuous(switch: Switch, jump: tuple[Expression, ...]) -> bool:
    """Whether a right-hand side has no jump where a switching function is zero.

    Both are analytic, so that a jump that vanishes at many places drawn at random vanishes at all.
    """
    if all(e.vanishes for e in jump):
        return True
    if switch.counts:
        return False
    rng = np.random.default_rng(0)
    inputs = [e for e in in_order([switch.function, *jump]) if not e.arguments and e.operation != "constant"]
    ends = [{e: rng.normal(size=_SAMPLES) * 2.0 for e in inputs} for _ in range(2)]
    for e in inputs:
        if e.operation == "parameter":
            ends[0][e] = ends[1][e] = np.abs(ends[0][e])
        if e.operation == "sign":
            ends[0][e] = ends[1][e] = np.where(ends[0][e] > 0.0, 1.0, -1.0)
    low, high = np.zeros(_SAMPLES), np.ones(_SAMPLES)

    def between(fraction: Any, expressions: Sequence[Expression]) -> list[Any]:
        found = evaluated(expressions, {e: ends[0][e] + fraction * (ends[1][e] - ends[0][e]) for e in inputs})
        return [np.broadcast_to(values, _SAMPLES) for values in found]

    (begin,), (end,) = (between(fraction, [switch.function]) for fraction in (low, high))
    crosses = np.asarray((begin < 0.0) & (end > 0.0) | (begin > 0.0) & (end < 0.0))
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        (value,) = between(middle, [switch.function])
        same = (value > 0.0) == (begin > 0.0)
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    close = [np.stack(between(low + offset, jump))[:, crosses] for offset in _OFFSETS]
    there, noise = np.abs(close[0]), np.ptp(close, axis=0)
    nearby = np.nan_to_num(np.abs(np.stack(between(low + 0.1, jump)))[:, crosses])  # one side may have a border there
    usable = np.isfinite(there + noise).all(axis=0)
    size = 1e-9 * np.maximum(nearby.max(axis=0, initial=0.0), 1e-3)
    return bool(usable.any() and (there <= size + 2.0 * noise)[:, usable].all())
