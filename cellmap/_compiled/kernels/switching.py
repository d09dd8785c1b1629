"""The mode that follows an event of a piecewise-smooth flow."""

from __future__ import annotations

import numpy as np

from ..loops import inlined, loop
from .events import TIE
from .lane import COUNTS, SIGN, look

_DIGITS = 1e-12  # distance, relative to the size of a state, by which it may be moved onto a surface
_SLIDING = 1e-8  # the same distance where the state may slide along the surface
_JUMP = 1e-6  # a state leaves a surface with a kink where the equivalent control exceeds one by this
_ROUNDS = 200  # iterations of the relaxation for several switches on their surfaces at once


@loop
def equivalent_control(rates, gains, slides, signs, held):
    """Fill in the sign of each switch: as it is where free, else the value that holds it on its surface."""
    count = rates.size
    if count == 1:
        held[0] = -rates[0] / gains[0, 0] if slides[0] else signs[0]
        return
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


@inlined
def _interval(kind, sign):
    """Return the middle and half the width of the values that a switch has on its surface."""
    middle = sign + 0.5 if kind == COUNTS else 0.0
    reach = 0.5 if kind == COUNTS else 1.0
    return middle, reach


@loop
def choose_mode(system, lane, surfaces, on_surface, held):
    """Decide for the switches on their surfaces which of them slide, and on which side the others go on.

    On return a switch slides, or it is free with the sign of the side that it moves to.  The values l of switches that
    are on their surfaces meet, each: l = 1 and dh/dt >= 0, or l = -1 and dh/dt <= 0, or -1 < l < 1 and dh/dt = 0.
    Of a switch that counts the value lies between its whole number n, of the side below the surface, and n + 1.
    Gauss-Seidel relaxation finds them; for friction, whose gains are those of an inverse inertia, it converges always.
    """
    rates, gains, kinds, signs, slides = surfaces.rates, surfaces.gains, system.kinds, lane.signs, lane.slides
    count = rates.size
    for i in range(count):
        middle, _ = _interval(kinds[i], signs[i])
        held[i] = middle if on_surface[i] else signs[i]
    for _ in range(_ROUNDS):
        change = 0.0
        for i in range(count):
            if on_surface[i]:
                own = gains[i, i]
                middle, reach = _interval(kinds[i], signs[i])
                rest = rates[i] + own * middle
                for j in range(count):
                    if j != i:
                        rest += gains[i, j] * held[j]
                if own < 0.0 and abs(rest) <= -own * reach * (1.0 + TIE):
                    value = middle + min(max(-rest / own, -reach), reach)
                    slides[i] = 1.0
                else:
                    value = middle + (reach if rest >= 0.0 else -reach)
                    slides[i] = 0.0
                change = max(change, abs(value - held[i]))
                held[i] = value
        if change <= 1e-15 or count == 1:
            break
    for i in range(count):
        if on_surface[i] and not slides[i]:
            signs[i] = held[i]
        elif on_surface[i] and kinds[i] != COUNTS:
            signs[i] = 0.0


@inlined
def begin_on_surface(system, lane, surfaces, event):
    """Choose the mode of an initial condition on a surface.  Switches that leave it are marked as fresh: no event.

    Where it slides, neighbours on either side are drawn in along the jump, and with them the tangent vectors.
    """
    count, dimension = surfaces.normals.shape
    on_surface, speeds, held, state = event.on_surface, event.before, event.after, lane.state
    for e in range(count):
        on_surface[e] = 1.0 if surfaces.values[e] == 0.0 and system.kinds[e] == SIGN else 0.0
    choose_mode(system, lane, surfaces, on_surface, held)
    for e in range(count):
        lane.fresh[e] = on_surface[e] - lane.slides[e]
    event.hits[:] = 0.0
    for first in range(dimension, state.size, dimension):
        for e in range(count):
            speeds[e] = 0.0
            for j in range(dimension):
                speeds[e] += surfaces.normals[e, j] * state[first + j]
        equivalent_control(speeds, surfaces.gains, lane.slides, event.hits, held)
        for e in range(count):
            for j in range(dimension):
                state[first + j] += held[e] * surfaces.jumps[e, j]


