"""Why a branch of limit cycles ends: they shrink to an equilibrium, or their periods grow without bound."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .._lib.arrays import Complexes, Floats, Ints
from ..maps.coordinates import shortest, turns_of
from ..maps.poincare import Section
from ..maps.swept_orbits import SweptOrbits
from ..orbits.arclength import SolutionPoint
from ..orbits.orbit_equations import OrbitProblem

_SHRUNK = 1e-4  # rates at the section, and the extent of a cycle, relative to those before, of one that vanishes
_SAMPLES = 512  # samples in a period, in which a passage near an equilibrium shows
_ASIDE = 1e-3  # part of the interval of the parameter within which a cycle that has shrunk tells where it vanishes
_TOUCHING = 1e-2  # speed across the section, relative to the largest, of a cycle that is about to touch it
_STEEP = 1e3  # relative change of the period for a scaled length of the branch, seen at its ends alone
_LAST = 8  # places at the end of a branch along which the period is seen to grow
_LONGEST = 0.9  # part of the longest time of return at which cycles are about to exceed it
_SLOW = 0.1  # part of its largest speed at which an orbit may pass an equilibrium
_NEAR = 0.1  # distance from an equilibrium, in extents of the orbit, of an orbit that passes it
_DIFFERENCE, _ITERATIONS, _CONVERGED = 6e-6, 20, 1e-9  # Newton's method for equilibria, in their units
_WEAK = 10.0  # logarithm of what an eigenvalue does in a period, from which it is not about to vanish


@dataclass(frozen=True, eq=False)
class LimitCycles:
    """The limit cycles of a branch of fixed points of a map of first returns, in one parameter."""

    problem: OrbitProblem
    name: str

    @classmethod
    def of(cls, problem: OrbitProblem, name: str) -> LimitCycles | None:
        """Return the cycles of a branch; None where its orbits are none, or the formulas are not known."""
        spec = problem.point_map.spec
        return cls(problem, name) if isinstance(spec, Section) and spec.swept((name,)) is not None else None

    def speed(self, place: SolutionPoint) -> float:
        """Return how fast the coordinate of the section changes there."""
        orbits = self._orbits([place])
        return abs(float(orbits.rates(orbits.beginning[1])[0, 0, self._section.place]))

    def vanishing(self, place: SolutionPoint, speed: float, largest: float) -> str | None:
        """Return the end of a branch whose cycles shrink to an equilibrium, at a speed beside the largest on it."""
        if not speed < _SHRUNK * largest:
            return None
        orbits, problem = self._orbits([place]), self.problem
        times, states = orbits.motion(_SAMPLES)
        size = float(times[-1, 0]) * largest
        if not np.ptp(states[:, 0, self._section.place]) < _SHRUNK * size:
            return None
        units = np.insert(problem.scale[: problem.dimension], self._section.place, size)
        value = _hopf(orbits, states[:, 0].mean(axis=0), units, float(problem.scale[-1]))
        return f"the orbit shrinks to an equilibrium at {self.name}={value:.10g}"

    def end_of(self, places: Sequence[SolutionPoint], speed: float) -> str | None:
        """Return why there are no further cycles after some places, the fastest of which crosses at a speed."""
        if len(places) < 2:
            return None
        spec, last = self._section, places[-1]
        if self.speed(last) < _TOUCHING * speed:
            return "the orbit touches the section"
        orbits = self._orbits(places[-_LAST:])
        times, states = orbits.motion(_SAMPLES)
        periods, along = times[-1], np.array([p.unknowns for p in places[-_LAST:]])
        # Beside the end periods are rounding errors times what an orbit of such a length makes of them.
        longest = int(np.argmax(periods))
        before = periods[:longest]
        apart = np.linalg.norm(along[:longest] - along[longest], axis=1)
        if not (np.log(periods[longest] / before) > _STEEP * apart).any():
            beyond = periods[-1] > _LONGEST * self.problem.period * spec.max_time
            return f"the return time reaches max_time={spec.max_time:g}" if beyond else None
        value = float(last.unknowns[-1] * self.problem.scale[-1])
        passage = _passage(orbits[np.array([longest])], states[:, longest], periods[longest])
        return f"the period grows without bound at {self.name}={value:.10g}{passage}"

    @property
    def _section(self) -> Section:
        spec = self.problem.point_map.spec
        assert isinstance(spec, Section)
        return spec

    def _orbits(self, places: Sequence[SolutionPoint]) -> SweptOrbits:
        problem, d = self.problem, self.problem.dimension
        states = np.array([problem.once(p.unknowns * problem.scale) for p in places])
        return SweptOrbits(problem.point_map, (self.name,), states[:, d:], states[:, :d], problem.period)


def _hopf(orbit: SweptOrbits, guess: Floats, units: Floats, span: float) -> float:
    """Return the parameter beside that of an orbit at which a pair of an equilibrium's eigenvalues is imaginary."""

    def growth(value: float) -> float:
        eigenvalues = _equilibrium(replace(orbit, values=np.array([[value]])), guess, units)[1]
        return float(eigenvalues[np.argmin(np.abs(eigenvalues.real) - np.abs(eigenvalues.imag))].real)

    start = last = float(orbit.values[0, 0])
    value = start + _ASIDE * span
    before, after = growth(last), growth(value)
    for _ in range(_ITERATIONS):
        if after == before or not abs(value - start) <= _ASIDE * span:
            break
        step = after * (value - last) / (after - before)
        last, before, value = value, after, value - step
        after = growth(value)
    return value if abs(value - start) <= _ASIDE * span else start


