"""Detection of bifurcations between two solution points of a branch."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from .._lib.arrays import Bools, Complexes, Floats, Ints
from .._lib.computed import computed_once
from ..maps.coordinates import wrap
from ..orbits.arclength import ContinuationStep, SolutionPoint, corrected
from ..orbits.multipliers import MARGIN, factors_beside, pair_on_circle, products_of_pairs, unstable_count
from ..orbits.orbit_equations import OrbitProblem
from .branch import Bifurcation
from .kinds import BifurcationKind
from .singular_orbits import branch_point

_REAL = 1e-6  # imaginary part of multipliers that are taken for real where two of them meet
_VERTICAL = 1e-4  # parameter component of the tangent of the branch that a pitchfork gives birth to
_SINGULAR = 1e-9  # value of a test function on which a step should not end
_STILL = 1e-9  # parameter component of the tangent that may be rounding, as along orbits that fill a line
_MET = 1e-9  # residual where curves cross, more where they only come close to each other
_SAME = 1e-3  # scaled distance of a fold from a crossing that are one pitchfork
_BESIDE, _ON_LINE = 0.03, 1e-11  # scaled displacement along the other branch, and of the parameter there on a line
_KEPT = 1e-9  # distance of the product of all multipliers from 1 that rounding explains
_BISECTIONS = 48

TESTS = (
    BifurcationKind.FOLD,
    BifurcationKind.PITCHFORK,
    BifurcationKind.PERIOD_DOUBLING,
    BifurcationKind.NEIMARK_SACKER,
)
"""Bifurcations of the test functions; that of a pitchfork detects all branch points."""

_CHANGES = {BifurcationKind.NEIMARK_SACKER: 2}
_SIMPLE = {BifurcationKind.FOLD, BifurcationKind.PITCHFORK, BifurcationKind.PERIOD_DOUBLING}


@dataclass(frozen=True, eq=False)
class TestValues:
    """Values of the test functions (4,), in the order of `TESTS`, at a place with some multipliers.

    Without damping (`conservative`) the product of all multipliers is 1 everywhere, but for rounding, and the last test
    function carries no information.
    """

    tests: Floats
    multipliers: Complexes
    counted: int | None = None
    since: SolutionPoint | None = None

    @computed_once
    def unstable(self) -> int:
        """Number of unstable multipliers: that which is known from the way here, or those beyond the margin."""
        return int(unstable_count(self.multipliers)) if self.counted is None else self.counted

    def following(self, before: TestValues, step: ContinuationStep, events: list[Bifurcation]) -> TestValues:
        """Return the test functions at the end of a step, given those at its beginning and its bifurcations.

        A single multiplier that has left the unit circle, but not the margin for rounding, is outside.  While the
        tangent's component along the parameter is rounding, it keeps its sign `since` it was not.
        """
        counted = events[-1].after if events else before.counted
        fewest, most = (int(unstable_count(self.multipliers, margin)) for margin in (MARGIN, -MARGIN))
        if not most == counted == fewest + 1:
            counted = None
        tests, since = self.tests.copy(), None
        if not self.informative[0]:
            since = before.since or step.begin
            if not before.informative[0]:
                tests[0] = np.copysign(tests[0], before.tests[0])
        return replace(self, tests=tests, counted=counted, since=since)

    @computed_once
    def conservative(self) -> bool:
        """Whether the product of all multipliers is 1."""
        return _is_volume_preserving(self.multipliers)

    def held(self, other: TestValues) -> Ints:
        """Return the number of factors (4,) that vanish in each test function here and elsewhere on the branch.

        A multiplier that holds at -1, or a pair that holds on the unit circle, tells nothing of the others.
        """
        return np.minimum(self.vanishing, other.vanishing)

    @computed_once
    def vanishing(self) -> Ints:
        """Number of factors (4,) that vanish."""
        return np.array([np.count_nonzero(np.abs(factors) <= MARGIN) for factors in self.factors])

    @computed_once
    def factors(self) -> list[Complexes]:
        """Factors of each test function, none of those that are no products over multipliers, the smallest first."""
        return [_factors_of(kind, self.multipliers) for kind in TESTS]

    def without(self, held: Ints) -> Floats:
        """Return the test functions (4,) without a number of factors of each that vanish."""
        if not held.any():
            return self.tests
        return np.array([
            float(np.prod(factors[leave:]).real) if leave else value
            for value, factors, leave in zip(self.tests, self.factors, held.tolist(), strict=True)
        ])  # fmt: skip

    def is_singular(self, before: TestValues) -> bool:
        """Return whether a test function that was informative before vanishes, or is not known."""
        compared = self.informative | before.informative
        return not bool((np.abs(self.without(self.held(before))[compared]) > _SINGULAR).all())

    @computed_once
    def informative(self) -> Bools:
        """Which test functions carry information."""
        return np.array([abs(float(self.tests[0])) > _STILL, True, True, not self.conservative])


@dataclass(frozen=True, eq=False)
class _Candidate:
    """Zero of a test function on a step, how far along, and by how many the number of unstable multipliers changes."""

    along: float
    kind: BifurcationKind
    change: int
    event: Bifurcation

    def is_birth(self) -> bool:
        """Return whether another branch is crossed where the parameter has an extremum on this one."""
        crosses = self.event.kind is BifurcationKind.TRANSCRITICAL
        return crosses and abs(float(self.event._along[-1])) <= _VERTICAL


@dataclass(frozen=True, eq=False)
class Detector:
    """Bifurcation detector: test functions at solution points, and bifurcations between them."""

    problem: OrbitProblem

    def unstable(self, place: SolutionPoint) -> int:
        """Return the number of unstable multipliers at a solution point."""
        return int(unstable_count(self.problem.multipliers(place)))

    def values_at(self, place: SolutionPoint) -> TestValues:
        """Return the values of the test functions at a solution point."""
        return TestValues(np.array([self._test(kind, place) for kind in TESTS]), self.problem.multipliers(place))

    def events(self, step: ContinuationStep, before: TestValues, after: TestValues) -> tuple[list[Bifurcation], bool]:
        """Return the bifurcations on a step, in its order, and whether they explain what has changed on it."""
        found: list[_Candidate] = []
        held = before.held(after)
        passed = signs(before.without(held)) != signs(after.without(held))
        for kind, changed, leave in zip(
            TESTS, passed & (before.informative | after.informative), held.tolist(), strict=True
        ):
            whole = step if before.since is None or kind is not BifurcationKind.FOLD else step.since(before.since)
            if changed and (place := self._located(kind, whole, leave)) is not None:
                found.append(self._candidate(kind, place, step))
        if not found and before.unstable != after.unstable:
            place = self._where_count_changes(step, before.unstable)
            found.append(self._candidate(self._kind_of_change(place), place, step))
        found.sort(key=lambda f: f.along)
        if passed[TESTS.index(BifurcationKind.FOLD)]:
            found = _with_pitchfork_of_birth(found)
        cuts = [0.5 * (a.along + b.along) for a, b in pairwise(found)]
        counts = [before.unstable, *(self._count_at(step, cut, before.unstable) for cut in cuts), after.unstable]
        if any(f.kind in _SIMPLE and f.change and counts[k] == counts[k + 1] for k, f in enumerate(found)):
            # Between two bifurcations that are close together a multiplier stays within the margin for rounding.
            exact = [self._exactly(p) for p in (before.since or step.begin, *(step.at(c) for c in cuts), step.end)]
            counts = [c if e is None else e for c, e in zip(counts, exact, strict=True)]
        events, clear = [], True
        for k, candidate in enumerate(found):
            change = abs(counts[k + 1] - counts[k])
            # The product of two real multipliers passes 1 where nothing happens.
            if candidate.kind is BifurcationKind.NEIMARK_SACKER and not change:
                continue
            clear &= change == candidate.change and self._meets(candidate)
            events.append(replace(candidate.event, before=counts[k], after=counts[k + 1]))
        return events, clear

    def _test(self, kind: BifurcationKind, place: SolutionPoint, leave: int = 0) -> float:
        if leave:
            return float(np.prod(_factors_of(kind, self.problem.multipliers(place))[leave:]).real)
        if kind is BifurcationKind.FOLD:
            return float(place.tangent[-1])
        if kind is BifurcationKind.PITCHFORK:
            return self.problem.bordered(place)
        if kind is BifurcationKind.PERIOD_DOUBLING:
            return self.problem.doublings(place)
        return self.problem.pairs(place)

    def _located(self, kind: BifurcationKind, step: ContinuationStep, leave: int) -> SolutionPoint | None:
        place = step.located(lambda p: self._test(kind, p, leave))
        if place is None and kind is BifurcationKind.PITCHFORK:
            # Next to a crossing corrections may fail; the crossing itself is found from afar.
            ends = self._test(kind, step.begin), self._test(kind, step.end)
            place = step.interpolated(ends[0] / (ends[0] - ends[1]))
        return place

    def _count_at(self, step: ContinuationStep, length: float, otherwise: int) -> int:
        place = step.at(length)
        return otherwise if place is None else self.unstable(place)

    def _exactly(self, place: SolutionPoint | None) -> int | None:
        """Return the number of multipliers outside the unit circle, however near to it; None for no place."""
        return None if place is None else int(unstable_count(self.problem.multipliers(place), 0.0))

    def _where_count_changes(self, step: ContinuationStep, count: int) -> SolutionPoint:
        low, high, place = 0.0, step.length, step.end
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            there = step.at(middle)
            if there is None:
                break
            if self.unstable(there) == count:
                low = middle
            else:
                high, place = middle, there
        return place

    def _kind_of_change(self, place: SolutionPoint) -> BifurcationKind:
        found = self.problem.multipliers(place)
        collide = _is_volume_preserving(found) and self._is_complex(found)
        return BifurcationKind.NEIMARK_SACKER if collide else BifurcationKind.DEGENERATE

    def _is_complex(self, multipliers: Complexes) -> bool:
        """Return whether the multipliers whose product is nearest to 1 are a complex pair."""
        return bool(abs(multipliers[list(pair_on_circle(multipliers))].imag).min() > _REAL)

    def _is_continuum(self, unknowns: Floats, direction: Floats) -> bool:
        """Return whether orbits fill a curve at one parameter value, as they do not at a pitchfork."""
        for length in (_BESIDE, -_BESIDE):
            place = corrected(self.problem, unknowns + length * direction, direction)
            if place is None or not abs(place.unknowns[-1] - unknowns[-1]) < _ON_LINE:
                return False
        return True

    def _candidate(self, kind: BifurcationKind, place: SolutionPoint, step: ContinuationStep) -> _Candidate:
        change = 0 if kind is BifurcationKind.DEGENERATE else _CHANGES.get(kind, 1)
        return _Candidate(step.along(place.unknowns), kind, change, self._event(kind, place, step))

    def _meets(self, candidate: _Candidate) -> bool:
        """Return whether the curves of a crossing have an orbit in common: a step may jump to one that is close."""
        event = candidate.event
        if candidate.kind is not BifurcationKind.PITCHFORK or event._branch_direction is None:
            return True
        return bool(np.linalg.norm(self.problem(event._unknowns)[0]) <= _MET)

    def _event(self, kind: BifurcationKind, place: SolutionPoint, step: ContinuationStep) -> Bifurcation:
        """Return a located bifurcation, but for the counts."""
        problem, d = self.problem, self.problem.dimension
        unknowns, along, branch_direction = place.unknowns, place.tangent, None
        if kind is BifurcationKind.PITCHFORK:
            meeting = branch_point(problem, unknowns, step.begin.tangent)
            if meeting is None:
                kind = BifurcationKind.DEGENERATE
            else:
                unknowns, along, branch_direction = meeting.unknowns, meeting.along, meeting.branch_direction
                place = replace(place, unknowns=unknowns, derivatives=problem(unknowns)[1])
                if abs(branch_direction[-1]) > _VERTICAL:
                    kind = BifurcationKind.TRANSCRITICAL
                elif not _is_in_family(step) and self._is_continuum(unknowns, branch_direction):
                    kind, branch_direction = BifurcationKind.DEGENERATE, None
        multipliers = self.problem.multipliers(place)
        if kind is BifurcationKind.NEIMARK_SACKER and not self._is_complex(multipliers):
            kind = BifurcationKind.DEGENERATE
        if kind is BifurcationKind.PERIOD_DOUBLING:
            branch_direction = problem.flipped(place)
        state = unknowns * problem.scale
        return Bifurcation(
            kind=kind,
            value=float(state[-1]),
            point=wrap(state[:d], problem.point_map.coordinates),
            multipliers=multipliers,
            before=0,
            after=0,
            place=0,
            _unknowns=unknowns,
            _along=along,
            _problem=problem,
            _branch_direction=branch_direction,
        )


def _with_pitchfork_of_birth(found: list[_Candidate]) -> list[_Candidate]:
    """Return candidates on a step that turns back, with one pitchfork in place of a crossing and the fold there.

    The orbits on both sides are mirror images, with the same number of unstable multipliers.  So near to a crossing the
    fold may not have been located.
    """
    fold = next((c for c in found if c.kind is BifurcationKind.FOLD), None)
    place = next((c for c in found if c.is_birth()), None)
    if place is None or (fold is not None and abs(fold.along - place.along) > _SAME):
        return found
    pitchfork = replace(place, change=0, event=replace(place.event, kind=BifurcationKind.PITCHFORK))
    return [pitchfork if c is place else c for c in found if c is not fold]


def _is_in_family(step: ContinuationStep) -> bool:
    """Return whether orbits of a step fill a curve at one parameter value, as those beside them may as well."""
    return bool(max(abs(place.tangent[-1]) for place in (step.begin, step.end)) <= _STILL)


def _is_volume_preserving(multipliers: Complexes) -> bool:
    return bool(abs(abs(np.prod(multipliers)) - 1.0) < _KEPT)


def signs(tests: Floats) -> Ints:
    """Return the signs of test functions, 1 for 0."""
    return np.where(tests < 0.0, -1, 1)


def _factors_of(kind: BifurcationKind, multipliers: Complexes) -> Complexes:
    """Return the factors of a test function that is a product over multipliers, the smallest first."""
    if kind is BifurcationKind.PERIOD_DOUBLING:
        found = factors_beside(multipliers, -1.0)
    elif kind is BifurcationKind.NEIMARK_SACKER:
        found = factors_beside(products_of_pairs(multipliers), 1.0)
    else:
        return multipliers[:0]
    return np.asarray(found[np.argsort(np.abs(found), kind="stable")])
