"""Boxes of covers: whole-number places that wrap along angles."""

from __future__ import annotations

from math import ceil, log, prod
from typing import Any

import numpy as np

from ..._lib.arrays import Bools, Floats, Ints
from ...maps.coordinates import turns_of, wrap
from ...maps.point_map import PointMap
from ...orbits.attractor import Attractor, Cover, Kind

BOXES = 64
"""Boxes along each axis of the bounding box of a sample of points."""

RESIDENCE = 64
"""Consecutive periods inside the cover of an attractor after which an orbit counts as converged, at least."""


def inside_cover(cover: Cover, points: Floats, point_map: PointMap, keys: Ints | None = None) -> Bools:
    """Tell which points lie in the boxes of a cover; its sorted keys may be given."""
    known = box_keys(cover.boxes, cover.corners) if keys is None else keys
    places = box_keys(boxes_of(points, cover.lower, cover.widths, point_map), cover.corners)
    place = np.minimum(np.searchsorted(known, places), len(known) - 1)
    return np.asarray(known[place] == places)


def boxes_of(points: Floats, lower: Floats, widths: Floats, point_map: PointMap) -> Ints:
    """Return whole-number places of boxes; along an angle they wrap."""
    turn = turns_of(point_map.coordinates)[1]
    with np.errstate(invalid="ignore"):
        places = np.floor((points - lower) / widths)
    places = np.where(np.isfinite(places), np.clip(places, -(2.0**40), 2.0**40), -(2.0**40)).astype(np.int64)
    return wrapped_boxes(places, boxes_around(widths, turn))


def boxes_around(widths: Floats, turn: Floats) -> Ints:
    """Return how many boxes make the turn of each angle; 0 for other coordinates."""
    return np.where(turn > 0, np.maximum(np.round(turn / widths), 1.0), 0.0).astype(np.int64)


def wrapped_boxes(places: Ints, around: Ints) -> Ints:
    """Wrap the indices of boxes along angles."""
    return np.where(around > 0, places % np.maximum(around, 1), places)


def moved_boxes(boxes: Ints, steps: Ints, around: Ints) -> Ints:
    """Return all boxes that lie some steps away from others, each once, sorted."""
    moved = (boxes[:, None, :] + steps).reshape(-1, boxes.shape[1])
    return distinct_boxes(wrapped_boxes(moved, around))


def distinct_boxes(boxes: Ints) -> Ints:
    """Return boxes (n, dimension) each once, sorted: by their numbers, where these have room in 64 bits."""
    if not len(boxes):
        return boxes
    low, high = boxes.min(axis=0), boxes.max(axis=0)
    shape = [b - a + 1 for a, b in zip(low.tolist(), high.tolist(), strict=True)]
    if prod(shape) >= 2**62:
        return np.unique(boxes, axis=0)
    keys = np.unique(np.ravel_multi_index(tuple((boxes - low).T), shape))
    return np.asarray(low + np.stack(np.unravel_index(keys, shape), axis=-1), np.int64)


def box_keys(boxes: Ints, reference: Ints) -> Ints:
    """Number boxes row-major in the bounding box of the reference; -1 outside of it."""
    low, high = reference.min(axis=0), reference.max(axis=0)
    shape = high - low + 1
    inside = ((boxes >= low) & (boxes <= high)).all(axis=-1)
    keys = np.zeros(len(boxes), np.int64)
    for j in range(boxes.shape[1]):
        keys = keys * shape[j] + np.where(inside, boxes[:, j] - low[j], 0)
    return np.where(inside, keys, -1)


def in_units(points: Floats, size: Floats, point_map: PointMap) -> Floats:
    """Return points in units of lengths (dimension,), angles from their branch cuts, as trees of points need them."""
    lower, turn = turns_of(point_map.coordinates)
    highest = np.where(turn > 0, np.nextafter(turn / size, 0.0), np.inf)
    corner = np.where(turn > 0, lower, 0.0)
    return np.asarray(np.minimum((wrap(points, point_map.coordinates) - corner) / size, highest))


def tree_of(points: Floats, size: Floats, point_map: PointMap) -> Any:
    """Return a tree of points (n, dimension) in units of lengths, periodic along angles."""
    from scipy.spatial import KDTree

    return KDTree(in_units(points, size, point_map), boxsize=turns_of(point_map.coordinates)[1] / size)


def full_residence(attractor: Attractor) -> int:
    """Return the periods inside the cover of an attractor after which an orbit has converged, whatever others do.

    On a chaotic one they are no fewer than an error takes to grow from a box to the size of the attractor: before, an
    orbit has not been all over it, and may only pass by.
    """
    if attractor.kind is not Kind.CHAOTIC or not attractor.exponents[0] > 0.0:
        return RESIDENCE
    return max(RESIDENCE, ceil(log(BOXES) / attractor.exponents[0]))
