"""Initial conditions by flat index: generated when they are needed, and selected by one bit each."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._lib.arrays import Bools, Floats, Ints, evenly
from .._lib.computed import computed_once
from .._lib.threads import slices
from ..maps.coordinates import Coordinate, check_no_window, state_points, wrap
from ..maps.fingerprint import PROBES, fingerprint
from ..maps.grid import CellGrid, grid_points
from ..maps.point_map import PointMap

BLOCK = 2**20
"""Initial conditions that are processed together; a multiple of 8, for bits are kept in bytes."""


@dataclass(frozen=True, eq=False)
class InitialConditions:
    """Initial conditions of a basin image: the centres of a grid, or given points."""

    grid: CellGrid | None
    given: Floats | None

    @classmethod
    def of(cls, initial_conditions: CellGrid | ArrayLike, point_map: PointMap) -> InitialConditions:
        """Check the argument of that name."""
        if isinstance(initial_conditions, CellGrid):
            return cls(initial_conditions.on(point_map.coordinates, "initial_conditions"), None)
        check_no_window("initial_conditions", initial_conditions, point_map.dimension)
        given = state_points("initial_conditions", initial_conditions, point_map.coordinates)
        if not given.size:
            raise ValueError("initial_conditions is empty: give at least one initial condition")
        return cls(None, given)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of an array with one number for each initial condition."""
        if self.grid is not None:
            return self.grid.shape
        assert self.given is not None
        return self.given.shape[:-1]

    @property
    def region(self) -> Floats:
        """Points that show how large the region is: two corners of a grid, else all points."""
        if self.grid is not None:
            return np.array([self.grid.lower, self.grid.upper])
        return self.points(slice(0, len(self)))

    def __len__(self) -> int:
        return int(np.prod(self.shape, dtype=object))

    @computed_once
    def _axes(self) -> list[Floats]:
        assert self.grid is not None
        return [self.grid.axis(j) for j in range(self.grid.dimension)]

    @computed_once
    def _wrapped_axes(self) -> dict[tuple[Coordinate, ...], list[Floats]]:
        return {}

    def points(self, rows: slice | Ints) -> Floats:
        """Return some initial conditions as a new array, shape (n, dimension)."""
        if self.grid is not None:
            if sum(self.grid.shape) <= BLOCK:
                return grid_points(self._axes, rows)
            # Axes of a grid of one dimension are as long as the grid.
            numbers = np.arange(rows.start, rows.stop) if isinstance(rows, slice) else rows
            index = np.unravel_index(numbers, self.grid.shape)
            return np.stack([self.grid.along(j, i + 0.5) for j, i in enumerate(index)], axis=-1)
        assert self.given is not None
        return self.given.reshape(-1, self.given.shape[-1])[rows].copy()

    def wrapped(self, rows: slice | Ints, point_map: PointMap) -> Floats:
        """Return some initial conditions with wrapped angles."""
        if self.grid is not None and sum(self.grid.shape) <= BLOCK:
            axes = self._wrapped_axes.get(point_map.coordinates)
            if axes is None:
                each = zip(self._axes, point_map.coordinates, strict=True)
                axes = [wrap(axis[:, None], [coordinate])[:, 0] for axis, coordinate in each]
                self._wrapped_axes[point_map.coordinates] = axes
            return grid_points(axes, rows)
        return wrap(self.points(rows), point_map.coordinates)

    def fingerprint(self, point_map: PointMap) -> dict[str, Any]:
        """Return plain values that identify these initial conditions, and a map by its images of some of them."""
        if self.grid is not None:
            grid = self.grid
            named: dict[str, Any] = {"lower": grid.lower, "upper": grid.upper, "shape": grid.shape, "wraps": grid.wraps}
        else:
            assert self.given is not None
            named = {"shape": self.given.shape, "sha256": hashlib.sha256(self.given.tobytes()).hexdigest()}
        probes = self.points(np.unique(np.linspace(0, len(self) - 1, PROBES).astype(np.int64)))
        return {"initial_conditions": named, **fingerprint(point_map, probes)}


@dataclass(frozen=True, eq=False)
class Rows:
    """Flat indices of initial conditions in rising order: all, or those whose bit is set.

    Examples
    --------
    >>> some = Rows.where(10, lambda part: np.arange(part.start, part.stop) % 3 == 0)
    >>> len(some), some[1:4]
    (4, array([3, 6, 9]))
    """

    total: int
    bits: NDArray[np.uint8] | None = None

    @classmethod
    def where(cls, total: int, wanted: Callable[[slice], Bools]) -> Rows:
        """Choose those for which ``wanted(part)`` is true, asked for a part at a time."""
        bits = [np.packbits(wanted(part)) for part in slices(total, BLOCK)]
        return cls(total, np.concatenate([np.empty(0, np.uint8), *bits]))

    @computed_once
    def _before(self) -> Ints:
        """Rows before each block, and of all."""
        assert self.bits is not None
        each = [int(np.bitwise_count(self.bits[part]).sum()) for part in slices(len(self.bits), BLOCK // 8)]
        return np.concatenate([[0], np.cumsum(each, dtype=np.int64)])

    def __len__(self) -> int:
        return self.total if self.bits is None else int(self._before[-1])

    def __getitem__(self, part: slice) -> Ints:
        begin, end, _ = part.indices(len(self))
        if self.bits is None:
            return np.arange(begin, end)
        found = [np.empty(0, np.int64)]
        first = int(np.searchsorted(self._before, begin, "right")) - 1
        for block in range(first, len(self._before) - 1):
            before = int(self._before[block])
            if before >= end:
                break
            found.append(self._of_block(block)[max(begin - before, 0) : end - before])
        return np.concatenate(found)

    def inside(self, part: slice) -> Bools:
        """Return which initial conditions of a block are among the rows."""
        if self.bits is None:
            return np.ones(part.stop - part.start, bool)
        return np.unpackbits(self.bits[part.start // 8 : -(-part.stop // 8)], count=part.stop - part.start).view(bool)

    def spread(self, count: int) -> Iterator[Ints]:
        """Yield about `count` rows at even distances, in parts; all, if they are no more."""
        total, chosen = len(self), evenly(len(self), count)
        blocks = [0, total] if self.bits is None else self._before.tolist()
        for block, (begin, end) in enumerate(pairwise(blocks)):
            mine = chosen[(chosen >= begin) & (chosen < end)]
            if len(mine):
                yield mine if self.bits is None else self._of_block(block)[mine - begin]

    def _of_block(self, block: int) -> Ints:
        assert self.bits is not None
        begin = block * BLOCK
        packed = self.bits[begin // 8 : begin // 8 + BLOCK // 8]
        return begin + np.flatnonzero(np.unpackbits(packed, count=min(BLOCK, self.total - begin)))
