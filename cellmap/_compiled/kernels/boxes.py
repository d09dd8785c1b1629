"""Which boxes of a grid hold a boundary, and how points share boxes."""

from __future__ import annotations

import numpy as np

from ..loops import inlined, loop

NO_BASIN = np.int16(-1)
"""Number of cells that belong to no basin."""

_LOWEST = np.int16(32767)


@loop(vectors=True)
def mixed_boxes(labels, rows, first, last, out):
    """Write into ``out[r, j]`` whether the labels at the corners of a box between cell centres differ.

    ``labels`` (rows, n) of int16 is an image of any dimension with all axes but the last in one; ``rows[r]`` are the
    rows at the corners of the boxes r.  Where ``out`` is as wide as the image, the last axis is a circle.  A label
    `NO_BASIN` does not count.
    """
    n = labels.shape[1]
    wide = out.shape[1]
    low = np.empty(n + 1, np.int16)
    high = np.empty(n + 1, np.int16)
    for r in range(first, last):
        row = labels[rows[r, 0]]
        for j in range(n):
            v = row[j]
            high[j] = v
            low[j] = _LOWEST if v == NO_BASIN else v
        for c in range(1, rows.shape[1]):
            row = labels[rows[r, c]]
            for j in range(n):
                v = row[j]
                high[j] = max(high[j], v)
                low[j] = min(low[j], _LOWEST if v == NO_BASIN else v)
        high[n], low[n] = high[0], low[0]
        target = out[r]
        for j in range(wide):
            target[j] = min(low[j], low[j + 1]) < max(high[j], high[j + 1])


@inlined
def _spread(x):
    """Put a zero before each of the lower 31 bits."""
    x = (x | (x << np.uint64(16))) & np.uint64(0x0000FFFF0000FFFF)
    x = (x | (x << np.uint64(8))) & np.uint64(0x00FF00FF00FF00FF)
    x = (x | (x << np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    x = (x | (x << np.uint64(2))) & np.uint64(0x3333333333333333)
    return (x | (x << np.uint64(1))) & np.uint64(0x5555555555555555)


@loop
def morton_keys(points, scale, shift, boxes, bits, keys):
    """Write into ``keys`` (n,) of uint64 the bits of the boxes of points (n, d), the highest of all coordinates first.

    The box of x is ``floor(x * scale + shift)``, modulo ``boxes`` on a circle, where this is not 0.
    """
    n, d = points.shape
    place = np.empty(d, np.int64)
    for i in range(n):
        for j in range(d):
            place[j] = np.int64(np.floor(points[i, j] * scale[j] + shift[j]))
            if boxes[j] > 0:
                place[j] %= boxes[j]
        if d == 2:
            keys[i] = (_spread(np.uint64(place[0])) << np.uint64(1)) | _spread(np.uint64(place[1]))
            continue
        key = np.uint64(0)
        for b in range(bits - 1, -1, -1):
            for j in range(d):
                key = (key << np.uint64(1)) | np.uint64((place[j] >> b) & 1)
        keys[i] = key


@inlined
def _highest_bit(x):
    """Return the number of the highest bit that is set, 0 for none."""
    h = 0
    for step in (32, 16, 8, 4, 2, 1):
        if x >> np.uint64(step):
            x >>= np.uint64(step)
            h += step
    return h


@loop
def separations(keys, bits, d, out):
    """Write into ``out[i]`` the first level at which the sorted keys i - 1 and i are in different boxes.

    Level 0 is one box for all; a level halves the sides of boxes, and at level ``bits`` all bits of a key count.
    ``out`` (n + 1,) begins and ends with 0; keys that are equal have ``bits + 1``.
    """
    n = len(keys)
    out[0] = out[n] = 0
    for i in range(1, n):
        x = keys[i - 1] ^ keys[i]
        out[i] = bits + 1 if x == 0 else bits - _highest_bit(x) // d


@loop
def moments(separate, weights, level, orders, out):
    """Write into ``out[k]`` the sum over boxes of ``p**orders[k]``, with ``p ln p`` in the place of order 1.

    ``weights`` (n,) are those of the sorted points, with the sum 1.
    """
    n = len(weights)
    m = len(orders)
    terms = np.zeros(m)
    out[:] = 0.0
    p, before = 0.0, 0.0
    for i in range(n):
        p += weights[i]
        if i + 1 == n or separate[i + 1] <= level:
            if p > 0.0 and p != before:  # small boxes often weigh the same
                for k in range(m):
                    if orders[k] == 0.0:
                        terms[k] = 1.0
                    elif orders[k] == 1.0:
                        terms[k] = p * np.log(p)
                    else:
                        terms[k] = p ** orders[k]
                before = p
            if p > 0.0:
                for k in range(m):
                    out[k] += terms[k]
            p = 0.0
