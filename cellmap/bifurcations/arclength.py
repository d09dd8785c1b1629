"""Pseudo-arclength continuation of the solutions of n equations in n + 1 unknowns."""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Problem = Callable[[NDArray[np.float64]], tuple[NDArray[np.float64], NDArray[np.float64]]]
"""Returns residuals (n,) and their derivatives (n, n + 1) at unknowns (n + 1,), all scaled to be of order 1."""

_ITERATIONS = 10
_CONVERGED = 1e-14  # scaled length of a Newton step that moves nothing any more
_FLOOR = 1e-6  # Newton steps below this that no longer shrink are rounding,
_ROUNDING = 1e-8  # if the residual is
_SHRINKING = 0.75  # or less, as from half to half where two solutions are close together
_STRAIGHT = 0.95  # cosine of the angle between neighbouring tangents from which a step was too long
_SHORTEST = 1e-9
_REPEATED = 0.43  # no power of it leads back to round numbers
_ALIGNED = 0.9  # cosine of the angle between tangents of one curve at one place


@dataclass(frozen=True, eq=False)
class SolutionPoint:
    """A solution (n + 1,), the derivatives (n, n + 1) there, and the unit tangent of the curve."""

    unknowns: NDArray[np.float64]
    derivatives: NDArray[np.float64]
    tangent: NDArray[np.float64]

    @property
    def bordered(self) -> float:
        """Determinant of derivatives and tangent: it changes sign where curves cross."""
        return float(np.linalg.det(np.vstack([self.derivatives, self.tangent])))


def corrected(problem: Problem, guess: NDArray[np.float64], normal: NDArray[np.float64]) -> SolutionPoint | None:
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
        stays = last <= _FLOOR and not length < _SHRINKING * last and float(np.abs(residual).max()) <= _ROUNDING
        if length <= _CONVERGED or stays:
            # The derivatives are those at the place itself, not at one before it.
            tangent = tangent_of(derivatives, normal)
            return None if tangent is None else SolutionPoint(unknowns, derivatives, tangent)
        if not length < 2.0 * last:
            return None
        unknowns = unknowns + change
        last = length
    return None


def tangent_of(derivatives: NDArray[np.float64], along: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return the unit vector that the derivatives (n, n + 1) map to zero, pointing along another."""
    try:
        found = np.linalg.solve(np.vstack([derivatives, along]), np.append(np.zeros(len(derivatives)), 1.0))
    except np.linalg.LinAlgError:
        return None
    length = float(np.linalg.norm(found))
    return found / length if np.isfinite(length) else None


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

    def interpolated(self, share: float) -> SolutionPoint:
        """Return a point between the ends that is near a solution."""
        begin, end = self.begin, self.end
        return replace(begin, unknowns=begin.unknowns + share * (end.unknowns - begin.unknowns))

    def located(self, test: Callable[[SolutionPoint], float]) -> SolutionPoint | None:
        """Return the solution point between the ends at which a test function changes its sign."""
        from scipy.optimize import brentq

        def value(length: float) -> float:
            place = self.at(length)
            if place is None:
                raise FloatingPointError
            return test(place)

        try:
            return self.at(brentq(value, 0.0, self.length, xtol=1e-15, rtol=1e-14))
        except (FloatingPointError, ValueError):
            return None

    def cut(self, first: int, lower: NDArray[np.float64], upper: NDArray[np.float64]) -> ContinuationStep | None:
        """Return the step up to where the unknowns from number `first` on leave an interval; None if it has none."""
        ends = []
        for k, (low, high) in enumerate(zip(lower, upper, strict=True), first):
            value = self.end.unknowns[k]
            if not low <= value <= high:
                edge = low if value < low else high
                last = self.located(lambda place, k=k, edge=edge: place.unknowns[k] - edge)  # type: ignore[misc]
                if last is not None:
                    last.unknowns[k] = edge
                    ends.append((self.along(last.unknowns), last))
        if not ends:
            return None
        length, last = min(ends, key=lambda e: e[0])
        return replace(self, end=last, length=length)

    def along(self, unknowns: NDArray[np.float64]) -> float:
        """Return how far along the tangent unknowns are."""
        return float(self.begin.tangent @ (unknowns - self.begin.unknowns))

    def passes(self, place: SolutionPoint, turns: NDArray[np.float64]) -> bool:
        """Return whether the step passes through a point in the same direction; unknowns with a period are angles."""
        apart = place.unknowns - self.begin.unknowns
        apart = apart - np.where(turns > 0, turns * np.round(apart / np.where(turns > 0, turns, 1.0)), 0.0)
        passed = 0.0 < float(self.begin.tangent @ apart) <= self.length
        aligned = float(place.tangent @ self.begin.tangent) > _ALIGNED
        return passed and aligned and bool(np.linalg.norm(apart) <= 1.1 * self.length)


def continuation_steps(
    problem: Problem, begin: SolutionPoint, longest: float, growing: NDArray[np.bool_]
) -> Generator[ContinuationStep, bool | None, None]:
    """Yield steps along a curve from a solution point, without end; stop where no step is short enough.

    Steps are adapted to the angle between tangents, up to `longest`, or that part of the largest of the unknowns that
    are `growing`.  A step that is sent back is repeated with less than half its length.
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
        here = there
        largest = longest * float(np.abs(here.unknowns[growing]).max(initial=1.0))
        length = min(largest, length * (1.5 if turned > 0.99 else 0.9))