def _passage(orbit: SweptOrbits, states: Floats, period: float) -> str:
    """Return what an orbit of states (times, d) tells of the equilibria that it passes, after a colon."""
    extents = np.ptp(states, axis=0)
    speeds = np.linalg.norm(orbit.rates(states[:, None])[:, 0] / extents, axis=1)
    spec = orbit.exact.spec
    assert isinstance(spec, Section)
    turns = turns_of(spec.system.axes)[1]
    found, weak = list[Floats](), False
    for slowest in _lowest(speeds):
        place, eigenvalues = _equilibrium(orbit, states[slowest], extents)
        near = np.linalg.norm(shortest(states - place, turns) / extents, axis=1).min() < _NEAR
        weak |= bool((np.abs(eigenvalues) * period < _WEAK).any())
        if near and eigenvalues.real.min() < 0.0 < eigenvalues.real.max():
            known = [f for f in found if np.linalg.norm(shortest(place - f, turns) / extents) < _NEAR**2]
            found += [] if known else [place]
    if weak:
        return ": saddle-node on an invariant circle"
    return ["", ": homoclinic orbit", ": heteroclinic cycle"][min(len(found), 2)]


def _lowest(speeds: Floats) -> Ints:
    """Return where speeds (times,) along a period are least between places at which they are not small."""
    small = speeds < _SLOW * speeds.max()
    edges = np.flatnonzero(np.diff(np.concatenate([[False], small, [False]]).astype(int))).reshape(-1, 2)
    return np.array([start + int(np.argmin(speeds[start:stop])) for start, stop in edges], np.int64)


def _equilibrium(orbit: SweptOrbits, guess: Floats, units: Floats) -> tuple[Floats, Complexes]:
    """Return the equilibrium near a state and the eigenvalues there; those at the state, and NaN, for none."""
    steps, place = _DIFFERENCE * np.diag(units), guess
    first: Complexes | None = None
    for _ in range(_ITERATIONS):
        around = orbit.rates(np.concatenate([[place], place + steps, place - steps])[:, None])[:, 0]
        ahead, behind = np.split(around[1:], 2)
        slopes = (ahead - behind).T / (2.0 * np.diag(steps))
        if not np.isfinite(slopes).all():
            break
        first = np.linalg.eigvals(slopes).astype(np.complex128) if first is None else first
        change = np.linalg.lstsq(slopes, -around[0], rcond=None)[0]
        place = place + change
        if np.abs(change / units).max() < _CONVERGED:
            return place, np.linalg.eigvals(slopes).astype(np.complex128)
    return np.full_like(guess, np.nan), np.array([complex(np.nan)]) if first is None else first