@loop
def project(system, lane, surfaces, event):
    """Move a state onto the surfaces where it has arrived or slides, by the last digits that it is away from them.

    Surfaces that are farther away than its errors allow, as those that all but depend on time alone, are left.  Where
    a state may slide it has to be on its surface, which the time of an event that all but touches leaves less exactly.
    """
    state, gains, normals, active, shifts = lane.state, surfaces.gains, surfaces.normals, event.on_surface, event.before
    count, moving = normals.shape[0], system.moving
    error, length = 0.0, 1.0
    for j in range(moving):
        error += abs(lane.errors[j])
        length += abs(state[j])
    for e in range(count):
        shifts[e] = surfaces.values[e]
        if system.kinds[e] == COUNTS:
            shifts[e] -= 0.5 if surfaces.values[e] > 0.0 else -0.5
    if count == 1:
        square = 0.0
        for j in range(moving):
            square += normals[0, j] * normals[0, j]
        reach = error + length * (_DIGITS if gains[0, 0] == 0.0 else _SLIDING)
        if event.hits[0] + lane.slides[0] > 0.0 and abs(shifts[0]) < reach * np.sqrt(square):
            for j in range(moving):
                state[j] -= normals[0, j] * (shifts[0] / square)
        return
    products, alone = np.empty((count, count)), 0.0
    for e in range(count):
        for k in range(count):
            products[e, k] = 0.0
            for j in range(moving):
                products[e, k] += normals[e, j] * normals[k, j]
        reach = error + length * (_DIGITS if gains[e, e] == 0.0 else _SLIDING)
        near = abs(shifts[e]) < reach * np.sqrt(products[e, e])
        active[e] = 1.0 if event.hits[e] + lane.slides[e] > 0.0 and near else 0.0
        alone += abs(shifts[e]) / products[e, e] if active[e] else 0.0
        shifts[e] = shifts[e] if active[e] else 0.0
    equivalent_control(shifts, products, active, shifts, shifts)
    for e in range(count):
        # Surfaces that all but coincide have no point of intersection nearby.
        if active[e] and abs(shifts[e]) <= 1e3 * alone:
            for j in range(moving):
                state[j] += normals[e, j] * shifts[e]


@inlined
def leave(system, lane, surfaces, event):
    """End the mode in which an event lies; return the surface that is entered, -1 if one is only left, and what fell.

    Switches that count, at the ends of their intervals, have the whole number below their surface now; as many as fell
    have another one than before.
    """
    gains, hits, kinds, on_surface, before = surfaces.gains, event.hits, system.kinds, event.on_surface, event.before
    signs, slides, fresh = lane.signs, lane.slides, lane.fresh
    equivalent_control(surfaces.rates, gains, slides, signs, before)
    entered, fallen = -1, 0
    for e in range(signs.size):
        on_surface[e] = slides[e]
        if hits[e] and slides[e]:
            # What pushes it off both sides at once, after the jump of another, has a gain of either sign.
            middle, reach = _interval(kinds[e], signs[e])
            beyond = abs(before[e] - middle) > reach + _JUMP
            signs[e] = before[e] = middle + (reach if (before[e] - middle) * gains[e, e] < 0.0 else -reach)
            slides[e] = 0.0
            fresh[e] = 1.0 if beyond else 2.0
            on_surface[e] = 0.0
        elif hits[e]:
            if kinds[e] == COUNTS and surfaces.values[e] < 0.0:
                signs[e] -= 1.0
                fallen += 1
            on_surface[e] = 1.0
            entered = e
    return entered, fallen


