"""Events of piecewise-smooth flows: where a step leaves its mode, and the mode that follows."""

from __future__ import annotations

import numpy as np
from numba import njit

from .options import KERNEL, LANES

NEVER = 2.0
"""Root returned where a polynomial has none in the step."""

_NARROWEST = 1e-9  # interval in which a minimum that all but touches zero is taken not to
_TIE = 1e-13  # share of the friction limit by which a force may pass it and still be held
_STALLS = 50  # events without progress after which a lane is given up
_ROUNDS = 200  # of the relaxation for several switches on their surfaces at once


@njit(**KERNEL)
def first_root(a, degree):
    """Return the first time in (0, 1] at which the polynomial of coefficients a becomes negative, else NEVER.

    Intervals are passed over where a bound from value, slope and largest curvature keeps them positive, and halved
    until they are, or the polynomial falls throughout and Newton's method finds its root.  A zero at time 0 does not
    count.  The coefficients are changed.
    """
    first = 0
    while first < degree and a[first] == 0.0:
        first += 1
    for k in range(first, degree + 1):
        a[k - first] = a[k]
    degree -= first
    if a[0] < 0.0:
        return 0.0
    low, width = 0.0, 1.0
    while low < 1.0:
        high = min(low + width, 1.0)
        middle, reach = 0.5 * (low + high), 0.5 * (high - low)
        value, slope = _value_and_slope(a, degree, middle)
        bend = 0.0
        for k in range(degree, 1, -1):
            bend = bend * high + k * (k - 1.0) * abs(a[k])
        if value - reach * abs(slope) - 0.5 * reach * reach * bend > 0.0:
            low, width = high, 2.0 * width
        elif slope + reach * bend < 0.0:
            end = _value_and_slope(a, degree, high)[0]
            if end < 0.0:
                return _root_between(a, degree, low, high, middle)
            low, width = high, 2.0 * width
        elif width > _NARROWEST:
            width *= 0.5
        elif _value_and_slope(a, degree, high)[0] < 0.0:
            return high
        else:
            low = high
    return NEVER


@njit(**KERNEL)
def _value_and_slope(a, degree, x):
    value, slope = a[degree], 0.0
    for k in range(degree - 1, -1, -1):
        slope = slope * x + value
        value = value * x + a[k]
    return value, slope


@njit(**KERNEL)
def _root_between(a, degree, low, high, x):
    """Newton's method for a falling polynomial, kept between bounds."""
    for _ in range(100):
        value, slope = _value_and_slope(a, degree, x)
        if value > 0.0:
            low = x
        else:
            high = x
        moved = x - value / slope
        if not low <= moved <= high:
            moved = 0.5 * (low + high)
        if abs(moved - x) <= 4e-16:
            return moved
        x = moved
    return x


@njit(**KERNEL)
def equivalent_control(rates, gains, slides, signs, held):
    """Fill in the sign of each switch: as it is where free, else the value that holds it on its surface."""
    count = rates.size
    matrix, right = np.empty((count, count)), np.empty(count)
    for i in range(count):
        for j in range(count):
            matrix[i, j] = gains[i, j] if slides[i] else (1.0 if i == j else 0.0)
        right[i] = -rates[i] if slides[i] else signs[i]
    for i in range(count):
        for k in range(i + 1, count):
            if matrix[k, i] != 0.0:
                factor = matrix[k, i] / matrix[i, i]
                for j in range(i, count):
                    matrix[k, j] -= factor * matrix[i, j]
                right[k] -= factor * right[i]
    for i in range(count - 1, -1, -1):
        known = right[i]
        for j in range(i + 1, count):
            known -= matrix[i, j] * held[j]
        held[i] = known / matrix[i, i]


@njit(**KERNEL)
def choose_mode(rates, gains, on_surface, signs, slides):
    """Decide for the switches on their surfaces which of them slide, and on which side the others go on.

    On return a switch slides, or it is free with the sign of the side that it moves to.  The values l of switches that
    are on their surfaces meet, each: l = 1 and dh/dt >= 0, or l = -1 and dh/dt <= 0, or -1 < l < 1 and dh/dt = 0.
    Gauss-Seidel relaxation finds them; for friction, whose gains are those of an inverse inertia, it converges always.
    """
    count = rates.size
    held = signs.copy()
    for i in range(count):
        if on_surface[i]:
            held[i] = 0.0
    for _ in range(_ROUNDS):
        change = 0.0
        for i in range(count):
            if on_surface[i]:
                rest = rates[i]
                for j in range(count):
                    if j != i:
                        rest += gains[i, j] * held[j]
                own = gains[i, i]
                if own < 0.0 and abs(rest) <= -own * (1.0 + _TIE):
                    value = min(max(-rest / own, -1.0), 1.0)
                    slides[i] = 1.0
                else:
                    value = 1.0 if rest >= 0.0 else -1.0
                    slides[i] = 0.0
                change = max(change, abs(value - held[i]))
                held[i] = value
        if change <= 1e-15:
            break
    for i in range(count):
        if on_surface[i]:
            signs[i] = 0.0 if slides[i] else held[i]


