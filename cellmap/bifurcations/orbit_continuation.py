"""Pseudo-arclength continuation of periodic orbits with detection of bifurcations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from .._lib.arrays import Floats
from .._lib.checks import one_point
from .._lib.signatures import checked
from ..maps.point_map import PointMap
from ..orbits.arclength import SolutionPoint, corrected, tangent_of
from ..orbits.attractor import Attractor
from ..orbits.orbit_equations import OrbitProblem, begin_orbit, orbit_problem
from ..orbits.orbit_kinds import PeriodicOrbit
from ..orbits.shooting import DIVISIONS, LARGEST_GROWTH, ShootingProblem
from .branch import Bifurcation, Branch
from .branch_tracer import LARGE, BranchTracer, Pieces, born_orbit, joined
from .codimension_two import CodimensionTwo
from .function_zeros import FunctionZero
from .intervals import interval_between, limits_of
from .kinds import BifurcationKind
from .period_measures import OrbitFunction, Quantity, as_functions

_STILL, _OPEN = (
    1e-13,
    1e-4,
)  # scaled change of the parameter, and distance from the old orbits, on a curve of doubled ones
_SMALL = 0.1  # part of the interval that a branch may take to be followed in units of its own


@checked
def continue_orbit(
    point_map: PointMap,
    orbit: PeriodicOrbit | Attractor | Bifurcation | FunctionZero | CodimensionTwo,
    parameter: str,
    lower: float,
    upper: float,
    step: float = 0.01,
    max_points: int = 1000,
    sizes: ArrayLike | None = None,
    progress: bool = False,
    until: Mapping[str, Quantity | OrbitFunction] | None = None,
) -> Branch:
    """Continue a periodic orbit in a parameter, around folds, and detect its bifurcations.

    The method is pseudo-arclength continuation (Keller 1977) with derivatives by state and parameter from the
    variational equation.  Test functions are monitored along the branch: the tangent's component along the parameter
    (folds), the bordered determinant (branch points), det(M + I) (period doublings) and the product of all mu_i mu_j -
    1 (Neimark-Sacker); their zeros are located on the branch by Brent's method.  Where deviations grow by more than 1e3
    in a period, the orbit is divided into segments (multiple shooting), and multipliers follow from products of QR
    decompositions.  A step is repeated with half its
    length if the detected bifurcations do not explain the change in the number of unstable multipliers.

    Parameters
    ----------
    point_map : PointMap
        The map at the parameters of the orbit; for an interpolated map, its exact map is used.
    orbit : PeriodicOrbit, Attractor, Bifurcation, FunctionZero or CodimensionTwo
        Initial orbit, from :func:`periodic_orbit`, :func:`find_periodic_orbits` or :func:`find_attractors`; or a
        bifurcation, a zero of a function or a point of codimension two of a branch or curve of this map, at whose
        parameters the new branch begins.
    parameter : str
        Name of the parameter.
    lower, upper : float
        Interval of parameter values, in its unit, which contains the present one.
    step : float, optional
        Longest step, in units in which the interval has length 1 and each coordinate its natural size, or the size that
        it has reached on the branch.  Beyond ten times the size that it began with, steps of a coordinate grow while
        the derivatives of the map hardly change.
    max_points : int, optional
        Largest number of points on either side; `ends` of the branch shows where they did not suffice.
    sizes : array_like, shape (dimension,), optional
        Natural sizes of displacements, in units of the coordinates.  By default a radian for an angle; for other
        coordinates an estimate from the angle, from the state and from its drift with the parameter.  Give them for an
        equilibrium at 0 in unusual units.
    progress : bool, optional
        Show progress on a terminal.
    until : mapping of str to OrbitFunction, optional
        Functions by their names, as for :meth:`Branch.with_zeros`: the branch ends where one of them is zero, and
        `ends` has its name.  A family of conservative orbits is followed up to an energy or an amplitude.

    Returns
    -------
    Branch
        The branch, from its end towards `lower` to that towards `upper`, as seen from the initial orbit.

    Raises
    ------
    TypeError, ValueError
        For an orbit that is not periodic or not one of this map, an unknown parameter, an empty interval or one that
        does not contain the present value.

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
    longest, most = limits_of(step, max_points)
    if not isinstance(orbit, PeriodicOrbit | Attractor):
        orbit = orbit.orbit
        point_map = point_map.without_table.with_params(**orbit.params)
    exact, state, period = begin_orbit(point_map, orbit, parameter)
    value = float(exact.params[parameter])
    low, high = interval_between(lower, upper, value, f"{parameter}=")
    own = None if sizes is None else one_point("sizes", sizes, exact.dimension)
    if own is not None and not (own > 0.0).all():
        raise ValueError(f"sizes={own.tolist()}: give positive numbers")
    for end in (low, high):
        exact.with_params(**{parameter: end})
    label = f"continuation in {parameter}" if progress else None
    limits = as_functions(until, "until")

    def follow(span: float) -> Branch:
        problem = orbit_problem(exact, state, period, (parameter,), (span,), own)
        unknowns = np.append(state, value) / problem.scale
        start = corrected(problem, unknowns, problem.parameter_direction) or _at_a_fold(problem, unknowns)
        divided = [n for n in DIVISIONS if ShootingProblem.can_divide(problem, n)]
        largest = LARGEST_GROWTH if divided else np.inf
        tracer = BranchTracer(
            exact, parameter, problem, (low, high), longest, most, label, frozenset(), largest, own is not None, limits
        )
        start = tracer.clear_start(start)
        ahead = _in_segments(tracer, start, divided, own is not None)
        if ahead[-1][1].end == "closed":
            return replace(joined([], ahead), ends=("closed", "closed"))
        return joined(_in_segments(tracer, replace(start, tangent=-start.tangent), divided, own is not None), ahead)

    branch = follow(high - low)
    extent = float(np.ptp(branch.values))
    if "no convergence" in branch.ends and 0.0 < extent < _SMALL * (high - low):
        # In units of the interval the ends of a small isola are too sharp to be followed around.
        near = follow(extent)
        branch = near if near.ends == ("closed", "closed") else branch
    return branch


