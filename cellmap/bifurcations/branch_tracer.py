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
from .arclength import Place, Stride, corrected, strides
from .branch import Bifurcation, BifurcationKind, Branch
from .detection import TESTS, Watch
from .orbit_equations import OrbitProblem

_REFUSALS = 6  # halvings of a step on which more seems to happen than is found
_ASIDE, _NEAREST = 0.02, 1e-12  # first step on a new branch, scaled, and the shortest
_ASTRIDE = 0.37  # part of a step beside a start that is a bifurcation


@dataclass(frozen=True, eq=False)
class Walk:
    """Solution points from an initial one on, the bifurcations between them, and the reason why they end."""

    places: list[Place]
    found: list[Bifurcation]
    end: str

    def reversed(self) -> Walk:
        """Return the same in the opposite order."""
        last = len(self.places) - 2
        found = [replace(b, before=b.after, after=b.before, place=last - b.place) for b in reversed(self.found)]
        return Walk(self.places[::-1], found, self.end)


@dataclass(frozen=True, eq=False)
class Walker:
    """Tracer of a branch."""

    point_map: PointMap
    name: str
    problem: OrbitProblem
    interval: tuple[float, float]
    longest: float
    most: int
    label: str | None
    stop_at: frozenset[BifurcationKind] = frozenset()

    @property
    def watch(self) -> Watch:
        """What looks for bifurcations."""
        return Watch(self.problem)

    @property
    def _edges(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        low, high = (v / self.problem.scale[-1:] for v in self.interval)
        slack = 1e-13 * np.maximum(np.abs(low), np.abs(high))
        return low - slack, high + slack

    def walk(self, start: Place) -> Walk:
        """Follow the branch along the tangent of a place."""
        low, high = self._edges
        places, found = [start], []
        with progress_bar(self.most, self.label) as tick:
            for stride, events in self._strides(start):
                found += [replace(b, place=len(places) - 1) for b in events]
                places.append(stride.end)
                tick(1)
                if any(b.kind in self.stop_at and not b.before for b in events):
                    return Walk(places, found, "bifurcation")
                if not low < stride.end.unknowns[-1] < high:
                    return Walk(places, found, "left the interval")
                if len(places) > 3 and stride.passes(start, self.problem.circles):
                    return Walk(places, found, "closed")
                if len(places) > self.most:
                    return Walk(places, found, "most points")
        inside = low < places[-1].unknowns[-1] < high
        return Walk(places, found, "no convergence" if inside else "left the interval")

    def clear_start(self, start: Place) -> Place:
        """Return a point beside the initial one if that is a bifurcation, so that it is passed; else itself."""
        low, high = self._edges
        here = self.watch.sight(start)
        for sign in (-1.0, 1.0):
            length = sign * _ASTRIDE * self.longest
            there = corrected(self.problem, start.unknowns + length * start.tangent, start.tangent)
            if there is not None and low < there.unknowns[-1] < high:
                beside = self.watch.sight(there)
                if not here.is_singular(beside):
                    return start
                if not beside.is_singular(beside):
                    return there
        return start

    def _strides(self, start: Place) -> Iterator[tuple[Stride, list[Bifurcation]]]:
        """Yield strides with the bifurcations on them, the last one cut at the interval.

        A stride is repeated with half its length where a test function vanishes at its end, where one seems to have
        been to zero and back, and where the bifurcations found do not explain the number of unstable multipliers.
        """
        watch, (low, high) = self.watch, self._edges
        steps = strides(self.problem, start, self.longest, self.problem.growing)
        stride: Stride | None = next(steps, None)
        before, slopes = watch.sight(start), np.zeros(len(TESTS))
        while stride is not None:
            part = stride
            if not low <= stride.end.unknowns[-1] <= high:
                cut = stride.cut(self.problem.dimension, low, high)
                if cut is None:
                    stride = _send(steps, True)
                    continue
                part = cut
            after = watch.sight(part.end)
            events, clear = watch.events(part, before, after)
            # A line through the last two values tells where a function heads.
            headed = np.where(before.tests + slopes * part.length < 0.0, -1, 1)
            back = (headed != before.sides) & (after.sides == before.sides) & before.watched & after.watched
            doubtful = after.is_singular(before) or not clear or bool(back.any())
            if doubtful and part is stride and stride.length > self.longest * 2.0**-_REFUSALS:
                stride = _send(steps, True)
                continue
            if part.length > 0.0:
                yield part, events
            if part is not stride:
                return
            before, slopes = after, (after.tests - before.tests) / part.length
            stride = _send(steps, False)

    def branch(self, back: Walk | None, ahead: Walk) -> Branch:
        """Join the segments on both sides of the initial point."""
        places = ahead.places if back is None else [*back.places[:-1], *ahead.places]
        shift = 0 if back is None else len(back.places) - 1
        found = [replace(b, place=b.place + shift) for b in ahead.found]
        unknowns = np.array([p.unknowns for p in places]) * self.problem.scale
        return Branch(
            parameter=self.name,
            period=self.problem.period,
            values=np.clip(unknowns[:, -1], *self.interval),
            points=wrap(unknowns[:, :-1], self.point_map.coordinates),
            multipliers=np.array([self.watch.multipliers(p) for p in places]),
            bifurcations=(*(back.found if back else []), *found),
            ends=("bifurcation" if back is None else back.end, ahead.end),
            point_map=self.point_map,
            _problem=self.problem,
        )


def _send(steps: Any, refused: bool) -> Stride | None:
    try:
        return steps.send(refused)
    except StopIteration:
        return None


def born_orbit(
    walker: Walker, bifurcation: Bifurcation, span: float, shrinking: float = 1.0, side: int = 1
) -> tuple[Walker, Place] | None:
    """Return where the branch begins that leaves a bifurcation of a walker's branch, and how to follow it.

    The parameter is rescaled by `span`, states by a factor.  None where no orbit is found.
    """
    assert bifurcation._aside is not None
    old = walker.problem
    rounds = 2 if bifurcation.kind is BifurcationKind.PERIOD_DOUBLING else 1
    scale = np.append(shrinking * old.scale[:-1], span)
    problem = replace(old, period=rounds * old.period, scale=scale)
    origin, aside, along = (
        v * old.scale / scale for v in (bifurcation._unknowns, bifurcation._aside, bifurcation._along)
    )
    aside, along = side * aside / np.linalg.norm(aside), along / np.linalg.norm(along)
    # Across the old branch, so that this is not found again.
    normal = aside - (aside @ along) * along
    normal /= np.linalg.norm(normal)
    first = min(_ASIDE, walker.longest)
    while first > _NEAREST:
        start = corrected(problem, origin + first * aside, normal)
        if start is not None:
            away = float(np.linalg.norm(start.unknowns - origin))
            # A doubled orbit is not closed after one round.
            open_by = float(np.linalg.norm(old(start.unknowns * scale / old.scale)[0] * old.scale[:-1] / scale[:-1]))
            if away < 3.0 * first and (rounds == 1 or open_by > 0.1 * away):
                return replace(walker, problem=problem), start
        first *= 0.5
    return None
