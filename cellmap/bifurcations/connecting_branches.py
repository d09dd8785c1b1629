"""Connecting orbits followed over a parameter, and their tangencies over two."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import ClassVar

import numpy as np

from .._lib.arrays import Floats
from .._lib.checks import known_parameter
from .._lib.records import ConvertsToDataFrame, ConvertsToXarray
from .._lib.signatures import checked
from ..maps.coordinates import Coordinate
from ..maps.point_map import PointMap
from ..orbits.arclength import Box, ContinuationStep, End, SolutionPoint, both_ways, corrected, trace
from .connecting_problem import ConnectingProblem, TangencyProblem
from .connections import ConnectingOrbit, orbit_at, problem_of
from .intervals import interval_between, interval_of, limits_of, spans, two_parameters

_BESIDE = 1e-3  # step, scaled, along the branch that tells on which side of a tangency the orbits are


@dataclass(frozen=True, eq=False)
class Tangency:
    """Tangency of a stable and an unstable manifold: a fold of connecting orbits.

    Parameters
    ----------
    value : float
        The parameter, in its unit.
    orbit : ConnectingOrbit
        The orbit along which the manifolds touch.
    gains : bool
        Whether the connecting orbits exist above the value, so that this is their first tangency as the parameter
        grows; otherwise they exist below it, and it is their last one.
    """

    _made_by: ClassVar = "continue_connection, among the tangencies of a ConnectionBranch"
    value: float
    orbit: ConnectingOrbit
    gains: bool

    def __repr__(self) -> str:
        return f"Tangency(at {self.value:.12g}, orbits exist {'above' if self.gains else 'below'})"


@dataclass(frozen=True, eq=False)
class ConnectionBranch(ConvertsToXarray, ConvertsToDataFrame):
    """Branch of connecting orbits in one parameter.

    Parameters
    ----------
    parameter : str
        Name of the parameter.
    values : ndarray, shape (n,)
        The parameter, in its unit.
    angles : ndarray, shape (n,)
        Angles in radians at which the manifolds cross; 0 at tangencies.
    points : ndarray, shape (n, length, dimension)
        Connecting orbits, with unwrapped angles.
    tangencies : tuple of Tangency
        Tangencies in the order of the branch.
    ends : tuple of str
        Reasons why the branch ends at its first and at its last point.
    parameter_units : mapping of str to str
        Units of parameters, as far as the system declares them.
    """

    parameter: str
    values: Floats
    angles: Floats
    points: Floats
    tangencies: tuple[Tangency, ...]
    ends: tuple[str, str]
    parameter_units: Mapping[str, str] = field(default_factory=dict)

    def __repr__(self) -> str:
        found = "; ".join(f"{t.value:.9g}" for t in self.tangencies) or "none"
        span = f"{self.values.min():.6g} to {self.values.max():.6g}"
        return f"ConnectionBranch({len(self.values)} orbits, {self.parameter} from {span}, tangencies: {found})"


@dataclass(frozen=True, eq=False)
class TangencyCurve(ConvertsToXarray, ConvertsToDataFrame):
    """Curve of tangencies in the plane of two parameters.

    Parameters
    ----------
    parameters : tuple of str
        Names of the parameters.
    values : ndarray, shape (n, 2)
        Parameter values along the curve, in their units.
    points : ndarray, shape (n, length, dimension)
        Orbits along which the manifolds touch, with unwrapped angles.
    ends : tuple of str
        Reasons why the curve ends at its first and at its last point.
    coordinates : tuple of Coordinate
        State variables.
    """

    parameters: tuple[str, str]
    values: Floats
    points: Floats
    ends: tuple[str, str]
    coordinates: tuple[Coordinate, ...]

    def __repr__(self) -> str:
        return f"TangencyCurve({len(self.values)} points, {spans(self.parameters, self.values)})"


@checked
def continue_connection(
    connection: ConnectingOrbit,
    parameter: str,
    lower: float,
    upper: float,
    step: float = 0.05,
    max_points: int = 400,
    progress: bool = False,
) -> ConnectionBranch:
    """Continue a connecting orbit in a parameter, around the tangencies of the manifolds.

    Pseudo-arclength continuation of the chain of images together with both saddles.  Where stable and unstable manifold
    touch, two connecting orbits meet and the branch turns back: the parameter value of this fold is refined to rounding
    error.

    Parameters
    ----------
    connection : ConnectingOrbit
        One of :func:`connecting_orbits`.
    parameter : str
        Name of the parameter.
    lower, upper : float
        Interval of parameter values, in its unit, which contains the present one.
    step : float, optional
        Longest step, in units in which the interval has length 1 and the region of the orbit about the same.
    max_points : int, optional
        Largest number of orbits on either side.
    progress : bool, optional
        Show progress on a terminal.

    Returns
    -------
    ConnectionBranch
        The branch, from its end towards `lower` to that towards `upper`, as seen from the initial orbit.

    Raises
    ------
    ValueError
        For an unknown parameter, or an interval that does not contain the present value.

    References
    ----------
    Beyn, Kleinkauf, SIAM Journal on Numerical Analysis 34 (1997) 1207; Kleinkauf, Zeitschrift für angewandte Mathematik
    und Mechanik 78, S3 (1998) 969.

    Examples
    --------
    >>> from cellmap import discrete_map, periodic_orbit
    >>> from cellmap.bifurcations import connecting_orbits
    >>> henon = discrete_map(lambda x, p: (p.a - x[0]**2 + p.b * x[1], x[0]), {"a": 1.4, "b": -0.3}, ("x", "y"))
    >>> orbit = connecting_orbits(henon, periodic_orbit(henon, [-2.0, -2.0]), max_steps=20)[0]
    >>> continue_connection(orbit, "a", 1.2, 1.5).tangencies
    (Tangency(at 1.314527109..., orbits exist above),)
    """
    exact = connection._point_map
    known_parameter("parameter", parameter, exact.params)
    (low, high), limits = interval_between(lower, upper, exact.params[parameter]), limits_of(step, max_points)
    points = _points(connection)
    problem, unknowns = problem_of(exact, (parameter,), (high - low,), connection.steps, connection._scale, points)
    start = corrected(problem, unknowns, problem.parameter_direction)
    if start is None:
        raise ValueError(f"connection={connection!r}: it is not found again with {parameter} free")
    label, box = f"connecting orbits over {parameter}" if progress else None, Box.of([[low, high]], high - low)

    sides: list[list[Tangency]] = []

    def side(begin: SolutionPoint) -> tuple[list[SolutionPoint], str]:
        found = list[Tangency]()

        def visit(step: ContinuationStep, may_refuse: bool) -> End | None:
            if step.begin.tangent[-1] * step.end.tangent[-1] < 0.0:
                fold = step.located(lambda place: float(place.tangent[-1]))
                found.extend([] if fold is None else [_tangency(exact, problem, fold, parameter)])
            return _end_at_saddles(problem, step)

        sides.append(found)
        return trace(problem, begin, box, *limits, label, visit=visit)

    every, ends = both_ways(side, start)
    after, *before = sides
    return ConnectionBranch(
        parameter=parameter,
        values=np.clip(np.array([p.unknowns[-1] for p in every]) * (high - low), low, high),
        angles=np.array([problem.angle(p.unknowns) for p in every]),
        points=np.array([problem.states(p.unknowns)[2:, :-1] for p in every]),
        tangencies=(*(t for found in before for t in found[::-1]), *after),
        ends=ends,
        parameter_units=exact.parameter_units,
    )


@checked
def continue_tangency(
    tangency: Tangency,
    parameters: tuple[str, str],
    first: tuple[float, float],
    second: tuple[float, float],
    step: float = 0.05,
    max_points: int = 400,
    progress: bool = False,
) -> TangencyCurve:
    """Continue a tangency of a stable and an unstable manifold in two parameters.

    Parameters
    ----------
    tangency : Tangency
        One of the `tangencies` of a :class:`ConnectionBranch`.
    parameters : tuple of str
        Names of the two parameters.
    first, second : tuple of float
        Intervals of both, in their units, which contain the values at the tangency.
    step : float, optional
        Longest step, in units in which the intervals have length 1.
    max_points : int, optional
        Largest number of points on either side.
    progress : bool, optional
        Show progress on a terminal.

    Returns
    -------
    TangencyCurve
        The curve: along it basin boundaries become fractal, or attractors are destroyed, if the orbit is the first one
        to appear.

    Raises
    ------
    TypeError, ValueError
        For unknown or equal parameters, or intervals that do not contain the present values.

    References
    ----------
    Govaerts, *Numerical Methods for Bifurcations of Dynamical Equilibria* (2000), chapter 3 (bordered systems).

    Examples
    --------
    >>> from cellmap import discrete_map, periodic_orbit
    >>> from cellmap.bifurcations import connecting_orbits
    >>> henon = discrete_map(lambda x, p: (p.a - x[0]**2 + p.b * x[1], x[0]), {"a": 1.4, "b": -0.3}, ("x", "y"))
    >>> orbit = connecting_orbits(henon, periodic_orbit(henon, [-2.0, -2.0]), max_steps=20)[0]
    >>> (touching,) = continue_connection(orbit, "a", 1.2, 1.5).tangencies
    >>> continue_tangency(touching, ("a", "b"), (1.2, 1.6), (-0.4, -0.2)).ends
    ('left the intervals', 'left the intervals')
    """
    exact = tangency.orbit._point_map
    one, two = two_parameters(parameters, exact.params)
    intervals = [
        interval_of(label, given, exact.params[name])
        for label, given, name in (("first", first, one), ("second", second, two))
    ]
    limits = limits_of(step, max_points)
    lengths = tuple(high - low for low, high in intervals)
    orbit = tangency.orbit
    orbits, unknowns = problem_of(exact, (one, two), lengths, orbit.steps, orbit._scale, _points(orbit))
    problem = TangencyProblem(orbits)
    start = corrected(problem, unknowns, np.linalg.svd(problem(unknowns)[1])[2][-1])
    if start is None:
        raise ValueError(f"tangency={tangency!r}: it is not found again with both parameters free")
    box = Box.of(intervals, lengths)
    label, visit = f"tangencies over {one} and {two}" if progress else None, partial(_end_at_saddles, problem)
    every, ends = both_ways(lambda begin: trace(problem, begin, box, *limits, label, visit=visit), start)
    return TangencyCurve(
        parameters=(one, two),
        values=np.clip(np.array([p.unknowns[-2:] for p in every]) * lengths, *np.transpose(intervals)),
        points=np.array([orbits.states(p.unknowns)[2:, :-2] for p in every]),
        ends=ends,
        coordinates=exact.coordinates,
    )


def _end_at_saddles(
    problem: ConnectingProblem | TangencyProblem, step: ContinuationStep, may_refuse: bool = False
) -> End | None:
    """Return the end of a curve on a step to a place at which a saddle is none any more."""
    return None if problem.has_saddles(step.end.unknowns) else End("a saddle changes its stability")


def _tangency(exact: PointMap, problem: ConnectingProblem, fold: SolutionPoint, parameter: str) -> Tangency:
    """Return the tangency at a fold; a point of the branch beside it tells on which side the orbits are."""
    value = float(fold.unknowns[-1] * problem.scale[-1])
    ahead = corrected(problem, fold.unknowns + _BESIDE * fold.tangent, fold.tangent)
    gains = ahead is not None and bool(ahead.unknowns[-1] > fold.unknowns[-1])
    here = exact.with_params(**{parameter: value})
    return Tangency(value, orbit_at(here, problem, fold.unknowns[:-1], problem.angle(fold.unknowns)), gains)


def _points(orbit: ConnectingOrbit) -> Floats:
    """Return the points (n, d) of saddles and orbit as the equations have them."""
    d = len(orbit._scale)
    return np.asarray(orbit._unknowns.reshape(-1, d) * orbit._scale)
