"""One period of a discontinuous right-hand side, for many initial conditions in SIMD lanes.

What belongs to a system is generated and called by address, see :mod:`cellmap._compiled.codegen.switching`; everything
else is here and compiled once for all systems.  Each lane has its own time and its own mode, and all lanes of a block
take a Taylor step together.  The step also says in which lanes an event may lie.  Only these are looked at one by one:
the first root of the event's polynomial is found, the lane is taken back to it, its mode changes, and it goes on from
there with the next step of its block.  So every step lies in one mode, events are located to the accuracy of the
series, and the order of the method holds across them.

Rows of ``lanes``, LANES numbers each: states, time, signs, slides, sums of local errors, and the entries of ``fresh``.
Rows of ``series``: coefficients of states and of events, local errors, step, time before the step, and the flag of an
event.
"""

from __future__ import annotations

import functools

import numpy as np

from ..loops import inlined, loop_by_address
from .blocks import BLOWN_UP, LANES
from .calls import PERIOD, array_at, call_begin, call_step, call_surfaces
from .collisions import SIGN, begin_at_impacts, collide
from .coupled_switches import doubt, doubt_of_one_surface, settle, wake
from .events import NO_EVENT, land
from .grazing import RECORDS, watch
from .switching import begin_on_surface, enter, leave, pass_event, project

FREE, GENERAL, BEGIN, SURFACES = range(4)
"""Which function an address belongs to; that of FREE is 0 where GENERAL does for all lanes."""

CONTEXT = 12  # numbers, and one more for each surface
MANY = 512
"""Steps, or events, from which on a lane without a right digit is given up: after a blow-up they never end."""

_HUGE = 1e6  # growth of a state that blows up, if its steps do not lead it to the end

COUNT, WATCHED = 6, 11
"""Places in the context of the number of surfaces, and of the address of what is kept of grazing (0 for nothing)."""


@inlined
def _piece(whole, begin, size):
    return whole[begin : begin + size], begin + size


@inlined
def _step(addresses, lanes, series, p, end, rate, used, size, count, flag):
    """Take a step; which one a lane takes is its own affair: an image must not depend on its neighbours."""
    for i in range(used):
        series[flag + i] = 0.0
    if addresses[FREE] == 0:
        call_step(addresses[GENERAL], lanes, series, p, end, rate, used)
        return
    sliding = 0
    for i in range(used):
        slides = 0.0
        for e in range(count):
            slides += lanes[(size + 1 + count + e) * LANES + i]
        sliding += slides > 0.0
    if sliding < used:
        call_step(addresses[FREE], lanes, series, p, end, rate, used)
    if sliding > 0:
        call_step(addresses[GENERAL], lanes, series, p, end, rate, used)


@inlined
def _load(lanes, i, state, signs, slides, errors, fresh):
    """Copy a lane to arrays of its own; return its time."""
    size, count = state.size, signs.size
    for j in range(size):
        state[j] = lanes[j * LANES + i]
        errors[j] = lanes[(size + 1 + 2 * count + j) * LANES + i]
    for e in range(count):
        signs[e] = lanes[(size + 1 + e) * LANES + i]
        slides[e] = lanes[(size + 1 + count + e) * LANES + i]
    for e in range(count + 1):
        fresh[e] = lanes[(2 * size + 1 + 2 * count + e) * LANES + i]
    return lanes[size * LANES + i]


@inlined
def _store(lanes, i, t, state, signs, slides, errors, fresh):
    """Copy the arrays of a lane back."""
    size, count = state.size, signs.size
    for j in range(size):
        lanes[j * LANES + i] = state[j]
        lanes[(size + 1 + 2 * count + j) * LANES + i] = errors[j]
    lanes[size * LANES + i] = t
    for e in range(count):
        lanes[(size + 1 + e) * LANES + i] = signs[e]
        lanes[(size + 1 + count + e) * LANES + i] = slides[e]
    for e in range(count + 1):
        lanes[(2 * size + 1 + 2 * count + e) * LANES + i] = fresh[e]


@inlined
def _is_lost(state, errors):
    """Tell whether a state is not finite, or has no right digit, as after a blow-up between two steps."""
    size, error = 1.0, 0.0
    for j in range(state.size):
        size += abs(state[j])
        error += abs(errors[j])
    return not error < size


