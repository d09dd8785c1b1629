"""Cells around a window: where they are, to the last bit, and what of them is proved."""

from __future__ import annotations

from dataclasses import dataclass
from decimal import ROUND_FLOOR, Context, Decimal
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..._compiled.kernels.cell_covers import Place
from ..._lib.arrays import Bools, Floats, Ints
from ..._lib.midpoint_radius import ROUNDING
from ...maps.coordinates import Coordinate, turns_of, wrap
from ...maps.grid import CellGrid
from ...maps.orbit_batch import CHUNK, Orbits
from ...maps.point_map import PointMap

_SAMPLE = 4096  # orbits that show how far images of the window reach
_PERIODS = 32
_REACHED = 0.998  # fraction of their points that the region shall hold
_WIDEST = 0.5  # distance that a region may reach beyond the window on each side, in widths of it
_ULPS = 16.0  # half units in the last place of what is near, by which cells beside the branch cut overlap


@dataclass(frozen=True, eq=False)
class Region:
    """Cells of a window and around it, each axis divided `2**level` times as finely as the grid.

    Parameters
    ----------
    grid : CellGrid
        The window.
    coordinates : tuple of Coordinate
        State variables.
    before, after : tuple of int
        Cells of the grid that the region reaches beyond the window, below and above.
    level : int
        How often cells are halved.
    """

    grid: CellGrid
    coordinates: tuple[Coordinate, ...]
    before: tuple[int, ...]
    after: tuple[int, ...]
    level: int = 0

    @property
    def is_slice(self) -> bool:
        """Whether some coordinates have one value, so that images lie elsewhere than cells."""
        return any(self.fixed)

    @property
    def fixed(self) -> tuple[bool, ...]:
        """Which coordinates have one value."""
        return tuple(a == b for a, b in zip(self.grid.lower, self.grid.upper, strict=True))

    @property
    def parts(self) -> tuple[int, ...]:
        """Cells along each axis that a cell of the grid is divided into."""
        return tuple(1 if fixed else 2**self.level for fixed in self.fixed)

    @property
    def shape(self) -> tuple[int, ...]:
        """Cells along each axis."""
        counts = zip(self.parts, self.before, self.grid.shape, self.after, strict=True)
        return tuple(parts * (a + n + b) for parts, a, n, b in counts)

    @property
    def window(self) -> tuple[slice, ...]:
        """The window's part of an array of this shape."""
        counts = zip(self.parts, self.before, self.grid.shape, strict=True)
        return tuple(slice(parts * a, parts * (a + n)) for parts, a, n in counts)

    def edges(self, axis: int) -> Floats:
        """Return the edges of all cells along an axis; those of halved cells are among those of their halves."""
        n, parts = self.grid.shape[axis], self.parts[axis]
        numbers = np.arange(-self.before[axis] * parts, (n + self.after[axis]) * parts + 1)
        return self.grid.along(axis, numbers / parts)

    def place(self) -> Place:
        """Return where the cells are, for kernels."""
        d = self.grid.dimension
        turn, wraps = turns_of(self.coordinates)[1], np.array(self.grid.wraps)
        lines, halves = [], np.empty(d)
        for j in range(d):
            edges = self.edges(j)
            # A window of a whole circle may be a little longer than the circle.
            excess = max(edges[-1] - edges[0] - turn[j], 0.0)
            if wraps[j]:
                # An angle that is a full rotation away, by a period that is known to a unit in the last place.
                edges = np.concatenate([edges[:-1] - turn[j], edges[:-1], edges + turn[j]])
            if not (np.diff(edges) > 0.0).all() and not self.fixed[j]:
                raise ValueError(f"splits: no floating-point numbers separate cells along {self.coordinates[j].name}")
            mids = 0.5 * (edges[:-1] + edges[1:])
            half = np.maximum(edges[1:] - mids, mids - edges[:-1]).max()
            slack = _ULPS * ROUNDING.unit * (np.abs(edges).max() + turn[j]) + excess if wraps[j] else 0.0
            halves[j] = (half * ROUNDING.wider + slack) * ROUNDING.wider
            lines.append((edges, mids))
        longest = max(len(edges) for edges, _ in lines)
        edges, middles = np.full((d, longest), np.inf), np.full((d, longest), np.inf)
        for j, (line, mids) in enumerate(lines):
            edges[j, : len(line)], middles[j, : len(mids)] = line, mids
        cells = np.array(self.shape, np.int64)
        first = np.where(wraps, cells, 0)
        ends = np.array([(edges[j, first[j]], edges[j, first[j] + cells[j]]) for j in range(d)])
        largest = np.abs(np.array([line[[0, -1]] for line, _ in lines])).max(axis=-1)
        return Place(edges, middles, first, cells, wraps.astype(np.int64), turn, ends.mean(axis=-1), halves, largest)

    def refined(self) -> Region:
        """Return the region with all cells halved along each axis."""
        return Region(self.grid, self.coordinates, self.before, self.after, self.level + 1)

    def least_volume(self) -> float:
        """Return a lower bound of the volume of every cell, along the axes that are no slice."""
        wide = [j for j, fixed in enumerate(self.fixed) if not fixed]
        return float(np.prod([np.diff(self.edges(j)).min() / ROUNDING.wider for j in wide])) / ROUNDING.wider


