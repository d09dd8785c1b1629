"""Zeros and extreme values of functions of orbits on branches and curves, and curves along which they persist."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np

from .._lib.arrays import Bools, Complexes, Floats, Ints
from .._lib.checks import check_mapping, warn_caller
from ..maps.coordinates import shortest, wrap
from ..orbits.arclength import ContinuationStep, SolutionPoint, corrected
from ..orbits.multipliers import unstable_count
from ..orbits.orbit_equations import OrbitProblem
from ..orbits.orbit_kinds import PeriodicOrbit
from .intervals import place_of
from .period_measures import OrbitFunction, Quantity, as_functions, measured, turn_of, unwrapped

_SHIFT = 3e-4  # distance, scaled, of the orbits by whose differences slopes are computed
_CORRECTIONS = 3  # corrections by Newton's method after which an orbit closes to rounding
_FINEST = 1e-12  # tolerance of the integration of functions that are differentiated
_FLAT, _ROUNDING = 1e-8, 1e-12  # changes of a function relative to its size, and values relative to states, of rounding
_LAST_BITS = 1e-15  # changes, relative, of functions of points, that are rounding
_BESIDE = 2  # steps without a change between those on which a function grows and falls


@dataclass(frozen=True, eq=False)
class FunctionZero:
    """Point of a branch or a curve at which a function of orbits is zero or has an extreme value.

    Parameters
    ----------
    name : str
        Name of the function.
    function : OrbitFunction
        The function.
    parameters : tuple of str
        Names of the parameters, one for a branch and two for a curve.
    values : ndarray, shape (m,)
        Parameter values, in their units.
    point : ndarray, shape (dimension,)
        First point of the orbit, angles within their period.
    multipliers : ndarray of complex, shape (dimension,)
        Multipliers of the orbit.
    place : int
        The point lies between the points `place` and ``place + 1`` of the branch or curve.
    """

    _made_by: ClassVar = "continue_orbit, among the zeros of Branch.with_zeros"
    name: str
    function: OrbitFunction
    parameters: tuple[str, ...]
    values: Floats
    point: Floats
    multipliers: Complexes
    place: int
    _unknowns: Floats = field(repr=False)
    _problem: OrbitProblem = field(repr=False)

    @property
    def value(self) -> float:
        """The first parameter, in its unit."""
        return float(self.values[0])

    @property
    def unstable(self) -> int:
        """Number of multipliers outside the unit circle."""
        return int(unstable_count(self.multipliers))

    @property
    def params(self) -> Mapping[str, float]:
        """All parameters at the point, in their units."""
        return self._problem.map_at(self._unknowns).params

    @property
    def orbit(self) -> PeriodicOrbit:
        """The orbit, with all parameters in its `params`."""
        return self._problem.orbit_at(self._unknowns)

    def __repr__(self) -> str:
        return f"FunctionZero({self.name} at {place_of(self.parameters, self.values)})"


def values_of(orbits: OrbitProblem, names: tuple[str, ...], function: OrbitFunction, unknowns: Floats) -> Floats:
    """Return a function (n,) of the orbits given by unknowns (n, ...); NaN where these are not finite.

    Angles are differences to the value of the function the shorter way round.
    """
    result = np.full(len(unknowns), np.nan)
    known = np.isfinite(unknowns).all(axis=1)
    if known.any():
        d, exact = orbits.dimension, orbits.point_map
        states = np.array([orbits.once(u * orbits.scale) for u in unknowns[known]])
        points = wrap(states[:, :d], exact.coordinates)
        quantity, measure = function.quantity, function.measure
        found = measured(exact, names, states[:, d:], points, orbits.period, quantity, measure, _FINEST)
        result[known] = shortest(found - function.value, turn_of(exact, quantity, measure))
    return result


@dataclass(frozen=True, eq=False)
class BranchPiece:
    """Solutions (n, ...) of the equations of a branch or curve, from the point number `first` on."""

    problem: Any
    orbits: OrbitProblem
    unknowns: Floats
    first: int = 0

    def beyond(self, end: int, before: int) -> Floats:
        """Return the solution one step further than the point `end`, NaN where there is none."""
        step = self.unknowns[end] - self.unknowns[before]
        place = corrected(self.problem, self.unknowns[end] + step, step / np.linalg.norm(step))
        return np.full_like(step, np.nan) if place is None else place.unknowns


def zeros_on(
    pieces: Sequence[BranchPiece],
    names: tuple[str, ...],
    functions: Mapping[str, Quantity | OrbitFunction],
    closed: bool = False,
) -> tuple[FunctionZero, ...]:
    """Return where functions are zero, or extreme, on the pieces of a branch or curve.

    Each piece begins at the end of the one before it; the end of a closed curve is its beginning.
    """
    found: list[tuple[int, float, FunctionZero]] = []
    check_mapping("functions", functions, "of names to functions, such as {'x': 0}")
    for name, function in as_functions(functions).items():
        searches = [_ZeroSearch(piece, names, function) for piece in pieces]
        searches = [replace(s, own=s.value(s.piece.unknowns)) for s in searches]
        known = [s for s in searches if np.isfinite(s.own).any()]
        if not known:
            raise ValueError(
                f"functions[{name!r}]: it is not known at any point, as for an angle that makes full rotations, and "
                "for orbits so unstable that they cannot be followed over a period; give a function of first points"
            )
        if all(s.vanishing[np.isfinite(s.own)].all() for s in known):
            raise ValueError(f"functions[{name!r}]: it is zero at all points; give one that changes")
        seen, last = set[int](), pieces[-1].first + len(pieces[-1].unknowns) - 1
        stretches = np.concatenate([s.stretches + s.piece.first for s in searches])
        if len(stretches) and not function.extremum:
            warn_caller(
                f"functions[{name!r}]: it is zero along stretches, not at points, between the points "
                f"{stretches.min()} and {stretches.max()}; its other zeros are returned. Give a function that changes "
                "its sign there",
                RuntimeWarning,
            )
        for m, search in enumerate(searches):
            piece = search.piece
            for k, number, place in search.places(closed or m > 0, closed or m < len(pieces) - 1):
                if number is not None:
                    number = (piece.first + number) % last if closed else piece.first + number
                    if number in seen:
                        continue
                    seen.add(number)
                state, d = piece.orbits.once(place.unknowns * piece.orbits.scale), piece.orbits.dimension
                point, factors = wrap(state[:d], piece.orbits.point_map.coordinates), piece.problem.multipliers(place)
                zero = FunctionZero(
                    name, function, names, state[d:], point, factors, piece.first + k, place.unknowns, piece.orbits
                )
                found.append((piece.first + k, float(np.linalg.norm(place.unknowns - piece.unknowns[k])), zero))
    return tuple(zero for *_, zero in sorted(found, key=lambda f: f[:2]))


@dataclass(frozen=True, eq=False)
class _ZeroSearch:
    """Search for zeros, or extreme values, of a function on a piece of a branch, with its values (n,) there."""

    piece: BranchPiece
    names: tuple[str, ...]
    function: OrbitFunction
    own: Floats = field(default_factory=lambda: np.empty(0))

    def value(self, unknowns: Floats) -> Floats:
        """Return the function (n,) at unknowns (n, ...); an angle that has extreme values is continuous."""
        function, exact = self.function, self.piece.orbits.point_map
        values = values_of(self.piece.orbits, self.names, function, unknowns)
        return unwrapped(values, turn_of(exact, function.quantity, function.measure)) if function.extremum else values

    def test(self, place: SolutionPoint) -> float:
        """Return the value that is zero at the place: that of the function, or of its slope."""
        if not self.function.extremum:
            return float(self.value(place.unknowns[None])[0])
        ahead = [place.unknowns + k * _SHIFT * place.tangent for k in (-2, -1, 1, 2)]
        beside = [corrected(self.piece.problem, guess, place.tangent) for guess in ahead]
        known = [b.unknowns for b in beside if b is not None]
        return _slope(self.value(np.array(known))) if len(known) == len(beside) else np.nan

    @property
    def vanishing(self) -> Bools:
        """Whether the function is rounding, (n,)."""
        level = np.abs(self.piece.unknowns * self.piece.orbits.scale).max()
        return np.abs(self.own) <= _ROUNDING * max(float(level), abs(self.function.value))

    @property
    def stretches(self) -> Ints:
        """Numbers of neighbouring points at which the function is zero, or rounding of either sign."""
        edges = np.flatnonzero(np.diff(np.concatenate([[False], self.vanishing, [False]]).astype(int)))
        found = [np.empty(0, np.int64)]
        for start, stop in edges.reshape(-1, 2):
            signs = np.sign(self.own[start:stop])
            if np.count_nonzero(signs == 0) > 1 or np.count_nonzero(signs[:-1] * signs[1:] < 0) > 1:
                found.append(np.arange(start, stop))
        return np.concatenate(found)

    def places(self, behind: bool, ahead: bool) -> Iterator[tuple[int, int | None, SolutionPoint]]:
        """Yield step, point number, if it is at one, and place of each zero; the branch may go on on either side."""
        piece, own, points = self.piece, self.own, self.piece.unknowns
        last, offset = len(points) - 1, 0
        if self.function.extremum:
            if behind:
                points, offset = np.vstack([piece.beyond(0, 1), points]), 1
            if ahead:
                points = np.vstack([points, piece.beyond(-1, -2)])
            own, steps = np.full(len(points), np.nan), set(_turns(self.value(points), self.function.measure is None))
        else:
            steps = set(range(last)) - {k + j for k in self.stretches.tolist() for j in (-1, 0)}
        for k in sorted(steps):
            chord = points[k + 1] - points[k]
            length = float(np.linalg.norm(chord))
            begin, end = (SolutionPoint(u, np.empty((0, 0)), chord / length) for u in points[k : k + 2])
            if self.function.extremum:
                own[k] = self.test(begin) if np.isnan(own[k]) else own[k]
                own[k + 1] = self.test(end)
            if not offset <= k < last + offset:
                continue
            step = ContinuationStep(piece.problem, begin, end, length)
            place: SolutionPoint | None = step.zero(self.test, own[k : k + 2].tolist())
            number = None
            if place is begin or place is end:
                at = k if place is begin else k + 1
                number = at - offset
                crossed = own[k] * own[k + 1] < 0.0
                touched = not crossed and 0 < at < len(own) - 1 and own[at - 1] * own[at + 1] > 0.0
                later = at == k + 1 < last + offset and own[at] * own[at + 1] < 0.0
                if (later and not crossed) or (touched and (self.function.extremum or not self.vanishing[at])):
                    continue
                inside = step.located(self.test) if crossed else None
                known = inside is not None and abs(self.test(inside)) <= abs(own[at])
                place = inside if known else corrected(piece.problem, place.unknowns, place.tangent)
            if place is not None:
                yield k - offset, number, place


def _slope(beside: Floats) -> float:
    """Return a derivative from values at distances -2, -1, 1 and 2."""
    return float((beside[0] - beside[3] + 8.0 * (beside[2] - beside[1])) / (12.0 * _SHIFT))


def _turns(values: Floats, exact: bool) -> Iterator[int]:
    """Return the numbers of steps on which a function, of points or integrated, may have an extreme value."""
    known = values[np.isfinite(values)]
    size, span = np.abs(known).max(initial=0.0), np.ptp(known) if len(known) else 0.0
    changes = np.diff(values)
    with np.errstate(invalid="ignore"):
        clear = np.flatnonzero(np.abs(changes) > (_LAST_BITS * size if exact else max(_FLAT * span, _ROUNDING * size)))
    steps = set[int]()
    for j, k in pairwise(clear):
        if changes[j] * changes[k] < 0.0 and k - j <= _BESIDE:
            steps |= set(range(j, k + 1))
    return iter(sorted(steps))


@dataclass(frozen=True, eq=False)
class FunctionOrbits:
    """Equations of orbits at which a function is zero, or extreme along branches in the first of two parameters.

    Unknowns are (x_1, ..., x_n, q1, q2) in units of a scale, with the states of n segments.  The function is that of
    the orbit with the same q2 next to them; its derivatives along the surface of orbits are differences.
    """

    orbits: OrbitProblem
    kind: str
    names: tuple[str, str]
    function: OrbitFunction
    unit: float = 1.0

    @classmethod
    def at(cls, orbits: OrbitProblem, names: tuple[str, str], zero: FunctionZero, unknowns: Floats) -> FunctionOrbits:
        """Set up the equations at a point of the curve."""
        found = cls(orbits, zero.name, names, zero.function)
        size = float(np.linalg.norm(found(unknowns)[1][-1]))
        return replace(found, unit=size if np.isfinite(size) and size > 0.0 else 1.0)

    def multipliers(self, place: SolutionPoint) -> Complexes:
        """Return the multipliers, by decreasing modulus."""
        return self.orbits.multipliers(replace(place, derivatives=place.derivatives[:-1]))

    def __call__(self, unknowns: Floats) -> tuple[Floats, Floats]:
        """Return residuals (n d + 1,) and their derivatives (n d + 1, n d + 2) at unknowns (n d + 2,)."""
        residual, slopes = self.orbits(unknowns)
        gap, matrix, place = residual, slopes, unknowns.copy()
        try:
            for _ in range(_CORRECTIONS):
                inverse = np.linalg.pinv(matrix[:, :-1])
                place[:-1] -= inverse @ gap
                gap, matrix = self.orbits(place)
            along, across = self._tangents(matrix)
        except np.linalg.LinAlgError:
            return np.full(len(residual) + 1, np.nan), np.full((len(residual) + 1, len(unknowns)), np.nan)
        ahead = [(0, 0), (-2, 0), (-1, 0), (1, 0), (2, 0), (0, -1), (0, 1), (-1, -1), (-1, 1), (1, -1), (1, 1)]
        steps = np.array(ahead if self.function.extremum else ahead[:7])
        nearby = place + _SHIFT * steps @ np.array([along, across])
        for _ in range(_CORRECTIONS):
            nearby[:, :-1] -= self.orbits(nearby)[0] @ inverse.T
        g = values_of(self.orbits, self.names, self.function, nearby)
        turn = turn_of(self.orbits.point_map, self.function.quantity, self.function.measure)
        g = (g[0] + shortest(g - g[0], turn)) / self.unit
        if self.function.extremum:
            value, by_along = _slope(g[1:5]), (g[2] - 2.0 * g[0] + g[3]) / _SHIFT**2
            by_across = (g[7] - g[8] - g[9] + g[10]) / (4.0 * _SHIFT**2)
        else:
            value, by_along, by_across = g[0], _slope(g[1:5]), (g[6] - g[5]) / (2.0 * _SHIFT)
        gradient = by_along * along
        gradient[-1] += by_across / across[-1]
        return np.append(residual, value), np.vstack([slopes, gradient])

    def _tangents(self, slopes: Floats) -> tuple[Floats, Floats]:
        """Return unit vectors along the surface of orbits: with the second parameter fixed, and across it."""
        along = np.append(np.linalg.svd(slopes[:, :-1])[2][-1], 0.0)
        return along, np.linalg.svd(np.vstack([slopes, along]))[2][-1]
