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
from numba.extending import register_jitable
from numpy.typing import NDArray
from scipy.integrate._ivp import dop853_coefficients as dop853

STATE, TIME, CONST, ADD, SUB, MUL, SIN, TANH, SIDE, CELL, SELECT = range(11)
DONE, TWO_SURFACES, TOO_MANY, LOST = range(4)

_A = np.ascontiguousarray(dop853.A[:12, :12])
_B, _C = np.ascontiguousarray(dop853.B), np.ascontiguousarray(dop853.C[:12])
_NO_SLIDE = -1
_EVENTS = 400
_FAR = 1e3  # growth by which errors of the beginning are no longer those at the end


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
        self, period: float, place: NDArray[np.float64], step: float, compiled: bool
    ) -> tuple[NDArray[np.float64], int, int]:
        """Return where a period leads, what became of the orbit, and the number of events; compiling takes 15 s."""
        program = (self.operations, self.operands, self.ends, self.levels, self.dimension)
        return (_compiled_image if compiled else _image)(program, period, place.copy(), step)  # type: ignore[no-any-return]


@register_jitable(error_model="numpy")
def _value(program, part, t, x, f, sides, stack):
    """Return the value of a part of the program, and its derivative along (1, f)."""
    ops, args, ends = program[:3]
    begin, end, n = ends[part], ends[part + 1], 0
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
        elif op in (SIDE, CELL):
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
        elif op == TANH:
            v = np.tanh(stack[n - 1, 0])
            stack[n - 1, 0] = v
            stack[n - 1, 1] *= 1.0 - v * v
        elif op == SELECT:
            n -= 2
            chosen = n if stack[n - 1, 0] > 0.0 else n + 1
            stack[n - 1, 0], stack[n - 1, 1] = stack[chosen, 0], stack[chosen, 1]
    return stack[0, 0], stack[0, 1]


@register_jitable(error_model="numpy")
def _rates(program, t, x, sides, stack, out):
    for i in range(len(x)):
        out[i] = _value(program, i, t, x, x, sides, stack)[0]


@register_jitable(error_model="numpy")
def _pushes(program, t, x, sides, room, k, low, high):
    """Rates on both sides of a surface, into the room for them; return the derivatives of its function along them."""
    stack, f_low, f_high, _ = room
    kept = sides[k]
    sides[k] = low
    _rates(program, t, x, sides, stack, f_low)
    sides[k] = high
    _rates(program, t, x, sides, stack, f_high)
    sides[k] = kept
    part = len(x) + k
    return (_value(program, part, t, x, f_low, sides, stack)[1], _value(program, part, t, x, f_high, sides, stack)[1])


@register_jitable(error_model="numpy")
def _field(program, t, x, sides, room, mode, out):
    """Rates, Filippov's on a surface; return how much of the higher side is in them."""
    slide, low, high = mode
    if slide == _NO_SLIDE:
        _rates(program, t, x, sides, room[0], out)
        return 0.5
    g_low, g_high = _pushes(program, t, x, sides, room, slide, low, high)
    part = g_low / (g_low - g_high)
    for i in range(len(x)):
        out[i] = room[1][i] + part * (room[2][i] - room[1][i])
    return part


@register_jitable(error_model="numpy")
def _step(program, t, x, h, sides, room, mode, out):
    k = room[3]
    for s in range(12):
        for i in range(len(x)):
            out[i] = x[i]
            for j in range(s):
                out[i] += h * _A[s, j] * k[j, i]
        _field(program, t + _C[s] * h, out, sides, room, mode, k[s])
    for i in range(len(x)):
        out[i] = x[i]
        for j in range(12):
            out[i] += h * _B[j] * k[j, i]


@register_jitable(error_model="numpy")
def _margins(program, t, x, sides, room, mode, f, margin, slope):
    """How far each surface is from a change of side, and how fast that changes; the last entry is of sliding."""
    part, levels = _field(program, t, x, sides, room, mode, f), program[3]
    n = len(levels)
    for k in range(n):
        g, rate = _value(program, len(x) + k, t, x, f, sides, room[0])
        if levels[k]:
            below = g - sides[k] < 0.5
            margin[k] = g - sides[k] if below else sides[k] + 1.0 - g
            slope[k] = rate if below else -rate
        else:
            margin[k], slope[k] = sides[k] * g, sides[k] * rate
        if k == mode[0]:
            margin[k], slope[k] = 1.0, 0.0
    margin[n], slope[n] = min(part, 1.0 - part), 0.0
    return part


@register_jitable(error_model="numpy")
def _follow(program, t, x, sides, stack, slide, entered):
    """Put surfaces whose functions jump with the side of another where they are then."""
    levels = program[3]
    for _ in range(len(levels)):
        for k in range(len(levels)):
            g = _value(program, len(x) + k, t, x, x, sides, stack)[0]
            if k != slide and k != entered:
                if levels[k] and not -1e-9 < g - sides[k] < 1.0 + 1e-9:
                    sides[k] = np.floor(g)
                elif not levels[k] and g * sides[k] < -1e-9:
                    sides[k] = -sides[k]


