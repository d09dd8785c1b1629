"""Where a table sends its cells: the cells that the image of each can touch, and the ends of paths over such cells.

Errors are in widths of a cell, boxes in numbers of cells from the first.
"""

from __future__ import annotations

from math import floor

import numpy as np

from ..loops import inlined, loop
from .blocks import in_turn, shortest
from .certainty import FARTHEST, NONE, touches

SEVERAL = -1
"""An end of paths over images of cells: more than one, or one that is not known."""

_FAR = 2**30  # cells from the first, outside of any table
_TILE = 5  # cells of a tile along each axis, as a power of 2: their changes are noticed together


@loop
def reaches_of(slopes, bends, errors, begin, end, reach):
    """Write how far the image of each cell reaches from its middle along each axis, in cells."""
    d = reach.shape[1]
    for c in range(begin, end):
        around = 0.25 * d * bends[c, 0] + errors[c]
        for i in range(d):
            own = 0.0
            for k in range(d):
                own += abs(slopes[c, i, k])
            reach[c, i] = 0.5 * own + around


@loop
def boxes_of(images, table, most, overhangs, begin, end, boxes):
    """Write the first and the last cell that an image can touch along each axis.

    ``images`` are (middle, reach), ``table`` (origin, inverse, cells, circle) and ``boxes`` (first, last).  Where cells
    are not known, ``last`` is smaller than ``first``: the image is too far, touches more than `most` cells,
    lies where an angle leaves the window that it comes back to, or leaves it where an attractor lies across
    (``overhangs``, boxes (n, 2, d)).
    """
    (middle, reach), (first, last), (_, _, cells, circle) = images, boxes, table
    d = len(cells)
    low, high = np.zeros(d, np.int64), np.zeros(d, np.int64)
    for c in range(begin, end):
        known, touched = True, 1.0
        leaves = False
        for j in range(d):
            (at, _turns), far = in_turn(middle[c, j], 0.0, circle[j]), reach[c, j]
            known = known and abs(at) + far < FARTHEST
            if not known:
                break
            touched *= 2.0 * far + 1.0
            # Part of the period of an angle is outside of the window, and the window repeats behind it.
            part = circle[j] > 0.0 and circle[j] != cells[j]
            known = not (part and (at + far >= circle[j] or at - far <= cells[j] - circle[j]))
            if not known:
                break
            low[j], high[j] = np.int64(floor(at - far)), np.int64(floor(at + far))
            leaves = leaves or (circle[j] != cells[j] and (low[j] < 0 or high[j] >= cells[j]))
        known = known and touched < most
        if known and leaves:
            known = not touches(low, high, overhangs)
        for j in range(d):
            # Beyond the window all cells are alike.
            first[c, j] = max(min(low[j], _FAR), -_FAR) if known else 0
            last[c, j] = max(min(high[j], _FAR), -_FAR) if known else -1


@loop
def claim_within(owners, table, neighbourhoods, turn, begin, end):
    """Give cells that lie in an ellipsoid as a whole its owner.

    Arguments as those of ``judge`` in :mod:`cellmap._compiled.kernels.certainty`.
    """
    origin, inverse, cells, _ = table
    centres, metrics, numbers = neighbourhoods.centres, neighbourhoods.metrics, neighbourhoods.owners
    d = len(cells)
    shift = np.empty(d)
    for c in range(begin, end):
        for m in range(len(numbers)):
            inside = owners[c] == NONE
            corner = 0
            while inside and corner < 2**d:
                rest = c
                for j in range(d - 1, -1, -1):
                    edge = rest % cells[j] + ((corner >> j) & 1)
                    rest //= cells[j]
                    shift[j] = origin[j] + edge / inverse[j] - centres[m, j]
                    if turn[j] > 0.0:
                        shift[j] = shortest(shift[j], turn[j])
                distance = 0.0
                for j in range(d):
                    for k in range(d):
                        distance += metrics[m, j, k] * shift[j] * shift[k]
                inside = distance <= 1.0
                corner += 1
            if inside:
                owners[c] = numbers[m]


