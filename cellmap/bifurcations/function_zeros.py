"""Zeros and extreme values of functions of orbits on branches and curves, and curves along which they persist."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..maps.coordinates import wrap
from ..orbits.arclength import ContinuationStep, SolutionPoint, corrected
from ..orbits.multipliers import unstable_count
from ..orbits.orbit_equations import OrbitProblem
from ..orbits.orbit_kinds import PeriodicOrbit
from .period_measures import OrbitFunction, Quantity, as_functions, measured

_SHIFT = 3e-4  # distance, scaled, of the orbits by whose differences slopes are computed
_CORRECTIONS = 3  # of Newton's method, after which an orbit closes to rounding
_FINEST = 1e-12  # tolerance of the integration of functions that are differentiated
_FLAT, _ROUNDING = 1e-8, 1e-12  # changes of a function relative to its size, and values relative to states, of rounding
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

    name: str
    function: OrbitFunction
    parameters: tuple[str, ...]
    values: NDArray[np.float64]
    point: NDArray[np.float64]
    multipliers: NDArray[np.complex128]
    place: int
    _unknowns: NDArray[np.float64] = field(repr=False)
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
    def orbit(self) -> PeriodicOrbit:
        """The orbit, with all parameters in its `params`."""
        return self._problem.orbit_at(self._unknowns)

    def __repr__(self) -> str:
        where = ", ".join(f"{n}={v:.10g}" for n, v in zip(self.parameters, self.values.tolist(), strict=True))
        return f"FunctionZero({self.name} at {where})"


def values_of(
    orbits: OrbitProblem, names: tuple[str, ...], function: OrbitFunction, unknowns: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return a function (n,) of the orbits given by unknowns (n, ...); NaN where these are not finite."""
    result = np.full(len(unknowns), np.nan)
    known = np.isfinite(unknowns).all(axis=1)
    if known.any():
        states, d, exact = (
            np.array([orbits.once(u * orbits.scale) for u in unknowns[known]]),
            orbits.dimension,
            orbits.point_map,
        )
        points = wrap(states[:, :d], exact.coordinates)
        quantity, measure = function.quantity, function.measure
        found = measured(exact, names, states[:, d:], points, orbits.period, quantity, measure, _FINEST)
        result[known] = found - function.value
    return result


def zeros_on(
    problem: Any,
    orbits: OrbitProblem,
    names: tuple[str, ...],
    unknowns: NDArray[np.float64],
    functions: Mapping[str, Quantity | OrbitFunction],
    first: int = 0,
    closed: bool = False,
) -> list[FunctionZero]:
    """Return where functions are zero, or extreme, between solutions (n, ...) of the equations of a branch or curve.

    The places are numbered from `first` on.  The last point of a closed curve is the first one.
    """
    last = len(unknowns) - 1
    if closed:
        unknowns = np.vstack([unknowns, unknowns[-1] + unknowns[1] - unknowns[0]])
    found: list[tuple[int, float, FunctionZero]] = []
    for name, function in as_functions(functions).items():

        def value(places: NDArray[np.float64], function: OrbitFunction = function) -> NDArray[np.float64]:
            return values_of(orbits, names, function, places)

        def test(place: SolutionPoint, function: OrbitFunction = function) -> float:
            if not function.extremum:
                return float(value(place.unknowns[None])[0])
            beside = [
                corrected(problem, place.unknowns + k * _SHIFT * place.tangent, place.tangent) for k in (-2, -1, 1, 2)
            ]
            if any(b is None for b in beside):
                return np.nan
            return _slope(value(np.array([b.unknowns for b in beside if b is not None])))

        own = value(unknowns)
        if not np.isfinite(own).any():
            raise ValueError(
                f"functions[{name!r}]: it is not known at any point, as for an angle that makes full rotations"
            )
        level = max(float(np.abs(unknowns * orbits.scale).max()), abs(function.value))
        if np.nanmax(np.abs(own)) <= _ROUNDING * level:
            raise ValueError(f"functions[{name!r}]: it is zero at all points; give one that changes")
        seen = {0} if closed else set[int]()
        for k in _turns(own) if function.extremum else range(last):
            chord = unknowns[k + 1] - unknowns[k]
            length = float(np.linalg.norm(chord))
            begin, end = (SolutionPoint(u, np.empty((0, 0)), chord / length) for u in unknowns[k : k + 2])
            ends = (test(begin), test(end)) if function.extremum else own[k : k + 2].tolist()
            place = ContinuationStep(problem, begin, end, length).zero(test, ends)
            if place is begin or place is end:
                number = k if place is begin else k + 1
                place = None if number in seen else corrected(problem, place.unknowns, place.tangent)
                seen.add(number)
            if place is not None:
                state, d = orbits.once(place.unknowns * orbits.scale), orbits.dimension
                point, factors = wrap(state[:d], orbits.point_map.coordinates), problem.multipliers(place)
                zero = FunctionZero(
                    name, function, names, state[d:], point, factors, first + k % last, place.unknowns, orbits
                )
                found.append((k % last, float(np.linalg.norm(place.unknowns - unknowns[k])), zero))
    return [zero for *_, zero in sorted(found, key=lambda f: f[:2])]


def _slope(beside: NDArray[np.float64]) -> float:
    """Return a derivative from values at distances -2, -1, 1 and 2."""
    return float((beside[0] - beside[3] + 8.0 * (beside[2] - beside[1])) / (12.0 * _SHIFT))


def _turns(values: NDArray[np.float64]) -> Iterator[int]:
    """Return the numbers of steps on which a function may have an extreme value."""
    changes = np.diff(values)
    with np.errstate(invalid="ignore"):
        clear = np.flatnonzero(np.abs(changes) > _FLAT * np.nanmax(np.abs(values)))
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
    def at(
        cls, orbits: OrbitProblem, names: tuple[str, str], zero: FunctionZero, unknowns: NDArray[np.float64]
    ) -> FunctionOrbits:
        """Set up the equations at a point of the curve."""
        found = cls(orbits, zero.name, names, zero.function)
        size = float(np.linalg.norm(found(unknowns)[1][-1]))
        return replace(found, unit=size if np.isfinite(size) and size > 0.0 else 1.0)

    def multipliers(self, place: SolutionPoint) -> NDArray[np.complex128]:
        """Return the multipliers, by decreasing modulus."""
        return self.orbits.multipliers(replace(place, derivatives=place.derivatives[:-1]))

    def __call__(self, unknowns: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
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
        g = values_of(self.orbits, self.names, self.function, nearby) / self.unit
        if self.function.extremum:
            value, by_along = _slope(g[1:5]), (g[2] - 2.0 * g[0] + g[3]) / _SHIFT**2
            by_across = (g[7] - g[8] - g[9] + g[10]) / (4.0 * _SHIFT**2)
        else:
            value, by_along, by_across = g[0], _slope(g[1:5]), (g[6] - g[5]) / (2.0 * _SHIFT)
        gradient = by_along * along
        gradient[-1] += by_across / across[-1]
        return np.append(residual, value), np.vstack([slopes, gradient])

    def _tangents(self, slopes: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return unit vectors along the surface of orbits: with the second parameter fixed, and across it."""
        along = np.append(np.linalg.svd(slopes[:, :-1])[2][-1], 0.0)
        return along, np.linalg.svd(np.vstack([slopes, along]))[2][-1]
