"""B-spline coefficients of an interpolated map from its images at the nodes."""

from __future__ import annotations

from math import comb

import numpy as np

from ..._compiled.codegen.spline_sum import WIDTH, basis_polynomials
from ..._compiled.kernels.banded import solve_banded
from ..._lib.arrays import Floats
from ..._lib.threads import run_over, slices, thread_count
from ..grid import CellGrid

ORDERS = (1, 3, 5)
PADDING = {1: 0, 3: 6, 5: 10}  # exact nodes past each end of an interval
_SLAB = 8192  # numbers that are filtered at a time, at least; fewer cost more than they take


def number_of_nodes(grid: CellGrid, order: int) -> int:
    """Count the nodes of a table, those past the ends of intervals included."""
    past = 1 + 2 * PADDING[order]
    return int(
        np.prod([n if wraps else n + past for n, wraps in zip(grid.shape, grid.wraps, strict=True)], dtype=object)
    )


def nodes_of(grid: CellGrid, order: int) -> list[Floats]:
    """Return the coordinates of the interpolation nodes along each axis."""
    axes = []
    for j, (n, wraps) in enumerate(zip(grid.shape, grid.wraps, strict=True)):
        past = PADDING[order]
        numbers = np.arange(n) if wraps else np.arange(-past, n + 1 + past)
        axes.append(grid.along(j, numbers))
    return axes


def line_memory(cells: int, lines: int, order: int, wraps: bool) -> int:
    """Return the bytes for the coordinates along an axis, and for solving for its coefficients, a line a thread."""
    numbers = 6
    if order > 1 and not wraps:
        reach = order + 1
        # The band with room for its factors, and the lines of a slab.
        numbers += ((3 * reach + 1) + 3) * min(thread_count(), max(1, lines))
    return 8 * numbers * (cells + 2 * PADDING[order] + 1)


def filtered(values: Floats, axis: int, order: int, wraps: bool) -> Floats:
    """Return B-spline coefficients along one axis, those that the cells need: one for each cell and `order` more."""
    shape = list(values.shape)
    past = PADDING[order]
    shape[axis] = shape[axis] + order if wraps else shape[axis] - 1 - 2 * past + order
    result = np.empty(shape)
    # In slabs across another axis: little memory besides the result, and work for all threads.
    across = 0 if axis else values.ndim - 1 if values.ndim == 2 else 1
    numbers = values.size // shape[across]
    size = max(1, shape[across] // 32, _SLAB // max(numbers, 1))

    def filter_slab(part: slice) -> None:
        slab = (slice(None),) * across + (part,)
        result[slab] = _filtered_slab(values[slab], axis, order, wraps)

    run_over(slices(shape[across], size), filter_slab)
    return result


def _filtered_slab(values: Floats, axis: int, order: int, wraps: bool) -> Floats:
    if wraps:
        n = values.shape[axis]
        if order > 1 and n > 1:
            from scipy.ndimage import spline_filter1d

            values = spline_filter1d(values, order, axis=axis, mode="grid-wrap")
        return np.take(values, np.arange(-(order // 2), n - order // 2 + order) % n, axis=axis)
    if order == 1:
        return values
    solved = _interval_coefficients(np.moveaxis(values, axis, 0), order)
    past = PADDING[order]
    return np.moveaxis(solved[past : len(solved) - past], 0, axis)


def _interval_coefficients(values: Floats, order: int) -> Floats:
    """Solve for the coefficients along the first axis of values at consecutive nodes; `order` - 1 more than nodes.

    The surplus is fixed at the ends by differences of order `order` + 1 of the coefficients that vanish: the
    polynomial pieces next to an end are one polynomial, so the order of convergence holds up to the end.
    """
    nodes, half, reach = len(values), order // 2, order + 1
    size = nodes + 2 * half
    band = np.zeros((size, 3 * reach + 1))  # band[row, column - row + reach]
    spline = [row[0] for row in basis_polynomials(order)][:order]  # values at a node
    vanishing = [(-1.0) ** k * comb(reach, k) for k in range(reach + 1)]
    for k, value in enumerate(spline):
        band[half : half + nodes, k - half + reach] = value
    for i in range(half):
        for k, value in enumerate(vanishing):
            band[i, k + reach] = band[size - 1 - i, reach - k] = value
    right = np.zeros((size, *values.shape[1:]))
    right[half : half + nodes] = values
    solve_banded(band, reach, right.reshape(size, -1))
    return right


def with_spare_doubles(values: Floats) -> Floats:
    """Return coefficients with zeros behind them: look-ups read whole vectors, and so past the last coefficient."""
    return padded(values)[: values.size].reshape(values.shape)


def padded(values: Floats) -> Floats:
    """Return coefficients and the zeros behind them, flat; in their own memory where it holds these zeros."""
    flat, whole = values, values.size + WIDTH
    while isinstance(flat.base, np.ndarray):
        flat = flat.base
    own = flat.flags.c_contiguous and flat.dtype == values.dtype == np.float64 and flat.size >= whole
    if own and values.flags.c_contiguous and values.ctypes.data == flat.ctypes.data:
        flat = flat.reshape(-1)[:whole]
        if not flat[values.size :].any():
            return flat
    flat = np.zeros(whole)
    flat[: values.size] = values.ravel()
    return flat
