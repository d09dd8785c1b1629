"""Which orbits are in a region that belongs to an attractor: an ellipsoid, or the boxes of a cover."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..loops import inlined, loop
from .blocks import shortest

LOOKED_AT = 256
"""Rows whose distances are computed together, in vectors that stay in the cache."""

AT_REST = 1e-13
"""Largest move in a period, relative to 1 or to the point, of an orbit that rests."""

BITS = 62
"""Ellipsoids of a word of a sieve, whose sign stays free."""

_FARTHEST = 2.0**40  # place, in boxes from the first one, of what has no finite place


class Regions(NamedTuple):
    """Ellipsoids: m holds x where (x - c)' M (x - c) <= 1 with centre c and metric M, and belongs to an owner.

    An orbit has to stay in those of an owner for as many periods in a row as ``residence`` says of it.
    """

    centres: NDArray[np.float64]
    metrics: NDArray[np.float64]
    owners: NDArray[np.int64]
    residence: NDArray[np.int64]


class Sieve(NamedTuple):
    """Which of many ellipsoids may hold a point: those whose bits are set in its bins along all axes.

    ``origin``: edge of the first bin; ``inverse``: bins per unit; ``around``: bins in the period of an angle, 0 on the
    line, where no ellipsoid is beyond the bins; ``bits`` (d, bins, words), BITS of each word; no words where there are
    so few ellipsoids that all of them are tried.
    """

    origin: NDArray[np.float64]
    inverse: NDArray[np.float64]
    around: NDArray[np.int64]
    bits: NDArray[np.int64]


class Covers(NamedTuple):
    """Boxes of sets that attract, cover by cover.

    ``corner``, ``widths`` of the first box; ``around``: boxes in the turn of an angle, 0 on the line; ``low``,
    ``shape`` of the boxes' bounding box, in which they are numbered row-major: sorted, those of cover c are
    ``keys[begin[c] : begin[c + 1]]``.  In a cover that is ``resting``, an orbit has to rest, but where a box is
    ``certain``; in the others it has to stay for as many periods as ``residence`` tells, or to be in one that is.
    """

    owners: NDArray[np.int64]
    corner: NDArray[np.float64]
    widths: NDArray[np.float64]
    around: NDArray[np.int64]
    low: NDArray[np.int64]
    shape: NDArray[np.int64]
    begin: NDArray[np.int64]
    keys: NDArray[np.int64]
    resting: NDArray[np.bool_]
    certain: NDArray[np.bool_]
    residence: NDArray[np.int64]


@loop(vectors=True)
def ellipsoids_of(points, begin, count, regions, turn, places, distances, found):
    """Write into ``found[i]`` the owner of the first ellipsoid that holds row ``begin + i``, -1 where there is none.

    Angles are compared the shorter way round (``turn`` is 0 on the line).  ``places`` (2 d, LOOKED_AT) and
    ``distances`` (LOOKED_AT,) are for work.
    """
    d = points.shape[1]
    for i in range(count):
        found[i] = -1
        for j in range(d):
            places[d + j, i] = points[begin + i, j]
    for m in range(regions.owners.size):
        for j in range(d):
            centre, circle = regions.centres[m, j], turn[j]
            if circle > 0.0:
                for i in range(count):
                    places[j, i] = shortest(places[d + j, i] - centre, circle)
            else:
                for i in range(count):
                    places[j, i] = places[d + j, i] - centre
        for i in range(count):
            distances[i] = 0.0
        for j in range(d):
            diagonal = regions.metrics[m, j, j]
            for i in range(count):
                distances[i] += diagonal * places[j, i] * places[j, i]
            for k in range(j):
                twice = 2.0 * regions.metrics[m, j, k]
                for i in range(count):
                    distances[i] += twice * places[j, i] * places[k, i]
        owner = regions.owners[m]
        for i in range(count):
            if distances[i] <= 1.0 and found[i] < 0:
                found[i] = owner


@loop
def sifted(points, begin, count, regions, sieve, turn, found):
    """Write what :func:`ellipsoids_of` does, by trying only the ellipsoids that a sieve lets through."""
    d, last = points.shape[1], sieve.bits.shape[1] - 1
    bins = np.empty(d, np.int64)
    for i in range(count):
        found[i] = -1
        somewhere = True
        for j in range(d):
            place = np.floor((points[begin + i, j] - sieve.origin[j]) * sieve.inverse[j])
            somewhere &= abs(place) < _FARTHEST  # neither is NaN
            if somewhere:
                bins[j] = np.int64(place)
                if sieve.around[j] > 0:
                    bins[j] %= sieve.around[j]
                somewhere = 0 <= bins[j] <= last
        if somewhere:
            found[i] = _first_to_hold(points, begin + i, regions, sieve, turn, bins)


@inlined
def _first_to_hold(points, r, regions, sieve, turn, bins):
    """Return the owner of the first ellipsoid that holds row r, whose bins are given, -1 where there is none."""
    for word in range(sieve.bits.shape[2]):
        left, m = sieve.bits[0, bins[0], word], word * BITS
        for j in range(1, bins.size):
            left &= sieve.bits[j, bins[j], word]
        while left != 0:
            if left & 255 == 0:
                left >>= 8
                m += 8
                continue
            if left & 1 != 0 and _distance(points, r, regions, m, turn) <= 1.0:
                return regions.owners[m]
            left >>= 1
            m += 1
    return np.int64(-1)


@inlined
def _distance(points, r, regions, m, turn):
    """Return the square of the distance of row r from the centre of an ellipsoid, in its metric."""
    total = 0.0
    for j in range(points.shape[1]):
        x = _shift(points, r, regions, m, turn, j)
        total += regions.metrics[m, j, j] * x * x
        for k in range(j):
            total += 2.0 * regions.metrics[m, j, k] * x * _shift(points, r, regions, m, turn, k)
    return total


@inlined
def _shift(points, r, regions, m, turn, j):
    x = points[r, j] - regions.centres[m, j]
    return shortest(x, turn[j]) if turn[j] > 0.0 else x


OUTSIDE, INSIDE, CERTAIN = 0, 1, 2
"""How a cover holds a point."""


@inlined
def held_by_cover(covers, c, points, r, before, m):
    """Return how a cover holds row r of points: INSIDE in a box, where it rests if it has to, CERTAIN in one of these.

    Row m is where it was.
    """
    key, d = np.int64(0), points.shape[1]
    for j in range(d):
        place = np.floor((points[r, j] - covers.corner[c, j]) / covers.widths[c, j])
        if not abs(place) < np.inf:
            place = -_FARTHEST
        box, around = np.int64(min(max(place, -_FARTHEST), _FARTHEST)), covers.around[c, j]
        if around > 0:
            box %= around
        box -= covers.low[c, j]
        if not 0 <= box < covers.shape[c, j]:
            return OUTSIDE
        key = key * covers.shape[c, j] + box
    first, end = covers.begin[c], covers.begin[c + 1]
    last = end
    while first < last:
        middle = (first + last) // 2
        if covers.keys[middle] < key:
            first = middle + 1
        else:
            last = middle
    if first == end or covers.keys[first] != key:
        return OUTSIDE
    if covers.certain[first]:
        return CERTAIN
    if not covers.resting[c]:
        return INSIDE
    rests = True
    for j in range(d):
        # A NaN is no place to have been at.
        rests &= abs(points[r, j] - before[m, j]) <= AT_REST * (1.0 + abs(points[r, j]))
    return INSIDE if rests else OUTSIDE
