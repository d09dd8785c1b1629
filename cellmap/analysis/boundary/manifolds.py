"""Stable and unstable manifolds of saddles of planar maps, as curves, and how far boundaries are from them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._lib.arrays import Floats
from ..._lib.checks import claim_memory, finite_number, one_of
from ..._lib.signatures import checked
from ...basins.record import Basins
from ...maps.coordinates import Coordinate, circular_tree, wrap
from ...maps.grid import CellGrid
from ...maps.point_map import PointMap
from ...maps.tangent import tangent
from ...orbits.orbit_kinds import PeriodicOrbit
from .curve_growth import GrowingCurve, ManifoldBranch, growth_of

_FINE = 0.1  # cells between points on the curves


@dataclass(frozen=True, eq=False)
class Manifold:
    """Stable or unstable manifold of a saddle of a planar map.

    Parameters
    ----------
    kind : str
        ``"stable"`` or ``"unstable"``.
    orbit : PeriodicOrbit
        The saddle.
    multiplier : float
        Multiplier of the saddle along the manifold.
    branches : tuple of ManifoldBranch
        Branches, two for each point of the saddle.
    spacing : float
        Largest distance of neighbouring points on the curves, in units of `scale`.
    scale : ndarray, shape (2,)
        Unit of length along each coordinate.
    coordinates : tuple of Coordinate
        State variables.
    """

    kind: str
    orbit: PeriodicOrbit
    multiplier: float
    branches: tuple[ManifoldBranch, ...]
    spacing: float
    scale: Floats
    coordinates: tuple[Coordinate, ...]

    def __repr__(self) -> str:
        lengths = ", ".join(f"{b.length:.3g}" for b in self.branches)
        return f"Manifold({self.kind}, multiplier {self.multiplier:.6g}, lengths {lengths})"

    @property
    def points(self) -> Floats:
        """All points, shape (n, 2), angles within their period, without order or interruptions."""
        every = np.concatenate([b.points for b in self.branches])
        return wrap(every[np.isfinite(every).all(axis=1)], self.coordinates)


@checked
def saddle_manifold(
    point_map: PointMap,
    orbit: PeriodicOrbit,
    kind: str,
    region: CellGrid,
    length: float = 10.0,
    spacing: float = 0.01,
    inverse: PointMap | None = None,
    reach: float = 0.1,
) -> Manifold:
    r"""Compute the stable or the unstable manifold of a saddle of a planar map.

    For a fixed point p of the map f they are :math:`W^s = \{x \,:\, \lim_{n \to \infty} f^n(x) = p\}` and
    :math:`W^u = \{x \,:\, \lim_{n \to \infty} f^{-n}(x) = p\}`; those of a cycle are the ones of its points, fixed
    under :math:`f^m` for its period m.

    A fundamental segment on the eigenvector, from a point close to the saddle to its image, is iterated.  Where the
    image is bent or stretched too much, points are inserted on the segment itself and iterated, so that the curve is
    nowhere interpolated.  The stable manifold is the unstable one of the inverse map; without `inverse` each preimage
    is found by Newton's method with the exact derivative, with the previous one on the curve as initial guess.

    Parameters
    ----------
    point_map : PointMap
        A map of two coordinates.
    orbit : PeriodicOrbit
        A saddle of it, with one multiplier outside and one inside the unit circle.
    kind : {"stable", "unstable"}
        Kind of the manifold.
    region : CellGrid
        Window of the curves; its sizes are the units of `length` and `spacing`, its cells are not used.
    length : float, optional
        Arc length up to which each branch is computed.
    spacing : float, optional
        Largest distance of neighbouring points; where the direction of the curve changes by more than 0.2 rad from one
        to the next, they are closer, down to a thousandth of it.
    inverse : PointMap, optional
        Inverse of the map, for example from :func:`inverse_stroboscopic_map`; several times faster than Newton's
        method.
    reach : float, optional
        Distance outside the window up to which curves are continued, in sizes of the window.  Increase it for curves
        that return from far away, as those of Hénon's map do.

    Returns
    -------
    Manifold
        The manifold with its branches.  Parts of a curve that lie farther outside are omitted, as is a part that
        returns between two neighbouring points outside.

    Raises
    ------
    ValueError
        For a map that is not planar, or an orbit that is no saddle.

    References
    ----------
    Hobson, Journal of Computational Physics 104 (1993) 14; You, Kostelich, Yorke, International Journal of Bifurcation
    and Chaos 1 (1991) 605.

    Examples
    --------
    >>> from cellmap import discrete_map, periodic_orbit
    >>> bent = discrete_map(lambda x, p: (2 * x[0], x[1] / 2 + 3.5 * x[0] ** 2), {}, ("x", "y"))
    >>> saddle = periodic_orbit(bent, [0.1, 0.1])
    >>> curve = saddle_manifold(bent, saddle, "unstable", CellGrid((-1, -1), (1, 1), (1, 1))).branches[0].points
    >>> bool(abs(curve[:, 1] - curve[:, 0] ** 2).max() < 1e-9)
    True
    """
    one_of("kind", kind, ("stable", "unstable"))
    if point_map.dimension != 2:
        raise ValueError(f"point_map has {point_map.dimension} coordinates: manifolds are grown as curves in a plane")
    moduli = np.abs(orbit.multipliers)
    if orbit.points.shape[-1] != 2 or not (moduli[0] > 1.0 > moduli[1] > 0.0):
        raise ValueError(f"orbit={orbit!r}: give a saddle, with one multiplier outside the unit circle and one inside")
    grid = region.on(point_map.coordinates, "region")
    longest = finite_number("length", length, above=0.0)
    apart = finite_number("spacing", spacing, above=0.0, at_most=0.5)
    beyond = finite_number("reach", reach, at_least=0.0)
    points = min(longest / apart, 2.0**58)
    claim_memory(
        f"spacing={apart!r}: a curve of {points:.3g} points",
        int(16 * points),
        "give a larger spacing, or a smaller length",
    )
    unit = np.array(grid.upper) - np.array(grid.lower)
    which = 0 if kind == "unstable" else 1
    multiplier = float(orbit.multipliers[which].real)
    rounds = 2 if multiplier < 0.0 else 1
    factor = multiplier**rounds if kind == "unstable" else multiplier**-rounds
    branches = []
    for row, saddle in enumerate(orbit.points):
        direction = _direction(point_map, orbit, row, multiplier)
        direction = direction / np.linalg.norm(direction / unit)
        growth = growth_of(point_map, orbit, row, kind, rounds, inverse)
        begun = (
            GrowingCurve(growth, saddle, sign * direction, factor, unit, grid, apart, beyond) for sign in (1.0, -1.0)
        )
        branches += [curve.grow(longest) for curve in begun]
    return Manifold(kind, orbit, multiplier, tuple(branches), apart, unit, point_map.coordinates)


def _direction(point_map: PointMap, orbit: PeriodicOrbit, row: int, multiplier: float) -> Floats:
    """Return an eigenvector of the monodromy matrix at one point of the orbit, with a fixed orientation."""
    steps = tangent(point_map, orbit.points)[1]
    matrix = np.eye(2)
    for k in range(orbit.period):
        matrix = steps[(row + k) % orbit.period] @ matrix
    rest = matrix - multiplier * np.eye(2)
    # The kernel of a matrix of rank one is orthogonal to its longer row.
    a, b = rest[int(np.argmax(np.linalg.norm(rest, axis=1)))]
    vector = np.array([-b, a]) / np.hypot(a, b)
    return vector if (vector[0], vector[1]) > (0.0, 0.0) else -vector


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
    r"""Compute the distances of a basin boundary from manifolds.

    The distance of a point x of the boundary is :math:`\min_{y \in C} |x - y|` over all points y of the curves C, with
    the width and the height of a cell as units.

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
