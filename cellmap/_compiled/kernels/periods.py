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
from .blocks import BLOWN_UP, END_PLACE, FARTHEST_STATE, LANES, ROUNDED, pack, unpack, wrap_angle
from .calls import call_period
from .poles import ARRIVED, SEEN_NOTHING, follow_alone, follow_coarsely
from .poles import ENDED as AT_POLE
from .step_numbers import ASYMPTOTIC, MET, next_rungs, sort_by_rung
from .step_numbers import DIVERGED as NOT_FINITE

INACCURATE, ESCAPED, DIVERGED, OUT_OF_STEPS, ENDED = 1, 2, 3, 5, 6
"""What :class:`cellmap.maps.orbit_batch.Status` says of an orbit, as the numbers that kernels write."""

MOST_ENDS = 16
"""Ends that a system may have: each has a status, ENDED and those after it, and a label."""

UNCHECKED, CHOSEN, COMPARED, DIFFERED = range(4)
"""Whether an orbit is integrated with a second number of steps: no, yes, it was, or with more still."""

_SPLIT = 134217729.0  # 2**27 + 1: what is left of a product with it are the last digits of a number (Veltkamp 1968)

PROBE = 16
"""One step of this part of the time tells how many steps the whole of it will take."""

ONE_DIGIT = 0.1
"""Part of its size by which the images of two numbers of steps differ at most, if a digit of them is right."""

_DOUBTFUL = 1e-3
"""Error, as a part of the image's size, from which on it is seen what becomes of an orbit that misses its tolerance.

That of the round before counts as well: across a pole an estimate may be small by accident."""

_SOON, _LONG = 512, 8192
"""Steps in which that is seen: of an orbit that goes on with more steps, and of one that is given up."""

