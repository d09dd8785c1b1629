"""Orbits with the frames that they carry along, in one loop over all periods."""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..loops import inlined, loop
from .blocks import MOST_TURNS, wrap_angle
from .calls import call_rows
from .periods import ESCAPED, integrate

ROUNDING = 2.0**-52
"""Of the largest entry of a step: what is smaller is no number but noise."""

_LARGEST, _SMALLEST = 1e100, 1e-100  # product of growths whose logarithm is taken
_LITTLE = 0.01  # fraction of the square of a length: where less is left, a second pass removes errors


class FrameStep(NamedTuple):
    """The address of the step of states with one tangent vector each, 2 d numbers in a row, and its parameters.

    ``lower`` and ``turn`` (d,) are branch cuts and periods of the coordinates; a coordinate of the size `bound` has
    ended, an angle where its phase is lost.
    """

    function: int
    parameters: NDArray[np.float64]
    lower: NDArray[np.float64]
    turn: NDArray[np.float64]
    bound: float


class Framed(NamedTuple):
    """Points (n, d), full rotations taken out of angles (n, d), orthonormal columns (n, d, d), and which have ended."""

    points: NDArray[np.float64]
    rotations: NDArray[np.int64]
    frames: NDArray[np.float64]
    ended: NDArray[np.bool_]


@functools.cache
def carrying(d):
    """Return the function ``carry`` for a dimension: loops of known length vanish."""

    @loop
    def carry(step, orbits, periods, growth):
        """Move orbits and their frames on, in place, but for those that have ended.

        ``growth`` (n, d) receives the logarithms of what the frames have grown by: NaN where a derivative is not
        finite, minus infinity where a direction vanishes.
        """
        points, rotations, frames, ended = orbits
        rows, factors = np.empty((d, 2 * d)), np.empty(d)
        vectors = rows[:, d:]
        for k in range(len(points)):
            for j in range(d):
                growth[k, j], factors[j] = 0.0, 1.0
                for i in range(d):
                    rows[j, i], vectors[j, i] = points[k, i], frames[k, i, j]
            for _ in range(periods):
                if ended[k]:
                    break
                call_rows(step.function, rows, d, step.parameters)
                inside = finite = True
                for i in range(d):
                    turn = step.turn[i]
                    inside &= abs(rows[0, i]) < (MOST_TURNS * turn if turn > 0.0 else step.bound)
                    for j in range(d):
                        finite &= abs(vectors[j, i]) < np.inf
                if not inside:
                    ended[k] = True
                    break
                for i in range(d):
                    points[k, i] = rows[0, i]
                    ended[k] |= not wrap_angle(points, rotations, k, i, step.lower[i], step.turn[i])
                    for j in range(d):
                        rows[j, i] = points[k, i]
                _grow(vectors, factors, finite, growth[k], d)
            for j in range(d):
                growth[k, j] += np.log(factors[j])
                for i in range(d):
                    frames[k, i, j] = vectors[j, i]

    return carry


@functools.cache
def carrying_along_flow(d):
    """Return the function ``carry`` for the flow of a system of that dimension."""

    @loop
    def carry(motion, rows, rotations, status, lower, turn, periods, growth):
        """Integrate rows (n, d + d d) of states with the vectors of their frames behind them, as `integrate` does.

        After each period frames are made orthonormal; ``growth`` (n, d) is added the logarithms of what they have
        grown by.
        """
        n = len(rows)
        vectors, small = np.empty((d, d)), np.empty((0, 0), np.uint8)
        factors = np.ones((n, d))
        for _ in range(periods):
            integrate(motion, rows, rotations, status, small, lower, turn, 1)
            for k in range(n):
                if status[k] >= ESCAPED:
                    continue
                for j in range(d):
                    for i in range(d):
                        vectors[j, i] = rows[k, d + j * d + i]
                _grow(vectors, factors[k], True, growth[k], d)
                for j in range(d):
                    for i in range(d):
                        rows[k, d + j * d + i] = vectors[j, i]
        for k in range(n):
            for j in range(d):
                growth[k, j] += np.log(factors[k, j])

    return carry


@inlined
def _grow(vectors, factors, finite, growth, d):
    """Make rows orthonormal and keep what they have grown by; where they are not finite, begin again."""
    if finite:
        _orthonormalise(vectors, factors, d)
    for j in range(d):
        if not finite:
            growth[j] = np.nan
            for i in range(d):
                vectors[j, i] = 1.0 if i == j else 0.0
        elif not _SMALLEST < factors[j] < _LARGEST:
            growth[j] += np.log(factors[j])
            factors[j] = 1.0


@inlined
def _orthonormalise(vectors, factors, d):
    """Make rows orthonormal, one after the other, and multiply factors by what remains of the length of each.

    Gram and Schmidt's method, with a second pass where the first leaves little of a row, for then rounding has left
    some of the other directions (Giraud, Langou, Rozloznik, Computers & Mathematics with Applications 50 (2005) 1069).
    A row that is noise beside the longest one vanishes, and any direction that is left takes its place.
    """
    largest = 0.0
    for j in range(d):
        for i in range(d):
            largest = max(largest, abs(vectors[j, i]))
    for j in range(d):
        length = _without_those_before(vectors, j, d)
        if length > ROUNDING * largest:
            factors[j] *= length
        else:
            factors[j] = 0.0
            for axis in range(d):
                for i in range(d):
                    vectors[j, i] = 1.0 if i == axis else 0.0
                length = _without_those_before(vectors, j, d)
                if length * length * d > 0.5:  # some axis has this much beside fewer than d directions
                    break
        scale = 1.0 / length
        for i in range(d):
            vectors[j, i] *= scale


@inlined
def _without_those_before(vectors, j, d):
    """Take out of a row the directions of those before it; return the length of what is left."""
    square = _square(vectors, j, d)
    for _ in range(2 if j else 0):
        before = square
        for m in range(j):
            part = 0.0
            for i in range(d):
                part += vectors[m, i] * vectors[j, i]
            for i in range(d):
                vectors[j, i] -= part * vectors[m, i]
        square = _square(vectors, j, d)
        if square > _LITTLE * before:
            break
    return np.sqrt(square)


@inlined
def _square(vectors, j, d):
    total = 0.0
    for i in range(d):
        total += vectors[j, i] * vectors[j, i]
    return total
