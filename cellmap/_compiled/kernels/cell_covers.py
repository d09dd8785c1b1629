"""Cells that enclosed images can meet, and labels of cells that follow from those of the cells that they meet.

A set is a zonotope: a centre, generators that are added with factors between -1 and 1, and a box of radii.  Cells are
boxes around their centres with one half-width along each axis, which covers the rounding of their edges.  No cell that
a set meets is left out: bounds of rounding are added wherever a cell is found to be away from a set.
"""

from __future__ import annotations

from collections import namedtuple
from math import floor, inf

import numpy as np

from ..loops import inlined, loop
from .blocks import shortest

Forms = namedtuple("Forms", "images derivatives spreads")
"""Mean-value forms of rows: images (n, d), derivatives (n, d, d), and how far points are from what these say (n, d)."""

Place = namedtuple("Place", "edges mids first cells wraps turn middle half largest")
"""Where cells are.

``edges`` (d, longest) of all cells along each axis, of three turns of a circle that is covered, with the number of the
first cell in ``first`` (d,), ``mids`` (d, longest) the centres between them, ``cells`` (d,) how many there are,
``wraps`` (d,) whether they go round, ``turn`` (d,) periods of angles, 0 for others, ``middle`` (d,) of the region, by
which angles are unwrapped, ``half`` (d,) half-widths of all cells, and ``largest`` (d,) the largest coordinate.
"""

HOPELESS = -1
"""Label of a cell that will not be proved in this pass: what meets it is not looked at further."""


@inlined(contract=False)
def mapped_cell(e, forms, half, rounding, centre, generators, box):
    """Write the set that a mean-value form makes of a box with these half-widths; tell whether it is known."""
    d = len(half)
    known = True
    for i in range(d):
        centre[i] = forms.images[e, i]
        spread = forms.spreads[e, i]
        for k in range(d):
            generators[i, k] = forms.derivatives[e, i, k] * half[k]
            spread += rounding.unit * abs(generators[i, k]) + rounding.tiny
        box[i] = spread * rounding.wider
        known = known and box[i] < inf and abs(centre[i]) < inf
    return known


@inlined(contract=False)
def unwrap(centre, box, place, rounding):
    """Shift angles of a set next to the middle of the region; their period is known to a unit in the last place."""
    for i in range(len(centre)):
        if place.turn[i] > 0.0:
            turns = floor((centre[i] - place.middle[i]) / place.turn[i] + 0.5)
            if turns != 0.0:
                away = turns * place.turn[i]
                centre[i] -= away
                # The product, the period and the difference.
                box[i] = (box[i] + 3.0 * rounding.unit * abs(away) + rounding.unit * abs(centre[i])) * rounding.wider


