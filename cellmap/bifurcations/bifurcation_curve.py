"""Curves of bifurcations of periodic orbits in two parameters."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .._lib.checks import finite_number, shown, whole_number
from .._lib.signatures import checked
from .._lib.threads import progress_bar
from ..maps.coordinates import wrap
from ..orbits.multipliers import multipliers_of, pair_on_circle, pairs_beside_one
from .arclength import SolutionPoint, continuation_steps, corrected
from .branch import Bifurcation, Branch
from .kinds import BifurcationKind
from .orbit_equations import OrbitProblem, orbit_problem

_DIFFERENCE = 1e-5  # of test functions, in scaled unknowns
_REAL = 1e-4  # imaginary part of multipliers that have met on the real axis


@dataclass(frozen=True, eq=False)
class BifurcationCurve:
    """Curve of a bifurcation in the plane of two parameters.

    Parameters
    ----------
    kind : BifurcationKind
        Kind of the bifurcation.
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
    """

    kind: BifurcationKind
    parameters: tuple[str, str]
    values: NDArray[np.float64]
    points: NDArray[np.float64]
    multipliers: NDArray[np.complex128]
    ends: tuple[str, str]

    def __repr__(self) -> str:
        spans = ", ".join(
            f"{name} from {column.min():.6g} to {column.max():.6g}"
            for name, column in zip(self.parameters, self.values.T, strict=True)
        )
        return f"BifurcationCurve({self.kind}, {len(self.values)} points, {spans})"


@checked
def continue_bifurcation(
    branch: Branch,
    bifurcation: Bifurcation,
    parameter: str,
    first: tuple[float, float],
    second: tuple[float, float],
    step: float = 0.01,
    max_points: int = 1000,
    progress: bool = False,
) -> BifurcationCurve:
    """Continue a bifurcation of a branch in two parameters.

    The equations of the orbit and the bifurcation condition, det(M - I) = 0 (fold), det(M + I) = 0 (period doubling) or
    the product of all mu_i mu_j - 1 = 0 (Neimark-Sacker), with the monodromy matrix M and its multipliers mu_i, are
    continued by pseudo-arclength in both parameters.  For a pitchfork, which persists through a symmetry, displacements
    along the left null vector are in addition held at zero.

    Parameters
    ----------
    branch : Branch
        The branch on which the bifurcation was found.
    bifurcation : Bifurcation
        Fold, period doubling, pitchfork or Neimark-Sacker.
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
        The curve.  A curve of Neimark-Sacker bifurcations ends where the multipliers meet on the real axis.

    Raises
    ------
    TypeError, ValueError
        For a transcritical bifurcation, which a generic second parameter destroys unless a solution is known for all
        values (see :func:`stability_map`), an unknown parameter or empty intervals.

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
    if bifurcation.kind is BifurcationKind.TRANSCRITICAL:
        raise ValueError(
            f"bifurcation={bifurcation!r}: a generic second parameter destroys it; for an equilibrium that is the same "
            "state at all values use stability_map"
        )
    exact = branch.point_map.with_params(**{branch.parameter: bifurcation.value})
    names = (branch.parameter, parameter)
    if not isinstance(parameter, str) or parameter not in exact.params or parameter == branch.parameter:
        others = sorted(set(exact.params) - {branch.parameter})
        raise ValueError(f"parameter={shown(parameter)}: give another parameter of this map, one of {others}")
    box = (_interval("first", first, bifurcation.value), _interval("second", second, exact.params[parameter]))
    longest, most = (
        finite_number("step", step, above=0.0, at_most=1.0),
        whole_number("max_points", max_points, at_least=1),
    )
    spans = (box[0][1] - box[0][0], box[1][1] - box[1][0])
    orbits = orbit_problem(exact, bifurcation.point, branch.period, names, spans)
    unknowns = np.concatenate([bifurcation.point, [bifurcation.value, exact.params[parameter]]]) / orbits.scale
    problem = _Singular.at(orbits, bifurcation.kind, unknowns)
    direction = np.linalg.svd(problem(unknowns)[1])[2][-1]
    start = corrected(problem, unknowns, direction)
    if start is None:
        raise ValueError(f"bifurcation={bifurcation!r}: it is not found again with both parameters free")
    low, high = np.array(box).T / np.array(spans)
    sides = []
    for sign in (-1.0, 1.0):
        places, end = [start], "no convergence"
        label = f"curve of {bifurcation.kind}" if progress else None
        with progress_bar(most, label) as tick:
            begin = replace(start, tangent=sign * start.tangent)
            for part in continuation_steps(problem, begin, longest, orbits.growing):
                there = part.end.unknowns[-2:]
                cut = None if (there >= low).all() and (there <= high).all() else part.cut(exact.dimension, low, high)
                last = part.end if cut is None else cut.end
                if bifurcation.kind is BifurcationKind.NEIMARK_SACKER and problem.is_real(last):
                    end = "multipliers met on the real axis"
                    break
                places.append(last)
                tick(1)
                if cut is not None:
                    end = "left the intervals"
                elif len(places) > 3 and part.passes(begin, orbits.circles):
                    end = "closed"
                elif len(places) > most:
                    end = "most points"
                else:
                    continue
                break
        sides.append((places, end))
        if end == "closed":
            sides.append(([start], end))
            break
    (back, first_end), (ahead, last_end) = sides
    places = [*back[:0:-1], *ahead]
    states = np.array([p.unknowns for p in places]) * orbits.scale
    d = exact.dimension
    return BifurcationCurve(
        kind=bifurcation.kind,
        parameters=names,
        values=states[:, d:],
        points=wrap(states[:, :d], exact.coordinates),
        multipliers=np.array([multipliers_of(problem.matrix(p)) for p in places]),
        ends=(first_end, last_end),
    )


