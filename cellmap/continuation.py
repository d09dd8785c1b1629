"""Branches of periodic orbits by pseudo-arclength, with their bifurcations located on the way."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .attractor import Attractor
from .branch import Bifurcation, BifurcationKind, Branch
from .branching import crossing
from .checks import finite_number, whole_number
from .coordinates import wrap
from .multipliers import multipliers_of, unstable_count
from .orbit import PeriodicOrbit
from .orbit_problem import OrbitProblem, begin_orbit, orbit_problem
from .pointmap import PointMap
from .threads import progress_bar
from .tracing import Place, Stride, corrected, strides, tangent_of

_REFUSALS = 6  # times that a step is halved because multipliers have crossed the circle without a bifurcation
_REAL = 1e-6  # imaginary part of multipliers that are taken for real where two of them meet
_VERTICAL = 1e-5  # parameter component of the tangent of the branch that a pitchfork gives birth to
_ASIDE = 0.02  # first step on a new branch, scaled


def continue_orbit(
    point_map: PointMap,
    orbit: PeriodicOrbit | Attractor,
    name: str,
    lower: float,
    upper: float,
    step: float = 0.01,
    points: int = 1000,
    progress: bool = False,
) -> Branch:
    """Follow a periodic orbit through a parameter, around folds, and find its bifurcations.

    Pseudo-arclength continuation (Keller 1977) with derivatives by state and parameter from the variational equation.
    Test functions are watched from step to step: the tangent's component along the parameter (folds), the bordered
    determinant (branches that cross), det(M + I) (period doublings) and the product of all mu_i mu_j - 1
    (Neimark-Sacker); their zeros are located by Brent's method on the branch itself.  A step in which the number of
    unstable multipliers changes more than these explain is repeated with half its length.

    Parameters
    ----------
    point_map : PointMap
        The map at the parameters of the orbit; of an interpolated map the exact map is taken.
    orbit : PeriodicOrbit or Attractor
        The orbit to begin with, from :func:`periodic_orbit`, :func:`find_periodic_orbits` or :func:`find_attractors`.
    name : str
        Name of the parameter.
    lower, upper : float
        Interval of its values, in its unit, that holds the present one.
    step : float, optional
        Longest step, where the interval has the length 1 and a coordinate its natural size.
    points : int, optional
        Most points to either side.
    progress : bool, optional
        Show progress on a terminal.

    Returns
    -------
    Branch
        From the end towards `lower` to the one towards `upper`, in the directions in which the branch leaves the orbit.

    Raises
    ------
    TypeError, ValueError
        For an orbit that is not periodic or not one of this map, an unknown parameter, an empty interval or one that
        does not hold the present value.

    References
    ----------
    Keller, in *Applications of Bifurcation Theory* (1977) 359; Kuznetsov, *Elements of Applied Bifurcation Theory*
    (2004), chapter 10.

    Examples
    --------
    >>> from cellmap import discrete_map, periodic_orbit
    >>> logistic = discrete_map(lambda x, p: (p.r * x[0] * (1 - x[0]),), {"r": 2.0}, ("x",))
    >>> continue_orbit(logistic, periodic_orbit(logistic, [0.5]), "r", 0.5, 3.5).bifurcations
    (Bifurcation(transcritical at 1, 1 -> 0 unstable), Bifurcation(period doubling at 3, 0 -> 1 unstable))
    """
    low, high = finite_number("lower", lower), finite_number("upper", upper)
    if not low < high:
        raise ValueError(f"upper={upper!r}: give a number above lower={lower!r}")
    longest, most = finite_number("step", step, above=0.0, at_most=1.0), whole_number("points", points, at_least=1)
    exact, state, period = begin_orbit(point_map, orbit, name)
    value = float(exact.params[name])
    if not low <= value <= high:
        raise ValueError(f"lower={lower!r}, upper={upper!r}: the interval must hold {name}={value:g} of the map")
    problem = orbit_problem(exact, state, period, (name,), (high - low,))
    start = corrected(problem, np.append(state, value) / problem.scale, problem.upright)
    if start is None:
        start = _at_a_fold(problem, np.append(state, value) / problem.scale)
    walker = Walker(exact, name, problem, (low, high), longest, most, f"continuation in {name}" if progress else None)
    ahead = walker.walk(start)
    back = walker.walk(replace(start, tangent=-start.tangent))
    return walker.branch(back.reversed(), ahead)


def switch_branch(
    branch: Branch,
    bifurcation: Bifurcation,
    lower: float,
    upper: float,
    step: float = 0.01,
    points: int = 1000,
    side: int = 1,
    progress: bool = False,
) -> Branch:
    """Follow the branch that is born at, or crosses in, a bifurcation.

    Parameters
    ----------
    branch : Branch
        The branch on which the bifurcation was found.
    bifurcation : Bifurcation
        A period doubling, from which orbits of twice the period are followed, or a pitchfork or transcritical one.
    lower, upper : float
        Interval of the parameter.
    step, points, progress
        As for :func:`continue_orbit`.
    side : {1, -1}, optional
        Which side of the new branch; those of a pitchfork are mirror images, those of a period doubling the same orbit
        begun half a round later.

    Returns
    -------
    Branch
        From the bifurcation on.

    Raises
    ------
    ValueError
        For a bifurcation from which no branch of periodic orbits leaves, or one where it is not found.

    Examples
    --------
    >>> from cellmap import discrete_map, periodic_orbit
    >>> logistic = discrete_map(lambda x, p: (p.r * x[0] * (1 - x[0]),), {"r": 2.0}, ("x",))
    >>> fixed = continue_orbit(logistic, periodic_orbit(logistic, [0.5]), "r", 1.5, 3.5)
    >>> switch_branch(fixed, fixed.bifurcations[-1], 1.5, 3.5)
    Branch(period 2, ... points, r from 3.00... to 3.5: period doubling at 3.44948974)
    """
    low, high = finite_number("lower", lower), finite_number("upper", upper)
    if not low <= bifurcation.value <= high:
        raise ValueError(f"lower={lower!r}, upper={upper!r}: the interval must hold the bifurcation {bifurcation!r}")
    if side not in (1, -1):
        raise ValueError(f"side={side!r}: give 1 or -1")
    if bifurcation._aside is None:
        raise ValueError(f"bifurcation={bifurcation!r}: no branch of periodic orbits leaves it")
    longest, most = finite_number("step", step, above=0.0, at_most=1.0), whole_number("points", points, at_least=1)
    label = f"continuation in {branch.name}" if progress else None
    walker = Walker(branch.point_map, branch.name, branch._problem, (low, high), longest, most, label)
    born = born_orbit(walker, bifurcation, high - low, side=side)
    if born is None:
        raise ValueError(
            f"bifurcation={bifurcation!r}: no orbit is found on the branch that leaves it; give a smaller step"
        )
    further, start = born
    return further.branch(None, further.walk(start))


def born_orbit(
    walker: Walker, bifurcation: Bifurcation, span: float, shrinking: float = 1.0, side: int = 1
) -> tuple[Walker, Place] | None:
    """Return where the branch begins that leaves a bifurcation of a walker's branch, and how to follow it.

    The parameter is scaled anew by `span`, states by a factor.  None where no orbit is found.
    """
    assert bifurcation._aside is not None
    old = walker.problem
    rounds = 2 if bifurcation.kind is BifurcationKind.PERIOD_DOUBLING else 1
    scale = np.append(shrinking * old.scale[:-1], span)
    problem = replace(old, period=rounds * old.period, turns=rounds * old.turns, scale=scale)
    origin, aside, along = (
        v * old.scale / scale for v in (bifurcation._unknowns, bifurcation._aside, bifurcation._along)
    )
    aside, along = side * aside / np.linalg.norm(aside), along / np.linalg.norm(along)
    # Across the old branch, so that this is not found again.
    normal = aside - (aside @ along) * along
    normal /= np.linalg.norm(normal)
    first = min(_ASIDE, walker.longest)
    while first > 1e-6:
        start = corrected(problem, origin + first * aside, normal)
        if start is not None:
            away = float(np.linalg.norm(start.unknowns - origin))
            # A doubled orbit is not closed after one round.
            open_by = float(np.linalg.norm(old(start.unknowns * scale / old.scale)[0] * old.scale[:-1] / scale[:-1]))
            if away < 3.0 * first and (rounds == 1 or open_by > 0.1 * away):
                return replace(walker, problem=problem), start
        first *= 0.5
    return None


def _at_a_fold(problem: OrbitProblem, unknowns: NDArray[np.float64]) -> Place:
    """Return the place of a given solution whose parameter cannot be held fixed."""
    derivatives = problem(unknowns)[1]
    direction = np.linalg.svd(derivatives)[2][-1]
    along = tangent_of(derivatives, direction)
    return Place(unknowns, derivatives, direction if along is None else along)


@dataclass(frozen=True, eq=False)
class Walk:
    """Places from a start on, the bifurcations between them, and why they end."""

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
    """How a branch is followed."""

    point_map: PointMap
    name: str
    problem: OrbitProblem
    interval: tuple[float, float]
    longest: float
    most: int
    label: str | None
    stop_at: frozenset[BifurcationKind] = frozenset()

    def walk(self, start: Place) -> Walk:
        """Follow the branch along the tangent of a place."""
        low, high = (v / self.problem.scale[-1] for v in self.interval)
        slack = 1e-12 * max(abs(low), abs(high))
        places, found = [start], []
        end = "most points"
        with progress_bar(self.most, self.label) as tick:
            for stride, events in self._strides(start):
                if not low - slack <= stride.end.unknowns[-1] <= high + slack:
                    edge = low if stride.end.unknowns[-1] < low else high
                    last = stride.located(lambda place, edge=edge: place.unknowns[-1] - edge)  # type: ignore[misc]
                    inside = [b for b in events if low - slack <= b._unknowns[-1] <= high + slack]
                    found += [replace(b, place=len(places) - 1) for b in inside]
                    if last is not None and last.unknowns[-1] != places[-1].unknowns[-1]:
                        places.append(last)
                    return Walk(places, found, "left the interval")
                found += [replace(b, place=len(places) - 1) for b in events]
                places.append(stride.end)
                tick(1)
                if any(b.kind in self.stop_at and not b.before for b in events):
                    return Walk(places, found, "bifurcation")
                if len(places) > 3 and self._closes(places[0], stride):
                    return Walk(places, found, "closed")
                if len(places) > self.most:
                    return Walk(places, found, end)
        return Walk(places, found, "no convergence")

    def _strides(self, start: Place) -> Iterator[tuple[Stride, list[Bifurcation]]]:
        """Yield strides with the bifurcations on them; repeat those on which something was passed over."""
        steps = strides(self.problem, start, self.longest)
        stride: Stride | None = next(steps, None)
        refusals = 0
        while stride is not None:
            events = self._events(stride)
            counts = [self.unstable(p) for p in (stride.begin, stride.end)]
            explained = sum(b.after - b.before for b in events)
            if counts[1] - counts[0] != explained and refusals < _REFUSALS:
                refusals += 1
                stride = _send(steps, True)
                continue
            refusals = 0
            yield stride, events
            stride = _send(steps, False)

    def unstable(self, place: Place) -> int:
        """Return the number of unstable multipliers at a place."""
        return int(unstable_count(self._multipliers(place)))

    def _multipliers(self, place: Place) -> NDArray[np.complex128]:
        return multipliers_of(self.problem.matrix(place))

    def _events(self, stride: Stride) -> list[Bifurcation]:
        """Return the bifurcations on a stride, in its order."""
        events = []
        # Without damping the product of all is 1 everywhere, but for rounding.
        conservative = all(abs(abs(np.prod(self._multipliers(p))) - 1.0) < 1e-9 for p in (stride.begin, stride.end))
        for test, kind in (
            (lambda p: float(p.tangent[-1]), BifurcationKind.FOLD),
            (lambda p: p.bordered, BifurcationKind.PITCHFORK),
            (self._minus_one, BifurcationKind.PERIOD_DOUBLING),
            (self._pair, BifurcationKind.NEIMARK_SACKER),
        ):
            ends = test(stride.begin), test(stride.end)
            if ends[0] * ends[1] < 0.0 and not (conservative and kind is BifurcationKind.NEIMARK_SACKER):
                place = stride.located(test)
                if place is None and kind is BifurcationKind.PITCHFORK:
                    # Next to a crossing corrections may fail; the crossing itself is found from afar.
                    place = stride.interpolated(ends[0] / (ends[0] - ends[1]))
                if place is not None and (event := self._event(kind, place, stride)) is not None:
                    events.append(event)
        along = stride.begin.tangent
        return sorted(events, key=lambda b: float(along @ b._unknowns))

    def _minus_one(self, place: Place) -> float:
        return float(np.linalg.det(self.problem.matrix(place) + np.eye(self.problem.dimension)))

    def _pair(self, place: Place) -> float:
        found = self._multipliers(place)
        i, j = np.triu_indices(len(found), 1)
        return float(np.prod(found[i] * found[j] - 1.0).real) if len(i) else 1.0

    def _event(self, kind: BifurcationKind, place: Place, stride: Stride) -> Bifurcation | None:
        """Return what is known of a bifurcation; None for two real multipliers whose product passes 1."""
        problem, d = self.problem, self.problem.dimension
        unknowns, along, aside = place.unknowns, place.tangent, None
        if kind is BifurcationKind.PITCHFORK:
            meeting = crossing(problem, unknowns, stride.begin.tangent)
            unknowns, along, aside = meeting.unknowns, meeting.along, meeting.aside
            place = replace(place, unknowns=unknowns, derivatives=problem(unknowns)[1])
            if abs(aside[-1]) > _VERTICAL:
                kind = BifurcationKind.TRANSCRITICAL
        matrix, multipliers = problem.matrix(place), self._multipliers(place)
        if kind is BifurcationKind.NEIMARK_SACKER:
            on_circle = np.argmin(np.abs(np.abs(multipliers) - 1.0))
            if abs(multipliers[on_circle].imag) < _REAL:
                return None
        if kind is BifurcationKind.PERIOD_DOUBLING:
            aside = np.append(np.linalg.svd(matrix + np.eye(d))[2][-1], 0.0)
        counts = [self.unstable(p) for p in (stride.begin, stride.end)]
        changes = {BifurcationKind.NEIMARK_SACKER: 2}.get(kind, 1)
        after = counts[0] + changes if counts[1] > counts[0] else counts[0] - changes
        state = unknowns * problem.scale
        return Bifurcation(
            kind=kind,
            value=float(state[-1]),
            point=wrap(state[:d], self.point_map.coordinates),
            multipliers=multipliers,
            before=counts[0],
            after=counts[1] if abs(counts[1] - counts[0]) == changes else after,
            place=0,
            _unknowns=unknowns,
            _along=along,
            _aside=aside,
        )

    def _closes(self, start: Place, stride: Stride) -> bool:
        """Tell whether a stride comes back to the start of the branch."""
        apart = start.unknowns - stride.begin.unknowns
        passed = 0.0 < float(stride.begin.tangent @ apart) <= stride.length
        aligned = float(start.tangent @ stride.begin.tangent) > 0.9
        return passed and aligned and bool(np.linalg.norm(apart) <= 1.1 * stride.length)

    def branch(self, back: Walk | None, ahead: Walk) -> Branch:
        """Join what was found to both sides of the start."""
        places = ahead.places if back is None else [*back.places[:-1], *ahead.places]
        shift = 0 if back is None else len(back.places) - 1
        found = [replace(b, place=b.place + shift) for b in ahead.found]
        unknowns = np.array([p.unknowns for p in places]) * self.problem.scale
        return Branch(
            name=self.name,
            period=self.problem.period,
            values=unknowns[:, -1],
            points=wrap(unknowns[:, :-1], self.point_map.coordinates),
            multipliers=np.array([self._multipliers(p) for p in places]),
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
