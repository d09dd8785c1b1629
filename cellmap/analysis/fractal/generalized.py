"""Generalized dimensions of measures, from the scaling of the weights of boxes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..._lib.arrays import Bools, Floats
from ..._lib.checks import real_array
from ..._lib.fit import Fit
from ..._lib.randomness import Rng
from ..._lib.signatures import checked
from ...maps.coordinates import Coordinate
from .box_counting import checked_sizes, fit_sizes, unseen
from .partitions import Partition, Space, dyadic_sizes, over_offsets

_FEWEST_BOXES = 10
_MISSED = 0.02
_FEWEST_POINTS = 20  # in a box, on average: a sum over fewer is biased by their chance numbers


@dataclass(frozen=True, eq=False)
class GeneralizedDimensions:
    """Generalized dimensions D_q of a measure, for several orders q.

    Parameters
    ----------
    orders : ndarray, shape (k,)
        Orders q, increasing.
    sizes : ndarray, shape (n,)
        Sides of the boxes in units of the scales, in decreasing order.
    informations : ndarray, shape (k, n)
        Rényi informations ``ln(sum p**q) / (1 - q)`` of the boxes' weights p, ``-sum p ln p`` for q = 1, with sums
        averaged over the offsets of the grid.
    usable : ndarray of bool, shape (n,)
        Sizes between the two ends at which the sums saturate.
    fits : tuple of Fit
        For each order, the fit of its information against ln 1/size; the slope is D_q.
    """

    orders: Floats
    sizes: Floats
    informations: Floats
    usable: Bools
    fits: tuple[Fit, ...]

    def __repr__(self) -> str:
        found = "; ".join(f"D_{q:g} {f.slope:.4g} +- {f.standard_error:.2g}" for q, f in self)
        return f"GeneralizedDimensions({found})"

    def __iter__(self) -> Iterator[tuple[float, Fit]]:
        """Yield orders with their fits."""
        return iter(zip(self.orders.tolist(), self.fits, strict=True))

    def __getitem__(self, order: float) -> Fit:
        """Return the fit of one order."""
        places = np.flatnonzero(np.isclose(self.orders, order))
        if not len(places):
            raise KeyError(f"q={order!r}: the orders are {self.orders.tolist()}")
        return self.fits[int(places[0])]

    @property
    def dimensions(self) -> Floats:
        """Dimension D_q of each order."""
        return np.array([f.slope for f in self.fits])

    @property
    def standard_errors(self) -> Floats:
        """Standard errors of D_q: scatter and drift of the slopes in their windows, and the choice of the windows."""
        return np.array([f.standard_error for f in self.fits])


@checked
def generalized_dimensions(
    points: ArrayLike,
    orders: ArrayLike = (0.0, 1.0, 2.0),
    sizes: ArrayLike | None = None,
    *,
    weights: ArrayLike | None = None,
    coordinates: Sequence[str | Coordinate] | None = None,
    scale: ArrayLike | None = None,
    origin: ArrayLike | None = None,
    n_offsets: int = 8,
    rng: Rng = 0,
    fit_range: tuple[float, float] | None = None,
) -> GeneralizedDimensions:
    """Compute the generalized dimensions D_q of a measure, from sample points or weights.

    D_0 is the box-counting dimension, D_1 the information dimension, D_2 the correlation dimension; with increasing q,
    dense regions count more.  A size is usable as in :func:`box_dimension`, and for a sample if its boxes contain at
    least 20 points on average.  Negative orders are dominated by boxes with few points, and thus by chance and the
    position of the grid; they require weights on a grid aligned with the measure.

    Parameters
    ----------
    points : array_like, shape (n, d)
        Orbit on an attractor, or positions of the weights.
    orders : array_like, optional
        Orders q, any real numbers.
    sizes : array_like, optional
        Sides of boxes, as in :func:`box_dimension`.
    weights : array_like, shape (n,), optional
        Weights of the points, at least 0, in any unit; by default all are equal.
    coordinates, scale, origin, n_offsets, rng : optional
        As in :func:`box_dimension`.
    fit_range : tuple of float, optional
        Smallest and largest size for all fits; by default they are chosen automatically for each.

    Returns
    -------
    GeneralizedDimensions
        Generalized dimensions with their fits.

    Raises
    ------
    ValueError
        For arguments out of bounds, or that leave fewer than three usable sizes.

    References
    ----------
    Hentschel, Procaccia, Physica D 8 (1983) 435; Grassberger, Physics Letters A 97 (1983) 227.

    Examples
    --------
    >>> x = np.random.default_rng(0).random((200_000, 1))
    >>> np.round(generalized_dimensions(x).dimensions, 1)
    array([1., 1., 1.])
    """
    space = Space.of(points, coordinates, scale)
    chosen = None if sizes is None else checked_sizes(sizes)
    q = np.unique(real_array("orders", orders).ravel())
    if not len(q) or not np.isfinite(q).all():
        raise ValueError(f"orders={orders!r}: give finite numbers, such as (0, 1, 2)")
    fractions = _fractions(weights, len(space.points))

    def measure(part: Partition) -> Floats:
        return np.concatenate([part.occupancy(), part.moments(fractions, q)], axis=1)

    found = over_offsets(space, chosen, origin, n_offsets, rng, measure, ordered=weights is not None)
    tried = dyadic_sizes(space) if chosen is None else chosen
    counts = found[..., :3]
    mean = counts[..., 0].mean(axis=0)
    usable = (mean >= _FEWEST_BOXES) & (unseen(counts) <= _MISSED)
    if weights is None:
        usable &= mean * _FEWEST_POINTS <= len(fractions)
    informations = _informations(q, found[..., 3:].mean(axis=0).T)
    x = -np.log(tried)
    fits = tuple(
        fit_sizes("points", x, y, tried, usable, fit_range, ("ln 1/size", f"information of order {order:g}"))
        for order, y in zip(q, informations, strict=True)
    )
    return GeneralizedDimensions(q, tried, informations, usable, fits)


def _fractions(weights: ArrayLike | None, n: int) -> Floats:
    """Weights with the sum 1."""
    if weights is None:
        return np.full(n, 1.0 / n)
    given = real_array("weights", weights)
    if given.shape != (n,) or not np.isfinite(given).all() or given.min() < 0.0 or not given.sum() > 0.0:
        raise ValueError(f"weights: give {n} finite numbers of at least 0, one for each point, and not all 0")
    return np.asarray(given / given.sum())


def _informations(orders: Floats, sums: Floats) -> Floats:
    """Rényi informations from the sums over boxes, shape (orders, sizes)."""
    rows = []
    for q, total in zip(orders, sums, strict=True):
        rows.append(-total if q == 1.0 else np.log(total) / (1.0 - q))
    return np.array(rows)
