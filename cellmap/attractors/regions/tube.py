"""Verified trapping regions around invariant curves and tori: tubes, covered by boxes."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass
from typing import Any, Protocol, cast

import numpy as np

from ..._lib.arrays import Complexes, Floats, Ints, evenly
from ..._lib.computed import computed_once
from ..._lib.stopping import check_stop
from ...maps.coordinates import difference, turns_of, wrap
from ...maps.orbit_batch import Orbits
from ...maps.paths import moved_on
from ...maps.point_map import PointMap
from ...maps.side_by_side import advance_on_threads
from ...orbits.attractor import Cover
from ...orbits.invariant_torus import InvariantTorus, places_of
from .boxes import boxes_around, boxes_of, distinct_boxes, in_units, moved_boxes, tree_of

DENSE = 2048
"""Points of each curve, between which it is straight."""

SAMPLED = 4
"""Dimensions, at most, in which surfaces around attractors are sampled densely."""

MOST_STEPS, FIRST_FACTOR = 512, 0.6
"""Steps after which points of the first surface have to be closer to the curves, and the factor."""

NARROW = 1e-4
"""Radius of the first surface, in units of the curve's size."""

LEAST = 0.01
"""Length along an axis in which distances from a curve are measured, in units of the largest, at least."""

_SEEN = 64  # points of each surface along a curve
_ALLOWED = 0.9  # largest factor on all other surfaces
_WIDER, _ALIKE = 16.0, 0.1  # factor between surfaces where contraction is the same on both, and what it may differ by;
_GROWTH = 2.0, 1.25  # the largest factor between others, and the least
_FINENESS = 0.5, 0.75  # diagonal of a box in units of the tube's radius, and the same in four dimensions
_MOST_BOXES = 2**20
_CELLS = 256  # points of a torus in each phase, between which it is a paraboloid
_REACH = 2.0  # cells of this grid, at most, between a point and the nearest one on the torus
_TORUS_SEEN = 24  # points of each surface in each phase
_PIECES = 16  # of a curve, before they are halved where it bends
_ACROSS_TUBE = 0.7  # semi-axis of an ellipsoid across a tube, in units of its radius
_WELL_INSIDE = 0.6  # square of the distance of a piece from the centre of its ellipsoid, in units of its axes
_MOST_ELLIPSOIDS = 2**13
_ACROSS = 4  # directions of each surface in each of those across a torus, where there are several


class Attracting(Protocol):
    """An invariant set around which a tube is verified.

    ``points`` (..., dimension) are so many that any box beside the set is near one of them; ``size`` makes distances
    along axes comparable.
    """

    @property
    def exact(self) -> PointMap:
        """The map under which the set is invariant."""

    @property
    def points(self) -> Floats:
        """Points of the set."""

    @property
    def size(self) -> Floats:
        """Lengths along each axis."""

    def distances(self, points: Floats) -> Floats:
        """Return the distance of points (n, dimension) to the set, inf for points that are not finite."""

    def surface(self, radii: Floats) -> Floats:
        """Return points (radii, ..., dimension) beside the set, across it."""

    def between(self, distances: Floats) -> Floats:
        """Return the largest of distances (radii, ...) of these points, and of those between them."""


