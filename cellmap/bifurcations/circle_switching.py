"""The invariant circle that is born in a Neimark-Sacker bifurcation, attracting or not, followed over the parameter."""

from __future__ import annotations

import numpy as np

from .._lib.arrays import Floats
from .._lib.signatures import checked
from ..maps.parameters_as_states import swept_map
from ..maps.point_map import PointMap
from ..maps.tangent import tangent
from ..orbits.arclength import Box, ContinuationStep, End, SolutionPoint, corrected, trace
from ..orbits.orbit_equations import natural_sizes
from .branch import Bifurcation, Branch
from .circle_branches import CircleBranch, CircleStatus, circle_branch
from .circle_equations import CircleProblem
from .intervals import interval_between, limits_of
from .kinds import BifurcationKind

_FEWEST, _MOST = 9, 273  # phases
_SMALL_TAIL = 1e-10  # tail of the harmonics above which more phases are taken
_LARGE_TAIL = 1e-4  # tail of the harmonics above which the circle is not resolved
_COARSE = "more phases are needed"
_FIRST_STEP, _NEAREST = 0.05, 1e-6  # amplitude of the first circle, scaled, and the smallest


@checked
def switch_circle(
    branch: Branch,
    bifurcation: Bifurcation,
    lower: float,
    upper: float,
    step: float = 0.05,
    max_points: int = 200,
    progress: bool = False,
) -> CircleBranch:
    """Continue the invariant circle that is born in a Neimark-Sacker bifurcation, attracting or not.

    Newton's method solves the equation of invariance, f(K(t)) = K(t + rho), for the values of the circle K at equally
    spaced phases and for its rotation number rho, by trigonometric interpolation.  Pseudo-arclength continuation
    follows the circle around folds, where an attracting and a repelling circle meet.  Phases are doubled as the
    harmonics ask for.

    Parameters
    ----------
    branch : Branch
        The branch of periodic orbits on which the bifurcation was found.
    bifurcation : Bifurcation
        A Neimark-Sacker bifurcation.
    lower, upper : float
        Interval of the parameter, in its unit, which contains the bifurcation.
    step : float, optional
        Longest step, in units in which the interval has length 1 and circles have the natural sizes of coordinates.
    max_points : int, optional
        Largest number of circles.
    progress : bool, optional
        Show progress on a terminal.

    Returns
    -------
    CircleBranch
        Circles from the bifurcation on, all smooth, in the order of the branch; `exponents` tells which attract.  In a
        wide tongue, where the motion is locked, there is no such circle, and the branch ends.

    Raises
    ------
    ValueError
        For another bifurcation, an interval without it, or where no circle is found.

    References
    ----------
    Castella, Jorba, Celestial Mechanics and Dynamical Astronomy 76 (2000) 35; Schilder, Osinga, Vogt, SIAM Journal on
    Applied Dynamical Systems 4 (2005) 459.

    Examples
    --------
    >>> from cellmap import continue_orbit, discrete_map, periodic_orbit
    >>> delayed = discrete_map(lambda x, p: (p.a * x[0] * (1 - x[1]), x[0]), {"a": 1.9}, ("x", "y"))
    >>> branch = continue_orbit(delayed, periodic_orbit(delayed, [0.5, 0.5]), "a", 1.5, 2.1)
    >>> circles = switch_circle(branch, branch.bifurcations[0], 1.5, 2.1)
    >>> circles.ends, bool((circles.exponents < 0.0).all())
    (('bifurcation', 'left the interval'), True)
    """
    if bifurcation.kind is not BifurcationKind.NEIMARK_SACKER:
        raise ValueError(
            f"bifurcation={bifurcation!r}: give a Neimark-Sacker bifurcation; switch_branch follows others"
        )
    low, high = interval_between(lower, upper, bifurcation.value, "the bifurcation at ")
    longest, most = limits_of(step, max_points)
    exact = branch.point_map.with_params(**{branch.parameter: bifurcation.value})
    start = _born(exact, branch, bifurcation, high - low)
    if start is None:
        raise ValueError(f"bifurcation={bifurcation!r}: no circle is found beside it, as at a strong resonance")
    box = Box.of([[low, high]], high - low)
    label = f"invariant circle over {branch.parameter}" if progress else None
    found, end = _traced(*start, box, longest, most, label)
    return _record(exact, branch.parameter, (low, high), found, end)


