"""Pack initial conditions into blocks of lanes, unpack their images, and wrap angles."""

from __future__ import annotations

import numpy as np

from ..loops import inlined, loop

LANES = 32
"""Initial conditions that step together, in vectors.  A vector is always full (the last one is repeated), so each of
them passes through the same machine code wherever it stands, and its image has the same bits."""

BLOWN_UP = -1.0
"""Error, and ratio of error to tolerance, of a state that blows up: more steps would not save it."""

FARTHEST_STATE = 1e100
"""Size of a coordinate from which on an orbit has diverged: the squares of errors overflow from 1e154 on."""

END_PLACE = 2.0**600
"""First coordinate of orbits that have come to the first of the ends of a system, and multiples at the others."""

ROUNDED = 2.0**-48
"""What rounding may add in a period, as a part of the largest component, or of its time: no tolerance is held to it."""

MOST_TURNS = 1e15
"""Full rotations from which on an angle has no phase: floating-point numbers of that size lie a tenth of a period
apart."""


@loop
def pack(points, members, blocks):
    """Copy rows of points into full blocks; the last member is repeated where members run out."""
    for b in range(blocks.shape[0]):
        for i in range(LANES):
            row = members[min(b * LANES + i, members.size - 1)]
            for j in range(points.shape[1]):
                blocks[b, j, i] = points[row, j]


UNRESOLVED, RESOLVED_AGAIN = 1e190, 1e290
"""Between these, errors stand for steps that pass over what they do not see, as written in
:mod:`cellmap._compiled.codegen.resolution`."""


@loop
def unpack(motion, blocks, errors, members, images, ratios):
    """Copy lanes back to rows of images, with the largest ratio of estimated error to tolerance; NaN where not finite.

    A ratio of BLOWN_UP, as the error of the first component, stands for a state that more steps would not save.  Where
    steps are too long to see something, the ratio asks for as many as they are too long, by errors of that order.

    The relative part of the tolerance refers to abs(x), but to no more than half the period of an angle.
    """
    largest, rtol, atol, order = motion.largest, motion.rtol, motion.atol, motion.order
    for m in range(members.size):
        b, i, row = m // LANES, m % LANES, members[m]
        worst = 0.0
        for j in range(images.shape[1]):
            x = blocks[b, j, i]
            images[row, j] = x
            error = errors[b, j, i]
            ratio = error / (atol[j] + rtol * min(abs(x), largest[j]))
            if UNRESOLVED < error < RESOLVED_AGAIN:
                ratio = max((error / 1e200) ** (0.125 * order), 1.1)
            # A NaN wins and stays: no comparison with it is true.
            worst = ratio if ratio > worst or ratio != ratio else worst
            worst = worst if abs(x) < np.inf else np.nan
        ratios[row] = BLOWN_UP if errors[b, 0, i] == BLOWN_UP else worst


@loop
def product_rows(axes, shape, begin, rows, points):
    """Write points of the product of axes, by their flat row-major numbers.

    The axes lie one behind the other.  The numbers are those of the rows, or consecutive ones where there are no rows.
    """
    for i in range(points.shape[0]):
        rest, end = begin + i if rows.size == 0 else rows[i], axes.size
        for j in range(shape.size - 1, -1, -1):
            above = rest // shape[j]
            end -= shape[j]
            points[i, j] = axes[end + rest - above * shape[j]]
            rest = above


@loop
def wrap_rows(points, rotations, lower, turn):
    """Wrap angles and count the full rotations taken away; angles without phase become NaN.

    Returns how many have none.
    """
    lost = 0
    for i in range(points.shape[0]):
        for j in range(points.shape[1]):
            lost += not wrap_angle(points, rotations, i, j, lower[j], turn[j])
    return lost


@inlined
def wrap_angle(points, rotations, i, j, lower, turn):
    """Wrap a component of a row, counting full rotations; return whether it has a phase."""
    x, whole = in_turn(points[i, j], lower, turn)
    points[i, j] = x
    rotations[i, j] += np.int64(whole)
    return not turn > 0.0 or x == x


@inlined
def in_turn(x, lower, turn):
    """Return where a number is in the period that begins at an edge, NaN without phase, and the rotations taken out.

    A number that is there stays as it is, so that wrapping again changes nothing; a period of 0 stands for the line.
    """
    whole = 0.0
    if turn > 0.0 and not lower <= x < lower + turn:
        whole = np.floor((x - lower) / turn)
        if not abs(whole) < MOST_TURNS:
            return np.nan, 0.0
        x = max(x - whole * turn, lower)
        if x >= lower + turn:
            x = lower
            whole += 1.0
    return x, whole


@inlined
def shortest(x, turn):
    """Return a difference on a circle the shorter way round."""
    return x - turn * np.floor(x * (1.0 / turn) + 0.5)


@inlined
def place_of(x, origin, inverse, circle):
    """Return where a coordinate is, in cells from the first edge; wrapped on a circle, and NaN there without phase."""
    place, _ = in_turn((x - origin) * inverse, 0.0, circle)
    return place
