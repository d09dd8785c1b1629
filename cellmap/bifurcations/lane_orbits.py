"""Periodic orbits near many states at once, in SIMD lanes: near returns, Newton's method, derivatives along orbits."""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from .._lib.stopping import check_stop
from ..maps.coordinates import difference, turns_of, wrap
from ..maps.orbit_batch import Orbits
from ..maps.point_map import PointMap
from ..maps.tangent import tangent, tangent_by_lanes

_NEAR = 0.05  # distance from its image, in extents, from which a point is refined
_ALIKE = 0.1  # part by which a longer period has to close an orbit better to be tried in place of a shorter one
_REACH = 0.25  # distance in extents that refinement may move a point
_ITERATIONS = 8
_CONVERGED = 1e-6  # last step of refinement, in extents; it leaves an error of the order of its square
_SAME = 1e-6  # distance, in extents, within which points are equal


def state_tangent(
    swept: PointMap, points: NDArray[np.float64], d: int, periods: int | NDArray[np.int64] = 1
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return unwrapped images (n, d + 2) and their derivatives (n, d, d) by the states, without those by parameters."""
    step, place = _tangent_step(swept), points.copy()
    total = np.broadcast_to(np.eye(d), (len(points), d, d)).copy()
    rounds = np.broadcast_to(periods, len(points))
    for k in range(int(rounds.max(initial=0))):
        check_stop()
        rows = np.flatnonzero(rounds > k)
        wrapped = wrap(place[rows], swept.coordinates)
        images, matrices = (
            tangent(swept, wrapped) if step is None else tangent_by_lanes(step, wrapped, swept.dimension, d)
        )
        place[rows] += images - wrapped
        total[rows] = matrices[:, :d, :d] @ total[rows]
    return place, total


@functools.lru_cache(maxsize=8)
def _tangent_step(swept: PointMap) -> Callable[[Orbits], None] | None:
    """Return a step of states with one tangent vector each; None where the formulas are unknown."""
    return None if swept.spec is None else swept.spec.curve_step(1)


def near_returns(
    swept: PointMap, states: NDArray[np.float64], most: int, extent: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the rows of states that nearly return within some periods, and after how many they do best."""
    d = len(extent)
    orbits = Orbits.starting(states.copy())
    apart = np.full((len(states), most), np.inf)
    for k in range(most):
        swept.advance(orbits, 1)
        shift = np.abs(difference(orbits.points, states, swept.coordinates)[:, :d] / extent).max(axis=-1)
        apart[:, k] = np.where(orbits.alive, shift, np.inf)
    best = np.minimum.accumulate(apart, axis=1)
    period = np.argmax(apart * _ALIKE <= apart.min(axis=1, keepdims=True), axis=1)
    near = np.flatnonzero(np.take_along_axis(best, period[:, None], axis=1)[:, 0] <= _NEAR)
    return near, period[near] + 1


def refined(
    swept: PointMap, states: NDArray[np.float64], period: NDArray[np.int64], extent: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the periodic points beside states (n, d + 2), by Newton's method, and which of them were found."""
    d = len(extent)
    points, good, active = states.copy(), np.zeros(len(states), bool), np.arange(len(states))
    for _ in range(_ITERATIONS):
        if not len(active):
            break
        images, matrices = state_tangent(swept, points[active], d, period[active])
        residual = difference(images, points[active], swept.coordinates)[:, :d]
        slopes = np.eye(d) - matrices
        finite = np.isfinite(residual).all(axis=-1) & np.isfinite(slopes).all(axis=(-2, -1))
        solvable = np.flatnonzero(finite)
        solvable = solvable[np.abs(np.linalg.det(slopes[solvable])) > 1e-12]
        active = active[solvable]
        step = np.linalg.solve(slopes[solvable], residual[solvable][..., None])[..., 0]
        points[active, :d] += step
        close = np.abs((points[active, :d] - states[active, :d]) / extent).max(axis=-1, initial=0.0) <= _REACH
        done = close & (np.abs(step / extent).max(axis=-1, initial=0.0) <= _CONVERGED)
        good[active[done]] = True
        active = active[close & ~done]
    return wrap(points, swept.coordinates), good


def along(
    swept: PointMap, points: NDArray[np.float64], period: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Return orbits (n, most, d + 2), derivatives (n, most, d, d) of each step, and full rotations up to each."""
    n, width = points.shape
    most, d = int(period.max(initial=1)), width - 2
    turn = turns_of(swept.coordinates)[1][:d]
    orbit, matrices = np.empty((n, most, width)), np.empty((n, most, d, d))
    moved, rotations = np.zeros((n, d)), np.empty((n, most, d), np.int64)
    here = points
    for k in range(most):
        orbit[:, k] = here
        images, matrices[:, k] = state_tangent(swept, here, d)
        moved += (images - here)[:, :d]
        rounds = np.where(turn > 0.0, moved / np.where(turn > 0.0, turn, 1.0), 0.0)
        rotations[:, k] = np.round(np.where(np.isfinite(rounds), rounds, 0.0))
        here = wrap(images, swept.coordinates)
    return orbit, matrices, rotations


def least_periods(
    orbit: NDArray[np.float64], period: NDArray[np.int64], extent: NDArray[np.float64], swept: PointMap
) -> NDArray[np.int64]:
    """Return the least periods of closed orbits."""
    least, d = period.copy(), len(extent)
    for q in range(orbit.shape[1] - 1, 0, -1):
        apart = np.abs(difference(orbit[:, q], orbit[:, 0], swept.coordinates)[:, :d] / extent).max(axis=-1)
        least[(period % q == 0) & (q < period) & (apart <= _SAME)] = q
    return least


def monodromy_of(matrices: NDArray[np.float64], period: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the products of the first `period` of matrices (n, most, d, d)."""
    total = np.broadcast_to(np.eye(matrices.shape[-1]), matrices[:, 0].shape)
    for k in range(matrices.shape[1]):
        total = np.where((k < period)[:, None, None], matrices[:, k] @ total, total)
    return total
