"""Errors of spline interpolation along each axis, from the coefficients."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..._lib.arrays import Floats
from ..._lib.threads import run_over, slices

_AT_CENTRE = {1: -1.0 / 8.0, 3: 1.0 / 384.0, 5: -1.0 / 15360.0}  # (B(1/2) - B(0)) / k! of the Bernoulli polynomials
_SLAB = 32768  # coefficients that are looked at together: more leave the cache, fewer cost more than they take


def leading_errors(
    coefficients: Floats, order: int, wraps: tuple[bool, ...]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the leading errors of interpolation along all axes at the centre of each cell: sums, and absolute ones.

    Splines of odd degree k that take the values of a function f at the nodes, a distance h apart, differ from it along
    one axis by ``h**(k+1) f^(k+1) (B(t) - B(0)) / (k+1)!``, where B is the Bernoulli polynomial of degree k + 1 and t
    the place between two nodes (Schoenberg, *Cardinal Spline Interpolation*, 1973).  This has one sign and is largest
    at the middle, for any f.  Errors along several axes add up.  At the centre of a cell those of different signs
    cancel, wholly so for holomorphic functions on square cells and degrees 1 and 5; at the middle of an edge or a face
    others vanish, so that the largest error in the cell is the sum of all positive ones or that of all negative ones:
    with the sums s and a that are returned, ``(a + |s|) / 2``.  The derivative is that of the spline: its derivative of
    degree k jumps at a node by the difference of k + 2 coefficients.

    The coefficients have the shape (n_1 + order, ..., n_d + order, components).  The sums of the errors (function minus
    spline) and of their absolute values have (n_1, ..., n_d, components); along an interval of a single cell the error
    is unknown, and counts as 0.
    """
    d = len(wraps)
    shape = (*(n - order for n in coefficients.shape[:d]), coefficients.shape[d])
    sums, absolute = np.zeros(shape, np.float32), np.zeros(shape, np.float32)

    @np.errstate(over="ignore", invalid="ignore")  # images of maps that diverge
    def add(task: tuple[int, int, slice]) -> None:
        axis, across, part = task
        taken = part if across == d else slice(part.start, part.stop + order)
        errors = _along(coefficients[(slice(None),) * across + (taken,)], axis, order, wraps[axis])
        slab = (slice(None),) * across + (part,)
        sums[slab] += errors
        absolute[slab] += np.abs(errors)

    for axis in range(d):
        # In slabs across another axis: little memory besides the result, and work for all threads.
        across = 0 if axis else 1
        size = max(1, _SLAB * shape[across] // coefficients.size)
        run_over([(axis, across, part) for part in slices(shape[across], size)], add)
    return sums, absolute


def _along(values: Floats, axis: int, order: int, wraps: bool) -> Floats:
    """Return the leading error along one axis at the centres of cells, its sign included."""
    values = np.moveaxis(values, axis, 0)
    for other in range(1, values.ndim - 1):
        # The mean of the two coefficients at the middle is the value there, but for terms of higher order.
        before, k, count = (slice(None),) * other, order // 2, values.shape[other] - order
        values = values[(*before, slice(k, k + count))] + values[(*before, slice(k + 1, k + 1 + count))]
    count = len(values) - order
    if wraps:
        values = values[np.arange(-1, count + order + 1) % count]
    for _ in range(order + 1):
        values = values[1:] - values[:-1]
    errors = np.empty((count, *values.shape[1:]))
    inner = errors if wraps else errors[1:-1]
    np.add(values[1:], values[:-1], out=inner)
    if not wraps:
        # Behind its ends a window has no coefficients: a straight line is put through the last two differences.
        errors[[0, -1]] = 0.0 if count == 1 else 2.0 * values[[0, -1]]
        if count > 2:
            errors[[0, -1]] += values[[0, -1]] - values[[1, -2]]
    errors *= 0.5 ** (values.ndim - 1) * _AT_CENTRE[order]
    return np.moveaxis(errors, 0, axis)
