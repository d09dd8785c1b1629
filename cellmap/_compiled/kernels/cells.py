"""Maps of cells to cells: groups of a simple cell mapping."""

from __future__ import annotations

import numpy as np

from ..loops import loop

_NEW = -3
_UNDER_WAY = -4


@loop
def unravel(images, groups, steps, periods):
    """Write the group of each cell, the steps that it takes to a periodic cell, and the period of each group.

    ``images`` (n,) are the cells to which cells go, or -1 and -2 for two sinks, which are groups of these numbers.  All
    arrays have the length n; returns the number of groups (Hsu 1980).
    """
    n = len(images)
    path = np.empty(n, np.int64)
    found = 0
    groups[:] = _NEW
    for start in range(n):
        length = 0
        cell = start
        while cell >= 0 and groups[cell] == _NEW:
            groups[cell] = _UNDER_WAY
            steps[cell] = length
            path[length] = cell
            length += 1
            cell = images[cell]
        if length == 0:
            continue
        tail = length
        if cell < 0:
            group, ahead = cell, 0
        elif groups[cell] == _UNDER_WAY:
            group, ahead, tail = found, 0, steps[cell]
            periods[found] = length - tail
            found += 1
            for k in range(tail, length):
                groups[path[k]], steps[path[k]] = group, 0
        else:
            group, ahead = groups[cell], steps[cell]
        for k in range(tail):
            groups[path[k]], steps[path[k]] = group, ahead + tail - k
    return found
