"""Events of piecewise-smooth flows: the first one in a step, at which the step ends."""

from __future__ import annotations

import numpy as np

from ..loops import inlined, loop
from .blocks import LANES
from .lane import COUNTS

NEVER = 2.0
"""Root returned where a polynomial has none in the step."""
NO_EVENT = -1e300  # a time before all others
TIE = 1e-13  # fraction of the friction limit by which a force may exceed it and contacts still stick

_NOTHING = 1e-300  # coefficients that hold no digits
_NARROW = 0.05  # interval from which on all coefficients are looked at
_NARROWEST = 1e-9  # interval in which a minimum that all but touches zero is taken not to
_STALLS = 50  # events without progress after which a lane is given up


@loop
def first_root(a, degree):
    """Return the first time in (0, 1] at which the polynomial of coefficients a becomes negative, else NEVER.

    Intervals are passed over where a bound from value, slope and largest curvature keeps them positive, and halved
    until they are, or the polynomial falls throughout and Halley's method finds its root.  A zero at time 0 does not
    count, and a polynomial that vanishes or is none is never negative.  The coefficients are changed.
    """
    first, total = 0, 0.0
    while first < degree and a[first] == 0.0:
        first += 1
    for k in range(first, degree + 1):
        a[k - first] = a[k]
        total += abs(a[k])
    if not _NOTHING < total < np.inf:
        return NEVER
    degree -= first
    if a[0] < 0.0:
        return 0.0
    # What the last coefficients add is bounded, so that most intervals are judged by the first few.
    last, tail, tail_slope = degree, 0.0, 0.0
    while last > 3 and tail + abs(a[last]) <= 1e-3 * a[0]:
        tail += abs(a[last])
        tail_slope += last * abs(a[last])
        last -= 1
    low, width = 0.0, 1.0
    while low < 1.0:
        high = min(low + width, 1.0)
        middle, reach = 0.5 * (low + high), 0.5 * (high - low)
        value, slope, bend = a[last], 0.0, 0.0
        for k in range(last - 1, -1, -1):
            if k > 0:
                bend = bend * high + (k + 1.0) * k * abs(a[k + 1])
            slope = slope * middle + value
            value = value * middle + a[k]
        if value - reach * abs(slope) - 0.5 * reach * reach * bend - tail > 0.0:
            low, width = high, 2.0 * width
        elif slope + reach * bend + tail_slope < 0.0:
            if _value(a, degree, high) < 0.0:
                return _root_between(a, degree, low, high, middle - value / slope)
            low, width = high, 2.0 * width
        elif width > _NARROW:
            width *= 0.5
        elif last < degree:
            last, tail, tail_slope = degree, 0.0, 0.0
        elif width > _NARROWEST:
            width *= 0.5
        elif _value(a, degree, high) < 0.0:
            return high
        else:
            low = high
    return NEVER


@inlined
def _value(a, degree, x):
    value = a[degree]
    for k in range(degree - 1, -1, -1):
        value = value * x + a[k]
    return value


@inlined
def _root_between(a, degree, low, high, x):
    """Halley's method for a polynomial that falls from low to high, kept between them."""
    x = min(max(x, low), high)
    for _ in range(100):
        value, slope, bend = a[degree], 0.0, 0.0  # of the bend, half
        for k in range(degree - 1, -1, -1):
            bend = bend * x + slope
            slope = slope * x + value
            value = value * x + a[k]
        if value > 0.0:
            low = x
        else:
            high = x
        step = value * slope / (slope * slope - value * bend)
        if not low <= x - step <= high:
            step = x - 0.5 * (low + high)
        x -= step
        # Convergence is cubic: what is left is of the order of the cube of the last step.
        if abs(step) <= 1e-6:
            break
    return x


@inlined
def load_event(event, least, factor, shift, a, length):
    """Copy the coefficients of ``least + factor event``, from one of them on; return the sum of their sizes."""
    total = 0.0
    for k in range(length - shift):
        a[k] = factor * event[(k + shift) * LANES] + (least if k + shift == 0 else 0.0)
        total += abs(a[k])
    return total


@inlined
def _leaves_between(event, shift, a, length):
    """Return the first time at which an event leaves the interval from -1/2 to 1/2, else NEVER.

    With a zero at the beginning, of the order `shift`, it begins on the nearer of both ends.
    """
    first = NEVER
    for factor in (-1.0, 1.0):
        begins = shift if factor * event[0] < 0.0 else 0
        load_event(event, 0.5, factor, begins, a, length)
        first = min(first, first_root(a, length - 1 - begins))
    return first


@inlined
def land(system, series, lane, event, end):
    """Take a lane back to the first event in its last step; return its time then, NO_EVENT if there is none.

    Rows of ``series`` hold coefficients of states and events, then estimates of the local errors, step, and time before
    the step; see :mod:`cellmap._compiled.codegen.switching`.
    """
    state, slides, errors, fresh, roots = lane.state, lane.slides, lane.errors, lane.fresh, event.before
    size, count, order = state.size, slides.size, system.order
    length = order + 1
    local = (size + count) * length
    step, begun = series[(local + size) * LANES], series[(local + size + 1) * LANES]
    if step == 0.0:
        return NO_EVENT
    for j in range(size):
        if not abs(state[j]) < np.inf:
            return NO_EVENT
    first = NEVER
    for e in range(count):
        shift, a, row = int(fresh[e]), event.series, series[(size + e) * length * LANES :]
        total = load_event(row, 0.0, 1.0, shift, a, length)
        if not total < np.inf:
            errors[:] = 1e300  # a mode that cannot be told is no mode
            return NO_EVENT
        if slides[e] > 0.0 and -10.0 * TIE < a[0] < 0.0:
            a[0] = 0.0
        if system.kinds[e] == COUNTS:
            roots[e] = _leaves_between(row, shift, a, length)
        else:
            roots[e] = first_root(a, order - shift)
        first = min(first, roots[e])
    if first > 1e-9:
        fresh[:] = 0.0
    if first == NEVER:
        return NO_EVENT
    fresh[count] += 1.0
    if fresh[count] > _STALLS:
        errors[:] = 1e300
        return NO_EVENT
    for j in range(size):
        value = series[(j * length + order) * LANES]
        for k in range(order - 1, -1, -1):
            value = value * first + series[(j * length + k) * LANES]
        state[j] = value
        errors[j] -= series[(local + j) * LANES] * (1.0 - first)
    for e in range(count):
        event.hits[e] = 1.0 if roots[e] <= first + 1e-13 else 0.0
    return min(begun + first * step, end)
