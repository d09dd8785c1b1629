"""Number of steps of an initial condition: increased along a ladder until the error estimate meets the tolerance."""

from __future__ import annotations

import numpy as np

from ..loops import loop
from .blocks import BLOWN_UP

MET, DIVERGED, MISSED = -1, -2, -3

KINK = 2.0  # order to which errors fall at best where a right-hand side has a kink
ASYMPTOTIC = 512.0  # steps a period from which on errors are taken to fall as they will


@loop
def next_rungs(motion, batch, members, first):
    """Choose the next rung of each member of a batch, or say why there is none.

    ``taken[m]`` is the rung that gave ``ratios[members[m]]``, error estimate over tolerance; in the ``first`` round it
    stands for a trial, and no rung below the lowest is chosen.  Rung k has ``ladder[k]`` steps and should do where
    ``ladder[k]**order >= safety * ratio * ladder[taken]**order``.  At most ``highest_climb`` rungs are climbed at once,
    or twice as many from an image that is not finite.  ``before[members[m]]`` holds ratio and steps of the round
    before, -1 for none; where the ratio falls so slowly that the last rung would not do, as it does across a kink,
    there is no next.  Nor is there one where an image is not finite on the rung that tells an ``unstable`` method.
    """
    taken, before, rungs, steps, powers = batch.taken, batch.before, batch.rungs, motion.ladder, motion.powers
    order, lowest, climb = motion.order, motion.lowest, motion.highest_climb
    last = steps.size - 1
    for m in range(members.size):
        member, rung = members[m], taken[m]
        ratio = batch.ratios[member]
        finite = ratio < np.inf
        if ratio == BLOWN_UP and not first:
            rungs[m] = DIVERGED
        elif ratio <= 1.0 and not first:
            rungs[m] = MET
        elif rung == last and not first:
            rungs[m] = MISSED if finite else DIVERGED
        elif not finite and rung >= motion.unstable and not first:
            rungs[m] = DIVERGED
        elif not finite:
            rungs[m] = max(min(rung + 2 * climb, last, motion.unstable), lowest)
        else:
            low = lowest if first else rung + 1
            if before[member, 1] >= ASYMPTOTIC and steps[rung] >= 1.4 * before[member, 1]:
                growth = np.log(steps[rung] / before[member, 1])
                seen = np.log(before[member, 0] / ratio) / growth
                if seen < 0.6 * order and np.log(ratio) > max(seen, KINK) * np.log(steps[last] / steps[rung]):
                    rungs[m] = MISSED
                    continue
            if not first:
                before[member, 0], before[member, 1] = ratio, steps[rung]
            needed = motion.safety * ratio * powers[rung]
            high = max(low, min(rung + climb, last))
            while low < high:
                middle = (low + high) // 2
                if powers[middle] >= needed:
                    high = middle
                else:
                    low = middle + 1
            rungs[m] = high


@loop
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
