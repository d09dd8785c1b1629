"""Covers of samples of orbits: boxes so fine that orbits of one sample do not stay in those of another."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from ..._lib.arrays import Bools, Floats, Ints
from ...maps.coordinates import turns_of
from ...maps.point_map import PointMap
from ...orbits.attractor import Cover
from .boxes import BOXES, RESIDENCE, boxes_around, boxes_of, distinct_boxes, inside_cover, moved_boxes
from .tube import SAMPLED

FLAT = 1e-3
"""Least width of all boxes together, in units of the extent: rounding must not tell orbits apart."""

_FINEST = 16  # times as many boxes along each axis where covers of two attractors hold the orbits of each other
_MARGIN = 0.1  # of a bounding box, at either side


def lattice(points: Floats, point_map: PointMap, extent: Floats) -> tuple[Floats, Floats]:
    """Boxes that cut the bounding box of the points, or the circle, into equal parts."""
    cut, turn = turns_of(point_map.coordinates)
    lower = np.where(turn > 0, cut, points.min(axis=0))
    span = np.where(turn > 0, turn, np.maximum(np.ptp(points, axis=0), FLAT * extent))
    return lower, span / BOXES


def _few_axes(
    points: Floats, lower: Floats, widths: Floats, point_map: PointMap, extent: Floats
) -> tuple[Floats, Floats, Bools]:
    """Return corner and sides of boxes that reach across all points, but along at most four axes, and which these are.

    They are the axes along which the points are most spread.  Along the others boxes have a margin, and no neighbours,
    of which there would be 3^d.
    """
    turn, cut = turns_of(point_map.coordinates)[1], np.zeros(len(widths), bool)
    cut[np.argsort(-np.ptp(points, axis=0) / extent, kind="stable")[:SAMPLED]] = True
    margin = np.where(turn > 0, 0.0, _MARGIN * BOXES * widths)
    return np.where(cut, lower, lower - margin), np.where(cut, widths, BOXES * widths + 2.0 * margin), cut


def covers_apart(
    history: Floats,
    groups: Sequence[Ints],
    lower: Floats,
    widths: Floats,
    point_map: PointMap,
    extent: Floats,
    planes: Ints,
) -> tuple[list[Ints], list[Cover]]:
    """Return groups of orbits with covers so fine that none stays for long in that of another group.

    Groups that no boxes keep apart are one.  Where all orbits of one are on one side of a plane, so are its boxes.
    """
    groups, fineness = list(groups), 1
    lower, widths, cut = _few_axes(history.reshape(-1, point_map.dimension), lower, widths, point_map, extent)
    while True:
        finer = np.where(cut, widths / fineness, widths)
        covers = [
            _cover(history[:, g].reshape(-1, point_map.dimension), lower, finer, cut, point_map, planes) for g in groups
        ]
        pairs = [
            (j, k) for j, k in itertools.permutations(range(len(groups)), 2)
            if _longest_stay(history[:, groups[j]], covers[k], point_map) > RESIDENCE // 2
        ]  # fmt: skip
        if not pairs:
            return groups, covers
        if fineness < _FINEST:
            fineness *= 2
        else:
            j, k = pairs[0]
            groups[j] = np.sort(np.concatenate([groups[j], groups.pop(k)] if k > j else [groups[k], groups[j]]))
            if k < j:
                groups.pop(k)


def _longest_stay(history: Floats, cover: Cover, point_map: PointMap) -> int:
    """Return the largest number of steps in a row in which one of some orbits (steps, n, dimension) is in a cover."""
    inside = inside_cover(cover, history.reshape(-1, point_map.dimension), point_map).reshape(len(history), -1)
    stay = longest = np.zeros(inside.shape[1], np.int64)
    for now in inside:
        stay = np.where(now, stay + 1, 0)
        longest = np.maximum(longest, stay)
    return int(longest.max())


def _cover(points: Floats, lower: Floats, widths: Floats, cut: Bools, point_map: PointMap, planes: Ints) -> Cover:
    """Boxes of the points and all their neighbours along the axes that are cut, but not beyond invariant planes."""
    visited = distinct_boxes(boxes_of(points, lower, widths, point_map))
    shifts = np.array(list(itertools.product(*[(-1, 0, 1) if c else (0,) for c in cut])))
    around = boxes_around(widths, turns_of(point_map.coordinates)[1])
    boxes = moved_boxes(visited, shifts, around)
    for k in planes[cut[planes]]:
        if (points[:, k] >= 0.0).all() or (points[:, k] <= 0.0).all():
            boxes = boxes[(boxes[:, k] >= 0) == (points[:, k] > 0.0).any()]
    return Cover(lower, widths, boxes)