def centres_of(place: Place, cells: Ints) -> Floats:
    """Return the centres (n, d) of cells by their flat numbers, as kernels see them."""
    index = np.unravel_index(cells, tuple(place.cells.tolist()))
    return np.stack([place.mids[j, place.first[j] + i] for j, i in enumerate(index)], axis=-1)


def region_of(grid: CellGrid, point_map: PointMap, converges: Bools) -> Region:
    """Return the cells of a window and those around it that its orbits pass, without those that do not converge.

    One is proved only where all cells on its way are, so that a window whose orbits leave it for a while needs them.
    """
    rows = np.flatnonzero(converges.ravel())
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, _SAMPLE).astype(int))] if len(rows) else rows
    index = np.unravel_index(rows, grid.shape)
    points = np.stack([grid.along(j, i + 0.5) for j, i in enumerate(index)], axis=-1)
    orbits, seen = Orbits.starting(wrap(points, point_map.coordinates)), [points]
    for part in range(0, len(points), CHUNK):
        some = orbits[part : part + CHUNK]
        for _ in range(_PERIODS):
            point_map.advance(some, 1)
            seen.append(some.points[some.alive].copy())
    places = np.concatenate(seen)
    before, after, width = [], [], grid.widths
    for j in range(grid.dimension):
        reach = (0, 0)
        if not grid.wraps[j] and grid.lower[j] < grid.upper[j] and len(places):
            low, high = np.quantile(places[:, j], (1.0 - _REACHED, _REACHED), method="nearest")
            most = int(_WIDEST * grid.shape[j])
            c = point_map.coordinates[j]
            if c.period is not None:
                most = min(most, int(0.5 * (c.period / width[j] - grid.shape[j])))
            away = (grid.lower[j] - low) / width[j], (high - grid.upper[j]) / width[j]
            reach = (min(max(int(np.ceil(away[0])), 0), most), min(max(int(np.ceil(away[1])), 0), most))
        before.append(reach[0])
        after.append(reach[1])
    return Region(grid, point_map.coordinates, tuple(before), tuple(after))


@dataclass(frozen=True, eq=False)
class ProvedCells:
    """Cells of a region with the number of their attractor plus one, 0 where nothing is proved, and their ranks.

    All cells that the image of a cell meets have the same label and a smaller rank; those of rank 0 lie in a ball.  A
    cell whose orbit is followed has a larger rank than those that one of its later images meets.
    """

    region: Region
    labels: NDArray[np.int16]
    ranks: NDArray[np.int32]

    @classmethod
    def none(cls, region: Region) -> ProvedCells:
        """Return a region in which nothing is proved."""
        return cls(region, np.zeros(region.shape, np.int16), np.zeros(region.shape, np.int32))

    def refined(self) -> ProvedCells:
        """Return the region with all cells halved along each axis, and what is proved of it."""
        labels, ranks = self.labels, self.ranks
        for j, fixed in enumerate(self.region.fixed):
            if not fixed:
                labels, ranks = np.repeat(labels, 2, axis=j), np.repeat(ranks, 2, axis=j)
        return ProvedCells(self.region.refined(), labels, ranks)

    @property
    def in_window(self) -> NDArray[np.int16]:
        """Labels of the cells of the window."""
        return self.labels[self.region.window]

    def whole(self) -> NDArray[np.int16]:
        """Return the labels of the cells of the grid all of whose parts are proved with one label, 0 of the others."""
        labels = self.in_window
        for j, parts in enumerate(self.region.parts):
            shape = (*labels.shape[:j], -1, parts, *labels.shape[j + 1 :])
            split = labels.reshape(shape)
            low, high = split.min(axis=j + 1), split.max(axis=j + 1)
            labels = np.where(low == high, low, 0).astype(np.int16)
        return labels


def alike(labels: NDArray[np.int16], wraps: tuple[bool, ...]) -> Bools:
    """Return which cells have the label of all their neighbours, those at corners too; along circles all round."""
    low, high = extremes(labels, labels, wraps)
    return np.asarray(low == high)


def extremes(low: NDArray[Any], high: NDArray[Any], wraps: tuple[bool, ...]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the least of low and the largest of high numbers among each cell and its neighbours."""
    for j, around in enumerate(wraps):
        widths = [(1, 1) if k == j else (0, 0) for k in range(low.ndim)]
        bounds = []
        for values in (low, high):
            padded = np.pad(values, widths, mode="wrap" if around else "edge")
            bounds.append([np.take(padded, range(s, s + low.shape[j]), axis=j) for s in range(3)])
        low, high = np.minimum.reduce(bounds[0]), np.maximum.reduce(bounds[1])
    return low, high


def in_figures(bound: float) -> str:
    """Write a lower bound with four figures, rounded down.

    Examples
    --------
    >>> in_figures(15.9999999), in_figures(0.0), in_figures(0.123456)
    ('15.99', '0', '0.1234')
    """
    if not bound > 0.0:
        return "0"
    rounded = Decimal(bound).normalize(Context(prec=4, rounding=ROUND_FLOOR))
    return f"{rounded:f}" if 1e-5 < bound < 1e7 else str(rounded)
