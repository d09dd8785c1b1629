"""Distances from an invariant torus, and points beside it, for the tube that is verified around it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._lib.arrays import Complexes, Floats
from .._lib.computed import computed_once
from ..maps.coordinates import difference, turns_of, wrap
from ..maps.point_map import PointMap
from ..orbits.invariant_torus import InvariantTorus, places_of
from .tube import nearest_places

_DENSE = 256  # points in each phase, between which the torus is a paraboloid
_REACH = 2.0  # cells of the grid, at most, between a point and the nearest one on the torus
_SEEN = 24  # points of each surface in each phase
_DIRECTIONS = 4  # in each of the directions across the torus, where there are several


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
        waves = torus.waves(np.arange(_DENSE) / _DENSE)
        k = (np.arange(len(waves)) - len(waves) // 2) * (2j * np.pi / _DENSE)

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
        chosen = np.round(np.arange(_SEEN) * (_DENSE / _SEEN)).astype(int)
        rows = (chosen[:, None] * _DENSE + chosen).ravel()
        here, slopes, _ = (part[rows] for part in self._patches)
        tangents = np.linalg.qr(slopes / self.size[:, None])[0]
        free = np.random.default_rng(0).standard_normal((1 if d == 3 else _DIRECTIONS * (d - 2), d))
        across = free - np.einsum("ndi,nei,me->nmd", tangents, tangents, free)
        across /= np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), 1e-300)
        across = np.concatenate([across, -across], axis=1)
        shift = radii[:, None, None, None] * across * self.size
        places = wrap((here[:, None, :] + shift).reshape(-1, d), self.exact.coordinates)
        return np.asarray(places.reshape(len(radii), _SEEN, _SEEN, -1, d))

    def between(self, distances: Floats) -> Floats:
        """Return the largest of distances (radii, n), with half of what they change to the next in each phase."""
        values = distances.reshape(len(distances), _SEEN, _SEEN, -1)
        with np.errstate(invalid="ignore"):
            beside = values + 0.5 * sum(np.abs(values - np.roll(values, 1, axis=axis)) for axis in (1, 2))
        return np.asarray(np.where(np.isnan(beside), np.inf, beside).reshape(len(distances), -1).max(axis=1))
