"""Basins in and around the boxes of a basin image."""

from __future__ import annotations

from itertools import product

import numpy as np

from ..._lib.arrays import Bools, Ints
from .label_images import NO_BASIN, LabelImage


def neighbourhoods(image: LabelImage) -> tuple[Bools, Ints]:
    """Return which basins are seen in and around each box (boxes, basins), and a neighbour of another colour.

    The neighbour, the nearest one, is given by the number of its step, see :func:`steps_to_neighbours`; -1 without one.
    """
    numbers = image.numbers
    offsets = steps_to_neighbours(numbers.ndim)
    seen = np.zeros((numbers.size, len(image.names)), bool)
    partner = np.full(numbers.size, -1, np.int64)
    coloured = (numbers != NO_BASIN).ravel()
    seen[np.flatnonzero(coloured), numbers.ravel()[coloured]] = True
    pads = [(1, 1)] * numbers.ndim
    around = np.pad(numbers, pads, constant_values=NO_BASIN)
    for axis, wraps in enumerate(image.wraps):
        if wraps:
            ends = np.moveaxis(around, axis, 0)
            ends[0], ends[-1] = ends[-2], ends[1]
    for k, offset in enumerate(offsets):
        part = tuple(slice(1 + o, 1 + o + n) for o, n in zip(offset, numbers.shape, strict=True))
        other = around[part].ravel()
        rows = np.flatnonzero(coloured & (other != NO_BASIN))
        seen[rows, other[rows]] = True
        differs = rows[(other[rows] != numbers.ravel()[rows]) & (partner[rows] < 0)]
        partner[differs] = k
    return seen, partner


def steps_to_neighbours(dimension: int) -> Ints:
    """Return the steps to all neighbours, the nearest ones first."""
    steps = np.array([s for s in product((-1, 0, 1), repeat=dimension) if any(s)], np.int64)
    return steps[np.argsort((steps**2).sum(axis=1), kind="stable")]
