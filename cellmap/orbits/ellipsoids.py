"""Ellipsoids around points of attracting orbits: metrics in which derivatives contract, and images of surfaces."""

from __future__ import annotations

import numpy as np

from .._lib.arrays import Bools, Floats, Ints
from .._lib.stopping import check_stop
from ..maps.coordinates import difference, turns_of
from ..maps.orbit_batch import Orbits
from ..maps.point_map import PointMap
from ..maps.side_by_side import advance_on_threads

_PARALLEL = 1e4  # condition of eigenvectors from which they make no metric


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


def directions(dimension: int, around: int, beyond: int) -> Floats:
    """Return unit vectors that cover the sphere: exact steps around a circle, a fixed random set beyond the plane."""
    if dimension == 1:
        return np.array([[1.0], [-1.0]])
    if dimension == 2:
        angles = np.arange(around) * (2 * np.pi / around)
        return np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    vectors = np.random.default_rng(0).standard_normal((beyond, dimension))
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))