NONE, NOWHERE = np.zeros(1, np.int64), np.zeros(1)
"""Arrays of what is not there: a motion, a map, a table."""


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
    rtol : float
        Relative tolerance of the error estimate.
    atol : ndarray, shape (d,)
        Absolute tolerance of it, for each component.
    digit : float
        Ratio of error to tolerance from which on an image has no right digit.
    ladder : ndarray of int64
        Numbers of steps to choose from.
    powers : ndarray
        These to the power of the order.
    lowest, probe, highest_climb : int
        Lowest rung; rung of PROBE steps; rungs that are climbed at once.
    order : int
        Order at which the error estimate shrinks.
    safety : float
        Factor by which the expected error of the chosen steps is under the tolerance.
    trial : int
        Number of steps that asks for one step whose error alone is wanted.
    checked : float
        Fraction of the orbits whose images are compared with those of more steps.
    more : float
        Ratio that asks for these.
    agreement : float
        Difference of two images, in tolerances of the error estimate, as a ratio that has to be at most 1.
    floor : ndarray, shape (d,)
        Size below which nothing is known of a component that stays zero where it is; 0 for the others.
    lost : ndarray of int64, shape (d,)
        Receives 1 for a component that was smaller, and is larger again.
    coarse : ndarray of int64
        The context for a tolerance of steps that rounding leaves room for, by which is seen whether an orbit ends,
        where each has steps of its own, and numbers of steps stand for finer tolerances; of one number for other
        methods.
    price : int
        Steps of the usual method that take as long as one of the method for stiff systems.
    hands_over : int
        1 where another method takes the orbits that no number of steps does for.
    unstable : int
        Rung from which on an image that is not finite tells that none does.
    """

    function: int = 0
    context: NDArray[np.int64] = NONE
    parameters: NDArray[np.float64] = NOWHERE
    begin: float = 0.0
    length: float = 0.0
    largest: NDArray[np.float64] = NOWHERE
    rtol: float = 0.0
    atol: NDArray[np.float64] = NOWHERE
    digit: float = 0.0
    ladder: NDArray[np.int64] = NONE
    powers: NDArray[np.float64] = NOWHERE
    lowest: int = 0
    probe: int = 0
    highest_climb: int = 0
    order: int = 0
    safety: float = 0.0
    trial: int = 0
    checked: float = 0.0
    more: float = 0.0
    agreement: float = 0.0
    floor: NDArray[np.float64] = NOWHERE
    lost: NDArray[np.int64] = NONE
    coarse: NDArray[np.int64] = NONE
    price: int = 1
    hands_over: int = 0
    unstable: int = 0


class Motions(NamedTuple):
    """What a system is integrated with, and the method for stiff systems that takes orbits which are handed over."""

    usual: Motion = Motion()
    stiff: Motion = Motion()


class CompiledMap(NamedTuple):
    """A discrete map: a compiled function, what it is called with, and the size from which on orbits have diverged."""

    function: int = 0
    context: NDArray[np.int64] = NONE
    parameters: NDArray[np.float64] = NOWHERE
    bound: float = 0.0


class PeriodWorkspace(NamedTuple):
    """Data of orbits in a period, by their numbers or, of those that still need steps, by their places.

    By number: ``initial`` points (n, d); ``ratios`` of error to tolerance; ratio and steps of the round ``before``
    (n, 2); images of fewer steps, ``earlier``; ``checks``, whether these are compared; in how many steps what becomes
    of the orbit was ``seen``.  By place: rungs ``taken`` and next ``rungs``, and where those of a rung end in the order
    of rungs.  ``aside`` has room for numbers of orbits that are put aside.  ``blocks``, their ``errors``
    and ``numbers`` of steps are what the compiled period is called with.
    """

    initial: NDArray[np.float64]
    ratios: NDArray[np.float64]
    before: NDArray[np.float64]
    earlier: NDArray[np.float64]
    checks: NDArray[np.int64]
    seen: NDArray[np.int64]
    taken: NDArray[np.int64]
    rungs: NDArray[np.int64]
    ends: NDArray[np.int64]
    aside: NDArray[np.int64]
    blocks: NDArray[np.float64]
    errors: NDArray[np.float64]
    numbers: NDArray[np.int64]


@loop
def integrate(motions, points, rotations, status, small, lower, turn, periods):
    """Integrate orbits over some periods; return the work of all of them together, in steps of the usual method.

    An orbit whose tolerance is not met is marked INACCURATE; one that ends at a singularity, or has an angle without
    phase or a coordinate from 1e100 on, has DIVERGED; one that is not seen to, and is not at the end of the period or
    has no right digit, is OUT_OF_STEPS.

    Which orbits are checked, by the images of two numbers of steps, and in each period which are handed over, follows
    from their states alone.
    ``lower`` and ``turn`` are branch cuts and periods of the coordinates; those of period 0 are not wrapped.
    ``small`` (n, d) remembers which components are below their floor, see :func:`notice`; it may be empty.
    """
    n, d = points.shape
    usual, stiff = motions
    living, members, ordered = np.empty(n, np.int64), np.empty(n, np.int64), np.empty(n, np.int64)
    checks, taken, rungs = np.empty(n, np.int64), np.empty(n, np.int64), np.empty(n, np.int64)
    blocks = np.empty((-(-n // LANES), d, LANES))
    batch = PeriodWorkspace(
        np.empty((n, d)),
        np.empty(n),
        np.empty((n, 2)),
        np.empty((n if usual.checked > 0.0 else 0, d)),
        checks,
        np.empty(n, np.int64),
        taken,
        rungs,
        np.empty(max(usual.ladder.size, stiff.ladder.size), np.int64),
        np.empty(n, np.int64),
        blocks,
        np.empty_like(blocks),
        np.empty(len(blocks), np.int64),
    )
    total = 0
    if small.size > 0:
        notice(usual, points, status, small)
    for _ in range(periods):
        alive = _living(status, living)
        if alive == 0:
            break
        steps, handed = _images_of_a_period(usual, batch, points, status, living[:alive], members, ordered)
        total += steps
        if handed > 0:
            steps, _ = _images_of_a_period(stiff, batch, points, status, batch.aside[:handed], members, ordered)
            total += stiff.price * steps
        for m in range(alive):
            if status[living[m]] < ESCAPED:
                _wrap(points, rotations, status, living[m], lower, turn)
        if small.size > 0:
            notice(usual, points, status, small)
    return total


@loop
def _images_of_a_period(motion, batch, points, status, living, members, ordered):
    """Move some orbits on by a period, each with the steps that it needs.

    Returns the steps of all, and how many are handed over to another method, at their initial points still.
    """
    total = left = living.size
    _begin(motion, batch, points, living, members[:left])
    handed, first = 0, True
    while left > 0:
        if motion.checked > 0.0 and not first:
            _compare(motion, batch, points, members[:left])
        next_rungs(motion, batch, members[:left], first)
        if motion.hands_over and not first:
            handed = _hand_over(motion, batch, points, members[:left], handed)
        if not first:
            total += _give_up(motion, batch, points, status, members[:left])
        sort_by_rung(members[:left], batch.rungs[:left], motion.ladder.size, ordered, batch.taken, batch.ends)
        members, ordered = ordered, members
        first = False
        total += _climb(motion, batch, points, members)
        left = batch.ends[motion.ladder.size - 1]
    return total, handed


@loop
def sample(motions, begins, points, rotations, status, small, turn, states):
    """Integrate orbits over stretches of time one after the other, as by :func:`integrate`; return the steps of all.

    The stretches have the length of the motions and begin at the times ``begins`` (m,); ``states`` (n, m, d) receives
    the states at their ends, angles unwrapped.  Angles are not wrapped either.
    """
    n, d = points.shape
    anywhere, total = np.zeros(d), 0
    for m in range(begins.size):
        stretch = Motions(motions.usual._replace(begin=begins[m]), motions.stiff._replace(begin=begins[m]))
        total += integrate(stretch, points, rotations, status, small, anywhere, anywhere, 1)
        for k in range(n):
            for j in range(d):
                states[k, m, j] = points[k, j] + rotations[k, j] * turn[j]
    return total


@inlined
def _begin(motion, batch, points, living, members):
    """Begin a period, with a trial step of each orbit."""
    for m in range(living.size):
        k = living[m]
        members[m], batch.taken[m] = k, motion.probe
        for j in range(points.shape[1]):
            batch.initial[k, j] = points[k, j]
        batch.before[k, 0] = batch.before[k, 1] = -1.0
        batch.seen[k] = 0
        batch.checks[k] = CHOSEN if _is_chosen(batch.initial, k, motion.checked) else UNCHECKED
    _images(motion, batch, members, motion.trial, motion.length / PROBE, points)
    for m in range(living.size):
        batch.ratios[living[m]] *= PROBE


@inlined
def _compare(motion, batch, points, members):
    """Compare images that meet the tolerance with those of fewer steps, where that is to be done."""
    checks, ratios = batch.checks, batch.ratios
    for m in range(members.size):
        k = members[m]
        met = 0.0 <= ratios[k] <= 1.0
        if met and (checks[k] > CHOSEN or (checks[k] == CHOSEN and batch.taken[m] < motion.ladder.size - 1)):
            ratios[k] = _disagreement(motion, batch, points, k)
        elif checks[k] == COMPARED:
            # More steps do worse, as some do that meet several events at once: nothing to compare with.
            checks[k], ratios[k] = UNCHECKED, 0.0
            for j in range(points.shape[1]):
                points[k, j] = batch.earlier[k, j]


@inlined
def _hand_over(motion, batch, points, members, handed):
    """Set aside the orbits that another method takes, at their initial points; return their number by now."""
    for m in range(members.size):
        if batch.rungs[m] < MET or (batch.rungs[m] > MET and _is_wrong(motion, batch, members[m], m)):
            batch.rungs[m], batch.aside[handed] = MET, members[m]
            handed += 1
            for j in range(points.shape[1]):
                points[members[m], j] = batch.initial[members[m], j]
    return handed


@loop
def _give_up(motion, batch, points, status, members):
    """Mark the orbits that no number of steps would do for; return the steps in which that was seen.

    Where the error does not fall as it should, steps of its own tell whether an orbit ends, as at a pole; they also
    have an image where equal steps have none.
    """
    total, suspects, own_steps = 0, 0, motion.coarse.size > 1
    if own_steps:
        for m in range(members.size):
            if batch.rungs[m] != MET and _most_to_see(motion, batch, members[m], m) > batch.seen[members[m]]:
                batch.aside[suspects] = members[m]
                suspects += 1
    places, fates = np.empty((max(suspects, 1), points.shape[1])), np.empty(suspects, np.int64)
    if suspects > 0:
        total += follow_coarsely(motion, batch.initial, batch.aside[:suspects], places, fates)
    suspects = 0
    for m in range(members.size):
        if batch.rungs[m] == MET:
            continue
        k, fate, row, spent = members[m], SEEN_NOTHING, 0, 0
        most = _most_to_see(motion, batch, k, m)
        if most > batch.seen[k]:
            batch.seen[k] = most
            if own_steps:
                fate, row = fates[suspects], suspects
                suspects += 1
            else:
                fate, spent = follow_alone(motion, batch.initial, k, most, places)
        total += spent
        if fate == AT_POLE:
            batch.rungs[m] = NOT_FINITE
            _end(points, status, k, DIVERGED)
        elif batch.rungs[m] < MET:
            in_time = fate == ARRIVED and spent <= motion.ladder[motion.ladder.size - 1]
            _mark(motion, batch, points, status, m, k, most > 0, in_time, places[row])
    return total


@inlined
def _most_to_see(motion, batch, k, m):
    """Return in how many steps it is to be seen what becomes of an orbit that misses its tolerance; 0 for none."""
    ratio = batch.ratios[k]
    if batch.rungs[m] < MET:
        small = _DOUBTFUL * motion.digit
        return _LONG if not ratio <= small or batch.before[k, 0] > small else 0
    if motion.coarse.size > 1:
        return _LONG if not ratio < np.inf else 0
    return _SOON if _is_wrong(motion, batch, k, m) else 0


@loop
def _mark(motion, batch, points, status, m, k, doubtful, in_time, place):
    """Mark an orbit that misses its tolerance, or ends, or has another image in time by steps of its own."""
    rung, ratio = batch.rungs[m], batch.ratios[k]
    if rung == NOT_FINITE or ratio > motion.digit or (doubtful and not _has_a_digit(motion, batch, points, k, m)):
        # Where events keep equal steps from arriving, it is not known which of the two to believe.
        if in_time and ratio != np.inf:
            status[k] = INACCURATE
            for j in range(points.shape[1]):
                points[k, j] = place[j]
        else:
            # Equal steps that overflow prove nothing: so do those of an explicit method that is unstable.
            _end(points, status, k, DIVERGED if ratio == BLOWN_UP else OUT_OF_STEPS)
    else:
        status[k] = INACCURATE


@loop
def _has_a_digit(motion, batch, points, k, m):
    """Tell whether the images of two numbers of steps, one half of the other, have a digit in common."""
    member, halved = np.empty(1, np.int64), np.empty(points.shape)
    member[0] = k
    _images(motion, batch, member, max(motion.ladder[batch.taken[m]] // 2, 1), motion.length, halved)
    for j in range(points.shape[1]):
        x = points[k, j]
        size = (motion.atol[j] + motion.rtol * min(abs(x), motion.largest[j])) * motion.digit
        if not abs(halved[k, j] - x) <= ONE_DIGIT * size:
            return False
    return True


@inlined
def _is_wrong(motion, batch, k, m):
    """Tell whether an image is wrong where it should not be; what is compared has met the tolerance."""
    wrong = not batch.ratios[k] <= _DOUBTFUL * motion.digit
    return wrong and batch.checks[k] <= CHOSEN and motion.ladder[batch.taken[m]] >= ASYMPTOTIC


@inlined
def _climb(motion, batch, points, members):
    """Integrate orbits that have a rung, rung by rung; return the steps that they took together."""
    total = begin = 0
    for rung in range(motion.ladder.size):
        end = batch.ends[rung]
        if end > begin:
            _images(motion, batch, members[begin:end], motion.ladder[rung], motion.length, points)
            for b in range(-(-(end - begin) // LANES)):
                total += batch.numbers[b] * min(LANES, end - begin - b * LANES)
            begin = end
    return total


LARGE, SMALL = 1, 2
"""What was seen of a component: that it was clear of its floor, and that it was below it thereafter."""


@loop
def notice(motion, points, status, small):
    """Notice components that come clear of their floor again after they were below it, or diverge from there."""
    for k in range(status.size):
        if status[k] >= ESCAPED:
            for j in range(points.shape[1]):
                if status[k] == DIVERGED and small[k, j] == SMALL:
                    motion.lost[j] = 1
            continue
        for j in range(points.shape[1]):
            size, seen = abs(points[k, j]), small[k, j]
            if size > 10.0 * motion.floor[j]:
                if seen == SMALL:
                    motion.lost[j] = 1
                small[k, j] = LARGE
            elif seen == LARGE and size < 0.1 * motion.floor[j]:
                small[k, j] = SMALL


@loop
def iterate(discrete, points, rotations, status, lower, turn, periods):
    """Apply a discrete map to orbits some times; return how often it was applied.

    An orbit that is not smaller than the bound has DIVERGED, as one whose angle has no phase.
    """
    function, context, parameters, bound = discrete
    n, d = points.shape
    living = np.empty(n, np.int64)
    block, error, once = np.empty((1, d, LANES)), np.empty((1, d, LANES)), np.ones(1, np.int64)
    alive = _living(status, living)
    total = 0
    for begin in range(0, alive, LANES):
        members = living[begin : min(begin + LANES, alive)]
        pack(points, members, block)
        for _ in range(periods):
            call_period(function, context, block, once, (0.0, 1.0), parameters, error, members.size)
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
                    _end(points, status, k, _fate(block[0, 0, i]))
                elif _wrap(points, rotations, status, k, lower, turn):
                    moving += 1
                    for j in range(d):
                        block[0, j, i] = points[k, j]
            if moving == 0:
                break
    return total


@inlined
def _is_chosen(points, k, fraction):
    """Choose a fraction of all orbits by the last digits of a sum of their coordinates."""
    if fraction >= 1.0 or fraction <= 0.0:
        return fraction >= 1.0
    total, weight = 0.0, 0.7548776662466927
    for j in range(points.shape[1]):
        total += weight * points[k, j]
        weight = 0.7548776662466927 * weight + 0.1
    product = total * _SPLIT
    first = product - (product - total)
    digits = 1e11 * (total - first) / first
    return digits - np.floor(digits) < fraction


@inlined
def _disagreement(motion, batch, points, k):
    """Compare an image with that of fewer steps, where there is one, and keep it; return a ratio as that of errors."""
    initial, earlier, checks, before = batch.initial, batch.earlier, batch.checks, batch.before
    worst, size = 0.0, 0.0
    for j in range(points.shape[1]):
        size = max(size, abs(points[k, j]), abs(initial[k, j]))
    for j in range(points.shape[1]):
        x = points[k, j]
        difference = max(abs(x - earlier[k, j]) - ROUNDED * size, 0.0)
        worst = max(worst, difference / (motion.atol[j] + motion.rtol * min(abs(x), motion.largest[j])))
        earlier[k, j] = x
    if checks[k] == CHOSEN:
        checks[k] = COMPARED
        before[k, 0] = before[k, 1] = -1.0
        return motion.more
    checks[k] = DIFFERED
    return motion.agreement * worst


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
def _images(motion, batch, members, steps, length, images):
    """Integrate some orbits over a time with a number of steps, in full blocks of lanes.

    The batch receives the steps that each block took.
    """
    used = -(-members.size // LANES)
    blocks, errors = batch.blocks[:used], batch.errors[:used]
    batch.numbers[:used] = steps
    pack(batch.initial, members, blocks)
    call_period(
        motion.function,
        motion.context,
        blocks,
        batch.numbers,
        (motion.begin, length),
        motion.parameters,
        errors,
        members.size,
    )
    unpack(motion, blocks, errors, members, images, batch.ratios)


@inlined
def _wrap(points, rotations, status, k, lower, turn):
    """Wrap the angles of an orbit, or terminate it where one has no phase; return whether it is still active."""
    for j in range(points.shape[1]):
        small = abs(points[k, j]) < FARTHEST_STATE
        if not (small and wrap_angle(points, rotations, k, j, lower[j], turn[j])):
            _end(points, status, k, _fate(points[k, 0]))
            return False
    return True


@inlined
def _fate(first):
    """Return the status of an orbit that is beyond all bounds, by its first coordinate."""
    number = first / END_PLACE
    if 1.0 <= number <= MOST_ENDS and number == np.floor(number):
        return ENDED - 1 + np.int64(number)
    return DIVERGED


@inlined
def _end(points, status, k, reason):
    status[k] = reason
    for j in range(points.shape[1]):
        points[k, j] = np.nan
