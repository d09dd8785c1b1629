"""Curves of bifurcations of periodic orbits in two parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, TypeVar

import numpy as np

from .._lib.arrays import Complexes, Floats
from .._lib.checks import whole_number
from .._lib.records import ConvertsToDataFrame, ConvertsToXarray
from .._lib.signatures import checked
from ..maps.coordinates import Coordinate, wrap
from ..maps.point_map import PointMap
from ..orbits.arclength import Box, ContinuationStep, End, SolutionPoint, both_ways, started, trace
from ..orbits.orbit_equations import OrbitProblem, orbit_problem
from ..orbits.orbit_kinds import PeriodicOrbit, with_values
from ..orbits.shooting import ShootingProblem
from .branch import Bifurcation, Branch
from .codimension_two import CodimensionTwo, CodimensionTwoOrbits, cosine_of_pair, points_on
from .function_zeros import BranchPiece, FunctionOrbits, FunctionZero, zeros_on
from .intervals import further_parameter, interval_of, limits_of, spans
from .kinds import BifurcationKind, CodimensionTwoKind
from .orbit_births import OrbitBirth
from .period_measures import OrbitFunction, Quantity, measured, turn_of, unwrapped
from .singular_orbits import SingularOrbits

_BROKEN, _MET = "symmetry broken", "multipliers met on the real axis"

CurveProblem = SingularOrbits | FunctionOrbits | CodimensionTwoOrbits
"""Equations of a curve in two or three parameters."""

_Located = tuple[tuple[CodimensionTwo, ...], frozenset[CodimensionTwoKind]]


@dataclass(frozen=True, eq=False)
class ParameterCurve:
    """Curve of orbits in the space of some parameters, with the equations that it solves."""

    kind: str
    parameters: tuple[str, ...]
    values: Floats
    points: Floats
    multipliers: Complexes
    ends: tuple[str, str]
    _problem: CurveProblem = field(repr=False)
    _places: tuple[SolutionPoint, ...] = field(repr=False)

    @checked
    def orbit(self, place: int) -> PeriodicOrbit:
        """Return the orbit at a point of the curve, by its number, with all parameters in its `params`."""
        place = whole_number("place", place, at_most=len(self._places) - 1)
        found = self._problem.orbits.orbit_at(self._places[place].unknowns)
        return with_values(found, self.parameters, self.values[place])

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.kind}, {len(self.values)} points, {spans(self.parameters, self.values)})"


Record = TypeVar("Record", bound=ParameterCurve)


@dataclass(frozen=True, eq=False, repr=False)
class BifurcationCurve(ParameterCurve, ConvertsToXarray, ConvertsToDataFrame):
    """Curve of a bifurcation in the plane of two parameters.

    Parameters
    ----------
    kind : BifurcationKind or str
        Kind of the bifurcation; the name of the function on a curve along which a function is zero or extreme.
    parameters : tuple of str
        Names of the parameters.
    values : ndarray, shape (n, 2)
        Parameter values along the curve, in their units.
    points : ndarray, shape (n, dimension)
        First points of the orbits, angles within their period.
    multipliers : ndarray of complex, shape (n, dimension)
        Multipliers, one or two of them on the unit circle.
    ends : tuple of str
        Reasons why the curve ends at its first and at its last point.
    zeros : tuple of FunctionZero
        Zeros and extreme values of functions, in the order of the curve; see :meth:`with_zeros`.
    """

    kind: BifurcationKind | str
    parameters: tuple[str, str]
    zeros: tuple[FunctionZero, ...] = ()
    _kept: list[_Located] = field(default_factory=list, repr=False)

    @property
    def point_map(self) -> PointMap:
        """The map, with the parameters of the initial point."""
        return self._problem.orbits.point_map

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """State variables."""
        return self.point_map.coordinates

    @property
    def period(self) -> int:
        """Period of the orbits in steps of the map."""
        return self._problem.orbits.period

    @checked
    def measure(self, quantity: Quantity = 0, measure: str | None = "maximum") -> Floats:
        """Return a measure of each orbit over its period, shape (n,); see :meth:`Branch.measure`."""
        found = measured(self.point_map, self.parameters, self.values, self.points, self.period, quantity, measure)
        return found if measure is None else unwrapped(found, turn_of(self.point_map, quantity, measure))

    @checked
    def with_zeros(self, functions: Mapping[str, Quantity | OrbitFunction]) -> BifurcationCurve:
        """Return the curve with the zeros and extreme values of functions, as :meth:`Branch.with_zeros` does."""
        problem, unknowns = self._problem, np.array([p.unknowns for p in self._places])
        pieces = [BranchPiece(problem, problem.orbits, unknowns)]
        found = zeros_on(pieces, self.parameters, functions, self.ends == ("closed", "closed"))
        return replace(self, zeros=found)

    @checked
    def codimension_two(self, progress: bool = False) -> tuple[CodimensionTwo, ...]:
        """Return the bifurcations of codimension two, in the order of the curve.

        They are located when they are asked for first, and kept.

        Parameters
        ----------
        progress : bool, optional
            Show progress on a terminal.
        """
        return self._located(progress)[0]

    @checked
    def degeneracies(self, progress: bool = False) -> frozenset[CodimensionTwoKind]:
        """Return the kinds of codimension two whose condition holds along the whole curve, without points of them.

        Parameters
        ----------
        progress : bool, optional
            Show progress on a terminal.
        """
        return self._located(progress)[1]

    def _located(self, progress: bool) -> _Located:
        if not isinstance(self._problem, SingularOrbits):
            return (), frozenset()
        if not self._kept:
            self._kept.append(points_on(self._problem, self.parameters, self._places, progress))
        return self._kept[0]


@checked
def continue_bifurcation(
    branch: Branch,
    bifurcation: Bifurcation | FunctionZero,
    parameter: str,
    first: tuple[float, float],
    second: tuple[float, float],
    step: float = 0.01,
    max_points: int = 1000,
    progress: bool = False,
) -> BifurcationCurve:
    """Continue a bifurcation of a branch, or a zero of a function of its orbits, in two parameters.

    The equations of the orbit and the bifurcation condition, det(M - I) = 0 (fold), det(M + I) = 0 (period doubling) or
    the product of all mu_i mu_j - 1 = 0 (Neimark-Sacker), with the monodromy matrix M and its multipliers mu_i, are
    continued by pseudo-arclength in both parameters.  For a pitchfork, which persists through a symmetry, displacements
    along the left null vector are in addition held at zero; where that leads to no symmetric orbits, the centre of the
    symmetry moves, and is where the second derivative of the residual along the null vectors vanishes.

    Parameters
    ----------
    branch : Branch
        The branch on which the bifurcation was found.
    bifurcation : Bifurcation
        Fold, period doubling, pitchfork or Neimark-Sacker, or one of the `zeros` of the branch: the curve is that of
        orbits at which the function is zero, or extreme along branches in the first parameter.
    parameter : str
        Name of the second parameter.
    first, second : tuple of float
        Intervals of both parameters, in their units; the first is that of the branch.
    step : float, optional
        Longest step, in units in which both intervals have length 1.
    max_points : int, optional
        Largest number of points on either side.
    progress : bool, optional
        Show progress on a terminal.

    Returns
    -------
    BifurcationCurve
        The curve.  A curve of Neimark-Sacker bifurcations ends where the multipliers meet on the real axis, one of
        pitchforks where the symmetry is broken: with a parameter that breaks it, at the bifurcation itself.

    Raises
    ------
    TypeError, ValueError
        For a transcritical bifurcation, which a generic second parameter destroys unless a solution is known for all
        values (see :func:`stability_map`), a degenerate one, one of another branch, an unknown parameter or empty
        intervals.

    References
    ----------
    Kuznetsov, *Elements of Applied Bifurcation Theory* (2004), section 10.3; Govaerts, *Numerical Methods for
    Bifurcations of Dynamical Equilibria* (2000).

    Examples
    --------
    >>> from cellmap import continue_orbit, discrete_map, periodic_orbit
    >>> henon = discrete_map(lambda x, p: (1 - p.a * x[0]**2 + x[1], p.b * x[0]), {"a": 0.2, "b": 0.3}, ("x", "y"))
    >>> branch = continue_orbit(henon, periodic_orbit(henon, [0.5, 0.2]), "a", 0.0, 1.4)
    >>> curve = continue_bifurcation(branch, branch.bifurcations[0], "b", (0.0, 1.4), (-0.9, 0.9))
    >>> a, b = curve.values.T
    >>> bool((abs(a - 0.75 * (1 - b)**2) < 1e-10).all())
    True
    """
    if isinstance(bifurcation, Bifurcation) and bifurcation.kind is BifurcationKind.TRANSCRITICAL:
        raise ValueError(
            f"bifurcation={bifurcation!r}: a generic second parameter destroys it; for an equilibrium that is the same "
            "state at all values use stability_map"
        )
    if isinstance(bifurcation, Bifurcation) and bifurcation.kind is BifurcationKind.DEGENERATE:
        raise ValueError(
            f"bifurcation={bifurcation!r}: no condition singles out what crosses there, and there is no curve to "
            "continue; for an equilibrium that is the same state at all values use stability_map"
        )
    if not any(part.problem is bifurcation._problem for part in branch._parts):
        raise ValueError(
            f"bifurcation={bifurcation!r}: it is not of branch={branch!r}; give one of its bifurcations or zeros"
        )
    exact = branch.point_map.with_params(**{branch.parameter: bifurcation.value})
    names = (branch.parameter, further_parameter(parameter, exact.params, (branch.parameter,)))
    box = (interval_of("first", first, bifurcation.value), interval_of("second", second, exact.params[parameter]))
    spans = (box[0][1] - box[0][0], box[1][1] - box[1][0])
    old = bifurcation._problem
    values = [bifurcation.value, exact.params[parameter]]
    if isinstance(old, ShootingProblem):
        orbits: OrbitProblem = old.with_parameters(exact, names, spans)
        unknowns = np.append((bifurcation._unknowns * old.scale)[:-1], values) / orbits.scale
    else:
        orbits = orbit_problem(exact, bifurcation.point, branch.period, names, spans)
        unknowns = np.append(bifurcation.point, values) / orbits.scale
    problem: CurveProblem
    if isinstance(bifurcation, FunctionZero):
        problem = FunctionOrbits.at(orbits, names, bifurcation, unknowns)
    else:
        problem = SingularOrbits(orbits, bifurcation.kind, unknowns)
    start = started(problem, unknowns)
    if start is None:
        raise ValueError(f"bifurcation={bifurcation!r}: it is not found again with both parameters free")
    tracer = CurveTracer(problem, names, box, *limits_of(step, max_points), progress)
    curve = tracer.curve(start, BifurcationCurve)
    if _BROKEN in curve.ends and isinstance(problem, SingularOrbits):
        # The centre of the symmetry may move with the parameters.
        moving = problem.with_moving_centre()
        start = started(moving, unknowns)
        other = None if start is None else replace(tracer, problem=moving).curve(start, BifurcationCurve)
        curve = curve if other is None or _BROKEN in other.ends else other
    return curve


@dataclass(frozen=True, eq=False)
class CurveTracer:
    """Tracer of a curve of bifurcations in a box of two or three parameters."""

    problem: CurveProblem
    names: tuple[str, ...]
    box: tuple[tuple[float, float], ...]
    longest: float
    most: int
    progress: bool
    birth: OrbitBirth | None = None

    def side(self, start: SolutionPoint) -> tuple[list[SolutionPoint], str]:
        """Trace the curve along the tangent of a point; return the points and the reason why they end."""
        problem, orbits = self.problem, self.problem.orbits
        label, box = (
            f"curve of {problem.kind}" if self.progress else None,
            Box.of(self.box, orbits.scale[orbits.states :]),
        )
        return trace(problem, start, box, self.longest, self.most, label, orbits.growing, orbits.circles, self._end)

    def _end(self, step: ContinuationStep, may_refuse: bool) -> End | Literal["refused"] | None:
        """Return why the curve ends on a step, None where it goes on."""
        problem = self.problem
        why = self.birth.end(step.begin, step.end) if self.birth else ""
        if why == "refused" and may_refuse:
            return "refused"
        if why not in ("", "refused"):
            return End(why)
        if isinstance(problem, CodimensionTwoOrbits):
            if not problem.tests.confirms(problem.kind, step.end):
                return "refused" if may_refuse else End(_MET)
            problem = problem.bifurcation
        elif isinstance(problem, SingularOrbits) and problem.has_met(step.end):
            return self._meeting(problem, step, may_refuse)
        return None if isinstance(problem, FunctionOrbits) or problem.is_symmetric(step.end) else End(_BROKEN)

    def _meeting(self, problem: SingularOrbits, step: ContinuationStep, may_refuse: bool) -> End | Literal["refused"]:
        """End the curve at the last point, that at which the multipliers meet.

        A long step may lead to a curve of neutral saddles.
        """
        real = np.sign(cosine_of_pair(problem.multipliers(step.end)))

        def apart(place: SolutionPoint) -> float:
            return cosine_of_pair(problem.multipliers(place)) - real

        place = step.zero(apart, (apart(step.begin), apart(step.end)))
        if place is None and may_refuse:
            return "refused"
        return End(_MET, place if place is not None and step.along(place.unknowns) > 0.0 else None)

    def curve(self, start: SolutionPoint, record: type[Record]) -> Record:
        """Trace the curve on both sides of a point."""
        places, ends = both_ways(self.side, start)
        orbits = self.problem.orbits
        states = np.array([orbits.once(p.unknowns * orbits.scale) for p in places])
        return record(
            kind=self.problem.kind,
            parameters=self.names,
            values=np.clip(states[:, orbits.dimension :], *np.transpose(self.box)),
            points=wrap(states[:, : orbits.dimension], orbits.point_map.coordinates),
            multipliers=np.array([self.problem.multipliers(p) for p in places]),
            ends=ends,
            _problem=self.problem,
            _places=tuple(places),
        )