@loop
def reach_ends(ends, fixed, first, last, cells, circle, beyond):
    """Find for each cell the end that all paths over images of cells reach, changed in place.

    ``ends`` (n,) int16 holds the number of an end, 0 for none and SEVERAL for more than one or one that is not known;
    cells that are ``fixed`` keep theirs.  ``first`` and ``last`` (n, d) int32 are the boxes of cells that hold the
    image of each cell, and ``beyond`` is the end of what lies outside of the grid.
    """
    order = np.empty(len(ends), np.int64)
    left = _by_time(ends, fixed, first, last, cells, circle, order)
    here = np.empty(len(cells), np.int64)
    tiles = np.empty(len(cells), np.int64)
    count = 1
    for j in range(len(cells)):
        tiles[j] = (cells[j] >> _TILE) + 1
        count *= tiles[j]
    visited, changed = np.zeros(len(ends), np.int64), np.zeros(count, np.int64)
    clock, again = 0, True
    while again:
        again = False
        kept = 0
        for m in range(left):
            c = order[m]
            clock += 1
            end = np.int64(ends[c])
            if visited[c] == 0 or _has_changed(c, first, last, cells, tiles, changed, visited[c], here):
                end = _end_of_box(c, ends, first, last, cells, circle, beyond, here)
            visited[c] = clock
            if end != ends[c]:
                ends[c], again = end, True
                tile, size = 0, len(ends)
                for j in range(len(cells)):
                    size //= cells[j]
                    tile = tile * tiles[j] + (((c // size) % cells[j]) >> _TILE)
                changed[tile] = clock
            if end != SEVERAL:
                order[kept] = c
                kept += 1
        left = kept


@loop
def _by_time(ends, fixed, first, last, cells, circle, order):
    """Write the cells whose ends are to be found, each behind the one that holds the middle of its image; count them.

    Ends travel against the map: in this sequence most have arrived after one pass.
    """
    n, d = first.shape
    seen, path = np.zeros(n, np.uint8), np.empty(n, np.int64)
    written = 0
    for c in range(n):
        length, at = 0, c
        while at >= 0 and seen[at] == 0:
            seen[at] = 1
            if fixed[at] or ends[at] == SEVERAL:
                break
            path[length] = at
            length += 1
            following = 0
            for j in range(d):
                middle = (first[at, j] + last[at, j]) // 2
                if circle[j] == cells[j]:
                    middle %= cells[j]
                inside = 0 <= middle < cells[j] and first[at, j] <= last[at, j]
                following = following * cells[j] + middle if inside and following >= 0 else -1
            at = following
        while length > 0:
            length -= 1
            order[written] = path[length]
            written += 1
    return written


@inlined
def _has_changed(c, first, last, cells, tiles, changed, visited, here):
    """Tell whether tiles that a box of cells meets have changed since its cell was visited, or the box leaves them."""
    for j in range(len(cells)):
        if first[c, j] < 0 or last[c, j] >= cells[j]:
            return True
        here[j] = first[c, j] >> _TILE
    while True:
        tile = 0
        for j in range(len(cells)):
            tile = tile * tiles[j] + here[j]
        if changed[tile] > visited:
            return True
        j = len(cells) - 1
        while j >= 0:
            here[j] += 1
            if here[j] <= last[c, j] >> _TILE:
                break
            here[j] = first[c, j] >> _TILE
            j -= 1
        if j < 0:
            return False


@inlined
def _end_of_box(c, ends, first, last, cells, circle, beyond, here):
    """Return the end of a cell and of all cells that its image can touch."""
    e = len(cells) - 1  # along the last axis cells are neighbours in memory
    # Ends other than 0 are all the same where the bits that some have are those that all have.
    some = np.int64(ends[c])
    every = some if some != 0 else SEVERAL
    for j in range(e):
        here[j] = first[c, j]
    low, high = np.int64(first[c, e]), np.int64(last[c, e])
    plain = low >= 0 and high < cells[e]
    more = True
    while more and (some == every or some == 0):
        flat, inside = 0, True
        for j in range(e):
            at = here[j]
            if not 0 <= at < cells[j]:
                inside = inside and circle[j] == cells[j]
                at %= cells[j]
            flat = (flat + at) * cells[j + 1]
        if not inside:
            some, every = some | beyond, every & beyond
        elif plain:
            for k in range(flat + low, flat + high + 1):
                end = np.int64(ends[k])
                some |= end
                every &= end if end != 0 else SEVERAL
        else:
            for k in range(low, high + 1):
                on = circle[e] == cells[e] or 0 <= k < cells[e]
                end = np.int64(ends[flat + k % cells[e]]) if on else beyond
                some |= end
                every &= end if end != 0 else SEVERAL
        more = False
        for j in range(e - 1, -1, -1):
            if not more:
                here[j] += 1
                more = here[j] <= last[c, j]
                if not more:
                    here[j] = first[c, j]
    return some if some == every or some == 0 else SEVERAL
