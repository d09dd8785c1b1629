"""Continuation of a branch of periodic orbits, with detection of its bifurcations."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._lib.threads import progress_bar
from ..maps.coordinates import wrap
from ..maps.point_map import PointMap
from .arclength import ContinuationStep, SolutionPoint, continuation_steps, corrected
from .branch import Bifurcation, Branch
from .detection import TESTS, Detector
from .kinds import BifurcationKind
from .orbit_equations import OrbitProblem

_REFUSALS = 6  # halvings of a step on which more seems to happen than is found
_FIRST_STEP, _NEAREST = 0.02, 1e-12  # first step on a new branch, scaled, and the shortest
LARGE = "large multipliers"
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

    @property
    def detector(self) -> Detector:
        """Detector of bifurcations."""
        return Detector(self.problem)

    @property
    def _edges(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        low, high = (v / self.problem.scale[-1:] for v in self.interval)
        slack = 1e-13 * np.maximum(np.abs(low), np.abs(high))
        return low - slack, high + slack

    def trace(self, start: SolutionPoint) -> BranchSegment:
        """Trace the branch along the tangent of a solution point."""
        low, high = self._edges
        places, found = [start], []
        with progress_bar(self.most, self.label) as tick:
            for step, events in self._steps(start):
                found += [replace(b, place=len(places) - 1) for b in events]
                places.append(step.end)
                tick(1)
                if any(b.kind in self.stop_at and not b.before for b in events):
                    return BranchSegment(places, found, "bifurcation")
                if not low < step.end.unknowns[-1] < high:
                    return BranchSegment(places, found, "left the interval")
                if len(places) > 3 and step.passes(start, self.problem.circles):
                    return BranchSegment(places, found, "closed")
                if self.problem.growth(step.end) > self.largest_growth:
                    return BranchSegment(places, found, LARGE)
                if len(places) > self.most:
                    return BranchSegment(places, found, "most points")
        inside = low < places[-1].unknowns[-1] < high
        return BranchSegment(places, found, "no convergence" if inside else "left the interval")

    def clear_start(self, start: SolutionPoint) -> SolutionPoint:
        """Return a point beside the initial one if that is a bifurcation, so that it is passed; else itself."""
        low, high = self._edges
        here = self.detector.values_at(start)
        for sign in (-1.0, 1.0):
            length = sign * _BESIDE * self.longest
            there = corrected(self.problem, start.unknowns + length * start.tangent, start.tangent)
            if there is not None and low < there.unknowns[-1] < high:
                beside = self.detector.values_at(there)
                if not here.is_singular(beside):
                    return start
                if not beside.is_singular(beside):
                    return there
        return start

    def _steps(self, start: SolutionPoint) -> Iterator[tuple[ContinuationStep, list[Bifurcation]]]:
        """Yield continuation steps with the bifurcations on them, the last one cut at the interval.

        A step is repeated with half its length where a test function vanishes at its end, where one seems to have
        been to zero and back, and where the bifurcations found do not explain the number of unstable multipliers.
        """
        detector, (low, high) = self.detector, self._edges
        ahead = continuation_steps(self.problem, start, self.longest, self.problem.growing)
        step: ContinuationStep | None = next(ahead, None)
        before, slopes = detector.values_at(start), np.zeros(len(TESTS))
        while step is not None:
            part = step
            if not low <= step.end.unknowns[-1] <= high:
                cut = step.cut(self.problem.states, low, high)
                if cut is None:
                    step = _send(ahead, True)
                    continue
                part = cut
            after = detector.values_at(part.end)
            events, clear = detector.events(part, before, after)
            # A line through the last two values tells where a function heads.
            headed = np.where(before.tests + slopes * part.length < 0.0, -1, 1)
            back = (headed != before.sides) & (after.sides == before.sides) & before.informative & after.informative
            doubtful = after.is_singular(before) or not clear or bool(back.any())
            if doubtful and part is step and step.length > self.longest * 2.0**-_REFUSALS:
                step = _send(ahead, True)
                continue
            if part.length > 0.0:
                yield part, events
            if part is not step:
                return
            before, slopes = after, (after.tests - before.tests) / part.length
            step = _send(ahead, False)

    def branch(self, back: BranchSegment | None, ahead: BranchSegment) -> Branch:
        """Join the segments on both sides of the initial point."""
        places = ahead.places if back is None else [*back.places[:-1], *ahead.places]
        shift = 0 if back is None else len(back.places) - 1
        found = [replace(b, place=b.place + shift) for b in ahead.found]
        unknowns = np.array([p.unknowns for p in places]) * self.problem.scale
        return Branch(
            parameter=self.name,
            period=self.problem.period,
            values=np.clip(unknowns[:, -1], *self.interval),
            points=wrap(unknowns[:, : self.problem.dimension], self.point_map.coordinates),
            multipliers=np.array([self.detector.multipliers(p) for p in places]),
            bifurcations=(*(back.found if back else []), *found),
            ends=("bifurcation" if back is None else back.end, ahead.end),
            point_map=self.point_map,
            _problem=self.problem,
            _unknowns=unknowns,
        )


def _send(ahead: Any, refused: bool) -> ContinuationStep | None:
    try:
        return ahead.send(refused)
    except StopIteration:
        return None


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
            gap = old(old.once(start.unknowns * problem.scale) / old.scale)[0]
            open_by = float(np.linalg.norm(gap * old.scale[:-1] / problem.scale[: old.states]))
            if away < 3.0 * first and (rounds == 1 or open_by > 0.1 * away):
                return replace(tracer, problem=problem), start
        first *= 0.5
    return None