@inlined
def enter(system, lane, surfaces, event):
    """Go over to the mode that follows an event."""
    on_surface, fresh, slides = event.on_surface, lane.fresh, lane.slides
    choose_mode(system, lane, surfaces, on_surface, event.after)
    for e in range(slides.size):
        touches = event.hits[e] > 0.0 and fresh[e] > 0.0 and slides[e] == 0.0 and surfaces.gains[e, e] == 0.0
        if on_surface[e] and touches and system.kinds[e] == SIGN:
            # It came back at once: it only touches the surface here, and the second derivative tells the side.
            lane.signs[e] = -event.before[e]
            fresh[e] = 2.0
        elif on_surface[e]:
            fresh[e] = 1.0 - slides[e]
    equivalent_control(surfaces.rates, surfaces.gains, slides, lane.signs, event.after)


@inlined
def follow(values, free, kinds, signs):
    """Put switches that are free on the side where the change of another has left them, and mark them with a 2.

    Return how many there were.
    """
    changed = 0
    for e in range(signs.size):
        counted = kinds[e] == COUNTS and not -0.5 <= values[e] < 0.5
        if free[e] and (counted or (kinds[e] == SIGN and signs[e] * values[e] < 0.0)):
            signs[e] = signs[e] + np.floor(values[e] + 0.5) if counted else -signs[e]
            free[e] = 2.0
            changed += 1
    return changed


@inlined
def pass_event(system, t, entered, gap, lane, surfaces, event):
    """Take errors, and tangent vectors if there are any, through an event whose time depends on the state.

    Its function is known up to a gap.
    It is the saltation matrix I + (f_after - f_before) grad h / (dh/dt before).
    """
    state, errors, before, after = lane.state, lane.errors, event.before, event.after
    count, dimension = surfaces.normals.shape
    changes, changed = 0, entered
    for e in range(count):
        if before[e] != after[e]:
            changes, changed = changes + 1, e
    factor = after[changed] - before[changed]
    if changes > 1 or system.coupled:
        _add_jumps(system, t, entered, lane, surfaces, event)
        changed, factor = entered, 1.0
    speed, normal, jump = surfaces.rates[entered], surfaces.normals[entered], surfaces.jumps[changed]
    for e in range(count):
        speed += surfaces.gains[entered, e] * before[e]
    if speed == 0.0 or changes == 0:
        return
    for first in range(0, state.size, dimension):
        # The state's own errors first, then each tangent vector.
        shift = gap if first == 0 else 0.0
        for j in range(dimension):
            shift += abs(normal[j]) * errors[j] if first == 0 else normal[j] * state[first + j]
        for j in range(dimension):
            if first == 0:
                errors[j] += abs(factor * jump[j] * shift / speed)
            else:
                state[first + j] += factor * jump[j] * shift / speed


@loop
def _add_jumps(system, t, entered, lane, surfaces, event):
    """Put the jump of all switches that change into the place of one of them, which is as it was before.

    It is the difference of the right-hand side in both modes: jumps depend on the sides of others.
    """
    count, dimension = surfaces.normals.shape
    event.values[:] = lane.signs
    jump, held = np.zeros(dimension), np.zeros(count)
    for way in range(2):
        for e in range(count):
            held[e] = event.before[e] if way else event.after[e]
            if system.kinds[e] == COUNTS:
                lane.signs[e] = np.floor(held[e])
            elif system.kinds[e] == SIGN:
                lane.signs[e] = 1.0 if held[e] == 1.0 else -1.0
        look(system, t, lane, surfaces)
        for j in range(dimension):
            value = surfaces.flow[j]
            for e in range(count):
                if system.kinds[e] <= COUNTS and held[e] != lane.signs[e]:
                    value += (held[e] - lane.signs[e]) * surfaces.jumps[e, j]
            jump[j] += -value if way else value
    lane.signs[:] = event.values
    surfaces.jumps[entered] = jump
