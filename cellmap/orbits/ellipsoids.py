"""Ellipsoids around points of attracting orbits: metrics, images of surfaces, and regions of many orbits at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .._lib.arrays import Bools, Floats, Ints
from .._lib.stopping import check_stop
from ..maps.coordinates import Coordinate, difference, turns_of
from ..maps.orbit_batch import Orbits
from ..maps.point_map import PointMap
from ..maps.side_by_side import advance_on_threads

_PARALLEL = 1e4  # condition of eigenvectors from which they make no metric
_DIRECTIONS = 16  # directions in a plane; for each further dimension twice as many are drawn
_SHELLS = 2.0 ** np.arange(-7.0, 1.0)  # half-widths of ellipsoids that are tested, in quarters of the extent


def displaced(
    point_map: PointMap, centres: Floats, shifts: Floats, periods: Ints, ends: Floats | None = None
) -> tuple[Floats, Bools]:
    """Return where states near centres are after some periods, and which of them (n, k) have an image.

    ``shifts`` (n, k, d) are the displacements from centres (n, d + m) that move by their own periods (n,), and those
    returned are from ``ends``, by default the centres; m parameters are held.
    """
    n, k, d = shifts.shape
    states = np.repeat(centres[:, None], k, axis=1)
    states[..., :d] += shifts
    orbits = Orbits.starting(states.reshape(n * k, -1))
    orbits.wrap(*turns_of(point_map.coordinates))
    check_stop()
    rounds = np.repeat(periods, k)
    for q in np.unique(periods):
        mine = slice(None) if (periods == q).all() else np.flatnonzero(rounds == q)
        part = orbits[mine]
        advance_on_threads(point_map.advance, part, int(q))
        orbits[mine] = part
    after = difference(
        orbits.points.reshape(states.shape), (centres if ends is None else ends)[:, None], point_map.coordinates
    )
    return after[..., :d], orbits.alive.reshape(n, k)


def half_widths(metrics: Floats) -> Floats:
    """Return how far ellipsoids with some metrics (n, d, d) reach from their centres along each axis, shape (n, d)."""
    return np.asarray(np.sqrt(np.einsum("njj->nj", np.linalg.inv(metrics))))


def eigenvector_metrics(matrices: Floats) -> tuple[Floats, Bools]:
    """Return metrics (n, d, d) with eigenvectors as axes, in which all directions weigh the same.

    And which of them are any good: close to a double eigenvalue eigenvectors are nearly parallel.
    """
    axes = np.linalg.eig(matrices)[1]
    good = np.linalg.cond(axes) < _PARALLEL
    rows = np.linalg.inv(np.where(good[:, None, None], axes, np.eye(axes.shape[-1])))
    metrics = np.real(rows.conj().transpose(0, 2, 1) @ rows)
    return 0.5 * (metrics + metrics.transpose(0, 2, 1)), good


def summed_metric(matrix: Floats, contraction: float) -> Floats:
    """Return the metric (d, d) that is the sum of squared lengths under all powers of a matrix over a contraction.

    It weighs slow directions far more than fast ones, and is narrow along them where one approaches slowly.
    """
    total, power = np.eye(len(matrix)), matrix / contraction
    while np.abs(power).max() > 1e-9 and np.abs(total).max() < 1e200:
        total = total + power.T @ total @ power
        power = power @ power
    return np.asarray(0.5 * (total + total.T))


def products(steps: Floats, number: int) -> Floats:
    """Return the products (period, d, d) of some consecutive steps (period, d, d) along a periodic orbit, from each."""
    total = steps
    for k in range(1, number):
        total = np.roll(steps, -k, axis=0) @ total
    return total


def lyapunov_forms(steps: Floats, rate: float) -> Floats:
    """Return forms (period, d, d) along a periodic orbit in which each linear step (period, d, d) contracts by a rate.

    They are the solution of the periodic discrete Lyapunov equation ``steps[k].T @ forms[k + 1] @ steps[k] / rate**2 =
    forms[k] - 1``, by doubling: O(period d^3).
    """
    last = np.eye(steps.shape[-1])
    total, through = np.zeros_like(last), last
    for step in steps:
        total = total + through.T @ through
        through = step @ through / rate
    while np.abs(through).max() > 1e-9 and np.abs(total).max() < 1e200:
        total = total + through.T @ total @ through
        through = through @ through
    forms, later = [0.5 * (total + total.T)], total
    for step in steps[:0:-1]:
        later = last + step.T @ later @ step / rate**2
        forms.append(0.5 * (later + later.T))
    return np.array(forms[:1] + forms[:0:-1])


def directions(dimension: int, around: int, beyond: int) -> Floats:
    """Return unit vectors that cover the sphere: exact steps around a circle, a fixed random set beyond the plane."""
    if dimension == 1:
        return np.array([[1.0], [-1.0]])
    if dimension == 2:
        angles = np.arange(around) * (2 * np.pi / around)
        return np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    vectors = np.random.default_rng(0).standard_normal((beyond, dimension))
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


@dataclass(frozen=True, eq=False)
class ParameterRegions:
    """Ellipsoids, one a row, sorted by parameter point: ``(x - centre) @ metric @ (x - centre) <= 1``."""

    place: Ints
    owner: Ints
    centre: Floats
    metric: Floats
    first: Ints

    @classmethod
    def empty(cls, d: int) -> ParameterRegions:
        """Return no rows."""
        whole = np.empty(0, np.int64)
        return cls(whole, whole, np.empty((0, d)), np.empty((0, d, d)), whole)

    def with_more(self, more: ParameterRegions, owners: int, places: int) -> ParameterRegions:
        """Add rows, whose owners are counted from a number on."""
        place = np.concatenate([self.place, more.place])
        order = np.argsort(place, kind="stable")
        owner = np.concatenate([self.owner, more.owner + owners])
        centre, metric = (np.concatenate([a, b]) for a, b in ((self.centre, more.centre), (self.metric, more.metric)))
        first = np.searchsorted(place[order], np.arange(places + 1))
        return ParameterRegions(place[order], owner[order], centre[order], metric[order], first)

    def has_any(self, owners: int) -> Bools:
        """Return which owners have an ellipsoid."""
        return np.bincount(self.owner, minlength=owners) > 0

    def renumbered(self, kept: Ints, owners: int) -> ParameterRegions:
        """Return the regions with the numbers that their owners have among those that are kept."""
        number = np.full(owners, -1)
        number[kept] = np.arange(len(kept))
        return ParameterRegions(self.place, number[self.owner], self.centre, self.metric, self.first)

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
) -> ParameterRegions:
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
    return ParameterRegions(place[owner[kept]], owner[kept], centre[kept, :d], within[kept] / radii**2, kept)


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