def _interval(label: str, given: tuple[float, float], value: float) -> tuple[float, float]:
    try:
        low, high = given
    except (TypeError, ValueError):
        raise TypeError(f"{label}={given!r}: give two numbers, the ends of an interval") from None
    low, high = finite_number(f"{label}[0]", low), finite_number(f"{label}[1]", high)
    if not low <= value <= high or low == high:
        raise ValueError(f"{label}={given!r}: give an interval that contains the present value {value:g}")
    return low, high


@dataclass(frozen=True, eq=False)
class _Singular:
    """Equations of the orbit with the bifurcation condition, for unknowns (x, q1, q2) in units of a scale."""

    orbits: OrbitProblem
    kind: BifurcationKind
    null: NDArray[np.float64]
    symmetric: NDArray[np.float64]

    @classmethod
    def at(cls, orbits: OrbitProblem, kind: BifurcationKind, unknowns: NDArray[np.float64]) -> _Singular:
        """Set up the equations at a point of the curve."""
        d = orbits.dimension
        left, _, _ = np.linalg.svd(orbits(unknowns)[1][:, :d])
        return cls(orbits, kind, left[:, -1], unknowns[:d])

    def matrix(self, place: SolutionPoint) -> NDArray[np.float64]:
        """Return the monodromy matrix."""
        return self._matrices(place.unknowns)

    def is_real(self, place: SolutionPoint) -> bool:
        """Return whether the multipliers whose product is 1 are real."""
        found = multipliers_of(self.matrix(place))
        return bool(abs(found[pair_on_circle(found)[0]].imag) < _REAL)

    def _matrices(self, unknowns: NDArray[np.float64]) -> NDArray[np.float64]:
        d = self.orbits.dimension
        return self.orbits(unknowns)[1][..., :d] + np.eye(d)

    def _test(self, matrices: NDArray[np.float64]) -> NDArray[np.float64]:
        unit = np.eye(matrices.shape[-1])
        if self.kind is BifurcationKind.NEIMARK_SACKER:
            return pairs_beside_one(np.linalg.eigvals(matrices).astype(np.complex128))
        sign = 1.0 if self.kind is BifurcationKind.PERIOD_DOUBLING else -1.0
        return np.asarray(np.linalg.det(matrices + sign * unit))

    def __call__(self, unknowns: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        residual, slopes = self.orbits(unknowns)
        d, m = self.orbits.dimension, len(unknowns)
        offsets = _DIFFERENCE * np.eye(m)
        around = np.concatenate([unknowns + offsets, unknowns - offsets])
        tests = self._test(self._matrices(around))
        gradient = (tests[:m] - tests[m:]) / (2.0 * _DIFFERENCE)
        test = self._test(slopes[:, :d] + np.eye(d))
        if self.kind is not BifurcationKind.PITCHFORK:
            return np.append(residual, test), np.vstack([slopes, gradient])
        # By symmetry the residual has no part along the left null vector, and the state none that breaks the symmetry.
        broken = self.null @ (unknowns[:d] - self.symmetric)
        residual = residual - (self.null @ residual) * self.null + broken * self.null
        slopes = slopes - np.outer(self.null, self.null @ slopes)
        slopes[:, :d] += np.outer(self.null, self.null)
        gradient[:d] -= (gradient[:d] @ self.null) * self.null
        return np.append(residual, test), np.vstack([slopes, gradient])
