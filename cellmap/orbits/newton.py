"""Newton's method for periodic points of the exact map, and the orbits through them."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from .._lib.arrays import Bools, Floats, Ints
from .._lib.stopping import check_stop
from ..maps.coordinates import difference, turns_of, wrap
from ..maps.grazing import grazing_distance
from ..maps.orbit_batch import Orbits
from ..maps.point_map import PointMap
from ..maps.side_by_side import advance_on_threads
from ..maps.tangent import tangent
from .attractor import Attractor, Kind
from .multipliers import multipliers_of
from .orbit_kinds import PeriodicOrbit

_ITERATIONS = 60
_FREE_ITERATIONS = 4  # steps in which the residual may rise
_SMALLEST_FRACTION = 1e-3  # fraction of a step below which a damped iteration is given up
_LONGEST = 0.25  # damped step, in extents
_SMALL = 1e-8  # step that may be the last one, if the next would be rounding
_STALLED = 1e-7  # a step below this that no longer shrinks is rounding error
_RESIDUAL, _AMPLIFIED = 1e-7, 1e-10  # residual of a solution, and the same in units of the largest derivative
_SHRINKING = 0.75  # ratio of steps: those to a double solution get shorter by half, to a triple one by a third
_ROUNDING = 1e-15
_SINGULAR = 1e-14  # determinant
_STABLE = 1.0 - 1e-8
_UNSTABLE = 1.0 + 1e-3  # largest multiplier from which the derivative of Newton's last step proves a point unstable
_CHORD = 1e-5  # way, as a part of the resolution, on which a derivative is kept
_FEW = 4  # dimensions up to which all derivatives cost little more than an image
_HOPELESS = 1e6  # derivative above which Newton's method is not tried: the guess is in the midst of chaos

ROUNDING = 4e-15
"""Residual that is rounding, in units of the resolution."""

Equations = Callable[[Ints, Floats], tuple[Floats, Floats]]
"""Returns the residuals (m, d) of some rows (m,) at points (m, d), and their derivatives (m, d, d)."""


class Solutions(NamedTuple):
    """Points (n, d), the derivatives (n, d, d) at the last point before each, and which of them are solutions (n,)."""

    points: Floats
    slopes: Floats
    settled: Bools


def solutions(
    equations: Equations, guesses: Floats, extent: Floats, reach: float | Floats = np.inf, damped: bool = False
) -> Solutions:
    """Solve d equations in d unknowns from guesses (n, d) by Newton's method, each until its steps stop falling.

    A solution farther than `reach` from its guess does not count.  A guess from which the residual does not keep
    falling after the first steps is given up.  Where guesses may be far away, steps are `damped`: halved until the next
    one, foreseen with the old derivative, is shorter, so that saddles are found from as far as other orbits (the
    natural monotonicity test of Deuflhard, *Newton Methods for Nonlinear Problems* (2004), 3.3), and never longer than
    a quarter of the extent.
    """
    base, points = np.array(guesses, dtype=float), np.array(guesses, dtype=float)
    n, d = base.shape
    steps, slopes, fraction = np.full((n, d), np.inf), np.tile(np.eye(d), (n, 1, 1)), np.ones(n)
    sizes, lengths = np.full(n, np.inf), np.full(n, np.inf)
    solved, settled = np.zeros(n, bool), np.zeros(n, bool)
    active = np.flatnonzero(np.isfinite(base).all(axis=-1))
    for iteration in range(_ITERATIONS):
        if not len(active):
            break
        residual, there = equations(active, points[active])
        scale = resolution(points[active], extent)
        size = np.abs(residual / scale).max(axis=-1, initial=0.0)
        finite = np.isfinite(size) & np.isfinite(there).all(axis=(-2, -1))
        with np.errstate(all="ignore"):
            singular = np.abs(np.linalg.det(there)) <= _SINGULAR
            # A solution at which another one is born, or one of a family, has no next step, and needs none.
            closed = finite & (size <= np.where(singular, _AMPLIFIED, ROUNDING))
            if damped:
                foreseen = np.linalg.solve(slopes[active], residual[..., None])[..., 0]
                before = np.linalg.norm(steps[active] / extent, axis=-1)
                falls = np.linalg.norm(foreseen / extent, axis=-1) <= (1.0 - 0.25 * fraction[active]) * before
            else:
                falls = (iteration < _FREE_ITERATIONS) | (size < 0.5 * sizes[active]) | (size < 1e-9)
        taken = finite & falls & ~closed
        regular = taken & ~singular
        settled[active[closed]] = True
        slopes[active[closed | regular]] = there[closed | regular]
        again = active[~taken & ~closed] if damped else active[:0]
        if len(again):
            fraction[again] *= 0.5
            shorter = np.where(np.isfinite(steps[again]), steps[again], np.nan)
            points[again] = base[again] + fraction[again, None] * shorter
            hopeful = (fraction[again] > _SMALLEST_FRACTION) & np.isfinite(points[again]).all(axis=-1)
            again, ended = again[hopeful], again[~hopeful]
            points[ended], settled[ended] = base[ended], solved[ended] & (lengths[ended] <= _STALLED)
        rows = active[regular]
        if len(rows) < len(active):
            residual, there, scale, size = residual[regular], there[regular], scale[regular], size[regular]
        step = np.linalg.solve(there, -residual[..., None])[..., 0]
        length, last = np.abs(step / scale).max(axis=-1, initial=0.0), lengths[rows]
        # Where derivatives are large, a short step may still be far from a solution.
        solved[rows] = size <= _RESIDUAL + _AMPLIFIED * np.abs(there).max(axis=(-2, -1), initial=0.0)
        stalled = solved[rows] & (last <= _STALLED) & (length > _SHRINKING * last)
        done = stalled | (solved[rows] & _is_last(length, last)) | (length <= _ROUNDING)
        if damped:
            longest = np.abs(step / extent).max(axis=-1, initial=0.0)
            longest = np.minimum(np.minimum(1.0, 2.0 * fraction[rows]), _LONGEST / np.maximum(longest, 1e-300))
            fraction[rows] = np.where(done, 1.0, longest)
        base[rows], steps[rows], lengths[rows], sizes[rows] = points[rows], step, length, size
        points[rows] += np.where(stalled, 0.0, fraction[rows])[:, None] * step
        near = (np.abs(points[rows] - guesses[rows]) <= reach).all(axis=-1)
        settled[rows[done]] = near[done]
        active = rows[near & ~done]
        if len(again):
            active = np.sort(np.concatenate([again, active]))
    return Solutions(points, slopes, settled)


def _is_last(lengths: Floats, before: Floats) -> Bools:
    """Return where the next step would be rounding, by quadratic convergence, from the lengths of the last two.

    Close to a fold, or to a critical point of the map, convergence is quadratic only at the very end.
    """
    with np.errstate(invalid="ignore"):
        ratio = np.where(np.isfinite(before), lengths / np.maximum(before, 1e-300), 1.0)
    return np.asarray((lengths <= _SMALL) & (lengths * ratio**2 <= _ROUNDING))


def newton(
    point_map: PointMap,
    guesses: Floats,
    periods: Ints,
    extent: Floats,
    reach: float = 0.5,
    attracting: bool = False,
    damped: bool = False,
) -> tuple[Floats, Bools]:
    """Solve P^period(x) = x, up to full rotations of angles, from guesses (n, d), each for its period.

    Coordinates (n, d + m) beyond those that have an extent (d,) are parameters, and held.  A solution farther than
    `reach` from its guess, in units of the extent of the region, does not count; if `attracting`, nor does one that is
    unstable beyond doubt, and guesses that are too unstable to be close to others are left out.  Unless steps are
    `damped`, see :func:`solutions`, nor does one that is not isolated.

    Returns solutions (n, d + m) of the exact map, wrapped, and which of them converged.
    """
    exact, d = point_map.without_table, len(extent)
    held, identity, first = guesses[:, d:], np.eye(d), attracting
    derivatives = _Derivatives(exact, len(guesses), d, extent)

    def equations(rows: Ints, points: Floats) -> tuple[Floats, Floats]:
        nonlocal first
        places = np.concatenate([points, held[rows]], axis=-1)
        images, matrices = derivatives.at(rows, places, periods[rows])
        residual = difference(images, places, exact.coordinates)[:, :d]
        if first:
            finite = np.asarray(np.isfinite(matrices).all(axis=(-2, -1)))
            residual[_largest_multiplier(np.where(finite[:, None, None], matrices, 0.0)) > _HOPELESS] = np.nan
            first = False
        return residual, matrices - identity

    turn = turns_of(exact.coordinates)[1][:d]
    # Nothing is farther away along an angle than half of its period.
    away = np.where((turn > 0.0) & (reach * extent >= 0.5 * turn), np.inf, reach * extent)
    points, slopes, settled = solutions(equations, guesses[:, :d], extent, away, damped)
    if not damped:
        settled &= np.abs(np.linalg.det(slopes)) > _SINGULAR
    if attracting:
        settled[settled] = ~(_largest_multiplier(slopes[settled] + identity) > _UNSTABLE)
    return wrap(np.concatenate([points, held], axis=-1), exact.coordinates), settled


class _Derivatives:
    """Images of points and derivatives there, which in many dimensions are kept as long as a point hardly moves."""

    def __init__(self, exact: PointMap, number: int, d: int, extent: Floats) -> None:
        self.exact, self.d, self.extent = exact, d, extent
        kept = number if d > _FEW else 0
        self.points, self.matrices = np.full((kept, d), np.nan), np.zeros((kept, d, d))

    def at(self, rows: Ints, places: Floats, periods: Ints) -> tuple[Floats, Floats]:
        """Return unwrapped images (m, d) of places of some rows, and derivatives (m, d, d)."""
        if self.d <= _FEW:
            return tangent(self.exact, places, periods, self.d)
        points = places[:, : self.d]
        moved = np.abs(points - self.points[rows]) / resolution(points, self.extent)
        near = (moved <= _CHORD).all(axis=-1)
        images = np.empty(places.shape)
        if near.any():  # one direction is enough
            images[near] = tangent(self.exact, places[near], periods[near], 1)[0]
        if not near.all():
            images[~near], self.matrices[rows[~near]] = _thrifty(self.exact, places[~near], periods[~near], self.d)
            self.points[rows[~near]] = points[~near]
        return images, self.matrices[rows]


def _thrifty(exact: PointMap, places: Floats, periods: int | Ints, d: int) -> tuple[Floats, Floats]:
    """Return unwrapped images (n, d + m) and derivatives (n, d, d), in many dimensions to the tolerance of the map.

    Images have that of Newton's method, for which a vector costs several of the map's own.
    """
    if d <= _FEW or exact.coarse_tangent is None or d < exact.dimension:
        return tangent(exact, places, periods, d)
    return tangent(exact, places, periods, 1)[0], tangent(exact, places, periods, coarse=True)[1]


def _largest_multiplier(matrices: Floats) -> Floats:
    return np.asarray(np.abs(np.linalg.eigvals(matrices)).max(axis=-1, initial=0.0))


def resolution(points: Floats, extent: Floats) -> Floats:
    """Size against which differences of points count as small: their own, or 1, or that of a smaller region."""
    return np.asarray(np.abs(points) + np.minimum(extent, 1.0))


def return_distances(point_map: PointMap, states: Floats, most: int, extent: Floats) -> Floats:
    """Return the distance of states (n, d + m) from their images after 1, ..., `most` periods, shape (most, n).

    Coordinates beyond those that have an extent (d,) are not looked at; orbits that end are infinitely far away.
    """
    orbits, distance = Orbits.starting(states.copy()), np.full((most, len(states)), np.inf)
    for q in range(most):
        check_stop()
        advance_on_threads(point_map.advance, orbits, 1)
        shift = difference(orbits.points, states, point_map.coordinates)[:, : len(extent)] / extent
        distance[q] = np.where(orbits.alive, np.abs(shift).max(axis=-1), np.inf)
    return distance


def followed(exact: PointMap, points: Floats, periods: Ints, d: int) -> tuple[Floats, Floats, Ints]:
    """Return orbits (n, most, d + m), derivatives (n, most, d, d) of each step, and full rotations up to each.

    ``points`` (n, d + m) are their first points, which move by the periods; m parameters are held.
    """
    n, width = points.shape
    most = int(periods.max(initial=1))
    turn = turns_of(exact.coordinates)[1][:d]
    orbit, matrices = np.empty((n, most, width)), np.empty((n, most, d, d))
    moved, rotations = np.zeros((n, d)), np.empty((n, most, d), np.int64)
    here = points
    for k in range(most):
        orbit[:, k] = here
        images, matrices[:, k] = _thrifty(exact, here, 1, d)
        moved += (images - here)[:, :d]
        rounds = np.where(turn > 0.0, moved / np.where(turn > 0.0, turn, 1.0), 0.0)
        rotations[:, k] = np.round(np.where(np.isfinite(rounds), rounds, 0.0))
        here = wrap(images, exact.coordinates)
    return orbit, matrices, rotations


def least_periods(exact: PointMap, orbit: Floats, periods: Ints, same: Floats) -> Ints:
    """Return the least periods (n,) of closed orbits (n, most, d + m), whose points are one within lengths (..., d)."""
    least = periods.copy()
    for q in range(orbit.shape[1] - 1, 0, -1):
        whole = (periods % q == 0) & (q < periods)
        if whole.any():
            apart = np.abs(difference(orbit[:, q], orbit[:, 0], exact.coordinates)[:, : same.shape[-1]])
            least[whole & (apart <= same).all(axis=-1)] = q
    return least


def closed_orbit(point_map: PointMap, point: Floats, period: int, extent: Floats) -> PeriodicOrbit:
    """Return the orbit through a periodic point, with its least period, begun at its point nearest the origin."""
    exact, rounds = point_map.without_table, np.array([period])
    orbit, steps, turned = followed(exact, np.array(point[None], dtype=float), rounds, exact.dimension)
    period = int(least_periods(exact, orbit, rounds, 1e-8 * resolution(orbit[:, 0], extent))[0])
    points, matrices, rotations = orbit[0, :period], steps[0, :period], tuple(turned[0, period - 1].tolist())
    # Rounding must not decide on which side of its cut an angle lies.
    for j, c in enumerate(exact.coordinates):
        if c.period is not None and c.lower is not None:
            points[points[:, j] > c.lower + c.period * (1.0 - 1e-12), j] = c.lower
    # Mirror images are equally far away; the largest coordinates decide between them.
    size = np.abs(points).max(axis=0)
    scale = np.where(size > 0, size, 1.0)
    rounded = np.round(points / scale, 6)
    first = int(np.lexsort((*-rounded.T[::-1], np.round(np.linalg.norm(points / scale, axis=-1), 6)))[0])
    points, matrices = np.roll(points, -first, axis=0), np.roll(matrices, -first, axis=0)
    matrix = functools.reduce(np.matmul, matrices[::-1])
    multipliers, grazing = multipliers_of(matrix), float(grazing_distance(exact, points).min())
    return PeriodicOrbit(period, points, rotations, matrix, multipliers, exact.coordinates, exact.params, grazing)


def stable_orbit(point_map: PointMap, point: Floats, period: int, extent: Floats) -> Attractor | None:
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
