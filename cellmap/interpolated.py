"""Interpolated cell maps: one period tabulated on a grid, iterated by look-ups (Tongue and Gu 1988)."""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterator
from math import comb

import numpy as np
from numpy.typing import NDArray

from .checks import claim_memory, finite_number, one_of
from .codegen.lookup import lookup_kernel
from .coordinates import turns_of
from .grid import CellGrid, grid_points
from .kernels.contraction import WIDTH, basis_polynomials
from .pointmap import CHUNK, CellTable, Cost, Family, Orbits, PointMap, Status
from .threads import run_over, slices

ORDERS = (1, 3, 5)
_PADDING = {1: 0, 3: 6, 5: 10}  # exact nodes past each end of an interval
_ALLOWED = {1: 0.05, 3: 1e-3, 5: 1e-4}  # difference at a cell's centre, in cell widths
_FARTHEST = 100.0  # an image so many windows away counts as none


def interpolated_map(
    exact: PointMap,
    grid: CellGrid,
    order: int = 5,
    outside: str = "escape",
    tolerance: float | None = None,
    progress: bool = False,
) -> PointMap:
    """Return the interpolated cell map of a point map.

    The images of one period are tabulated at the nodes of the grid, and their displacements interpolated by tensor
    B-splines.  For a smooth map the error falls as h^2, h^4, h^6 with the node distance h for orders 1, 3, 5.  The
    exact image of each cell's centre is compared with the interpolated one; cells that fail, across kinks of the map
    for instance, are left to the exact map.

    Parameters
    ----------
    exact : PointMap
        The map to tabulate.
    grid : CellGrid
        Cells between the nodes.  An axis that covers one turn of an angle wraps; along other axes some nodes past the
        ends are tabulated too, so that the window is accurate up to its edge.
    order : {5, 3, 1}
        Degree of the B-splines; 1 is Tongue and Gu's bilinear method.
    outside : {"escape", "integrate"}
        What becomes of an orbit that leaves the window: it ends with the status ESCAPED, or the exact map carries it
        on until it is back.
    tolerance : float, optional
        Largest difference allowed at a cell's centre, in the units of the coordinates.  By default a share of a cell's
        width in each coordinate: 0.05 for order 1, 1e-3 for order 3, 1e-4 for order 5.
    progress : bool, optional
        Show a bar on a terminal for work of more than two seconds.

    Returns
    -------
    PointMap
        The interpolated map; its `exact` is the map it was made from, its `table` holds the coefficients.

    Raises
    ------
    ValueError
        For arguments out of range or a grid that does not fit the coordinates.
    MemoryError
        Where the table does not fit into memory.

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
    if not isinstance(grid, CellGrid):
        raise TypeError(f"grid={grid!r}: give a CellGrid")
    one_of("order", order, ORDERS)
    one_of("outside", outside, ("escape", "integrate"))
    if tolerance is not None:
        tolerance = finite_number("tolerance", tolerance, above=0.0)
    grid = grid.on(exact.coordinates)
    began = time.perf_counter()
    claim_memory(f"a table of {grid}", table_memory(grid, order), "take fewer cells or a lower order")
    coefficients, spoilt = _coefficients(exact, grid, order, progress)
    allowed = grid.widths * _ALLOWED[order] if tolerance is None else np.full(grid.dimension, tolerance)
    smooth = CellTable(grid, order, coefficients, np.zeros(0, np.float32), np.zeros((0,) * grid.dimension, bool))
    indicator, rough = _centre_errors(exact, smooth, allowed, progress)
    rough |= spoilt
    share = float(rough.mean())
    if share > 0.5:
        warnings.warn(
            f"{100 * share:.0f} % of the cells are left to the exact map: the table is too coarse or the map not "
            "smooth; take more cells, or iterate the exact map itself",
            stacklevel=2,
        )
    table = CellTable(grid, order, coefficients, indicator, rough)
    return PointMap(
        name=exact.name,
        coordinates=exact.coordinates,
        params=exact.params,
        advance=_Advance(exact, table, outside),
        recipe={
            "kind": "interpolated",
            "order": order,
            "outside": outside,
            "tolerance": tolerance,
            "lower": grid.lower,
            "upper": grid.upper,
            "shape": grid.shape,
            "exact": dict(exact.recipe),
        },
        period=exact.period,
        tolerance=exact.tolerance,
        exact=exact,
        table=table,
        family=Family(lambda params: interpolated_map(exact.with_params(**params), grid, order, outside, tolerance)),
        cost=Cost(seconds=time.perf_counter() - began, steps=_tabulated(grid, order) + grid.size),
    )


def table_memory(grid: CellGrid, order: int) -> int:
    """Return the bytes that a table and the making of it need.

    Examples
    --------
    >>> table_memory(CellGrid((0, 0), (1, 1), (100, 100)), 5) // 1000
    518
    """
    d = grid.dimension
    return 16 * d * _tabulated(grid, order) + 5 * grid.size


def _tabulated(grid: CellGrid, order: int) -> int:
    """Count the nodes of a table, those past the ends of intervals included."""
    past = 1 + 2 * _PADDING[order]
    return int(
        np.prod([n if wraps else n + past for n, wraps in zip(grid.shape, grid.wraps, strict=True)], dtype=object)
    )


def _nodes(grid: CellGrid, order: int) -> list[NDArray[np.float64]]:
    """Coordinates of the tabulated nodes along each axis."""
    axes = []
    for j, (n, wraps) in enumerate(zip(grid.shape, grid.wraps, strict=True)):
        past = _PADDING[order]
        numbers = np.arange(n) if wraps else np.arange(-past, n + 1 + past)
        axes.append(grid.lower[j] + numbers * grid.widths[j])
    return axes


def _coefficients(
    exact: PointMap, grid: CellGrid, order: int, progress: bool
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Tabulate displacements and turn them into B-spline coefficients; also mark cells next to nodes without image."""
    values = _displacements(exact, _nodes(grid, order), progress)
    extent = np.array(grid.upper) - np.array(grid.lower)
    with np.errstate(invalid="ignore"):
        failed = ~(np.abs(values) <= _FARTHEST * extent).all(axis=-1)
    if failed.any():
        _fill_from_neighbours(values, failed)
    for j in range(grid.dimension):
        values = _filtered(values, j, order, grid.wraps[j])
    # The look-up reads whole vectors, so that it may read past the last coefficient.
    flat = np.zeros(values.size + WIDTH)
    flat[: values.size] = values.ravel()
    return flat[: values.size].reshape(values.shape), _cells_with_failed_corner(failed, grid, order)


