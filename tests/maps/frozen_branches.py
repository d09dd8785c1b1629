"""An integrator of right-hand sides with branches that shares nothing with the library's.

Programs are interpreted, one side of every surface is given, and SciPy's coefficients of order 8 make short equal
steps.  A step after which a surface has changed its side is halved until the time of the change is known to rounding,
visits that are shorter than a step are seen by the derivatives at its ends, and where both sides push back onto a
surface the solution is Filippov's.  Where it would slide on two surfaces at once it is given up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.integrate._ivp import dop853_coefficients as dop853

STATE, TIME, CONST, ADD, SUB, MUL, SIN, COS, TANH, SIDE, CELL, SELECT, AND = range(13)
DONE, TWO_SURFACES, TOO_MANY, LOST = range(4)

_A = np.ascontiguousarray(dop853.A[:12, :12])
_B, _C = np.ascontiguousarray(dop853.B), np.ascontiguousarray(dop853.C[:12])
_NO_SLIDE = -1
_EVENTS = 400


@dataclass(frozen=True)
class Program:
    """Operations one after the other: the rates, then the surfaces, whose ends are ``ends``."""

    operations: NDArray[np.int64]
    operands: NDArray[np.float64]
    ends: NDArray[np.int64]
    levels: NDArray[np.bool_]
    dimension: int

    @classmethod
    def of(
        cls,
        rates: Sequence[list[tuple[int, float]]],
        surfaces: Sequence[list[tuple[int, float]]],
        levels: Sequence[bool],
    ) -> Program:
        parts = [*rates, *surfaces]
        flat = [pair for part in parts for pair in part]
        return cls(
            np.array([o for o, _ in flat], np.int64),
            np.array([a for _, a in flat], float),
            np.cumsum([0, *map(len, parts)]).astype(np.int64),
            np.array(levels, np.bool_),
            len(rates),
        )

    def image(
        self, period: float, place: NDArray[np.float64], step: float = 0.02
    ) -> tuple[NDArray[np.float64], int, int]:
        """Return where a period leads, what became of the orbit, and the number of events."""
        return _image(  # type: ignore[no-any-return]
            self.operations, self.operands, self.ends, self.levels, self.dimension, period, place.copy(), step
        )


@njit(cache=True)
def _value(ops, args, begin, end, t, x, f, sides, stack):
    """Return the value of a part of the program, and its derivative along (1, f)."""
    n = 0
    for i in range(begin, end):
        op, a = ops[i], args[i]
        if op == STATE:
            stack[n, 0], stack[n, 1] = x[int(a)], f[int(a)]
            n += 1
        elif op == TIME:
            stack[n, 0], stack[n, 1] = t, 1.0
            n += 1
        elif op == CONST:
            stack[n, 0], stack[n, 1] = a, 0.0
            n += 1
        elif op == SIDE or op == CELL:
            stack[n, 0], stack[n, 1] = sides[int(a)], 0.0
            n += 1
        elif op == ADD:
            n -= 1
            stack[n - 1, 0] += stack[n, 0]
            stack[n - 1, 1] += stack[n, 1]
        elif op == SUB:
            n -= 1
            stack[n - 1, 0] -= stack[n, 0]
            stack[n - 1, 1] -= stack[n, 1]
        elif op == MUL:
            n -= 1
            stack[n - 1, 1] = stack[n - 1, 1] * stack[n, 0] + stack[n - 1, 0] * stack[n, 1]
            stack[n - 1, 0] *= stack[n, 0]
        elif op == SIN:
            v = stack[n - 1, 0]
            stack[n - 1, 0] = np.sin(v)
            stack[n - 1, 1] *= np.cos(v)
        elif op == COS:
            v = stack[n - 1, 0]
            stack[n - 1, 0] = np.cos(v)
            stack[n - 1, 1] *= -np.sin(v)
        elif op == TANH:
            v = np.tanh(stack[n - 1, 0])
            stack[n - 1, 0] = v
            stack[n - 1, 1] *= 1.0 - v * v
        elif op == AND:
            n -= 1
            stack[n - 1, 0] = min(stack[n - 1, 0], stack[n, 0])
        elif op == SELECT:
            n -= 2
            chosen = n if stack[n - 1, 0] > 0.0 else n + 1
            stack[n - 1, 0], stack[n - 1, 1] = stack[chosen, 0], stack[chosen, 1]
    return stack[0, 0], stack[0, 1]


@njit(cache=True)
def _rates(ops, args, ends, d, t, x, sides, stack, out):
    for i in range(d):
        out[i] = _value(ops, args, ends[i], ends[i + 1], t, x, x, sides, stack)[0]


@njit(cache=True)
def _pushes(ops, args, ends, d, t, x, sides, stack, k, low, high, f_low, f_high):
    """Rates on both sides of a surface, and the derivatives of its function along them."""
    kept = sides[k]
    sides[k] = low
    _rates(ops, args, ends, d, t, x, sides, stack, f_low)
    sides[k] = high
    _rates(ops, args, ends, d, t, x, sides, stack, f_high)
    sides[k] = kept
    g_low = _value(ops, args, ends[d + k], ends[d + k + 1], t, x, f_low, sides, stack)[1]
    g_high = _value(ops, args, ends[d + k], ends[d + k + 1], t, x, f_high, sides, stack)[1]
    return g_low, g_high


@njit(cache=True)
def _field(ops, args, ends, d, t, x, sides, stack, slide, low, high, f_low, f_high, out):
    """Rates, Filippov's on a surface; return how much of the higher side is in them."""
    if slide == _NO_SLIDE:
        _rates(ops, args, ends, d, t, x, sides, stack, out)
        return 0.5
    g_low, g_high = _pushes(ops, args, ends, d, t, x, sides, stack, slide, low, high, f_low, f_high)
    part = g_low / (g_low - g_high)
    for i in range(d):
        out[i] = f_low[i] + part * (f_high[i] - f_low[i])
    return part