def _born(
    exact: PointMap, branch: Branch, bifurcation: Bifurcation, span: float
) -> tuple[CircleProblem, SolutionPoint] | None:
    """Return the equations and the first circle, of a small amplitude along the critical eigenvectors."""
    name, period, m = branch.parameter, branch.period, _FEWEST
    sizes = natural_sizes(exact, bifurcation.point, period)
    values, vectors = np.linalg.eig(tangent(exact, bifurcation.point, period)[1])
    upper = np.flatnonzero(values.imag > 0.0)
    if not len(upper):
        return None
    k = upper[np.argmin(np.abs(np.abs(values[upper]) - 1.0))]
    waves = np.exp(2j * np.pi * np.arange(m) / m)[:, None]
    ring = np.real(waves * vectors[:, k])
    unit = np.tile(sizes * np.sqrt(m), m)
    scale = np.concatenate([unit, [1.0, span]])
    rho = float(np.angle(values[k])) / (2.0 * np.pi)
    centre = np.concatenate([np.tile(bifurcation.point, m), [rho, bifurcation.value]]) / scale
    direction = np.append(ring.ravel(), [0.0, 0.0]) / scale
    direction /= np.linalg.norm(direction)
    problem = CircleProblem(swept_map(exact, name), period, scale, bifurcation.point + ring)
    first = _FIRST_STEP
    while first > _NEAREST:
        start = corrected(problem, centre + first * direction, direction)
        if start is not None and np.linalg.norm(start.unknowns - centre) < 3.0 * first:
            return problem, start
        first *= 0.5
    return None


def _traced(
    problem: CircleProblem, start: SolutionPoint, box: Box, longest: float, most: int, label: str | None
) -> tuple[list[tuple[CircleProblem, Floats]], str]:
    """Return the circles with their equations, and the reason why they end."""
    problem, here = _resolved(problem, start) or (problem, start)
    found = [(problem, here.unknowns)]

    def visit(step: ContinuationStep, may_refuse: bool) -> End | None:
        tail = problem.tail(step.end.unknowns)
        if tail > _SMALL_TAIL and problem.phases < _MOST:
            return End(_COARSE)
        return End("not resolved") if tail > _LARGE_TAIL else None

    while True:
        places, end = trace(problem, here, box, longest, most - len(found) + 1, label, visit=visit)
        found += [(problem, place.unknowns) for place in places[1:]]
        if end != _COARSE:
            return found, end
        finer = _finer(problem, places[-1])
        if finer is None:
            return found, "no convergence"
        problem, here = finer


def _resolved(problem: CircleProblem, place: SolutionPoint) -> tuple[CircleProblem, SolutionPoint] | None:
    """Return the equations with as many phases as a circle asks for, and the circle."""
    while problem.tail(place.unknowns) > _SMALL_TAIL and problem.phases < _MOST:
        finer = _finer(problem, place)
        if finer is None:
            return None
        problem, place = finer
    return problem, place


def _finer(problem: CircleProblem, place: SolutionPoint) -> tuple[CircleProblem, SolutionPoint] | None:
    """Return the equations with twice as many phases, and the same circle; None where it is not found again."""
    phases = 2 * problem.phases - 1
    finer, unknowns = problem.finer(place.unknowns, phases)
    ahead = problem.finer(place.unknowns + place.tangent, phases)[1] - unknowns
    there = corrected(finer, unknowns, ahead / np.linalg.norm(ahead))
    return None if there is None else (finer, there)


def _record(
    exact: PointMap, parameter: str, interval: tuple[float, float], found: list[tuple[CircleProblem, Floats]], end: str
) -> CircleBranch:
    """Return the circles as a record."""
    values = np.clip([unknowns[-1] * problem.scale[-1] for problem, unknowns in found], *interval)
    circles = [
        problem.circle(exact.with_params(**{parameter: value}), unknowns)
        for (problem, unknowns), value in zip(found, values.tolist(), strict=True)
    ]
    looked = [(CircleStatus.SMOOTH, circle, 0, circle.frequency) for circle in circles]
    return circle_branch(exact, parameter, values, looked, ("bifurcation", end))
