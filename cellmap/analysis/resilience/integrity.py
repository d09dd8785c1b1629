"""Integrity of basins: the largest balls inside them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._lib.arrays import Floats
from ..._lib.checks import whole_array, whole_number
from ..._lib.randomness import Rng
from ..._lib.signatures import checked
from ...attractors.settling.labels import Label
from ...basins.classification import own_label, places_of, scale_of, span_of
from ...basins.record import Basins
from ...maps.coordinates import Coordinate
from ...maps.grid import CellGrid
from ...maps.point_map import PointMap
from .shock_search import nearest_foreign
from .shocks import FatalShock, minimal_fatal_shock


@dataclass(frozen=True, eq=False)
class Ball:
    """Ball inside a basin.

    Parameters
    ----------
    label : int
        Label of the basin.
    centre : ndarray, shape (dimension,)
        Centre, in the units of the coordinates.
    radius : float
        Radius in units of `scale`: computed with the map if `shock` is given, else `image_radius`.
    image_radius : float
        Distance from the centre to the nearest labelled initial condition outside the basin.
    resolution : float
        Diagonal of a cell in units of `scale`: the error of the image even for a smooth boundary; NaN for initial
        conditions without a grid.
    scale : ndarray, shape (dimension,)
        Unit of length along each coordinate.
    meets_window : bool
        Whether, by the labels, the edge of the window is nearer than the basin boundary: the basin may then contain a
        larger ball.
    shock : FatalShock or None
        Minimal fatal shock from the centre, computed with the map.
    """

    label: int
    centre: Floats
    radius: float
    image_radius: float
    resolution: float
    scale: Floats
    meets_window: bool
    shock: FatalShock | None

    def __repr__(self) -> str:
        place = ", ".join(f"{v:.6g}" for v in self.centre)
        how = "map" if self.shock is not None else "image"
        more = ", cut off by the window" if self.meets_window else ""
        return f"Ball(basin {self.label}, radius {self.radius:.6g} by the {how}, about ({place}){more})"


@checked
def local_integrity(
    basins: Basins,
    label: int,
    scale: ArrayLike | None = None,
    refine: bool = True,
    *,
    rng: Rng = 0,
    point_map: PointMap | None = None,
) -> Ball:
    r"""Compute the local integrity measure: the largest ball about an attractor inside its basin.

    It is :math:`\min_{a \in A, x \notin B} \lvert x - a \rvert` for the attractor A and its basin B.

    For a periodic or chaotic attractor, it is the smallest of the balls about its points.

    Parameters
    ----------
    basins : Basins
        Basins on a grid, or of single initial conditions.
    label : int
        Label of the attractor.
    scale : array_like, optional
        Unit of length along each coordinate, by default the sizes of the window.
    refine : bool, optional
        Compute the radius with the map, by :func:`minimal_fatal_shock`; otherwise from the labels alone.
    rng : int, numpy.random.Generator or None, optional
        Seed or generator of the refinement.
    point_map : PointMap, optional
        Map to use instead of the exact one.

    Returns
    -------
    Ball
        The ball; its centre is the point of the attractor that is nearest to the basin boundary.  Undecided initial
        conditions count neither as inside nor as outside.

    Raises
    ------
    ValueError
        For a label without a basin, or if no initial condition lies outside the basin.

    References
    ----------
    Soliman, Thompson, Journal of Sound and Vibration 135 (1989) 453.

    Examples
    --------
    >>> from cellmap import discrete_map, find_basins
    >>> cubic = discrete_map(lambda x, p: (1.5 * x[0] - 0.5 * x[0] ** 3,), {}, ("x",))
    >>> local_integrity(find_basins(cubic, CellGrid((-1.5,), (1.5,), (60,))), 0, scale=1.0)
    Ball(basin 0, radius 0.732051 by the map, about (1))
    """
    k = own_label(basins, label)
    unit = scale_of(scale, basins.coordinates, span_of(basins))
    labels = basins.labels.ravel()
    outside = (labels != k) & (labels != Label.UNDECIDED)
    if not outside.any():
        raise ValueError(
            f"basins: no initial condition has another label than {k}; take a larger window, or a finer grid"
        )
    origins = basins.attractors[k].points
    distance, _ = nearest_foreign(places_of(basins)[outside], origins, unit, basins.coordinates)
    row = int(np.argmin(distance))
    radius = float(distance[row])
    shock = minimal_fatal_shock(basins, k, None, unit, rng=rng, point_map=point_map) if refine else None
    centre = origins[row] if shock is None else shock.point
    final = radius if shock is None else shock.size
    meets = _meets_window(basins.grid, basins.coordinates, centre, final, unit)
    return Ball(k, centre.copy(), final, radius, _resolution(basins.grid, unit), unit, meets and shock is None, shock)


@checked
def largest_ball(
    basins: Basins | ArrayLike,
    label: int,
    scale: ArrayLike | None = None,
    wraps: Sequence[bool] = (),
    refine: bool = False,
    *,
    rng: Rng = 0,
    point_map: PointMap | None = None,
) -> Ball:
    r"""Compute the largest ball, with any centre, that fits into a basin within its window.

    Its radius is :math:`\max_c \min_{x \notin B} \lvert x - c \rvert` over all centres c, for the basin B.

    Distances are computed by the Euclidean distance transform of the labels, with periodic angles.

    Parameters
    ----------
    basins : Basins or array_like of int
        Basins on a grid, or labels; the cells of an array are unit squares, with the corner of the first at the origin.
    label : int
        Label of the basin.
    scale : array_like, optional
        Unit of length along each coordinate, by default the sizes of the window; for an array, a cell.
    wraps : sequence of bool, optional
        Which axes of an array are periodic; for basins the grid determines it.
    refine : bool, optional
        Compute the radius about this centre with the map; otherwise from the labels alone.
    rng : int, numpy.random.Generator or None, optional
        Seed or generator of the refinement.
    point_map : PointMap, optional
        Map to use instead of the exact one.

    Returns
    -------
    Ball
        A ball whose cells all have the label; undecided cells and everything beyond the window count as outside.

    Raises
    ------
    ValueError
        For basins that are not on a grid, or a label that no cell has.

    References
    ----------
    Rega, Lenci, Nonlinear Analysis 63 (2005) 902.

    Examples
    --------
    >>> import numpy as np
    >>> stripes = np.repeat([0, 1, 1, 1, 0, 1], 2)
    >>> largest_ball(stripes, 1), largest_ball(stripes, 0, wraps=[True])
    (Ball(basin 1, radius 3 by the image, about (4.5)), Ball(basin 0, radius 1 by the image, about (0.5)))
    """
    from scipy.ndimage import distance_transform_edt

    labels: NDArray[np.integer]
    if isinstance(basins, Basins):
        k, grid = own_label(basins, label), basins.grid
        if grid is None:
            raise ValueError("basins of initial conditions without a grid have no cells; find basins on a CellGrid")
        labels, coordinates = basins.labels, basins.coordinates
    else:
        labels = whole_array("basins", basins, "Basins, or whole numbers as labels")
        k = whole_number("label", label)
        if not labels.size or not labels.ndim:
            raise ValueError(f"basins has the shape {labels.shape}: give the labels of an image")
        if refine:
            raise ValueError("refine=True: an array of labels has no map; give Basins")
        around = tuple(wraps) or (False,) * labels.ndim
        grid = CellGrid((0.0,) * labels.ndim, labels.shape, labels.shape, around)
        coordinates, scale = (), np.ones(labels.ndim) if scale is None else scale
    inside = labels == k
    if not inside.any():
        raise ValueError(f"label={label!r}: no cell has it")
    span = np.array(grid.upper) - np.array(grid.lower)
    unit = scale_of(scale, coordinates or [Coordinate(f"x{j}") for j in range(grid.dimension)], span)
    layers = [(n // 2, n // 2) if w else (1, 1) for n, w in zip(grid.shape, grid.wraps, strict=True)]
    padded = inside
    for axis, layer in enumerate(layers):
        widths = [(0, 0)] * axis + [layer] + [(0, 0)] * (grid.dimension - axis - 1)
        padded = np.pad(padded, widths, mode="wrap" if grid.wraps[axis] else "constant")
    if padded.all():
        raise ValueError(
            f"label={label!r} is that of all cells of a periodic grid: the basin has no boundary; take a larger window"
        )
    distance, ends = distance_transform_edt(padded, sampling=grid.widths / unit, return_indices=True)
    own = tuple(slice(a, a + n) for (a, _), n in zip(layers, grid.shape, strict=True))
    cell = np.unravel_index(int(np.argmax(distance[own])), grid.shape)
    place = tuple(c + a for c, (a, _) in zip(cell, layers, strict=True))
    radius = float(distance[place])
    beyond = any(
        not w and not a <= int(ends[(j, *place)]) < a + n
        for j, ((a, _), n, w) in enumerate(zip(layers, grid.shape, grid.wraps, strict=True))
    )
    centre = np.array([grid.axis(j)[c] for j, c in enumerate(cell)])
    shock = None
    if refine and isinstance(basins, Basins):
        shock = minimal_fatal_shock(basins, k, centre, unit, rng=rng, point_map=point_map)
    final = radius if shock is None else shock.size
    return Ball(k, centre, final, radius, _resolution(grid, unit), unit, beyond and shock is None, shock)


def _resolution(grid: CellGrid | None, unit: Floats) -> float:
    return np.nan if grid is None else float(np.linalg.norm(grid.widths / unit))


def _meets_window(
    grid: CellGrid | None, coordinates: Sequence[Coordinate], centre: Floats, radius: float, unit: Floats
) -> bool:
    """Return whether a ball reaches beyond a window, where nothing is known."""
    if grid is None:
        return True
    free = ~np.array(grid.wraps)
    room = np.minimum(centre - np.array(grid.lower), np.array(grid.upper) - centre) / unit
    return bool((room[free] < radius).any())