@njit(cache=True)
def _step(ops, args, ends, d, t, x, h, sides, stack, slide, low, high, f_low, f_high, k, out):
    for s in range(12):
        for i in range(d):
            out[i] = x[i]
            for j in range(s):
                out[i] += h * _A[s, j] * k[j, i]
        _field(ops, args, ends, d, t + _C[s] * h, out, sides, stack, slide, low, high, f_low, f_high, k[s])
    for i in range(d):
        out[i] = x[i]
        for j in range(12):
            out[i] += h * _B[j] * k[j, i]


@njit(cache=True)
def _margins(ops, args, ends, levels, d, t, x, sides, stack, slide, low, high, f_low, f_high, f, margin, slope):
    """How far each surface is from a change of side, and how fast that changes; the last entry is of sliding."""
    part = _field(ops, args, ends, d, t, x, sides, stack, slide, low, high, f_low, f_high, f)
    n = len(levels)
    for k in range(n):
        g, rate = _value(ops, args, ends[d + k], ends[d + k + 1], t, x, f, sides, stack)
        if levels[k]:
            below = g - sides[k] < 0.5
            margin[k] = g - sides[k] if below else sides[k] + 1.0 - g
            slope[k] = rate if below else -rate
        else:
            margin[k], slope[k] = sides[k] * g, sides[k] * rate
        if k == slide:
            margin[k], slope[k] = 1.0, 0.0
    margin[n], slope[n] = min(part, 1.0 - part), 0.0
    return part


