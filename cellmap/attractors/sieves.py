"""Sieves: which of many ellipsoids may hold a point, by its coordinates."""

from __future__ import annotations

import numpy as np

from .._compiled.kernels.capture import BITS, Regions, Sieve
from .._lib.arrays import Floats

MANY = 32
"""Ellipsoids from which on it is worthwhile to sift them."""

_BINS = 256  # along each axis
_ROUND = 1e-8  # least eigenvalue of a metric in units in which its diagonal is 1, with which an inverse is a number


def sieve_of(regions: Regions, turn: Floats) -> Sieve:
    """Return the bins along each axis that the bounding boxes of ellipsoids meet, widened by a bin at either side.

    It has no words where ellipsoids are few, or one is so narrow and oblique that its bounding box is not known.
    """
    number, d = regions.centres.shape
    scale = np.sqrt(np.einsum("njj->nj", regions.metrics))
    if number < MANY or not (np.isfinite(scale) & (scale > 0.0)).all():
        return _nothing(d)
    scaled = regions.metrics / (scale[:, :, None] * scale[:, None, :])
    if not np.linalg.eigvalsh(scaled).min() > _ROUND:
        return _nothing(d)
    reach = np.sqrt(np.einsum("njj->nj", np.linalg.inv(scaled))) / scale
    low, high = regions.centres - reach, regions.centres + reach
    inverse = _BINS / np.where(turn > 0, turn, (high.max(axis=0) - low.min(axis=0)) * (1.0 + 4.0 / _BINS))
    origin = np.where(turn > 0, 0.0, low.min(axis=0) - 1.5 / inverse)
    first, last = (np.floor((ends - origin) * inverse) for ends in (low, high))
    bins = np.arange(_BINS)[:, None, None] - (first - 1)
    bins = np.where(turn > 0, bins % _BINS, bins)
    words = -(-number // BITS)
    met = np.zeros((_BINS, words * BITS, d), np.int64)
    met[:, :number] = (bins >= 0) & (bins <= last - first + 2)
    bits = (met.reshape(_BINS, words, BITS, d) << np.arange(BITS)[:, None]).sum(axis=2)
    return Sieve(origin, inverse, np.where(turn > 0, _BINS, 0), np.ascontiguousarray(np.moveaxis(bits, -1, 0)))


def _nothing(dimension: int) -> Sieve:
    words = np.zeros((dimension, _BINS, 0), np.int64)
    return Sieve(np.zeros(dimension), np.ones(dimension), np.zeros(dimension, np.int64), words)
