"""Where a table sends its cells: derivatives and errors of each, the cells that its image touches, and their ends.

Derivatives and errors are in widths of a cell, boxes in numbers of cells from the first.
"""

from __future__ import annotations

import functools
from math import floor, sqrt

import numpy as np

from ..loops import inlined, loop
from .certainty import NONE, touches

FARTHEST = 1e15
"""Cells from the first edge beyond which an image is not known."""

SEVERAL = -1
"""An end of paths over images of cells: more than one, or one that is not known."""

_FAR = 2**30  # cells from the first, outside of any table
_TILE = 5  # cells of a tile along each axis, 2 to this: their changes are noticed together


@loop
def differences(images, rotations, turn, origin, inverse, step, slopes, places):
    """Compute derivatives (n, d, d) and the places (n, d) of images of centres, in cells.

    ``images`` and ``rotations`` (n (1 + 2 d), d) are those of each centre, and of points a step to both sides of it.
    """
    n, d = places.shape
    for c in range(n):
        r = c * (1 + 2 * d)
        for i in range(d):
            places[c, i] = (images[r, i] + turn[i] * rotations[r, i] - origin[i]) * inverse[i]
            for j in range(d):
                a, b = r + 1 + 2 * j, r + 2 + 2 * j
                change = images[b, i] - images[a, i] + turn[i] * (rotations[b, i] - rotations[a, i])
                slopes[c, i, j] = change * inverse[i] / (2.0 * step)


@inlined
def _beside(number, j, cells, wraps, stride):
    """Return by how much the numbers of the cells before and behind a cell along an axis differ from its own."""
    at = (number // stride) % cells[j]
    before = -stride if at > 0 else ((cells[j] - 1) * stride if wraps[j] else 0)
    behind = stride if at < cells[j] - 1 else (-(cells[j] - 1) * stride if wraps[j] else 0)
    return before, behind


@functools.cache
def curving(d):
    """Return the function ``curve`` for a dimension."""

    @loop
    def curve(slopes, cells, wraps, begin, end, curved):
        """Write into ``curved`` (n, d, d) how far derivatives are from a straight line over the neighbours."""
        for c in range(begin, end):
            for i in range(d):
                for k in range(d):
                    curved[c, i, k] = 0.0
            stride = 1
            for j in range(d - 1, -1, -1):
                before, behind = _beside(c, j, cells, wraps, stride)
                for i in range(d):
                    for k in range(d):
                        bend = slopes[c + before, i, k] - 2.0 * slopes[c, i, k] + slopes[c + behind, i, k]
                        curved[c, i, k] += abs(bend) / 8.0
                stride *= cells[j]

    return curve


@functools.cache
def bounding(d):
    """Return the function ``bound`` for a dimension."""

    @loop
    def bound(table, slopes, curved, images, indicator, rough, numbers, begin, end, bends, errors, tolerances):
        """Bound the changes of derivatives over a cell (n, 2) and errors, by the largest in the cell and around it.

        ``table`` is (origin, widths, cells, wraps), ``numbers`` (safety, largest error, rtol, atol).  ``bends[:, 0]``
        is the change from a cell to the next, ``bends[:, 1]`` twice the distance from a straight line: where a line
        bends, it may bend more next to the centre.
        """
        origin, widths, cells, wraps = table
        safety, unbounded, rtol, atol = numbers
        shifts, around = np.empty((d, 3), np.int64), np.empty(3**d, np.int64)
        most, line = np.empty((d, d)), np.empty((d, d))
        for c in range(begin, end):
            stride = 1
            for j in range(d - 1, -1, -1):
                shifts[j, 0], shifts[j, 2] = _beside(c, j, cells, wraps, stride)
                shifts[j, 1] = 0
                stride *= cells[j]
            error = 0.0
            for m in range(3**d):
                at, rest = c, m
                for j in range(d):
                    at += shifts[j, rest % 3]
                    rest //= 3
                around[m] = at
                here = np.float64(indicator[at])
                here = here if here < unbounded else unbounded
                error = here if here > error else error
            most[:] = 0.0
            line[:] = 0.0
            for m in range(3**d):
                at = around[m]
                for i in range(d):
                    for k in range(d):
                        # No comparison with a NaN is true.
                        difference, bend = abs(slopes[at, i, k] - slopes[c, i, k]), curved[at, i, k]
                        most[i, k] = difference if difference > most[i, k] else most[i, k]
                        line[i, k] = bend if bend > line[i, k] else line[i, k]
            known, change, bent = True, 0.0, 0.0
            for i in range(d):
                for k in range(d):
                    known = known and abs(slopes[c, i, k]) < np.inf
                    change += most[i, k] * most[i, k]
                    bent += line[i, k] * line[i, k]
            tolerance = 0.0
            for j in range(d):
                share = (atol + rtol * abs(origin[j] + images[c, j] * widths[j])) / widths[j]
                known = known and share < np.inf
                tolerance = max(tolerance, share)
            bends[c, 0], bends[c, 1] = sqrt(change), 2.0 * sqrt(bent)
            tolerances[c] = tolerance if known else np.inf
            errors[c] = safety * error + tolerance if known and not rough[c] else np.inf

    return bound


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
def boxes_of(middle, reach, cells, circle, most, overhangs, begin, end, first, last):
    """Write the first and the last cell that an image can touch along each axis; return nothing.

    Where they are not known, ``last`` is smaller than ``first``: the image is too far, touches more than `most` cells,
    lies where an angle leaves the window that it comes back to, or leaves it where an attractor lies across
    (``overhangs``, boxes (n, 2, d)).
    """
    d = len(cells)
    low, high = np.zeros(d, np.int64), np.zeros(d, np.int64)
    for c in range(begin, end):
        known, touched = True, 1.0
        leaves = False
        for j in range(d):
            at, far = middle[c, j], reach[c, j]
            if circle[j] > 0.0:
                at -= circle[j] * floor(at / circle[j])
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
    centres, metrics, numbers = neighbourhoods
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
                        shift[j] -= turn[j] * floor(shift[j] / turn[j] + 0.5)
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
    cells that are ``fixed`` keep theirs.  ``first`` and ``last`` (n, d) int32 are the boxes of cells that hold the image
    of each cell, and ``beyond`` is the end of what lies outside of the grid.
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

    Ends travel against the map: in this sequence most have arrived after one round.
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
    more = low <= high
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
