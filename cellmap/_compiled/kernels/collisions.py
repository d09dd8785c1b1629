"""Impacts of a flow: the state jumps, and after ever smaller jumps it rests."""

from __future__ import annotations

import numpy as np

from ..loops import inlined
from .calls import call_impacts
from .lane import COUNTS, ENDS, RESTS, SOLID, STRIKES, look

CLOSE = 1e-12
"""Value of a guard below which a state is on the surface."""

_HEIGHT = 1e-13  # height of the highest flight that counts as rest
_FALLS = 1e-9  # acceleration at the end of a rest below which the third derivative decides


@inlined
def rests_on(rate, acceleration):
    """Tell whether a flight that begins on the surface is too low to count."""
    return acceleration < 0.0 and rate * rate <= -2.0 * acceleration * _HEIGHT


@inlined
def begin_rest(e, system, t, lane, jumps):
    """Let a lane rest on a surface, with the deviations of its neighbours, which come to rest as well.

    Switches whose surfaces hold wherever it rests are on the side that it will leave to.
    """
    state, signs, slides, fresh, bound = lane.state, lane.signs, lane.slides, lane.fresh, system.bound
    dimension = system.dimension
    own = e * dimension
    call_impacts(system.impacts, t, state, state, system.p, signs, jumps)
    for j in range(dimension):
        state[j] = jumps.stuck[own + j]
    for first in range(dimension, state.size, dimension):
        call_impacts(system.impacts, t, state, state[first:], system.p, signs, jumps)
        for j in range(dimension):
            state[first + j] = jumps.held[own + j]
    signs[e], slides[e], fresh[e] = 0.0, 1.0, 0.0
    for k in range(signs.size):
        if bound[e * signs.size + k] != 0:
            signs[k], slides[k], fresh[k] = bound[e * signs.size + k], 0.0, 0.0


@inlined
def turn_sides(e, system, lane, surfaces, leaving):
    """Put switches on the sides where a jump of the state has left them; return how many there were.

    With `leaving`, switches on surfaces that hold wherever the lane rests are on the side to which it leaves.
    """
    kinds, bound, values, signs, slides = system.kinds, system.bound, surfaces.values, lane.signs, lane.slides
    changed, count = 0, signs.size
    for k in range(count):
        side = 1.0 if values[k] > 0.0 else -1.0
        if k == e:
            continue
        if kinds[k] == COUNTS:
            if abs(values[k]) > 0.5:
                signs[k] += np.floor(values[k] + 0.5)
                changed += 1
            continue
        if abs(values[k]) <= CLOSE:
            if not leaving or bound[e * count + k] == 0:
                continue
            side = bound[e * count + k]
        elif slides[k] > 0.0 and kinds[k] >= STRIKES:
            continue
        if side != signs[k] or slides[k] > 0.0:
            signs[k], slides[k] = side, 0.0
            changed += 1
    return changed


@inlined
def begin_at_impacts(system, t, lane, surfaces, jumps, end):
    """Choose the mode of a lane that begins on the surface of an impact: an impact at once, a flight, or a rest.

    A state behind a solid surface is put on it; behind an end it has ended.  Return the time that it is then.
    """
    kinds, values, normals, state = system.kinds, surfaces.values, surfaces.normals, lane.state
    dimension, moved = normals.shape[1], 0
    for e in range(lane.signs.size):
        if kinds[e] == SOLID and values[e] < 0.0:
            square = 0.0
            for j in range(system.moving):
                square += normals[e, j] * normals[e, j]
            for first in range(0, state.size, dimension):
                depth = values[e] if first == 0 else 0.0
                for j in range(dimension):
                    depth += 0.0 if first == 0 else normals[e, j] * state[first + j]
                for j in range(system.moving):
                    state[first + j] -= normals[e, j] * depth / square
            moved += 1
    if moved > 0:
        look(system, t, lane, surfaces)
    for e in range(lane.signs.size):
        if kinds[e] == ENDS and values[e] < -CLOSE:
            lane.signs[e] = -1.0
            return end
        if kinds[e] >= STRIKES and abs(values[e]) <= CLOSE:
            if turn_sides(e, system, lane, surfaces, True) > 0:
                look(system, t, lane, surfaces)
            if kinds[e] >= RESTS and rests_on(surfaces.rates[e], surfaces.gains[e, e]):
                begin_rest(e, system, t, lane, jumps)
            else:
                lane.signs[e], lane.slides[e], lane.fresh[e] = 1.0, 0.0, 1.0
    return t


@inlined
def _jump(e, system, t, lane, jumps):
    """Let the state of a lane jump, with its errors and the deviations of its neighbours."""
    state, dimension = lane.state, system.dimension
    own = e * dimension
    call_impacts(system.impacts, t, state, lane.errors, system.p, lane.signs, jumps)
    for j in range(dimension):
        lane.errors[j] = abs(jumps.turned[own + j])
    for first in range(dimension, state.size, dimension):
        call_impacts(system.impacts, t, state, state[first:], system.p, lane.signs, jumps)
        for j in range(dimension):
            state[first + j] = jumps.turned[own + j]
    for j in range(dimension):
        state[j] = jumps.landed[own + j]


@inlined
def collide(system, t, lane, surfaces, event, jumps, span):
    """Carry out the impacts of an event and clear their hits; return the time that it is then.

    What happens after the last time of a span, all but at its end, is left to the next period.
    """
    kinds, values, rates, hits = system.kinds, surfaces.values, surfaces.rates, event.hits
    signs, slides, fresh = lane.signs, lane.slides, lane.fresh
    count, struck = signs.size, 0
    for e in range(count):
        if kinds[e] < STRIKES or hits[e] == 0.0 or signs[e] < 0.0:
            continue
        hits[e] = 0.0
        if slides[e] > 0.0:
            signs[e], slides[e] = 1.0, 0.0
            fresh[e] = 2.0 if surfaces.gains[e, e] > _FALLS else 3.0
            for k in range(count):
                if system.bound[e * count + k] != 0:
                    fresh[k] = fresh[e] - 1.0
            continue
        if struck > 0 and rates[e] > 0.0:
            fresh[e] = 1.0  # what has happened at another surface takes the state away from this one
            continue
        if (t - values[e] / rates[e] if rates[e] < 0.0 else t) >= span.last:
            t = span.end
            continue
        if kinds[e] == ENDS:
            signs[e] = -1.0
            return span.end
        struck += 1
        before = values[e]
        _jump(e, system, t, lane, jumps)
        look(system, t, lane, surfaces)
        if turn_sides(e, system, lane, surfaces, False) > 0:
            look(system, t, lane, surfaces)
        # A guard that the jump leaves as it was, as one of time alone, has been passed, however exactly.
        if abs(values[e]) > CLOSE and abs(values[e] - before) > CLOSE:
            signs[e], fresh[e] = 1.0 if values[e] > 0.0 else -1.0, 0.0
        elif kinds[e] >= RESTS and rests_on(rates[e], surfaces.gains[e, e]):
            begin_rest(e, system, t, lane, jumps)
        else:
            signs[e], fresh[e] = 1.0 if rates[e] > 0.0 else -1.0, 1.0
    for e in range(count):
        if kinds[e] >= STRIKES and hits[e] > 0.0:
            signs[e], fresh[e], hits[e] = 1.0 if rates[e] > 0.0 else -1.0, 1.0, 0.0
    return t
