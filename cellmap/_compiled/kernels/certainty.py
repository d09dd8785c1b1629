"""What an error of a table can do to the labels of cells and of orbits.

Points are given in the units of their coordinates, errors in widths of a cell.  An error is an ellipsoid: its `spread`
S stands for the deviations e with ``e' inv(S) e <= 1``, so it reaches ``sqrt(S[i, i])`` along axis i.
"""

from __future__ import annotations

import functools
from math import floor, sqrt

import numpy as np

from ..loops import inlined, loop

NONE, LOST = -10, -11
"""No region holds the error as a whole; it overlaps an edge of the window, beyond which orbits end."""


@loop
def place_of(x, origin, inverse, circle):
    """Return where a coordinate is, in cells from the first edge; wrapped on a circle."""
    u = (x - origin) * inverse
    if circle > 0.0:
        u -= circle * floor(u / circle)
        u = u if 0.0 <= u < circle else 0.0
    return u


@loop
def touches(first, last, boxes):
    """Tell whether a box of cells shares one with any of others, whose first and last cells are given (n, 2, d)."""
    for m in range(len(boxes)):
        shared = True
        for j in range(len(first)):
            shared = shared and first[j] <= boxes[m, 1, j] and last[j] >= boxes[m, 0, j]
        if shared:
            return True
    return False


@loop
def owner_of_box(owners, first, last, cells, circle, escapes, outside, overhangs):
    """Return the owner that all cells of a box share, else NONE; LOST where it lies across an edge that ends orbits.

    ``outside`` is the owner of boxes beyond such an edge, except where they touch one of the boxes ``overhangs``
    (n, 2, d) of attractors that lie across it.
    """
    d = len(cells)
    here = np.empty(d, np.int64)
    leaves = False
    for j in range(d):
        if circle[j] == cells[j]:
            if last[j] - first[j] >= cells[j]:
                first[j], last[j] = 0, cells[j] - 1
        elif circle[j] > 0.0 and (last[j] + 1 > circle[j] or first[j] < cells[j] - circle[j]):
            return LOST if escapes else NONE  # across the rest of the turn, to where the window comes again
        elif last[j] < 0 or first[j] >= cells[j]:
            if not escapes:
                return NONE
            return LOST if touches(first, last, overhangs) else outside
        elif first[j] < 0 or last[j] >= cells[j]:
            leaves = True
        here[j] = first[j]
    if leaves:
        return LOST if escapes else NONE
    shared = NONE
    while True:
        flat = 0
        for j in range(d):
            flat = flat * cells[j] + (here[j] % cells[j])
        owner = owners[flat]
        if owner == NONE or (shared != NONE and owner != shared):
            return NONE
        shared = owner
        j = d - 1
        while j >= 0:
            here[j] += 1
            if here[j] <= last[j]:
                break
            here[j] = first[j]
            j -= 1
        if j < 0:
            return shared


@loop
def claim_within(owners, table, neighbourhoods, turn):
    """Give cells that lie in an ellipsoid as a whole its owner; other arguments as for :func:`judge`."""
    origin, inverse, cells, _ = table
    centres, metrics, numbers = neighbourhoods
    d = len(cells)
    shift = np.empty(d)
    for c in range(len(owners)):
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
    """Find for each cell the ends that some path over images of cells can reach.

    ``ends`` (n,) int64 holds a bit for each end and is changed in place; cells that are ``fixed`` keep theirs.
    ``first`` and ``last`` (n, d) int64 are the boxes of cells that hold the image of each cell, and ``beyond`` are the
    bits of what lies outside of the grid.  Cells that reach more than one end are not looked at again, and may have too
    few bits.
    """
    n, d = first.shape
    e = d - 1  # along the last axis cells are neighbours in memory
    here = np.empty(d, np.int64)
    forward = again = True
    while again:
        again = False
        for m in range(n):
            c = m if forward else n - 1 - m
            known = ends[c]
            if fixed[c] or known & (known - 1):
                continue
            bits = known
            for j in range(d):
                here[j] = first[c, j]
            plain = first[c, e] >= 0 and last[c, e] < cells[e]
            while not bits & (bits - 1):
                flat, inside = 0, True
                for j in range(e):
                    inside = inside and (circle[j] == cells[j] or 0 <= here[j] < cells[j])
                    flat = (flat + here[j] % cells[j]) * cells[j + 1]
                if not inside:
                    bits |= beyond
                elif plain:
                    for k in range(flat + first[c, e], flat + last[c, e] + 1):
                        bits |= ends[k]
                else:
                    for k in range(first[c, e], last[c, e] + 1):
                        on = circle[e] == cells[e] or 0 <= k < cells[e]
                        bits |= ends[flat + k % cells[e]] if on else beyond
                j = e - 1
                while j >= 0:
                    here[j] += 1
                    if here[j] <= last[c, j]:
                        break
                    here[j] = first[c, j]
                    j -= 1
                if j < 0:
                    break
            if bits != known:
                ends[c] = bits
                again = True
        forward = not forward


