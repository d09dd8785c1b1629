"""Branches of periodic orbits in one parameter, and the bifurcations on them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from .._lib.arrays import Complexes, Floats, Ints
from .._lib.checks import finite_number, whole_number
from .._lib.computed import computed_once
from .._lib.records import ConvertsToDataFrame, ConvertsToXarray
from .._lib.signatures import checked
from ..maps.point_map import PointMap
from ..orbits.multipliers import unstable_count
from ..orbits.orbit_equations import OrbitProblem
from ..orbits.orbit_kinds import PeriodicOrbit, with_values
from .function_zeros import BranchPiece, FunctionZero, zeros_on
from .kinds import BifurcationKind
from .normal_forms import NormalForm, form_at
from .period_measures import OrbitFunction, Quantity, measured, turn_of, unwrapped

_ROUNDING = 1e-10  # change of the parameter, scaled, along orbits at one value of it


@dataclass(frozen=True, eq=False)
class Bifurcation:
    """Bifurcation on a branch of periodic orbits.

    Parameters
    ----------
    kind : BifurcationKind
        Kind of the bifurcation.
    value : float
        The parameter, in its unit.
    point : ndarray, shape (dimension,)
        First point of the orbit, angles within their period.
    multipliers : ndarray of complex, shape (dimension,)
        Multipliers at the bifurcation.
    before, after : int
        Number of unstable multipliers on the branch on either side, in the order of the branch.
    place : int
        The bifurcation lies between the points `place` and ``place + 1`` of the branch.
    """

    _made_by: ClassVar = "continue_orbit, among the bifurcations of a Branch"
    kind: BifurcationKind
    value: float
    point: Floats
    multipliers: Complexes
    before: int
    after: int
    place: int
    _unknowns: Floats = field(repr=False)
    _along: Floats = field(repr=False)
    _problem: OrbitProblem = field(repr=False)
    _branch_direction: Floats | None = field(repr=False, default=None)

    @computed_once
    def normal_form(self) -> NormalForm | None:
        """Normal form with its coefficient, super- or subcritical; computed when it is first asked for.

        None where several multipliers cross together, and where deviations grow by more than 1e6 in a period.
        """
        return form_at(self._problem, self._unknowns, self.kind)

    @property
    def params(self) -> Mapping[str, float]:
        """All parameters at the point, in their units."""
        return self._problem.map_at(self._unknowns).params

    @property
    def orbit(self) -> PeriodicOrbit:
        """The orbit, with all parameters in its `params`."""
        return self._problem.orbit_at(self._unknowns)

    def __repr__(self) -> str:
        return f"Bifurcation({self.kind} at {self.value:.12g}, {self.before} -> {self.after} unstable)"


@dataclass(frozen=True, eq=False)
class BranchPart:
    """Unknowns (n, ...) of some points of a branch, in their units, from the point number `first` on."""

    first: int
    problem: OrbitProblem
    unknowns: Floats


@dataclass(frozen=True, eq=False)
class Branch(ConvertsToXarray, ConvertsToDataFrame):
    """Branch of periodic orbits in one parameter.

    Parameters
    ----------
    parameter : str
        Name of the parameter.
    period : int
        Period in steps of the map; along a branch it may be a multiple of the least period.
    values : ndarray, shape (n,)
        The parameter, in its unit.
    points : ndarray, shape (n, dimension)
        First points of the orbits, angles within their period.
    multipliers : ndarray of complex, shape (n, dimension)
        Multipliers, by decreasing modulus.
    bifurcations : tuple of Bifurcation
        Bifurcations in the order of the branch.
    ends : tuple of str
        Reasons why the branch ends at its first and at its last point: "left the interval", "closed", "most points",
        "bifurcation", from which it has been switched to, or "no convergence"; "grazing" where the orbit touches a
        surface of impacts, at the last point; "impact at the section" where it has an impact at that time, beyond which
        the same orbit goes on in a map of another phase; "rest begins or ends" where impacts that accumulate just come
        to rest, and beyond do not, or the reverse.  Limit cycles may shrink to an equilibrium, have a period that
        grows without bound, touch the section, or reach its longest time; this is told with the parameter value.  The
        name of a function where it was to be followed until that is zero.
    point_map : PointMap
        The map, with the parameters of the initial orbit.
    zeros : tuple of FunctionZero
        Zeros and extreme values of functions, in the order of the branch; see :meth:`with_zeros`.
    """

    parameter: str
    period: int
    values: Floats
    points: Floats
    multipliers: Complexes
    bifurcations: tuple[Bifurcation, ...]
    ends: tuple[str, str]
    point_map: PointMap
    _parts: tuple[BranchPart, ...] = field(repr=False)
    zeros: tuple[FunctionZero, ...] = ()

    def __repr__(self) -> str:
        found = "; ".join(f"{b.kind} at {b.value:.9g}" for b in self.bifurcations) or "no bifurcation"
        span = f"{self.values.min():.6g} to {self.values.max():.6g}"
        early = {end for end in self.ends if end not in ("left the interval", "bifurcation")}
        ends = f"; ends: {', '.join(sorted(early))}" if early else ""
        where = (
            f"a family at {self.parameter}={self.values[0]:.6g}" if self.is_family else f"{self.parameter} from {span}"
        )
        return f"Branch(period {self.period}, {len(self.values)} points, {where}: {found}{ends})"

    @property
    def is_family(self) -> bool:
        """Whether orbits fill a line at one value of the parameter, to rounding, as without damping.

        Along the family of a conservative system the energy changes, while a parameter that would add damping stays 0.
        """
        unit = self._parts[0].problem.scale[-1]
        return bool(len(self.values) > 1 and np.ptp(self.values) <= _ROUNDING * unit)

    @property
    def unstable(self) -> Ints:
        """Number of multipliers outside the unit circle, shape (n,)."""
        return unstable_count(self.multipliers)

    @checked
    def of_kind(self, kind: BifurcationKind) -> tuple[Bifurcation, ...]:
        """Return the bifurcations of the given kind."""
        return tuple(b for b in self.bifurcations if b.kind is kind)

    @checked
    def measure(self, quantity: Quantity = 0, measure: str | None = "maximum") -> Floats:
        """Return a measure of each orbit over its period.

        Parameters
        ----------
        quantity : int, str or callable, optional
            Number or name of a coordinate, one of the `outputs` of the system, or a function ``f(t, x, p)`` of time,
            state and parameters, written with the functions of :mod:`math`.
        measure : {"maximum", "minimum", "amplitude", "mean", "norm"} or None, optional
            What is computed; see :class:`PeriodMeasure`.  None for the quantity at the first point of the orbit.

        Returns
        -------
        ndarray, shape (n,)
            Values, in the unit of the quantity; NaN where it does not return after the period, as an angle that makes
            full rotations.  Means and extreme values of angles are continuous along the branch, and may leave the
            interval of the angle.  Extreme values are those of a trigonometric polynomial through samples that resolve
            the quantity.  Where 1024 samples in a step do not, because of jumps or kinks, extreme values are values of
            the quantity at times found to 1e-9 of a step beside the best sample, and means those of the samples, to
            1e-3 of its jumps; NaN where it oscillates between the samples.  For discrete maps all are those of the
            points of the orbit.  The error is that of the integration over a period, which grows with the largest
            multiplier; NaN too where it exceeds 1e-5 of the quantity.

        Raises
        ------
        TypeError, ValueError
            For a quantity that the system does not have.

        Examples
        --------
        >>> from math import cos, pi
        >>> from cellmap import ForcedSystem, periodic_orbit, stroboscopic_map
        >>> linear = ForcedSystem(
        ...     lambda t, x, p: (x[1], -4.0 * x[0] - p.damping * x[1] + cos(t)), {"damping": 0.5}, 2 * pi, ("x", "v")
        ... )
        >>> from cellmap import continue_orbit
        >>> exact = stroboscopic_map(linear)
        >>> branch = continue_orbit(exact, periodic_orbit(exact, [0.0, 0.0]), "damping", 0.1, 1.0)
        >>> amplitude = branch.measure("x", "amplitude")
        >>> bool((abs(amplitude * (9.0 + branch.values**2) ** 0.5 - 1.0) < 1e-8).all())
        True
        """
        values, points = self.values[:, None], self.points
        found = measured(self.point_map, (self.parameter,), values, points, self.period, quantity, measure)
        return found if measure is None else unwrapped(found, turn_of(self.point_map, quantity, measure))

    @checked
    def orbit(self, place: int) -> PeriodicOrbit:
        """Return the orbit at a point of the branch, by its number, with all parameters in its `params`."""
        place = whole_number("place", place, at_most=len(self.values) - 1)
        part = next(p for p in self._parts if place < p.first + len(p.unknowns))
        found = part.problem.orbit_at(part.unknowns[place - part.first] / part.problem.scale)
        return with_values(found, (self.parameter,), self.values[[place]])

    @checked
    def with_zeros(self, functions: Mapping[str, Quantity | OrbitFunction]) -> Branch:
        """Return the branch with the zeros and extreme values of functions of its orbits, which become its `zeros`.

        Zeros are located as bifurcations are, to rounding, where a function changes its sign between two points of the
        branch; two zeros between neighbouring points are missed, and those where it is not known.  An angle is zero
        where it is the `value` of the function up to full rotations.  They are drawn, and
        written to files for AUTO (UZ); :func:`continue_bifurcation` continues them in a second parameter.

        Parameters
        ----------
        functions : mapping of str to OrbitFunction
            Functions by their names.  A coordinate, one of the `outputs` or a function ``f(t, x, p)`` stands for
            itself at the first point of the orbit.

        Returns
        -------
        Branch
            The same branch, with its `zeros` replaced.

        Raises
        ------
        TypeError, ValueError
            For a quantity that the system does not have, or a function that is not known, or zero, at all points.

        Warns
        -----
        RuntimeWarning
            For a function that is zero along a stretch of the branch, of which no point is returned.

        References
        ----------
        Doedel, Oldeman et al., *AUTO-07P* (2012), on user-defined points (UZR).

        Examples
        --------
        >>> from math import cos, pi
        >>> from cellmap import ForcedSystem, continue_orbit, periodic_orbit, stroboscopic_map
        >>> linear = ForcedSystem(
        ...     lambda t, x, p: (x[1], -x[0] - 0.2 * x[1] + cos(p.w * t)),
        ...     {"w": 0.5}, lambda p: 2 * pi / p.w, ("x", "v"),
        ... )
        >>> exact = stroboscopic_map(linear)
        >>> branch = continue_orbit(exact, periodic_orbit(exact, [1.0, 0.0]), "w", 0.5, 1.5)
        >>> peak = OrbitFunction("x", "amplitude", extremum=True)
        >>> branch.with_zeros({"peak": peak, "unit": lambda t, x, p: p.w - 1}).zeros
        (FunctionZero(peak at w=0.9899494937), FunctionZero(unit at w=1))
        """
        pieces = [BranchPiece(p.problem, p.problem, p.unknowns / p.problem.scale, p.first) for p in self._parts]
        found = zeros_on(pieces, (self.parameter,), functions, self.ends == ("closed", "closed"))
        return replace(self, zeros=found)

    @property
    def special_points(self) -> tuple[Bifurcation | FunctionZero, ...]:
        """Bifurcations and zeros of functions in the order of the branch."""
        return tuple(sorted((*self.bifurcations, *self.zeros), key=self._along))

    def _along(self, point: Bifurcation | FunctionZero) -> tuple[int, float]:
        part = next(p for p in self._parts if point.place < p.first + len(p.unknowns) - 1)
        apart = point._unknowns - part.unknowns[point.place - part.first] / part.problem.scale
        return point.place, float(np.linalg.norm(apart))

    @checked
    def orbits_at(self, value: float) -> tuple[PeriodicOrbit, ...]:
        """Return the periodic orbits of the branch at a parameter value, in the order of the branch."""
        value = finite_number("value", value)
        sides = np.sign(self.values - value)
        found = []
        passed = (sides[:-1] != sides[1:]) & ((sides[1:] != 0) | (np.arange(1, len(sides)) == len(sides) - 1))
        for k in np.flatnonzero(passed):
            share = (value - self.values[k]) / (self.values[k + 1] - self.values[k])
            part = next(p for p in self._parts if k < p.first + len(p.unknowns) - 1)
            begin, end = part.unknowns[k - part.first : k - part.first + 2]
            orbit = part.problem.orbit_between(begin, end, float(share), value)
            if orbit is not None:
                found.append(orbit)
        return tuple(found)
