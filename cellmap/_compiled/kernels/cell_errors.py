"""Bounds on the errors of a table, cell by cell, from derivatives by differences and the table's own estimates.

Cells are numbered row-major; those along the last axis are a row.  Derivatives and errors are in widths of a cell.
"""

from __future__ import annotations

import functools
from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

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
    """Pad a row on both sides: with its other end where it is periodic, else with the values beside the end."""
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


class Given(NamedTuple):
    """Data of a table.

    ``slopes``, and how far they are from straight lines, ``curved`` (rows, cells d^2), ``indicator`` and ``rough``
    (rows, cells) are taken row by row; ``images`` (n, d) are in cells.
    """

    slopes: NDArray[np.float64]
    curved: NDArray[np.float64]
    images: NDArray[np.float64]
    indicator: NDArray[np.float32]
    rough: NDArray[np.bool_]


class Bounds(NamedTuple):
    """Bounds that are found for each cell.

    ``bends[:, 0]`` is the change from a cell to the next, ``bends[:, 1]`` twice the distance from a straight line:
    where a line bends, it may bend more next to the centre.  ``estimates`` are errors of the spline, also in fallback
    cells.
    """

    bends: NDArray[np.float64]
    errors: NDArray[np.float64]
    tolerances: NDArray[np.float64]
    estimates: NDArray[np.float64]


class Around(NamedTuple):
    """Extremes over a row and those beside it: of slopes, of how far they are from lines, and of the indicator.

    In front of the row and behind it there is room for one more cell.
    """

    least: NDArray[np.float64]
    most: NDArray[np.float64]
    line: NDArray[np.float64]
    error: NDArray[np.float64]


@inlined
def _gather(given, table, unbounded, r, beside, ways, around):
    """Find the extremes over a row and those beside it, `ways` together."""
    _, _, cells, wraps = table
    least, most, line, error = around
    d = len(beside)
    width = d * d
    size, length = given.slopes.shape[1], cells[d - 1]
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
    for m in range(ways):
        row, rest = r, m
        for j in range(d - 1):
            row += beside[j, rest % 3] - r
            rest //= 3
        for q in range(size):
            value, bend, p = given.slopes[row, q], given.curved[row, q], width + q
            least[p] = value if value < least[p] else least[p]
            most[p] = value if value > most[p] else most[p]
            line[p] = bend if bend > line[p] else line[p]
        for k in range(length):
            here = np.float64(given.indicator[row, k])
            here = here if here < unbounded else unbounded
            error[1 + k] = here if here > error[1 + k] else error[1 + k]
    _pad(least, width, wraps[d - 1])
    _pad(most, width, wraps[d - 1])
    _pad(line, width, wraps[d - 1])
    _pad(error, 1, wraps[d - 1])


@functools.cache
def bounding(d):
    """Return the function ``bound`` for a dimension."""
    width = d * d

    @loop(vectors=True)
    def bound(table, given, numbers, begin, end, found):
        """Bound changes of derivatives over a cell and errors, by the largest in the cell and around it.

        ``table`` is (origin, widths, cells, wraps), ``numbers`` (safety, largest error, rtol, atol).
        """
        origin, widths, cells, _ = table
        safety, unbounded, rtol, atol = numbers
        size, length = given.slopes.shape[1], cells[d - 1]
        beside = np.empty((d, 3), np.int64)
        least, most, line = np.empty(size + 2 * width), np.empty(size + 2 * width), np.empty(size + 2 * width)
        error = np.empty(length + 2)
        for r in range(begin, end):
            _gather(given, table, unbounded, r, beside, 3 ** (d - 1), Around(least, most, line, error))
            for k in range(length):
                c = r * length + k
                known, change, bent, tolerance = True, 0.0, 0.0, 0.0
                for q in range(width):
                    p = width * k + q
                    own = given.slopes[r, p]
                    known = known and abs(own) < np.inf
                    low, high = min(least[p], least[p + width]), max(most[p], most[p + width])
                    low, high = min(low, least[p + 2 * width]), max(high, most[p + 2 * width])
                    far = max(high - own, own - low)
                    bend = max(max(line[p], line[p + width]), line[p + 2 * width])
                    change += far * far
                    bent += bend * bend
                for j in range(d):
                    share = (atol + rtol * abs(origin[j] + given.images[c, j] * widths[j])) / widths[j]
                    known = known and share < np.inf
                    tolerance = max(tolerance, share)
                found.bends[c, 0], found.bends[c, 1] = sqrt(change), 2.0 * sqrt(bent)
                found.tolerances[c] = tolerance if known else np.inf
                largest = max(max(error[k], error[k + 1]), error[k + 2])
                found.estimates[c] = safety * largest + tolerance
                found.errors[c] = found.estimates[c] if known and not given.rough[r, k] else np.inf

    return bound
