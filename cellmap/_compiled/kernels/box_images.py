"""Points in cells, numbers of the cells that points lie in, and the tally of them box by box."""

from __future__ import annotations

import numpy as np

from ..loops import inlined, loop

_GAPS = (1750, 701, 301, 132, 57, 23, 10, 4, 1)
"""Of Shell's method of sorting (M. Ciura, Lecture Notes in Computer Science 2138 (2001) 106)."""


@inlined(contract=False)
def _along(lower, upper, width, n, number):
    """Return what :func:`cellmap.maps.grid.between` returns, with the same bits."""
    if 2.0 * number == n:
        return 0.5 * lower + 0.5 * upper
    return lower + number * width if 2.0 * number < n else upper - (n - number) * width


@loop(contract=False)  # an edge is where CellGrid has it, to the last bit
def locate_rows(points, lower, upper, widths, shape, turn, wraps, keys):
    """Write the flat number (row-major) of the half-open cell of each row into `keys`, -1 for a point outside.

    Along an axis with a `turn` a point outside of the window is first brought into the turn that begins at its lower
    edge; where the axis wraps, that turn is the window.
    """
    for i in range(points.shape[0]):
        key = np.int64(0)
        for j in range(points.shape[1]):
            x, n = points[i, j], shape[j]
            if turn[j] > 0.0 and not lower[j] <= x < upper[j]:
                if wraps[j]:
                    x = min(lower[j] + (x - lower[j]) % turn[j], upper[j])
                else:
                    x = x - np.floor((x - lower[j]) / turn[j]) * turn[j]
            if not abs(x) < np.inf or not (wraps[j] or lower[j] <= x < upper[j]):
                key = np.int64(-1)
                break
            cell = np.floor((x - lower[j]) / widths[j])
            # The division rounds: a point next to an edge may have come to the wrong side of it.
            cell += 1.0 if x >= _along(lower[j], upper[j], widths[j], n, cell + 1.0) else 0.0
            cell -= 1.0 if x < _along(lower[j], upper[j], widths[j], n, cell) else 0.0
            key = key * n + min(max(np.int64(cell), 0), n - 1)
        keys[i] = key


@loop(contract=False)  # an edge is where CellGrid has it, to the last bit
def points_of_cells(keys, shape, lower, upper, widths, offsets, points):
    """Write the points at `offsets` (m, d), in widths of a cell, from the centre of each cell, cell after cell."""
    m, d = offsets.shape
    for b in range(keys.size):
        rest = keys[b]
        for j in range(d - 1, -1, -1):
            centre = _along(lower[j], upper[j], widths[j], shape[j], rest % shape[j] + 0.5)
            rest //= shape[j]
            for i in range(m):
                points[b * m + i, j] = centre + offsets[i, j] * widths[j]


@loop
def tally_rows(keys, begins, rows, targets, counts, lost):
    """Count equal keys between neighbouring entries of `begins`; return how many different ones there are.

    The keys are sorted in place; ``rows[m]``, ``targets[m]``, ``counts[m]`` are a stretch, a key in it and how often it
    stands there.  Negative keys are counted in ``lost`` alone.
    """
    found = 0
    for b in range(begins.size - 1):
        part = keys[begins[b] : begins[b + 1]]
        for gap in _GAPS:
            for i in range(gap, part.size):
                key, k = part[i], i - gap
                while k >= 0 and part[k] > key:
                    part[k + gap] = part[k]
                    k -= gap
                part[k + gap] = key
        last = np.int64(-1)
        lost[b] = 0
        for key in part:
            if key < 0:
                lost[b] += 1
            elif key == last:
                counts[found - 1] += 1
            else:
                rows[found], targets[found], counts[found] = b, key, 1
                found, last = found + 1, key
    return found
