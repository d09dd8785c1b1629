"""Tiles of an image from coarse to fine, each place of the image in one of them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np

from .._lib.arrays import Ints

_IN_A_TILE = 4096  # places, about: few enough that one is soon done, enough that what surrounds it does not count


@dataclass(frozen=True)
class StridedTile:
    """Places on a grid of some stride in a block of an image, without those that are on the grid of twice the stride.

    ``corners``: first place along each axis, a multiple of twice the stride, and the one after the last; ``first``:
    whether no grid is coarser, so that all places belong to it.

    Examples
    --------
    >>> StridedTile((3, 4), ((0, 3), (0, 4)), 2, False).rows
    array([ 2,  8, 10])
    """

    shape: tuple[int, ...]
    corners: tuple[tuple[int, int], ...]
    stride: int
    first: bool

    @property
    def rows(self) -> Ints:
        """Flat numbers of the places, in rising order."""
        first = 0
        for (low, _), n in zip(self.corners, self.shape, strict=True):
            first = first * n + low
        return first + self._rows_of_corner

    def __len__(self) -> int:
        return len(self._rows_of_corner)

    @property
    def _rows_of_corner(self) -> Ints:
        """The same in a block of this size that begins at the first place of the image."""
        return _rows_of_corner(self.shape, tuple(high - low for low, high in self.corners), self.stride, self.first)


@lru_cache(maxsize=64)
def _rows_of_corner(shape: tuple[int, ...], sizes: tuple[int, ...], stride: int, first: bool) -> Ints:
    flat, coarser = np.zeros((), np.int64), np.ones((), bool)
    for size, n in zip(sizes, shape, strict=True):
        axis = np.arange(0, size, stride)
        flat = flat[..., None] * n + axis
        coarser = coarser[..., None] & (axis % (2 * stride) == 0)
    return flat.ravel() if first else flat[~coarser]


@lru_cache(maxsize=8)
def strided_tiles(
    shape: tuple[int, ...], stride: int, middle: tuple[int, ...] | None
) -> tuple[tuple[StridedTile, ...], ...]:
    """Return the tiles of an image for each stride, from the coarsest to 1; those come first that are near a place."""
    centre = np.array([(n - 1) / 2 for n in shape] if middle is None else middle, float)
    side = max(2, round(_IN_A_TILE ** (1.0 / max(len(shape), 1))) // 2 * 2)
    groups, step = [], stride
    while step:
        cuts = [[(low, min(low + side * step, n)) for low in range(0, n, side * step)] for n in shape]
        tiles = [StridedTile(tuple(shape), block, step, step == stride) for block in product(*cuts)]
        tiles = [tile for tile in tiles if len(tile)]
        apart = [sum(max(a - x, x - b, 0.0) ** 2 for (a, b), x in zip(t.corners, centre, strict=True)) for t in tiles]
        groups.append(tuple(tiles[k] for k in np.argsort(apart, kind="stable")))
        step //= 2
    return tuple(groups)
