"""Regions of attraction of many periodic orbits at once: ellipsoids seen to contract, for orbits in SIMD lanes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..maps.coordinates import Coordinate, difference
from ..maps.orbit_batch import Orbits
from ..maps.point_map import PointMap

_DIRECTIONS = 16  # for each dimension beyond the first
_SHELLS = 2.0 ** np.arange(-7.0, 1.0)  # half-widths of ellipsoids that are tested, in quarters of the extent
_PARALLEL = 1e4  # condition of eigenvectors from which they make no metric


@dataclass(frozen=True, eq=False)
class Regions:
    """Ellipsoids, one a row, sorted by parameter point: ``(x - centre) @ metric @ (x - centre) <= 1``."""

    place: NDArray[np.int64]
    owner: NDArray[np.int64]
    centre: NDArray[np.float64]
    metric: NDArray[np.float64]
    first: NDArray[np.int64]

    @classmethod
    def empty(cls, d: int) -> Regions:
        """Return no rows."""
        whole = np.empty(0, np.int64)
        return cls(whole, whole, np.empty((0, d)), np.empty((0, d, d)), whole)

    def with_more(self, more: Regions, owners: int, places: int) -> Regions:
        """Add rows, whose owners are counted from a number on."""
        place = np.concatenate([self.place, more.place])
        order = np.argsort(place, kind="stable")
        owner = np.concatenate([self.owner, more.owner + owners])
        centre, metric = (np.concatenate([a, b]) for a, b in ((self.centre, more.centre), (self.metric, more.metric)))
        first = np.searchsorted(place[order], np.arange(places + 1))
        return Regions(place[order], owner[order], centre[order], metric[order], first)

    def has_any(self, owners: int) -> NDArray[np.bool_]:
        """Return which owners have an ellipsoid."""
        return np.bincount(self.owner, minlength=owners) > 0

    def renumbered(self, kept: NDArray[np.int64], owners: int) -> Regions:
        """Return the regions with the numbers that their owners have among those that are kept."""
        number = np.full(owners, -1)
        number[kept] = np.arange(len(kept))
        return Regions(self.place, number[self.owner], self.centre, self.metric, self.first)

    def owners(
        self, points: NDArray[np.float64], place: NDArray[np.int64], coordinates: Sequence[Coordinate]
    ) -> NDArray[np.int64]:
        """Return the owner of the first ellipsoid that holds each point (n, d) of a parameter point; -1 for none."""
        found = np.full(len(points), -1)
        if not len(self.place):
            return found
        number = self.first[place + 1] - self.first[place]
        rows = np.flatnonzero(number > 0)
        for k in range(int(number.max(initial=0))):
            row = self.first[place[rows]] + k
            shift = difference(points[rows], self.centre[row], coordinates[: points.shape[1]])
            inside = np.einsum("ni,nij,nj->n", shift, self.metric[row], shift) <= 1.0
            found[rows[inside]] = self.owner[row[inside]]
            rows = rows[~inside]
            rows = rows[number[rows] > k + 1]
        return found


def regions_around(
    swept: PointMap,
    orbit: NDArray[np.float64],
    matrices: NDArray[np.float64],
    period: NDArray[np.int64],
    place: NDArray[np.int64],
    extent: NDArray[np.float64],
) -> Regions:
    """Return ellipsoids around all points of attracting periodic orbits, each as large as it is seen to contract.

    ``orbit`` (n, most, d + 2) are their points, ``matrices`` (n, most, d, d) the derivatives of the steps.  From a
    small ellipsoid on, the surfaces of larger ones are mapped over one period of the orbit: one whose distance from
    the orbit shrinks everywhere, by a factor of at most (1 + the largest multiplier) / 2, is kept and the next one,
    twice as wide, tried.
    """
    owner = np.repeat(np.arange(len(period)), period)
    phase = np.arange(len(owner)) - np.repeat(np.cumsum(period) - period, period)
    d, rounds = len(extent), period[owner]
    monodromy = np.broadcast_to(np.eye(d), (len(owner), d, d))
    for k in range(matrices.shape[1]):
        step = matrices[owner, (phase + k) % rounds]
        monodromy = np.where((k < rounds)[:, None, None], step @ monodromy, monodromy)
    limit = 0.25 * extent
    metric, factor = _metrics(monodromy * limit / limit[:, None])
    root = np.linalg.inv(np.linalg.cholesky(metric)).transpose(0, 2, 1)
    # In units of the limits the widest half-axis of an ellipsoid is 1.
    widest = np.sqrt((root**2).sum(axis=-1)).max(axis=-1)
    surface = np.einsum("nij,kj->nki", root / widest[:, None, None], _directions(d))
    centre, radius = orbit[owner, phase], np.zeros(len(owner))
    active = np.arange(len(owner))
    for shell in _SHELLS:
        some = _contracting(
            swept,
            centre[active],
            shell * surface[active] * limit,
            metric[active] / shell**2 * widest[active, None, None] ** 2 / np.outer(limit, limit),
            rounds[active],
            0.5 * (1.0 + factor[active]),
        )
        active = active[some]
        radius[active] = shell
        if not len(active):
            break
    kept = np.flatnonzero(radius > 0.0)
    size = (widest[kept] / radius[kept])[:, None, None]
    return Regions(
        place[owner[kept]], owner[kept], centre[kept, :d], metric[kept] * size**2 / np.outer(limit, limit), kept
    )


def _contracting(
    swept: PointMap,
    centre: NDArray[np.float64],
    surface: NDArray[np.float64],
    metric: NDArray[np.float64],
    periods: NDArray[np.int64],
    allowed: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Return which surfaces (n, k, d) around centres (n, d + 2) are mapped inside of themselves by a factor."""
    n, k, d = surface.shape
    states = np.repeat(centre[:, None], k, axis=1)
    states[..., :d] += surface
    orbits = Orbits.starting(states.reshape(n * k, -1))
    rounds = np.repeat(periods, k)
    for q in np.unique(periods):
        mine = np.flatnonzero(rounds == q)
        part = orbits[mine]
        swept.advance(part, int(q))
        orbits[mine] = part
    after = difference(orbits.points.reshape(states.shape), centre[:, None], swept.coordinates)[..., :d]
    squares = np.einsum("nki,nij,nkj->nk", after, metric, after)
    return np.asarray((squares <= allowed[:, None] ** 2).all(axis=1))