@checked
def switch_branch(
    branch: Branch,
    bifurcation: Bifurcation,
    lower: float,
    upper: float,
    step: float = 0.01,
    max_points: int = 1000,
    side: int = 1,
    progress: bool = False,
) -> Branch:
    """Continue the branch that bifurcates from a branch at a bifurcation.

    Parameters
    ----------
    branch : Branch
        The branch on which the bifurcation was found.
    bifurcation : Bifurcation
        A period doubling, from which orbits of twice the period are continued, a pitchfork or a transcritical
        bifurcation.
    lower, upper : float
        Interval of the parameter.
    step, points, progress
        As for :func:`continue_orbit`.
    side : {1, -1}, optional
        Side of the new branch.  The two sides of a pitchfork are mirror images, or, of the branch that passes it, lower
        and higher values of the parameter; those of a period doubling are the same orbit, shifted by half a period.

    Returns
    -------
    Branch
        The new branch, from the bifurcation on.

    Raises
    ------
    ValueError
        For a bifurcation from which no branch of periodic orbits emanates, as from one at whose parameter value orbits
        fill a curve, or where it is not found.

    Examples
    --------
    >>> from cellmap import discrete_map, periodic_orbit
    >>> logistic = discrete_map(lambda x, p: (p.r * x[0] * (1 - x[0]),), {"r": 2.0}, ("x",))
    >>> fixed = continue_orbit(logistic, periodic_orbit(logistic, [0.5]), "r", 1.5, 3.5)
    >>> switch_branch(fixed, fixed.bifurcations[-1], 1.5, 3.5)
    Branch(period 2, ... points, r from 3.00... to 3.5: period doubling at 3.44948974)
    """
    low, high = interval_between(lower, upper, bifurcation.value, "the bifurcation at ")
    if side not in (1, -1):
        raise ValueError(f"side={side!r}: give 1 or -1")
    if bifurcation._branch_direction is None:
        raise ValueError(f"bifurcation={bifurcation!r}: no branch of periodic orbits leaves it")
    longest, most = limits_of(step, max_points)
    label = f"continuation in {branch.parameter}" if progress else None
    tracer = BranchTracer(branch.point_map, branch.parameter, bifurcation._problem, (low, high), longest, most, label)
    born = born_orbit(tracer, bifurcation, high - low, side=side)
    if born is None:
        raise ValueError(
            f"bifurcation={bifurcation!r}: no orbit is found on the branch that leaves it; give a smaller step"
        )
    further, start = born
    moved = abs(float(start.unknowns[-1] * further.problem.scale[-1]) - bifurcation.value) / (high - low)
    doubles = bifurcation.kind is BifurcationKind.PERIOD_DOUBLING
    if moved < _STILL and doubles and bifurcation._problem.opened(further.problem, start.unknowns) > _OPEN:
        raise ValueError(
            f"bifurcation={bifurcation!r}: orbits of twice the period fill a curve there, and form no branch"
        )
    return further.branch(further.trace(start))


def _in_segments(tracer: BranchTracer, start: SolutionPoint, divided: Sequence[int], sized: bool) -> Pieces:
    """Trace a branch along the tangent of a point, with the orbit in more segments where deviations grow too much."""
    single, pieces = tracer.problem, tracer.follow(start)
    for number, count in enumerate(divided, 1):
        tracer, segment = pieces[-1]
        left = tracer.most - len(segment.places) + 1
        if segment.end != LARGE or left < 1:
            break
        old, last = tracer.problem, segment.places[-1]
        problem = ShootingProblem.of(single, count, old.once(last.unknowns * old.scale), sized)
        largest = LARGEST_GROWTH if number < len(divided) else np.inf
        finer = replace(tracer, problem=problem, most=left, largest_growth=largest)
        begin = finer.resumed(old, last)
        if begin is None:
            break
        # A closed branch comes back to where it began, in whatever units and segments.
        origin = finer.resumed(old, tracer.origin or segment.places[0])
        pieces += replace(finer, origin=origin).follow(begin)
    return pieces


def _at_a_fold(problem: OrbitProblem, unknowns: Floats) -> SolutionPoint:
    """Return the place of a given solution whose parameter cannot be held fixed."""
    derivatives = problem(unknowns)[1]
    direction = np.linalg.svd(derivatives)[2][-1]
    along = tangent_of(derivatives, direction)
    return SolutionPoint(unknowns, derivatives, direction if along is None else along)
