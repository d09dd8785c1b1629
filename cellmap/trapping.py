"""Neighbourhoods of attractors that are verified to lie in their basins."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .attractor import Attractor, Neighbourhood
from .coordinates import difference, turns_of
from .jacobian import jacobian
from .pointmap import PointMap, Status, follow

_DIRECTIONS = 96  # on a circle
_FINE = {1: 1.01, 2: 1.0 + 2 * np.pi / _DIRECTIONS}  # from one shell to the next, where the map is not linear; else 1.1
_COARSE = 2.0  # where it is, and the surface is small:
_STRAIGHT = 0.01  # of the largest one
_ALL_BUT_LINEAR = 0.5  # of what the linear part leaves to spare: the most that may be seen of bend and error
_ABOVE = np.arange(6.0)  # octaves from the resolved radius on at which that is looked for,
_BELOW = -np.arange(1.0, 25.0).reshape(4, 6)  # and then downwards
_FARTHEST = 1e4  # largest half-width of an ellipsoid, relative to 1 + abs(point)


def trapping_neighbourhood(
    point_map: PointMap, attractor: Attractor, extent: NDArray[np.float64]
) -> Neighbourhood | None:
    """Return ellipsoids around a periodic attractor in which every orbit is verified to approach it.

    The metric is the sum of the squares of what the derivative of one round does to a vector in all later rounds, so
    that the linear map contracts in it by a known factor c < 1.  From a small ellipsoid on which the exact map is seen
    to be all but linear, the ellipsoids grow as long as the exact map shortens the distance to the attractor, by a
    factor of at most (1 + c)/2 in one round, everywhere on their surfaces.  Surfaces and directions are sampled as
    closely as the map bends: coarsely where it is all but linear, with steps of some percent of the radius beyond.  A
    distance that falls in every round leaves no other attractor in the ellipsoid.

    Parameters
    ----------
    point_map : PointMap
        The map; its exact map is used.
    attractor : Attractor
        A periodic attractor.
    extent : ndarray, shape (dimension,)
        Size of the region of interest; no half-width of an ellipsoid is larger than a quarter of it.

    Returns
    -------
    Neighbourhood or None
        None where even the smallest ellipsoid fails, as it does where the largest multiplier is too close to 1.
    """
    exact = point_map.exact or point_map
    turn = turns_of(exact.coordinates)[1]
    reach = _FARTHEST * (1.0 + np.abs(attractor.points).max(axis=0))
    limit = np.minimum(np.where(turn > 0, np.minimum(extent, turn), extent) / 4.0, reach)
    contraction = 0.5 * (1.0 + float(np.abs(attractor.multipliers[0])))
    matrices = jacobian(exact, attractor.points, attractor.period)
    metrics, worst = np.empty_like(matrices), 0.0
    for k, (centre, matrix) in enumerate(zip(attractor.points, matrices, strict=True)):
        shells = _Shells(exact, centre, attractor.period, matrix, contraction, limit)
        radius, factor = shells.largest_verified()
        if not radius > 0.0:
            return None
        metrics[k], worst = shells.metric / radius**2, max(worst, factor)
    return Neighbourhood(attractor.points, metrics, worst)


class _Shells:
    """Surfaces around one point of an attractor, from small to large."""

    def __init__(
        self,
        exact: PointMap,
        centre: NDArray[np.float64],
        period: int,
        matrix: NDArray[np.float64],
        contraction: float,
        limit: NDArray[np.float64],
    ) -> None:
        self.exact, self.centre, self.period, self.matrix = exact, centre, period, matrix
        # In units of the limits all coordinates are of one size.
        self.metric = _metric(matrix * limit / limit[:, None] / contraction) / np.outer(limit, limit)
        root = np.linalg.cholesky(self.metric)
        inverse_root = np.linalg.inv(root).T  # unit sphere -> unit ellipsoid
        self.offsets = _directions(exact.dimension) @ inverse_root.T
        self.linear = float(np.linalg.norm(root.T @ matrix @ inverse_root, 2))
        self.fine = _FINE.get(exact.dimension, 1.1)
        self.allowed = 0.5 * (1.0 + contraction)
        rtol, atol = exact.tolerance
        noise = 2.0 * period * (atol + rtol * (np.abs(centre) + limit * 1e-3))
        self.resolved = float(np.sqrt(noise @ np.abs(self.metric) @ noise)) / (0.5 * (self.allowed - self.linear))
        self.largest = float((limit / np.sqrt((inverse_root**2).sum(axis=-1))).min())

    def largest_verified(self) -> tuple[float, float]:
        """Return the largest radius up to which all surfaces pass, 0 where none does, and their largest factor."""
        radius, worst = 0.0, self.linear
        following, coarse = self._beginning(), True
        while following > 0.0 and radius < self.largest and following <= self.largest:
            growth = _COARSE if coarse else self.fine
            batch = np.minimum(following * growth ** np.arange(4 if coarse else 16), self.largest)
            factors, bends = self._factors(batch)
            failed = np.flatnonzero(~(factors <= self.allowed))
            passed = int(failed[0]) if len(failed) else len(batch)
            if passed:
                radius, worst = float(batch[passed - 1]), max(worst, float(factors[:passed].max()))
            if len(failed) and not coarse:
                break
            linear = bends.max() <= 0.1 * (self.allowed - self.linear)
            coarse = coarse and linear and not len(failed) and radius < _STRAIGHT * self.largest
            following = min(radius * (_COARSE if coarse else self.fine), self.largest) if radius else following
        return radius, worst

    def _beginning(self) -> float:
        """Return a radius at which the map is seen to be all but linear, so that it is inside as well; 0 without one.

        It is sought near the radius that the tolerance resolves at worst, then below.  What the image differs from that
        of the linear part is the bend and the error of the map together: where it is small, both are.  Most maps are
        far better than their tolerance, and cycles that attract weakly bend the map before that resolves anything.
        """
        nearest = max(self.resolved, 1e-12 * self.largest)
        for octaves in (_ABOVE, *_BELOW):
            radii = nearest * 2.0**octaves
            factors, bends = self._factors(radii)
            linear = (factors <= self.allowed) & (bends <= _ALL_BUT_LINEAR * (self.allowed - self.linear))
            if linear.any():
                return float(radii[np.argmax(linear)])
        return 0.0

    def _factors(self, radii: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Bound the factor by which one round changes the distance on each surface; also say how far it bends each.

        There are two bounds, what is seen and what the linear part allows with the rest that is seen, each with what
        may happen between neighbouring directions; the smaller one holds.
        """
        shift = radii[:, None, None] * self.offsets
        images = follow(self.exact, (self.centre + shift).reshape(-1, self.exact.dimension), self.period)
        after = difference(images.points, self.centre, self.exact.coordinates).reshape(shift.shape)
        seen = self._norm(after) / radii[:, None]
        rest = self._norm(after - shift @ self.matrix.T) / radii[:, None]
        alive = images.status.reshape(seen.shape) < Status.ESCAPED
        seen, rest = np.where(alive, seen, np.inf), np.where(alive, rest, np.inf)
        with np.errstate(invalid="ignore"):
            bound = np.minimum(_between(seen).max(axis=1), self.linear + _between(rest).max(axis=1))
        return np.where(np.isnan(bound), np.inf, bound), rest.max(axis=1)

    def _norm(self, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.sqrt(np.maximum(np.einsum("sni,ij,snj->sn", vectors, self.metric, vectors), 0.0)))


def _between(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Add to values on a circle of directions half of what they change to the next; others are dense enough."""
    if values.shape[1] != _DIRECTIONS:
        return values
    return np.asarray(values + 0.5 * np.abs(values - np.roll(values, 1, axis=1)))


def _metric(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return S = sum of (M^k)' M^k over all k, by doubling: S - M' S M = 1, so M shortens lengths in S."""
    total, power = np.eye(len(matrix)), np.array(matrix)
    while np.abs(power).max() > 1e-9 and np.abs(total).max() < 1e200:
        total = total + power.T @ total @ power
        power = power @ power
    return np.asarray(0.5 * (total + total.T))


def _directions(dimension: int) -> NDArray[np.float64]:
    """Return unit vectors that cover the sphere densely: exact steps on a circle, a fixed random set beyond."""
    if dimension == 1:
        return np.array([[1.0], [-1.0]])
    if dimension == 2:
        angles = np.arange(_DIRECTIONS) * (2 * np.pi / _DIRECTIONS)
        return np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    vectors = np.random.default_rng(0).standard_normal((128 * dimension, dimension))
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))
