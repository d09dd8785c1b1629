"""Windows with matching cells."""

from __future__ import annotations

import numpy as np

from .._lib.arrays import Ints
from ..maps.grid import CellGrid


def offsets(inner: CellGrid, outer: CellGrid) -> Ints:
    """Return how many cells of one grid are before another one along each axis."""
    if not np.allclose(inner.widths, outer.widths, rtol=1e-9, atol=0.0):
        raise ValueError(
            f"grid={outer!r}: cells of widths {outer.widths} do not continue cells of widths {inner.widths}: give a "
            "window of whole cells more"
        )
    before = (np.array(inner.lower) - np.array(outer.lower)) / outer.widths
    if (np.abs(before - np.round(before)) > 1e-6).any():
        raise ValueError(
            f"the corner {outer.lower} is {before} cells from {inner.lower}: give a corner that is whole cells away"
        )
    return np.round(before).astype(np.int64)


def places_in(inner: CellGrid, outer: CellGrid) -> Ints:
    """Return the flat numbers that the cells of a grid have in a wider one."""
    before = offsets(inner, outer)
    if (before < 0).any() or (before + inner.shape > outer.shape).any():
        raise ValueError(
            f"the window {outer.lower} to {outer.upper} does not contain {inner.lower} to {inner.upper}: widen it"
        )
    axes = [np.arange(n) + k for n, k in zip(inner.shape, before, strict=True)]
    return np.asarray(np.ravel_multi_index(np.ix_(*axes), outer.shape).ravel(), dtype=np.int64)


def overlap(a: CellGrid, b: CellGrid) -> int:
    """Count the cells that two grids have in common."""
    before = offsets(b, a)
    low = np.maximum(before, 0)
    high = np.minimum(before + b.shape, a.shape)
    return int(np.prod(np.maximum(high - low, 0), dtype=object))
