"""Orbits of sets: parallelepipeds with a remainder in an orthogonal frame of its own (Lohner 1987).

A set is {c + A s + Q t: |s_i| <= w_i, |t_i| <= rho_i}.  Those of flows are made of what their enclosures carry along.
For discrete maps a mean-value form over a box that holds a set takes c to the image, A to its product with the
derivative, and everything that is not known exactly into the remainder, whose frame is turned so that it does not grow
by being wrapped into boxes.
"""

from __future__ import annotations

from collections import namedtuple
from math import inf, sqrt

import numpy as np

from ..loops import inlined, loop
from .cell_covers import (
    ball_around,
    box_of_cells,
    cell_at,
    following,
    is_away,
    limits_of,
    normals_to,
    unwrap,
)

Sets = namedtuple("Sets", "centres shapes sizes frames spreads hulls")
"""Centres (n, d), shapes A (n, d, m) with sizes w (n, m), frames Q (n, d, d) with spreads rho (n, d), and half-widths
of boxes around (n, d)."""

FAILED, GOING = -1, 0
"""Outcomes of a set without a label: it has no enclosed image or is too wide, or may go on."""

_MOST = 4096.0  # cells of a set that are looked at


@inlined(contract=False)
def turned_frame(product, spread, frame):
    """Write a nearly orthogonal frame: the columns of a product, the longest side first, by Gram and Schmidt."""
    d = len(spread)
    used = np.zeros(d, np.int64)
    for column in range(d):
        best, longest = 0, -1.0
        for k in range(d):
            size = 0.0
            for i in range(d):
                size += product[i, k] * product[i, k]
            size *= spread[k] * spread[k]
            if used[k] == 0 and size > longest:
                best, longest = k, size
        used[best] = 1
        for i in range(d):
            frame[i, column] = product[i, best]
        accepted = False
        for attempt in range(d + 1):
            before = 0.0
            for i in range(d):
                before += frame[i, column] * frame[i, column]
            for _again in range(2):
                for k in range(column):
                    along = 0.0
                    for i in range(d):
                        along += frame[i, k] * frame[i, column]
                    for i in range(d):
                        frame[i, column] -= along * frame[i, k]
            size = 0.0
            for i in range(d):
                size += frame[i, column] * frame[i, column]
            if size > 1e-20 * before and size > 0.0:
                for i in range(d):
                    frame[i, column] /= sqrt(size)
                accepted = True
                break
            for i in range(d):  # nothing is left of it: any axis that is not among the others does as well
                frame[i, column] = 1.0 if i == attempt else 0.0
        if not accepted:
            return False
    return True


@inlined(contract=False)
def astray(frame, rounding):
    """Return a bound of the row sums of ``1 - frame' frame``."""
    d = len(frame)
    worst = 0.0
    for i in range(d):
        row = 0.0
        for k in range(d):
            product, scale = 0.0, 0.0
            for j in range(d):
                product += frame[j, i] * frame[j, k]
                scale += abs(frame[j, i] * frame[j, k])
            unit = 1.0 if i == k else 0.0
            row += abs(unit - product) + (d + 2.0) * rounding.unit * (scale + unit)
        worst = max(worst, row)
    return worst * rounding.wider


@inlined(contract=False)
def next_set(e, sets, forms, errors, product, frame, rounding):
    """Replace a set by one that holds its image; tell whether there is one."""
    centres, shapes, sizes, frames, spreads, hulls = sets
    d = centres.shape[1]
    # What is not known: images of the hull, and products of matrices.
    for i in range(d):
        errors[i] = forms.spreads[e, i]
    for i in range(d):
        for k in range(d):
            total, scale = 0.0, 0.0
            for j in range(d):
                total += forms.derivatives[e, i, j] * shapes[e, j, k]
                scale += abs(forms.derivatives[e, i, j] * shapes[e, j, k])
            product[i, k] = total
            errors[i] += (d + 1.0) * (rounding.unit * scale + rounding.tiny) * sizes[e, k]
    for i in range(d):
        for k in range(d):
            shapes[e, i, k] = product[i, k]
    for i in range(d):
        for k in range(d):
            total, scale = 0.0, 0.0
            for j in range(d):
                total += forms.derivatives[e, i, j] * frames[e, j, k]
                scale += abs(forms.derivatives[e, i, j] * frames[e, j, k])
            product[i, k] = total
            errors[i] += (d + 1.0) * (rounding.unit * scale + rounding.tiny) * spreads[e, k]
        errors[i] *= rounding.wider
        centres[e, i] = forms.images[e, i]
    if not turned_frame(product, spreads[e], frame):
        return False
    left = astray(frame, rounding)
    if not left < 0.5:
        return False
    # The transposed frame is nearly the inverse: t = F'z + (1 - F'F) t.
    largest = 0.0
    for i in range(d):
        total = 0.0
        for k in range(d):
            along, scale = 0.0, 0.0
            for j in range(d):
                along += frame[j, i] * product[j, k]
                scale += abs(frame[j, i] * product[j, k])
            total += (abs(along) + (d + 1.0) * (rounding.unit * scale + rounding.tiny)) * spreads[e, k]
        for j in range(d):
            total += abs(frame[j, i]) * errors[j]
        hulls[e, i] = total * rounding.wider  # kept here until all are known
        largest = max(largest, hulls[e, i])
    known = True
    for i in range(d):
        spreads[e, i] = (hulls[e, i] + left / (1.0 - left) * largest) * rounding.wider
        known = known and spreads[e, i] < inf and abs(centres[e, i]) < inf
        for k in range(d):
            frames[e, i, k] = frame[i, k]
    return known


