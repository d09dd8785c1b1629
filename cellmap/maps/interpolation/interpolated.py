"""Interpolated cell maps: iteration by interpolation on a grid (Tongue and Gu 1988)."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..._lib.arrays import Floats
from ..._lib.checks import claim_memory, finite_number, one_of, warn_caller, whole_number
from ..._lib.files import as_checkpoint, locked
from ..._lib.signatures import checked
from ..._lib.tiles import check_client
from ..cell_table import CellTable
from ..grid import CellGrid, check_volume
from ..orbit_batch import Cost
from ..point_map import PointMap
from ..specification import MapSpec, specification, with_spec
from .look_ups import LookUps
from .spline_coefficients import ORDERS, line_memory, number_of_nodes
from .table_making import doubled_table, errors_in_cells, spline_coefficients_of
from .tabulation import TableTiles, table_checkpoint

ALLOWED = {1: 0.05, 3: 1e-3, 5: 1e-4}  # error in a cell, in cell widths
_STRICTER = 0.01  # tolerance of tables of several periods, as a fraction of the error allowed for one period


@checked
def interpolated_map(
    exact: PointMap,
    grid: CellGrid,
    order: int = 5,
    outside: str = "integrate",
    tolerance: float | None = None,
    progress: bool = False,
    max_step: int = 1,
    client: Any = None,
    checkpoint: str | os.PathLike[str] | None = None,
) -> PointMap:
    """Return the interpolated cell map of a point map.

    The images of the grid's nodes after one period are computed with the exact map, and their displacements are
    interpolated by tensor products of B-splines.  For a smooth map the error decreases as h^2, h^4, h^6 with the node
    distance h for orders 1, 3, 5.  The error in each cell is estimated from its leading terms along the axes, which
    follow from the coefficients, and from the exact image of its centre.  Fallback cells, in which the error is too
    large, for instance across a kink of the map, are evaluated with the exact map.

    Parameters
    ----------
    exact : PointMap
        The map to interpolate.
    grid : CellGrid
        Cells between the nodes.  An axis that covers one period of an angle is periodic.  Along other axes images are
        also computed at some nodes beyond the ends, so that the map is accurate up to the edge of the window.
    order : {5, 3, 1}, optional
        Degree of the B-splines, by default 5; 1 is Tongue and Gu's bilinear method.
    outside : {"integrate", "escape"}
        Treatment of an orbit that leaves the window.  By default it is continued with the exact map until it returns,
        so that no orbit escapes, and attractors outside the window keep their basins.  With "escape" it terminates with
        the status ESCAPED, as in Tongue and Gu (1988); this saves exact images if many orbits leave.
    tolerance : float, optional
        Largest error allowed in a cell, in the units of the coordinates.  By default a fraction of the cell width in
        each coordinate: 0.05 for order 1, 1e-3 for order 3, 1e-4 for order 5.
    progress : bool, optional
        Show a bar on a terminal for work of more than two seconds.
    max_step : int, optional
        Largest number of periods in a multi-period step, a power of two.  Interpolated maps of 2, 4, ..., `max_step`
        periods are composed from that of one.  Each cell uses the longest multi-period step whose error in it, compared
        with single periods, is at most `tolerance`, or a hundredth of the default.  One step of the returned map
        remains one period.
    client : distributed.Client, optional
        Dask cluster that computes the exact images; by default they are computed by the threads of this process.
    checkpoint : path-like, optional
        File in which exact images are stored as they are computed.  Repeating a call that was interrupted or killed
        resumes it, with the same result; repeating a finished call reads the images from the file.

    Returns
    -------
    PointMap
        The interpolated map; its `exact` is the map that it interpolates, its `table` holds the coefficients.

    Raises
    ------
    ValueError
        For arguments out of range, a grid that does not fit the coordinates, or a checkpoint of another map.
    MemoryError
        If the interpolation grid does not fit into memory.
    OSError
        If a checkpoint does not fit on the disk.
    StoreError
        For a checkpoint that is damaged or in use by another run, or a file of another kind.

    Warns
    -----
    UserWarning
        If more than half of the cells are fallback cells.

    References
    ----------
    Tongue, Gu, Journal of Applied Mechanics 55 (1988) 461; Unser, Aldroubi, Eden, IEEE Transactions on Pattern Analysis
    and Machine Intelligence 13 (1991) 277.

    Examples
    --------
    >>> from math import pi, sin
    >>> from cellmap import CellGrid, angle, discrete_map
    >>> def standard(x, p):
    ...     y = x[1] + p.k * sin(x[0])
    ...     return x[0] + y, y
    >>> exact = discrete_map(standard, {"k": 0.5}, (angle("theta"), "y"))
    >>> icm = interpolated_map(exact, CellGrid((-pi, -1), (pi, 1), (128, 64)))
    >>> bool(icm.error().largest < 1e-8)
    True
    """
    if not isinstance(exact, PointMap) or exact.table is not None:
        raise TypeError(f"exact={exact!r}: give an exact map, from stroboscopic_map or discrete_map")
    one_of("order", order, ORDERS)
    one_of("outside", outside, ("escape", "integrate"))
    if tolerance is not None:
        tolerance = finite_number("tolerance", tolerance, above=0.0)
    max_step = whole_number("max_step", max_step, at_least=1)
    if max_step & (max_step - 1):
        raise ValueError(f"max_step={max_step}: give a power of two")
    check_client(client)
    check_volume(grid)
    grid = grid.on(exact.coordinates)
    began = time.perf_counter()
    needed = table_memory(grid, order, max_step)
    claim_memory(f"an interpolation grid of {grid}", needed, "take fewer cells or a lower order")
    path = as_checkpoint(checkpoint)
    with locked(path):
        file = None
        if path is not None:
            settings = {"order": order, "tolerance": tolerance}
            file = table_checkpoint(path, exact, grid, settings, number_of_nodes(grid, order))
        tiles = TableTiles(client, file)
        coefficients, spoilt = spline_coefficients_of(exact, grid, order, progress, tiles)
        allowed = allowed_errors(grid, order, tolerance)
        smooth = CellTable.unexamined(grid, order, coefficients)
        indicator, fallback = errors_in_cells(exact, smooth, allowed, progress, tiles)
    fallback |= spoilt
    fraction = float(fallback.mean())
    if fraction > 0.5:
        warn_caller(
            f"{100 * fraction:.0f} % of the cells are fallback cells: the grid is too coarse or the map not smooth; "
            "take more cells, or iterate the exact map itself; error() measures the other cells alone",
        )
    cost = Cost(
        seconds=time.perf_counter() - began,
        steps=number_of_nodes(grid, order) + grid.size,
        evaluations=tiles.work.evaluations,
    )
    table = CellTable(grid, order, coefficients, indicator, fallback)
    return Interpolated(exact, grid, order, outside, tolerance, max_step, table, cost).make(progress)


@dataclass(frozen=True, eq=False)
class Interpolated(MapSpec[PointMap]):
    """Specification of an interpolated map; see :func:`interpolated_map`.

    With a `table` and its `cost` the map is built from them; the tables of several periods follow from it.
    """

    kind = "interpolated"
    exact: PointMap
    grid: CellGrid
    order: int
    outside: str
    tolerance: float | None
    max_step: int
    table: CellTable | None = None
    cost: Cost = Cost()

    def make(self, progress: bool = False) -> PointMap:
        """Return the map, from the table where there is one."""
        exact, table, outside = self.exact, self.table, self.outside
        if table is None:
            return interpolated_map(exact, self.grid, self.order, outside, self.tolerance, progress, self.max_step)
        allowed = allowed_errors(self.grid, self.order, self.tolerance) * (_STRICTER if self.tolerance is None else 1.0)
        began = time.perf_counter()
        tables = [table]
        while 2 ** len(tables) <= self.max_step:
            tables.append(doubled_table(exact, tables, outside, allowed, progress))
        advance = LookUps(exact, tables, outside)
        kept = replace(table, coefficients=advance.coefficients)
        seconds = self.cost.seconds + time.perf_counter() - began
        made = PointMap(
            name=exact.name,
            coordinates=exact.coordinates,
            params=exact.params,
            advance=advance,
            period=exact.period,
            tolerance=exact.tolerance,
            exact=exact,
            table=kept,
            cost=replace(self.cost, seconds=seconds, tabulation=seconds),
            max_step=self.max_step,
            escapes=outside == "escape",
            is_flow=exact.is_flow,
            no_image=exact.no_image,
            ends=exact.ends,
            unknown_formulas=exact.unknown_formulas,
        )
        return with_spec(made, replace(self, table=kept))

    def build(self) -> PointMap:
        """Return the map."""
        return self.make()

    def with_params(self, params: Mapping[str, float]) -> Interpolated:
        """Return the specification with other values of the parameters."""
        return replace(self, exact=self.exact.with_params(**params), table=None)

    def with_phase(self, phase: float) -> Interpolated:
        """Return the specification with another phase of the forcing."""
        exact = self.exact.specified
        phased = exact.with_phase(phase)
        return self if phased is exact else replace(self, exact=phased.build(), table=None)

    @property
    def recipe(self) -> dict[str, Any]:
        """Plain values for a file."""
        grid = self.grid
        return {
            "kind": self.kind,
            "order": self.order,
            "outside": self.outside,
            "tolerance": self.tolerance,
            "lower": grid.lower,
            "upper": grid.upper,
            "shape": grid.shape,
            "exact": self.exact.recipe,
            **({"leap": self.max_step} if self.max_step > 1 else {}),
        }

    @classmethod
    def from_recipe(cls, source: Any, recipe: Mapping[str, Any]) -> Interpolated:
        """Return the specification of a recipe."""
        exact = specification(source, recipe["exact"]).build()
        grid = CellGrid(tuple(recipe["lower"]), tuple(recipe["upper"]), tuple(recipe["shape"]))
        max_step = recipe.get("leap", 1)
        return cls(exact, grid, int(recipe["order"]), recipe["outside"], recipe["tolerance"], max_step)


def allowed_errors(grid: CellGrid, order: int, tolerance: float | None) -> Floats:
    """Return the largest error in a cell that is allowed, for each coordinate."""
    return grid.widths * ALLOWED[order] if tolerance is None else np.full(grid.dimension, tolerance)


def table_memory(grid: CellGrid, order: int, max_step: int = 1) -> int:
    """Return the bytes that tables of up to `max_step` periods and the making of them need.

    Examples
    --------
    >>> table_memory(CellGrid((0, 0), (1, 1), (1000, 1000)), 1) // 10**6
    38
    """
    d, nodes = grid.dimension, number_of_nodes(grid, order)
    along = sum(line_memory(n, nodes // n, order, wraps) for n, wraps in zip(grid.shape, grid.wraps, strict=True))
    return (16 * d * nodes + 6 * grid.size + along) * max_step.bit_length()
