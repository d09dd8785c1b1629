"""Neighbourhoods of attractors that are verified to lie in their basins."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .attractor import Attractor, Neighbourhood
from .coordinates import difference, turns_of
from .jacobian import jacobian
from .pointmap import PointMap

_SHELLS = np.array([1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1, 0.05])
_SHRINK = 0.75
_TRIALS = 60


def trapping_neighbourhood(
    point_map: PointMap, attractor: Attractor, extent: NDArray[np.float64]
) -> Neighbourhood | None:
    """Return ellipsoids around a periodic attractor in which every orbit is verified to approach it.

    The metric solves the discrete Lyapunov equation of the derivative of one round, so that the linear map contracts
    in it by a known factor c < 1.  The ellipsoids are shrunk until the exact map itself shortens the distance to the
    attractor, by a factor of at most (1 + c)/2 in one round, at every point of a dense sample: eleven shells, on each
    of them directions so close that the factor, which is smooth, cannot pass 1 between them.  A distance that falls in
    every round leaves no other attractor in the ellipsoid.

    Parameters
    ----------
    point_map : PointMap
        The map; its exact map is used.
    attractor : Attractor
        A periodic attractor.
    extent : ndarray, shape (dimension,)
        Size of the region of interest; no ellipsoid is larger than a quarter of it.

    Returns
    -------
    Neighbourhood or None
        None where even the smallest ellipsoid tried fails.
    """
    exact = point_map.exact or point_map
    period = attractor.period
    turn = turns_of(exact.coordinates)[1]
    limit = np.where(turn > 0, np.minimum(extent, turn), extent) / 4.0
    matrices = jacobian(exact, attractor.points, period)
    contraction = 0.5 * (1.0 + float(np.abs(attractor.multipliers[0])))
    metrics = np.array([_lyapunov_metric(m / contraction, limit) for m in matrices])
    allowed = 0.5 * (1.0 + contraction)
    directions = _directions(exact.dimension)
    factor = np.linalg.cholesky(np.linalg.inv(metrics))  # unit sphere -> unit ellipsoid
    offsets = np.einsum("qij,nj->qni", factor, directions)
    radius = _largest_radius(factor, limit)
    for _ in range(_TRIALS):
        measured = _contraction(exact, attractor, metrics, offsets, radius)
        if measured <= allowed:
            return Neighbourhood(attractor.points, metrics / radius**2, measured)
        radius *= _SHRINK
    return None


def _lyapunov_metric(matrix: NDArray[np.float64], scale: NDArray[np.float64]) -> NDArray[np.float64]:
    """Solve M' S M - S = -Q for S, with Q the metric of the scales."""
    from scipy.linalg import solve_discrete_lyapunov

    metric: NDArray[np.float64] = solve_discrete_lyapunov(matrix.T, np.diag(1.0 / scale**2))
    return 0.5 * (metric + metric.T)


def _directions(dimension: int) -> NDArray[np.float64]:
    """Return unit vectors that cover the sphere densely: exact steps on a circle, a fixed random set beyond."""
    if dimension == 1:
        return np.array([[1.0], [-1.0]])
    if dimension == 2:
        angles = np.arange(96) * (2 * np.pi / 96)
        return np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    vectors = np.random.default_rng(0).standard_normal((128 * dimension, dimension))
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def _largest_radius(factor: NDArray[np.float64], limit: NDArray[np.float64]) -> float:
    """Return the radius at which an ellipsoid first touches the limit of a coordinate."""
    half_widths = np.sqrt((factor**2).sum(axis=-1))
    return float((limit / half_widths).min())


def _contraction(
    exact: PointMap, attractor: Attractor, metrics: NDArray[np.float64], offsets: NDArray[np.float64], radius: float
) -> float:
    """Return the largest factor by which a round shortens the distance, over all sampled points; inf on failure."""
    worst = 0.0
    for centre, metric, directions in zip(attractor.points, metrics, offsets, strict=True):
        shift = radius * _SHELLS[:, None, None] * directions
        flat = (centre + shift).reshape(-1, exact.dimension)
        images = exact.iterate(flat, attractor.period)
        if (images.status != 0).any():
            return np.inf
        after = difference(images.points, centre, exact.coordinates).reshape(shift.shape)
        before_norm = np.sqrt(np.einsum("sni,ij,snj->sn", shift, metric, shift))
        after_norm = np.sqrt(np.einsum("sni,ij,snj->sn", after, metric, after))
        ratio = after_norm / before_norm
        if exact.dimension == 2:
            # What the factor may add between neighbouring directions of a shell.
            ratio = ratio + 0.5 * np.abs(ratio - np.roll(ratio, 1, axis=1))
        worst = max(worst, float(ratio.max()))
        if not np.isfinite(worst) or worst > 1.0:
            return np.inf
    return worst
