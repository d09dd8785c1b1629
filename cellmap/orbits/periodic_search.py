"""Search for periodic orbits in a window, stable and unstable."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from .._lib.arrays import Floats
from .._lib.checks import claim_memory, whole_number
from .._lib.signatures import checked
from .._lib.threads import run_over, slices
from ..maps.coordinates import difference, state_points, turns_of, wrap
from ..maps.grid import CellGrid, check_volume, grid_points
from ..maps.orbit_batch import CHUNK, Orbits
from ..maps.poincare import Section
from ..maps.point_map import PointMap
from ..maps.swept_orbits import SweptOrbits
from ..maps.tangent import tangent
from .newton import ROUNDING, closed_orbit, newton, resolution, solutions
from .orbit_equations import OrbitProblem
from .orbit_kinds import PeriodicOrbit
from .shooting import ShootingProblem

_NEAR = 1.5  # cell widths within which a linear step from a cell's centre has to end
_SEGMENTS = 16  # segments of a step of the map, where it can be divided
_LARGE_GROWTH = 30.0  # growth of deviations in a period above which orbits are looked for in segments as well
_FAR = 0.05  # distance of a solution from its guess, in extents, above which orbits are looked for in segments as well
_STEPS, _FREE_STEPS = 30, 4  # steps across a family of orbits that fill a line; such in which the residual may rise
_ACROSS, _SINGULAR = 0.01, 1e-8  # singular value, relative, of the direction along it beside it, and on it
_SAME = 1e-7  # distance of points of one orbit, relative to the resolution
_BESIDE = 0.01  # distance from a known orbit, in resolutions, within which a solution may be that orbit
_BLURRED = 10.0  # errors of a solution within which two are the same: a residual is known in order of magnitude alone
_STILL = 1e-6  # motion of an equilibrium in an interval of time, in extents: Newton's method blurs it that much
_FOLLOWED, _PERIODS = 32, 64  # cells whose orbits are followed, and for how long


@checked
def periodic_orbit(point_map: PointMap, guess: ArrayLike, period: int = 1) -> PeriodicOrbit:
    """Return the periodic orbit to which a damped Newton method converges from a guess.

    Where deviations grow much in the period, the method is applied to the orbit in segments as well (multiple
    shooting), and the solution nearest to the guess counts; where they do not, but the method ends far from the guess,
    a solution in segments counts if it is near.  Where orbits fill a line, as without damping, the one nearest to the
    guess is found.

    Parameters
    ----------
    point_map : PointMap
        The map; for an interpolated map, the exact map behind it is used.
    guess : array_like, shape (dimension,)
        A state near one of its points, in units of the coordinates.
    period : int, optional
        Period in steps of the map, up to full rotations of angles.

    Returns
    -------
    PeriodicOrbit
        The orbit with its least period, which divides `period`.  Its points are accurate to the tolerance of the
        derivatives (1e-12 or that of the map) times the condition number of the problem.

    Raises
    ------
    ValueError
        If the method does not converge.

    Examples
    --------
    >>> from cellmap import discrete_map
    >>> henon = discrete_map(lambda x, p: (1 - p.a * x[0]**2 + x[1], p.b * x[0]), {"a": 1.4, "b": 0.3}, ("x", "y"))
    >>> periodic_orbit(henon, [0.5, 0.2])
    PeriodicOrbit(flip saddle, period 1, at (0.631354, 0.189406), |multiplier| 1.924)
    """
    state = state_points("guess", guess, point_map.coordinates)
    if state.ndim != 1:
        raise ValueError(f"guess has shape {state.shape}: give one state")
    rounds = whole_number("period", period, at_least=1)
    extent = _extent(point_map, np.ones(point_map.dimension) + np.abs(state))
    found = _from_guess(point_map.without_table, state, rounds, extent)
    apart = np.abs(difference(found, state, point_map.coordinates))
    if not (apart <= _FAR * np.minimum(extent, np.abs(state).max())).all(axis=-1).any():
        found = np.concatenate([found, _of_a_family(point_map.without_table, state, rounds, extent)])
    if not len(found):
        raise ValueError(
            f"guess={state.tolist()}: no orbit of period {rounds} is found from there; give a guess nearer to one, or "
            "search a window with find_periodic_orbits"
        )
    away = _away(point_map, found, state, extent)
    nearest = found[np.argmin(away)]
    if _rests(point_map.without_table, nearest, extent):
        raise ValueError(
            f"guess={state.tolist()}: {nearest.tolist()} is an equilibrium through which the section passes; give a "
            "guess nearer to a cycle, or another section"
        )
    return closed_orbit(point_map, nearest, rounds, extent)


def _from_guess(exact: PointMap, state: Floats, rounds: int, extent: Floats) -> Floats:
    """Return the points (n, d) of orbits that Newton's method finds from a guess, in one segment and in several."""
    points, settled = newton(exact, state[None], np.array([rounds]), extent, np.inf, damped=True)
    growth = float(np.linalg.norm(tangent(exact, state, rounds)[1]))
    single = OrbitProblem(exact, exact, rounds, extent)
    count = next((n for n in (_SEGMENTS, 1) if ShootingProblem.can_divide(single, n)), None)
    tame = settled[0] and growth < _LARGE_GROWTH
    if count is None or (tame and _away(exact, points, state, extent)[0] <= _FAR):
        return points[settled]
    problem = ShootingProblem.of(single, count, state, sized=True)
    # From the nodes of the orbit through the guess, and from nodes that stay there.
    guesses = np.stack([problem.through(state), np.tile(state, problem.nodes) / problem.scale])
    guesses = guesses[np.isfinite(guesses).all(axis=-1)]
    others, _, found = solutions(lambda _, unknowns: problem(unknowns), guesses, np.ones(problem.states), damped=True)
    firsts = wrap((others * problem.scale)[:, : exact.dimension], exact.coordinates)
    # Deviations that grow little at the guess may grow much on an orbit beside it, but hardly on one that is far away.
    found &= not tame or _away(exact, firsts, state, extent) <= _FAR
    return np.concatenate([points[settled], firsts[found]])


