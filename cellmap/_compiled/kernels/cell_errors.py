"""Bounds on the errors of a table, cell by cell, from derivatives by differences and the table's own estimates.

Cells are numbered row-major; those along the last axis are a row.  Derivatives and errors are in widths of a cell.
"""

from __future__ import annotations

import functools
from math import sqrt

import numpy as np

from ..loops import inlined, loop


@loop
def probes(axes, cells, steps, begin, points):
    """Write the centres of cells from number `begin` on, and points a step to both sides of each, along all axes.

    ``axes`` are the centres along all axes, one axis behind the other; ``points`` (n (1 + 2 d), d).
    """
    d = len(cells)
    for c in range(len(points) // (1 + 2 * d)):
        rest, offset = begin + c, len(axes)
        r = c * (1 + 2 * d)
        for j in range(d - 1, -1, -1):
            offset -= cells[j]
            centre = axes[offset + rest % cells[j]]
            rest //= cells[j]
            for m in range(1 + 2 * d):
                points[r + m, j] = centre
            points[r + 1 + 2 * j, j] = centre - steps[j]
            points[r + 2 + 2 * j, j] = centre + steps[j]


@loop
def differences(images, rotations, turn, origin, inverse, step, slopes, places):
    """Compute derivatives (n, d, d) and the places (n, d) of images of centres, in cells.

    ``images`` and ``rotations`` (n (1 + 2 d), d) are those of :func:`probes`, `step` cells from the centres.
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
def _beside(row, j, cells, wraps, stride):
    """Return the rows before and behind a row along an axis, itself at an end."""
    at = (row // stride) % cells[j]
    before = row - stride if at > 0 else (row + (cells[j] - 1) * stride if wraps[j] else row)
    behind = row + stride if at < cells[j] - 1 else (row - (cells[j] - 1) * stride if wraps[j] else row)
    return before, behind


@inlined
def _pad(values, width, wraps):
    """Write in front of a row and behind it what is beside its ends: its other end, or the same."""
    size = len(values)
    for k in range(width):
        values[k] = values[size - 2 * width + k] if wraps else values[width + k]
        values[size - width + k] = values[width + k] if wraps else values[size - 2 * width + k]


@loop(vectors=True)
def curve(slopes, cells, wraps, begin, end, curved):
    """Write into ``curved`` how far derivatives, both (rows, cells d^2), are from straight lines over neighbours."""
    d = len(cells)
    size, width = slopes.shape[1], d * d
    padded = np.empty(size + 2 * width)
    for r in range(begin, end):
        for q in range(size):
            padded[width + q] = slopes[r, q]
        _pad(padded, width, wraps[d - 1])
        for q in range(size):
            curved[r, q] = 0.125 * abs(padded[q] - 2.0 * padded[width + q] + padded[2 * width + q])
        stride = 1
        for j in range(d - 2, -1, -1):
            before, behind = _beside(r, j, cells, wraps, stride)
            for q in range(size):
                curved[r, q] += 0.125 * abs(slopes[before, q] - 2.0 * slopes[r, q] + slopes[behind, q])
            stride *= cells[j]


@functools.cache
def bounding(d):
    """Return the function ``bound`` for a dimension."""

    @loop(vectors=True)
    def bound(
        table, slopes, curved, images, indicator, rough, numbers, begin, end, bends, errors, tolerances, estimates
    ):
        """Bound the changes of derivatives over a cell (n, 2) and errors, by the largest in the cell and around it.

        ``table`` is (origin, widths, cells, wraps), ``numbers`` (safety, largest error, rtol, atol); ``slopes`` and
        ``curved`` (rows, cells d^2), ``indicator`` and ``rough`` (rows, cells) are taken row by row.  ``bends[:, 0]``
        is the change from a cell to the next, ``bends[:, 1]`` twice the distance from a straight line: where a line
        bends, it may bend more next to the centre.  ``estimates`` are errors of the spline, also in fallback cells.
        """
        origin, widths, cells, wraps = table
        safety, unbounded, rtol, atol = numbers
        size, length, around = slopes.shape[1], cells[d - 1], wraps[d - 1]
        width = d * d
        beside = np.empty((d, 3), np.int64)
        least, most, line = np.empty(size + 2 * width), np.empty(size + 2 * width), np.empty(size + 2 * width)
        error = np.empty(length + 2)
        for r in range(begin, end):
            for q in range(size):
                # No comparison with a NaN is true.
                least[width + q], most[width + q], line[width + q] = np.inf, -np.inf, 0.0
            for k in range(length):
                error[1 + k] = 0.0
            stride = 1
            for j in range(d - 2, -1, -1):
                beside[j, 0], beside[j, 2] = _beside(r, j, cells, wraps, stride)
                beside[j, 1] = r
                stride *= cells[j]
            for m in range(3 ** (d - 1)):
                row, rest = r, m
                for j in range(d - 1):
                    row += beside[j, rest % 3] - r
                    rest //= 3
                for q in range(size):
                    value, bend, p = slopes[row, q], curved[row, q], width + q
                    least[p] = value if value < least[p] else least[p]
                    most[p] = value if value > most[p] else most[p]
                    line[p] = bend if bend > line[p] else line[p]
                for k in range(length):
                    here = np.float64(indicator[row, k])
                    here = here if here < unbounded else unbounded
                    error[1 + k] = here if here > error[1 + k] else error[1 + k]
            _pad(least, width, around)
            _pad(most, width, around)
            _pad(line, width, around)
            _pad(error, 1, around)
            for k in range(length):
                c = r * length + k
                known, change, bent, tolerance = True, 0.0, 0.0, 0.0
                for q in range(width):
                    p = width * k + q
                    own = slopes[r, p]
                    known = known and abs(own) < np.inf
                    low, high = min(least[p], least[p + width]), max(most[p], most[p + width])
                    low, high = min(low, least[p + 2 * width]), max(high, most[p + 2 * width])
                    far = max(high - own, own - low)
                    bend = max(max(line[p], line[p + width]), line[p + 2 * width])
                    change += far * far
                    bent += bend * bend
                for j in range(d):
                    share = (atol + rtol * abs(origin[j] + images[c, j] * widths[j])) / widths[j]
                    known = known and share < np.inf
                    tolerance = max(tolerance, share)
                bends[c, 0], bends[c, 1] = sqrt(change), 2.0 * sqrt(bent)
                tolerances[c] = tolerance if known else np.inf
                largest = max(max(error[k], error[k + 1]), error[k + 2])
                estimates[c] = safety * largest + tolerance
                errors[c] = estimates[c] if known and not rough[r, k] else np.inf

    return bound
