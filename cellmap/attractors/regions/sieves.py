"""Sieves: which of many ellipsoids may hold a point, by its coordinates."""

from __future__ import annotations

import numpy as np

from ..._compiled.kernels.capture import BITS, Regions, Sieve
from ..._lib.arrays import Floats
from ...orbits.ellipsoids import half_widths

MANY = 32
"""Ellipsoids from which on it is worthwhile to sift them."""

_BINS = 256  # along each axis
_ROUND = 1e-8  # least eigenvalue of a metric in units in which its diagonal is 1, with which an inverse is a number


def sieve_of(regions: Regions, turn: Floats) -> Sieve:
    """Return the bins along each axis that the bounding boxes of ellipsoids meet, widened by a bin at either side.

    One that reaches all round along some angles meets all their bins.  The sieve has no words where ellipsoids are few,
    or one is so narrow and oblique that its bounding box is not known.
    """
    number, d = regions.centres.shape
    scale = np.sqrt(np.einsum("njj->nj", regions.metrics))
    round_angles = (scale == 0.0) & (turn > 0) & (regions.metrics == 0.0).all(axis=2)
    scale[round_angles] = 1.0
    if number < MANY or not (np.isfinite(scale) & (scale > 0.0)).all():
        return _nothing(d)
    scaled = regions.metrics / (scale[:, :, None] * scale[:, None, :])
    scaled[:, range(d), range(d)] += round_angles
    if not np.linalg.eigvalsh(scaled).min() > _ROUND:
        return _nothing(d)
    reach = np.where(round_angles, turn, half_widths(scaled) / scale)
    low, high = regions.centres - reach, regions.centres + reach
    inverse = _BINS / np.where(turn > 0, turn, (high.max(axis=0) - low.min(axis=0)) * (1.0 + 4.0 / _BINS))
    origin = np.where(turn > 0, 0.0, low.min(axis=0) - 1.5 / inverse)
    words = -(-number // BITS)
    bits, bins = np.zeros((d, _BINS, words), np.int64), np.arange(_BINS)[:, None]
    for j in range(d):
        first, last = (np.floor((ends[:, j] - origin[j]) * inverse[j]) for ends in (low, high))
        after = bins - (first - 1)
        met = np.zeros((_BINS, words * BITS), bool)
        met[:, :number] = (after % _BINS if turn[j] > 0 else after) <= last - first + 2
        met[:, :number] &= (turn[j] > 0) | (after >= 0)
        padded = np.pad(met.reshape(_BINS, words, BITS), ((0, 0), (0, 0), (0, 64 - BITS)))
        bits[j] = np.packbits(padded, axis=2, bitorder="little").view("<i8")[..., 0]
    return Sieve(origin, inverse, np.where(turn > 0, _BINS, 0), bits)


def _nothing(dimension: int) -> Sieve:
    words = np.zeros((dimension, _BINS, 0), np.int64)
    return Sieve(np.zeros(dimension), np.ones(dimension), np.zeros(dimension, np.int64), words)