def _of_a_family(exact: PointMap, state: Floats, rounds: int, extent: Floats) -> Floats:
    """Return the point (n, d) of a family of orbits nearest a guess, by steps across the family; (0, d) for none.

    Beside a family the derivative is nearly singular, and Newton's steps slide along it, to where it ends.
    """
    d, point, last = exact.dimension, state.copy(), np.inf
    for k in range(_STEPS):
        image, slopes = tangent(exact, point, rounds)
        residual = difference(image, point, exact.coordinates) / extent
        matrix = (slopes - np.eye(d)) * extent / extent[:, None]
        size = float(np.abs(residual).max())
        if not (np.isfinite(matrix).all() and (k < _FREE_STEPS or size < 0.5 * last or size <= ROUNDING)):
            break
        if size <= ROUNDING:
            sizes = np.linalg.svd(matrix, compute_uv=False)
            return point[None] if sizes[-1] <= _SINGULAR * sizes[0] else np.empty((0, d))
        point, last = point - extent * np.linalg.lstsq(matrix, residual, rcond=_ACROSS)[0], size
    return np.empty((0, d))


def _rests(exact: PointMap, point: Floats, extent: Floats) -> bool:
    """Return whether a point of a section is an equilibrium: in an interval of time it would not leave the point."""
    spec = exact.spec
    if not isinstance(spec, Section):
        return False
    names, place = tuple(exact.params)[:1], spec.place
    orbit = SweptOrbits(exact, names, np.array([[exact.params[name] for name in names]]), point[None], 1)
    rates = orbit.rates(np.insert(point, place, spec.section[1])[None, None])[0, 0]
    return bool((np.abs(rates) * spec.system.length <= _STILL * np.insert(extent, place, extent.max())).all())


def _away(point_map: PointMap, points: Floats, guess: Floats, extent: Floats) -> Floats:
    """Return the distances (n,) of points from a guess, in extents."""
    return np.asarray(np.abs(difference(points, guess, point_map.coordinates) / extent).max(axis=-1))