@njit(cache=True)
def _image(ops, args, ends, levels, d, period, x, step):
    n = len(levels)
    stack = np.zeros((64, 2))
    sides = np.zeros(n)
    f, f_low, f_high, end = np.zeros(d), np.zeros(d), np.zeros(d), np.zeros(d)
    k_stages = np.zeros((12, d))
    before, before_slope = np.zeros(n + 1), np.zeros(n + 1)
    margin, slope = np.zeros(n + 1), np.zeros(n + 1)
    for k in range(n):
        g = _value(ops, args, ends[d + k], ends[d + k + 1], 0.0, x, x, sides, stack)[0]
        sides[k] = np.floor(g) if levels[k] else (1.0 if g > 0.0 else -1.0)
    t, slide, low, high, events = 0.0, _NO_SLIDE, 0.0, 0.0, 0
    while t < period:
        h = min(step, period - t)
        _margins(ops, args, ends, levels, d, t, x, sides, stack, slide, low, high, f_low, f_high, f, before, before_slope)
        _step(ops, args, ends, d, t, x, h, sides, stack, slide, low, high, f_low, f_high, k_stages, end)
        _margins(ops, args, ends, levels, d, t + h, end, sides, stack, slide, low, high, f_low, f_high, f, margin, slope)
        for i in range(d):
            if not np.abs(end[i]) < 1e6:
                return x, LOST, events
        reached = -1.0
        for k in range(n + 1):
            if margin[k] < 0.0:
                reached = h
        if reached < 0.0:
            # A margin that falls at the begin and rises at the end, so steeply that it may vanish between.
            for k in range(n):
                a, b, c, e = before[k], before_slope[k], margin[k], slope[k]
                if b < 0.0 < e and 0.5 * (a + c + 0.5 * h * (b - e)) - 0.25 * h * (e - b) < 0.0:
                    first, last = 0.0, h
                    for _ in range(40):
                        middle = 0.5 * (first + last)
                        _step(ops, args, ends, d, t, x, middle, sides, stack, slide, low, high, f_low, f_high, k_stages, end)  # fmt: skip
                        _margins(ops, args, ends, levels, d, t + middle, end, sides, stack, slide, low, high, f_low, f_high, f, margin, slope)  # fmt: skip
                        if margin[k] < 0.0:
                            reached = middle
                            break
                        if slope[k] < 0.0:
                            first = middle
                        else:
                            last = middle
                if reached > 0.0:
                    break
            if reached < 0.0:
                if margin.min() >= 0.0:
                    _step(ops, args, ends, d, t, x, h, sides, stack, slide, low, high, f_low, f_high, k_stages, end)
                x[:] = end
                t = period if h < step else t + h
                continue
        events += 1
        if events > _EVENTS:
            return x, TOO_MANY, events
        first, last = 0.0, reached
        for _ in range(60):
            middle = 0.5 * (first + last)
            if middle <= first or middle >= last:
                break
            _step(ops, args, ends, d, t, x, middle, sides, stack, slide, low, high, f_low, f_high, k_stages, end)
            _margins(ops, args, ends, levels, d, t + middle, end, sides, stack, slide, low, high, f_low, f_high, f, margin, slope)  # fmt: skip
            if margin.min() < 0.0:
                last = middle
            else:
                first = middle
        _step(ops, args, ends, d, t, x, last, sides, stack, slide, low, high, f_low, f_high, k_stages, end)
        part = _margins(ops, args, ends, levels, d, t + last, end, sides, stack, slide, low, high, f_low, f_high, f, margin, slope)  # fmt: skip
        x[:] = end
        t = min(t + last, period)
        k = int(margin.argmin())
        if k == n:  # sliding ends
            sides[slide] = high if part > 0.5 else low
            slide = _NO_SLIDE
            continue
        g = _value(ops, args, ends[d + k], ends[d + k + 1], t, x, f, sides, stack)[0]
        old = sides[k]
        new = np.floor(g) if levels[k] else -old
        if new == old:
            new = old + 1.0 if g - old > 0.5 else old - 1.0
        a, b = min(old, new), max(old, new)
        if slide == _NO_SLIDE:
            g_low, g_high = _pushes(ops, args, ends, d, t, x, sides, stack, k, a, b, f_low, f_high)
            if g_low > 0.0 > g_high:
                slide, low, high = k, a, b
            sides[k] = new
            continue
        sides[k] = new
        g_low, g_high = _pushes(ops, args, ends, d, t, x, sides, stack, slide, low, high, f_low, f_high)
        if not g_low > 0.0 > g_high:
            if g_low < 0.0 < g_high:
                return x, TWO_SURFACES, events
            sides[slide] = high if g_high > 0.0 else low
            slide = _NO_SLIDE
        _field(ops, args, ends, d, t, x, sides, stack, slide, low, high, f_low, f_high, f)
        rate = _value(ops, args, ends[d + k], ends[d + k + 1], t, x, f, sides, stack)[1]
        if rate * (new - old) <= 0.0:
            return x, TWO_SURFACES, events
    return x, DONE, events
