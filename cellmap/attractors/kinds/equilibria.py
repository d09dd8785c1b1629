"""Sticking sets: continua of equilibria at which dry friction keeps an orbit for ever."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from ..._compiled.kernels.capture import AT_REST
from ..._lib.arrays import Bools, Floats, Ints, evenly
from ..._lib.stopping import check_stop
from ...maps.coordinates import difference, turns_of, wrap
from ...maps.orbit_batch import Orbits
from ...maps.point_map import PointMap
from ...maps.side_by_side import advance_on_threads
from ...maps.tangent import tangent
from ...orbits.attractor import Attractor, Cover, Kind
from ...orbits.multipliers import multipliers_of
from ...orbits.newton import resolution
from ..regions.boxes import (
    boxes_around,
    boxes_of,
    distinct_boxes,
    in_units,
    inside_cover,
    moved_boxes,
    tree_of,
    wrapped_boxes,
)
from .ends import Ends
from .neutral_segments import fades

_PROBE = 1e-7  # distance at which the neighbours of an equilibrium are tried, in units of the extent,
_RESOLVED = 1e4 * AT_REST  # or of the resolution, where they would not be seen to move in a smaller region
_THIN = 1e-9  # width of boxes along directions in which the set does not reach, relative to the resolution
_BOXES = 32  # along the set
_MOST_BOXES = 20_000
_SAMPLE = 256
_PERIODS = 16  # in which orbits near the edge have to come closer
_AHEAD = tuple(2.0**k for k in range(-2, 8))  # times the way of these periods, ahead of where they may come to rest,
_FARTHEST = 2.0  # up to this many boxes


def look(ends: Ends) -> list[Attractor]:
    """Return the attracting sticking sets on which some orbits rest, without the known ones."""
    return sticking_sets(ends.point_map, ends.points, ends.extent, ends.known)


def sticking_sets(
    point_map: PointMap, states: Floats, extent: Floats, known: Sequence[Attractor] = ()
) -> list[Attractor]:
    """Return the attracting sticking sets (continua of equilibria) on which some orbits rest, without the known ones.

    An equilibrium counts where the map leaves it in place to rounding, together with its neighbours along at least one
    axis, and its derivative contracts in all other directions: so it does in the interior of the friction cone.  Or
    neighbours along all axes stay in place, as where a right-hand side is zero beyond a limit.  From there the set is
    explored, box by box, along those axes.  A set has a sample of its points, and boxes that hold it.
    """
    exact = point_map.without_table
    left = states[_rests(exact, states, extent)]
    region = None if not len(left) else np.array([left.min(axis=0) - extent, left.max(axis=0) + extent])
    for other in known:
        if other.cover is not None and other.kind is Kind.EQUILIBRIA and len(left):
            left = left[~inside_cover(other.cover, left, exact)]
    found: list[Attractor] = []
    while len(left):
        assert region is not None
        attractor = _explored(exact, left[0], extent, region)
        inside = np.zeros(len(left), bool)
        inside[0] = True
        if attractor is not None:
            found.append(attractor)
            assert attractor.cover is not None
            inside |= inside_cover(attractor.cover, left, exact)
        left = left[~inside]
        if attractor is None and len(left) > _SAMPLE:
            left = left[:: len(left) // _SAMPLE]
    return found


def _rests(exact: PointMap, states: Floats, extent: Floats) -> Bools:
    """Tell which states the map leaves in place."""
    images = _moved(exact, states, 1)
    with np.errstate(invalid="ignore"):
        moved = np.abs(difference(images.points, states, exact.coordinates))
        still = (moved <= AT_REST * resolution(states, extent)).all(axis=-1)
    return np.asarray(still & images.alive & ~images.rotations.any(axis=-1))


def _moved(exact: PointMap, states: Floats, periods: int) -> Orbits:
    """Return orbits that begin at some states, after some periods."""
    check_stop()
    orbits = Orbits.starting(wrap(states, exact.coordinates))
    advance_on_threads(exact.advance, orbits, periods)
    return orbits


def _explored(exact: PointMap, place: Floats, extent: Floats, region: Floats) -> Attractor | None:
    """Return the continuum of equilibria around one of them in a region (lower and upper corner).

    None where it is isolated or does not attract.
    """
    d = exact.dimension
    matrix = tangent(exact, place)[1] * (extent / extent[:, None])
    multipliers = multipliers_of(matrix)
    sizes = np.abs(multipliers)
    if not (np.isfinite(sizes).all() and sizes.max() <= 1.0 + 1e-6):
        return None
    unit = np.eye(d) * extent
    probe = np.maximum(_PROBE, _RESOLVED * resolution(place, extent) / extent)
    wide = np.array(
        [_rests(exact, place + probe[j] * np.array([[1.0], [-1.0]]) * unit[j], extent).any() for j in range(d)]
    )
    if not wide.any() or not (wide.all() or sizes.min() < 1.0 - 1e-3):
        return None
    reaches = np.array([_reach(exact, place, unit[j], extent, probe[j]) if wide[j] else 0.0 for j in range(d)])
    across = min(_BOXES, int(_MOST_BOXES ** (1.0 / np.count_nonzero(wide))) // 2)
    turn = turns_of(exact.coordinates)[1]
    widths = np.where(wide, 2.0 * reaches * extent / across, _THIN * resolution(place, extent))
    around = boxes_around(widths, turn)
    widths = np.where(turn > 0, turn / np.maximum(around, 1), widths)
    boxes = _flooded(exact, place, widths, around, wide, extent, region)
    centres = wrap(place + boxes * widths, exact.coordinates)
    if fades(exact, centres, 1, extent):
        return None
    with np.errstate(divide="ignore"):
        exponents = np.log(np.abs(multipliers))
    sample = centres[evenly(len(centres), _SAMPLE)]
    steps = np.array(list(itertools.product(*[(-1, 0, 1) if w else (0,) for w in wide])))
    grown = moved_boxes(boxes, steps, around)
    places = wrap(place + grown * widths, exact.coordinates)
    certain = _amid(grown, boxes, steps, around)
    if not certain.all():
        certain[~certain] = _drawn(exact, place, grown[~certain], centres, widths, wide, extent)
    lower = place - 0.5 * widths
    # Boxes are numbered within the turn of an angle, as the places of points are.
    numbers = boxes_of(places, lower, widths, exact)
    order = np.lexsort(numbers.T[::-1])
    cover = Cover(lower, widths, numbers[order], certain[order])
    return Attractor(Kind.EQUILIBRIA, 1, sample, (0,) * d, multipliers, exponents, exact.coordinates, cover=cover)


def _reach(exact: PointMap, place: Floats, unit: Floats, extent: Floats, reach: float) -> float:
    """Return how far the equilibria reach along an axis, the farther way, in units of the extent; at least `reach`."""
    for factor in (2.0, 1.05):
        while reach * factor <= 0.5:
            beyond = place + factor * reach * np.array([[1.0], [-1.0]]) * unit
            if not _rests(exact, beyond, extent).any():
                break
            reach *= factor
    return reach


def _flooded(
    exact: PointMap, place: Floats, widths: Floats, around: Ints, wide: Bools, extent: Floats, region: Floats
) -> Ints:
    """Return the boxes around equilibria that can be reached through one another, by their numbers from the first."""
    steps = np.concatenate([sign * np.eye(len(place), dtype=np.int64)[wide] for sign in (1, -1)])
    known = front = np.zeros((1, len(place)), np.int64)
    while len(front) and len(known) < _MOST_BOXES:
        new = moved_boxes(front, steps, around)
        new = _not_among(new, known)
        centres = place + new * widths
        new = new[(((centres >= region[0]) & (centres <= region[1])) | ~wide | (around > 0)).all(axis=-1)]
        front = new[_rests(exact, wrap(place + new * widths, exact.coordinates), extent)]
        known = np.concatenate([known, front])
    return distinct_boxes(known)


def _amid(boxes: Ints, among: Ints, steps: Ints, around: Ints) -> Bools:
    """Tell which boxes, and all their neighbours, are among others."""
    keys = {tuple(box) for box in among.tolist()}
    neighbours = wrapped_boxes(boxes[:, None, :] + steps, around)
    return np.array([all(tuple(n) in keys for n in group) for group in neighbours.tolist()], dtype=bool)


def _drawn(
    exact: PointMap, place: Floats, boxes: Ints, centres: Floats, widths: Floats, wide: Bools, extent: Floats
) -> Bools:
    """Tell in which boxes all of some points rest, or come closer to the nearest of the centres, or to others ahead."""
    # Centres, edges and corners, counted in half boxes: neighbours share most of them.
    halves = np.array(list(itertools.product(*[(-1, 0, 1) if w else (0,) for w in wide])))
    counted = (2 * boxes[:, None, :] + halves).reshape(-1, len(widths))
    numbers, shared = np.unique(counted, axis=0, return_inverse=True)
    points = place + 0.5 * numbers * widths
    restless = np.flatnonzero(~_rests(exact, wrap(points, exact.coordinates), extent))
    drawn = np.ones(len(points), bool)
    if len(restless):
        begin = wrap(points[restless], exact.coordinates)
        nearest = centres[tree_of(centres, extent, exact).query(in_units(begin, extent, exact))[1]]
        images = _moved(exact, begin, _PERIODS).points
        far, near = (np.abs(difference(p, nearest, exact.coordinates) / extent).max(axis=-1) for p in (begin, images))
        closer = near < far
        closer[~closer] = _ahead(exact, begin[~closer], images[~closer], widths, wide, extent)
        drawn[restless] = closer
    return np.asarray(drawn[shared.ravel()].reshape(len(boxes), -1).all(axis=1))


def _ahead(exact: PointMap, begin: Floats, images: Floats, widths: Floats, wide: Bools, extent: Floats) -> Bools:
    """Tell which points move ever less, after some periods, towards equilibria that lie ahead within two boxes.

    Near the edge of a sticking set orbits move by about the square of their distance from it.
    """
    shift = difference(images, begin, exact.coordinates)
    further = difference(_moved(exact, images, _PERIODS).points, images, exact.coordinates)
    less, boxes = (np.where(wide, np.abs(s) / widths, 0.0).max(axis=-1) for s in (further, shift))
    found = np.zeros(len(begin), bool)
    for times in _AHEAD:
        rows = np.flatnonzero(~found & (less < boxes) & (times * boxes <= _FARTHEST))
        places = begin[rows] + np.where(wide, (1.0 + times) * shift[rows], 0.0)
        found[rows] = _rests(exact, wrap(places, exact.coordinates), extent)
    return found


def _not_among(new: Ints, known: Ints) -> Ints:
    both, index, counts = np.unique(np.concatenate([new, known]), axis=0, return_index=True, return_counts=True)
    return np.asarray(both[(counts == 1) & (index < len(new))])
