"""Dimensions of measures: generalized ones from the weights of boxes, that of Kaplan and Yorke from exponents."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..._lib.arrays import Bools, Floats
from ..._lib.checks import real_array
from ..._lib.fit import Fit
from ..._lib.randomness import Rng
from ..._lib.signatures import checked
from ...maps.coordinates import Coordinate
from .box_counting import averaged, checked_sizes, fit_sizes, unseen
from .partitions import Partition, Space, dyadic_sizes, over_offsets

if TYPE_CHECKING:
    from ...orbits.lyapunov import LyapunovSpectrum

_FEWEST_BOXES = 10
_MISSED = 0.02
_FEWEST_POINTS = 20  # mean number of points in a box: a sum over fewer is biased by their chance numbers


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
    r"""Compute the generalized dimensions D_q of a measure, from sample points or weights.

    They are :math:`D_q = \frac{1}{q - 1} \frac{d \ln \sum_i p_i^q}{d \ln s}` for boxes of side s with the weights
    :math:`p_i`.

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
    >>> x = np.random.default_rng(0).random((50_000, 1))
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

    found = averaged(over_offsets(space, chosen, origin, n_offsets, rng, measure, ordered=weights is not None))[0]
    tried = dyadic_sizes(space) if chosen is None else chosen
    mean = found[:, 0]
    usable = (mean >= _FEWEST_BOXES) & (unseen(found, space.dimension)[0] <= _MISSED)
    if weights is None:
        usable &= mean * _FEWEST_POINTS <= len(fractions)
    sums = found[:, 3:].T
    informations = np.array(
        [-s if order == 1.0 else np.log(s) / (1.0 - order) for order, s in zip(q, sums, strict=True)]
    )
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


@dataclass(frozen=True, eq=False)
class KaplanYorke:
    """Kaplan-Yorke dimension, with the Lyapunov exponents from which it is computed.

    Parameters
    ----------
    dimension : float
        ``j + (l_1 + ... + l_j) / |l_(j+1)|``, with the largest j for which the sum is not negative.
    standard_error : float
        Propagated from the errors of the exponents, taken as independent; NaN without these.
    exponents, errors : ndarray, shape (d,)
        Lyapunov exponents in decreasing order, and their standard errors (NaN if they are not known).
    whole : int
        The number j.
    bounded : bool
        Whether volumes contract; if not, the dimension is that of the space and contains no information on the
        attractor.
    """

    dimension: float
    standard_error: float
    exponents: Floats
    errors: Floats
    whole: int
    bounded: bool

    def __repr__(self) -> str:
        return f"KaplanYorke(dimension {self.dimension:.5g} +- {self.standard_error:.2g})"


def kaplan_yorke_dimension(exponents: ArrayLike | LyapunovSpectrum, errors: ArrayLike | None = None) -> KaplanYorke:
    r"""Compute the Kaplan-Yorke (Lyapunov) dimension from Lyapunov exponents.

    It is :math:`D = k + \frac{\lambda_1 + \dots + \lambda_k}{\lvert \lambda_{k+1} \rvert}` for the largest k with a
    sum that is not negative.

    By the conjecture of Kaplan and Yorke it is the information dimension D_1 of typical chaotic attractors; it is an
    upper bound of D_1 for any smooth map (Ledrappier 1981).  For two-dimensional smooth maps the two are equal (Young
    1982).

    Parameters
    ----------
    exponents : array_like, shape (d,), or LyapunovSpectrum
        All Lyapunov exponents, in any order, per step or per time; for a spectrum, the mean over its orbits is used.
    errors : array_like, shape (d,), optional
        Their standard errors.

    Returns
    -------
    KaplanYorke
        Dimension with its error.

    Raises
    ------
    ValueError
        For exponents that are not numbers.

    References
    ----------
    Kaplan, Yorke, Lecture Notes in Mathematics 730 (1979) 204; Frederickson, Kaplan, Yorke, Yorke, Journal of
    Differential Equations 49 (1983) 185.

    Examples
    --------
    >>> kaplan_yorke_dimension([0.4192, -1.6232], [0.0003, 0.0003])
    KaplanYorke(dimension 1.2583 +- 0.00019)
    """
    from ...orbits.lyapunov import LyapunovSpectrum

    if isinstance(exponents, LyapunovSpectrum):
        exponents, known = exponents.pooled
        errors = known if errors is None else errors
    given = real_array("exponents", exponents)
    if given.ndim > 1 and given.size > given.shape[-1]:
        raise ValueError(f"exponents have the shape {given.shape}: give those of one orbit, such as their mean")
    given = given.ravel()
    sigma = np.full(given.shape, np.nan) if errors is None else real_array("errors", errors).ravel()
    if not len(given) or np.isnan(given).any() or (given == np.inf).any():
        raise ValueError(f"exponents={given.tolist()}: give all Lyapunov exponents as numbers")
    if sigma.shape != given.shape or (sigma < 0.0).any():
        raise ValueError(f"errors={sigma.tolist()}: give one error of at least 0 for each of {len(given)} exponents")
    order = np.argsort(-given, kind="stable")
    given, sigma = given[order], sigma[order]
    sums = np.cumsum(given)
    whole = int(np.flatnonzero(sums >= 0.0)[-1]) + 1 if (sums >= 0.0).any() else 0
    if whole in (0, len(given)):
        return KaplanYorke(float(whole), np.nan if whole else 0.0, given, sigma, whole, whole == 0)
    falling = abs(given[whole])
    rising = sums[whole - 1]
    dimension = whole + float(rising / falling)
    squares = (sigma[:whole] ** 2).sum() + (rising / falling * sigma[whole]) ** 2
    return KaplanYorke(dimension, float(np.sqrt(squares) / falling), given, sigma, whole, True)
