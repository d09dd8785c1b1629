"""Whole periods of a batch of orbits in one call: from states to images, with the steps that each orbit needs.

What belongs to a system is called by address, as :mod:`cellmap._compiled.codegen.period` describes it; what is here is
compiled once for all systems.  Orbits are changed in place: ``points`` (n, d), ``rotations`` (n, d) taken out of
angles, ``status`` (n,), of which those from ESCAPED on have ended and are left alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..loops import inlined, loop
from .blocks import LANES, pack, unpack, wrap_angle
from .calls import call_period
from .step_numbers import DIVERGED as NOT_FINITE
from .step_numbers import MISSED, next_rungs, sort_by_rung

INACCURATE, ESCAPED, DIVERGED, OUT_OF_STEPS = 1, 2, 3, 5
"""What :class:`cellmap.maps.orbit_batch.Status` says of an orbit, as the numbers that kernels write."""

PROBE = 16
"""One step of this part of the time tells how many steps the whole of it will take."""


class Motion(NamedTuple):
    """What a system is integrated with.

    Parameters
    ----------
    function, context : int, ndarray of int64
        Address of the compiled period, and what it is called with.
    parameters : ndarray
        Parameters of the right-hand side.
    begin, length : float
        Time at which the period begins, and its length.
    largest : ndarray, shape (d,)
        Size up to which a component counts in the relative tolerance.
    rtol, atol : float
        Tolerances of the error estimate.
    digit : float
        Ratio of error to tolerance from which on an image has no right digit.
    ladder : ndarray of int64
        Numbers of steps to choose from.
    lowest, probe, highest_climb : int
        Lowest rung; rung of PROBE steps; rungs that are climbed at once.
    order : int
        Order at which the error estimate shrinks.
    safety : float
        Factor by which the expected error of the chosen steps is under the tolerance.
    trial : int
        Number of steps that asks for one step whose error alone is wanted.
    """

    function: int
    context: NDArray[np.int64]
    parameters: NDArray[np.float64]
    begin: float
    length: float
    largest: NDArray[np.float64]
    rtol: float
    atol: float
    digit: float
    ladder: NDArray[np.int64]
    lowest: int
    probe: int
    highest_climb: int
    order: int
    safety: float
    trial: int


@loop
def integrate(motion, points, rotations, status, lower, turn, periods):
    """Integrate orbits over some periods; return the steps that all of them took together.

    An orbit whose tolerance is not met is marked INACCURATE; one that is not finite, or has an angle without phase, has
    DIVERGED; one that is finite, but not at the end of the period or without a right digit, is OUT_OF_STEPS.
    ``lower`` and ``turn`` are branch cuts and periods of the coordinates; those of period 0 are not wrapped.
    """
    n, d = points.shape
    initial, ratios, before = np.empty((n, d)), np.empty(n), np.empty((n, 2))
    living, members, ordered = np.empty(n, np.int64), np.empty(n, np.int64), np.empty(n, np.int64)
    taken, rungs = np.empty(n, np.int64), np.empty(n, np.int64)
    ends = np.empty(motion.ladder.size, np.int64)
    blocks = np.empty((-(-n // LANES), d, LANES))
    errors, numbers = np.empty_like(blocks), np.empty(len(blocks), np.int64)
    total = 0
    for _ in range(periods):
        alive = _living(status, living)
        if alive == 0:
            break
        for m in range(alive):
            k = living[m]
            members[m], taken[m] = k, motion.probe
            for j in range(d):
                initial[k, j] = points[k, j]
            before[k, 0] = before[k, 1] = -1.0
        shortened = motion.length / PROBE
        _images(motion, initial, members[:alive], motion.trial, shortened, blocks, errors, numbers, points, ratios)
        total += alive
        for m in range(alive):
            ratios[living[m]] *= PROBE
        left, first = alive, True
        while left > 0:
            next_rungs(
                members[:left], taken, ratios, before, motion.order, first, motion.lowest, motion.ladder, motion.safety,
                motion.highest_climb, rungs,
            )  # fmt: skip
            if not first:
                for m in range(left):
                    k = members[m]
                    if rungs[m] == MISSED:
                        status[k] = INACCURATE
                        if ratios[k] > motion.digit:
                            _end(points, status, k, OUT_OF_STEPS)
                    elif rungs[m] == NOT_FINITE:
                        # The ratio is infinite for one that has not arrived, and NaN where it is nowhere.
                        _end(points, status, k, OUT_OF_STEPS if ratios[k] == np.inf else DIVERGED)
            sort_by_rung(members[:left], rungs[:left], motion.ladder.size, ordered, taken, ends)
            members, ordered = ordered, members
            first, begin = False, 0
            for rung in range(motion.ladder.size):
                end = ends[rung]
                if end > begin:
                    steps = motion.ladder[rung]
                    some = members[begin:end]
                    _images(motion, initial, some, steps, motion.length, blocks, errors, numbers, points, ratios)
                    for b in range(-(-some.size // LANES)):
                        total += numbers[b] * min(LANES, some.size - b * LANES)
                    begin = end
            left = begin
        for m in range(alive):
            if status[living[m]] < ESCAPED:
                _wrap(points, rotations, status, living[m], lower, turn)
    return total


@loop
def iterate(function, context, parameters, bound, points, rotations, status, lower, turn, periods):
    """Apply a discrete map to orbits some times; return how often it was applied.

    An orbit that is not smaller than ``bound`` has DIVERGED, as one whose angle has no phase.
    """
    n, d = points.shape
    living = np.empty(n, np.int64)
    block, error, once = np.empty((1, d, LANES)), np.empty((1, d, LANES)), np.ones(1, np.int64)
    alive = _living(status, living)
    total = 0
    for begin in range(0, alive, LANES):
        members = living[begin : min(begin + LANES, alive)]
        pack(points, members, block)
        for _ in range(periods):
            call_period(function, context, block, once, 0.0, 1.0, parameters, error, members.size)
            moving = 0
            for i in range(members.size):
                k = members[i]
                if status[k] >= ESCAPED:
                    continue
                total += 1
                inside = True
                for j in range(d):
                    points[k, j] = block[0, j, i]
                    inside &= abs(points[k, j]) < bound
                if not inside:
                    _end(points, status, k, DIVERGED)
                elif _wrap(points, rotations, status, k, lower, turn):
                    moving += 1
                    for j in range(d):
                        block[0, j, i] = points[k, j]
            if moving == 0:
                break
    return total


@inlined
def _living(status, living):
    """Write the numbers of those orbits that have a point; return how many there are."""
    alive = 0
    for k in range(status.size):
        if status[k] < ESCAPED:
            living[alive] = k
            alive += 1
    return alive


@loop
def _images(motion, initial, members, steps, length, blocks, errors, numbers, images, ratios):
    """Integrate some orbits over a time with a number of steps, in full blocks of lanes.

    ``numbers`` receives the steps that each block took.
    """
    used = -(-members.size // LANES)
    blocks, errors = blocks[:used], errors[:used]
    numbers[:used] = steps
    pack(initial, members, blocks)
    call_period(
        motion.function, motion.context, blocks, numbers, motion.begin, length, motion.parameters, errors, members.size
    )  # fmt: skip
    unpack(blocks, errors, members, images, ratios, motion.largest, motion.rtol, motion.atol)


@inlined
def _wrap(points, rotations, status, k, lower, turn):
    """Wrap the angles of an orbit, or terminate it where one has no phase; return whether it is still active."""
    for j in range(points.shape[1]):
        if not wrap_angle(points, rotations, k, j, lower[j], turn[j]):
            _end(points, status, k, DIVERGED)
            return False
    return True


@inlined
def _end(points, status, k, reason):
    status[k] = reason
    for j in range(points.shape[1]):
        points[k, j] = np.nan
