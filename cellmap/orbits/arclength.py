"""Pseudo-arclength continuation of the solutions of n equations in n + 1 unknowns."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from .._lib.arrays import Bools, Floats
from .._lib.stopping import check_stop
from .._lib.threads import progress_bar
from ..maps.coordinates import shortest

Problem = Callable[[Floats], tuple[Floats, Floats]]
"""Returns residuals (n,) and their derivatives (n, n + 1) at unknowns (n + 1,), all scaled to be of order 1."""

_ITERATIONS = 10
_CONVERGED = 1e-14  # scaled length of a Newton step that moves nothing any more
_FLOOR = 1e-6  # Newton steps below this that no longer shrink are rounding,
_ROUNDING = 1e-8  # if the residual is
_SHRINKING = 0.75  # or less, as from half to half where two solutions are close together
_STRAIGHT = 0.95  # cosine of the angle between neighbouring tangents from which a step was too long
_SHORTEST = 1e-9
FAR = 10.0
"""Times the size that unknowns began with from which this says nothing of them."""
_CREEPING = 1e-9  # part of a step in the other unknowns that may be rounding
LOST, MOST = "no convergence", "most points"
_REPEATED = 0.43  # no power of it leads back to round numbers
_ALIGNED = 0.9  # cosine of the angle between tangents of one curve at one place
_REFUSALS = 6  # halvings of a step that is refused, or on which the edge of the box is not located
_AT_END, _LOCATED = 1e-8, 1e-3  # part of its largest value that a test function has where it is zero: at an end, within
_OFF = 1e-9  # scaled distance from the edge of a box of a point that is not on it
_SLACK = 1e-13  # relative distance from the edge of a box that counts as rounding


@dataclass(frozen=True, eq=False)
class SolutionPoint:
    """A solution (n + 1,), the derivatives (n, n + 1) there, and the unit tangent of the curve."""

    unknowns: Floats
    derivatives: Floats
    tangent: Floats

    @property
    def bordered(self) -> float:
        """Determinant of derivatives and tangent: it changes sign where curves cross."""
        return float(np.linalg.det(np.vstack([self.derivatives, self.tangent])))


def corrected(problem: Problem, guess: Floats, normal: Floats) -> SolutionPoint | None:
    """Return the solution in the plane through a guess, by Newton's method; None where it does not converge.

    The tangent of the curve points along `normal`.
    """
    unknowns, last = guess.copy(), np.inf
    for _ in range(_ITERATIONS):
        residual, derivatives = problem(unknowns)
        if not (np.isfinite(residual).all() and np.isfinite(derivatives).all()):
            return None
        matrix = np.vstack([derivatives, normal])
        try:
            change = np.linalg.solve(matrix, -np.append(residual, normal @ (unknowns - guess)))
        except np.linalg.LinAlgError:
            return None
        length = float(np.linalg.norm(change))
        # Rounding of unknowns leaves larger residuals where a parameter moves orbits far.
        rounding = np.maximum(_ROUNDING, np.spacing(1.0) * np.abs(derivatives) @ np.abs(unknowns))
        stays = last <= _FLOOR and not length < _SHRINKING * last and bool((np.abs(residual) <= rounding).all())
        if length <= _CONVERGED or stays:
            # The derivatives are those at the place itself, not at one before it.
            tangent = tangent_of(derivatives, normal)
            return None if tangent is None else SolutionPoint(unknowns, derivatives, tangent)
        if not length < 2.0 * last:
            return None
        unknowns = unknowns + change
        last = length
    return None


def started(problem: Problem, guess: Floats) -> SolutionPoint | None:
    """Return the solution near a guess on a curve whose direction is not known; None where it is not found."""
    slopes = problem(guess)[1]
    return corrected(problem, guess, np.linalg.svd(slopes)[2][-1]) if np.isfinite(slopes).all() else None


def tangent_of(derivatives: Floats, along: Floats) -> Floats | None:
    """Return the unit vector that the derivatives (n, n + 1) map to zero, pointing along another."""
    try:
        found = np.linalg.solve(np.vstack([derivatives, along]), np.append(np.zeros(len(derivatives)), 1.0))
    except np.linalg.LinAlgError:
        return None
    length = float(np.linalg.norm(found))
    return found / length if np.isfinite(length) else None


Test = Callable[[SolutionPoint], float]
"""Function of solution points whose zeros are of interest."""


@dataclass(frozen=True, eq=False)
class ContinuationStep:
    """A step along a curve from one solution point to the next, `length` along the tangent of the first."""

    problem: Problem
    begin: SolutionPoint
    end: SolutionPoint
    length: float

    def at(self, length: float) -> SolutionPoint | None:
        """Return the solution point at a distance along the tangent."""
        begin = self.begin
        return corrected(self.problem, begin.unknowns + length * begin.tangent, begin.tangent)

    def since(self, place: SolutionPoint) -> ContinuationStep:
        """Return the step from an earlier solution point to the end of this one."""
        return replace(self, begin=place, length=float(place.tangent @ (self.end.unknowns - place.unknowns)))

    def interpolated(self, share: float) -> SolutionPoint:
        """Return a point between the ends that is near a solution."""
        begin, end = self.begin, self.end
        return replace(begin, unknowns=begin.unknowns + share * (end.unknowns - begin.unknowns))

    def located(self, test: Test) -> SolutionPoint | None:
        """Return the solution point between the ends at which a test function changes its sign.

        Where interpolation does not get there, as at zeros of high multiplicity, the step is halved instead.
        """
        from scipy.optimize import bisect, brentq

        places: dict[float, SolutionPoint | None] = {0.0: self.begin}

        def place_at(length: float) -> SolutionPoint | None:
            if length not in places:
                places[length] = self.at(length)
            return places[length]

        def value(length: float) -> float:
            place = place_at(length)
            if place is None:
                raise FloatingPointError
            return test(place)

        try:
            bounds = {"xtol": 1e-15, "rtol": 1e-14, "full_output": True, "disp": False}
            length, found = brentq(value, 0.0, self.length, **bounds)
            return place_at(length if found.converged else bisect(value, 0.0, self.length, **bounds)[0])
        except (FloatingPointError, ValueError):
            return None

    def where(self, k: int, value: float) -> SolutionPoint | None:
        """Return the solution point between the ends at which an unknown has a value that it passes from end to end."""
        begin, end = self.begin.unknowns, self.end.unknowns
        passed, plane = end[k] - begin[k], np.zeros(len(begin))
        guess = begin + (value - begin[k]) / passed * (end - begin)
        guess[k], plane[k] = value, np.sign(passed)
        place = corrected(self.problem, guess, plane)
        if (
            place is not None
            and 0.0 <= self.along(place.unknowns) <= self.length
            and float(place.tangent @ self.begin.tangent) > _ALIGNED
        ):
            return place
        # A curve that is nearly parallel to the plane, or another one.
        return self.located(lambda place: float(place.unknowns[k] - value))

    def zero(
        self, test: Test, values: Sequence[float], locate: Callable[[], SolutionPoint | None] | None = None
    ) -> SolutionPoint | None:
        """Return the solution point at which a test function is zero that has some values at both ends.

        It is an end where the function is rounding beside its value at the other one.  A function changes its sign at a
        pole as well, and at a jump, where it is not zero.  ``locate`` replaces :meth:`located` where that cannot work.
        """
        size = max(map(abs, values))
        if abs(values[1]) <= _AT_END * size:
            return self.end
        if abs(values[0]) <= _AT_END * size:
            return self.begin
        if not values[0] * values[1] < 0.0:
            return None
        place = self.located(test) if locate is None else locate()
        return place if place is not None and abs(test(place)) < _LOCATED * size else None

    def along(self, unknowns: Floats) -> float:
        """Return how far along the tangent unknowns are."""
        return float(self.begin.tangent @ (unknowns - self.begin.unknowns))

    def until(self, place: SolutionPoint, turns: Floats) -> ContinuationStep | None:
        """Return the step up to a point that it passes in the same direction, None if it does not.

        Unknowns with a period are angles.
        """
        apart = shortest(place.unknowns - self.begin.unknowns, turns)
        length = float(self.begin.tangent @ apart)
        aligned = float(place.tangent @ self.begin.tangent) > _ALIGNED
        if not (0.0 < length <= self.length and aligned and np.linalg.norm(apart) <= 1.1 * self.length):
            return None
        return replace(self, end=replace(place, unknowns=self.begin.unknowns + apart), length=length)


def continuation_steps(
    problem: Problem, begin: SolutionPoint, longest: float, growing: Bools
) -> Generator[ContinuationStep, bool | None, None]:
    """Yield steps along a curve from a solution point, without end; stop where no step is short enough.

    Steps are adapted to the angle between tangents, up to `longest`, or that part of the largest of the unknowns that
    are `growing`.  While these are far from the size that they began with, and the derivatives by them hardly change,
    steps grow until they are as long in the other unknowns.  A step that is sent back is repeated with less than half
    its length.
    """
    here, length = begin, longest
    while length > _SHORTEST:
        there = corrected(problem, here.unknowns + length * here.tangent, here.tangent)
        turned = -1.0 if there is None else float(here.tangent @ there.tangent)
        if there is None or turned < _STRAIGHT:
            length *= 0.5
            continue
        refused = yield ContinuationStep(problem, here, there, length)
        if refused:
            length *= _REPEATED
            continue
        slopes = [place.derivatives[:, :-1] for place in (here, there)]
        here = there
        reached = float(np.abs(here.unknowns[growing]).max(initial=1.0))
        largest, aside = longest * reached, float(np.linalg.norm(here.tangent[~growing]))
        if reached > FAR and aside > _CREEPING:
            changed = np.linalg.norm(slopes[1] - slopes[0]) / (1.0 + np.linalg.norm(slopes[1]))
            largest = max(largest, longest / aside) if changed < longest else largest
        length = min(largest, length * (1.5 if turned > 0.99 else 0.9))


@dataclass(frozen=True, eq=False)
class Box:
    """Intervals of the parameters, which are the last unknowns, in units of the unknowns."""

    lower: Floats
    upper: Floats

    @classmethod
    def of(cls, intervals: ArrayLike, units: ArrayLike) -> Box:
        """Return the box of intervals (m, 2) of the parameters, whose units are (m,)."""
        low, high = np.asarray(intervals, dtype=float).T / units
        slack = _SLACK * np.maximum(np.abs(low), np.abs(high))
        return cls(low - slack, high + slack)

    def holds(self, place: SolutionPoint) -> bool:
        """Return whether a solution point lies in the box or on its edge."""
        there = place.unknowns[-len(self.lower) :]
        return bool((there >= self.lower).all() and (there <= self.upper).all())

    def contains(self, place: SolutionPoint) -> bool:
        """Return whether a solution point lies inside the box."""
        there = place.unknowns[-len(self.lower) :]
        return bool((there > self.lower).all() and (there < self.upper).all())

    def cut(self, step: ContinuationStep) -> ContinuationStep | None:
        """Return a step up to where it leaves the box; None where that point is not found."""
        ends = []
        for k, (low, high) in enumerate(zip(self.lower, self.upper, strict=True), -len(self.lower)):
            value = step.end.unknowns[k]
            if not low <= value <= high:
                edge = low if value < low else high
                last = step.where(k, edge)
                # Corrections of long steps may lead to another curve beyond the edge, and to none at it.
                if last is None or abs(last.unknowns[k] - edge) > _OFF:
                    return None
                last.unknowns[k] = edge
                ends.append((step.along(last.unknowns), last))
        length, last = min(ends, key=lambda e: e[0])
        return replace(step, end=last, length=length)


@dataclass(frozen=True, eq=False)
class End:
    """Reason why a curve ends on a step, and its last point there, if it has one."""

    reason: str
    last: SolutionPoint | None = None


Visit = Callable[[ContinuationStep, bool], End | Literal["refused"] | None]
"""Looks at a step; returns why the curve ends there, or refuses the step, if it may, so that a shorter one is tried."""


def trace(
    problem: Problem,
    start: SolutionPoint,
    box: Box,
    longest: float,
    most: int,
    label: str | None = None,
    growing: Bools | None = None,
    circles: Floats | None = None,
    visit: Visit = lambda step, may_refuse: None,
    origin: SolutionPoint | None = None,
) -> tuple[list[SolutionPoint], str]:
    """Trace a curve from a solution point along its tangent; return its points and the reason why they end.

    It is closed where it comes back to that point, or to the `origin` of a curve of which it is a further part.

    Steps are at most `longest`, and in proportion to the unknowns that are `growing`; the last one is cut at the edge
    of the box.  A curve whose step leads out of the box where no point of its edge is found, as where solutions are not
    isolated, ends before it.  `circles` are the periods of the unknowns that are angles, 0 for others.
    """
    places, shortest = [start], longest * 2.0**-_REFUSALS
    left = "left the interval" if len(box.lower) == 1 else "left the intervals"
    turns = np.zeros(len(start.unknowns)) if circles is None else circles
    still = np.zeros(len(start.unknowns), bool) if growing is None else growing
    ahead = continuation_steps(problem, start, longest, still)
    step = next(ahead, None)
    with progress_bar(most, label) as tick:
        while step is not None:
            check_stop()
            part = step if box.holds(step.end) else box.cut(step)
            closing = None
            if part is not None and (origin is not None or len(places) >= 3):
                closing = part.until(origin or start, turns)
            may_refuse = step.length > shortest
            part = part if closing is None else closing
            if part is None and not may_refuse:
                return places, left
            verdict = "refused" if part is None else visit(part, may_refuse)
            if part is None or verdict == "refused":
                step = _following(ahead, refused=True)
                continue
            last = verdict.last if isinstance(verdict, End) else part.end
            if last is not None and part.length > 0.0:
                places.append(last)
                tick(1)
            if isinstance(verdict, End):
                return places, verdict.reason
            if closing is not None:
                return places, "closed"
            if part is not step or not box.contains(part.end):
                return places, left
            if len(places) > most:
                return places, MOST
            step = _following(ahead, refused=False)
    return places, LOST


def both_ways(
    side: Callable[[SolutionPoint], tuple[list[SolutionPoint], str]], start: SolutionPoint
) -> tuple[list[SolutionPoint], tuple[str, str]]:
    """Trace a curve from a solution point along its tangent and against it; a closed one once.

    ``side`` traces it one way.  Returns its points, the first ones against the tangent, and the reasons why both ends
    are there.
    """
    ahead, last = side(start)
    back, first = ([start], last) if last == "closed" else side(replace(start, tangent=-start.tangent))
    return [*back[:0:-1], *ahead], (first, last)


def _following(ahead: Generator[ContinuationStep, bool | None, None], refused: bool) -> ContinuationStep | None:
    try:
        return ahead.send(refused)
    except StopIteration:
        return None
