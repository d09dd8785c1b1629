"""Branches of periodic orbits by pseudo-arclength, with their bifurcations located on the way."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .attractor import Attractor
from .branch import Bifurcation, BifurcationKind, Branch
from .checks import finite_number, finite_points, whole_number
from .coordinates import wrap
from .events import TESTS, Watch
from .orbit import PeriodicOrbit
from .orbit_problem import OrbitProblem, begin_orbit, orbit_problem
from .pointmap import PointMap
from .threads import progress_bar
from .tracing import Place, Stride, corrected, strides, tangent_of

_REFUSALS = 6  # halvings of a step on which more seems to happen than is found
_ASIDE, _NEAREST = 0.02, 1e-12  # first step on a new branch, scaled, and the shortest
_ASTRIDE = 0.37  # part of a step beside a start that is a bifurcation


def continue_orbit(
    point_map: PointMap,
    orbit: PeriodicOrbit | Attractor,
    name: str,
    lower: float,
    upper: float,
    step: float = 0.01,
    points: int = 1000,
    sizes: ArrayLike | None = None,
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
        Longest step, where the interval has the length 1 and a coordinate its natural size, or the size that it has
        come to on the branch.
    points : int, optional
        Most points to either side; `ends` of the branch says where they did not suffice.
    sizes : array_like, shape (dimension,), optional
        Natural sizes of displacements, in units of the coordinates.  By default a radian for an angle, and for others
        what goes with it, or what the state and its drift with the parameter tell; give them for an equilibrium at 0
        in unusual units.
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
    own = None if sizes is None else finite_points("sizes", sizes, exact.dimension)
    if own is not None and not (own > 0.0).all():
        raise ValueError(f"sizes={own.tolist()}: give positive numbers")
    for end in (low, high):
        exact.with_params(**{name: end})
    problem = orbit_problem(exact, state, period, (name,), (high - low,), own)
    start = corrected(problem, np.append(state, value) / problem.scale, problem.upright)
    if start is None:
        start = _at_a_fold(problem, np.append(state, value) / problem.scale)
    walker = Walker(exact, name, problem, (low, high), longest, most, f"continuation in {name}" if progress else None)
    start = walker.clear_start(start)
    ahead = walker.walk(start)
    if ahead.end == "closed":
        return replace(walker.branch(None, ahead), ends=("closed", "closed"))
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
        """Return a place next to a start that is a bifurcation itself, so that this is passed; else the start."""
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
        """Join what was found to both sides of the start."""
        places = ahead.places if back is None else [*back.places[:-1], *ahead.places]
        shift = 0 if back is None else len(back.places) - 1
        found = [replace(b, place=b.place + shift) for b in ahead.found]
        unknowns = np.array([p.unknowns for p in places]) * self.problem.scale
        return Branch(
            name=self.name,
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