@dataclass(frozen=True, eq=False)
class Curves:
    """Curves: points (curves, n, dimension) in their order; ``size`` makes distances along axes comparable."""

    exact: PointMap
    points: Floats
    size: Floats
    closed: bool = True

    def distances(self, points: Floats) -> Floats:
        """Return the distance of points (n, dimension) to the nearest curve, inf for points that are not finite."""
        return self.feet(points)[0]

    def feet(self, points: Floats) -> tuple[Floats, Floats]:
        """Return distances of points, and where along their curve, in points from its begin, they are nearest."""
        apart, where = np.full(len(points), np.inf), np.zeros(len(points))
        finite = np.flatnonzero(np.isfinite(points).all(axis=1))
        lines = self.points.reshape(-1, *self.points.shape[-2:])
        last = lines.shape[1] - 1
        curve, nearest = np.divmod(nearest_places(self, points[finite]), last + 1)
        for side in (-1, 1):
            there = (nearest + side) % (last + 1) if self.closed else np.clip(nearest + side, 0, last)
            far, fraction = _feet_on_edges(self, points[finite], lines[curve, nearest], lines[curve, there])
            closer = far < apart[finite]
            apart[finite[closer]], where[finite[closer]] = far[closer], (nearest + side * fraction)[closer]
        return apart, where

    def between(self, distances: Floats) -> Floats:
        """Return the largest of distances (surfaces, n), with half of what they change to the next along a curve."""
        return _largest(distances.reshape(len(distances), len(self.points), _SEEN, -1), (2,))

    def surface(self, radii: Floats) -> Floats:
        """Return points (radii, curves, along, directions, dimension) beside the curves, across them."""
        d, number = self.exact.dimension, self.points.shape[1]
        chosen = np.arange(_SEEN) * (number // _SEEN)
        here = self.points[:, chosen]
        ahead, behind = (self.points[:, (chosen + side) % number] for side in (1, -1))
        tangents = difference(ahead, behind, self.exact.coordinates) / self.size
        tangents /= np.maximum(np.linalg.norm(tangents, axis=-1, keepdims=True), 1e-300)
        if d == 2:
            normal = np.stack([-tangents[..., 1], tangents[..., 0]], axis=-1)
            across = np.stack([normal, -normal], axis=-2)
        else:
            free = np.random.default_rng(0).standard_normal((4 * (d - 1), d))
            free = np.concatenate([free, -free])
            across = free - (free @ tangents[..., None]) * tangents[..., None, :]
            across /= np.linalg.norm(across, axis=-1, keepdims=True)
        shift = radii[:, None, None, None, None] * across * self.size
        return wrap((here[:, :, None, :] + shift).reshape(-1, d), self.exact.coordinates).reshape(shift.shape)


@dataclass(frozen=True, eq=False)
class DenseTorus:
    """A torus in points; ``size`` makes distances along axes comparable."""

    exact: PointMap
    torus: InvariantTorus
    size: Floats

    @property
    def points(self) -> Floats:
        """Points (n, dimension)."""
        return self._patches[0]

    @computed_once
    def _patches(self) -> tuple[Floats, Floats, Floats]:
        """Points (n, d), first (n, d, 2) and second derivatives (n, d, 2, 2) by the phases, in steps of the grid."""
        coordinates, torus = self.exact.coordinates, self.torus
        turn = turns_of(coordinates)[1]
        waves = torus.waves(np.arange(_CELLS) / _CELLS)
        k = (np.arange(len(waves)) - len(waves) // 2) * (2j * np.pi / _CELLS)

        def values(first: int, second: int) -> Complexes:
            weighted = torus.coefficients * (k**first)[:, None] * k**second
            found = np.einsum("dkl,kn,lm->nmd", weighted, waves, waves, optimize=True)
            return np.asarray(found.reshape(-1, len(coordinates)))

        value = values(0, 0)
        slopes = np.stack([values(1, 0), values(0, 1)], axis=-1)
        bends = np.stack([values(2, 0), values(1, 1), values(1, 1), values(0, 2)], axis=-1).reshape(*value.shape, 2, 2)
        # Of an angle, the logarithm has the derivatives.
        unit = np.where(np.abs(value) > 0.0, value, 1.0)[..., None]
        along = slopes / unit
        curved = bends / unit[..., None] - along[..., None, :] * along[..., :, None]
        angle, scale = (turn > 0)[:, None], (turn / (2 * np.pi))[:, None]
        return (
            places_of(value, coordinates),
            np.where(angle, along.imag * scale, slopes.real),
            np.where(angle[..., None], curved.imag * scale[..., None], bends.real),
        )

    def distances(self, points: Floats) -> Floats:
        """Return the distance of points (n, dimension) to the torus, inf for points that are not finite."""
        found = np.full(len(points), np.inf)
        finite = np.flatnonzero(np.isfinite(points).all(axis=1))
        places, slopes, bends = (part[nearest_places(self, points[finite])] for part in self._patches)
        shift = difference(points[finite], places, self.exact.coordinates) / self.size
        slopes, bends = slopes / self.size[:, None], bends / self.size[:, None, None]
        steps = np.zeros((len(finite), 2))
        for _ in range(3):
            foot = np.einsum("ndi,ni->nd", slopes, steps) + 0.5 * np.einsum("ndij,ni,nj->nd", bends, steps, steps)
            here = slopes + np.einsum("ndij,nj->ndi", bends, steps)
            normal = np.einsum("ndi,ndj->nij", here, here) + 1e-30 * np.eye(2)
            right = np.einsum("ndi,nd->ni", here, shift - foot)
            steps = np.clip(steps + np.linalg.solve(normal, right[..., None])[..., 0], -_REACH, _REACH)
        foot = np.einsum("ndi,ni->nd", slopes, steps) + 0.5 * np.einsum("ndij,ni,nj->nd", bends, steps, steps)
        found[finite] = np.linalg.norm(shift - foot, axis=1)
        return found

    def surface(self, radii: Floats) -> Floats:
        """Return points (radii, along, along, directions, dimension) beside the torus, across it."""
        d = self.exact.dimension
        chosen = np.round(np.arange(_TORUS_SEEN) * (_CELLS / _TORUS_SEEN)).astype(int)
        rows = (chosen[:, None] * _CELLS + chosen).ravel()
        here, slopes, _ = (part[rows] for part in self._patches)
        tangents = np.linalg.qr(slopes / self.size[:, None])[0]
        free = np.random.default_rng(0).standard_normal((1 if d == 3 else _ACROSS * (d - 2), d))
        across = free - np.einsum("ndi,nei,me->nmd", tangents, tangents, free)
        across /= np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), 1e-300)
        across = np.concatenate([across, -across], axis=1)
        shift = radii[:, None, None, None] * across * self.size
        places = wrap((here[:, None, :] + shift).reshape(-1, d), self.exact.coordinates)
        return np.asarray(places.reshape(len(radii), _TORUS_SEEN, _TORUS_SEEN, -1, d))

    def between(self, distances: Floats) -> Floats:
        """Return the largest of distances (radii, n), with half of what they change to the next in each phase."""
        return _largest(distances.reshape(len(distances), _TORUS_SEEN, _TORUS_SEEN, -1), (1, 2))


