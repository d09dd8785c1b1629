"""Regions of attraction of many periodic orbits at once: ellipsoids seen to contract, for orbits in SIMD lanes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .._lib.arrays import Bools, Floats, Ints
from ..maps.coordinates import Coordinate, difference
from ..maps.point_map import PointMap
from ..orbits.ellipsoids import directions, displaced, eigenvector_metrics, summed_metric

_DIRECTIONS = 16  # in a plane, and twice as many for each dimension beyond the first in others
_SHELLS = 2.0 ** np.arange(-7.0, 1.0)  # half-widths of ellipsoids that are tested, in quarters of the extent


@dataclass(frozen=True, eq=False)
class Regions:
    """Ellipsoids, one a row, sorted by parameter point: ``(x - centre) @ metric @ (x - centre) <= 1``."""

    place: Ints
    owner: Ints
    centre: Floats
    metric: Floats
    first: Ints

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

    def has_any(self, owners: int) -> Bools:
        """Return which owners have an ellipsoid."""
        return np.bincount(self.owner, minlength=owners) > 0

    def renumbered(self, kept: Ints, owners: int) -> Regions:
        """Return the regions with the numbers that their owners have among those that are kept."""
        number = np.full(owners, -1)
        number[kept] = np.arange(len(kept))
        return Regions(self.place, number[self.owner], self.centre, self.metric, self.first)

    def owners(self, points: Floats, place: Ints, coordinates: Sequence[Coordinate]) -> Ints:
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
    swept: PointMap, orbit: Floats, matrices: Floats, period: Ints, place: Ints, extent: Floats
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
    monodromy = monodromy_of(matrices, period, owner, phase)
    limit = 0.25 * extent
    metric, factor = _metrics(monodromy * limit / limit[:, None])
    root = np.linalg.inv(np.linalg.cholesky(metric)).transpose(0, 2, 1)
    # In units of the limits the widest half-axis of an ellipsoid is 1.
    widest = np.sqrt((root**2).sum(axis=-1)).max(axis=-1)
    surface = np.einsum(
        "nij,kj->nki", root / widest[:, None, None], directions(d, _DIRECTIONS, 2 * _DIRECTIONS * (d - 1))
    )
    within = metric * widest[:, None, None] ** 2 / np.outer(limit, limit)
    centre, radius = orbit[owner, phase], np.zeros(len(owner))
    active = np.arange(len(owner))
    for shell in _SHELLS:
        shift = shell * surface[active] * limit
        after, alive = displaced(swept, centre[active], shift, rounds[active])
        sizes = np.sqrt(np.einsum("nki,nij,nkj->nk", after, within[active], after))
        some = (alive & (sizes <= 0.5 * (1.0 + factor[active, None]) * shell)).all(axis=1)
        active = active[some]
        radius[active] = shell
        if not len(active):
            break
    kept = np.flatnonzero(radius > 0.0)
    radii = radius[kept, None, None]
    return Regions(place[owner[kept]], owner[kept], centre[kept, :d], within[kept] / radii**2, kept)


def monodromy_of(matrices: Floats, period: Ints, rows: Ints, phase: int | Ints = 0) -> Floats:
    """Return the products (m, d, d) around orbits, from a phase on, of rows (m,) of matrices (n, most, d, d)."""
    rounds, total = period[rows], np.broadcast_to(np.eye(matrices.shape[-1]), matrices[rows, 0].shape)
    for k in range(matrices.shape[1]):
        total = np.where((k < rounds)[:, None, None], matrices[rows, (phase + k) % rounds] @ total, total)
    return total


def _metrics(matrices: Floats) -> tuple[Floats, Floats]:
    """Return metrics (n, d, d) in which matrices contract, and the factors (n,)."""
    modulus = np.abs(np.linalg.eigvals(matrices)).max(axis=-1)
    metrics, good = eigenvector_metrics(matrices)
    for k in np.flatnonzero(~good):
        modulus[k] = 0.5 * (1.0 + modulus[k])
        metrics[k] = summed_metric(matrices[k], modulus[k])
    return metrics, modulus
