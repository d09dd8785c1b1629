"""Labels of cells and of orbits that an error of a table can change.

Points are given in the units of their coordinates, errors in widths of a cell.  An error is an ellipsoid: its `spread`
S stands for the deviations e with ``e' inv(S) e <= 1``, so it reaches ``sqrt(S[i, i])`` along axis i.
"""

from __future__ import annotations

import functools
from math import floor, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..loops import inlined, loop
from .blocks import place_of, shortest

FARTHEST = 1e15
"""Cells from the first edge beyond which a place is not known."""

NONE, LOST = -10, -11
"""No region holds the error as a whole; it overlaps an edge of the window, beyond which orbits end."""


class Window(NamedTuple):
    """Owners of the cells of a table, where it is, and what is outside.

    Points are ``(x - origin) * inverse`` cells from the first edge, of ``cells`` along each axis; ``circle`` is the
    period of an angle in cells, or 0.  Where ``escapes`` is true orbits end outside, and ``outside`` is the owner of
    boxes there, but for those that touch one of the boxes ``overhangs`` (n, 2, d) of attractors that lie across it.
    """

    owners: NDArray[np.int16]
    origin: NDArray[np.float64]
    inverse: NDArray[np.float64]
    cells: NDArray[np.int64]
    circle: NDArray[np.float64]
    escapes: int
    outside: int
    overhangs: NDArray[np.int64]


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
def owner_of_box(window, first, last):
    """Return the owner that all cells of a box share, else NONE; LOST where it lies across an edge that ends orbits."""
    cells, circle, escapes = window.cells, window.circle, window.escapes
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
            return LOST if touches(first, last, window.overhangs) else window.outside
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
        owner = window.owners[flat]
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


@functools.cache
def judging(d):
    """Return the function ``judge`` for a dimension: loops of known length vanish."""

    @loop
    def judge(points, spread, window, neighbourhoods, reaches, turn, found):
        """Write into ``found`` the owner of the region that holds each point with all of its error, NONE or LOST.

        Regions are cells with an owner and ellipsoids around attractors, which are ``neighbourhoods``,
        metrics in units of the coordinates; ``reaches`` (m, d) is how far these reach from their centres.
        """
        origin, inverse, cells, circle = window.origin, window.inverse, window.cells, window.circle
        centres, metrics, owners = neighbourhoods.centres, neighbourhoods.metrics, neighbourhoods.owners
        first, last = np.empty(d, np.int64), np.empty(d, np.int64)
        shift = np.empty(d)
        for i in range(len(points)):
            found[i] = NONE
            finite = single = True
            flat = 0
            for j in range(d):
                reach = sqrt(spread[i, j, j])
                u = place_of(points[i, j], origin[j], inverse[j], circle[j])
                finite = finite and abs(u) + reach < FARTHEST
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
                found[i] = window.owners[flat]
            else:
                found[i] = owner_of_box(window, first, last)
            if found[i] != NONE:
                continue
            for m in range(len(owners)):
                distance = across = 0.0
                for j in range(d):
                    shift[j] = points[i, j] - centres[m, j]
                    if turn[j] > 0.0:
                        shift[j] = shortest(shift[j], turn[j])
                    if abs(shift[j]) > reaches[m, j]:
                        distance = np.inf  # as for most
                        break
                    for k in range(j + 1):
                        distance += metrics[m, j, k] * (1.0 if k == j else 2.0) * shift[j] * shift[k]
                if not distance <= 1.0:
                    continue
                for j in range(d):
                    for k in range(j + 1):
                        weight = metrics[m, j, k] * (1.0 if k == j else 2.0)
                        across += weight * spread[i, j, k] / (inverse[j] * inverse[k])
                if sqrt(max(distance, 0.0)) + sqrt(max(across, 0.0)) <= 1.0:
                    found[i] = owners[m]
                    break

    return judge


@loop
def sort_out(found, spread, status, rows, rule, outcome, places):
    """Write labels of rows that a region holds, and which of the others go on; return how many do.

    ``rows`` are the numbers of initial conditions, for which ``outcome`` has (patience, labels, times, evidence);
    ``places`` are (kept, lost, gone), which get places among the rows, and how many are lost.  The ``rule`` is (age,
    widest, mark, first): an orbit does not go on that overlaps an edge, has not the status OK, has an error of `widest`
    cells or more, or is older than its patience.  Labels from `first` on are those of regions.
    """
    (age, widest, mark, first), (kept, lost, gone) = rule, places
    patience, labels, times, evidence = outcome
    d, going = spread.shape[1], 0
    gone[0] = 0
    for i in range(len(rows)):
        r, label = rows[i], found[i]
        if label >= first:
            if labels[r] != label:
                labels[r], times[r] = label, age
            evidence[r] = mark
            continue
        size = 0.0
        for j in range(d):
            size += spread[i, j, j]
        if label == NONE and status[i] == 0 and size < widest * widest and age < patience[r]:
            kept[going] = i
            going += 1
        else:
            lost[gone[0]] = i
            gone[0] += 1
    return going


@loop
def keep_rows(kept, count, points, rotations, status, spread, rows):
    """Move the rows that go on to the front, in their sequence."""
    d = points.shape[1]
    for k in range(count):
        i = kept[k]
        if i != k:
            for j in range(d):
                points[k, j], rotations[k, j] = points[i, j], rotations[i, j]
                for m in range(d):
                    spread[k, j, m] = spread[i, j, m]
            status[k], rows[k] = status[i], rows[i]


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
    """Return the function ``widen`` for a dimension."""

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
        place, lower = np.empty(d), np.empty((d, 2), np.int64)
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
                place[j] -= low
                lower[j, 0], lower[j, 1] = np.int64(low), np.int64(low) + 1
                if lower[j, 0] < 0:
                    lower[j, 0] += cells[j]
                if lower[j, 1] >= cells[j]:
                    lower[j, 1] -= cells[j]
            slope[:] = 0.0
            for corner in range(2**d):
                weight, number = 1.0, 0
                for j in range(d):
                    side = (corner >> j) & 1
                    weight *= place[j] if side else 1.0 - place[j]
                    number = number * cells[j] + lower[j, side]
                for j in range(d):
                    for k in range(d):
                        slope[j, k] += weight * slopes[number, j, k]
            reach = 0.0
            for j in range(d):
                reach += spread[i, j, j]
            reach = sqrt(reach)
            carry(spread[i], slope, errors[flat] + (bends[flat, 1] + 0.5 * bends[flat, 0] * reach) * reach, work, d)

    return widen
