"""One period of a discontinuous right-hand side, for many initial conditions in SIMD lanes.

What belongs to a system is generated and called by address, see :mod:`cellmap._compiled.codegen.switching`; everything
else is here and compiled once for all systems.  Each lane has its own time and its own mode, and all lanes of a block
take a Taylor step together.  The step also says in which lanes an event may lie.  Only these are looked at one by one:
the first root of the event's polynomial is found, the lane is taken back to it, its mode changes, and it goes on from
there with the next step of its block.  So every step lies in one mode, events are located to the accuracy of the
series, and the order of the method holds across them.

Rows of ``lanes``, LANES numbers each: states, time, signs, slides, sums of local errors, and the entries of ``fresh``.
Rows of ``series``: coefficients of states and of events, local errors, step, time before the step, the flag of an
event, and how far the function of each event is known.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..loops import inlined, loop_by_address
from .blocks import BLOWN_UP, END_PLACE, LANES
from .calls import PERIOD, array_at, call_begin, call_step
from .collisions import begin_at_impacts, collide
from .coupled_switches import doubt, doubt_of_one_surface, settle, wake
from .events import NO_EVENT, land
from .grazing import RECORDS, watch
from .lane import ENDS, SIGN, Event, Jumps, Lane, Surfaces, load, look, store, system_of
from .switching import begin_on_surface, enter, leave, pass_event, project

MANY = 512
"""Steps, or events, from which on a lane without a right digit is given up: after a blow-up they never end."""

_HUGE = 1e6  # growth of a state that blows up, if its steps do not lead it to the end


class Block(NamedTuple):
    """A block of lanes, of which some are used; the first row of errors, and places of steps and of flags of events.

    The step of a lane at the end is 0.
    """

    lanes: NDArray[np.float64]
    series: NDArray[np.float64]
    used: int
    errors: int
    moved: int
    flag: int


class Span(NamedTuple):
    """End of the period, the time from which on impacts are left to the next one, and how many steps it takes."""

    end: float
    last: float
    steps: int


class Workspace(NamedTuple):
    """Room for one lane after the other."""

    lane: Lane
    surfaces: Surfaces
    event: Event
    jumps: Jumps


@inlined
def _workspace(of_states, of_surfaces, gains, of_both, flow, fresh, coefficients, of_impacts):
    state, errors = of_states
    values, rates, signs, slides, hits, on_surface, before, after, earlier = of_surfaces
    jumps, normals = of_both
    landed, turned, stuck, held = of_impacts
    return Workspace(
        Lane(state, errors, signs, slides, fresh),
        Surfaces(values, rates, gains, jumps, normals, flow),
        Event(hits, on_surface, before, after, earlier, coefficients),
        Jumps(landed, turned, stuck, held),
    )


@inlined
def _step(system, block, end, rate):
    """Take a step; which one a lane takes is its own affair: an image must not depend on its neighbours."""
    lanes, series, used, size, count = block.lanes, block.series, block.used, system.size, system.switches
    for i in range(used):
        series[block.flag + i] = 0.0
    if system.free == 0:
        call_step(system.general, lanes, series, system.p, end, rate, used)
        return
    sliding = 0
    for i in range(used):
        slides = 0.0
        for e in range(count):
            slides += lanes[(size + 1 + count + e) * LANES + i]
        sliding += slides > 0.0
    if sliding < used:
        call_step(system.free, lanes, series, system.p, end, rate, used)
    if sliding > 0:
        call_step(system.general, lanes, series, system.p, end, rate, used)


@inlined
def _begin(system, block, work, start, end):
    """Choose the modes in which the lanes of a block begin."""
    lane, surfaces, event, _ = work
    call_begin(system.begin, block.lanes, block.series, system.p, start)
    for i in range(block.used):
        if block.series[block.flag + i] > 0.0:
            t = load(block.lanes, i, lane)
            look(system, t, lane, surfaces)
            if system.coupled:
                for e in range(system.switches):
                    event.hits[e] = 1.0 if surfaces.values[e] == 0.0 and system.kinds[e] == SIGN else 0.0
                wake(system, t, lane, surfaces, event)
                look(system, t, lane, surfaces)
            begin_on_surface(system, lane, surfaces, event)
            if system.coupled:
                event.hits[:] = 0.0
                event.values[:] = surfaces.values
                unsettled = settle(system, t, lane, surfaces, event)
                doubt(system, t, lane, surfaces, unsettled)
            if system.impacts != 0:
                t = begin_at_impacts(system, t, lane, surfaces, work.jumps, end)
            store(block.lanes, i, t, lane)


@inlined
def _is_lost(lane):
    """Tell whether a state is not finite, or has no right digit, as after a blow-up between two steps."""
    size, error = 1.0, 0.0
    for j in range(lane.state.size):
        size += abs(lane.state[j])
        error += abs(lane.errors[j])
    return not error < size


@inlined
def _visit(system, block, i, work, span, spent, records):
    """Look at a lane after a step in which an event may lie, and take it through the first one that does."""
    lane, event, series = work.lane, work.event, block.series[i:]
    t, begun = load(block.lanes, i, lane), series[block.moved + LANES]
    if (_is_lost(lane) and (span.steps >= MANY or spent > span.steps + MANY)) or t == begun:
        block.lanes[system.size * LANES + i] = np.nan  # it takes no more steps, and does not arrive
        return
    landed = land(system, series, lane, event, span.end)
    if system.watched != 0:
        until = 1.0
        if landed > NO_EVENT:
            until = (landed - begun) / series[block.moved]
        else:
            event.hits[:] = 0.0
        watch(system, series, lane, event, until, records)
    if landed > NO_EVENT:
        t = _pass(system, landed, work, span, series[block.flag + LANES :])
    store(block.lanes, i, t, lane)


@inlined
def _pass(system, t, work, span, gaps):
    """Take a lane through an event, to the mode that follows; return its time then."""
    lane, surfaces, event, jumps = work
    if system.coupled:
        doubt(system, t, lane, surfaces, False)
    look(system, t, lane, surfaces)
    project(system, lane, surfaces, event)
    if system.impacts != 0:
        t = collide(system, t, lane, surfaces, event, jumps, span)
    if system.coupled:
        wake(system, t, lane, surfaces, event)
        look(system, t, lane, surfaces)
        event.values[:] = surfaces.values
    entered, fallen = leave(system, lane, surfaces, event)
    if fallen > 0:
        look(system, t, lane, surfaces)
    if entered >= 0:
        enter(system, lane, surfaces, event)
        if system.switches > 1:
            doubt_of_one_surface(system, lane, surfaces, event.after)
    unsettled = False
    if system.coupled:
        unsettled = settle(system, t, lane, surfaces, event)
    if entered >= 0:
        pass_event(system, t, entered, gaps[entered * LANES], lane, surfaces, event)
    if system.coupled:
        doubt(system, t, lane, surfaces, unsettled)
    return t


@inlined
def _end(system, block, work, is_trial):
    """Doubt lanes between two modes; bring lanes that slide back onto their surfaces, where rounding has led away."""
    lane, surfaces, event, _ = work
    if system.coupled and not is_trial:
        for i in range(block.used):
            t = load(block.lanes, i, lane)
            doubt(system, t, lane, surfaces, False)
            store(block.lanes, i, t, lane)
    if system.projects:
        for i in range(block.used):
            t = load(block.lanes, i, lane)
            sliding = 0.0
            for e in range(system.switches):
                sliding = max(sliding, lane.slides[e])
            if sliding > 0.0:
                event.hits[:] = 0.0
                look(system, t, lane, surfaces)
                project(system, lane, surfaces, event)
                for j in range(system.size):
                    block.lanes[j * LANES + i] = lane.state[j]


@inlined
def _hand_back(system, block, end, states, errors):
    """Copy states and errors (size, LANES) of a block back."""
    for i in range(block.used):
        through, before, total = block.lanes[system.size * LANES + i] >= end, 1.0, 0.0
        for j in range(system.size):
            before += abs(states[j, i])
            states[j, i] = block.lanes[j * LANES + i]
            errors[j, i] = block.lanes[(block.errors + j) * LANES + i] if through else 1e300
            total += abs(states[j, i])
        number = 0.0
        for e in range(system.switches):
            if system.kinds[e] == ENDS:
                number += 1.0
                if block.lanes[(system.size + 1 + e) * LANES + i] < 0.0:
                    states[0, i] = number * END_PLACE
        if not through and _HUGE * before < total < np.inf:
            errors[0, i] = BLOWN_UP


@functools.cache
def period(single):
    """Return the function ``advance`` for one switching function, whose loops over surfaces vanish, or for several."""

    @loop_by_address(PERIOD)
    def advance(context, blocks_of_states, steps, start, period, p, blocks_of_errors, orbits):
        """Move blocks of states on by a period; no steps at all stand for a trial step, in which events do not count.

        The context is that of a :class:`.lane.System`.
        """
        system = system_of(context, p, single)
        size, count = system.size, system.switches
        blocks, end = -(-orbits // LANES), start + period
        x, error = array_at(blocks_of_states, (blocks, size, LANES)), array_at(blocks_of_errors, (blocks, size, LANES))
        kept = array_at(system.watched, orbits * RECORDS * count)
        local = (size + count) * (system.order + 1)
        moved = (local + size) * LANES
        lanes, series = np.zeros((2 * size + 3 * count + 2) * LANES), np.zeros((local + size + 3 + count) * LANES)
        work = _workspace(
            np.zeros((2, size)),
            np.zeros((9, count)),
            np.zeros((count, count)),
            np.zeros((2, count, system.dimension)),
            np.zeros(system.dimension),
            np.zeros(count + 1),
            np.zeros(system.order + 1),
            np.zeros((4, count * system.dimension)),
        )
        for b in range(blocks):
            used = min(orbits - b * LANES, LANES)
            block = Block(lanes, series, used, size + 1 + 2 * count, moved, moved + 2 * LANES)
            span = Span(end, end - 1e-12 * period, steps[b])
            rate = (steps[b] if steps[b] > 0 else -1) / period
            lanes[block.errors * LANES :] = 0.0
            for j in range(size):
                for i in range(LANES):
                    lanes[j * LANES + i] = x[b, j, i]
            _begin(system, block, work, start, end)
            rounds = 8 * steps[b] + (1024 if system.impacts == 0 else 16384)
            moving, spent = 1, 0
            while moving and spent < rounds:
                spent += 1
                if system.watched != 0:
                    series[moved : moved + LANES] = 0.0
                _step(system, block, end, rate)
                # No steps at all: one is tried, for its error alone, and no event is looked for.
                if steps[b] == 0:
                    break
                moving = 0
                for i in range(used):
                    if series[block.flag + i] > 0.0 or (system.watched != 0 and series[moved + i] > 0.0):
                        records = kept[(b * LANES + i) * RECORDS * count :]
                        _visit(system, block, i, work, span, spent, records)
                    moving += lanes[size * LANES + i] < end
            _end(system, block, work, steps[b] == 0)
            _hand_back(system, block, end, x[b], error[b])

    return advance
