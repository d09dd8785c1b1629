"""Distances of basin boundaries from curves, such as the stable manifolds of the saddles on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._lib.arrays import Floats
from ..._lib.checks import finite_number
from ..._lib.signatures import checked
from ...basins.record import Basins
from ..resilience.shock_search import circular_tree
from .manifolds import Manifold

_FINE = 0.1  # cells between points on the curves


@dataclass(frozen=True, eq=False)
class BoundaryDistance:
    """Distances of a basin boundary from curves.

    Parameters
    ----------
    places : ndarray, shape (n, 2)
        Midpoints between neighbouring cells with different labels.
    distances : ndarray, shape (n,)
        Distance of each point from the nearest curve, in cell widths; infinite without a curve.
    between : ndarray of int16, shape (n, 2)
        Labels of the two cells, the smaller one first.
    within : float
        Distance up to which a point counts as lying on a curve.
    fraction : float
        Fraction of the points that are so close.
    """

    places: Floats
    distances: Floats
    between: NDArray[np.int16]
    within: float
    fraction: float

    def __repr__(self) -> str:
        return (
            f"BoundaryDistance({100 * self.fraction:.4g} % of {len(self.places)} boundary points within "
            f"{self.within:g} cells, median {np.median(self.distances):.3g}, largest {self.distances.max():.3g})"
        )


@checked
def boundary_distance(
    manifolds: Manifold | Sequence[Manifold],
    basins: Basins,
    labels: tuple[int, int] | None = None,
    max_distance: float = 1.0,
) -> BoundaryDistance:
    """Compute the distances of a basin boundary from manifolds.

    Parameters
    ----------
    manifolds : Manifold or sequence of Manifold
        Curves.
    basins : Basins
        Labels on a grid of two axes.
    labels : tuple of int, optional
        Two labels whose common boundary is measured, by default all boundaries.  By default, cells that are undecided
        or whose orbits escaped form no boundary.
    max_distance : float, optional
        Distance, in cells, up to which a point counts as lying on a curve.

    Returns
    -------
    BoundaryDistance
        The distances.  They contain no information on curves that lie on no boundary.

    Raises
    ------
    ValueError
        For basins that are not on a grid of two axes, or without such a boundary.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map, find_basins, periodic_orbit
    >>> from cellmap.analysis.boundary.manifolds import saddle_manifold
    >>> cubic = discrete_map(lambda x, p: (1.5 * x[0] - 0.5 * x[0] ** 3, x[1] / 2), {}, ("x", "y"))
    >>> grid = CellGrid((-1.5, -1), (1.5, 1), (60, 40))
    >>> axis = saddle_manifold(cubic, periodic_orbit(cubic, [0.0, 0.0]), "stable", grid)
    >>> followed = boundary_distance(axis, find_basins(cubic, grid))
    >>> len(followed.places), followed.fraction, bool(followed.distances.max() < 0.06)
    (40, 1.0, True)
    """
    curves = [manifolds] if isinstance(manifolds, Manifold) else list(manifolds)
    if basins.grid is None or basins.grid.dimension != 2:
        raise ValueError("basins are not on a grid of two axes: find basins on a CellGrid of a plane")
    allowed = finite_number("max_distance", max_distance, above=0.0)
    places, between = _boundary(basins, labels)
    if not len(places):
        raise ValueError(f"labels={labels!r}: no neighbouring cells differ so; there is no boundary to follow")
    widths = basins.grid.widths
    dense = [_dense(b.points, widths) for m in curves for b in m.branches]
    points = np.concatenate([np.empty((0, 2)), *dense])
    distances = np.full(len(places), np.inf)
    if len(points):
        tree, scaled = circular_tree(points, widths, basins.coordinates)
        distances = tree.query(scaled(places))[0]
    return BoundaryDistance(places, distances, between, allowed, float((distances <= allowed).mean()))


def _boundary(basins: Basins, wanted: ArrayLike | None) -> tuple[Floats, NDArray[np.int16]]:
    grid = basins.grid
    assert grid is not None
    axes = [grid.axis(0), grid.axis(1)]
    places, between = [], []
    for axis in (0, 1):
        ahead = np.roll(basins.labels, -1, axis)
        differ = ahead != basins.labels
        if not grid.wraps[axis]:
            differ[(slice(None),) * axis + (-1,)] = False
        if wanted is None:
            differ &= (basins.labels >= 0) & (ahead >= 0)
        index = np.nonzero(differ)
        pair = np.sort(np.stack([basins.labels[index], ahead[index]], axis=1), axis=1)
        spots = np.stack([axes[0][index[0]], axes[1][index[1]]], axis=1)
        spots[:, axis] = grid.edges(axis)[index[axis] + 1]
        if wanted is not None:
            keep = (pair == np.sort(np.asarray(wanted))).all(axis=1)
            pair, spots = pair[keep], spots[keep]
        places.append(spots)
        between.append(pair)
    return np.concatenate(places), np.concatenate(between)


def _dense(curve: Floats, widths: Floats) -> Floats:
    """Return points close together on the pieces of a curve."""
    ends = np.isfinite(curve[:-1]).all(axis=1) & np.isfinite(curve[1:]).all(axis=1)
    first, piece = curve[:-1][ends], np.diff(curve, axis=0)[ends]
    count = np.maximum(np.ceil(np.linalg.norm(piece / widths, axis=1) / _FINE), 1).astype(int)
    number = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    return np.asarray(
        np.repeat(first, count, axis=0) + (number / np.repeat(count, count))[:, None] * np.repeat(piece, count, axis=0)
    )