@loop(contract=False)
def carry_sets(sets, forms, rounding, known, begin, end):
    """Replace sets by those that hold their images, by mean-value forms over their hulls; tell which are known."""
    d = sets.centres.shape[1]
    errors, product, frame = np.zeros(d), np.zeros((d, d)), np.zeros((d, d))
    for e in range(begin, end):
        known[e] = next_set(e, sets, forms, errors, product, frame, rounding)


@loop(contract=False)
def find_sets(sets, known, place, balls, numbers, widest, labels, ranks, rounding, outcome, reached, begin, end):
    """Write the label of known sets that are in a ball or where all is proved with one label, and their hulls.

    ``outcome`` (n,) is a label, GOING or FAILED; ``reached`` is one more than the ranks of the cells that a set
    meets.  Sets wider than `widest` (d,) along an axis fail.  Without ``labels`` only balls are looked at.
    """
    d, columns = len(widest), sets.shapes.shape[2]
    count = columns + d
    centre, box, generators = np.zeros(d), np.zeros(d), np.zeros((d, count))
    normals, limits = np.zeros((count, d)), np.zeros(count)
    low, high, here = np.zeros(d, np.int64), np.zeros(d, np.int64), np.zeros(d, np.int64)
    for e in range(begin, end):
        outcome[e], reached[e], narrow = FAILED, 0, known[e]
        for i in range(d):
            reach, centre[i] = 0.0, sets.centres[e, i]
            box[i] = 0.0
            for k in range(count):
                if k < columns:
                    generators[i, k] = sets.shapes[e, i, k] * sets.sizes[e, k]
                else:
                    generators[i, k] = sets.frames[e, i, k - columns] * sets.spreads[e, k - columns]
                # A unit of each, lost in these products, is less than what is added where sums of them are taken: with
                # d units for d products and sums, the last sum loses none where its terms cancel.
                reach += abs(generators[i, k])
                box[i] += rounding.tiny
            sets.hulls[e, i] = (reach + box[i]) * rounding.wider
            narrow = narrow and sets.hulls[e, i] < widest[i]
        if not narrow:
            continue
        outcome[e] = GOING
        unwrap(centre, box, place, rounding)
        b = ball_around(centre, generators, count, box, balls, place.turn, rounding)
        if b >= 0:
            outcome[e], reached[e] = numbers[b], 1
            continue
        if len(labels) == 0 or not box_of_cells(centre, generators, count, box, place, rounding, low, high):
            continue
        size = 1.0
        for i in range(d):
            size *= float(high[i] - low[i] + 1)
            here[i] = (low[i] + high[i]) // 2
        label = np.int64(labels[cell_at(here, place)])
        if label <= 0 or size > _MOST:
            continue
        number = normals_to(generators, count, rounding, normals)
        limits_of(centre, generators, count, box, normals, number, place, rounding, limits)
        rank, more = np.int64(0), True
        for i in range(d):
            here[i] = low[i]
        while more:
            if not is_away(here, centre, normals, number, limits, place):
                flat = cell_at(here, place)
                rank = max(rank, np.int64(ranks[flat]))
                if np.int64(labels[flat]) != label:
                    label, more = np.int64(0), False
            if more:
                more = following(here, low, high)
        if label > 0:
            outcome[e], reached[e] = label, rank + 1
