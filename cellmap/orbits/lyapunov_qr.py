"""QR iteration of orthonormal frames along many orbits, for Lyapunov exponents."""

from __future__ import annotations

import numpy as np

from .._lib.arrays import Bools, Floats
from .._lib.threads import run_over, slices
from ..maps.orbit_batch import CHUNK
from ..maps.point_map import PointMap
from ..maps.tangent import NotDifferentiableError, tangent

BLOCKS = 10
"""Stretches of an orbit whose means tell the standard error."""


def is_positive(largest: Floats, errors: Floats, periods: float = 1e3) -> Bools:
    """Tell which largest exponents are evidence of chaos: above five standard errors, and 1e-3 per step.

    What is from more than 1,000 periods may be as small as growth by a factor e over all of them.
    """
    return np.asarray(largest > np.maximum(5.0 * errors, 1.0 / max(periods, 1e3)))


def exponents_along(matrices: Floats) -> tuple[Floats, Floats]:
    """Return exponents (n, d) per step of orbits, the largest first, and their standard errors (n, d), by QR factors.

    ``matrices`` (n, steps, d, d) are the derivatives of at least 20 steps, of which the first tenth is
    left out while frames align.  The errors are those of the means over
    stretches of the orbit (Benettin, Galgani, Giorgilli, Strelcyn 1980; Eckmann, Ruelle 1985).  NaN where a derivative
    is not finite.

    Examples
    --------
    >>> exponents, errors = exponents_along(np.tile(np.diag([2.0, 0.5]), (1, 20, 1, 1)))
    >>> exponents / np.log(2.0)
    array([[ 1., -1.]])
    """
    logs = stretching(matrices)
    steps, n, d = logs.shape
    length = steps // BLOCKS
    used = logs[steps - (BLOCKS - 1) * length :]
    with np.errstate(invalid="ignore"):  # a vanishing derivative has an infinite logarithm
        means = used.reshape(BLOCKS - 1, length, n, d).mean(axis=1)
        errors = means.std(axis=0, ddof=1) / np.sqrt(BLOCKS - 1.0)
    exponents = means.mean(axis=0)
    order = np.argsort(-exponents, axis=-1, kind="stable")
    return np.take_along_axis(exponents, order, axis=-1), np.take_along_axis(errors, order, axis=-1)


def stretching(matrices: Floats) -> Floats:
    """Return the logarithms (steps, n, d) by which each step stretches frames that are carried along and kept square.

    ``matrices`` (n, steps, d, d) are the derivatives; NaN for an orbit of which one is not finite.
    """
    n, steps, d, _ = matrices.shape
    frame = np.broadcast_to(np.eye(d), (n, d, d)).copy()
    known = np.asarray(np.isfinite(matrices).all(axis=(1, 2, 3)))
    logs = np.empty((steps, n, d))
    for k in range(steps):
        step = np.where(known[:, None, None], matrices[:, k], np.eye(d))
        frame, upper = np.linalg.qr(step @ frame)
        with np.errstate(divide="ignore"):
            logs[k] = np.log(np.abs(np.diagonal(upper, axis1=-2, axis2=-1)))
    logs[:, ~known] = np.nan
    return logs


def exponents_of_cycles(matrices: Floats) -> Floats:
    """Return the exponents (n, d) per step of periodic orbits, the largest first, from their multipliers.

    ``matrices`` (n, period, d, d) are the derivatives of the steps of one period of the cycle.  Minus infinity for a
    multiplier 0, NaN where a derivative is not finite.

    Examples
    --------
    >>> exponents_of_cycles(np.array([[[[0.5]], [[-0.25]]]])) / np.log(2.0)
    array([[-1.5]])
    """
    n, period, d, _ = matrices.shape
    known = np.asarray(np.isfinite(matrices).all(axis=(1, 2, 3)))
    total = np.broadcast_to(np.eye(d), (n, d, d))
    volume = np.zeros(n)
    for k in range(period):
        step = np.where(known[:, None, None], matrices[:, k], np.eye(d))
        total = step @ total
        volume += np.linalg.slogdet(step)[1]
    with np.errstate(divide="ignore"):
        logs = -np.sort(-np.log(np.abs(np.linalg.eigvals(total))), axis=-1)
    # Rounding of the large multipliers drowns the smallest one; the determinants know it.
    with np.errstate(invalid="ignore"):
        logs[:, -1] = np.where(np.isfinite(volume), volume - logs[:, :-1].sum(axis=-1), -np.inf)
    logs[~known] = np.nan
    return -np.sort(-logs / period, axis=-1)


def swept_derivatives(exact: PointMap, swept: PointMap, name: str, points: Floats, values: Floats) -> Floats:
    """Return the derivatives of one step (m, d, d) at points (m, d), each for its own value of the parameter."""
    d = exact.dimension
    matrices = np.empty((len(points), d, d))
    moving = swept.tangent
    if moving is not None:
        states = np.column_stack([points, values])

        def work(part: slice) -> None:
            matrices[part] = moving(states[part])[1][:, :d, :d]

        try:
            run_over(slices(len(points), CHUNK // 16), work)
            return matrices
        except NotDifferentiableError:
            pass
    for value in np.unique(values):
        mine = values == value
        matrices[mine] = tangent(exact.with_params(**{name: float(value)}), points[mine])[1]
    return matrices
