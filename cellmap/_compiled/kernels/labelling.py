"""Labels of a batch of orbits in one call: iterated until each is in a region of an attractor, has ended, or is late.

Orbits are worked on in a pool of rows, compact at all times; each has its own clock.  A table moves all rows of the
pool; those that it does not serve wait until they fill blocks of the exact map.  How an orbit moves does not depend on
the others, and neither do label, time, and state, which are written by the number of the orbit.

A map that no compiled loop can call is asked for: the loop returns, and is called again when the rows have been moved.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..loops import inlined, loop
from .blocks import place_of
from .calls import call_look_up
from .capture import CERTAIN, LOOKED_AT, OUTSIDE, ellipsoids_of, held_by_cover, sifted
from .periods import ENDED, ESCAPED, NOWHERE, CompiledMap, Motions, integrate, iterate, notice

FINISHED, INTERRUPTED, ASKS_FOR_POOL, ASKS_FOR_WAITING = 0, 1, 2, 3
"""Why the loop returns: nothing is left, so that Ctrl-C is heard, or for one step of the map or of the exact map."""

ACTIVE, WAITING, BEGUN, MOVED, LOOKED, SPENT, PERIODS, APPLIED, LOOK_UPS = range(9)
"""Places in the counts: rows in the pool and waiting, orbits begun, whether the waiting rows have been moved, whether
the pool has been looked at; orbits moved by exact maps since the last return; periods, steps of the integrator or
applications, and look-ups."""
COUNTS = 9

POOL = 2048
"""Rows of a table that are moved together: they and much of the table stay in the cache."""

FULL = 512
"""Waiting rows that are handed to the exact map: enough to fill its blocks at each number of steps."""

NOT_COMPILED, FLOW, DISCRETE = 0, 1, 2


class Table(NamedTuple):
    """Look-ups of an interpolated map, by the address of their function; 0 for none.

    ``arrays``: addresses of the arrays that the function takes; ``levels``: numbers of cells with a reach, 0 for one
    table everywhere; ``escapes``: whether orbits end outside.  The rest tells where outside is.
    """

    function: int = 0
    arrays: tuple[int, ...] = (0,) * 9
    levels: int = 0
    escapes: int = 0
    origin: NDArray[np.float64] = NOWHERE
    inverse: NDArray[np.float64] = NOWHERE
    cells: NDArray[np.float64] = NOWHERE
    circle: NDArray[np.float64] = NOWHERE


class PeriodStep(NamedTuple):
    """How orbits make a period: with a table or without, and by the exact map of some kind.

    Without arguments it is that of a map of which nothing is known but the function that it is.
    """

    table: Table = Table()
    kind: int = NOT_COMPILED
    motion: Motions = Motions()
    discrete: CompiledMap = CompiledMap()
    lower: NDArray[np.float64] = NOWHERE
    turn: NDArray[np.float64] = NOWHERE


class Limits(NamedTuple):
    """When orbits are looked at: from the age that all have in the beginning to that at the end.

    ``stride``: periods from one look to the next; ``patience``: periods of the exact map after which the loop returns
    for a moment.
    """

    age: int
    end: int
    stride: int
    patience: int


class PoolRows(NamedTuple):
    """Rows of the pool: states, periods left until the next look, the age at it, and the number of the orbit."""

    points: NDArray[np.float64]
    rotations: NDArray[np.int64]
    status: NDArray[np.uint8]
    left: NDArray[np.int64]
    age: NDArray[np.int64]
    member: NDArray[np.int64]


class LabelledOrbits(NamedTuple):
    """Outcome of each orbit: state, label, settling time, and the last look before, with the point there.

    ``points``, ``rotations``, ``status`` are the orbits' states, at the beginning and at the end; ``residence`` counts
    for each cover the periods inside; ``visits`` (3, n), or empty, are the owner of the ellipsoids in which an orbit
    was, and the ages at which it was seen there first and last; ``told`` is the number of a final state in which an
    orbit is said to be, -1 for none, or empty; ``labels_of`` are the labels of orbits that have ended, by status.
    """

    points: NDArray[np.float64]
    rotations: NDArray[np.int64]
    status: NDArray[np.uint8]
    labels: NDArray[np.int64]
    times: NDArray[np.int32]
    since: NDArray[np.int64]
    before: NDArray[np.float64]
    residence: NDArray[np.int64]
    visits: NDArray[np.int64]
    told: NDArray[np.int64]
    labels_of: NDArray[np.int64]


class Scratch(NamedTuple):
    """Arrays for a look at some rows, and ``made``, the number of periods or look-ups."""

    places: NDArray[np.float64]
    distances: NDArray[np.float64]
    found: NDArray[np.int64]
    holes: NDArray[np.int64]
    made: NDArray[np.int64]


class LabellingWorkspace(NamedTuple):
    """Rows of the pool and those that wait, arrays for a look at them, and counts."""

    pool: PoolRows
    waiting: PoolRows
    scratch: Scratch
    counts: NDArray[np.int64]


@loop
def label(step, regions, sieve, covers, limits, outcome, work):
    """Label orbits within some limits; return why the loop stops."""
    pool, waiting, scratch, counts = work
    while True:
        if counts[MOVED] > 0:
            _return_waiting(pool, waiting, counts)
        if counts[LOOKED] == 0:
            _fill(outcome, pool, counts, limits.age)
            _look(step, regions, sieve, covers, limits, outcome, work)
        counts[LOOKED] = 0
        active, waits = counts[ACTIVE], counts[WAITING]
        if active + waits == 0:
            if counts[BEGUN] == outcome.labels.size:
                return FINISHED
            continue
        if counts[SPENT] > limits.patience:
            counts[SPENT], counts[LOOKED] = 0, 1
            return INTERRUPTED
        if step.table.function == 0:
            rows, moving, periods = pool, active, pool.left[0]  # those of all rows
            for i in range(active):
                pool.left[i] = 0
        else:
            if active > 0:
                table, made = step.table, scratch.made
                call_look_up(
                    table.function, pool.points, pool.rotations, pool.left, table.arrays, active, table.levels, made
                )
                counts[LOOK_UPS] += scratch.made[0]
                counts[SPENT] += 1 + active // 64
            if waits == 0 or (waits < FULL and active > 0):
                continue
            rows, moving, periods = waiting, waits, np.int64(1)
            counts[MOVED] = 1
        counts[SPENT] += moving * periods
        if step.kind == NOT_COMPILED:
            scratch.made[0] = periods
            return ASKS_FOR_WAITING if step.table.function != 0 else ASKS_FOR_POOL
        points, rotations, status = rows.points[:moving], rows.rotations[:moving], rows.status[:moving]
        counts[APPLIED] += apply_exact_map(step, points, rotations, status, periods)


@loop
def apply_exact_map(step, points, rotations, status, periods):
    """Move orbits on by some periods of a compiled map, flow or function; return the steps or applications made."""
    if step.kind == FLOW:
        small = np.empty((0, 0), np.uint8)
        return integrate(step.motion, points, rotations, status, small, step.lower, step.turn, periods)
    return iterate(step.discrete, points, rotations, status, step.lower, step.turn, periods)


@loop
def _copy(rows, i, others, k):
    for j in range(rows.points.shape[1]):
        others.points[k, j] = rows.points[i, j]
        others.rotations[k, j] = rows.rotations[i, j]
    others.status[k] = rows.status[i]
    others.left[k] = rows.left[i]
    others.age[k] = rows.age[i]
    others.member[k] = rows.member[i]


@loop
def _return_waiting(pool, waiting, counts):
    """Put rows that the exact map has moved back into the pool; a negative number of periods left goes on at once."""
    active = counts[ACTIVE]
    for i in range(counts[WAITING]):
        _copy(waiting, i, pool, active)
        pool.left[active] = 0 if waiting.status[i] >= ESCAPED else 1 - waiting.left[i]
        active += 1
    counts[ACTIVE], counts[WAITING], counts[MOVED] = active, 0, 0


@loop
def _fill(outcome, pool, counts, age):
    """Begin with further orbits where there is room."""
    active, begun = counts[ACTIVE], counts[BEGUN]
    most = min(outcome.labels.size - begun, pool.left.size - active - counts[WAITING])
    for _ in range(most):
        for j in range(pool.points.shape[1]):
            pool.points[active, j] = outcome.points[begun, j]
            pool.rotations[active, j] = outcome.rotations[begun, j]
        pool.status[active] = outcome.status[begun]
        pool.left[active], pool.age[active], pool.member[active] = 0, age, begun
        active += 1
        begun += 1
    counts[ACTIVE], counts[BEGUN] = active, begun


@loop
def _look(step, regions, sieve, covers, limits, outcome, work):
    """Find the rows that have settled or ended, and those that the table does not serve; the others go on."""
    pool, waiting, scratch, counts = work
    rows, holes, found, made = counts[ACTIVE], 0, scratch.found, 0
    age, end, stride = limits.age, limits.end, limits.stride
    by_region_alone = covers.owners.size == 0 and stride == 1 and outcome.told.size == 0
    # Where nothing captures orbits, all that can happen is that they end, and ended ones stay so.
    grows = regions.owners.size + covers.owners.size == 0
    for begin in range(0, rows, LOOKED_AT):
        some = min(LOOKED_AT, rows - begin)
        if sieve.bits.shape[2] > 0:
            sifted(pool.points, begin, some, regions, sieve, step.turn, found)
        else:
            ellipsoids_of(pool.points, begin, some, regions, step.turn, scratch.places, scratch.distances, found)
        for i in range(some):
            r = begin + i
            k = pool.age[r]
            # Nearly always nothing has happened.
            if not (by_region_alone and found[i] < 0 and pool.left[r] == 0 and pool.status[r] < ESCAPED and k < end):
                if pool.left[r] != 0 and pool.status[r] < ESCAPED:
                    if pool.left[r] < 0:
                        pool.left[r] = -pool.left[r]
                        continue
                    if not (step.table.escapes != 0 and _is_outside(step.table, pool.points, r)):
                        _copy(pool, r, waiting, counts[WAITING])
                        counts[WAITING] += 1
                        scratch.holes[holes] = r
                        holes += 1
                        continue
                    pool.status[r] = ESCAPED
                    found[i] = -1
                    for j in range(pool.points.shape[1]):
                        pool.points[r, j] = np.nan
                if _ends(regions, covers, limits, outcome, pool, r, found[i]):
                    scratch.holes[holes] = r
                    holes += 1
                    continue
                if not by_region_alone:
                    outcome.since[pool.member[r]] = k
                    for j in range(pool.points.shape[1]):
                        outcome.before[pool.member[r], j] = pool.points[r, j]
            periods = min(stride, end - k, max(k - age, 1) if grows else stride)
            pool.left[r], pool.age[r] = periods, k + periods
            made += periods
    counts[PERIODS] += made
    counts[ACTIVE] = _compact(pool, rows, scratch.holes, holes)


@inlined
def _ends(regions, covers, limits, outcome, pool, r, owner):
    """Return whether a row is finished; if so, write the outcome of its orbit."""
    m, k, ended = pool.member[r], pool.age[r], pool.status[r] >= ESCAPED
    when = k
    if owner >= 0 and regions.residence[owner] > 0:
        visits = outcome.visits
        if visits[0, m] != owner or visits[2, m] < k - limits.stride:
            visits[0, m], visits[1, m] = owner, k
        visits[2, m], when = k, visits[1, m]
        if k - when < regions.residence[owner]:
            owner, when = np.int64(-1), k
    if owner < 0 and outcome.told.size > 0:
        owner = outcome.told[m]
    for c in range(covers.owners.size):
        held = held_by_cover(covers, c, pool.points, r, outcome.before, m)
        inside = held != OUTSIDE
        if covers.resting[c]:
            if inside and owner < 0:
                owner = covers.owners[c]
            continue
        outcome.residence[c, m] = outcome.residence[c, m] + 1 if inside else 0
        if owner < 0 and (held == CERTAIN or outcome.residence[c, m] >= covers.residence[c]):
            owner, when = covers.owners[c], max(k - outcome.residence[c, m] + 1, 0)
    if owner < 0 and not ended and k < limits.end:
        return False
    if owner >= 0:
        outcome.labels[m], outcome.times[m] = owner, when
    elif ended:
        outcome.labels[m] = outcome.labels_of[pool.status[r]]
        if pool.status[r] >= ENDED:
            outcome.times[m] = k
    for j in range(pool.points.shape[1]):
        outcome.points[m, j] = pool.points[r, j]
        outcome.rotations[m, j] = pool.rotations[r, j]
    outcome.status[m] = pool.status[r]
    return True


@inlined
def _compact(pool, rows, holes, count):
    """Move the last rows into those that have become free; return how many rows there are."""
    last = count
    for h in range(count):
        while last > h and holes[last - 1] == rows - 1:
            last -= 1
            rows -= 1
        if last == h:
            break
        rows -= 1
        _copy(pool, rows, pool, holes[h])
    return rows


@inlined
def _is_outside(table, points, r):
    """Tell whether a row is outside the window of the table, as the look-up does."""
    for j in range(points.shape[1]):
        place = place_of(points[r, j], table.origin[j], table.inverse[j], table.circle[j])
        if place < 0.0 or place > table.cells[j]:  # not an angle without phase, of which the exact map decides
            return True
    return False


@loop
def find_outside(table, points, outside):
    """Write which rows are outside the window of a table."""
    for r in range(points.shape[0]):
        outside[r] = _is_outside(table, points, r)


@loop
def record(step, points, rotations, status, small, places, turned, states):
    """Move orbits on by the exact map, and write where they are after each period; return the steps that were made.

    ``places`` (periods, n, d), ``turned`` (periods, n, d) and ``states`` (periods, n) receive points, full rotations
    and status.  The map of a step is a flow or a compiled function.  ``small`` is for :func:`.periods.notice`.
    """
    total = 0
    for period in range(places.shape[0]):
        if step.kind == FLOW:
            notice(step.motion.usual, points, status, small)
        total += apply_exact_map(step, points, rotations, status, 1)
        for k in range(points.shape[0]):
            states[period, k] = status[k]
            for j in range(points.shape[1]):
                places[period, k, j] = points[k, j]
                turned[period, k, j] = rotations[k, j]
    return total


@loop
def count_labels(labels, lowest, counts):
    """Add to ``counts`` how often the labels from `lowest` on occur; others are passed over."""
    for i in range(len(labels)):
        k = labels[i] - lowest
        if 0 <= k < len(counts):
            counts[k] += 1
