"""Homoclinic and heteroclinic orbits: intersections of the unstable manifold of a saddle with a stable manifold."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from math import ceil, lcm, log

import numpy as np

from .._lib.arrays import Floats, Ints
from .._lib.checks import finite_number, warn_caller, whole_number
from .._lib.signatures import checked
from ..maps.coordinates import Coordinate, difference, turns_of, wrap
from ..maps.orbit_batch import Orbits
from ..maps.parameters_as_states import swept_map
from ..maps.point_map import PointMap
from ..maps.tangent import tangent
from ..orbits.arclength import corrected
from ..orbits.orbit_kinds import PeriodicOrbit
from .connecting_problem import ConnectingProblem

_BEGINNING = 1e-6  # scaled distance of the first and the last point from the saddles
_BISECTIONS = 60
_SAME = 1e-6  # difference of places on the fundamental segment within which orbits are equal
_MOST_POINTS = 400  # largest number of points of an orbit
_TOUCHING = 1e-9  # angle in radians below which manifolds do not cross
_NEARLY = 1e-6  # angle in radians below which manifolds coincide, where Newton's method fails
_FEW = 3  # places of this kind from which manifolds coincide
_APART = 64  # samples between changes of side that do not belong to one group


@dataclass(frozen=True, eq=False)
class ConnectingOrbit:
    """Homoclinic or heteroclinic orbit.

    Parameters
    ----------
    points : ndarray, shape (n, dimension)
        Points of the orbit, angles within their period, from near one saddle to near the other.
    source, target : ndarray, shape (dimension,)
        Points of the two saddles.
    steps : int
        Steps of the map from one point to the next: the least common multiple of the periods of the saddles.
    angle : float
        Angle in radians at which the manifolds cross at the middle point, in coordinates scaled by their sizes; its
        sign tells on which side.  Near 0 the manifolds nearly touch.
    coordinates : tuple of Coordinate
        State variables.
    """

    points: Floats
    source: Floats
    target: Floats
    steps: int
    angle: float
    coordinates: tuple[Coordinate, ...]
    _point_map: PointMap = field(repr=False)
    _unknowns: Floats = field(repr=False)
    _scale: Floats = field(repr=False)

    @property
    def homoclinic(self) -> bool:
        """Whether both saddles are one, up to full rotations of angles."""
        apart = difference(self.source, self.target, self.coordinates)
        return bool((np.abs(apart) <= 1e-8 * self._scale).all())

    def __repr__(self) -> str:
        kind = "homoclinic" if self.homoclinic else "heteroclinic"
        return f"ConnectingOrbit({kind}, {len(self.points)} points, manifolds cross at {self.angle:.3g} rad)"


@checked
def connecting_orbits(
    point_map: PointMap,
    source: PeriodicOrbit,
    target: PeriodicOrbit | None = None,
    max_steps: int = 40,
    n_samples: int = 16384,
    radius: float = 0.05,
) -> tuple[ConnectingOrbit, ...]:
    """Find homoclinic or heteroclinic orbits from a saddle to a saddle.

    Points of a fundamental segment of the unstable manifold of `source`, which covers a whole branch under iteration,
    are iterated.  Where neighbouring ones come close to `target` on different sides of its stable manifold, the point
    between is refined by bisection, and the whole chain of images by Newton's method, with its ends in the eigenspaces
    of the saddles at a distance of some 1e-6 of the orbit's size (projection boundary conditions).  The map may have
    any dimension from 2 on.

    Parameters
    ----------
    point_map : PointMap
        The map; for an interpolated map, its exact map is used.
    source, target : PeriodicOrbit
        Saddles of the map with one unstable multiplier each; by default `target` is `source`.  Orbits from and to the
        first points are found.
    max_steps : int, optional
        Steps of the map, in units of the least common multiple of the periods, within which an orbit has to come from
        one saddle to the other.
    n_samples : int, optional
        Points of the segment on either side of the saddle.
    radius : float, optional
        Distance from `target` within which sides are told, in units of the region that the samples visit.

    Returns
    -------
    tuple of ConnectingOrbit
        Orbits, those that take the fewest steps first; each once, though all its images are connecting points too.
        Two crossings between neighbouring samples are missed.

    Raises
    ------
    ValueError
        For orbits that are no saddles with one unstable multiplier, for a map that has no parameter, and for manifolds
        that coincide, as those of integrable maps; where others cross as well, a warning tells.

    References
    ----------
    Beyn, Kleinkauf, SIAM Journal on Numerical Analysis 34 (1997) 1207.

    Examples
    --------
    >>> from cellmap import discrete_map, periodic_orbit
    >>> henon = discrete_map(lambda x, p: (p.a - x[0]**2 + p.b * x[1], x[0]), {"a": 1.4, "b": -0.3}, ("x", "y"))
    >>> saddle = periodic_orbit(henon, [-2.0, -2.0])
    >>> connecting_orbits(henon, saddle, max_steps=24)[:2]
    (ConnectingOrbit(homoclinic, ... points, manifolds cross at ... rad), ConnectingOrbit(homoclinic, ...))
    """
    exact = point_map.without_table
    end = source if target is None else target
    if not exact.params:
        raise ValueError(f"point_map={exact!r} has no parameter: give it one, over which orbits can be followed")
    steps = lcm(_saddle("source", source, exact), _saddle("target", end, exact))
    most = whole_number("max_steps", max_steps, at_least=1)
    samples = whole_number("n_samples", n_samples, at_least=16)
    reach = finite_number("radius", radius, above=0.0, at_most=0.5)
    p, q = np.array(source.points[0]), np.array(end.points[0])
    begin, near = _Splitting.at(exact, p, steps), _Splitting.at(exact, q, steps)
    size = _visited(exact, p, begin.unstable, begin.factor, steps, most, turns_of(exact.coordinates)[1])
    orbits: list[tuple[int, ConnectingOrbit]] = []
    sides, coinciding = (1.0, -1.0) if begin.factor > 0.0 else (1.0,), 0
    for side in sides:
        direction = side * begin.unstable / np.linalg.norm(begin.unstable / size)
        segment = _Segment(exact, p, direction, abs(begin.factor) ** (1 if begin.factor > 0.0 else 2), steps)
        found, coincide = _connections(segment, near, size, segment.crossings(near, size, reach, most, samples))
        for number, orbit in found:
            if not any(_equal(orbit, other) for _, other in orbits):
                orbits.append((number, orbit))
        coinciding += coincide
    if coinciding:
        which = f"source={source!r}, target={end!r}: their manifolds coincide within {_TOUCHING:g} rad"
        remedy = "all of their points belong to connecting orbits; change a parameter that separates them"
        if not orbits:
            raise ValueError(f"{which}, so that {remedy}")
        warn_caller(f"{which} along {coinciding} of {len(sides)} branches, of which nothing is returned: {remedy}")
    return tuple(orbit for _, orbit in sorted(orbits, key=lambda found: found[0]))


def _saddle(name: str, orbit: PeriodicOrbit, exact: PointMap) -> int:
    """Return the period of a saddle; refuse other orbits."""
    if orbit.coordinates != exact.coordinates:
        raise ValueError(f"{name}={orbit!r}: its coordinates are not those of {exact!r}")
    if exact.dimension < 2 or orbit.unstable != 1:
        raise ValueError(f"{name}={orbit!r}: give a saddle with one unstable multiplier")
    return orbit.period


@dataclass(frozen=True, eq=False)
class _Splitting:
    """A saddle with its unstable eigenvector and multiplier; `left` times a shift is its component along the former."""

    exact: PointMap
    point: Floats
    matrix: Floats
    unstable: Floats
    factor: float
    left: Floats

    @classmethod
    def at(cls, exact: PointMap, point: Floats, steps: int) -> _Splitting:
        """Return the eigenspaces of a saddle that is fixed under some steps."""
        matrix = tangent(exact, point, steps)[1]
        values, vectors = np.linalg.eig(matrix)
        k = int(np.argmax(np.abs(values)))
        vector = np.real(vectors[:, k])
        vector = vector * np.sign(vector[np.argmax(np.abs(vector))])
        numbers, rows = np.linalg.eig(matrix.T)
        row = np.real(rows[:, np.argmax(np.abs(numbers))])
        return cls(exact, point, matrix, vector, float(np.real(values[k])), row / (row @ vector))

    def parts(self, points: Floats) -> tuple[Floats, Floats]:
        """Return the unstable component (n,) and the stable part (n, d) of the shifts of points from the saddle."""
        shift = difference(points, self.point, self.exact.coordinates)
        along = shift @ self.left
        return along, shift - along[..., None] * self.unstable


def _visited(
    exact: PointMap, p: Floats, direction: Floats, factor: float, steps: int, most: int, turn: Floats
) -> Floats:
    """Return the extent of a region that the unstable manifold visits: its images near the saddle, robustly."""
    offsets = np.concatenate([s * np.geomspace(1e-6, 1e-6 * factor**2, 64) for s in (1.0, -1.0)])
    unit = 1.0 + np.abs(p).max()
    orbits = Orbits.starting(p + unit * offsets[:, None] * direction / np.linalg.norm(direction))
    seen = [orbits.points.copy()]
    count = min(most, ceil(log(1e6) / log(abs(factor))) + 4)
    for _ in range(count):
        exact.advance(orbits, steps)
        near = orbits.alive & (np.abs(orbits.points - p) <= 10.0 * unit).all(axis=1)
        seen.append(orbits.points[near].copy())
    span = np.ptp(np.concatenate(seen), axis=0)
    return np.where(turn > 0.0, turn / (2.0 * np.pi), np.where(span > 1e-9 * unit, span, unit))


@dataclass(frozen=True, eq=False)
class _Segment:
    """Fundamental segment of an unstable manifold: places from 0 to 1 are from a point to its first image."""

    exact: PointMap
    saddle: Floats
    direction: Floats
    factor: float
    steps: int

    def begin(self, places: Floats) -> Floats:
        """Return the points (n, d) at places."""
        return np.asarray(self.saddle + _BEGINNING * np.power(self.factor, places)[:, None] * self.direction)

    def crossings(
        self, target: _Splitting, size: Floats, radius: float, most: int, samples: int
    ) -> Iterator[tuple[int, Ints, Floats]]:
        """Yield numbers of steps, and samples (n,) from which to the next ones images change their side of a saddle.

        Both are near the saddle then.  Last come the places of all samples.
        """
        places = np.linspace(0.0, 1.0, samples + 1)
        orbits = Orbits.starting(self.begin(places))
        for number in range(1, most + 1):
            self.exact.advance(orbits, self.steps)
            with np.errstate(invalid="ignore"):
                shift = difference(orbits.points, target.point, self.exact.coordinates)
                near = np.asarray((np.abs(shift / size) <= radius).all(axis=1))
            along, rest = target.parts(orbits.points)
            away = np.linalg.norm(rest / size, axis=1)
            rows = np.flatnonzero(near[:-1] & near[1:] & (along[:-1] * along[1:] <= 0.0))
            rows = rows[np.linalg.norm((rest[rows + 1] - rest[rows]) / size, axis=1) <= away[rows]]
            # The way out to the saddle's own neighbourhood is no way back to it.
            yield number, rows[away[rows] > 1e-3 * away[near].max(initial=0.0)], places

    def bisected(self, low: Floats, high: Floats, number: int, target: _Splitting) -> list[float]:
        """Return the places between others from which images are on the stable manifold of a saddle."""

        def side(places: Floats) -> Floats:
            orbits = Orbits.starting(self.begin(places))
            self.exact.advance(orbits, self.steps * number)
            return np.asarray(np.sign(target.parts(orbits.points)[0]))

        if not len(low):
            return []
        begin = side(low)
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            same = side(middle) == begin
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        return [float(place) for place in 0.5 * (low + high)]

    def chain(self, place: float, number: int) -> Floats:
        """Return the images (number + 1, d) of a place."""
        orbits = Orbits.starting(self.begin(np.array([place])))
        points = [orbits.points[0].copy()]
        for _ in range(number):
            self.exact.advance(orbits, self.steps)
            points.append(orbits.points[0].copy())
        return np.array(points)


def _connections(
    segment: _Segment, target: _Splitting, size: Floats, steps: Iterable[tuple[int, Ints, Floats]]
) -> tuple[list[tuple[int, ConnectingOrbit]], bool]:
    """Return the orbits along which manifolds cross, with their numbers of steps, and whether manifolds coincide.

    Where these do, rounding decides on which side images are: of a dense group of changes of side the first, the middle
    and the last one are looked at, and the others only if manifolds cross at one of them.
    """
    known: list[tuple[float, bool, bool]] = []  # places, whether manifolds cross there, and whether they touch
    found: list[tuple[int, ConnectingOrbit]] = []

    def cross(number: int, low: Floats, high: Floats) -> list[bool]:
        crossing = []
        for place in segment.bisected(low, high, number, target):
            before = [crosses for other, crosses, _ in known if abs(place - other) <= _SAME]
            if not before:
                orbit, touches = _connection(segment, target, size, segment.chain(place, number))
                before = [orbit is not None]
                known.append((place, orbit is not None, touches))
                if orbit is not None:
                    found.append((number, orbit))
            crossing.append(any(before))
        return crossing

    for number, rows, places in steps:
        if len(rows):
            group = np.cumsum(np.diff(rows, prepend=rows[0]) > _APART)
            _, first, count = np.unique(group, return_index=True, return_counts=True)
            looked = count[group] <= _FEW
            looked[np.concatenate([first, first + count // 2, first + count - 1])] = True
            crossing = np.zeros(len(rows), bool)
            crossing[looked] = cross(number, places[rows[looked]], places[rows[looked] + 1])
            others = rows[~looked & np.logical_or.reduceat(crossing, first)[group]]
            cross(number, places[others], places[others + 1])
        coincide = sum(touches for *_, touches in known) >= _FEW
        if coincide and not found:
            break
    return found, coincide


def _to_target(chain: Floats, target: _Splitting, size: Floats) -> Floats | None:
    """Return a chain continued in the stable eigenspace of a saddle until it is close; None where that takes long."""
    rest = target.parts(chain[-1])[1]
    further = [rest]
    while np.linalg.norm(rest / size) > _BEGINNING:
        if len(chain) + len(further) > _MOST_POINTS:
            return None
        image = target.matrix @ rest
        rest = image - (target.left @ image) * target.unstable
        further.append(rest)
    return np.concatenate([chain[:-1], target.point + np.array(further)])


def _connection(
    segment: _Segment, target: _Splitting, size: Floats, chain: Floats
) -> tuple[ConnectingOrbit | None, bool]:
    """Return the connecting orbit beside a chain of points, and whether manifolds touch there instead of crossing."""
    if not np.isfinite(chain).all():
        return None, False
    exact, guess = segment.exact, _to_target(chain, target, size)
    points = np.vstack([segment.saddle, target.point, chain if guess is None else guess])
    problem, unknowns = problem_of(exact, (next(iter(exact.params)),), (1.0,), segment.steps, size, points)
    at = None if guess is None else corrected(problem, unknowns, problem.parameter_direction)
    angle = problem.angle(unknowns if at is None else at.unknowns)
    if at is None or abs(angle) < _TOUCHING:
        return None, abs(angle) < _NEARLY
    return orbit_at(exact, problem, at.unknowns[: problem.points * problem.dimension], angle), False


def problem_of(
    exact: PointMap, names: tuple[str, ...], spans: tuple[float, ...], steps: int, size: Floats, points: Floats
) -> tuple[ConnectingProblem, Floats]:
    """Return the equations with free parameters, and the unknowns of points (n, d): saddles, then the orbit."""
    scale = np.concatenate([np.tile(size, len(points)), spans])
    problem = ConnectingProblem(swept_map(exact, *names), exact.dimension, steps, len(points) - 3, scale)
    values = [exact.params[name] for name in names]
    return problem, np.concatenate([points.ravel(), values]) / scale


def orbit_at(exact: PointMap, problem: ConnectingProblem, states: Floats, angle: float) -> ConnectingOrbit:
    """Return the orbit of unknowns without parameters."""
    d = problem.dimension
    points = (states * problem.scale[: len(states)]).reshape(-1, d)
    wrapped = wrap(points, exact.coordinates)
    return ConnectingOrbit(
        wrapped[2:], wrapped[0], wrapped[1], problem.steps, angle, exact.coordinates, exact, states, problem.scale[:d]
    )


def _equal(one: ConnectingOrbit, other: ConnectingOrbit) -> bool:
    """Tell whether the middle point of an orbit is on another one."""
    middle = one.points[np.argmax(np.linalg.norm(difference(one.points, one.source, one.coordinates), axis=1))]
    apart = np.abs(difference(other.points, middle, one.coordinates) / one._scale).max(axis=1)
    return bool((apart <= 1e-7).any())
