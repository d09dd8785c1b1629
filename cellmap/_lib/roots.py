"""Zeros and extrema of many functions of one variable, vectorised."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from .arrays import Floats

Functions = Callable[..., Floats]
"""``functions(rows, values)`` returns values of some of the functions, given by their numbers, at one place each."""

_ROUNDS = 80
_GOLDEN = 0.5 * (3.0 - np.sqrt(5.0))


def zeros(function: Functions, low: Floats, high: Floats, at_low: Floats, at_high: Floats) -> Floats:
    """Find one zero in each bracket, to rounding, by inverse quadratic interpolation and bisection (Chandrupatla)."""
    a, b, c = high.copy(), low.copy(), high.copy()
    fa, fb, fc = at_high.copy(), at_low.copy(), at_high.copy()
    fraction = np.full(len(a), 0.5)
    root = np.where(np.abs(fa) < np.abs(fb), a, b)
    active = np.arange(len(a))
    for _ in range(_ROUNDS):
        if not len(active):
            break
        x = a[active] + fraction[active] * (b[active] - a[active])
        fx = function(active, x)
        same = (fx < 0.0) == (fa[active] < 0.0)
        c[active] = np.where(same, a[active], b[active])
        fc[active] = np.where(same, fa[active], fb[active])
        b[active] = np.where(same, b[active], a[active])
        fb[active] = np.where(same, fb[active], fa[active])
        a[active], fa[active] = x, fx
        root[active] = np.where(np.abs(fa[active]) < np.abs(fb[active]), a[active], b[active])
        width = np.abs(b - a)[active]
        resolution = 2e-15 * np.abs(root[active]) + 1e-300
        limit = resolution / np.maximum(width, 1e-300)
        with np.errstate(all="ignore"):
            xi = ((a - b) / (c - b))[active]
            phi = ((fa - fb) / (fc - fb))[active]
            inverse = (fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb))[active]
            smooth = (phi**2 < xi) & ((1.0 - phi) ** 2 < 1.0 - xi) & np.isfinite(inverse)
        fraction[active] = np.clip(np.where(smooth, inverse, 0.5), np.minimum(limit, 0.5), 1.0 - np.minimum(limit, 0.5))
        active = active[(width > 2.0 * resolution) & (fx != 0.0) & np.isfinite(fx)]
    return root


def extrema(function: Functions, sides: Sequence[Floats], height: Sequence[Floats]) -> tuple[Floats, Floats]:
    """Find the extrema towards zero between three points each, by golden sections; stop a search beyond zero."""
    low, best, high = (s.copy() for s in sides)
    sign = np.where(height[1] < 0.0, -1.0, 1.0)
    value = height[1] * sign
    for _ in range(_ROUNDS):
        active = np.flatnonzero((value > 0.0) & (high - low > 1e-9 * np.maximum(np.abs(low), np.abs(high))))
        if not len(active):
            break
        a, b, c = low[active], best[active], high[active]
        right = c - b > b - a
        new = np.where(right, b + _GOLDEN * (c - b), b - _GOLDEN * (b - a))
        seen = function(active, new) * sign[active]
        lower = seen < value[active]
        low[active] = np.where(right & lower, b, np.where(~right & ~lower, new, a))
        high[active] = np.where(~right & lower, b, np.where(right & ~lower, new, c))
        best[active] = np.where(lower, new, b)
        value[active] = np.where(lower, seen, value[active])
    return best, value * sign