@checked
def find_periodic_orbits(
    point_map: PointMap, region: CellGrid, longest_period: int = 1, progress: bool = False
) -> tuple[PeriodicOrbit, ...]:
    """Find the periodic orbits with a point in a window, stable and unstable.

    The displacement of P^n at the centres of the cells, and its differences between neighbouring cells, give the linear
    step from each centre to the nearest periodic point.  Steps that end near their cell, and cells whose displacement
    is least among all neighbours, are the initial guesses of a damped Newton method on the exact map.  So are the ends
    of some orbits after 64 periods, by which attractors are found in coarse cells too.  Orbits whose points are closer
    than some cells, and those of long periods in chaotic regions, need fine cells.

    Parameters
    ----------
    point_map : PointMap
        The map; an interpolated map makes the search faster, and orbits are still those of its exact map.
    region : CellGrid
        Cells; an orbit counts if one of its points is inside the window.
    longest_period : int, optional
        Longest period.
    progress : bool, optional
        Show progress on a terminal.

    Returns
    -------
    tuple of PeriodicOrbit
        Periodic orbits sorted by period, the most unstable first.

    Raises
    ------
    TypeError, ValueError
        For a window that does not fit the map.
    MemoryError
        If the images of the cells need more memory than is free.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map
    >>> henon = discrete_map(lambda x, p: (1 - p.a * x[0]**2 + x[1], p.b * x[0]), {"a": 1.4, "b": 0.3}, ("x", "y"))
    >>> for orbit in find_periodic_orbits(henon, CellGrid((-2, -1), (2, 1), (40, 40)), longest_period=2):
    ...     print(orbit)
    PeriodicOrbit(saddle, period 1, at (-1.13135, -0.339406), |multiplier| 3.26)
    PeriodicOrbit(flip saddle, period 1, at (0.631354, 0.189406), |multiplier| 1.924)
    PeriodicOrbit(flip saddle, period 2, at (0.9758, -0.14274), |multiplier| 3.01)
    """
    grid = region.on(point_map.coordinates, "region")
    longest = whole_number("longest_period", longest_period, at_least=1)
    d = grid.dimension
    claim_memory(f"images of {grid}", 8 * grid.size * d * (d + 6), "take fewer cells")
    centres = grid_points([grid.axis(j) for j in range(d)], np.arange(grid.size))
    check_volume(grid)
    extent = _extent(point_map, np.array(grid.upper) - np.array(grid.lower))
    orbits = Orbits.starting(wrap(centres, point_map.coordinates))
    known = _Known(point_map, extent)
    label = f"periodic orbits of {point_map.name}" if progress else None
    ends = _ends(point_map, centres)
    for n in range(1, longest + 1):
        run_over(slices(len(orbits), CHUNK), lambda part: point_map.advance(orbits[part], 1), label)
        guesses = np.concatenate([_guesses(point_map, grid, centres, orbits.points), ends])
        rounds = np.full(len(guesses), n)
        for part in slices(len(guesses), CHUNK):
            points, settled = newton(point_map, guesses[part], rounds[part], extent, np.inf, damped=True)
            for solution in points[settled]:
                if not known.has(solution, n) and is_inside(grid, solution):
                    known.add(closed_orbit(point_map, solution, n, extent))
    order = sorted(known.orbits, key=lambda o: (o.period, -o.unstable, *np.round(o.points[0], 6)))
    return tuple(order)


def _ends(point_map: PointMap, centres: Floats) -> Floats:
    """Return where the orbits of some of the cells are after some periods, those that have not ended."""
    some = centres[np.linspace(0, len(centres) - 1, min(_FOLLOWED, len(centres))).astype(int)]
    orbits = Orbits.starting(wrap(some, point_map.coordinates))
    point_map.advance(orbits, _PERIODS)
    return orbits.points[orbits.alive]