def _displacements(exact: PointMap, axes: list[NDArray[np.float64]], progress: bool) -> NDArray[np.float64]:
    """Return image minus node, angles unwrapped, for all nodes; shape (nodes_1, ..., nodes_d, d)."""
    shape = tuple(map(len, axes))
    moved = np.empty((int(np.prod(shape)), len(axes)))
    turn = turns_of(exact.coordinates)[1]

    def tabulate(part: slice) -> None:
        nodes = grid_points(axes, part)
        orbits = Orbits.starting(nodes.copy())
        exact.advance(orbits, 1)
        moved[part] = orbits.points + orbits.turns * turn - nodes

    run_over(slices(len(moved), CHUNK), tabulate, f"tabulating {exact.name}" if progress else None)
    return moved.reshape(*shape, len(axes))


def _fill_from_neighbours(displacement: NDArray[np.float64], failed: NDArray[np.bool_]) -> None:
    """Give nodes without image the value of the nearest node with one, lest they spoil the filter far around."""
    if failed.all():
        displacement[:] = 0.0
        return
    from scipy.ndimage import distance_transform_edt

    nearest = distance_transform_edt(failed, return_distances=False, return_indices=True)
    displacement[:] = displacement[tuple(nearest)]


def _cells_with_failed_corner(failed: NDArray[np.bool_], grid: CellGrid, order: int) -> NDArray[np.bool_]:
    corner = failed
    for j, (n, wraps) in enumerate(zip(grid.shape, grid.wraps, strict=True)):
        first = 0 if wraps else _PADDING[order]
        lower = np.take(corner, np.arange(first, first + n), axis=j)
        upper = np.take(corner, np.arange(first + 1, first + n + 1) % corner.shape[j], axis=j)
        corner = lower | upper
    return corner


