"""Orbits of discrete maps with the frames that they carry along, in one loop over all periods."""

from __future__ import annotations

import functools

import numpy as np

from ..loops import inlined, loop
from .blocks import MOST_TURNS, wrap_angle
from .calls import call_rows

ROUNDING = 2.0**-52
"""Of the largest entry of a step: what is smaller is no number but noise."""

_LARGEST, _SMALLEST = 1e100, 1e-100  # product of growths whose logarithm is taken
_LITTLE = 0.01  # of the square of a length: less is left with errors that a second pass removes


@functools.cache
def carrying(d):
    """Return the function ``carry`` for a dimension: loops of known length vanish."""

    @loop
    def carry(step, parameters, lower, turn, bound, points, rotations, frames, ended, periods, growth):
        """Move orbits and their frames on; write the logarithms of what the frames have grown by.

        Parameters
        ----------
        step : int
            Address of the step of states with one tangent vector each, 2 d numbers in a row.
        parameters, lower, turn : ndarray
            Parameters of the step; branch cuts and periods of the coordinates, shape (d,).
        bound : float
            Size from which on an orbit has ended; for an angle it is that at which its phase is lost.
        points, rotations, frames, ended : ndarray, shapes (n, d), (n, d), (n, d, d), (n,)
            Points, full rotations taken out of angles, orthonormal columns, and which orbits are terminated, and stay
            as they are.  All are changed in place.
        periods : int
            Steps.
        growth : ndarray, shape (n, d)
            Receives the logarithms: NaN where a derivative is not finite, minus infinity where a direction vanishes.
        """
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
                call_rows(step, rows, d, parameters)
                inside = finite = True
                for i in range(d):
                    inside &= abs(rows[0, i]) < (MOST_TURNS * turn[i] if turn[i] > 0.0 else bound)
                    for j in range(d):
                        finite &= abs(vectors[j, i]) < np.inf
                if not inside:
                    ended[k] = True
                    break
                for i in range(d):
                    points[k, i] = rows[0, i]
                    ended[k] |= not wrap_angle(points, rotations, k, i, lower[i], turn[i])
                    for j in range(d):
                        rows[j, i] = points[k, i]
                if finite:
                    _orthonormalise(vectors, factors, d)
                    for j in range(d):
                        if not _SMALLEST < factors[j] < _LARGEST:
                            growth[k, j] += np.log(factors[j])
                            factors[j] = 1.0
                else:
                    for j in range(d):
                        growth[k, j] = np.nan
                        for i in range(d):
                            vectors[j, i] = 1.0 if i == j else 0.0
            for j in range(d):
                growth[k, j] += np.log(factors[j])
                for i in range(d):
                    frames[k, i, j] = vectors[j, i]

    return carry


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
