"""Continua of equilibria and of cycles that were found in pieces, joined where their covers overlap."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .._lib.arrays import Ints
from ..maps.coordinates import difference, wrap
from ..maps.point_map import PointMap
from ..orbits.attractor import Attractor, Cover, Kind
from .boxes import boxes_of, inside_cover
from .matching import thinned

_SAMPLE = 256
_MOST_BOXES = 2**20  # into which those of another cover are cut
_EDGE = 0.499  # of a box, from its centre to its corners


def joined_continua(point_map: PointMap, attractors: Sequence[Attractor]) -> tuple[tuple[Attractor, ...], Ints]:
    """Join continua whose covers overlap; return all attractors, and the new number of each of the old ones.

    Two overlap if a point of one lies in the cover of the other.  The longest gives its kind and its boxes to all.
    """
    number = len(attractors)
    exact, overlap = point_map.without_table, np.eye(number, dtype=bool)
    lines = [k for k, a in enumerate(attractors) if a.kind in (Kind.EQUILIBRIA, Kind.CONTINUUM)]
    for j, k in itertools.permutations(lines, 2):
        cover = attractors[j].cover
        same = attractors[j].period == attractors[k].period and cover is not None
        overlap[j, k] = same and inside_cover(cover, attractors[k].points, exact).any()  # type: ignore[arg-type]
    if overlap.sum() == number:
        return tuple(attractors), np.arange(number)
    from scipy.sparse.csgraph import connected_components

    groups = connected_components(overlap, directed=False)[1]
    first = np.unique(groups, return_index=True)[1]
    joined = [
        _joined(exact, [attractors[k] for k in np.flatnonzero(groups == g).tolist()]) for g in groups[np.sort(first)]
    ]
    return tuple(joined), np.searchsorted(np.sort(first), first[groups])


def _joined(exact: PointMap, pieces: Sequence[Attractor]) -> Attractor:
    if len(pieces) == 1:
        return pieces[0]
    longest = max(pieces, key=lambda a: np.abs(difference(a.points, a.points[0], a.coordinates)).max())
    cover = longest.cover
    for piece in pieces:
        if piece is not longest and cover is not None and piece.cover is not None:
            cover = _with_boxes(exact, cover, piece.cover)
    points = np.concatenate([a.points for a in pieces])
    if longest.period == 1:
        points = points[np.lexsort(points.T[::-1])]
    return replace(longest, cover=cover, points=thinned(points, _SAMPLE))


def _with_boxes(exact: PointMap, cover: Cover, other: Cover) -> Cover:
    """Return a cover with boxes that hold the centres of those of another one, cut as finely as its own."""
    parts = np.maximum(np.ceil(other.widths / cover.widths), 1.0).astype(int)
    if len(other.boxes) * np.prod(parts, dtype=float) > _MOST_BOXES:
        parts[:] = 1
    inner = (np.array(list(np.ndindex(*parts))) + 0.5) / parts
    places = other.lower + (other.boxes[:, None, :] + inner) * other.widths
    places = wrap(places.reshape(-1, exact.dimension), exact.coordinates)
    new = np.unique(boxes_of(places, cover.lower, cover.widths, exact), axis=0)
    centres = cover.lower + (new + 0.5) * cover.widths
    new = new[~inside_cover(cover, wrap(centres, exact.coordinates), exact)]
    certain = np.ones(len(new), bool)
    sure = other if other.certain is None else replace(other, boxes=other.boxes[other.certain])
    for corner in itertools.product((-_EDGE, _EDGE), repeat=exact.dimension):
        places = cover.lower + (new + 0.5 + np.array(corner)) * cover.widths
        certain &= len(sure.boxes) > 0 and inside_cover(sure, wrap(places, exact.coordinates), exact)
    known = np.zeros(len(cover.boxes), bool) if cover.certain is None else cover.certain
    boxes = np.concatenate([cover.boxes, new])
    order = np.lexsort(boxes.T[::-1])
    return Cover(cover.lower, cover.widths, boxes[order], np.concatenate([known, certain])[order])
