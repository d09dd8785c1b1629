"""The invariant circle that is born in a Neimark-Sacker bifurcation, attracting or not, followed over the parameter."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .._lib.checks import finite_number, whole_number
from .._lib.signatures import checked
from .._lib.stopping import check_stop
from .._lib.threads import progress_bar
from ..maps.parameters_as_states import swept_map
from ..maps.point_map import PointMap
from ..maps.tangent import tangent
from .arclength import SolutionPoint, continuation_steps, corrected
from .branch import Bifurcation, Branch
from .circle_branches import CircleBranch, CircleStatus, decay_of
from .circle_equations import CircleProblem, across_exponent
from .kinds import BifurcationKind
from .orbit_equations import natural_sizes

_FEWEST, _MOST = 9, 273  # phases
_SMALL_TAIL = 1e-10  # of harmonics, from which there should be more phases,
_LARGE_TAIL = 1e-4  # and from which the circle is not resolved
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
    low, high = finite_number("lower", lower), finite_number("upper", upper)
    if not low < bifurcation.value < high:
        raise ValueError(
            f"lower={lower!r}, upper={upper!r}: give an interval, the smaller value first, that contains the "
            f"bifurcation at {bifurcation.value:g}"
        )
    longest = finite_number("step", step, above=0.0, at_most=1.0)
    most = whole_number("max_points", max_points, at_least=1)
    exact = branch.point_map.with_params(**{branch.parameter: bifurcation.value})
    start = _born(exact, branch, bifurcation, high - low)
    if start is None:
        raise ValueError(f"bifurcation={bifurcation!r}: no circle is found beside it, as at a strong resonance")
    edges = np.array([[low], [high]]) / (high - low)
    label = f"invariant circle over {branch.parameter}" if progress else None
    found, end = _traced(*start, edges, longest, most, label)
    return _record(exact, branch.parameter, found, end)


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
    problem: CircleProblem,
    start: SolutionPoint,
    edges: NDArray[np.float64],
    longest: float,
    most: int,
    label: str | None,
) -> tuple[list[tuple[CircleProblem, NDArray[np.float64]]], str]:
    """Return the circles with their equations, and the reason why they end."""
    low, high = edges
    problem, here = _resolved(problem, start) or (problem, start)
    found = [(problem, here.unknowns)]
    with progress_bar(most, label) as tick:
        while True:
            refined = False
            for part in continuation_steps(problem, here, longest, np.zeros(len(here.unknowns), bool)):
                check_stop()
                tail = problem.tail(part.end.unknowns)
                if tail > _SMALL_TAIL and problem.phases < _MOST:
                    refined = True
                    break
                if tail > _LARGE_TAIL:
                    return found, "not resolved"
                inside = low <= part.end.unknowns[-1:] <= high
                last = None if inside else part.cut(len(part.end.unknowns) - 1, low, high)
                here = part.end if last is None else last.end
                found.append((problem, here.unknowns))
                tick(1)
                if last is not None:
                    return found, "left the interval"
                if len(found) > most:
                    return found, "most points"
            if not refined:
                return found, "no convergence"
            finer = _finer(problem, here)
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
    exact: PointMap, parameter: str, found: list[tuple[CircleProblem, NDArray[np.float64]]], end: str
) -> CircleBranch:
    """Return the circles as a record."""
    values = np.array([unknowns[-1] * problem.scale[-1] for problem, unknowns in found])
    circles, exponents = [], []
    for (problem, unknowns), value in zip(found, values.tolist(), strict=True):
        here = exact.with_params(**{parameter: value})
        circles.append(problem.circle(here, unknowns))
        exponents.append(across_exponent(here, circles[-1]))
    errors = np.array([c.invariance_error for c in circles])
    return CircleBranch(
        parameter=parameter,
        values=values,
        status=(CircleStatus.SMOOTH,) * len(found),
        rotation=np.array([c.frequency for c in circles]),
        rotation_errors=errors,
        period=np.zeros(len(found), np.int64),
        invariance_errors=errors.copy(),
        decay=np.array([decay_of(c) for c in circles]),
        circles=tuple(circles),
        coordinates=exact.coordinates,
        exponents=np.array(exponents),
        ends=("bifurcation", end),
    )
