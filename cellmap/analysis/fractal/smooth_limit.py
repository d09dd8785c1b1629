"""Entropy of discs cut by a straight boundary, the reference value of smooth boundaries (Puy et al. 2021)."""

from __future__ import annotations

from math import floor

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import quad
from scipy.special import betainc, xlogy

from ..._lib.arrays import Floats, Ints
from ..._lib.checks import whole_number
from ..._lib.signatures import checked

_DIRECTIONS = 720


@checked
def smooth_boundary_entropy(dimension: int, cells: ArrayLike | None = None) -> float:
    """Compute the mean entropy of balls cut by a plane at uniformly distributed distances from the centre.

    Parameters
    ----------
    dimension : int
        Dimension of the space.
    cells : array_like of int, shape (n, dimension), optional
        Positions of the cells of the "ball", in any shape, such as those of a square box; the mean is then also over
        all directions of the plane.  By default a ball in the limit of many cells.

    Returns
    -------
    float
        Mean entropy; for balls 1/2, 0.4395, 0.3961, 0.3632, 0.3372 in one to five dimensions.

    References
    ----------
    Puy, Daza, Wagemakers, Sanjuan, Communications in Nonlinear Science and Numerical Simulation 95 (2021) 105588.

    Examples
    --------
    >>> round(smooth_boundary_entropy(2), 4)
    0.4395
    """
    d = whole_number("dimension", dimension, at_least=1)
    if cells is None:
        return float(quad(lambda t: float(_two(0.5 * betainc(0.5 * (d + 1), 0.5, 1.0 - t * t))), 0.0, 1.0)[0])
    offsets = np.asarray(cells)
    if offsets.ndim != 2 or offsets.shape[1] != d or len(np.unique(offsets, axis=0)) < 2:
        raise ValueError(f"cells has the shape {offsets.shape}: give two different places of {d} coordinates or more")
    return straight_cuts(offsets)[0]


def ball(dimension: int, radius: float) -> Ints:
    """Return the cells whose centres are within a radius of that of a cell, shape (n, dimension)."""
    reach = np.arange(-floor(radius), floor(radius) + 1)
    cube = np.stack(np.meshgrid(*(reach,) * dimension, indexing="ij"), axis=-1).reshape(-1, dimension)
    return np.asarray(cube[(cube**2).sum(axis=1) <= radius * radius * (1 + 1e-12)])


def _two(fraction: ArrayLike) -> Floats:
    """Return the entropy of two basins of which one has this fraction."""
    p = np.asarray(fraction, dtype=float)
    return np.asarray(-xlogy(p, p) - xlogy(1.0 - p, 1.0 - p))


def straight_cuts(offsets: Ints) -> tuple[float, float, float]:
    """Return the mean entropy of cells that are cut by a plane, and its smallest and largest value over directions.

    A plane cuts wherever its distance lies between those of two cells next to each other in its direction; all these
    distances are equally likely.
    """
    n, d = offsets.shape
    if d == 1:
        directions = np.ones((1, 1))
    elif d == 2:
        turned = (np.arange(_DIRECTIONS) + 0.5) * (np.pi / _DIRECTIONS)
        directions = np.stack([np.cos(turned), np.sin(turned)], axis=-1)
    else:
        directions = np.random.default_rng(0).standard_normal((_DIRECTIONS, d))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    entropy = _two(np.arange(1, n) / n)
    gaps = np.diff(np.sort(directions @ offsets.T.astype(float), axis=1), axis=1)
    sums, weights = gaps @ entropy, gaps.sum(axis=1)
    each = sums / weights
    if d == 2:
        # Directions along the axes, where many cells are at one distance, are the extremes.
        aligned = _along(offsets, np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, -1.0]]))
        each = np.append(each, aligned)
    return float(sums.sum() / weights.sum()), float(each.min()), float(each.max())


def _along(offsets: Ints, directions: Floats) -> Floats:
    gaps = np.diff(np.sort(directions @ offsets.T, axis=1), axis=1)
    n = len(offsets)
    return np.asarray(gaps @ _two(np.arange(1, n) / n) / gaps.sum(axis=1))
