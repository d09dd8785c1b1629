"""Neighbourhoods of chaotic attractors that no orbit leaves: unions of boxes, verified by images of their corners."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..._lib.arrays import Bools, Floats, Ints
from ..._lib.stopping import check_stop
from ...maps.coordinates import difference, turns_of, wrap
from ...maps.orbit_batch import Orbits
from ...maps.point_map import PointMap
from ...maps.side_by_side import advance_on_threads
from ...orbits.attractor import Attractor, Cover, Kind
from .boxes import boxes_around, boxes_of, inside_cover, moved_boxes

_BESIDE = 24  # boxes on each side of the cover that may belong to the neighbourhood,
_NEAR = 4  # and around each of its boxes, where those would be too many
_FINENESS = 4  # cells of a box along each axis
_MOST = 2**18  # cells
_SAFETY = 2.0  # factor on the bound of what is not linear in a cell
_SLACK = 0.01  # of a cell: how far images by a surrogate of the map may be from those of the map
_CHECKED = 1024  # random points whose images are compared with the bounds of their cells
_FOLLOWED = 4096  # boxes outside of the cover, from which orbits have to come to it
_FOR = 64  # within so many periods


def is_trapped(attractor: Attractor) -> bool:
    """Tell whether there are boxes of a chaotic attractor in which orbits have converged."""
    return attractor.cover is not None and attractor.cover.trapped is not None and bool(attractor.cover.trapped.any())


def with_trapped_boxes(
    point_map: PointMap,
    attractors: Sequence[Attractor],
    others: Sequence[Attractor] = (),
    surrogate: PointMap | None = None,
) -> list[Attractor]:
    """Return attractors, the chaotic ones with the boxes in which orbits have converged, where they have none yet."""
    found = list[Attractor]()
    for attractor in attractors:
        if attractor.kind is Kind.CHAOTIC and attractor.cover is not None and attractor.cover.trapped is None:
            beside = [a for a in (*attractors, *others) if a is not attractor]
            trapped = trapped_boxes(point_map, attractor.cover, attractor.points, beside, surrogate)
            attractor = replace(attractor, cover=replace(attractor.cover, trapped=trapped))
        found.append(attractor)
    return found


def region_around(point_map: PointMap, cover: Cover, others: Sequence[Attractor] = ()) -> tuple[Floats, Floats] | None:
    """Return the corners of the region in which boxes are looked for; None if it is too large, or others are in it."""
    lattice = _Lattice.free_around(point_map, cover, others)
    return None if lattice is None else (lattice.lower, lattice.lower + lattice.cells.shape * lattice.widths)


def trapped_boxes(
    point_map: PointMap,
    cover: Cover,
    points: Floats,
    others: Sequence[Attractor] = (),
    surrogate: PointMap | None = None,
) -> Bools:
    """Tell which boxes (number,) of the cover of a chaotic attractor are trapped.

    They are those in a neighbourhood of the attractor that no orbit leaves, so that an orbit in one of them has
    converged.  The neighbourhood is the largest union of cells, in a region around the cover, that the map takes into
    itself; as by M. Dellnitz and A. Hohmann (1997), cells are left out whose images are not in the others, until none
    is.  The image of a cell lies between the images of its corners, but for a bound from their second differences that
    images of random points have to confirm.

    The neighbourhood must hold the `points` (n, dimension) of the attractor, none of the `others` may be in the region,
    and from boxes outside of the cover orbits must be seen to come to the trapped ones: then they can go nowhere else.
    Where it is narrower than cells can show, as beside fractal boundaries, no box is trapped.

    A `surrogate` of the map may give the images of corners, and orbits; those of random points are the map's own.
    """
    cheap = point_map if surrogate is None else surrogate
    none = np.zeros(len(cover.boxes), bool)
    lattice = _Lattice.free_around(point_map, cover, others)
    if lattice is None:
        return none
    images = _Images.of(cheap, lattice, 0.0 if surrogate is None else _SLACK)
    kept = images.largest_invariant()
    places = lattice.places_of(point_map, points)
    if not kept.any() or not lattice.within(places).all() or not kept[tuple(places.T)].all():
        return none
    trapped = lattice.whole_boxes(kept)
    own = np.asarray(trapped[tuple((cover.boxes - lattice.low).T)])
    confirmed = images.confirmed(point_map, kept) and _come_to(cheap, cover, own, lattice, trapped)
    return own if confirmed else none


@dataclass(frozen=True, eq=False)
class _Lattice:
    """A region around a cover, in whose boxes there are equal cells.

    ``low``: place of the first box; ``lower``: its corner; ``widths``: those of a cell; ``cells``: which of them are in
    the region; ``around``: cells in the turn of each angle, 0 on the line.
    """

    low: Ints
    lower: Floats
    widths: Floats
    cells: Bools
    around: Ints

    @classmethod
    def around_cover(cls, point_map: PointMap, cover: Cover) -> _Lattice | None:
        """Return a block around a cover, or what is near its boxes if that is too large, None if that is, too."""
        around = boxes_around(cover.widths, turns_of(point_map.coordinates)[1])
        for margin in (_BESIDE, _NEAR):
            low = np.where(around > 0, 0, cover.corners[0] - margin)
            shape = np.where(around > 0, around, cover.corners[1] + margin + 1 - low)
            if np.prod(1.0 * _FINENESS * shape) > (_MOST if margin == _BESIDE else 16 * _MOST):
                continue
            boxes: Bools = np.full(shape, margin == _BESIDE)
            if margin == _NEAR:
                steps = np.array(list(itertools.product(range(-margin, margin + 1), repeat=len(shape))))
                boxes[tuple((moved_boxes(cover.boxes, steps, around) - low).T)] = True
            for axis in range(len(shape)):
                boxes = np.repeat(boxes, _FINENESS, axis=axis)
            if np.count_nonzero(boxes) <= _MOST:
                lower = cover.lower + low * cover.widths
                return cls(low, lower, cover.widths / _FINENESS, boxes, around * _FINENESS)
        return None

    @classmethod
    def free_around(cls, point_map: PointMap, cover: Cover, others: Sequence[Attractor]) -> _Lattice | None:
        """Return the same, None if it holds a point of one of other attractors, too."""
        found = cls.around_cover(point_map, cover)
        held = found is None or any(found.within(found.places_of(point_map, a.points)).any() for a in others)
        return None if held else found

    def places_of(self, point_map: PointMap, points: Floats) -> Ints:
        """Return the indices (n, dimension) of the cells of points, beyond the others where there is none."""
        return boxes_of(points, self.lower, self.widths, point_map)

    def within(self, places: Ints) -> Bools:
        """Tell which indices (n, dimension) are those of cells in the region."""
        inside = np.asarray(((places >= 0) & (places < self.cells.shape)).all(axis=-1))
        inside[inside] = self.cells[tuple(places[inside].T)]
        return inside

    def whole_boxes(self, kept: Bools) -> Bools:
        """Tell of which boxes all cells are kept."""
        parts = kept.reshape([n for count in kept.shape for n in (count // _FINENESS, _FINENESS)])
        return np.asarray(parts.all(axis=tuple(range(1, parts.ndim, 2))))


@dataclass(frozen=True, eq=False)
class _Images:
    """Bounds of the images of cells.

    ``cells`` (n, dimension): their indices; ``lowest``, ``highest`` (n, dimension): least and largest coordinates of
    the images, from the corner of the lattice on and angles not wrapped; NaN where there are none.
    """

    lattice: _Lattice
    cells: Ints
    lowest: Floats
    highest: Floats

    @classmethod
    def of(cls, point_map: PointMap, lattice: _Lattice, slack: float) -> _Images:
        """Compute the images of all corners, and bounds that are wider by some part of a cell."""
        inside, d = lattice.cells, lattice.cells.ndim
        corners = np.array(list(itertools.product((0, 1), repeat=d)))
        used = np.zeros(np.add(inside.shape, 1), bool)
        for corner in corners:
            used[tuple(slice(k, k + n) for k, n in zip(corner, inside.shape, strict=True))] |= inside
        rows = np.full(used.shape, -1)
        rows[used] = np.arange(np.count_nonzero(used))
        images = _images(point_map, lattice.lower + lattice.widths * np.argwhere(used))
        cells = np.argwhere(inside)
        ends = [rows[tuple((cells + corner).T)] for corner in corners]
        first = images[ends[0]]
        apart = np.array([difference(images[end], first, point_map.coordinates) for end in ends])
        bound = sum(_bends(images, rows, axis, ends, point_map) for axis in range(d))
        bound += slack * lattice.widths
        begin = first - lattice.lower
        return cls(lattice, cells, begin + apart.min(axis=0) - bound, begin + apart.max(axis=0) + bound)

    def largest_invariant(self) -> Bools:
        """Return the largest set of cells whose images are in the set."""
        size, widths, kept = np.array(self.lattice.cells.shape), self.lattice.widths, self.lattice.cells.copy()
        circle = self.lattice.around > 0
        known = np.asarray(np.isfinite(self.lowest + self.highest).all(axis=1))
        low = np.floor(np.where(known[:, None], self.lowest, 0.0) / widths).astype(np.int64)
        count = np.floor(np.where(known[:, None], self.highest, 0.0) / widths).astype(np.int64) - low + 1
        low = np.where(circle, np.where(count < size, low % size, 0), low)
        count = np.where(circle, np.minimum(count, size), count)
        known &= (circle | ((low >= 0) & (low + count <= size))).all(axis=1)
        kept[tuple(self.cells[~known].T)] = False
        low, count = low[known], count[known]
        # The number of cells that are kept in a block is a signed sum over its corners.
        sums = np.zeros(1 + size * (1 + circle), np.int32)
        strides, inner = np.divide(sums.strides, sums.itemsize).astype(np.int64), (slice(1, None),) * len(size)
        corners = list(itertools.product((0, 1), repeat=len(size)))
        signs = [(-1) ** (len(size) - sum(corner)) for corner in corners]
        ends = [(low + count * corner) @ strides for corner in corners]
        places, number = np.ravel_multi_index(tuple(self.cells[known].T), kept.shape), count.prod(axis=1)
        while True:
            check_stop()
            np.cumsum(np.tile(kept, 1 + circle), axis=0, out=sums[inner])
            for axis in range(1, len(size)):
                np.cumsum(sums[inner], axis=axis, out=sums[inner])
            held = sum(sign * sums.take(end) for sign, end in zip(signs, ends, strict=True))
            stays = kept.take(places) & (held == number)
            left = np.zeros(kept.shape, bool)
            left.ravel()[places[stays]] = True
            if (left == kept).all():
                return kept
            kept, places, number, ends = left, places[stays], number[stays], [end[stays] for end in ends]

    def confirmed(self, point_map: PointMap, kept: Bools) -> bool:
        """Tell whether the images of random points in cells that are kept are within the bounds."""
        rng, lattice = np.random.default_rng(0), self.lattice
        rows = rng.choice(np.flatnonzero(kept[tuple(self.cells.T)]), _CHECKED)
        places = self.cells[rows] + rng.random((_CHECKED, kept.ndim))
        images = _images(point_map, lattice.lower + lattice.widths * places)
        centre, reach = 0.5 * (self.highest + self.lowest)[rows], 0.5 * (self.highest - self.lowest)[rows]
        shift = difference(images - lattice.lower, centre, point_map.coordinates)
        return bool((np.abs(shift) <= reach + 1e-9 * lattice.widths).all())


def _images(point_map: PointMap, points: Floats) -> Floats:
    """Return where points are after a period, NaN where their orbits end."""
    orbits = Orbits.starting(wrap(points, point_map.coordinates))
    advance_on_threads(point_map.advance, orbits, 1)
    return np.where(orbits.alive[:, None], orbits.points, np.nan)


def _bends(images: Floats, rows: Ints, axis: int, ends: Sequence[Ints], point_map: PointMap) -> Floats:
    """Return how far images of a cell may be from those that are linear between its corners along an axis.

    That is an eighth of the second difference, the largest at the corners of the cell; NaN where none is known.
    """
    along = np.moveaxis(rows, axis, 0)
    before, here, after = (along[k : len(along) - 2 + k].ravel() for k in range(3))
    some = (before >= 0) & (here >= 0) & (after >= 0)
    before, here, after = before[some], here[some], after[some]
    there = images[here]
    second = np.full(images.shape, np.nan)
    second[here] = np.abs(sum(difference(images[k], there, point_map.coordinates) for k in (before, after)))
    return np.asarray(_SAFETY / 8.0 * np.fmax.reduce([second[end] for end in ends]))


def _come_to(point_map: PointMap, cover: Cover, own: Bools, lattice: _Lattice, trapped: Bools) -> bool:
    """Tell whether orbits from the trapped boxes outside of a cover are seen to come to those of the cover."""
    outside = trapped.copy()
    outside[tuple((cover.boxes - lattice.low).T)] = False
    boxes = np.argwhere(outside)
    boxes = boxes[:: max(1, len(boxes) // _FOLLOWED)]
    points = lattice.lower + cover.widths * (boxes + 0.5)
    orbits = Orbits.starting(wrap(points, point_map.coordinates))
    aims = Cover(cover.lower, cover.widths, cover.boxes[own])
    for _ in range(_FOR):
        if not len(orbits) or not own.any():
            break
        advance_on_threads(point_map.advance, orbits, 1)
        orbits = orbits[~inside_cover(aims, orbits.points, point_map)]
    return bool(own.any()) and not len(orbits)
