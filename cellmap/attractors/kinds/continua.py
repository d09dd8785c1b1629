"""Continua of cycles: curves of periodic points with one multiplier 1, beside which all orbits come to them."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..._compiled.kernels.capture import AT_REST
from ..._lib.arrays import Bools, Floats, Ints, thinned
from ..._lib.stopping import check_stop
from ...maps.coordinates import difference, turns_of, wrap
from ...maps.orbit_batch import Orbits
from ...maps.point_map import PointMap, follow
from ...maps.side_by_side import advance_on_threads
from ...orbits.attractor import Attractor, Cover, Kind
from ...orbits.multipliers import multipliers_of
from ...orbits.newton import resolution
from ..regions.boxes import boxes_around, boxes_of, distinct_boxes, inside_cover, moved_boxes
from ..regions.tube import Curves, Tube, cover_of_tube, doubled
from .cycles import verified_cycles
from .ends import Ends
from .neutral_segments import DENSE, densely, fades, traced

_AT_REST = 128  # longest period of orbits that rest on a cycle, at the last look
_LOOKED_AT = 1024  # orbits that are tested for having closed
_FEWER = 256  # those for long periods
_REFUSED = 8  # of those that have closed, on no attracting segment, farthest apart first, in one look
_SAME = 1e-6  # distance of places that are taken for one, in units of the region
_CLOSED = 1e-7  # distance from its beginning at which an orbit is near a cycle, relative to the resolution
_RADII = tuple(0.1 * 0.5**k for k in range(7))  # of the tube, in units of the segment
_ALONG, _DIRECTIONS = 17, 24  # points and directions at which the tube is tried
_FEW = 4  # one in so many directions is tried first
_LONGEST = 512  # steps in which distances have to be halved
_SETTLED, _STANDS = 64, 0.95  # periods after which distances that twice as many leave as they are will not be halved
_PERIODS = 16  # in which orbits near the ends have to come closer
_SAMPLE = 256
_MOST_BOXES = 2**20  # into which those of another cover are cut
_MOST_PLACES = 2**22  # in boxes that are tried, corners of which there are 2^d in each
_EDGE = 0.499  # of a box, from its centre to its corners


@dataclass(frozen=True, eq=False)
class Segment(Curves):
    """A curve, in points (n, dimension), closed or with two ends; ``size`` makes distances along axes comparable."""

    closed: bool = False

    def surface(self, radii: Floats) -> Floats:
        """Return points (radii, along, directions, dimension) at distances from points of the segment."""
        d = self.exact.dimension
        free = np.random.default_rng(0).standard_normal((_DIRECTIONS, d))
        free = np.concatenate([free / np.linalg.norm(free, axis=1, keepdims=True), np.eye(d), -np.eye(d)])
        here = self.points[np.linspace(0, len(self.points) - 1, _ALONG).round().astype(int)]
        return np.asarray(here[:, None, :] + radii[:, None, None, None] * free * self.size)

    def spacing(self) -> float:
        """Return the distance of the first two points."""
        return float(np.linalg.norm(difference(self.points[1], self.points[0], self.exact.coordinates) / self.size))

    def between(self, distances: Floats) -> Floats:
        """Return the largest of distances (radii, n)."""
        return np.asarray(distances.max(axis=1))


def look(ends: Ends) -> list[Attractor]:
    """Return the cycles on which orbits have closed, or the attracting segments of such cycles."""
    if not ends.mature or (ends.wandering and not ends.last):
        return []
    longest = _AT_REST if ends.last else 0
    closed = closed_orbits(ends.point_map, ends.points, ends.extent, ends.longest_period, longest)
    return verified_cycles(ends, closed) or new_continua(ends, closed)


def new_continua(ends: Ends, closed: Sequence[tuple[Floats, int]]) -> list[Attractor]:
    """Return the attracting segments on which orbits have closed, and remember those that do not attract."""
    return continua(ends.point_map, closed, ends.extent, ends.known, ends.examined.lines)


def continua(
    point_map: PointMap,
    closed: Sequence[tuple[Floats, int]],
    extent: Floats,
    known: Sequence[Attractor] = (),
    refused: list[Floats] | None = None,
) -> list[Attractor]:
    """Return the attracting segments of periodic points on which orbits have closed, without the known ones.

    All those that :func:`closed_orbits` returns are on one of them, or on lines that are added to those that are
    `refused`, or farther from these than others; how many are looked at does not matter unless several lines are
    refused.

    Where dry friction holds one part of a system while another moves, each place at which it can be held has a cycle of
    its own.  Such a cycle has one multiplier 1, and the others inside the unit circle.  The segment of its neighbours
    is followed along the neutral direction, until there are no more or they leave the region.  A tube around it is a
    trapping region if the distance of all points tried on its surface is halved in some steps, and what they move along
    the segment meanwhile is less than what the tube leaves out at its ends.
    """
    exact = point_map.without_table
    found: list[Attractor] = []
    refused = [] if refused is None else refused
    if exact.dimension < 2 or not closed:
        return found
    places, periods = (np.array(column) for column in zip(*closed, strict=True))
    extent = np.maximum(extent, np.ptp(places, axis=0))  # a line may reach farther than the region
    seen = [a.points for a in known if a.kind is Kind.CONTINUUM] + refused
    left = np.array([not any(_beside(place, line, exact, extent) for line in seen) for place in places], bool)
    far, failures = np.full(len(places), np.inf), 0
    while left.any() and failures < _REFUSED:
        k = int(np.where(left, far, -1.0).argmax())
        attractor, line = _explored(exact, places[k], int(periods[k]), extent)
        if attractor is None:
            failures += 1
            refused.append(line)
        else:
            found.append(attractor)
        left[k] = False
        left[left] = [not _beside(place, line, exact, extent) for place in places[left]]
        apart = difference(places, places[k], exact.coordinates) / extent
        far = np.minimum(far, np.abs(apart).max(axis=1))
    return found


def _beside(place: Floats, line: Floats, exact: PointMap, extent: Floats) -> bool:
    """Tell whether a place is on a line that is known by some of its points, or between two of them."""
    apart = np.linalg.norm(difference(line, place, exact.coordinates) / extent, axis=1)
    steps = np.linalg.norm(difference(line[1:], line[:-1], exact.coordinates) / extent, axis=1)
    return bool(apart.min() <= max(_SAME, float(np.median(steps)) if len(steps) else 0.0))


def closed_orbits(
    point_map: PointMap, states: Floats, extent: Floats, longest_period: int, longest: int = 0
) -> list[tuple[Floats, int]]:
    """Return those of many states that orbits come back to, and after how many steps; of fewer up to a longest period.

    No more than 1024 states are looked at, and 256 where periods are longer.
    """
    exact = point_map.without_table
    chosen = np.unique(np.linspace(0, len(states) - 1, min(len(states), _LOOKED_AT)).round().astype(int))
    states = states[chosen]
    orbits, periods = Orbits.starting(states.copy()), np.zeros(len(states), np.int64)
    near, few = _CLOSED * np.array([resolution(state, extent) for state in states]), np.ones(len(states), bool)
    for q in range(1, max(longest_period, longest) + 1):
        check_stop()
        if q == longest_period + 1:
            few[:] = False
            few[np.linspace(0, len(states) - 1, min(len(states), _FEWER)).round().astype(int)] = True
        rows = np.flatnonzero(few & (periods == 0))
        some = orbits[rows]
        advance_on_threads(exact.advance, some, 1)
        orbits[rows] = some
        back = (np.abs(difference(some.points, states[rows], exact.coordinates)) <= near[rows]).all(axis=1)
        periods[rows[back]] = q
    return [(states[k], int(periods[k])) for k in np.flatnonzero(periods)]


def _explored(exact: PointMap, place: Floats, period: int, extent: Floats) -> tuple[Attractor | None, Floats]:
    """Return the attracting segment through a place, None for none, and the points of what was followed."""
    curve = traced(exact, place, period, extent)
    if curve is None:
        return None, place[None]
    points, matrix, closed = curve
    if not closed and fades(exact, points, period, extent):
        return None, points
    dense = densely(points, exact, extent, closed)
    size = extent * min(1.0, float(np.abs(difference(dense, dense[0], exact.coordinates) / extent).max()))
    segments = [Segment(exact, dense, size, closed)]
    for _ in range(period - 1):
        images = follow(exact, segments[-1].points, 1).points
        if closed and segments[0].distances(images).max() < segments[0].spacing():
            break  # a closed curve that is all of its images
        segments.append(replace(segments[-1], points=images))
    line = np.concatenate([segment.points[::8] for segment in segments])
    covers = [_cover(segment, len(segments) if closed else period) for segment in segments]
    if any(cover is None for cover in covers):
        return None, line
    cover = _joined([c for c in covers if c is not None], segments)
    image = follow(exact, points[len(points) // 2], period)
    multipliers = multipliers_of(matrix)
    with np.errstate(divide="ignore"):
        exponents = np.log(np.abs(multipliers)) / period
    kept = np.linspace(0, DENSE - 1, max(_SAMPLE // len(segments), 2)).round().astype(int)
    sample = np.concatenate([segment.points[kept] for segment in segments])
    rotations = tuple(image.rotations.tolist())
    attractor = Attractor(
        Kind.CONTINUUM, period, sample, rotations, multipliers, exponents, exact.coordinates, cover=cover
    )
    return attractor, line


def _cover(segment: Segment, period: int) -> Cover | None:
    """Return the boxes of the widest tube around a segment that is seen to contract, but for its ends."""
    exact, d, unit = segment.exact, segment.exact.dimension, segment.spacing()
    for radius in _RADII:
        begin = wrap(segment.surface(np.array([radius])).reshape(-1, d), exact.coordinates)
        # What the middle needs all of it needs: it is in every part that is long enough.
        steps, moved = _halving(segment, begin.reshape(_ALONG, -1, d)[_ALONG // 2], radius, period)
        if not steps or (not segment.closed and 2 * _left_out(moved, radius / unit) >= DENSE // 2):
            continue
        # In more steps points move as far along it, or farther, in all directions as in some.
        few = begin.reshape(_ALONG, -1, d)[:, ::_FEW].reshape(-1, d)
        orbits = Orbits.starting(few.copy())
        advance_on_threads(exact.advance, orbits, steps)
        kept = _between_ends(segment, few, orbits.points, radius, unit)
        if kept is not None and kept[1] - kept[0] <= DENSE // 2:
            continue
        orbits = Orbits.starting(begin.copy())
        for made in doubled(exact, orbits, steps, _LONGEST):
            kept = _between_ends(segment, begin, orbits.points, radius, unit)
            if kept is not None:
                low, high = kept
                if high - low > DENSE // 2:
                    shorter = replace(segment, points=segment.points[low : high + 1])
                    return cover_of_tube(shorter, Tube(radius, made, 0.5))
                break
    return None


def _between_ends(
    segment: Segment, begin: Floats, images: Floats, radius: float, unit: float
) -> tuple[int, int] | None:
    """Return the first and last point of a segment between whose ends some steps have halved all distances.

    Points beside the ends may leave; all of those between them have to come closer, else there is None.
    """
    apart, after = segment.feet(images)
    along = np.abs(after - segment.feet(begin)[1]).reshape(_ALONG, -1)
    halved = np.max(apart.reshape(_ALONG, -1), axis=1) <= 0.5 * radius
    if segment.closed:
        return (0, DENSE - 1) if halved.all() else None
    inner, each = np.flatnonzero(halved), (DENSE - 1) / (_ALONG - 1)
    if len(inner) <= _ALONG // 2 or not halved[inner[0] : inner[-1] + 1].all():
        return None
    margin = _left_out(along[inner].max(), radius / unit)
    return int(np.ceil(inner[0] * each)) + margin, int(inner[-1] * each) - margin


def _left_out(moved: float, radius: float) -> int:
    """Return how many points at an end of a segment a tube leaves out: four times what others move along it."""
    return int(np.ceil(4.0 * moved + 2.0 * radius))


def _halving(segment: Segment, begin: Floats, radius: float, period: int) -> tuple[int, float]:
    """Return in how many steps some points of a tube come to half of its radius, 0 if never; how far they move along.

    Both in points of the segment.
    """
    orbits, before = Orbits.starting(begin.copy()), np.inf
    for steps in doubled(segment.exact, orbits, period, _LONGEST):
        apart, after = segment.feet(orbits.points)
        if steps >= _SETTLED * period and apart.max() > _STANDS * before:
            break
        before = float(apart.max())
        if apart.max() <= 0.5 * radius:
            return steps, float(np.abs(after - segment.feet(begin)[1]).max())
    return 0, 0.0


def _joined(covers: Sequence[Cover], segments: Sequence[Segment]) -> Cover:
    """Put covers together, in boxes of the first; with boxes at the ends of a single segment, see :func:`_drawn`."""
    first, exact = covers[0], segments[0].exact
    centres = np.concatenate([c.lower + (c.boxes + 0.5) * c.widths for c in covers])
    boxes = distinct_boxes(boxes_of(centres, first.lower, first.widths, exact))
    if len(segments) > 1 or segments[0].closed:
        return Cover(first.lower, first.widths, boxes, np.ones(len(boxes), bool))
    known = Cover(first.lower, first.widths, boxes)
    points = segments[0].points
    around = boxes_around(first.widths, turns_of(exact.coordinates)[1])
    ends = np.unique(
        boxes_of(points[~inside_cover(known, points, exact)], first.lower, first.widths, exact), axis=0
    )  # fmt: skip
    beside = np.array(list(itertools.product((-1, 0, 1), repeat=exact.dimension)))
    further = moved_boxes(ends, beside, around)
    further = further[
        ~inside_cover(known, wrap(first.lower + (further + 0.5) * first.widths, exact.coordinates), exact)
    ]
    both = np.concatenate([boxes, further])
    certain = np.concatenate([np.ones(len(boxes), bool), _drawn(segments[0], first, further)])
    order = np.lexsort(both.T[::-1])
    return Cover(first.lower, first.widths, both[order], certain[order])


def _drawn(segment: Segment, cover: Cover, boxes: Ints) -> Bools:
    """Tell in which boxes centre and corners rest, or come closer to the segment; of very many, in none."""
    exact, d = segment.exact, segment.exact.dimension
    drawn = np.ones(len(boxes), bool)
    # Where the centre is not drawn in, the corners need not be followed.
    for corners in (np.full((1, d), 0.5), np.array(list(itertools.product((0.0, 1.0), repeat=d)))):
        if np.count_nonzero(drawn) * len(corners) > _MOST_PLACES:
            return np.zeros(len(boxes), bool)
        places = cover.lower + (boxes[drawn][:, None, :] + corners) * cover.widths
        begin = wrap(places.reshape(-1, d), exact.coordinates)
        orbits = Orbits.starting(begin.copy())
        advance_on_threads(exact.advance, orbits, 1)
        moved = np.abs(difference(orbits.points, begin, exact.coordinates))
        rests = (moved <= AT_REST * resolution(begin, segment.size)).all(axis=-1)
        advance_on_threads(exact.advance, orbits, _PERIODS - 1)
        far, near = segment.distances(begin), segment.distances(orbits.points)
        drawn[drawn] = (rests | (near < far)).reshape(-1, len(corners)).all(axis=1)
    return drawn


def joined_continua(point_map: PointMap, attractors: Sequence[Attractor]) -> tuple[tuple[Attractor, ...], Ints]:
    """Join continua whose covers overlap; return all attractors, and the new number of each of the old ones.

    Two overlap if a point of one lies in the cover of the other.  The longest gives its kind and its boxes to all.
    Chaotic sets of one neutral family are joined, however far apart they are.
    """
    number = len(attractors)
    exact, overlap = point_map.without_table, np.eye(number, dtype=bool)
    lines = [k for k, a in enumerate(attractors) if a.kind in (Kind.EQUILIBRIA, Kind.CONTINUUM)]
    for j, k in itertools.permutations(lines, 2):
        cover = attractors[j].cover
        same = attractors[j].period == attractors[k].period and cover is not None
        overlap[j, k] = same and inside_cover(cover, attractors[k].points, exact).any()  # type: ignore[arg-type]
    subspaces = ((k, a.subspace) for k, a in enumerate(attractors) if a.subspace is not None)
    for (j, one), (k, other) in itertools.permutations([(k, s) for k, s in subspaces if s.is_neutral], 2):
        overlap[j, k] = one.is_parallel(other)
    if overlap.sum() == number:
        return tuple(attractors), np.arange(number)
    from scipy.sparse.csgraph import connected_components

    groups = connected_components(overlap, directed=False)[1]
    first = np.unique(groups, return_index=True)[1]
    joined = [
        _of_pieces(exact, [attractors[k] for k in np.flatnonzero(groups == g).tolist()]) for g in groups[np.sort(first)]
    ]
    return tuple(joined), np.searchsorted(np.sort(first), first[groups])


def _of_pieces(exact: PointMap, pieces: Sequence[Attractor]) -> Attractor:
    if len(pieces) == 1:
        return pieces[0]
    longest = max(pieces, key=lambda a: np.abs(difference(a.points, a.points[0], a.coordinates)).max())
    cover = longest.cover
    for piece in pieces:
        if piece is not longest and cover is not None and piece.cover is not None:
            cover = _with_boxes(exact, cover, piece.cover)
    if longest.kind is Kind.CHAOTIC and cover is not None:
        cover = replace(cover, certain=None)
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
    new = distinct_boxes(boxes_of(places, cover.lower, cover.widths, exact))
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