@dataclass(frozen=True)
class Tube:
    """Points closer to curves than a radius: after some steps each is closer by a factor of at most `contraction`."""

    radius: float
    steps: int
    contraction: float


def images_of_surface(exact: PointMap) -> int:
    """Return how many points a surface around a curve has."""
    return _SEEN * 8 * (exact.dimension - 1)


def _largest(values: Floats, axes: tuple[int, ...]) -> Floats:
    """Return the largest of each of some values (n, ...), with half of what they change to the next along axes."""
    with np.errstate(invalid="ignore"):
        beside = values + 0.5 * sum(np.abs(values - np.roll(values, 1, axis=axis)) for axis in axes)
    return np.asarray(np.where(np.isnan(beside), np.inf, beside).reshape(len(values), -1).max(axis=1))


def verified_tube(
    curves: Attracting, extent: Floats, narrowest: float, most_steps: int = MOST_STEPS, patience: int = 0
) -> Tube | None:
    """Return the widest tube around attracting curves on whose inner surfaces all points are seen to come closer.

    After a fixed number of steps the distance to the curves has fallen by a tenth or more, everywhere on surfaces from
    the narrowest to the widest, each a quarter wider than the one before; in four dimensions, where surfaces take many
    points, and with `patience`, each at most twice as wide, or 16 times as long as contraction is the same, as it is
    where the map is all but linear.  A distance that falls again and again leaves no other attractor in the tube.  None
    where the narrowest surface does not contract.  With `patience` for so many steps, those needed on the narrowest
    surface are doubled where a wider one takes more.
    """
    limit = 0.25 * float((extent / curves.size).min())
    radius = max(NARROW, narrowest)
    if curves.exact.dimension == 1:
        return Tube(limit, 1, 0.0)
    if radius > limit:
        return None
    steps, factor = _steps_needed(curves, radius, most_steps)
    if not steps:
        return None
    linear, failed = factor, np.inf
    growth = _WIDER if patience or curves.exact.dimension > 3 else _GROWTH[1]
    while radius < limit and growth >= _GROWTH[1]:
        wider = min(growth * radius, limit)
        there = _factor(curves, wider, steps) if wider < failed else np.inf
        if there <= _ALLOWED and (wider <= _GROWTH[0] * radius or abs(there - linear) <= _ALIKE):
            radius, factor = wider, max(factor, there)
        elif wider <= _GROWTH[0] * radius and 2 * steps <= patience:
            steps *= 2  # where each point has come closer after some steps, it has after twice as many
        else:
            growth, failed = growth**0.5, failed if there <= _ALLOWED else wider
    return Tube(radius, steps, factor)


