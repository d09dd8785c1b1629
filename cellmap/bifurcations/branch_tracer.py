"""Continuation of a branch of periodic orbits, with detection of its bifurcations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from .._lib.arrays import Floats
from ..maps.coordinates import wrap
from ..maps.grazing import GRAZING as GRAZES
from ..maps.grazing import contacts
from ..maps.point_map import PointMap
from ..maps.stroboscopic import Stroboscopic
from ..orbits.arclength import FAR, LOST, MOST, Box, ContinuationStep, End, SolutionPoint, corrected, tangent_of, trace
from ..orbits.orbit_equations import OrbitProblem
from .branch import Bifurcation, Branch, BranchPart
from .branch_ends import LimitCycles
from .detection import TESTS, Detector, signs
from .function_zeros import values_of
from .kinds import BifurcationKind
from .period_measures import OrbitFunction

_FIRST_STEP, _NEAREST = 0.02, 1e-12  # first step on a new branch, scaled, and the shortest
LARGE, GRAZING, AT_SECTION = "large multipliers", "grazing", "impact at the section"
RESTING, _ACROSS = "rest begins or ends", 1e-6  # reason of an end, and step across that place
OUTGROWN, _OUTGROWN = "outgrown", 1e3  # reason of an end, and size of an orbit in its unit that asks for another unit
_ON_SURFACE = 1e-6  # value of a guard on its surface, where steps have become as short as 1e-9
_SEEN, _LOCATED = 10, 1e-9  # last points that tell where orbits graze, and the scaled error of that place
_BESIDE = 0.37  # part of a step beside an initial point that is a bifurcation


@dataclass(frozen=True, eq=False)
class BranchSegment:
    """Solution points from an initial one on, the bifurcations between them, and the reason why they end."""

    places: list[SolutionPoint]
    found: list[Bifurcation]
    end: str

    def reversed(self) -> BranchSegment:
        """Return the segment in the opposite direction."""
        last = len(self.places) - 2
        found = [replace(b, before=b.after, after=b.before, place=last - b.place) for b in reversed(self.found)]
        return BranchSegment(self.places[::-1], found, self.end)


@dataclass(frozen=True, eq=False)
class BranchTracer:
    """Tracer of a branch."""

    point_map: PointMap
    name: str
    problem: OrbitProblem
    interval: tuple[float, float]
    longest: float
    most: int
    label: str | None
    stop_at: frozenset[BifurcationKind] = frozenset()
    largest_growth: float = np.inf
    keeps_units: bool = True
    until: Mapping[str, OrbitFunction] = field(default_factory=dict)
    origin: SolutionPoint | None = None

    @property
    def detector(self) -> Detector:
        """Detector of bifurcations."""
        return Detector(self.problem)

    @property
    def _box(self) -> Box:
        return Box.of([self.interval], self.problem.scale[-1:])

    def trace(self, start: SolutionPoint) -> BranchSegment:
        """Trace the branch along the tangent of a solution point.

        A step is repeated with half its length where a test function vanishes at its end, where one seems to have
        been to zero and back, and where the bifurcations found do not explain the number of unstable multipliers.
        """
        detector, found = self.detector, list[Bifurcation]()
        before, slopes, number = detector.values_at(start), np.zeros(len(TESTS)), 0
        _, impacts = self._contacts([start])
        cycles = LimitCycles.of(self.problem, self.name)
        fastest = 0.0 if cycles is None else cycles.speed(start)
        heights = self._heights(start)

        def visit(step: ContinuationStep, may_refuse: bool) -> End | Literal["refused"] | None:
            nonlocal before, slopes, number, fastest, heights
            reached = self._until(step, heights)
            step = step if reached is None else reached[1]
            # Orbits with one impact more or less are beyond grazing; those that lead to rest are without number.
            if -np.inf < self._contacts([step.end])[1] != impacts > -np.inf:
                return "refused"
            if cycles is not None:
                speed = cycles.speed(step.end)
                fastest = max(fastest, speed)
                if vanished := cycles.vanishing(step.end, speed, fastest):
                    return End(vanished, step.end)
            after = detector.values_at(step.end).following(before, step, [])
            events, clear = detector.events(step, before, after)
            # A line through the last two values tells where a function heads.
            held = before.held(after)
            first, last = before.without(held), after.without(held)
            headed, side = signs(first + slopes * step.length), signs(first)
            back = (headed != side) & (signs(last) == side) & before.informative & after.informative
            unclear = after.is_singular(before) or not clear or bool(back.any())
            if may_refuse and unclear and box.contains(step.end):
                return "refused"
            if step.length > 0.0:
                found.extend(replace(b, place=number) for b in events)
                before = after.following(before, step, events)
                slopes, number = (last - first) / step.length, number + 1
            if any(b.kind in self.stop_at and b.after > b.before == 0 for b in events):
                return End("bifurcation", step.end)
            if reached is not None:
                return End(reached[0], step.end)
            heights = self._heights(step.end)
            if box.contains(step.end) and self.problem.growth(step.end) > self.largest_growth:
                return End(LARGE, step.end)
            if not self.keeps_units and self._grown(step.end) > _OUTGROWN and box.contains(step.end):
                return End(OUTGROWN, step.end)
            return None

        box, problem = self._box, self.problem
        places, end = trace(
            problem,
            start,
            box,
            self.longest,
            self.most,
            self.label,
            problem.growing,
            problem.circles,
            visit,
            self.origin,
        )
        if end == LOST and cycles is not None:
            end = cycles.end_of(places, fastest) or end
        if end in (LOST, LARGE):
            distance, struck = self._contacts(places[-1:])
            if end == LOST and self._rests_on_one_side(places[-1]):
                end = RESTING
            elif (last := self._where_it_grazes(places[-_SEEN:])) is not None:
                places, end = [*places, last], GRAZING
            elif end == LOST and struck > -np.inf and abs(distance) <= GRAZES:
                end = GRAZING
            elif end == LOST and struck > 0.0 and self._strikes_at_section(places[-1]):
                end = AT_SECTION
        if end in (LARGE, OUTGROWN) and len(places) > self.most:
            end = MOST
        return BranchSegment(places, found, end)

    def _heights(self, place: SolutionPoint) -> dict[str, float]:
        """Return the functions at whose zeros the branch ends."""
        orbits, unknowns = self.problem, place.unknowns[None]
        return {name: float(values_of(orbits, (self.name,), f, unknowns)[0]) for name, f in self.until.items()}

    def _until(self, step: ContinuationStep, before: Mapping[str, float]) -> tuple[str, ContinuationStep] | None:
        """Return the first function that passes zero on a step, and the step up to there; None for none."""
        after, found = self._heights(step.end), list[tuple[str, ContinuationStep]]()
        for name in (
            name for name in self.until if before[name] * after[name] < 0.0 or after[name] == 0.0 != before[name]
        ):
            place = step.zero(lambda place: self._heights(place)[name], (before[name], after[name]))  # noqa: B023
            if place is not None:
                found.append((name, replace(step, end=place, length=step.along(place.unknowns))))
        return min(found, key=lambda f: f[1].length, default=None)

    def _contacts(self, places: Sequence[SolutionPoint]) -> tuple[Floats, Floats]:
        """Return how near orbits come to grazing, below 0 for those that touch, and the numbers of their impacts."""
        problem = self.problem
        states = np.array([problem.once(place.unknowns * problem.scale) for place in places])
        return contacts(problem.swept, states, problem.period)

    def _where_it_grazes(self, places: Sequence[SolutionPoint]) -> SolutionPoint | None:
        """Return the place at which the orbit touches a surface, which is beyond the last ones; None if it does not.

        Unknowns are smooth functions of the distance before the surface, and of its square root, the speed, behind it.
        They are extrapolated to 0 by Neville's scheme, from no farther than the places reach.
        """
        distances = self._contacts(places)[0]
        distances[~np.isfinite(distances)] = 0.0
        side = np.sign(distances[-_SEEN // 2 :].sum())  # the last ones are rounding of either sign
        same = distances * side > 0.0
        along = np.sqrt(np.abs(distances[same])) if side < 0.0 else distances[same]
        rows = near = np.array([place.unknowns for place in places])[same]
        best, error = None, _LOCATED
        for k in range(1, len(along)):
            apart = (along[k:] - along[:-k])[:, None]
            with np.errstate(divide="ignore", invalid="ignore"):
                finer = (along[k:, None] * rows[:-1] - along[:-k, None] * rows[1:]) / apart
            errors = np.abs(finer - rows[1:]).max(axis=1)
            if k > 1 and np.nanmin(errors, initial=np.inf) < error:
                best, error = finer[np.nanargmin(errors)], float(np.nanmin(errors))
            rows = finer
        if best is None or np.linalg.norm(best - near[-1]) > np.linalg.norm(near[-1] - near[0]):
            return None
        return replace(places[-1], unknowns=best)

    def _rests_on_one_side(self, place: SolutionPoint) -> bool:
        """Return whether orbits come to rest either before a place or beyond it, and with a number of impacts else."""
        sides = [replace(place, unknowns=place.unknowns + d * place.tangent) for d in (-_ACROSS, _ACROSS)]
        return bool(np.isinf(self._contacts(sides)[1]).sum() == 1)

    def _strikes_at_section(self, place: SolutionPoint) -> bool:
        """Return whether there is an impact at the time of the section, before or after which states are other ones."""
        orbit = self.problem.orbit_at(place.unknowns)
        spec = self.point_map.with_params(**orbit.params).spec
        assert isinstance(spec, Stroboscopic), "other maps know of no impacts"
        system, time = spec.system, spec.phase * spec.system.length
        guards = [impact.guard(time, x, system.parameters) for impact in system.impacts for x in orbit.points.tolist()]
        return bool(min(map(abs, guards)) < _ON_SURFACE)

    def _grown(self, place: SolutionPoint) -> float:
        return float(np.abs(place.unknowns[self.problem.growing]).max(initial=0.0))

    def follow(self, start: SolutionPoint) -> Pieces:
        """Trace the branch along the tangent of a solution point, in larger units where the orbit outgrows its own."""
        tracer, pieces = self, Pieces()
        while True:
            segment = tracer.trace(start)
            pieces.append((tracer, segment))
            left = tracer.most - len(segment.places) + 1
            if segment.end != OUTGROWN or left < 1:
                return pieces
            last = segment.places[-1]
            problem = tracer.problem.enlarged(tracer._grown(last) / FAR)
            further = tracer._in_units_of(problem, last)
            if further is None:
                return pieces
            origin = tracer._in_units_of(problem, tracer.origin or start)
            start, tracer = further, replace(tracer, problem=problem, most=left, origin=origin)

    def _in_units_of(self, problem: OrbitProblem, place: SolutionPoint) -> SolutionPoint | None:
        """Return a solution point in the units of a problem with the same equations; None where it has no tangent."""
        unknowns, along = (v * self.problem.scale / problem.scale for v in (place.unknowns, place.tangent))
        derivatives = problem(unknowns)[1]
        tangent = tangent_of(derivatives, along)
        return None if tangent is None else SolutionPoint(unknowns, derivatives, tangent)

    def clear_start(self, start: SolutionPoint) -> SolutionPoint:
        """Return a point beside the initial one if that is a bifurcation, so that it is passed; else itself."""
        box, here = self._box, self.detector.values_at(start)
        for sign in (-1.0, 1.0):
            length = sign * _BESIDE * self.longest
            there = corrected(self.problem, start.unknowns + length * start.tangent, start.tangent)
            if there is not None and box.contains(there):
                beside = self.detector.values_at(there)
                if not here.is_singular(beside):
                    return start
                if not beside.is_singular(beside):
                    return there
        return start

    def resumed(self, old: OrbitProblem, last: SolutionPoint) -> SolutionPoint | None:
        """Return the solution point at which a branch goes on that was followed by other equations; None for none."""
        problem, d = self.problem, self.problem.dimension
        state, along = (old.once(v * old.scale) for v in (last.unknowns, last.tangent))
        there = corrected(problem, problem.through(state), problem.parameter_direction)
        if there is None:
            return None
        heading = problem.once(there.tangent * problem.scale) @ (
            along / np.append(problem.scale[:d], problem.scale[-1]) ** 2
        )
        return replace(there, tangent=there.tangent * (1.0 if heading > 0.0 else -1.0))

    def branch(self, ahead: BranchSegment) -> Branch:
        """Return the branch of one segment, which leaves a bifurcation."""
        return joined([], [(self, ahead)])


Pieces = list[tuple[BranchTracer, BranchSegment]]
"""Segments one after the other, each begins at the last point of the one before, with their tracers."""


def joined(back: Pieces, ahead: Pieces) -> Branch:
    """Join the segments on both sides of an initial point; those of `back` lead away from it."""
    first = ahead[0][0]
    pieces = [(tracer, segment.reversed()) for tracer, segment in back[::-1]] + ahead
    d, shift = first.problem.dimension, 0
    found: list[Bifurcation] = []
    parts: list[BranchPart] = []
    for tracer, segment in pieces:
        unknowns = np.array([p.unknowns for p in segment.places]) * tracer.problem.scale
        parts.append(BranchPart(shift, tracer.problem, unknowns))
        found += [replace(b, place=b.place + shift) for b in segment.found]
        shift += len(segment.places) - 1
    seen = [(tracer, place) for tracer, segment in pieces for place in segment.places[:-1]]
    seen.append((pieces[-1][0], pieces[-1][1].places[-1]))
    states = np.array([tracer.problem.once(place.unknowns * tracer.problem.scale) for tracer, place in seen])
    return Branch(
        parameter=first.name,
        period=first.problem.period,
        values=np.clip(states[:, -1], *first.interval),
        points=wrap(states[:, :d], first.point_map.coordinates),
        multipliers=np.array([tracer.problem.multipliers(place) for tracer, place in seen]),
        bifurcations=tuple(found),
        ends=(back[-1][1].end if back else "bifurcation", ahead[-1][1].end),
        point_map=first.point_map,
        _parts=tuple(parts),
    )


def born_orbit(
    tracer: BranchTracer, bifurcation: Bifurcation, span: float, shrinking: float = 1.0, side: int = 1
) -> tuple[BranchTracer, SolutionPoint] | None:
    """Return where the branch begins that leaves a bifurcation of a tracer's branch, and its tracer.

    The parameter is rescaled by `span`, states by a factor.  None where no orbit is found.
    """
    assert bifurcation._branch_direction is not None
    old = tracer.problem
    rounds = 2 if bifurcation.kind is BifurcationKind.PERIOD_DOUBLING else 1
    problem = old.over(rounds, shrinking, span)
    origin, branch_direction, along = (
        old.repeated(v * old.scale, rounds, sign) / problem.scale
        for v, sign in (
            (bifurcation._unknowns, 1.0),
            (bifurcation._branch_direction, -1.0),
            (bifurcation._along, 1.0),
        )
    )
    branch_direction, along = side * branch_direction / np.linalg.norm(branch_direction), along / np.linalg.norm(along)
    # Across the old branch, so that this is not found again.
    normal = branch_direction - (branch_direction @ along) * along
    normal /= np.linalg.norm(normal)
    first = min(_FIRST_STEP, tracer.longest)
    while first > _NEAREST:
        start = corrected(problem, origin + first * branch_direction, normal)
        if start is not None:
            away = float(np.linalg.norm(start.unknowns - origin))
            # A doubled orbit is not closed after the original period.
            if away < 3.0 * first and (rounds == 1 or old.opened(problem, start.unknowns) > 0.1 * away):
                return replace(tracer, problem=problem), start
        first *= 0.5
    return None
