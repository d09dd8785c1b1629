"""Newton's method for periodic points of the exact map."""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..maps.coordinates import difference, wrap
from ..maps.grazing import grazing_distance
from ..maps.point_map import PointMap
from ..maps.tangent import tangent
from .attractor import Attractor, Kind
from .multipliers import multipliers_of
from .orbit_kinds import PeriodicOrbit

_ITERATIONS = 25
_FREE_ITERATIONS = 4  # steps in which the residual may rise
_DAMPED_ITERATIONS = 60
_SMALLEST_FRACTION = 1e-3  # of a step, below which there is no hope
_SMALL = 1e-8  # step that may be the last one, if the next would be rounding;
_STALLED = 1e-7  # steps below this that do not get shorter are what the errors of images leave,
_PATIENCE = 4  # if so many of them follow one another
_ROUNDING = 1e-15
_STABLE = 1.0 - 1e-8
_UNSTABLE = 1.0 + 1e-3  # largest multiplier from which the derivative of Newton's last step proves a point unstable
_HOPELESS = 1e6  # and from which a guess is in the midst of chaos, and no attracting point is close


def newton(
    point_map: PointMap,
    guesses: NDArray[np.float64],
    periods: NDArray[np.int64],
    extent: NDArray[np.float64],
    reach: float = 0.5,
    attracting: bool = False,
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Solve P^period(x) = x, up to full rotations of angles, from guesses (n, d), each for its period.

    A guess from which the residual does not keep falling after the first steps is given up.  A solution farther than
    `reach` from its guess, in units of the extent of the region, does not count; if `attracting`, nor does one that is
    unstable beyond doubt, and guesses that are too unstable to be close to others are left out.

    Returns solutions (n, d) of the exact map, wrapped, and which of them converged.
    """
    exact = point_map.without_table
    points = np.array(guesses, dtype=float)
    settled = np.zeros(len(points), bool)
    active = np.arange(len(points))
    last, before, stalled = np.full(len(points), np.inf), np.full(len(points), np.inf), np.zeros(len(points), np.int64)
    identity = np.eye(exact.dimension)
    for iteration in range(_ITERATIONS):
        if not len(active):
            break
        images, matrices = tangent(exact, points[active], periods[active])
        residual = difference(images, points[active], exact.coordinates)
        scale = resolution(points[active], extent)
        size = np.abs(residual / scale).max(axis=-1)
        with np.errstate(invalid="ignore"):
            usable = np.isfinite(size) & np.isfinite(matrices).all(axis=(-2, -1))
            usable &= (iteration < _FREE_ITERATIONS) | (size < 0.5 * last[active]) | (size < 1e-9)
            if attracting and iteration == 0:
                usable &= ~(_largest_multiplier(np.where(usable[:, None, None], matrices, 0.0)) > _HOPELESS)
            usable &= np.abs(np.linalg.det(np.where(usable[:, None, None], matrices, 0.0) - identity)) > 1e-14
        last[active] = size
        active, residual, matrices, scale = active[usable], residual[usable], matrices[usable], scale[usable]
        step = np.linalg.solve(matrices - identity, -residual[..., None])[..., 0]
        points[active] += step
        near = (np.abs(difference(points[active], guesses[active], exact.coordinates)) <= reach * extent).all(axis=-1)
        length = np.abs(step / scale).max(axis=-1, initial=0.0)
        stalls = (before[active] <= _STALLED) & (length > 0.5 * before[active])
        stalled[active] = np.where(stalls, stalled[active] + 1, 0)
        done = near & (have_settled(length, before[active]) | (stalled[active] >= _PATIENCE))
        before[active] = length
        settled[active[done]] = ~(attracting & (_largest_multiplier(matrices[done]) > _UNSTABLE))
        active = active[near & ~done]
    return wrap(points, exact.coordinates), settled


def have_settled(lengths: NDArray[np.float64], before: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return where Newton's method has come to its end, from the lengths (n,) of its last steps and of those before.

    The last step is rounding, or the next would be, by quadratic convergence.  Close to a fold, or to a critical point
    of the map, convergence is quadratic only at the very end.
    """
    with np.errstate(invalid="ignore"):
        ratio = np.where(np.isfinite(before), lengths / np.maximum(before, 1e-300), 1.0)
    foreseen = (lengths <= _SMALL) & (lengths * ratio**2 <= _ROUNDING)
    return np.asarray(foreseen | (lengths <= _ROUNDING))


def _largest_multiplier(matrices: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.abs(np.linalg.eigvals(matrices)).max(axis=-1))


def resolution(points: NDArray[np.float64], extent: NDArray[np.float64]) -> NDArray[np.float64]:
    """Size against which differences of points count as small: their own, or 1, or that of a smaller region."""
    return np.asarray(np.abs(points) + np.minimum(extent, 1.0))


def damped_newton(
    point_map: PointMap,
    guesses: NDArray[np.float64],
    periods: NDArray[np.int64],
    extent: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Solve P^period(x) = x, up to full rotations of angles, from guesses (n, d) that may be far away.

    No step is longer than a quarter of the extent of the region.  Returns what :func:`newton` returns.
    """
    exact = point_map.without_table
    identity = np.eye(exact.dimension)

    def system(rows: NDArray[np.int64], points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        images, matrices = tangent(exact, points, periods[rows])
        return difference(images, points, exact.coordinates), matrices - identity

    points, settled = damped_solutions(system, guesses, extent)
    return wrap(points, exact.coordinates), settled


def damped_solutions(
    system: Callable[[NDArray[np.int64], NDArray[np.float64]], tuple[NDArray[np.float64], NDArray[np.float64]]],
    guesses: NDArray[np.float64],
    extent: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Solve d equations in d unknowns from guesses (n, d) that may be far away, by a damped Newton method.

    `system` returns the residuals (m, d) of some rows at points (m, d), and their derivatives (m, d, d).  A step is
    halved until the next one, foreseen with the old derivative, is shorter, so that saddles are found from as far as
    other orbits: the natural monotonicity test of Deuflhard, *Newton Methods for Nonlinear Problems* (2004), 3.3.  No
    step is longer than a quarter of the extent.  Returns solutions (n, d) and which of them converged.
    """
    base, points = np.array(guesses, dtype=float), np.array(guesses, dtype=float)
    d = base.shape[-1]
    steps, inverses = np.full(base.shape, np.inf), np.zeros((len(base), d, d))
    fraction = np.ones(len(base))
    settled = np.zeros(len(base), bool)
    active = np.arange(len(base))
    for _ in range(_DAMPED_ITERATIONS):
        if not len(active):
            break
        residual, slopes = system(active, points[active])
        finite = np.isfinite(residual).all(axis=-1) & np.isfinite(slopes).all(axis=(-2, -1))
        with np.errstate(all="ignore"):
            foreseen = np.einsum("nij,nj->ni", inverses[active], residual) / extent
            length = np.linalg.norm(steps[active] / extent, axis=-1)
            shorter = np.linalg.norm(foreseen, axis=-1) <= (1.0 - 0.25 * fraction[active]) * length
        # A solution at which another one is born has no next step, and needs none.
        closed = finite & (np.abs(residual) <= 4e-15 * resolution(points[active], extent)).all(axis=-1)
        settled[active[closed]] = True
        taken = finite & shorter & ~closed
        again = active[~taken & ~closed]
        fraction[again] *= 0.5
        points[again] = base[again] + fraction[again, None] * np.where(np.isfinite(steps[again]), steps[again], np.nan)
        accepted, slopes = active[taken], -slopes[taken]
        solvable = np.abs(np.linalg.det(slopes)) > 1e-14
        accepted, slopes, residual = accepted[solvable], slopes[solvable], residual[taken][solvable]
        inverses[accepted] = np.linalg.inv(slopes)
        step = np.einsum("nij,nj->ni", inverses[accepted], residual)
        scale = resolution(points[accepted], extent)
        lengths, before = (np.abs(v / scale).max(axis=-1, initial=0.0) for v in (step, steps[accepted]))
        longest = np.abs(step / extent).max(axis=-1, initial=0.0)
        base[accepted], steps[accepted] = points[accepted], step
        fraction[accepted] = np.minimum(np.minimum(1.0, 2.0 * fraction[accepted]), 0.25 / np.maximum(longest, 1e-300))
        done = have_settled(lengths, before)
        fraction[accepted[done]] = 1.0
        points[accepted] = base[accepted] + fraction[accepted, None] * step
        settled[accepted[done]] = True
        hopeful = (fraction[again] > _SMALLEST_FRACTION) & np.isfinite(points[again]).all(axis=-1)
        trying, ended = again[hopeful], again[~hopeful]
        points[ended] = base[ended]
        settled[ended] = (np.abs(steps[ended]) <= _STALLED * resolution(base[ended], extent)).all(axis=-1)
        active = np.sort(np.concatenate([trying, accepted[~done]]))
    return points, settled


def closed_orbit(
    point_map: PointMap, point: NDArray[np.float64], period: int, extent: NDArray[np.float64]
) -> PeriodicOrbit:
    """Return the orbit through a periodic point, with its least period, begun at its point nearest the origin."""
    exact = point_map.without_table
    points, rotations, matrices = _follow(exact, point, period)
    same = 1e-8 * resolution(points[0], extent)
    for q in range(1, period):
        if period % q == 0 and (np.abs(difference(points[q], points[0], exact.coordinates)) <= same).all():
            points, rotations, matrices = _follow(exact, point, q)
            period = q
            break
    # Mirror images are equally far away; the largest coordinates decide between them.
    size = np.abs(points).max(axis=0)
    scale = np.where(size > 0, size, 1.0)
    rounded = np.round(points / scale, 6)
    first = int(np.lexsort((*-rounded.T[::-1], np.round(np.linalg.norm(points / scale, axis=-1), 6)))[0])
    points, matrices = np.roll(points, -first, axis=0), np.roll(matrices, -first, axis=0)
    matrix = functools.reduce(np.matmul, matrices[::-1])
    multipliers, grazing = multipliers_of(matrix), float(grazing_distance(exact, points).min())
    return PeriodicOrbit(period, points, rotations, matrix, multipliers, exact.coordinates, exact.params, grazing)


def stable_orbit(
    point_map: PointMap, point: NDArray[np.float64], period: int, extent: NDArray[np.float64]
) -> Attractor | None:
    """Return the attractor through a periodic point; None where its multipliers do not prove it stable."""
    orbit = closed_orbit(point_map, point, period, extent)
    if not np.abs(orbit.multipliers[0]) < _STABLE:
        return None
    kind = Kind.ROTATING if any(orbit.rotations) else Kind.FIXED_POINT if orbit.period == 1 else Kind.PERIODIC
    with np.errstate(divide="ignore"):
        exponents = np.log(np.abs(orbit.multipliers)) / orbit.period
    return Attractor(
        kind, orbit.period, orbit.points, orbit.rotations, orbit.multipliers, exponents, orbit.coordinates,
        grazing_distance=orbit.grazing_distance,
    )  # fmt: skip


def _follow(
    exact: PointMap, point: NDArray[np.float64], period: int
) -> tuple[NDArray[np.float64], tuple[int, ...], NDArray[np.float64]]:
    """Return the wrapped points of a closed orbit, its full rotations, and the derivative of each step."""
    points = np.empty((period, exact.dimension))
    matrices = np.empty((period, exact.dimension, exact.dimension))
    place, total = np.array(point, dtype=float), np.zeros(exact.dimension)
    for k in range(period):
        points[k] = place
        image, matrices[k] = tangent(exact, place)
        total += image - place
        place = wrap(image, exact.coordinates)
    # Rounding must not decide on which side of its cut an angle lies.
    for j, c in enumerate(exact.coordinates):
        if c.period is not None and c.lower is not None:
            points[points[:, j] > c.lower + c.period * (1.0 - 1e-12), j] = c.lower
    rotations = tuple(round(t / c.period) if c.period else 0 for t, c in zip(total, exact.coordinates, strict=True))
    return points, rotations, matrices
