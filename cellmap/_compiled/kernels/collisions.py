"""Impacts of a flow: the state jumps, and after ever smaller jumps it rests."""

from __future__ import annotations

import numpy as np

from ..loops import inlined
from .calls import call_impacts, call_surfaces

SIGN, COUNTS, STRIKES, RESTS, SOLID = range(5)
"""What a switch does: it has a sign, or a whole number; or there are impacts at it, after which a state may rest, and
behind which none may begin."""

CLOSE = 1e-12
"""Value of a guard below which a state is on the surface."""

_HEIGHT = 1e-13  # of the highest flight that counts as rest
_FALLS = 1e-9  # acceleration at the end of a rest below which the third derivative decides


@inlined
def rests_on(rate, acceleration):
    """Tell whether a flight that begins on the surface is too low to count."""
    return acceleration < 0.0 and rate * rate <= -2.0 * acceleration * _HEIGHT


@inlined
def begin_rest(e, impacts, t, state, p, bound, signs, slides, fresh, landed, turned, stuck, held, dimension):
    """Let a lane rest on a surface, with the deviations of its neighbours, which come to rest as well.

    Switches whose surfaces hold wherever it rests are on the side that it will leave to.
    """
    own = e * dimension
    for first in range(dimension, state.size, dimension):
        call_impacts(impacts, t, state, state[first:], p, signs, landed, turned, stuck, held)
        for j in range(dimension):
            state[first + j] = held[own + j]
    call_impacts(impacts, t, state, state, p, signs, landed, turned, stuck, held)
    for j in range(dimension):
        state[j] = stuck[own + j]
    signs[e], slides[e], fresh[e] = 0.0, 1.0, 0.0
    for k in range(signs.size):
        if bound[e * signs.size + k] != 0:
            signs[k], slides[k], fresh[k] = bound[e * signs.size + k], 0.0, 0.0


@inlined
def turn_sides(e, bound, kinds, values, signs, slides, leaving):
    """Put switches on the sides where a jump of the state has left them; return how many there were.

    With `leaving`, switches on surfaces that hold wherever the lane rests are on the side to which it leaves.
    """
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
def begin_at_impacts(
    impacts, surfaces, t, state, p, kinds, bound, signs, slides, fresh, values, rates, gains, jumps, normals, landed,
    turned, stuck, held
):  # fmt: skip
    """Choose the mode of a lane that begins on the surface of an impact: an impact at once, a flight, or a rest.

    A state behind a solid surface is put on it.
    """
    dimension, moved = normals.shape[1], 0
    for e in range(signs.size):
        if kinds[e] == SOLID and values[e] < 0.0:
            square = 0.0
            for j in range(dimension):
                square += normals[e, j] * normals[e, j]
            for first in range(0, state.size, dimension):
                depth = values[e] if first == 0 else 0.0
                for j in range(dimension):
                    depth += 0.0 if first == 0 else normals[e, j] * state[first + j]
                for j in range(dimension):
                    state[first + j] -= normals[e, j] * depth / square
            moved += 1
    if moved > 0:
        call_surfaces(surfaces, t, state, p, signs, values, rates, gains, jumps, normals)
    for e in range(signs.size):
        if kinds[e] >= STRIKES and abs(values[e]) <= CLOSE:
            if turn_sides(e, bound, kinds, values, signs, slides, True) > 0:
                call_surfaces(surfaces, t, state, p, signs, values, rates, gains, jumps, normals)
            if kinds[e] >= RESTS and rests_on(rates[e], gains[e, e]):
                begin_rest(
                    e, impacts, t, state, p, bound, signs, slides, fresh, landed, turned, stuck, held, dimension
                )  # fmt: skip
            else:
                signs[e], slides[e], fresh[e] = 1.0, 0.0, 1.0


@inlined
def collide(
    impacts, surfaces, t, last, end, state, p, kinds, bound, hits, signs, slides, fresh, errors, values, rates, gains,
    jumps, normals, landed, turned, stuck, held
):  # fmt: skip
    """Carry out the impacts of an event and clear their hits; return the time that it is then.

    What happens after the time `last`, all but at the end, is left to the next period.
    """
    count, dimension = normals.shape
    struck = 0
    for e in range(count):
        if kinds[e] < STRIKES or hits[e] == 0.0 or signs[e] < 0.0:
            continue
        hits[e] = 0.0
        if slides[e] > 0.0:
            signs[e], slides[e] = 1.0, 0.0
            fresh[e] = 2.0 if gains[e, e] > _FALLS else 3.0
            for k in range(count):
                if bound[e * count + k] != 0:
                    fresh[k] = fresh[e] - 1.0
            continue
        if struck > 0 and rates[e] > 0.0:
            fresh[e] = 1.0  # what has happened at another surface takes the state away from this one
            continue
        if (t - values[e] / rates[e] if rates[e] < 0.0 else t) >= last:
            t = end
            continue
        struck += 1
        own, before = e * dimension, values[e]
        call_impacts(impacts, t, state, errors, p, signs, landed, turned, stuck, held)
        for j in range(dimension):
            errors[j] = abs(turned[own + j])
        for first in range(dimension, state.size, dimension):
            call_impacts(impacts, t, state, state[first:], p, signs, landed, turned, stuck, held)
            for j in range(dimension):
                state[first + j] = turned[own + j]
        for j in range(dimension):
            state[j] = landed[own + j]
        call_surfaces(surfaces, t, state, p, signs, values, rates, gains, jumps, normals)
        if turn_sides(e, bound, kinds, values, signs, slides, False) > 0:
            call_surfaces(surfaces, t, state, p, signs, values, rates, gains, jumps, normals)
        # A guard that the jump leaves as it was, as one of time alone, has been passed, however exactly.
        if abs(values[e]) > CLOSE and abs(values[e] - before) > CLOSE:
            signs[e], fresh[e] = 1.0 if values[e] > 0.0 else -1.0, 0.0
        elif kinds[e] >= RESTS and rests_on(rates[e], gains[e, e]):
            begin_rest(e, impacts, t, state, p, bound, signs, slides, fresh, landed, turned, stuck, held, dimension)
        else:
            signs[e], fresh[e] = 1.0 if rates[e] > 0.0 else -1.0, 1.0
    for e in range(count):
        if kinds[e] >= STRIKES and hits[e] > 0.0:
            signs[e], fresh[e], hits[e] = 1.0 if rates[e] > 0.0 else -1.0, 1.0, 0.0
    return t