def floor_of(curves: Curves, steps: int = 1, number: int = DENSE) -> float:
    """Return how far a number of points of each curve are from the curves, straight in between, after some steps."""
    points = curves.points[:, evenly(curves.points.shape[1], number)]
    orbits = Orbits.starting(points.reshape(-1, points.shape[-1]))
    moved_on(curves.exact, orbits, steps)
    return float(curves.distances(orbits.points).max())


def cover_of_tube(curves: Attracting, tube: Tube) -> Cover | None:
    """Return boxes that lie in a tube, and hold all that is close to its curves; None where they are too many."""
    d = curves.exact.dimension
    lower, turn = turns_of(curves.exact.coordinates)
    fineness = _FINENESS[d > 3] * min(tube.radius, 1.0)
    widths = curves.size * (fineness / np.sqrt(d))
    widths = np.where(turn > 0, turn / np.maximum(np.ceil(turn / widths), 1.0), widths)
    corner = np.where(turn > 0, lower, curves.points.reshape(-1, d)[0])
    points = curves.points.reshape(-1, d)
    visited = distinct_boxes(boxes_of(points, corner, widths, curves.exact))
    half = 0.5 * float(np.linalg.norm(widths / curves.size))
    reach = np.ceil((tube.radius - half) * curves.size / widths).astype(int).clip(1, None)
    while len(visited) * np.prod(2.0 * reach + 1.0) > _MOST_BOXES and reach.max() > 1:
        reach = np.maximum(reach - 1, 1)
    if len(visited) * np.prod(2.0 * reach + 1.0) > _MOST_BOXES:
        return None
    steps = np.array(list(itertools.product(*[range(-r, r + 1) for r in reach])))
    boxes = moved_boxes(visited, steps, boxes_around(widths, turn))
    if d > 1:
        boxes = boxes[curves.distances(corner + (boxes + 0.5) * widths) + half <= tube.radius]
    if not len(boxes):
        return None
    return Cover(corner, widths, boxes, np.ones(len(boxes), bool))


def ellipsoids_of_tube(
    curves: Curves, tube: Tube, bent: Callable[[Floats, Floats], Floats]
) -> tuple[Floats, Floats] | None:
    """Return centres (n, d) and metrics (n, d, d) of ellipsoids in a tube that hold its closed curve; None if too many.

    The curve is cut into pieces, each of which is halved until it is well inside of an ellipsoid along the line between
    its ends that lies in the tube; where short ones do not, they become narrower.  ``bent`` returns the points at some
    shifts (n, ..., d) from centres.
    """
    d, coordinates = curves.exact.dimension, curves.exact.coordinates
    vertices = curves.points[0]
    ways = difference(np.roll(vertices, -1, axis=0), vertices, coordinates)
    path = np.concatenate([vertices[:1], vertices[0] + np.cumsum(ways, axis=0)])
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(ways / curves.size, axis=1))])
    cuts = np.linspace(0.0, lengths[-1], _PIECES + 1)
    begin, end = cuts[:-1], cuts[1:]
    sphere = np.random.default_rng(0).standard_normal((8 * d, d))
    sphere = np.concatenate([np.eye(d), -np.eye(d), sphere / np.linalg.norm(sphere, axis=1, keepdims=True)])
    found = list[tuple[Floats, Floats]]()
    across, count = np.full(len(begin), _ACROSS_TUBE * tube.radius), 0
    while len(begin):
        inner = begin[:, None] + (end - begin)[:, None] * np.linspace(0.0, 1.0, 9)
        places = np.stack([np.interp(inner, lengths, path[:, j]) for j in range(d)], axis=-1)
        centres, chord = 0.5 * (places[:, 0] + places[:, -1]), (places[:, -1] - places[:, 0]) / curves.size
        half = 0.5 * np.linalg.norm(chord, axis=1)
        frames = _frames_along(chord)
        axes = np.tile(across[:, None], d)
        axes[:, 0] = np.maximum(np.sqrt(2.0) * half, across)
        inside = np.einsum("nij,npj->npi", frames, (places - centres[:, None]) / curves.size) / axes[:, None]
        ends = np.einsum("nji,npj->npi", frames, sphere * axes[:, None]) * curves.size
        edge = wrap(bent(centres[:, None], ends).reshape(-1, d), coordinates)
        apart = curves.distances(edge).reshape(len(begin), -1)
        good = ((inside**2).sum(axis=2).max(axis=1) <= _WELL_INSIDE) & (apart.max(axis=1) <= tube.radius)
        scaled = frames[good] / axes[good][:, :, None] / curves.size
        found.append((wrap(centres[good], coordinates), np.einsum("nji,njk->nik", scaled, scaled)))
        count += int(good.sum())
        # A short piece has an ellipsoid that is too wide.
        short = ~good & (axes[:, 0] <= across)
        long_ = ~good & ~short
        middle = 0.5 * (begin + end)[long_]
        begin, end = (
            np.concatenate(p) for p in ((begin[short], begin[long_], middle), (end[short], middle, end[long_]))
        )
        across = np.concatenate([0.5 * across[short], across[long_], across[long_]])
        if count + len(begin) > _MOST_ELLIPSOIDS:
            return None
    return np.concatenate([c for c, _ in found]), np.concatenate([m for _, m in found])


