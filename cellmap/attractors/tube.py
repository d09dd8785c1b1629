"""Verified trapping regions around invariant curves: tubes, covered by boxes."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Hashable
from dataclasses import dataclass
from typing import Any, Protocol, cast

import numpy as np

from .._lib.arrays import Floats, Ints
from .._lib.stopping import check_stop
from ..maps.coordinates import difference, turns_of, wrap
from ..maps.orbit_batch import CHUNK, Orbits
from ..maps.point_map import PointMap
from ..orbits.attractor import Cover
from .boxes import boxes_of, in_units

DENSE = 2048
"""Points of each curve, between which it is straight."""

MOST_STEPS, FIRST_FACTOR = 256, 0.6
"""Steps after which points of the first surface have to be closer to the curves, and the factor."""

_SEEN = 128  # points of each surface along a curve
_NARROW = 1e-4  # radius of the first surface, in units of the curve's size
_ALLOWED = 0.9  # largest factor on all other surfaces
_GROWTH = 1.25
_AHEAD = 4  # surfaces that are looked at together
_FINENESS = {1: 0.5, 2: 0.5, 3: 0.5, 4: 0.75}  # diagonal of a box in units of the tube's radius; else 1.5
_MOST_BOXES = 2**20


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
    """Closed curves: points (curves, n, dimension) in their order; ``size`` makes distances along axes comparable."""

    exact: PointMap
    points: Floats
    size: Floats

    def distances(self, points: Floats) -> Floats:
        """Return the distance of points (n, dimension) to the nearest curve, inf for points that are not finite."""
        found = np.full(len(points), np.inf)
        finite = np.flatnonzero(np.isfinite(points).all(axis=1))
        nearest = nearest_places(self, points[finite])
        curve, k = np.divmod(nearest, self.points.shape[1])
        for side in (-1, 1):
            here, there = self.points[curve, k], self.points[curve, (k + side) % self.points.shape[1]]
            found[finite] = np.minimum(found[finite], feet_on_edges(self, points[finite], here, there)[0])
        return found

    def between(self, distances: Floats) -> Floats:
        """Return the largest of distances (surfaces, n), with half of what they change to the next along a curve."""
        values = distances.reshape(len(distances), len(self.points), _SEEN, -1)
        with np.errstate(invalid="ignore"):
            beside = values + 0.5 * np.abs(values - np.roll(values, 1, axis=2))
        return np.asarray(np.where(np.isnan(beside), np.inf, beside).reshape(len(distances), -1).max(axis=1))

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


@dataclass(frozen=True)
class Tube:
    """Points closer to curves than a radius: after some steps each is closer by a factor of at most `contraction`."""

    radius: float
    steps: int
    contraction: float


def verified_tube(curves: Attracting, extent: Floats, narrowest: float) -> Tube | None:
    """Return the widest tube around attracting curves on whose inner surfaces all points are seen to come closer.

    After a fixed number of steps the distance to the curves has fallen by a tenth or more, everywhere on surfaces from
    the narrowest to the widest, each a quarter wider than the one before.  A distance that falls again and again leaves
    no other attractor in the tube.  None where the narrowest surface does not contract.
    """
    limit = 0.25 * float((extent / curves.size).min())
    radius = max(_NARROW, narrowest)
    if curves.exact.dimension == 1:
        return Tube(limit, 1, 0.0)
    if radius > limit:
        return None
    steps, factor = _steps_needed(curves, radius)
    if not steps:
        return None
    while radius < limit:
        radii = np.minimum(radius * _GROWTH ** np.arange(1, _AHEAD + 1), limit)
        factors = _factors(curves, radii, steps)
        passed = int(np.argmin(np.append(factors <= _ALLOWED, False)))
        if passed:
            radius, factor = float(radii[passed - 1]), max(factor, float(factors[:passed].max()))
        if passed < len(radii):
            break
    return Tube(radius, steps, factor)


def cover_of_tube(curves: Attracting, tube: Tube) -> Cover | None:
    """Return boxes that lie in a tube, and hold all that is close to its curves; None where they are too many."""
    d = curves.exact.dimension
    lower, turn = turns_of(curves.exact.coordinates)
    fineness = _FINENESS.get(d, 1.5) * min(tube.radius, 1.0)
    widths = curves.size * (fineness / np.sqrt(d))
    widths = np.where(turn > 0, turn / np.maximum(np.ceil(turn / widths), 1.0), widths)
    corner = np.where(turn > 0, lower, curves.points.reshape(-1, d)[0])
    points = curves.points.reshape(-1, d)
    visited = np.unique(boxes_of(points, corner, widths, curves.exact), axis=0)
    half = 0.5 * float(np.linalg.norm(widths / curves.size))
    reach = np.ceil((tube.radius - half) * curves.size / widths).astype(int).clip(1, None)
    while len(visited) * np.prod(2 * reach + 1) > _MOST_BOXES and reach.max() > 1:
        reach = np.maximum(reach - 1, 1)
    steps = list(itertools.product(*[range(-r, r + 1) for r in reach]))
    if len(visited) * len(steps) > _MOST_BOXES:
        return None
    # Boxes are numbered within the turn of an angle, as the places of points are.
    centres = corner + (visited[:, None, :] + np.array(steps) + 0.5) * widths
    boxes = np.unique(boxes_of(centres.reshape(-1, d), corner, widths, curves.exact), axis=0)
    if d > 1:
        boxes = boxes[curves.distances(corner + (boxes + 0.5) * widths) + half <= tube.radius]
    if not len(boxes):
        return None
    return Cover(corner, widths, boxes, np.ones(len(boxes), bool))


def feet_on_edges(curves: Attracting, points: Floats, here: Floats, there: Floats) -> tuple[Floats, Floats]:
    """Return distances of points to straight edges, a row each, and at which fraction of its edge each is nearest."""
    along = difference(there, here, curves.exact.coordinates) / curves.size
    shift = difference(points, here, curves.exact.coordinates) / curves.size
    length = np.maximum((along**2).sum(axis=1), 1e-300)
    fraction = np.clip((shift * along).sum(axis=1) / length, 0.0, 1.0)
    return np.linalg.norm(shift - fraction[:, None] * along, axis=1), fraction


def nearest_places(curves: Attracting, points: Floats) -> Ints:
    """Return the number of the point of the set that is nearest to each of some finite points (n, dimension)."""
    return np.asarray(_tree(cast(Hashable, curves)).query(in_units(points, curves.size, curves.exact))[1], np.int64)


@functools.lru_cache(maxsize=1)
def _tree(curves: Any) -> Any:
    from scipy.spatial import KDTree

    box = turns_of(curves.exact.coordinates)[1] / curves.size
    return KDTree(in_units(curves.points.reshape(-1, len(box)), curves.size, curves.exact), boxsize=box)


def _steps_needed(curves: Attracting, radius: float) -> tuple[int, float]:
    """Return after how many steps the points of a surface are close enough, and the factor; 0 steps if never."""
    orbits = Orbits.starting(curves.surface(np.array([radius])).reshape(-1, curves.exact.dimension))
    made, steps = 0, 1
    while steps <= MOST_STEPS:
        check_stop()
        curves.exact.advance(orbits, steps - made)
        made = steps
        factor = float(curves.between(curves.distances(orbits.points)[None])[0] / radius)
        if factor <= FIRST_FACTOR:
            return steps, factor
        steps *= 2
    return 0, np.inf


def _factors(curves: Attracting, radii: Floats, steps: int) -> Floats:
    """Return for each surface the largest factor by which some steps change the distance to the curves."""
    orbits = Orbits.starting(curves.surface(radii).reshape(-1, curves.exact.dimension))
    for begin in range(0, len(orbits), CHUNK):
        check_stop()
        curves.exact.advance(orbits[begin : begin + CHUNK], steps)
    after = curves.distances(orbits.points).reshape(len(radii), -1)
    return np.asarray(curves.between(after) / radii)
