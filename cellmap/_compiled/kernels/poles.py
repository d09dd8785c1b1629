"""Orbits that come to a singularity of their right-hand side, where they end.

Equal steps may pass over a pole, and land anywhere behind it.  Steps that are as long as their own error allows become
shorter and shorter before it, in proportion to the time that is left.
"""

from __future__ import annotations

import numpy as np

from ..loops import loop
from .blocks import BLOWN_UP, FARTHEST_STATE, LANES, RESOLVED_AGAIN, ROUNDED, UNRESOLVED, pack, unpack
from .calls import call_period

SEEN_NOTHING, ENDED, ARRIVED = range(3)
"""What has become of an orbit: it is not known, it ended within the period, or came to the end of it."""

_ERROR = 1e-9  # error of a step, relative to the state; steps below rounding would pass jumps, which are no poles
_FIRST = 1.0 / 16  # first step, as a fraction of the period
_SHORTEN, _LENGTHEN = 0.1, 5.0
_UNRESOLVED = 2.0  # factor by which a step is shortened that passes over something


@loop
def follow_alone(motion, initial, k, most, place):
    """Follow an orbit through a period by steps of its own; return its fate, and the steps taken.

    There are at most so many steps, besides those without which part of the forcing might not be seen.  It ends where
    no step that is longer than the rounding of times has a small error, or where it is too far away.  ``place`` (1, d)
    receives where it is then.
    """
    d = initial.shape[1]
    moved, ratios = np.empty((1, d)), np.empty(1)
    block, errors = np.empty((1, d, LANES)), np.empty((1, d, LANES))
    alone, once = np.zeros(1, np.int64), np.empty(1, np.int64)
    for j in range(d):
        place[0, j] = initial[k, j]
    length, fewest, time = motion.length, motion.ladder[motion.lowest], 0.0
    longest, most = length / fewest, most + fewest
    least, h = ROUNDED * length, _FIRST * length
    for count in range(1, most + 1):
        h = min(h, longest, length - time)
        pack(place, alone, block)
        once[0] = 1
        span = (motion.begin + time, h)
        call_period(motion.function, motion.context, block, once, span, motion.parameters, errors, 1)
        unpack(motion, block, errors, alone, moved, ratios)
        if ratios[0] == BLOWN_UP:
            return ENDED, count
        if ratios[0] == np.inf and not h > least:
            return SEEN_NOTHING, count  # events without end
        error = ratios[0] / (_ERROR * motion.digit)
        for j in range(d):
            if UNRESOLVED < errors[0, j, 0] < RESOLVED_AGAIN:
                error = max(error, _UNRESOLVED ** (motion.order + 1))
        if error <= 1.0:
            time += h
            for j in range(d):
                place[0, j] = moved[0, j]
                if not abs(place[0, j]) < FARTHEST_STATE:
                    return ENDED, count
            if length - time <= least:
                return ARRIVED, count
        elif not h > least:
            # What hardly moves comes to no pole: the error is that of jumps which hold the orbit.
            rests = True
            for j in range(d):
                if not abs(moved[0, j] - place[0, j]) <= _ERROR * (abs(initial[k, j]) + abs(place[0, j])):
                    rests = False
            return SEEN_NOTHING if rests else ENDED, count
        change = _SHORTEN
        if error < np.inf:
            change = 0.8 * max(error, 1e-30) ** (-1.0 / (motion.order + 1))
        h = max(min(max(change, _SHORTEN), _LENGTHEN) * h, 0.5 * least)
    return SEEN_NOTHING, most


@loop
def follow_coarsely(motion, initial, members, places, fates):
    """Follow orbits through a period by a method with steps of its own, to a coarse tolerance; return the steps of all.

    ``places`` (n, d) and ``fates`` (n,) receive where they are then, and what has become of them.
    """
    n, d = members.size, initial.shape[1]
    used = -(-n // LANES)
    ratios, block, errors = np.empty(n), np.empty((used, d, LANES)), np.empty((used, d, LANES))
    rows, taken = np.empty(n, np.int64), np.ones(used, np.int64)
    pack(initial, members, block)
    span = (motion.begin, motion.length)
    call_period(motion.function, motion.coarse, block, taken, span, motion.parameters, errors, n)
    total = 0
    for m in range(n):
        rows[m] = m
        total += taken[m // LANES]
    unpack(motion, block, errors, rows, places, ratios)
    for m in range(n):
        fates[m] = ARRIVED if ratios[m] < np.inf else SEEN_NOTHING if ratios[m] == np.inf else ENDED
    return total
