"""Periodic orbits continued over a grid of two parameters, in SIMD lanes."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .._lib.arrays import Bools, Floats, Ints
from .._lib.checks import claim_memory, known_parameter
from .._lib.threads import progress_bar, run_over, slices
from ..maps.coordinates import difference
from ..maps.orbit_batch import CHUNK, Status
from ..maps.point_map import PointMap, follow
from ..orbits.attractor import Attractor
from ..orbits.newton import solutions
from ..orbits.orbit_equations import OrbitProblem, begin_orbit, orbit_problem
from ..orbits.orbit_kinds import PeriodicOrbit
from .crossings import Matrices

_NEAR = 0.3  # distance of a solution from its guess, scaled, beyond which it is on another branch
_FORESEEN, _SMALL = 0.2, 1e-3  # part of a move, and scaled distance, by which an orbit may miss its prediction
_SHORTEST = 2.0**-6  # step, as a fraction of the way to a neighbour
_CAREFUL = 2.0**-5  # step where branches may cross, as a fraction of the way to a neighbour
_OPEN = 1e-5  # distance, scaled, by which an orbit is open before its period is over
_TRIES = 2  # neighbours from which a point is sought in short steps


@dataclass(frozen=True, eq=False)
class FollowedOrbit:
    """An orbit at the points of a grid (ny, nx) of two parameters."""

    problem: OrbitProblem
    x: Floats
    y: Floats
    _grid: _Solved = field(repr=False)

    @property
    def states(self) -> Floats:
        """States of the orbit, shape (ny, nx, d)."""
        return self._grid.states

    def matrices(self, points: Floats, progress: str | None = None) -> Matrices:
        """Return the monodromy matrices at parameter points (n, 2), from the orbit at the nearest point."""
        columns, rows = (
            np.searchsorted(0.5 * (axis[1:] + axis[:-1]), values)
            for values, axis in ((points[:, 0], self.x), (points[:, 1], self.y))
        )
        begins = np.stack([self.x[columns], self.y[rows]], axis=-1)
        nearest = self._grid[rows, columns]
        matrices = nearest.matrices.copy()
        away = np.flatnonzero((begins != points).any(axis=-1))

        def work(part: slice) -> None:
            some = away[part]
            matrices[some] = _follow_one_branch(self.problem, nearest[some], begins[some], points[some]).matrices

        run_over(slices(len(away), CHUNK), work, progress)
        lost = np.asarray(np.isnan(matrices).any(axis=(-2, -1)))
        determinants = np.where(lost, np.nan, np.linalg.det(np.where(lost[:, None, None], 0.0, matrices)))
        status = np.where(lost, Status.DIVERGED, Status.OK).astype(np.uint8)
        return Matrices(matrices, determinants, determinants - 1.0, status)


@dataclass(frozen=True, eq=False)
class _Solved:
    """States (n, d) of orbits, monodromy matrices (n, d, d) and derivatives of the states by the parameters (n, d, m).

    NaN where there is no orbit.
    """

    states: Floats
    matrices: Floats
    drifts: Floats

    @property
    def sides(self) -> Floats:
        """Signs of det(M - I), different on branches that cross or lie side by side; 0 where there is no orbit."""
        known = np.asarray(np.isfinite(self.matrices).all(axis=(-2, -1)))
        unit = np.eye(self.states.shape[-1])
        return np.sign(np.linalg.det(np.where(known[:, None, None], self.matrices, unit) - unit))

    def __getitem__(self, part: Any) -> _Solved:
        return _Solved(self.states[part], self.matrices[part], self.drifts[part])

    def __setitem__(self, part: Any, other: _Solved) -> None:
        self.states[part], self.matrices[part], self.drifts[part] = other.states, other.matrices, other.drifts


def _solve(problem: OrbitProblem, guesses: Floats, values: Floats) -> _Solved:
    """Return the orbits near guesses (n, d) at parameters (n, m)."""
    n, d, m = len(guesses), problem.dimension, values.shape[-1]
    scale, spans = problem.scale[:d], problem.scale[d:]
    given = values / spans

    def equations(rows: Ints, states: Floats) -> tuple[Floats, Floats]:
        residual, slopes = problem(np.concatenate([states, given[rows]], axis=-1))
        return residual, slopes[..., :d]

    found = _Solved(np.full((n, d), np.nan), np.full((n, d, d), np.nan), np.full((n, d, m), np.nan))
    states, _, settled = solutions(equations, guesses / scale, np.ones(d), _NEAR)
    rows = np.flatnonzero(settled)
    slopes = problem(np.concatenate([states[rows], given[rows]], axis=-1))[1]
    own, regular = slopes[..., :d], np.abs(np.linalg.det(slopes[..., :d])) > 1e-14
    found.states[rows] = states[rows] * scale
    found.matrices[rows] = (own + np.eye(d)) * scale[:, None] / scale
    drifts = np.linalg.solve(np.where(regular[:, None, None], own, np.eye(d)), -slopes[..., d:])
    found.drifts[rows] = np.where(regular[:, None, None], drifts * scale[:, None] / spans, 0.0)
    shorter = _repeat_themselves(problem, found.states, values)
    found.states[shorter] = found.matrices[shorter] = np.nan
    return found


def _repeat_themselves(problem: OrbitProblem, states: Floats, values: Floats) -> Bools:
    """Return which orbits have a shorter period: a doubled orbit's parent solves its equations too."""
    repeated = np.zeros(len(states), bool)
    rows = np.flatnonzero(np.isfinite(states).all(axis=-1)) if problem.period > 1 else np.empty(0, np.int64)
    if len(rows):
        begin = np.concatenate([states[rows], values[rows]], axis=-1)
        orbit, d = begin, problem.dimension
        for k in range(1, problem.period // 2 + 1):
            orbit = follow(problem.swept, orbit, 1).points
            if problem.period % k == 0:
                apart = difference(orbit[:, :d], begin[:, :d], problem.point_map.coordinates) / problem.scale[:d]
                repeated[rows] |= (np.abs(apart) <= _OPEN).all(axis=-1)
    return repeated


def _one_step(problem: OrbitProblem, begin: _Solved, before: Floats, after: Floats) -> _Solved:
    """Return the orbits at parameters `after` (n, m) where they are as foreseen from `before`, and on the same side."""
    foreseen = np.einsum("nij,nj->ni", begin.drifts, after - before)
    found = _solve(problem, begin.states + foreseen, after)
    wrong = ~(_as_foreseen(problem, begin, found, foreseen) & (begin.sides * found.sides > 0.0))
    found.states[wrong] = found.matrices[wrong] = np.nan
    return found


def _as_foreseen(problem: OrbitProblem, begin: _Solved, end: _Solved, foreseen: Floats) -> Bools:
    scale = problem.scale[: problem.dimension]
    with np.errstate(invalid="ignore"):
        wrong = np.abs((end.states - begin.states - foreseen) / scale).max(axis=-1)
        return np.asarray(wrong <= _FORESEEN * np.abs(foreseen / scale).max(axis=-1) + _SMALL)


def _several_steps(
    problem: OrbitProblem, begin: _Solved, before: Floats, after: Floats, longest: float = 1.0
) -> _Solved:
    """Return the orbits at parameters `after` (n, m) to which those at `before` lead, in steps that are short enough.

    A step, as a fraction of the way, is halved where the orbit is not where its derivatives by the parameters foresaw
    it.
    """
    here = begin[np.arange(len(before))]
    share, step = np.zeros(len(before)), np.full(len(before), longest)
    active = np.flatnonzero(np.isfinite(here.states).all(axis=-1))
    while len(active):
        step[active] = np.minimum(step[active], 1.0 - share[active])
        moved = step[active, None] * (after[active] - before[active])
        foreseen = np.einsum("nij,nj->ni", here.drifts[active], moved)
        to = before[active] + (share[active] + step[active])[:, None] * (after[active] - before[active])
        there = _solve(problem, here.states[active] + foreseen, to)
        good = _as_foreseen(problem, here[active], there, foreseen)
        here[active[good]] = there[good]
        share[active[good]] += step[active[good]]
        step[active] = np.where(good, np.minimum(2.0 * step[active], longest), 0.5 * step[active])
        given_up = active[~good & (step[active] < _SHORTEST)]
        here.states[given_up] = here.matrices[given_up] = np.nan
        share[given_up] = 1.0
        active = active[share[active] < 1.0 - 1e-12]
    return here


def _follow_one_branch(problem: OrbitProblem, begin: _Solved, before: Floats, after: Floats) -> _Solved:
    """Follow orbits; where branches seem to cross on the way, again in steps short enough to stay on one branch."""
    found = _several_steps(problem, begin, before, after)
    crossed = np.flatnonzero(begin.sides * found.sides < 0.0)
    if len(crossed):
        found[crossed] = _several_steps(problem, begin[crossed], before[crossed], after[crossed], _CAREFUL)
    return found


def follow_over(
    point_map: PointMap,
    orbit: PeriodicOrbit | Attractor,
    names: tuple[str, str],
    x: Floats,
    y: Floats,
    progress: str | None,
) -> FollowedOrbit:
    """Follow an orbit from its own parameters over a grid, from each point to its neighbours.

    Derivatives by the parameters foresee where it moves.  A point has no orbit if none of its neighbours leads there.
    """
    exact, state, period = begin_orbit(point_map, orbit, names[0], "equilibrium")
    known_parameter("y[0]", names[1], exact.params)
    problem = orbit_problem(exact, state, period, names, (float(np.ptp(x)), float(np.ptp(y))))
    claim_memory(f"an orbit over {x.size} x {y.size} points", 8 * x.size * y.size * problem.dimension, "give fewer")
    d, shape = problem.dimension, (len(y), len(x))
    grid = _Solved(np.full((*shape, d), np.nan), np.full((*shape, d, d), np.nan), np.full((*shape, d, 2), np.nan))
    own = np.array([[exact.params[name] for name in names]])
    first = int(np.argmin(np.abs(y - own[0, 1]))), int(np.argmin(np.abs(x - own[0, 0])))
    start = _solve(problem, state[None], own)
    start = _follow_one_branch(problem, start, own, np.array([[x[first[1]], y[first[0]]]]))
    if np.isnan(start.states).any():
        raise ValueError(
            f"equilibrium={orbit!r}: it ceases to exist between {names[0]}={own[0, 0]:g}, {names[1]}={own[0, 1]:g} and "
            "the nearest point of the grid; give values nearer to its own"
        )
    grid[first] = start[0]
    known, tries = np.zeros(shape, bool), np.zeros(shape, np.int64)
    known[first] = True
    front = np.array([first])
    hard = np.empty((0, 2, 2), np.int64)
    with progress_bar(known.size, progress) as tick:
        while len(front) or len(hard):
            # Most points are one step away; the others wait until they are many.
            easy = bool(len(front))
            links = _links(front, known) if easy else hard
            begins, places = links[:, 0], links[:, 1]
            before, after = (np.stack([x[p[:, 1]], y[p[:, 0]]], axis=-1) for p in (begins, places))
            nearest = grid[tuple(begins.T)]
            parts: dict[int, _Solved] = {}

            def work(part: slice) -> None:
                follow = _one_step if easy else _follow_one_branch  # noqa: B023
                parts[part.start] = follow(problem, nearest[part], before[part], after[part])  # noqa: B023

            run_over(slices(len(places), CHUNK), work)
            for begin, found in parts.items():
                there = places[begin : begin + len(found.states)]
                good = np.isfinite(found.states).all(axis=-1)
                grid[tuple(there[good].T)] = found[good]
                known[tuple(there[good].T)] = True
            if easy:
                hard = np.concatenate([hard, links[~known[tuple(places.T)]]])
            else:
                tries[tuple(places.T)] += 1
                hard = np.empty((0, 2, 2), np.int64)
            front = places[known[tuple(places.T)]]
            hard = hard[~known[tuple(hard[:, 1].T)] & (tries[tuple(hard[:, 1].T)] < _TRIES)]
            hard = hard[np.unique(hard[:, 1], axis=0, return_index=True)[1]]
            tick(len(front))
    return FollowedOrbit(problem, x, y, grid)


def _links(front: Ints, known: Bools) -> Ints:
    """Return pairs (n, 2, 2) of a place of a front and an unknown one next to it, every such place once."""
    links = []
    for move in np.array([[0, 1], [0, -1], [1, 0], [-1, 0]]):
        there = front + move
        inside = np.asarray(((there >= 0) & (there < known.shape)).all(axis=1))
        inside[inside] &= ~known[tuple(there[inside].T)]
        links.append(np.stack([front[inside], there[inside]], axis=1))
    every = np.concatenate(links)
    return every[np.unique(every[:, 1], axis=0, return_index=True)[1]]