def _filtered(values: NDArray[np.float64], axis: int, order: int, wraps: bool) -> NDArray[np.float64]:
    """Return B-spline coefficients along one axis, those that the cells need: one for each cell and `order` more."""
    shape = list(values.shape)
    past = _PADDING[order]
    shape[axis] = shape[axis] + order if wraps else shape[axis] - 1 - 2 * past + order
    result = np.empty(shape)
    # In slabs across another axis: little memory besides the result, and work for all threads.
    across = 0 if axis else values.ndim - 1 if values.ndim == 2 else 1
    size = max(1, shape[across] // 32)

    def filter_slab(part: slice) -> None:
        slab = (slice(None),) * across + (part,)
        result[slab] = _filtered_slab(values[slab], axis, order, wraps)

    run_over(slices(shape[across], size), filter_slab)
    return result


def _filtered_slab(values: NDArray[np.float64], axis: int, order: int, wraps: bool) -> NDArray[np.float64]:
    if wraps:
        n = values.shape[axis]
        if order > 1 and n > 1:
            from scipy.ndimage import spline_filter1d

            values = spline_filter1d(values, order, axis=axis, mode="grid-wrap")
        return np.take(values, np.arange(-(order // 2), n - order // 2 + order) % n, axis=axis)
    if order == 1:
        return values
    solved = _interval_coefficients(np.moveaxis(values, axis, 0), order)
    past = _PADDING[order]
    return np.moveaxis(solved[past : len(solved) - past], 0, axis)


def _interval_coefficients(values: NDArray[np.float64], order: int) -> NDArray[np.float64]:
    """Solve for the coefficients along the first axis of values at consecutive nodes; `order` - 1 more than nodes.

    The surplus is fixed at the ends by differences of order `order` + 1 of the coefficients that vanish: the
    polynomial pieces next to an end are one polynomial, so the order of convergence holds up to the end.
    """
    from scipy.linalg import solve_banded

    nodes, half, reach = len(values), order // 2, order + 1
    size = nodes + 2 * half
    band = np.zeros((2 * reach + 1, size))  # band[reach + row - column, column]
    spline = [row[0] for row in basis_polynomials(order)][:order]  # values at a node
    vanishing = [(-1.0) ** k * comb(reach, k) for k in range(reach + 1)]
    for k, value in enumerate(spline):
        rows = np.arange(half, half + nodes)
        columns = rows - half + k
        band[reach + rows - columns, columns] = value
    for i in range(half):
        for k, value in enumerate(vanishing):
            band[reach + i - (i + k), i + k] = value
            row, column = size - 1 - i, size - 1 - i - k
            band[reach + row - column, column] = value
    right = np.zeros((size, *values.shape[1:]))
    right[half : half + nodes] = values
    solved: NDArray[np.float64] = solve_banded((reach, reach), band, right.reshape(size, -1), overwrite_b=True)
    return solved.reshape(size, *values.shape[1:])


def _centre_errors(
    exact: PointMap, table: CellTable, allowed: NDArray[np.float64], progress: bool
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Compare both images of every cell's centre."""
    grid = table.grid
    indicator = np.empty(grid.size, np.float32)
    rough = np.empty(grid.size, bool)
    turn = turns_of(exact.coordinates)[1]
    interpolated = _Advance(exact, table, "escape")
    axes = [grid.axis(j) for j in range(grid.dimension)]

    def compare(part: slice) -> None:
        centres = grid_points(axes, part)
        images = []
        for advance in (exact.advance, interpolated):
            orbits = Orbits.starting(centres.copy())
            advance(orbits, 1)
            images.append(orbits.points + orbits.turns * turn)
        error = np.abs(images[0] - images[1])
        with np.errstate(invalid="ignore", over="ignore"):
            worst = (error / grid.widths).max(axis=-1)
            indicator[part] = np.where(np.isfinite(worst), worst, np.inf)
            rough[part] = ~(error <= allowed).all(axis=-1)

    run_over(slices(grid.size, CHUNK), compare, f"checking the table of {exact.name}" if progress else None)
    return indicator.reshape(grid.shape), rough.reshape(grid.shape)


class _Advance:
    """Iteration of a table, with the exact map where the table does not serve."""

    def __init__(self, exact: PointMap, table: CellTable, outside: str) -> None:
        grid, coefficients = table.grid, table.coefficients
        self._exact, self._integrate, self._grid = exact, outside == "integrate", grid
        self._look_up = lookup_kernel(grid.dimension, table.order)
        lower, turn = turns_of(exact.coordinates)
        strides = np.array(coefficients.strides[:-1]) // coefficients.itemsize
        flat = np.lib.stride_tricks.as_strided(coefficients, (coefficients.size + WIDTH,), (coefficients.itemsize,))
        rough = table.rough.ravel() if table.rough.any() else np.zeros(0, bool)
        circle = np.where(grid.wraps, np.array(grid.shape, float), turn / grid.widths)
        self._description = (
            flat,
            strides,
            np.array(grid.lower),
            1.0 / grid.widths,
            np.array(grid.shape),
            circle,
            np.ascontiguousarray(rough),
            lower,
            turn,
        )

    def __call__(self, orbits: Orbits, periods: int) -> None:
        for now in orbits.living():
            left = np.full(len(now), periods, np.int64)
            for part in self._moving(now, left):
                stopped = now[part]
                if not self._integrate:
                    stopped.end(self._outside(stopped.points), Status.ESCAPED)
                for carried in stopped.living():
                    self._exact.advance(carried, 1)
                now[part] = stopped
                left[part] = np.where(stopped.alive, left[part] - 1, 0)

    def _moving(self, orbits: Orbits, left: NDArray[np.int64]) -> Iterator[NDArray[np.int64]]:
        """Look up until every orbit is through, yielding those that the table cannot carry on."""
        everyone = np.arange(len(orbits))
        part = everyone
        while len(part):
            if part is everyone:
                self._look_up(orbits.points, orbits.turns, left, *self._description)
            else:
                some, remaining = orbits[part], left[part]
                self._look_up(some.points, some.turns, remaining, *self._description)
                orbits[part], left[part] = some, remaining
            part = part[left[part] > 0]
            if len(part):
                yield part

    def _outside(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        outside = np.zeros(len(points), bool)
        _, _, origin, inverse, cells, circle, *_ = self._description
        place = (points - origin) * inverse
        for j in range(points.shape[1]):
            if circle[j]:
                place[:, j] -= circle[j] * np.floor(place[:, j] / circle[j])
                place[:, j] = np.where((place[:, j] >= 0.0) & (place[:, j] < circle[j]), place[:, j], 0.0)
            outside |= ~((place[:, j] >= 0.0) & (place[:, j] <= cells[j]))
        return outside