def _frames_along(directions: Floats) -> Floats:
    """Return orthonormal rows (n, d, d), the first along some directions (n, d)."""
    d = directions.shape[1]
    length = np.linalg.norm(directions, axis=1, keepdims=True)
    unit = np.where(length > 0.0, directions / np.maximum(length, 1e-300), np.eye(d)[0])
    # Householder's reflection takes the first axis to the direction, or to its opposite.
    sign = np.where(unit[:, :1] < 0.0, -1.0, 1.0)
    mirror = unit + sign * np.eye(d)[0]
    return np.asarray(
        np.eye(d) - 2.0 * mirror[:, :, None] * mirror[:, None, :] / (mirror**2).sum(axis=1)[:, None, None]
    )


def _feet_on_edges(curves: Attracting, points: Floats, here: Floats, there: Floats) -> tuple[Floats, Floats]:
    """Return distances of points to straight edges, a row each, and at which fraction of its edge each is nearest."""
    along = difference(there, here, curves.exact.coordinates) / curves.size
    shift = difference(points, here, curves.exact.coordinates) / curves.size
    length = np.maximum((along**2).sum(axis=1), 1e-300)
    fraction = np.clip((shift * along).sum(axis=1) / length, 0.0, 1.0)
    return np.linalg.norm(shift - fraction[:, None] * along, axis=1), fraction


def lengths_beside(span: Floats, extent: Floats) -> Floats:
    """Return lengths in which distances from a curve of some span are about the same in all directions."""
    return np.asarray(np.maximum(span, LEAST * extent * (span / extent).max()))


def nearest_places(curves: Attracting, points: Floats) -> Ints:
    """Return the number of the point of the set that is nearest to each of some finite points (n, dimension)."""
    return np.asarray(_tree(cast(Hashable, curves)).query(in_units(points, curves.size, curves.exact))[1], np.int64)


@functools.lru_cache(maxsize=1)
def _tree(curves: Any) -> Any:
    return tree_of(curves.points.reshape(-1, len(curves.size)), curves.size, curves.exact)


def _steps_needed(curves: Attracting, radius: float, most: int) -> tuple[int, float]:
    """Return after how many steps the points of a surface are close enough, and the factor; 0 steps if never."""
    orbits = Orbits.starting(curves.surface(np.array([radius])).reshape(-1, curves.exact.dimension))
    for steps in doubled(curves.exact, orbits, 1, most):
        factor = float(curves.between(curves.distances(orbits.points)[None])[0] / radius)
        if factor <= FIRST_FACTOR:
            return steps, factor
    return 0, np.inf


def doubled(exact: PointMap, orbits: Orbits, first: int, most: int) -> Iterator[int]:
    """Move orbits on; yield how many steps they have made, twice as many each time."""
    made, steps = 0, first
    while steps <= most:
        check_stop()
        advance_on_threads(exact.advance, orbits, steps - made)
        yield steps
        made, steps = steps, 2 * steps


def _factor(curves: Attracting, radius: float, steps: int) -> float:
    """Return the largest factor by which some steps change the distance of points of a surface to the curves."""
    orbits = Orbits.starting(curves.surface(np.array([radius])).reshape(-1, curves.exact.dimension))
    moved_on(curves.exact, orbits, steps)
    return float(curves.between(curves.distances(orbits.points)[None])[0] / radius)
