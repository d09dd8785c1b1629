"""Sets of boxes: cells of a grid that is too fine to be stored as a whole."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from .._lib.arrays import Bools, Floats, Ints
from .._lib.checks import array_of_any, claim_memory, shown, whole_array, whole_number
from .._lib.signatures import checked
from ..maps.grid import CellGrid

MOST_CELLS = 2**62
"""Largest number of cells of a grid."""


@dataclass(frozen=True, eq=False)
class BoxSet:
    """Set of cells of a grid, stored by their numbers.

    Only the boxes that belong to the set take memory.  They are half-open, as cells are: a box owns its lower edges,
    not its upper ones; along a periodic axis the last box is a neighbour of the first.

    Parameters
    ----------
    grid : CellGrid
        Window and resolution.
    keys : ndarray of int64, shape (n,)
        Flat numbers (row-major) of the cells that belong to the set; sorted and made unique.

    Raises
    ------
    ValueError
        For numbers outside the grid, or a grid of more than 2**62 cells.

    Examples
    --------
    >>> grid = CellGrid((0, 0), (1, 1), (4, 4))
    >>> lower = BoxSet(grid, np.arange(8))
    >>> left = BoxSet.of_points(grid, [[0.1, y] for y in (0.1, 0.3, 0.6, 0.9)])
    >>> lower & left, (lower | left).volume, lower - left
    (BoxSet(4 of 4 x 4 boxes), 0.5, BoxSet(4 of 4 x 4 boxes))
    >>> left.subdivided()
    BoxSet(16 of 8 x 8 boxes)
    """

    _made_by: ClassVar = "BoxSet.full or relative_attractor"
    grid: CellGrid
    keys: Ints

    def __post_init__(self) -> None:
        if not isinstance(self.grid, CellGrid):
            raise TypeError(f"grid={shown(self.grid)}: give a CellGrid")
        if self.grid.size > MOST_CELLS:
            raise ValueError(f"grid has {self.grid.size:.3g} cells, and 2**62 can be numbered: bisect fewer times")
        keys = distinct(whole_array("keys", self.keys, "numbers of cells").ravel())
        if len(keys) and not 0 <= keys[0] <= keys[-1] < self.grid.size:
            raise ValueError(
                f"keys run from {keys[0]} to {keys[-1]}: the cells have numbers from 0 to {self.grid.size - 1}"
            )
        object.__setattr__(self, "keys", keys)

    @classmethod
    @checked
    def full(cls, grid: CellGrid) -> BoxSet:
        """Return the set of all cells of a grid."""
        claim_memory(f"the numbers of {grid.size:,} boxes", 8 * grid.size, "begin with fewer cells")
        return cls(grid, np.arange(grid.size))

    @classmethod
    @checked
    def of_points(cls, grid: CellGrid, points: ArrayLike) -> BoxSet:
        """Return the boxes that contain points (..., dimension); points outside the window are ignored."""
        keys = grid.locate(points).ravel()
        return cls(grid, keys[keys >= 0])

    def __repr__(self) -> str:
        return f"BoxSet({len(self):,} of {' x '.join(map(str, self.grid.shape))} boxes)"

    def __len__(self) -> int:
        return len(self.keys)

    def __or__(self, other: BoxSet) -> BoxSet:
        return BoxSet(self.grid, np.concatenate([self.keys, self._beside(other)]))

    def __and__(self, other: BoxSet) -> BoxSet:
        return BoxSet(self.grid, np.intersect1d(self.keys, self._beside(other), assume_unique=True))

    def __sub__(self, other: BoxSet) -> BoxSet:
        return BoxSet(self.grid, np.setdiff1d(self.keys, self._beside(other), assume_unique=True))

    def __le__(self, other: BoxSet) -> bool:
        return not len(self - other)

    @property
    def places(self) -> Ints:
        """Integer indices of the boxes along the axes, shape (n, dimension)."""
        return np.stack(np.unravel_index(self.keys, self.grid.shape), axis=-1).astype(np.int64)

    @property
    def volume(self) -> float:
        """Total volume of the boxes."""
        return len(self) * float(np.prod(self.grid.widths))

    def lower_corners(self) -> Floats:
        """Return the lower corners, shape (n, dimension)."""
        return self.grid.places(self.places)

    def centres(self) -> Floats:
        """Return the centres, shape (n, dimension)."""
        return self.grid.places(self.places + 0.5)

    def corners(self) -> Floats:
        """Return all corners, shape (n, 2**dimension, dimension)."""
        ends = np.array(list(itertools.product((0, 1), repeat=self.grid.dimension)))
        return self.grid.places(self.places[:, None, :] + ends)

    def contains(self, points: ArrayLike) -> Bools:
        """Return a mask of the points (..., dimension) that lie in the set."""
        return self.indices(self.grid.locate(points)) >= 0

    def indices(self, keys: Ints) -> Ints:
        """Return the indices of cell numbers in `keys`, -1 for cells that are not in the set."""
        keys = whole_array("keys", keys, "numbers of cells")
        if not len(self):
            return np.full(keys.shape, -1)
        places = np.minimum(np.searchsorted(self.keys, keys), len(self) - 1)
        return np.where(self.keys[places] == keys, places, -1)

    def chosen(self, mask: Bools) -> BoxSet:
        """Return the subset given by a mask of shape (n,)."""
        mask = array_of_any("mask", mask, "an array of True and False")
        if mask.shape != self.keys.shape or mask.dtype != bool:
            raise ValueError(f"mask={shown(mask)}: give True or False for each of {len(self)} boxes")
        return BoxSet(self.grid, self.keys[mask])

    @checked
    def subdivided(self, axes: int | Sequence[int] | None = None) -> BoxSet:
        """Return the same region with the boxes bisected along one axis, several or all."""
        chosen = range(self.grid.dimension) if axes is None else [axes] if isinstance(axes, int | np.integer) else axes
        shape, places = list(self.grid.shape), self.places
        for j in chosen:
            j = whole_number("axes", j, at_most=self.grid.dimension - 1)
            shape[j] *= 2
            claim_memory(f"bisecting {len(places):,} boxes", 4 * places.nbytes, "bisect fewer times")
            places = np.repeat(places, 2, axis=0)
            places[:, j] *= 2
            places[1::2, j] += 1
        return BoxSet(finer(self.grid, shape, "axes"), _numbers(places, shape))

    def neighbours(self) -> BoxSet:
        """Return the boxes outside the set that share a face, an edge or a corner with it."""
        around = [there for _, there in neighbours_of(self.grid, self.keys)]
        return BoxSet(self.grid, np.concatenate(around)) - self

    def touching(self) -> tuple[Ints, Ints]:
        """Return all pairs of boxes of the set that share at least a corner, as indices into `keys`."""
        pairs = [(rows, self.indices(there)) for rows, there in neighbours_of(self.grid, self.keys)]
        which, touched = np.concatenate(pairs, axis=1)
        order = np.flatnonzero((touched >= 0) & (which != touched))
        order = order[np.argsort(which[order], kind="stable")]
        return which[order], touched[order]

    def _beside(self, other: BoxSet) -> Ints:
        if not isinstance(other, BoxSet) or other.grid != self.grid:
            given = other.grid if isinstance(other, BoxSet) else other
            raise ValueError(
                f"the other set has {given!r} and this one {self.grid!r}: boxes of one grid can be compared"
            )
        return other.keys


def neighbours_of(grid: CellGrid, cells: Ints) -> Iterator[tuple[Ints, Ints]]:
    """Yield, for each direction to a cell that shares a corner, the cells by their places, and their neighbours."""
    index = np.stack(np.unravel_index(cells, grid.shape))
    shape, wraps = np.array(grid.shape)[:, None], np.array(grid.wraps)[:, None]
    claim_memory(f"neighbours of {len(cells):,} boxes", 8 * (3**grid.dimension + 2) * len(cells), "take fewer boxes")
    for step in itertools.product((-1, 0, 1), repeat=grid.dimension):
        if not any(step):
            continue
        moved = index + np.array(step)[:, None]
        moved = np.where(wraps, moved % shape, moved)
        inside = ((moved >= 0) & (moved < shape)).all(axis=0)
        yield np.flatnonzero(inside), np.ravel_multi_index(tuple(moved[:, inside]), grid.shape)


def distinct(keys: Ints) -> Ints:
    """Return numbers sorted, each once; at no cost where they are."""
    if not (keys[1:] > keys[:-1]).all():
        keys = np.sort(keys)  # faster than the hash table of numpy.unique, and what comes out is to be sorted anyway
        keys = keys[np.append(True, keys[1:] > keys[:-1])]
    return keys


def finer(grid: CellGrid, shape: Sequence[int], argument: str) -> CellGrid:
    """Return the window in other cells."""
    if np.prod([int(n) for n in shape], dtype=object) > MOST_CELLS:
        raise ValueError(f"{argument}: of {tuple(shape)} cells at most 2**62 can be numbered; bisect fewer times")
    return replace(grid, shape=tuple(int(n) for n in shape))


def _numbers(places: Ints, shape: Sequence[int]) -> Ints:
    return np.ravel_multi_index(tuple(np.moveaxis(places, -1, 0)), tuple(shape)).astype(np.int64)