@njit(**KERNEL)
def begin(surfaces, rates, gains, signs, slides, fresh):
    """Choose the modes of a start.  A switch that leaves its surface is marked as fresh: that is no event."""
    count = surfaces.size
    on_surface = np.zeros(count, np.bool_)
    some = False
    for e in range(count):
        slides[e] = 0.0
        signs[e] = 1.0 if surfaces[e] > 0.0 else -1.0
        on_surface[e] = surfaces[e] == 0.0
        some = some or on_surface[e]
    if some:
        choose_mode(rates, gains, on_surface, signs, slides)
    for e in range(count):
        fresh[e] = 1 if on_surface[e] and not slides[e] else 0


@njit(**KERNEL)
def land(lanes, series, errors, fresh, stalls, hits, i, size, count, order, end):
    """Take a lane back to the first event in its last step; return whether there is one.

    Rows of ``lanes`` hold states, time, signs and slides, rows of ``series`` coefficients of states and events, then
    estimates of the local errors, step, and time before the step; see :mod:`cellmap.codegen.switching`.
    """
    stride, length = LANES, order + 1
    local = (size + count) * length
    step, begun = series[(local + size) * stride + i], series[(local + size + 1) * stride + i]
    if step == 0.0:
        return False
    for j in range(size):
        if not abs(lanes[j * stride + i]) < np.inf:
            lanes[size * stride + i] = end
            return False
    a = np.empty(length)
    roots = np.empty(count)
    first = NEVER
    for e in range(count):
        shift = fresh[e, i]
        for k in range(length - shift):
            a[k] = series[((size + e) * length + k + shift) * stride + i]
        sliding = lanes[(size + 1 + count + e) * stride + i] > 0.0
        if sliding and -_TIE * 10.0 < a[0] < 0.0:
            a[0] = 0.0
        roots[e] = first_root(a, order - shift)
        first = min(first, roots[e])
    if first == NEVER:
        for e in range(count):
            fresh[e, i] = 0
        return False
    for j in range(size):
        value = series[(j * length + order) * stride + i]
        for k in range(order - 1, -1, -1):
            value = value * first + series[(j * length + k) * stride + i]
        lanes[j * stride + i] = value
        errors[j, i] -= series[(local + j) * stride + i] * (1.0 - first ** (order - 1))
    lanes[size * stride + i] = min(begun + first * step, end)
    for e in range(count):
        hits[e] = roots[e] <= first + 1e-13
        if first > 1e-9:
            fresh[e, i] = 0
    stalls[i] = stalls[i] + 1 if first < 1e-12 else 0
    if stalls[i] > _STALLS:
        lanes[size * stride + i] = end
        for j in range(size):
            errors[j, i] = 1e300
        return False
    return True


@njit(**KERNEL)
def project(state, surfaces, normals, on_surface):
    """Move a state onto the surfaces it has reached, by the last digits that it is away from them."""
    for e in range(surfaces.size):
        square = 0.0
        for j in range(normals.shape[1]):
            square += normals[e, j] * normals[e, j]
        if on_surface[e] and square > 0.0:
            for j in range(normals.shape[1]):
                state[j] -= normals[e, j] * (surfaces[e] / square)


@njit(**KERNEL)
def switch(rates, gains, jumps, normals, hits, signs, slides, fresh, state, errors):
    """Go over to the mode that follows an event.

    Errors, and tangent vectors if there are any, pass the event as its time depends on the state: by the saltation
    matrix I + (f_after - f_before) grad h / (dh/dt before).
    """
    count, dimension = normals.shape
    before, after = np.empty(count), np.empty(count)
    equivalent_control(rates, gains, slides, signs, before)
    on_surface = np.empty(count, np.bool_)
    entered = -1
    for e in range(count):
        on_surface[e] = slides[e] > 0.0
        if hits[e] and slides[e]:
            signs[e] = before[e] = 1.0 if before[e] > 0.0 else -1.0
            slides[e] = 0.0
            fresh[e] = 2
            on_surface[e] = False
        elif hits[e]:
            on_surface[e] = True
            entered = e
    if entered < 0:
        return
    was_on = on_surface.copy()
    choose_mode(rates, gains, on_surface, signs, slides)
    for e in range(count):
        if was_on[e]:
            fresh[e] = 0 if slides[e] else 1
    equivalent_control(rates, gains, slides, signs, after)
    speed = rates[entered]
    for e in range(count):
        speed += gains[entered, e] * before[e]
    if speed == 0.0:
        return
    for first in range(0, state.size, dimension):
        # The state's own errors first, then each tangent vector.
        shift = 0.0
        for j in range(dimension):
            shift += abs(normals[entered, j]) * errors[j] if first == 0 else normals[entered, j] * state[first + j]
        for j in range(dimension):
            jump = 0.0
            for e in range(count):
                jump += (after[e] - before[e]) * jumps[e, j]
            if first == 0:
                errors[j] += abs(jump * shift / speed)
            else:
                state[first + j] += jump * shift / speed
