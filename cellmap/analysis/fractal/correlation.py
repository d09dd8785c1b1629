"""Correlation dimension of attractors, from pairs of points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement, pairwise

import numpy as np
from numpy.typing import ArrayLike

from ..._lib.arrays import Bools, Floats, Ints
from ..._lib.checks import one_of, whole_number
from ..._lib.fit import Fit, fit_line
from ..._lib.signatures import checked
from ..._lib.stopping import check_stop
from ..._lib.threads import run_over, slices
from ...maps.coordinates import Coordinate, in_turn, shortest
from .box_counting import checked_sizes, fit_sizes
from .partitions import Space

_BLOCKS = 8
_PAIRS_AT_ONCE = 2**26  # pairs that are counted before Ctrl-C is heard
_FEWEST_PAIRS = 500
_LARGEST = 0.25  # largest distance of a pair, in extents of the set
_RADII = 25
_DECADES = 5


@dataclass(frozen=True, eq=False)
class CorrelationSum:
    """Correlation sum of an orbit by distance, and the resulting correlation dimension.

    Parameters
    ----------
    radii : ndarray, shape (n,)
        Distances in units of the scales, in decreasing order.
    fractions : ndarray, shape (n,)
        Correlation sum C(r): fraction of pairs closer than r, among those farther apart in time than `theiler`.
    errors : ndarray, shape (n,)
        Standard errors of C(r), from the spread over segments of the orbit.
    pairs : int
        Total number of pairs.
    theiler : int
        Theiler window: pairs up to so many steps apart are excluded.
    usable : ndarray of bool, shape (n,)
        Distances up to a quarter of the set's extent with at least 500 closer pairs.
    fit : Fit
        Fit of -ln C against ln 1/r; its slope is the dimension.  The standard error includes scatter, drift of the
        slope in the window, the choice of the window, and the spread of the slope over segments of the orbit.
    """

    radii: Floats
    fractions: Floats
    errors: Floats
    pairs: int
    theiler: int
    usable: Bools
    fit: Fit

    def __repr__(self) -> str:
        first, last = self.radii[self.fit.inside][[0, -1]]
        return (
            f"CorrelationSum(dimension {self.dimension:.4g} +- {self.standard_error:.2g}, "
            f"distances {last:.3g} to {first:.3g})"
        )

    @property
    def dimension(self) -> float:
        """Correlation dimension: the slope in the window."""
        return self.fit.slope

    @property
    def standard_error(self) -> float:
        """Standard error of the dimension."""
        return self.fit.standard_error


@checked
def correlation_dimension(
    points: ArrayLike,
    radii: ArrayLike | None = None,
    *,
    theiler: int = 10,
    norm: float = 2.0,
    coordinates: Sequence[str | Coordinate] | None = None,
    scale: ArrayLike | None = None,
    fit_range: tuple[float, float] | None = None,
) -> CorrelationSum:
    r"""Compute the correlation dimension of an orbit on an attractor (Grassberger and Procaccia 1983).

    It is :math:`D_2 = \frac{d \ln C(r)}{d \ln r}`, where C(r) is the fraction of pairs of points closer than r.

    Pairs are counted with a tree of the points; those that are close because they are close in time are excluded
    (Theiler 1986).  The window among usable distances is the one in which scatter and drift of the slope are
    least.

    Parameters
    ----------
    points : array_like, shape (n, d)
        Consecutive points of one orbit, at least 1000.
    radii : array_like, optional
        Distances; by default 25 over up to five decades.
    theiler : int, optional
        Theiler window: pairs up to so many steps apart in time do not count; choose at least the correlation time.
    norm : float, optional
        Norm of distances: 2 for Euclidean, ``inf`` for the maximum norm.
    coordinates, scale : optional
        As in :func:`box_dimension`; distances of angles are taken on the circle.
    fit_range : tuple of float, optional
        Smallest and largest distance for the fit; by default they are chosen automatically.

    Returns
    -------
    CorrelationSum
        Correlation sums, window, dimension and its error.

    Raises
    ------
    ValueError
        For too few points, or arguments out of bounds.

    References
    ----------
    Grassberger, Procaccia, Physica D 9 (1983) 189; Theiler, Physical Review A 34 (1986) 2427.

    Examples
    --------
    >>> x = np.random.default_rng(0).random((4000, 1))
    >>> round(correlation_dimension(x).dimension, 1)
    1.0
    """
    space = Space.of(points, coordinates, scale)
    n = len(space.points)
    if n < 1000:
        raise ValueError(f"points: {n} are too few for pairs at all distances; give at least 1000")
    theiler = whole_number("theiler", theiler, at_most=n // 4)
    one_of("norm", norm, (1.0, 2.0, np.inf))
    if radii is None:
        distances = _LARGEST * space.extent * np.geomspace(1.0, 10.0**-_DECADES, _RADII)
    else:
        distances = checked_sizes(radii, "radii")
    counts = _pairs(space, distances[::-1], theiler, norm)[:, ::-1]  # stretch of the orbit, distance
    edges = np.linspace(0, n, _BLOCKS + 1).astype(int)
    time = np.arange(n)
    partners = n - 1 - np.minimum(time, theiler) - np.minimum(n - 1 - time, theiler)
    each = np.add.reduceat(partners, edges[:-1])
    ratios = counts.sum(axis=0) / each.sum()
    with np.errstate(divide="ignore", invalid="ignore"):
        logs = np.log(counts / each[:, None])
        y, errors = -np.log(ratios), logs.std(axis=0, ddof=1) / np.sqrt(_BLOCKS)
    usable = (counts.sum(axis=0) >= 2 * _FEWEST_PAIRS) & (distances <= _LARGEST * space.extent)
    x = -np.log(distances)
    labels = "ln 1/distance", "ln 1/fraction of pairs"
    fit = fit_sizes("points", x, y, distances, usable, fit_range, labels, argument="radii")
    inside = logs[:, fit.inside]
    if np.isfinite(inside).all():
        slopes = [fit_line(x[fit.inside], -row, (0, inside.shape[1] - 1)).slope for row in inside]
        spread = float(np.std(slopes, ddof=1) / np.sqrt(_BLOCKS))
        fit = replace(fit, standard_error=float(np.hypot(fit.standard_error, spread)))
    errors = np.where(np.isfinite(errors), errors, 0.0)
    return CorrelationSum(
        distances, ratios, errors * ratios, int(each.sum()) // 2, theiler, usable, replace(fit, errors=errors)
    )


def _pairs(space: Space, rising: Floats, theiler: int, norm: float) -> Ints:
    """Ordered pairs that are closer than each distance, by the stretch of the orbit that holds the first of them."""
    from scipy.spatial import cKDTree

    circle = space.periods if space.periods.any() else None
    points = space.points
    if circle is not None:
        # Rounding may put an angle on the upper end of its period, which is the lower one.
        points = in_turn(points, 0.0, circle)
    edges = np.linspace(0, len(points), _BLOCKS + 1).astype(int)
    blocks = [points[first:last] for first, last in pairwise(edges)]
    trees = [cKDTree(block, boxsize=circle) for block in blocks]
    both = list(combinations_with_replacement(range(_BLOCKS), 2))

    def work(pair: tuple[int, int]) -> Ints:
        mine, tree = blocks[pair[0]], trees[pair[1]]
        found = np.zeros(len(rising), np.int64)
        for some in slices(len(mine), max(256, _PAIRS_AT_ONCE // tree.n)):
            check_stop()
            found += cKDTree(mine[some], boxsize=circle).count_neighbors(tree, rising, p=norm)
        return found

    counts = np.zeros((_BLOCKS, len(rising)), np.int64)
    for pair, close in zip(both, run_over(both, work), strict=True):
        counts[list(set(pair))] += close
    counts -= np.diff(edges)[:, None]  # each with itself
    for lag in range(1, theiler + 1):
        apart = np.abs(points[lag:] - points[:-lag])
        if circle is not None:
            apart = np.abs(shortest(apart, circle))
        distance = np.linalg.norm(apart, ord=norm, axis=1)
        for shift in (0, lag):  # the pair belongs to the stretch of either point
            owner = np.searchsorted(edges, np.arange(len(distance)) + shift, side="right") - 1
            for block in range(_BLOCKS):
                close = np.searchsorted(np.sort(distance[owner == block]), rising, side="right")
                counts[block] -= close
    return counts
