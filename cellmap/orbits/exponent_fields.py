"""Finite-time Lyapunov exponents over a grid of initial conditions."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from .._compiled.kernels.stretching import append_steps
from .._lib.arrays import Floats
from .._lib.checks import claim_memory, whole_number
from .._lib.records import Array, ConvertsToXarray, Keyed, Layout
from .._lib.signatures import checked
from .._lib.threads import run_over, slices
from ..maps.coordinates import Coordinate, wrap
from ..maps.grid import CellGrid, grid_points
from ..maps.orbit_batch import CHUNK, Cost
from ..maps.point_map import PointMap
from ..maps.tangent import tangent


@dataclass(frozen=True, eq=False)
class ExponentField(ConvertsToXarray):
    """Finite-time Lyapunov exponents over a grid of initial conditions.

    Parameters
    ----------
    forward : ndarray, shape of the grid
        Logarithm of the largest growth factor of a small displacement of the initial condition, per step of the map;
        NaN if the orbit terminated.
    backward : ndarray, shape of the grid
        The same for the inverse map, at `images`: minus the logarithm of the smallest growth factor, per step; infinite
        if a direction is mapped to zero in some step, or shrinks below the rounding of the others.
    images : ndarray, shape (*grid.shape, d)
        Images of the initial conditions after `periods`, angles wrapped.
    periods : int
        Steps of the map.
    period : float
        Time of one step; 1 for a discrete map.
    grid : CellGrid
        Cells whose centres are the initial conditions.
    name : str
        Name of the system.
    params : mapping of str to float
        Parameters of the system.
    coordinates : tuple of Coordinate
        State variables.
    cost : Cost
        Wall time and number of steps.
    """

    _layout: ClassVar = Layout(
        "Finite-time Lyapunov exponents of {0.name}",
        {},
        {
            "forward": Array("{cells}", "forward exponent per step of the map", unit="1"),
            "backward": Array("{cells}", "backward exponent per step, at the image", unit="1"),
            "images": Array("{cells}", name="image_{state}"),
        },
        {"period": "map_period"},
    )

    forward: Floats
    backward: Floats
    images: Floats
    periods: int
    period: float
    grid: CellGrid
    name: str
    params: Mapping[str, float]
    coordinates: tuple[Coordinate, ...]
    cost: Cost = Cost()

    def __repr__(self) -> str:
        known = self.forward[np.isfinite(self.forward)]
        ended = self.forward.size - known.size
        span = f"{known.min():.4g} to {known.max():.4g} per step" if known.size else "none"
        lost = f", {ended} orbits terminated" if ended else ""
        return f"ExponentField({self.name}, {self.periods} periods on {self.grid.shape}: {span}{lost})"

    @property
    def per_time(self) -> Floats:
        """Forward exponents per unit of time, shape of the grid."""
        return self.forward / self.period


@checked
def finite_time_exponents(
    point_map: PointMap, grid: CellGrid, periods: int = 10, progress: bool = False
) -> ExponentField:
    r"""Return the finite-time Lyapunov exponents at the centres of all cells, forward and backward.

    They are :math:`\frac{1}{n} \ln \sigma_1(D P^n)` forward and :math:`-\frac{1}{n} \ln \sigma_d(D P^n)` backward.

    The forward exponent is the logarithm of the largest singular value of the derivative of `periods` steps, divided by
    their number.  Its ridges follow repelling structures: stable manifolds, among them basin boundaries.  The smallest
    singular value gives the backward exponent at the image (Haller and Sapsis 2011), whose ridges follow unstable
    manifolds; no map is inverted for it.

    Parameters
    ----------
    point_map : PointMap
        Stroboscopic or discrete map, in any dimension; for an interpolated map, the exact map behind it is used.
    grid : CellGrid
        Cells whose centres are the initial conditions; with one cell along some axes, a slice.
    periods : int, optional
        Steps of the map, at least 1.
    progress : bool, optional
        Show a bar on a terminal for work of more than two seconds.

    Returns
    -------
    ExponentField
        Exponents per step and per time.

    Raises
    ------
    TypeError, ValueError
        For arguments of the wrong kind, or a grid of the wrong dimension.
    MemoryError
        If the field does not fit into memory.

    Notes
    -----
    These exponents depend on the coordinates and their units, which the Lyapunov exponents do not; the difference is of
    order 1/periods.

    References
    ----------
    Haller, Physica D 149 (2001) 248; Haller, Sapsis, Chaos 21 (2011) 023115; Shadden, Lekien, Marsden, Physica D 212
    (2005) 271.

    Examples
    --------
    >>> from cellmap import discrete_map
    >>> saddle = discrete_map(lambda x, p: (2 * x[0], x[1] / 4), {}, ("x", "y"))
    >>> field = finite_time_exponents(saddle, CellGrid((-1, -1), (1, 1), (3, 2)), periods=5)
    >>> (field.forward / np.log(2.0)).round(12).tolist(), (field.backward / np.log(2.0)).round(12).tolist()
    ([[1.0, 1.0], [1.0, 1.0], [1.0, 1.0]], [[2.0, 2.0], [2.0, 2.0], [2.0, 2.0]])
    """
    began = time.perf_counter()
    exact = point_map.without_table
    grid = grid.on(exact.coordinates)
    periods = whole_number("periods", periods, at_least=1)
    d = grid.dimension
    claim_memory(f"exponents of {grid.size:,} initial conditions", 8 * (2 + d) * grid.size, "take fewer cells")
    axes = [grid.axis(j) for j in range(d)]
    forward, backward = np.empty(grid.size), np.empty(grid.size)
    images = np.empty((grid.size, d))

    def work(part: slice) -> None:
        initial_conditions = wrap(grid_points(axes, part), exact.coordinates)
        forward[part], backward[part], images[part] = growth(exact, initial_conditions, periods)

    run_over(slices(grid.size, CHUNK // 16), work, f"exponents of {exact.name}" if progress else None)
    return ExponentField(
        forward=forward.reshape(grid.shape) / periods,
        backward=backward.reshape(grid.shape) / periods,
        images=images.reshape(*grid.shape, d),
        periods=periods,
        period=exact.period,
        grid=grid,
        name=exact.name,
        params=Keyed(exact.params, "params"),
        coordinates=exact.coordinates,
        cost=Cost(time.perf_counter() - began, grid.size * periods),
    )


def growth(exact: PointMap, places: Floats, periods: int) -> tuple[Floats, Floats, Floats]:
    """Return logarithms of the largest growth forward (n,) and backward (n,) of places, and the images (n, d)."""
    n, d = places.shape
    lost = np.zeros(n, bool)
    there = np.broadcast_to(np.eye(d), (n, d, d)).copy()
    back = there.copy()  # the inverse of the whole product: its largest singular value loses no digits
    size_there, size_back = np.zeros(n), np.zeros(n)
    for _ in range(periods):
        images, matrices = tangent(exact, places, coarse=True)
        lost |= ~(np.isfinite(images).all(axis=-1) & np.isfinite(matrices).all(axis=(-2, -1)))
        places = wrap(np.where(lost[:, None], places, images), exact.coordinates)
        matrices = np.where(lost[:, None, None], np.eye(d), matrices)
        append_steps(matrices, there, size_there, back, size_back)
    with np.errstate(divide="ignore"):
        forward = size_there + np.log(np.linalg.svd(there, compute_uv=False)[:, 0])
        backward = size_back + np.log(np.linalg.svd(back, compute_uv=False)[:, 0])
    forward[lost] = backward[lost] = np.nan
    places[lost] = np.nan
    return forward, backward, places