@loop
def judge(points, spread, cell_owners, table, escapes, outside, overhangs, neighbourhoods, turn, found):
    """Write into ``found`` the owner of the region that holds each point with all of its error, NONE or LOST.

    Regions are cells with an owner and ellipsoids around attractors; ``table`` is (origin, inverse, cells, circle),
    ``neighbourhoods`` (centres, metrics, owners), metrics in units of the coordinates.
    """
    origin, inverse, cells, circle = table
    centres, metrics, owners = neighbourhoods
    n, d = points.shape
    first, last = np.empty(d, np.int64), np.empty(d, np.int64)
    shift = np.empty(d)
    for i in range(n):
        found[i] = NONE
        finite = single = True
        flat = 0
        for j in range(d):
            reach = sqrt(spread[i, j, j])
            u = place_of(points[i, j], origin[j], inverse[j], circle[j])
            finite = finite and abs(u) + reach < 1e15
            if finite:
                first[j], last[j] = np.int64(floor(u - reach)), np.int64(floor(u + reach))
                # The far edge of the window belongs to it.
                if first[j] == cells[j] and u == cells[j] and circle[j] != cells[j]:
                    first[j] -= 1
                    last[j] -= 1
                flat = flat * cells[j] + first[j]
                single = single and first[j] == last[j] and 0 <= first[j] < cells[j]
        if not finite:
            continue
        if single:
            found[i] = cell_owners[flat]
        else:
            found[i] = owner_of_box(cell_owners, first, last, cells, circle, escapes, outside, overhangs)
        if found[i] != NONE:
            continue
        for m in range(len(owners)):
            distance = across = 0.0
            for j in range(d):
                shift[j] = points[i, j] - centres[m, j]
                if turn[j] > 0.0:
                    shift[j] -= turn[j] * floor(shift[j] / turn[j] + 0.5)
                for k in range(j + 1):
                    weight = metrics[m, j, k] * (1.0 if k == j else 2.0)
                    distance += weight * shift[j] * shift[k]
                    across += weight * spread[i, j, k] / (inverse[j] * inverse[k])
            if sqrt(max(distance, 0.0)) + sqrt(max(across, 0.0)) <= 1.0:
                found[i] = owners[m]
                break


@inlined
def carry(spread, slope, radius, work, d):
    """Replace an ellipsoid by one that holds its image under a matrix plus a ball: the smallest in the sum of squares.

    ``d`` is the dimension; ``work`` has room for two matrices.  Source: Kurzhanski, Valyi, *Ellipsoidal Calculus for
    Estimation and Control* (1997), 2.2.
    """
    half, image = work
    for i in range(d):
        for j in range(d):
            half[i, j] = image[i, j] = 0.0
    for i in range(d):
        for j in range(d):
            for k in range(d):
                half[i, j] += slope[i, k] * spread[k, j]
    trace = 0.0
    for i in range(d):
        for j in range(d):
            for k in range(d):
                image[i, j] += half[i, k] * slope[j, k]
        trace += image[i, i]
    own, added = sqrt(max(trace, 0.0)), sqrt(1.0 * d) * radius
    for i in range(d):
        for j in range(d):
            spread[i, j] = image[i, j] * (1.0 + added / own) if own > 0.0 else 0.0
        spread[i, i] += (own + added) * added / d


@loop
def carry_rows(spread, slopes, radii):
    """Carry errors over one period, given what the map makes of each and what the period adds."""
    d = spread.shape[1]
    work = np.empty((2, d, d))
    for i in range(len(spread)):
        carry(spread[i], slopes[i], radii[i], work, d)


@functools.cache
def widening(d):
    """Return the function ``widen`` for a dimension: loops of known length vanish."""

    @loop
    def widen(points, spread, table, slopes, bends, errors, unknown):
        """Carry errors over one period: what the map makes of them, and what the period adds.

        ``slopes`` (n, d, d) are derivatives at the centres of cells; between centres they are interpolated linearly,
        with an error of ``bends[:, 1]``, and over the width of a cell they change by ``bends[:, 0]``.  ``errors`` (n,)
        is the error of a period, all in widths of a cell.  Rows outside of the table or in cells whose error is
        infinite are marked in ``unknown`` and left as they are.
        """
        origin, inverse, cells, circle = table
        n = points.shape[0]
        work, slope = np.empty((2, d, d)), np.empty((d, d))
        place, lower = np.empty(d), np.empty(d, np.int64)
        for i in range(n):
            flat, inside = 0, True
            for j in range(d):
                u = place_of(points[i, j], origin[j], inverse[j], circle[j])
                inside = inside and 0.0 <= u <= cells[j]
                flat = flat * cells[j] + (min(np.int64(u), cells[j] - 1) if inside else 0)
                place[j] = u - 0.5
            unknown[i] = not (inside and errors[flat] < np.inf)
            if unknown[i]:
                continue
            for j in range(d):
                low = floor(place[j])
                if circle[j] != cells[j]:
                    low = min(max(low, 0.0), max(cells[j] - 2.0, 0.0))
                lower[j] = np.int64(low)
                place[j] -= low
            slope[:] = 0.0
            for corner in range(2**d):
                weight, number = 1.0, 0
                for j in range(d):
                    side = (corner >> j) & 1
                    weight *= place[j] if side else 1.0 - place[j]
                    number = number * cells[j] + (lower[j] + side) % cells[j]
                for j in range(d):
                    for k in range(d):
                        slope[j, k] += weight * slopes[number, j, k]
            reach = 0.0
            for j in range(d):
                reach += spread[i, j, j]
            reach = sqrt(reach)
            carry(spread[i], slope, errors[flat] + (bends[flat, 1] + 0.5 * bends[flat, 0] * reach) * reach, work, d)

    return widen
