"""Box partitions of points: all dyadic sizes by one sort, any other size by a sort of its own."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._compiled.kernels.boxes import moments, morton_keys, separations
from ..._lib.arrays import Floats, Ints
from ..._lib.checks import affordable_number, finite_points, real_array, shown
from ..._lib.randomness import Rng, random_numbers
from ..._lib.threads import run_over, slices
from ...maps.coordinates import Coordinate, as_coordinates, turns_of, wrap

_KEY_BITS = 62
TOGETHER = 64  # offsets whose counts are kept at a time
_FINEST = 40  # halvings of the extent; floating-point numbers have few more digits


@dataclass(frozen=True, eq=False)
class Space:
    """Points in units of the scales of their coordinates.

    Parameters
    ----------
    points : ndarray, shape (n, d)
        Points less the lower corner of the set; angles less their cuts.
    periods : ndarray, shape (d,)
        Lengths of circles, 0 for a coordinate on the line.
    extent : float
        The longest extent of the set, or the longest period.
    corner : ndarray, shape (d,)
        What was subtracted, in the units of the coordinates.
    scales : ndarray, shape (d,)
        Lengths that count as one.
    """

    points: Floats
    periods: Floats
    extent: float
    corner: Floats
    scales: Floats

    @classmethod
    def of(cls, points: ArrayLike, coordinates: Sequence[str | Coordinate] | None, scales: ArrayLike | None) -> Space:
        """Check points and scales.

        Without scales these are 1 where all coordinates have the same unit and none is an angle; else the period of an
        angle, and the extent of the set for the others.
        """
        if hasattr(points, "labels"):
            raise TypeError(
                f"points={shown(points)}: give points, such as those of an attractor; basins go to boundary_dimension"
            )
        array = real_array("points", points)
        if array.ndim != 2 or array.shape[1] < 1:
            raise ValueError(f"points has shape {array.shape}: give one point a row, in an array of shape (n, d)")
        d = array.shape[1]
        given = finite_points("points", array, d)
        if len(given) < 2:
            raise ValueError(f"points: {len(given)} points have no dimension to measure; give many more")
        names = as_coordinates([f"x{j}" for j in range(d)] if coordinates is None else coordinates)
        if len(names) != d:
            raise ValueError(f"coordinates: {len(names)} are given for points with {d}; give one for each column")
        given = wrap(given, names)
        cuts, periods = turns_of(names)
        extents = np.where(periods > 0.0, periods, np.ptp(given, axis=0))
        if scales is None:
            alike = not periods.any() and len({c.unit for c in names}) == 1
            lengths = np.ones(d) if alike else np.where(extents > 0.0, extents, 1.0)
        else:
            lengths = real_array("scale", scales)
            lengths = np.full(d, lengths) if lengths.ndim == 0 else lengths
            if lengths.shape != (d,) or not ((lengths > 1e-150) & (lengths < 1e150)).all():
                raise ValueError(f"scale={shown(scales)}: give a positive length for each coordinate")
        if not np.ptp(given, axis=0).any():
            raise ValueError("points: all of them are the same; a point has dimension 0")
        corner = np.where(periods > 0.0, cuts, given.min(axis=0))
        return cls((given - corner) / lengths, periods / lengths, float((extents / lengths).max()), corner, lengths)

    @property
    def dimension(self) -> int:
        """Number of coordinates."""
        return self.points.shape[1]

    def stretched(self, sides: Floats) -> Space:
        """Return the space in which boxes with some sides (d,) are cubes."""
        points, periods = self.points / sides, self.periods / sides
        extents = np.where(periods > 0.0, periods, np.ptp(points, axis=0))
        return replace(self, points=points, periods=periods, extent=float(extents.max()), scales=self.scales * sides)


@dataclass(frozen=True, eq=False)
class Partition:
    """Sorted points and the sizes at which neighbours come into different boxes.

    Parameters
    ----------
    separate : ndarray of int16, shape (n + 1,)
        The first level at which a point is in another box than the one before it.
    bits : int
        The finest level.
    levels : range
        Levels of the sizes that it stands for.
    order : ndarray, shape (n,), or None
        Numbers of the points in sorted order.
    """

    separate: NDArray[np.int16]
    bits: int
    levels: range
    order: Ints | None

    def occupancy(self) -> Ints:
        """Return for each size the number of boxes that hold any point, exactly one, exactly two."""
        before, after = self.separate[:-1], self.separate[1:]
        around, between = np.maximum(before[:-1], after[1:]), after[:-1]
        two = around < between  # such pairs of points have a box from one level on, and up to another
        first = [before, np.maximum(before, after), around[two]]
        begun = np.stack([np.bincount(levels, minlength=self.bits + 2) for levels in first], axis=1)
        begun[:, 2] -= np.bincount(between[two], minlength=self.bits + 2)
        return np.cumsum(begun, axis=0)[list(self.levels)]

    def moments(self, weights: Floats, orders: Floats) -> Floats:
        """Return for each size and order q the sum of p**q over the boxes, with p ln p for q = 1."""
        sums = np.empty((len(self.levels), len(orders)))
        inside = weights if self.order is None else weights[self.order]
        for k, level in enumerate(self.levels):
            moments(self.separate, inside, level, orders, sums[k])
        return sums


def dyadic_sizes(space: Space) -> Floats:
    """Return the extent of a set and its halves, quarters, ..., as far as sorted numbers can tell them apart."""
    return np.asarray(space.extent * 0.5 ** np.arange(min(_KEY_BITS // space.dimension, _FINEST)))


def distinct(space: Space) -> Space:
    """Return a space without points that coincide: they tell nothing new of a set."""
    part = dyadic_partition(space, np.zeros(space.dimension), ordered=True)
    assert part.order is not None
    return replace(space, points=space.points[part.order[part.separate[:-1] <= part.bits]])


def dyadic_partition(space: Space, offset: Floats, ordered: bool = False) -> Partition:
    """Sort points along a curve that visits the boxes of each dyadic size one after the other (Morton 1966).

    ``offset`` (d,) is in units of the largest box, in [0, 1); `ordered` keeps the order of the points.
    """
    d, bits = space.dimension, len(dyadic_sizes(space))
    # The largest box of all, level 0, holds the set wherever the grid is.  A period of an angle is a whole number of
    # boxes, which may therefore be longer or shorter there by a factor of up to sqrt(2), the same one at all sizes.
    top = np.full(d, 2.0 * space.extent)
    circle = space.periods > 0.0
    top[circle] = space.periods[circle] * 2.0 ** -np.round(np.log2(space.periods[circle] / top[circle]))
    scale = 2.0**bits / top
    boxes = np.where(circle, np.round(space.periods * scale), 0.0).astype(np.int64)
    keys = np.empty(len(space.points), np.uint64)
    morton_keys(space.points, scale, offset * 2.0 ** (bits - 1), boxes, bits, keys)
    order = np.argsort(keys, kind="stable") if ordered else None
    keys = np.sort(keys) if order is None else keys[order]
    separate = np.empty(len(keys) + 1, np.int16)
    separations(keys, bits, d, separate)
    return Partition(separate, bits, range(1, bits + 1), order)


def partition(space: Space, size: float, offset: Floats, ordered: bool = False) -> Partition:
    """Sort points into boxes of one size; the period of an angle is divided into the nearest whole number of them.

    The side of a box is in units of the scales, ``offset`` (d,) in units of a box, in [0, 1); `ordered` keeps the order
    of the points.
    """
    places = np.empty(space.points.shape, np.int64)
    for j, period in enumerate(space.periods):
        x = space.points[:, j]
        if period > 0.0:
            boxes = max(1, round(period / size))
            places[:, j] = np.floor(x / period * boxes + offset[j]).astype(np.int64) % boxes
        else:
            places[:, j] = np.floor(x / size + offset[j]).astype(np.int64)
    places -= places.min(axis=0)
    ranges = [int(n) + 1 for n in places.max(axis=0)]
    if np.prod([float(n) for n in ranges]) < 2.0**62:
        keys = np.ravel_multi_index(tuple(places.T), tuple(ranges))
    else:
        keys = np.unique(places, axis=0, return_inverse=True)[1].ravel()
    order = np.argsort(keys, kind="stable") if ordered else None
    keys = np.sort(keys) if order is None else keys[order]
    separate = np.zeros(len(keys) + 1, np.int16)
    separate[1:-1] = keys[1:] == keys[:-1]
    return Partition(separate, 0, range(1), order)


def over_offsets(
    space: Space,
    sizes: Floats | None,
    origin: ArrayLike | None,
    offsets: int,
    rng: Rng,
    measure: Callable[[Partition], NDArray[Any]],
    ordered: bool = False,
) -> Iterator[NDArray[Any]]:
    """Measure partitions at several offsets of the grid, drawn at random; yield an array (sizes, ...) for each.

    Without sizes these are those of :func:`dyadic_sizes`.  An `origin` is a corner of a box, in the place of random
    offsets; circles are cut where they are.  ``measure(partition)`` returns an array whose first axis are the sizes
    that a partition stands for; `ordered` keeps the order of the points.
    """
    offsets = affordable_number("n_offsets", offsets, 8 * space.dimension, at_least=1)
    if origin is not None:
        place = real_array("origin", origin)
        place = np.full(space.corner.shape, place) if place.ndim == 0 else place
        if place.shape != space.corner.shape or not np.isfinite(place).all():
            raise ValueError(f"origin={shown(origin)}: give finite coordinates of a corner")
        moved = np.where(space.periods > 0.0, 0.0, (space.corner - place) / space.scales)
        space = replace(space, points=space.points + moved)
        shifts = np.zeros((1, space.dimension))
        sizes = dyadic_sizes(space) if sizes is None else sizes
    else:
        shifts = random_numbers(rng).random((offsets, space.dimension))
    if sizes is not None and not space.extent / sizes.min() < 2.0**_KEY_BITS:
        raise ValueError(f"sizes={shown(sizes)}: boxes of the smallest size cannot be numbered; give larger ones")

    def work(shift: Floats) -> NDArray[Any]:
        if sizes is None:
            return measure(dyadic_partition(space, shift, ordered))
        return np.concatenate([measure(partition(space, float(s), shift, ordered)) for s in sizes])

    for part in slices(len(shifts), TOGETHER):
        yield from run_over(list(shifts[part]), work)