@functools.cache
def period(single):
    """Return the function ``advance`` for one switching function, whose loops over surfaces vanish, or for several."""

    @loop_by_address(PERIOD)
    def advance(context, blocks_of_states, steps, start, period, p, blocks_of_errors, orbits):
        """Move blocks of states on by a period; no steps at all stand for a trial step, in which events do not count.

        The context holds the four addresses, the numbers of state variables (with those of tangent vectors), of
        coordinates and of surfaces, the order, whether lanes that slide are brought back at the end, whether surfaces
        depend on the sides of others, the address of impacts or 0, that of what :mod:`.grazing` keeps of each orbit or
        0; for each surface what its switch does; and, surface by surface, the sign with which each switch leaves it
        together with the state that leaves a rest there, 0 where a rest leaves the switch alone.
        """
        addresses = array_at(context, CONTEXT)
        size, dimension, order, project_at_end = addresses[4], addresses[5], addresses[7], addresses[8]
        coupled, impacts = 0 if single else addresses[9], addresses[10]
        count = 1 if single else addresses[COUNT]
        watched = addresses[WATCHED]
        kept = array_at(watched, orbits * RECORDS * count)
        described = array_at(context, CONTEXT + count + count * count)
        counts, bound = described[CONTEXT : CONTEXT + count], described[CONTEXT + count :]
        blocks = -(-orbits // LANES)
        x, error = array_at(blocks_of_states, (blocks, size, LANES)), array_at(blocks_of_errors, (blocks, size, LANES))
        length = order + 1
        local = (size + count) * length
        moved = (local + size) * LANES  # by the last step, 0 where a lane is at the end
        flag = moved + 2 * LANES
        errors_row = size + 1 + 2 * count
        end = start + period
        shared = (2 * size + 3 * count + 2) * LANES
        rows = ((size + count) * length + size + 3 + count) * LANES
        whole = np.zeros(shared + rows + 2 * size + 10 * count + 1 + length + 4 * count * dimension)
        gains, jumps, normals = np.zeros((count, count)), np.zeros((count, dimension)), np.zeros((count, dimension))
        place = 0
        lanes, place = _piece(whole, place, shared)
        series, place = _piece(whole, place, rows)
        state, place = _piece(whole, place, size)
        errors, place = _piece(whole, place, size)
        values, place = _piece(whole, place, count)
        rates, place = _piece(whole, place, count)
        signs, place = _piece(whole, place, count)
        slides, place = _piece(whole, place, count)
        hits, place = _piece(whole, place, count)
        on_surface, place = _piece(whole, place, count)
        held, place = _piece(whole, place, count)
        after, place = _piece(whole, place, count)
        values_before, place = _piece(whole, place, count)
        fresh, place = _piece(whole, place, count + 1)
        a, place = _piece(whole, place, length)
        jumped, place = _piece(whole, place, count * dimension)
        turned, place = _piece(whole, place, count * dimension)
        stuck, place = _piece(whole, place, count * dimension)
        bent, place = _piece(whole, place, count * dimension)
        for b in range(blocks):
            used = min(orbits - b * LANES, LANES)
            lanes[errors_row * LANES :] = 0.0
            rate = (steps[b] if steps[b] > 0 else -1) / period
            for j in range(size):
                for i in range(LANES):
                    lanes[j * LANES + i] = x[b, j, i]
            call_begin(addresses[BEGIN], lanes, series, p, start)
            for i in range(used):
                if series[flag + i] > 0.0:
                    t = _load(lanes, i, state, signs, slides, errors, fresh)
                    call_surfaces(addresses[SURFACES], t, state, p, signs, values, rates, gains, jumps, normals)
                    if coupled:
                        for e in range(count):
                            hits[e] = 1.0 if values[e] == 0.0 and counts[e] == SIGN else 0.0
                        wake(
                            addresses[SURFACES], t, state, p, signs, values, rates, gains, jumps, normals,
                            slides, hits, counts, after,
                        )  # fmt: skip
                        call_surfaces(addresses[SURFACES], t, state, p, signs, values, rates, gains, jumps, normals)
                    begin_on_surface(
                        values, rates, gains, jumps, normals, counts, signs, slides, fresh, state,
                        hits, on_surface, held, after,
                    )  # fmt: skip
                    if coupled:
                        hits[:] = 0.0
                        for e in range(count):
                            values_before[e] = values[e]
                        settle(
                            addresses[SURFACES], t, state, p, signs, values, rates, gains, jumps, normals,
                            slides, fresh, hits, counts, on_surface, values_before, after,
                        )  # fmt: skip
                    if impacts != 0:
                        begin_at_impacts(
                            impacts, addresses[SURFACES], t, state, p, counts, bound, signs, slides, fresh, values,
                            rates, gains, jumps, normals, jumped, turned, stuck, bent,
                        )  # fmt: skip
                    _store(lanes, i, t, state, signs, slides, errors, fresh)
            rounds = 8 * steps[b] + (1024 if impacts == 0 else 16384)
            moving, spent = 1, 0
            while moving and spent < rounds:
                spent += 1
                if watched != 0:
                    series[moved : moved + LANES] = 0.0
                _step(addresses, lanes, series, p, end, rate, used, size, count, flag)
                # No steps at all: one is tried, for its error alone, and no event is looked for.
                if steps[b] == 0:
                    break
                moving = 0
                for i in range(used):
                    if series[flag + i] > 0.0 or (watched != 0 and series[moved + i] > 0.0):
                        t = _load(lanes, i, state, signs, slides, errors, fresh)
                        lost = _is_lost(state, errors) and (steps[b] >= MANY or spent > steps[b] + MANY)
                        if lost or t == series[moved + LANES + i]:
                            lanes[size * LANES + i] = np.nan  # it takes no more steps, and does not arrive
                            continue
                        landed = land(
                            series[i:], state, signs, slides, counts, errors, fresh, hits, a, held, t, order, end
                        )
                        if watched != 0:
                            until = 1.0
                            if landed > NO_EVENT:
                                until = (landed - series[moved + LANES + i]) / series[moved + i]
                            else:
                                hits[:] = 0.0
                            watch(
                                series[i:], slides, counts, hits, until, a, size, order,
                                kept[(b * LANES + i) * RECORDS * count :],
                            )  # fmt: skip
                        if landed > NO_EVENT:
                            t = landed
                            if coupled:
                                doubt(
                                    addresses[SURFACES], t, state, p, signs, values, rates, gains, jumps, normals,
                                    slides, counts, errors, False,
                                )  # fmt: skip
                            call_surfaces(addresses[SURFACES], t, state, p, signs, values, rates, gains, jumps, normals)
                            project(state, errors, values, normals, gains, hits, slides, counts, on_surface, held)
                            if impacts != 0:
                                t = collide(
                                    impacts, addresses[SURFACES], t, end - 1e-12 * period, end, state, p, counts, bound,
                                    hits, signs, slides, fresh, errors, values, rates, gains, jumps, normals,
                                    jumped, turned, stuck, bent,
                                )  # fmt: skip
                            if coupled:
                                wake(
                                    addresses[SURFACES], t, state, p, signs, values, rates, gains, jumps, normals,
                                    slides, hits, counts, after,
                                )  # fmt: skip
                                call_surfaces(
                                    addresses[SURFACES], t, state, p, signs, values, rates, gains, jumps, normals
                                )
                                for e in range(count):
                                    values_before[e] = values[e]
                            entered, fallen = leave(
                                values, rates, gains, hits, counts, signs, slides, fresh, on_surface, held
                            )
                            if fallen > 0:
                                call_surfaces(
                                    addresses[SURFACES], t, state, p, signs, values, rates, gains, jumps, normals
                                )
                            if entered >= 0:
                                enter(
                                    rates, gains, hits, counts, signs, slides, fresh, on_surface, held, after
                                )  # fmt: skip
                                if count > 1:
                                    doubt_of_one_surface(
                                        values, rates, gains, jumps, normals, slides, counts, after, state, errors
                                    )  # fmt: skip
                            unsettled = False
                            if coupled:
                                unsettled = settle(
                                    addresses[SURFACES], t, state, p, signs, values, rates, gains, jumps, normals,
                                    slides, fresh, hits, counts, on_surface, values_before, after,
                                )  # fmt: skip
                            if entered >= 0:
                                gap = series[flag + (1 + entered) * LANES + i]
                                pass_event(entered, gap, rates, gains, jumps, normals, state, errors, held, after)
                            if coupled:
                                doubt(
                                    addresses[SURFACES], t, state, p, signs, values, rates, gains, jumps, normals,
                                    slides, counts, errors, unsettled,
                                )  # fmt: skip
                        _store(lanes, i, t, state, signs, slides, errors, fresh)
                    moving += lanes[size * LANES + i] < end
            if coupled and steps[b] > 0:
                for i in range(used):
                    t = _load(lanes, i, state, signs, slides, errors, fresh)
                    doubt(
                        addresses[SURFACES], t, state, p, signs, values, rates, gains, jumps, normals,
                        slides, counts, errors, False,
                    )  # fmt: skip
                    _store(lanes, i, t, state, signs, slides, errors, fresh)
            if project_at_end:
                # Lanes that slide are brought back onto their surfaces, where rounding has led away.
                for i in range(used):
                    t = _load(lanes, i, state, signs, slides, errors, fresh)
                    sliding = 0.0
                    for e in range(count):
                        sliding = max(sliding, slides[e])
                    if sliding > 0.0:
                        hits[:] = 0.0
                        call_surfaces(addresses[SURFACES], t, state, p, signs, values, rates, gains, jumps, normals)
                        project(state, errors, values, normals, gains, hits, slides, counts, on_surface, held)
                        for j in range(size):
                            lanes[j * LANES + i] = state[j]
            for i in range(used):
                through, before, total = lanes[size * LANES + i] >= end, 1.0, 0.0
                for j in range(size):
                    before += abs(x[b, j, i])
                    x[b, j, i] = lanes[j * LANES + i]
                    error[b, j, i] = lanes[(errors_row + j) * LANES + i] if through else 1e300
                    total += abs(x[b, j, i])
                if not through and _HUGE * before < total < np.inf:
                    error[b, 0, i] = BLOWN_UP

    return advance
