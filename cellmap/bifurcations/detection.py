"""Detection of bifurcations between two solution points of a branch."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..maps.coordinates import wrap
from ..orbits.multipliers import multipliers_of, pair_on_circle, pairs_beside_one, unstable_count
from .arclength import Place, Stride
from .branch import Bifurcation, BifurcationKind
from .branch_points import crossing
from .orbit_equations import OrbitProblem

_REAL = 1e-6  # imaginary part of multipliers that are taken for real where two of them meet
_VERTICAL = 1e-4  # parameter component of the tangent of the branch that a pitchfork gives birth to
_SINGULAR = 1e-9  # value of a test function on which a step should not end
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
class Sight:
    """What is seen at a place: test functions (4,), in the order of `TESTS`, and the number of unstable multipliers.

    Without damping (`conservative`) the product of all multipliers is 1 everywhere, but for rounding, and the last test
    tells nothing.
    """

    tests: NDArray[np.float64]
    unstable: int
    conservative: bool

    def is_singular(self, before: Sight) -> bool:
        """Whether a test function that told something before vanishes, or is not known."""
        told = self.watched | before.watched
        return not bool((np.abs(self.tests[told]) > _SINGULAR).all())

    @property
    def watched(self) -> NDArray[np.bool_]:
        """Which tests tell something."""
        return np.array([kind is not BifurcationKind.NEIMARK_SACKER or not self.conservative for kind in TESTS])

    @property
    def sides(self) -> NDArray[np.int64]:
        """Signs of the test functions."""
        return np.where(self.tests < 0.0, -1, 1)


@dataclass(frozen=True, eq=False)
class Watch:
    """Bifurcation detector: test functions at solution points, and bifurcations between them."""

    problem: OrbitProblem

    def multipliers(self, place: Place) -> NDArray[np.complex128]:
        """Return the multipliers at a place."""
        return multipliers_of(self.problem.matrix(place))

    def unstable(self, place: Place) -> int:
        """Return the number of unstable multipliers at a place."""
        return int(unstable_count(self.multipliers(place)))

    def sight(self, place: Place) -> Sight:
        """Return what is seen at a place."""
        found = self.multipliers(place)
        tests = np.array([self._test(kind, place) for kind in TESTS])
        return Sight(tests, int(unstable_count(found)), _keeps_volumes(found))

    def events(self, stride: Stride, before: Sight, after: Sight) -> tuple[list[Bifurcation], bool]:
        """Return the bifurcations on a stride, in its order, and whether they explain what has changed on it."""
        found: list[tuple[float, BifurcationKind, Place]] = []
        for kind, changed in zip(TESTS, (before.sides != after.sides) & (before.watched | after.watched), strict=True):
            if changed and (place := self._located(kind, stride)) is not None:
                found.append((stride.along(place.unknowns), kind, place))
        if not found and before.unstable != after.unstable:
            place = self._where_count_changes(stride, before.unstable)
            found.append((stride.along(place.unknowns), self._kind_of_change(place), place))
        found.sort(key=lambda f: f[0])
        cuts = [0.5 * (a[0] + b[0]) for a, b in pairwise(found)]
        counts = [before.unstable, *(self._count_at(stride, cut, before.unstable) for cut in cuts), after.unstable]
        if any(kind in _SIMPLE and counts[k] == counts[k + 1] for k, (_, kind, _) in enumerate(found)):
            # Between two bifurcations that are close together a multiplier stays within the margin for rounding.
            exact = [self._exactly(p) for p in (stride.begin, *(stride.at(c) for c in cuts), stride.end)]
            counts = [c if e is None else e for c, e in zip(counts, exact, strict=True)]
        events, clear = [], True
        for k, (_, kind, place) in enumerate(found):
            change = abs(counts[k + 1] - counts[k])
            # The product of two real multipliers passes 1 where nothing happens.
            if kind is BifurcationKind.NEIMARK_SACKER and not change:
                continue
            clear &= change == (0 if kind is BifurcationKind.DEGENERATE else _CHANGES.get(kind, 1))
            if (event := self._event(kind, place, stride)) is not None:
                events.append(replace(event, before=counts[k], after=counts[k + 1]))
        return events, clear

    def _test(self, kind: BifurcationKind, place: Place) -> float:
        if kind is BifurcationKind.FOLD:
            return float(place.tangent[-1])
        if kind is BifurcationKind.PITCHFORK:
            return place.bordered
        if kind is BifurcationKind.PERIOD_DOUBLING:
            return float(np.linalg.det(self.problem.matrix(place) + np.eye(self.problem.dimension)))
        return float(pairs_beside_one(self.multipliers(place)))

    def _located(self, kind: BifurcationKind, stride: Stride) -> Place | None:
        place = stride.located(lambda p: self._test(kind, p))
        if place is None and kind is BifurcationKind.PITCHFORK:
            # Next to a crossing corrections may fail; the crossing itself is found from afar.
            ends = self._test(kind, stride.begin), self._test(kind, stride.end)
            place = stride.interpolated(ends[0] / (ends[0] - ends[1]))
        return place

    def _count_at(self, stride: Stride, length: float, otherwise: int) -> int:
        place = stride.at(length)
        return otherwise if place is None else self.unstable(place)

    def _exactly(self, place: Place | None) -> int | None:
        """Return the number of multipliers outside the unit circle, however near to it; None for no place."""
        return None if place is None else int(unstable_count(self.multipliers(place), 0.0))

    def _where_count_changes(self, stride: Stride, count: int) -> Place:
        low, high, place = 0.0, stride.length, stride.end
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            there = stride.at(middle)
            if there is None:
                break
            if self.unstable(there) == count:
                low = middle
            else:
                high, place = middle, there
        return place

    def _kind_of_change(self, place: Place) -> BifurcationKind:
        found = self.multipliers(place)
        collide = _keeps_volumes(found) and self._is_complex(found)
        return BifurcationKind.NEIMARK_SACKER if collide else BifurcationKind.DEGENERATE

    def _is_complex(self, multipliers: NDArray[np.complex128]) -> bool:
        """Return whether the multipliers whose product is nearest to 1 are a complex pair."""
        return bool(abs(multipliers[list(pair_on_circle(multipliers))].imag).min() > _REAL)

    def _event(self, kind: BifurcationKind, place: Place, stride: Stride) -> Bifurcation | None:
        """Return what is known of a bifurcation, but for the counts; None where it is none."""
        problem, d = self.problem, self.problem.dimension
        unknowns, along, aside = place.unknowns, place.tangent, None
        if kind is BifurcationKind.PITCHFORK:
            meeting = crossing(problem, unknowns, stride.begin.tangent)
            if meeting is None:
                kind = BifurcationKind.DEGENERATE
            else:
                unknowns, along, aside = meeting.unknowns, meeting.along, meeting.aside
                place = replace(place, unknowns=unknowns, derivatives=problem(unknowns)[1])
                if abs(aside[-1]) > _VERTICAL:
                    kind = BifurcationKind.TRANSCRITICAL
        matrix, multipliers = problem.matrix(place), self.multipliers(place)
        if kind is BifurcationKind.NEIMARK_SACKER and not self._is_complex(multipliers):
            kind = BifurcationKind.DEGENERATE
        if kind is BifurcationKind.PERIOD_DOUBLING:
            aside = np.append(np.linalg.svd(matrix + np.eye(d))[2][-1], 0.0)
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
            _aside=aside,
        )


def _keeps_volumes(multipliers: NDArray[np.complex128]) -> bool:
    return bool(abs(abs(np.prod(multipliers)) - 1.0) < _KEPT)