def _metrics(matrices: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return metrics (n, d, d) in which matrices contract, and the factors (n,).

    The axes are the eigenvectors; where these are nearly parallel, the sum of the squared lengths under all powers.
    """
    values, axes = np.linalg.eig(matrices)
    modulus = np.abs(values).max(axis=-1)
    rows = np.linalg.pinv(axes)
    metric = np.real(rows.conj().transpose(0, 2, 1) @ rows)
    bad = np.flatnonzero(np.linalg.cond(axes) > _PARALLEL)
    if len(bad):
        power = matrices[bad] / (0.5 * (1.0 + modulus[bad]))[:, None, None]
        total = np.broadcast_to(np.eye(matrices.shape[-1]), power.shape)
        for _ in range(60):
            total = total + power.transpose(0, 2, 1) @ total @ power
            power = power @ power
        metric[bad] = total
        modulus[bad] = 0.5 * (1.0 + modulus[bad])
    metric = 0.5 * (metric + metric.transpose(0, 2, 1))
    return metric, modulus


def _directions(dimension: int) -> NDArray[np.float64]:
    """Return unit vectors around the sphere."""
    if dimension == 1:
        return np.array([[1.0], [-1.0]])
    if dimension == 2:
        angles = np.arange(_DIRECTIONS) * (2 * np.pi / _DIRECTIONS)
        return np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    vectors = np.random.default_rng(0).standard_normal((_DIRECTIONS * (dimension - 1) * 2, dimension))
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))