class _Known:
    """Orbits found so far, and whether a solution is on one of them."""

    def __init__(self, point_map: PointMap, extent: Floats) -> None:
        self.orbits: list[PeriodicOrbit] = []
        self._exact, self._coordinates, self._extent = point_map.without_table, point_map.coordinates, extent
        self._points = np.empty((0, point_map.dimension))

    def has(self, point: Floats, period: int) -> bool:
        """Return whether a solution for some period is on a known orbit, as far as its accuracy can tell.

        At a bifurcation, where several solutions are one, Newton's method ends anywhere near them.
        """
        scale = resolution(point, self._extent)
        apart = np.abs(difference(self._points, point, self._coordinates)) / scale
        if (apart <= _SAME).all(axis=-1).any():
            return True
        apart = apart[(apart <= _BESIDE).all(axis=-1)]
        if not len(apart):
            return False
        image, slopes = tangent(self._exact, point, period)
        residual = np.abs(difference(image, point, self._coordinates)) / scale + ROUNDING
        regular = np.linalg.svd((slopes - np.eye(len(point))) / scale[:, None] * scale, compute_uv=False)[-1]
        return bool((np.linalg.norm(apart, axis=-1) * regular <= _BLURRED * np.linalg.norm(residual)).any())

    def add(self, orbit: PeriodicOrbit) -> None:
        self.orbits.append(orbit)
        self._points = np.concatenate([self._points, orbit.points])


def _extent(point_map: PointMap, span: Floats) -> Floats:
    turn = turns_of(point_map.coordinates)[1]
    return np.where(turn > 0, turn, span)


def is_inside(grid: CellGrid, point: Floats) -> bool:
    """Return whether a point (d,) is in a window, or on its border."""
    lower, upper = np.array(grid.lower), np.array(grid.upper)
    slack = 1e-9 * (upper - lower)
    wraps = np.array(grid.wraps)
    return bool((wraps | ((point >= lower - slack) & (point <= upper + slack))).all())


def _guesses(point_map: PointMap, grid: CellGrid, centres: Floats, images: Floats) -> Floats:
    """Return places near which P^n(x) = x, from the images of the centres of all cells."""
    d, shape = grid.dimension, (*grid.shape, grid.dimension)
    widths = np.asarray(grid.widths, dtype=float)
    moved = difference(images, centres, point_map.coordinates).reshape(shape)
    slopes = np.stack([_differences(moved, j, grid, point_map) / widths[j] for j in range(d)], axis=-1)
    finite = np.isfinite(slopes).all(axis=(-2, -1)) & np.isfinite(moved).all(axis=-1)
    safe = np.where(finite[..., None, None], slopes, np.eye(d))
    regular = finite & (np.abs(np.linalg.det(safe)) > 1e-12)
    safe = np.where(regular[..., None, None], safe, np.eye(d))
    step = -np.linalg.solve(safe, np.where(regular[..., None], moved, np.inf)[..., None])[..., 0]
    with np.errstate(invalid="ignore"):
        close = regular & (np.abs(step) <= _NEAR * widths).all(axis=-1)
        size = np.where(np.isfinite(moved).all(axis=-1), np.abs(moved / widths).max(axis=-1), np.inf)
    least = np.isfinite(size)
    for offset in product((-1, 0, 1), repeat=d):
        if any(offset):
            least &= size <= _neighbour(size, offset, grid)
    flat = close.ravel()
    return np.concatenate([centres[flat] + step.reshape(-1, d)[flat], centres[least.ravel() & ~flat]])


def _differences(moved: Floats, axis: int, grid: CellGrid, point_map: PointMap) -> Floats:
    """Return central differences along an axis for one cell, one-sided at the ends of an interval."""
    ahead = difference(np.roll(moved, -1, axis), moved, point_map.coordinates)
    behind = np.roll(ahead, 1, axis)
    if not grid.wraps[axis]:
        first, last = ((slice(None),) * axis + (k,) for k in (0, -1))
        ahead[last] = behind[last]
        behind[first] = ahead[first]
    return 0.5 * (ahead + behind)


def _neighbour(size: Floats, offset: tuple[int, ...], grid: CellGrid) -> Floats:
    """Return for each cell the value of its neighbour, infinity beyond the window."""
    moved = size
    for axis, k in enumerate(offset):
        if k:
            moved = np.roll(moved, k, axis)
            if not grid.wraps[axis]:
                moved[(slice(None),) * axis + (0 if k > 0 else -1,)] = np.inf
    return moved