@register_jitable(error_model="numpy")
def _visit(program, t, x, h, sides, room, mode, f, before, margin, end):
    """Return a time within a step at which some margin is negative that is positive at both ends, -1 for none.

    It falls at the begin and rises at the end, so steeply that it may vanish between.
    """
    here, slope = margin[0].copy(), margin[1].copy()
    for k in range(len(program[3])):
        fall, rise = before[1][k], slope[k]
        depth = 0.5 * (before[0][k] + here[k] + 0.5 * h * (fall - rise)) - 0.25 * h * (rise - fall)
        if fall < 0.0 < rise and depth < 0.0:
            first, last = 0.0, h
            for _ in range(40):
                middle = 0.5 * (first + last)
                _step(program, t, x, middle, sides, room, mode, end)
                _margins(program, t + middle, end, sides, room, mode, f, margin[0], margin[1])
                if margin[0][k] < 0.0:
                    return middle
                if margin[1][k] < 0.0:
                    first = middle
                else:
                    last = middle
    return -1.0


def _image(program, period, x, step):
    levels, d = program[3], program[4]
    n = len(levels)
    sides, f, end = np.zeros(n), np.zeros(d), np.zeros(d)
    room = (np.zeros((256, 2)), np.zeros(d), np.zeros(d), np.zeros((12, d)))
    before, margin = np.zeros((2, n + 1)), np.zeros((2, n + 1))
    for k in range(n):
        g = _value(program, d + k, 0.0, x, x, sides, room[0])[0]
        sides[k] = np.floor(g) if levels[k] else (1.0 if g > 0.0 else -1.0)
    t, mode, events = 0.0, (_NO_SLIDE, 0.0, 0.0), 0
    while t < period:
        h = min(step, period - t)
        _margins(program, t, x, sides, room, mode, f, before[0], before[1])
        _step(program, t, x, h, sides, room, mode, end)
        _margins(program, t + h, end, sides, room, mode, f, margin[0], margin[1])
        if not np.abs(end).max() < _FAR:
            return x, LOST, events
        reached = h
        if not margin[0].min() < 0.0:
            reached = _visit(program, t, x, h, sides, room, mode, f, before, margin, end)
        if reached < 0.0:
            _step(program, t, x, h, sides, room, mode, end)
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
            _step(program, t, x, middle, sides, room, mode, end)
            _margins(program, t + middle, end, sides, room, mode, f, margin[0], margin[1])
            if margin[0].min() < 0.0:
                last = middle
            else:
                first = middle
        _step(program, t, x, last, sides, room, mode, end)
        part = _margins(program, t + last, end, sides, room, mode, f, margin[0], margin[1])
        x[:] = end
        t = min(t + last, period)
        k, slide = int(margin[0].argmin()), mode[0]
        if k == n:  # sliding ends
            sides[slide] = mode[2] if part > 0.5 else mode[1]
            mode = (_NO_SLIDE, 0.0, 0.0)
            continue
        g = _value(program, d + k, t, x, f, sides, room[0])[0]
        old = sides[k]
        new = np.floor(g) if levels[k] else -old
        if new == old:
            new = old + 1.0 if g - old > 0.5 else old - 1.0
        if slide == _NO_SLIDE:
            low, high = min(old, new), max(old, new)
            g_low, g_high = _pushes(program, t, x, sides, room, k, low, high)
            if g_low > 0.0 > g_high:
                mode = (k, low, high)
            sides[k] = new
            _follow(program, t, x, sides, room[0], mode[0], k)
            continue
        sides[k] = new
        _follow(program, t, x, sides, room[0], slide, k)
        g = _value(program, d + slide, t, x, f, sides, room[0])[0]
        if abs(g) > 1e-9:  # the surface has jumped away
            sides[slide] = 1.0 if g > 0.0 else -1.0
            _follow(program, t, x, sides, room[0], _NO_SLIDE, k)
            mode = (_NO_SLIDE, 0.0, 0.0)
            continue
        g_low, g_high = _pushes(program, t, x, sides, room, slide, mode[1], mode[2])
        if not g_low > 0.0 > g_high:
            if g_low < 0.0 < g_high:
                return x, TWO_SURFACES, events
            sides[slide] = mode[2] if g_high > 0.0 else mode[1]
            mode = (_NO_SLIDE, 0.0, 0.0)
        _field(program, t, x, sides, room, mode, f)
        rate = _value(program, d + k, t, x, f, sides, room[0])[1]
        if rate * (new - old) <= 0.0:
            return x, TWO_SURFACES, events
    return x, DONE, events


_compiled_image = njit(cache=True, error_model="numpy")(_image)
