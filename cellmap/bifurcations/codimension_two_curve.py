"""Curves of points of codimension two in three parameters."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from .._lib.arrays import Complexes, Floats
from .._lib.checks import whole_number
from .._lib.signatures import checked
from ..maps.coordinates import wrap
from ..orbits.arclength import Box, ContinuationStep, End, SolutionPoint, both_ways, corrected, trace
from ..orbits.orbit_kinds import PeriodicOrbit, with_values
from .bifurcation_curve import BifurcationCurve
from .codimension_two import CodimensionTwo, CodimensionTwoOrbits
from .curve_switching import check_on
from .intervals import further_parameter, interval_of, limits_of, spans
from .kinds import CodimensionTwoKind
from .singular_orbits import SingularOrbits


@dataclass(frozen=True, eq=False)
class CodimensionTwoCurve:
    """Curve of bifurcations of codimension two in the space of three parameters.

    Parameters
    ----------
    kind : CodimensionTwoKind
        Kind of the bifurcation.
    parameters : tuple of str
        Names of the parameters.
    values : ndarray, shape (n, 3)
        Parameter values along the curve, in their units.
    points : ndarray, shape (n, dimension)
        First points of the orbits, angles within their period.
    multipliers : ndarray of complex, shape (n, dimension)
        Multipliers, those of the kind on the unit circle.
    ends : tuple of str
        Reasons why the curve ends at its first and at its last point.
    """

    kind: CodimensionTwoKind
    parameters: tuple[str, str, str]
    values: Floats
    points: Floats
    multipliers: Complexes
    ends: tuple[str, str]
    _problem: CodimensionTwoOrbits = field(repr=False)
    _places: tuple[SolutionPoint, ...] = field(repr=False)

    @checked
    def orbit(self, place: int) -> PeriodicOrbit:
        """Return the orbit at a point of the curve, by its number, with all parameters in its `params`."""
        place = whole_number("place", place, at_most=len(self._places) - 1)
        found = self._problem.bifurcation.orbits.orbit_at(self._places[place].unknowns)
        return with_values(found, self.parameters, self.values[place])

    def __repr__(self) -> str:
        return f"CodimensionTwoCurve({self.kind}, {len(self.values)} points, {spans(self.parameters, self.values)})"


@checked
def continue_codimension_two(
    curve: BifurcationCurve,
    point: CodimensionTwo,
    parameter: str,
    first: tuple[float, float],
    second: tuple[float, float],
    third: tuple[float, float],
    step: float = 0.01,
    max_points: int = 1000,
    progress: bool = False,
) -> CodimensionTwoCurve:
    """Continue a point of codimension two in three parameters.

    The equations of the curve of bifurcations on which the point was found and the condition of the point are continued
    by pseudo-arclength: that the coefficient of the normal form vanishes (cusp, generalised flip, degenerate pitchfork,
    Chenciner), or that further multipliers are 1, -1 or a pair with a product or an angle (the others).  A double
    Neimark-Sacker point, where two curves of bifurcations intersect, is given by the moduli of both pairs.

    Parameters
    ----------
    curve : BifurcationCurve
        The curve on which the point was found.
    point : CodimensionTwo
        One of its `codimension_two()`.
    parameter : str
        Name of the third parameter.
    first, second, third : tuple of float
        Intervals of the parameters, in their units; the first two are those of the curve.
    step : float, optional
        Longest step, in units in which all intervals have length 1.
    max_points : int, optional
        Largest number of points on either side.
    progress : bool, optional
        Show progress on a terminal.

    Returns
    -------
    CodimensionTwoCurve
        The curve.  It ends beside the place where a complex pair that the kind has meets on the real axis, and that of
        degenerate pitchforks where the symmetry is broken: with a parameter that breaks it, at the point itself.
        Next to a 1:3 resonance the coefficient of a Chenciner point is infinite, so that a curve may end there without
        convergence.

    Raises
    ------
    ValueError
        For a point that is not one of the curve, an unknown parameter or an interval without its present value.

    References
    ----------
    Kuznetsov, *Elements of Applied Bifurcation Theory* (2004), section 10.3; Kuznetsov, Meijer, *Numerical Bifurcation
    Analysis of Maps* (2019), chapter 5.

    Examples
    --------
    The cusps of x + a + b x + c x^2 - x^3 have b = -c^2 / 3 and a = c^3 / 27.

    >>> from cellmap import continue_orbit, discrete_map, periodic_orbit
    >>> from cellmap.bifurcations import BifurcationKind, continue_bifurcation
    >>> params = {"a": -1.0, "b": 0.5, "c": 0.0}
    >>> cubic = discrete_map(lambda x, p: (x[0] + p.a + p.b * x[0] + p.c * x[0]**2 - x[0]**3,), params, ("x",))
    >>> branch = continue_orbit(cubic, periodic_orbit(cubic, [-1.2]), "a", -1.0, 1.0)
    >>> fold = branch.of_kind(BifurcationKind.FOLD)[0]
    >>> folds = continue_bifurcation(branch, fold, "b", (-1.0, 1.0), (-1.0, 1.0))
    >>> cusp = folds.codimension_two()[0]
    >>> cusps = continue_codimension_two(folds, cusp, "c", (-1.0, 1.0), (-1.0, 1.0), (-1.0, 1.0))
    >>> a, b, c = cusps.values.T
    >>> bool((abs(b + c**2 / 3) < 1e-10).all() and (abs(a - c**3 / 27) < 1e-10).all())
    True
    """
    check_on(curve, point)
    exact = curve.point_map.with_params(**dict(zip(curve.parameters, point.values.tolist(), strict=True)))
    names = (*curve.parameters, further_parameter(parameter, exact.params, curve.parameters))
    present = np.append(point.values, exact.params[parameter])
    given = (("first", first), ("second", second), ("third", third))
    box = np.array([interval_of(*one, value) for one, value in zip(given, present.tolist(), strict=True)])
    old = point._problem.orbits
    orbits = old.with_parameters(exact, names, tuple(np.ptp(box, axis=1).tolist()))
    unknowns = np.append((point._unknowns * old.scale)[: old.states], present) / orbits.scale
    bifurcation = SingularOrbits(orbits, point._problem.kind, unknowns)
    problem = CodimensionTwoOrbits(bifurcation, point.kind)
    slopes = problem(unknowns)[1]
    start = corrected(problem, unknowns, np.linalg.svd(slopes)[2][-1]) if np.isfinite(slopes).all() else None
    if start is None:
        raise ValueError(f"point={point!r}: it is not found again with three parameters free")
    longest, most = limits_of(step, max_points)

    def end(part: ContinuationStep, may_refuse: bool) -> End | Literal["refused"] | None:
        if not problem.tests.confirms(point.kind, part.end):
            return "refused" if may_refuse else End("multipliers met on the real axis")
        return None if bifurcation.is_symmetric(part.end) else End("symmetry broken")

    def side(begin: SolutionPoint) -> tuple[list[SolutionPoint], str]:
        label = f"curve of {point.kind}" if progress else None
        inside = Box.of(box, orbits.scale[orbits.states :])
        return trace(problem, begin, inside, longest, most, label, orbits.growing, orbits.circles, end)

    places, ends = both_ways(side, start)
    states = np.array([orbits.once(p.unknowns * orbits.scale) for p in places])
    return CodimensionTwoCurve(
        kind=point.kind,
        parameters=names,
        values=np.clip(states[:, orbits.dimension :], *box.T),
        points=wrap(states[:, : orbits.dimension], orbits.point_map.coordinates),
        multipliers=np.array([bifurcation.multipliers(p) for p in places]),
        ends=ends,
        _problem=problem,
        _places=tuple(places),
    )