@inlined(contract=False)
def normals_to(generators, count, rounding, normals):
    """Write vectors along which zonotopes are thin; return their number.  Any vector is right, few are useful."""
    d = len(generators)
    number = 0
    if d == 2:
        for k in range(count):
            normals[number, 0], normals[number, 1] = -generators[1, k], generators[0, k]
            number += 1
    if d == 3:
        for group in range(count // 3):
            for k in range(3):
                a, b = 3 * group + (k + 1) % 3, 3 * group + (k + 2) % 3
                for i in range(3):
                    j, m = (i + 1) % 3, (i + 2) % 3
                    normals[number, i] = generators[j, a] * generators[m, b] - generators[m, a] * generators[j, b]
                number += 1
    for n in range(number):
        size = 0.0
        for i in range(d):
            size = max(size, abs(normals[n, i]))
        if size > rounding.tiny and size < inf:
            for i in range(d):
                normals[n, i] /= size
        else:
            for i in range(d):
                normals[n, i] = 0.0
    return number


@inlined(contract=False)
def limits_of(centre, generators, count, box, normals, number, place, rounding, limits):
    """Write how far the centre of a cell that a set meets can be from that of the set, along each normal."""
    d = len(centre)
    for n in range(number):
        extent, scale = 0.0, 0.0
        for k in range(count):
            product = 0.0
            for i in range(d):
                product += normals[n, i] * generators[i, k]
                scale += abs(normals[n, i] * generators[i, k])
            extent += abs(product)
        for i in range(d):
            extent += abs(normals[n, i]) * (box[i] + place.half[i])
            scale += abs(normals[n, i]) * (abs(centre[i]) + place.largest[i])
        # Products and sums of d terms, here and where a cell is compared with the limit.
        limits[n] = (extent + (2.0 * d + 4.0) * rounding.unit * scale + rounding.tiny) * rounding.wider


@inlined(contract=False)
def box_of_cells(centre, generators, count, box, place, rounding, low, high):
    """Write the first and the last cell that a set meets along each axis; tell whether all are in the region."""
    inside = True
    for i in range(len(centre)):
        reach = box[i]
        for k in range(count):
            reach += abs(generators[i, k])
        reach = (reach + 2.0 * rounding.unit * (abs(centre[i]) + reach)) * rounding.wider
        begin, end = place.first[i], place.first[i] + place.cells[i]
        least = 0 if place.wraps[i] != 0 else begin
        most = 3 * place.cells[i] if place.wraps[i] != 0 else end
        below, above = centre[i] - reach, centre[i] + reach
        known = below >= place.edges[i, least] and above <= place.edges[i, most]
        if place.wraps[i] != 0:
            known = known and reach < 0.5 * place.turn[i]
        inside = inside and known
        if known:
            width = 2.0 * place.half[i]
            at = max(least, min(most - 1, begin + np.int64(floor((below - place.edges[i, begin]) / width))))
            while at > least and place.edges[i, at] > below:
                at -= 1
            while at < most - 1 and place.edges[i, at + 1] < below:
                at += 1
            low[i] = at
            at = max(at, min(most - 1, begin + np.int64(floor((above - place.edges[i, begin]) / width))))
            while at < most - 1 and place.edges[i, at + 1] < above:
                at += 1
            while at > low[i] and place.edges[i, at] > above:
                at -= 1
            high[i] = at
    return inside


@inlined(contract=False)
def cell_at(here, place):
    """Return the flat number of a cell, given by its places along the axes, those of circles in any of three turns."""
    flat = 0
    for i in range(len(here)):
        at = here[i] - place.first[i]
        if place.wraps[i] != 0:
            at = (at + place.cells[i]) % place.cells[i]
        flat = flat * place.cells[i] + at
    return flat


@inlined(contract=False)
def is_away(here, centre, normals, number, limits, place):
    """Tell whether a normal separates a cell from a set."""
    for n in range(number):
        gap = 0.0
        for i in range(len(here)):
            gap += normals[n, i] * (place.mids[i, here[i]] - centre[i])
        if abs(gap) > limits[n]:
            return True
    return False


@inlined(contract=False)
def following(here, low, high):
    """Step to the next cell of a box of cells; tell whether there is one."""
    for j in range(len(here)):
        i = len(here) - 1 - j
        here[i] += 1
        if here[i] <= high[i]:
            return True
        here[i] = low[i]
    return False


@loop(contract=False)
def list_met(forms, half, place, rounding, labels, met, counts, begin, end):
    """Write the cells that the image of each box meets; no cells where the box cannot be proved in this pass.

    ``met`` (rows, most) int32 holds their flat numbers and ``counts`` (rows,) how many there are.
    """
    d = len(half)
    centre, box, generators = np.zeros(d), np.zeros(d), np.zeros((d, d))
    normals, limits = np.zeros((d, d)), np.zeros(d)
    low, high, here = np.zeros(d, np.int64), np.zeros(d, np.int64), np.zeros(d, np.int64)
    for e in range(begin, end):
        counts[e] = 0
        if not mapped_cell(e, forms, half, rounding, centre, generators, box):
            continue
        unwrap(centre, box, place, rounding)
        if not box_of_cells(centre, generators, d, box, place, rounding, low, high):
            continue
        size = 1.0
        for i in range(d):
            size *= float(high[i] - low[i] + 1)
            here[i] = low[i]
        if size > 16.0 * met.shape[1]:
            continue
        number = normals_to(generators, d, rounding, normals)
        limits_of(centre, generators, d, box, normals, number, place, rounding, limits)
        found, label, more = 0, np.int64(0), True
        while more:
            if not is_away(here, centre, normals, number, limits, place):
                flat = cell_at(here, place)
                own = np.int64(labels[flat])
                clash = own > 0 and label > 0 and own != label
                if own == HOPELESS or clash or found == met.shape[1]:
                    found, more = 0, False
                else:
                    if own > 0:
                        label = own
                    met[e, found] = flat
                    found += 1
            if more:
                more = following(here, low, high)
        counts[e] = found


@loop
def prove_cells(cells, bounds, met, labels, ranks):
    """Prove cells all of whose met cells are proved with one label, as long as there are any; return how many.

    ``cells`` (m,) are the flat numbers of cells, ``met[bounds[e] : bounds[e + 1]]`` what cell e meets.  The rank of a
    cell is larger than those of the cells that it meets.
    """
    count, left = 0, len(cells)
    order = np.empty(left, np.int64)
    for e in range(left):
        order[e] = e
    more = True
    while more:
        more = False
        kept = 0
        for m in range(left):
            e = order[m]
            c = cells[e]
            label, rank, known, alive = np.int64(0), np.int64(0), True, True
            if labels[c] > 0:
                continue
            for k in range(bounds[e], bounds[e + 1]):
                own = np.int64(labels[met[k]])
                if own <= 0:
                    known = False
                elif label > 0 and own != label:
                    alive = False
                    break
                else:
                    label = own
                    rank = max(rank, np.int64(ranks[met[k]]))
            if not alive:
                continue
            if known and label > 0:
                labels[c], ranks[c] = label, rank + 1
                count += 1
                more = True
            else:
                order[kept] = e
                kept += 1
        left = kept
        # Against the sequence as well: labels travel either way.
        for m in range(left // 2):
            order[m], order[left - 1 - m] = order[left - 1 - m], order[m]
    return count


@inlined(contract=False)
def ball_around(centre, generators, count, box, balls, turn, rounding):
    """Return the number of a ball that holds a set as a whole, -1 for none.

    ``balls`` are (centres, forms, radii): those of points x with ``|form @ (x - centre)| <= radius``.
    """
    centres, forms, radii = balls
    d = len(centre)
    for b in range(len(radii)):
        total = 0.0
        for i in range(d):
            at, spread = 0.0, 0.0
            for j in range(d):
                gap = centre[j] - centres[b, j]
                if turn[j] > 0.0:
                    gap = shortest(gap, turn[j])
                around = abs(centre[j]) + abs(centres[b, j]) + 4.0 * turn[j]
                at += forms[b, i, j] * gap
                spread += abs(forms[b, i, j]) * (box[j] + (d + 4.0) * rounding.unit * around + rounding.tiny)
            for k in range(count):
                along = 0.0
                for j in range(d):
                    along += forms[b, i, j] * generators[j, k]
                    spread += d * rounding.unit * abs(forms[b, i, j] * generators[j, k])
                spread += abs(along)
            reach = (abs(at) + spread) * rounding.wider
            total += reach * reach + rounding.tiny  # squares may vanish
        if total * rounding.wider < radii[b] * radii[b]:
            return b
    return -1


@loop(contract=False)
def cells_in_balls(place, balls, numbers, rounding, labels, ranks):
    """Label the cells that lie in a ball as a whole by the number of its attractor."""
    d = len(place.cells)
    centre, generators = np.zeros(d), np.zeros((d, 1))
    here = np.zeros(d, np.int64)
    for c in range(len(labels)):
        rest = c
        for j in range(d):
            i = d - 1 - j
            here[i] = place.first[i] + rest % place.cells[i]
            rest //= place.cells[i]
            centre[i] = place.mids[i, here[i]]
        if labels[c] <= 0:
            b = ball_around(centre, generators, 0, place.half, balls, place.turn, rounding)
            if b >= 0:
                labels[c], ranks[c] = numbers[b], 0
