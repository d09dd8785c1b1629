"""How many steps a start takes: a ladder of numbers of steps, climbed until the error estimate meets the tolerance."""

from __future__ import annotations

import numpy as np
from numba import njit

from .options import KERNEL

MET, DIVERGED, MISSED = -1, -2, -3


@njit(**KERNEL)
def next_rungs(members, taken, ratios, first, lowest, powers, safety, leap, last_finite, rungs):
    """Choose the next rung of each member, or say why there is none.

    ``taken[m]`` is the rung that gave ``ratios[members[m]]``, error estimate over tolerance; in the ``first`` round it
    stands for a trial, and no rung below ``lowest`` is chosen.  ``powers[k]`` is the number of steps of rung k to the
    order of the estimate, so that rung k should do where ``powers[k] >= safety * ratio * powers[taken]``.  At most
    ``leap`` rungs are climbed at once.  From rung ``last_finite`` on, an image that is not finite has diverged.
    """
    last = powers.size - 1
    for m in range(members.size):
        ratio, rung = ratios[members[m]], taken[m]
        if ratio <= 1.0 and not first:
            rungs[m] = MET
            continue
        if not ratio < np.inf:
            rungs[m] = DIVERGED if rung >= last_finite else max(min(rung + leap, last), lowest)
            continue
        if rung == last and not first:
            rungs[m] = MISSED
            continue
        needed = safety * ratio * powers[rung]
        low = lowest if first else rung + 1
        high = max(low, min(rung + leap, last))
        while low < high:
            middle = (low + high) // 2
            if powers[middle] >= needed:
                high = middle
            else:
                low = middle + 1
        rungs[m] = high


@njit(**KERNEL)
def sort_by_rung(members, rungs, count, ordered, ordered_rungs, ends):
    """Sort members that have a rung by it, stably; ``ends[k]`` is where those of rung k end."""
    ends[:] = 0
    for rung in rungs:
        if rung >= 0:
            ends[rung] += 1
    total = 0
    for k in range(count):
        total += ends[k]
        ends[k] = total - ends[k]
    for m in range(members.size):
        rung = rungs[m]
        if rung >= 0:
            ordered[ends[rung]] = members[m]
            ordered_rungs[ends[rung]] = rung
            ends[rung] += 1
