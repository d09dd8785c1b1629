"""Curves that leave points of codimension two, and curves of such points in three parameters."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .._lib.signatures import checked
from ..orbits.arclength import started
from .bifurcation_curve import BifurcationCurve, CurveTracer, ParameterCurve
from .codimension_two import CodimensionTwo, CodimensionTwoOrbits
from .intervals import further_parameter, interval_of, limits_of
from .kinds import BifurcationKind, CodimensionTwoKind
from .orbit_births import NewCurve, OrbitBirth, born_curves
from .singular_orbits import SingularOrbits

_BEFORE = {1: BifurcationKind.PITCHFORK, 2: BifurcationKind.PERIOD_DOUBLING, 4: BifurcationKind.NEIMARK_SACKER}
"""Bifurcations at which orbits of some times the period are born."""


@dataclass(frozen=True, eq=False, repr=False)
class CodimensionTwoCurve(ParameterCurve):
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
    >>> folds = continue_bifurcation(branch, fold, "b", (-1.0, 1.0), (-1.0, 1.0), step=0.1)
    >>> cusp = folds.codimension_two()[0]
    >>> cusps = continue_codimension_two(folds, cusp, "c", (-1.0, 1.0), (-1.0, 1.0), (-1.0, 1.0), step=0.1)
    >>> a, b, c = cusps.values.T
    >>> bool((abs(b + c**2 / 3) < 1e-10).all() and (abs(a - c**3 / 27) < 1e-10).all())
    True
    """
    _check_on(curve, point)
    exact = curve.point_map.with_params(**dict(zip(curve.parameters, point.values.tolist(), strict=True)))
    names = (*curve.parameters, further_parameter(parameter, exact.params, curve.parameters))
    present = np.append(point.values, exact.params[parameter])
    given = (("first", first), ("second", second), ("third", third))
    box = tuple(interval_of(*one, value) for one, value in zip(given, present.tolist(), strict=True))
    old = point._problem.orbits
    orbits = old.with_parameters(exact, names, tuple(high - low for low, high in box))
    unknowns = np.append((point._unknowns * old.scale)[: old.states], present) / orbits.scale
    bifurcation = SingularOrbits(orbits, point._problem.kind, unknowns)
    problem = CodimensionTwoOrbits(bifurcation, point.kind)
    start = started(problem, unknowns)
    if start is None:
        raise ValueError(f"point={point!r}: it is not found again with three parameters free")
    return CurveTracer(problem, names, box, *limits_of(step, max_points), progress).curve(start, CodimensionTwoCurve)


@checked
def switch_curve(
    curve: BifurcationCurve,
    point: CodimensionTwo,
    first: tuple[float, float],
    second: tuple[float, float],
    step: float = 0.01,
    max_points: int = 1000,
    progress: bool = False,
    new_curve: NewCurve | None = None,
) -> BifurcationCurve:
    """Continue another curve of bifurcations through a point of codimension two.

    From a 1:1 or 1:2 resonance that is the curve of Neimark-Sacker bifurcations if `curve` is one of folds or period
    doublings, and the other way round; in the same way from points with two critical multipliers, such as fold-flip.
    Other curves begin at the point, with orbits that are born there: folds of orbits of twice the period at a
    generalised flip, of asymmetric orbits at a degenerate pitchfork, and of four times the period at a 1:4 resonance;
    Neimark-Sacker bifurcations of orbits of twice the period at a 1:2 resonance, a fold-flip and a
    flip-Neimark-Sacker point, and of four times the period at a 1:4 resonance.

    Parameters
    ----------
    curve : BifurcationCurve
        The curve on which the point was found.
    point : CodimensionTwo
        One of its `codimension_two()`, with `new_curves`.
    first, second : tuple of float
        Intervals of both parameters, in their units.
    step, max_points, progress
        As for :func:`continue_bifurcation`.
    new_curve : NewCurve, optional
        One of the `new_curves` of the point, by default the first.

    Returns
    -------
    BifurcationCurve
        The other curve.  One that begins at the point ends beside it, with the name of the point as the reason.

    Raises
    ------
    ValueError
        For a point without another curve, or where it is not found.

    References
    ----------
    Kuznetsov, Meijer, *Numerical Bifurcation Analysis of Maps* (2019), chapter 3 for the curves at each point.

    Examples
    --------
    >>> from cellmap import continue_orbit, discrete_map, periodic_orbit
    >>> from cellmap.bifurcations import continue_bifurcation
    >>> henon = discrete_map(lambda x, p: (1 - p.a * x[0]**2 + x[1], p.b * x[0]), {"a": 0.2, "b": 0.3}, ("x", "y"))
    >>> branch = continue_orbit(henon, periodic_orbit(henon, [0.5, 0.2]), "a", 0.0, 1.4)
    >>> doublings = continue_bifurcation(branch, branch.bifurcations[0], "b", (0.0, 4.0), (-1.5, 0.9))
    >>> doublings.codimension_two()
    (CodimensionTwo(1:2 resonance at a=3, b=-1),)
    >>> switch_curve(doublings, doublings.codimension_two()[0], (-2.0, 4.0), (-1.5, 0.9))
    BifurcationCurve(Neimark-Sacker, ... points, a from -1 to 3, b from -1 to -1)
    """
    chosen = new_curve or next(iter(point.new_curves), None)
    if chosen is None or chosen not in point.new_curves:
        known = ", ".join(map(repr, point.new_curves)) or "no other curve of bifurcations of periodic orbits"
        raise ValueError(f"new_curve={new_curve!r}: {point!r} has {known}")
    _check_on(curve, point)
    names, old = curve.parameters, curve._problem.orbits
    if old.nodes > 1 and chosen.times > 1:
        raise ValueError(
            f"new_curve={chosen!r}: of orbits in segments, those with multipliers of more than 1e6, only curves with "
            "the same period are followed"
        )
    box = (interval_of("first", first, point.values[0]), interval_of("second", second, point.values[1]))
    spans = [high - low for low, high in box]
    orbits = replace(old, scale=np.append(old.scale[:-2], spans))
    origin = point._unknowns * old.scale / orbits.scale
    problem = SingularOrbits(replace(orbits, period=chosen.times * old.period), chosen.kind, origin)
    tracer = CurveTracer(problem, names, box, *limits_of(step, max_points), progress)
    if chosen in born_curves(point.kind, point.normal_form):
        before = SingularOrbits(orbits, _BEFORE[chosen.times], origin)
        birth = OrbitBirth.at(str(point.kind), before, origin, chosen.times)
        alike = sum((new.kind, new.times) == (chosen.kind, chosen.times) for new in point.new_curves)
        nearby = [] if birth is None else birth.bifurcations(problem, alike)
        start = nearby[chosen.number] if chosen.number < len(nearby) else None
        tracer = replace(tracer, birth=birth)
    else:
        start = started(problem, origin)
    if start is None:
        raise ValueError(f"point={point!r}: {chosen!r} is not found beside it")
    return tracer.curve(start, BifurcationCurve)


def _check_on(curve: BifurcationCurve, point: CodimensionTwo) -> None:
    """Refuse a point of codimension two that is not one of a curve."""
    own = (p for p in curve.codimension_two() if (p.kind, p.parameters) == (point.kind, point.parameters))
    if not any(np.array_equal(p.values, point.values) for p in own):
        raise ValueError(f"point={point!r} is not on {curve!r}: give one of its codimension_two()")
