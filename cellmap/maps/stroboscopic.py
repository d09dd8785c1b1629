"""Stroboscopic maps: states of a forced system one period apart, integrated in SIMD lanes."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from .._compiled.codegen.kernel import period_enclosure
from .._compiled.codegen.methods import METHOD_NAMES, MIXED
from .._lib.arrays import Floats
from .._lib.checks import finite_number, is_sequence, one_of, real_array, shown, whole_number
from .._lib.computed import computed_once
from .._lib.signatures import checked
from .compiled_advance import FlowAdvance
from .coordinates import Coordinate, turns_of
from .formulas import Formulas, formulas
from .frames import stretched_by_flow
from .integration import Flow, flow, jet_flow, tangent_flow
from .orbit_batch import Orbits
from .parameters_as_states import with_states
from .point_map import PointMap
from .specification import MapSpec, no_source
from .system import ForcedSystem
from .tangent import NotDifferentiableError, derivatives_of, tangent_by_lanes

if TYPE_CHECKING:
    from .._compiled.codegen.enclosures import CompiledEnclosure

SMALLEST_TOLERANCE = 1e-14
LARGEST_TOLERANCE = 0.1
MOST_STEPS = 2**31
MAX_STEPS = 16384
_ATOL = 1e-9
_TANGENT_TOLERANCE = 1e-12  # or that of the map, if it is finer
_COARSEST = 1e-8  # tolerance of orbits with derivatives: exponents are told from zero by less than 1e-6
_OF_TANGENTS = 10.0  # tolerances, error of a tangent vector relative to its length: estimates are ten times the errors


@checked
def stroboscopic_map(
    system: ForcedSystem,
    phase: float = 0.0,
    rtol: float = 1e-9,
    atol: ArrayLike | Mapping[str, float] = 1e-9,
    method: str = "auto",
    max_steps: int = MAX_STEPS,
) -> PointMap:
    """Return the stroboscopic (Poincaré) map of a forced system, from a state to the state one period later.

    Every image satisfies ``error <= atol + rtol * abs(image)`` in each component by the integrator's estimate,
    summed over the period with a margin for the growth of errors along the flow (for an angle, ``abs(image)``
    counts as half a period at most).  The margin covers flows that expand distances up to some 250-fold within a
    period, by row sums of :func:`~cellmap.maps.jacobian`.  Where a sample of orbits comes near the tolerance, every
    image is computed with more and more steps until two agree to half the tolerance; elsewhere one image in 1,024
    is.  Steps that could pass over a layer of ``tanh``, ``exp``, ``cosh``, ``sinh`` or ``erf`` are shortened.

    The number of steps of each initial condition follows from its own error, so that its image does not depend on the
    others.  An initial condition that misses the tolerance with `max_steps` keeps its best value and gets the status
    INACCURATE.

    Parameters
    ----------
    system : ForcedSystem
        The system.
    phase : float, optional
        Phase of the forcing at the section, as a fraction of the period: the section is at ``t = phase * period``.
    rtol : float, optional
        Relative tolerance of one period, at least 1e-14.
    atol : float, array_like, shape (dimension,), or mapping of str to float, optional
        Absolute tolerance of one period, at least 1e-14; or one for each coordinate, in their order or by name, above
        0, and 1e-9 for those that are not named.  Values of a coordinate below its `atol` have no correct digit.
    method : {"auto", "DOP853", "RK45", "Taylor", "Rosenbrock", "mixed"}, optional
        Dormand and Prince's methods of order 8 and 5, a Taylor series whose order follows from the tolerance, or the
        L-stable Rosenbrock method Rodas5P for stiff systems, with steps of its own for each initial condition; "mixed"
        is the cheaper of Taylor and DOP853, and Rosenbrock for orbits that are stiff in a period.  "auto"
        chooses the cheaper of Taylor and DOP853, or "mixed" or Rosenbrock where a few initial conditions are less work
        with these.
    max_steps : int, optional
        Largest number of steps in a period; of Rosenbrock's sixteen times as many.

    Returns
    -------
    PointMap
        The exact map, vectorised over initial conditions and run on all threads.

    Raises
    ------
    TypeError, ValueError
        For arguments out of range, or a right-hand side that cannot be compiled.

    References
    ----------
    Hairer, Norsett, Wanner, *Solving Ordinary Differential Equations I* (1993), II.5 and II.10; Jorba, Zou,
    Experimental Mathematics 14 (2005) 99; Steinebach, BIT Numerical Mathematics 63 (2023) 27.

    Examples
    --------
    >>> from math import cos, pi, sin
    >>> from cellmap import angle
    >>> def rhs(t, x, p):
    ...     theta, v = x
    ...     return v, -p.gamma * v - sin(theta)
    >>> pendulum = ForcedSystem(rhs, {"gamma": 0.1}, 2 * pi, (angle("theta"), "v"))
    >>> strobe = stroboscopic_map(pendulum)
    >>> strobe([[0.0, 0.0], [3.0, 4.0]]).shape
    (2, 2)
    >>> strobe.iterate([3.0, 4.0], 1).rotations
    array([4, 0])
    """
    return Stroboscopic(system, phase, rtol, atol, method, max_steps).build()


@dataclass(frozen=True, eq=False)
class Stroboscopic(MapSpec[PointMap]):
    """Specification of a stroboscopic map; see :func:`stroboscopic_map`."""

    kind = "stroboscopic"
    system: ForcedSystem
    phase: float
    rtol: float
    atol: Any
    """A number, or a tuple of one for each coordinate."""
    method: str
    max_steps: int

    def __post_init__(self) -> None:
        set_field = functools.partial(object.__setattr__, self)
        set_field("phase", finite_number("phase", self.phase))
        check_tolerances(self)
        one_of("method", self.method, METHOD_NAMES)

    @computed_once
    def formulas(self) -> Formulas:
        """Formulas of the right-hand side, or the reason why there are none."""
        return formulas(self.system)

    @computed_once
    def motion(self) -> Flow:
        """The compiled flow over one period; it knows the method that "auto" has chosen."""
        s = self.system
        return flow(self.formulas, self.phase * s.length, s.length, self.rtol, self.atol, self.method, self.max_steps)

    @property
    def _stiff(self) -> bool:
        """Whether orbits that need the method for stiff systems have it."""
        return self.motion.method in {MIXED, "Rosenbrock"}

    @property
    def _of_derivatives(self) -> str:
        """The method of the motion with derivatives."""
        return self.motion.method if self._stiff else "auto"

    @property
    def is_explicit(self) -> bool:
        """Whether the method for stiff systems is another one, which the system allows."""
        return self.system.functions[1:] == (None, None) and not self._stiff

    def _tangents(self, count: int = 1) -> Flow | None:
        """The motion with tangent vectors, to a tolerance of 1e-12 or better, over the first of some equal parts."""
        s, tolerance = self.system, min(self.rtol, _TANGENT_TOLERANCE)
        begin, length = self.phase * s.length, s.length / count
        atol = np.minimum(self.atol, tolerance)
        return tangent_flow(
            self.formulas, begin, length, tolerance, atol, tolerance, self.max_steps, self._of_derivatives
        )

    @computed_once
    def _tangent_motion(self) -> Flow | None:
        return self._tangents()

    @computed_once
    def _coarse_motion(self) -> Flow | None:
        """The motion with tangent vectors to the tolerance of the map, or the finer one where that is not trusted."""
        s, rtol = self.system, min(self.rtol, _COARSEST)
        if rtol <= _TANGENT_TOLERANCE or self.motion.checked == 1.0 or self._stiff or self.formulas.has_events:
            return self._tangent_motion
        begin, atol = self.phase * s.length, np.minimum(self.atol, _COARSEST)
        return tangent_flow(self.formulas, begin, s.length, rtol, atol, _OF_TANGENTS * rtol, self.max_steps)

    def make(self) -> PointMap:
        """Return the map, without its specification."""
        return self.over(self.system.length)

    def over(self, time: float) -> PointMap:
        """Return the map over a time, which may be another one than the period where nothing depends on time."""
        system, dimension = self.system, self.system.dimension
        motion = self.motion if time == self.motion.length else replace(self.motion, length=time)
        lower, turn = turns_of(system.axes)

        @functools.cache
        def carried_along(coarse: bool) -> Flow:
            found = derivatives_of(system.name, self._coarse_motion if coarse else self._tangent_motion)
            return found if found.length == time else replace(found, length=time)

        def tangent(points: Floats) -> tuple[Floats, Floats]:
            found = carried_along(coarse=False)
            return tangent_by_lanes(found, points, dimension, together=found.vectors)

        def coarse_tangent(points: Floats) -> tuple[Floats, Floats]:
            found = carried_along(coarse=True)
            return tangent_by_lanes(found, points, dimension, together=found.vectors)

        def stretch(orbits: Orbits, frames: Floats, periods: int) -> Floats:
            found = carried_along(coarse=True)
            if found.vectors != dimension:
                raise NotDifferentiableError(f"{system.name} has too many states for its frames to be in one lane")
            return stretched_by_flow(found, orbits, frames, lower, turn, periods)

        return PointMap(
            name=system.name,
            coordinates=system.axes,
            params=system.params,
            advance=FlowAdvance(motion, lower, turn),
            period=time,
            tolerance=(self.rtol, float(np.max(self.atol))),
            tangent=tangent,
            coarse_tangent=coarse_tangent,
            stretch=stretch,
            is_flow=True,
            unknown_formulas=motion.unknown_formulas,
            ends=tuple(self.system.ends),
        )

    def with_phase(self, phase: float) -> Stroboscopic:
        """Return the specification with another phase of the forcing."""
        return self if phase == self.phase else replace(self, phase=phase)

    def swept(self, names: tuple[str, ...]) -> Stroboscopic | None:
        """Return the specification with some parameters appended to the state, where the formulas are known.

        The method is that of the map: which one is less work shows at its parameters, and not at any.
        """
        further, atol, method = with_states(self.formulas.unchanged(), names), self.atol, self.motion.method
        return (
            None
            if further is None
            else replace(self, system=further, atol=with_further(atol, len(names)), method=method)
        )

    def curve_step(
        self, order: int, finer: bool = False, part: tuple[int, int] = (0, 1)
    ) -> Callable[[Orbits], None] | None:
        """Return a step of orbits of (x, x', x'', ...), derivatives along a curve up to an order; None if unknown."""
        s, method = self.system, self._of_derivatives
        tolerance, length = min(self.rtol, _TANGENT_TOLERANCE), s.length / part[1]
        begin = self.phase * s.length + part[0] * length
        return jet_flow(self.formulas, begin, length, tolerance, self.max_steps, order, method, finer)

    def parts(self, count: int) -> tuple[Callable[..., tuple[Any, Any]], ...] | None:
        """Return the tangent maps of equal parts of a period, one after the other; None without known derivatives."""
        first, s = self._tangent_motion if count == 1 else self._tangents(count), self.system
        if first is None:
            return None
        flows = [replace(first, begin=self.phase * s.length + k * first.length) for k in range(count)]
        return tuple(functools.partial(tangent_by_lanes, f, dimension=s.dimension, together=f.vectors) for f in flows)

    def enclosure(self, order: int, second: bool) -> CompiledEnclosure:
        """Return the compiled enclosure of periods of boxes, with series of an order and second derivatives or not."""
        s = self.formulas.unchanged()
        return period_enclosure(s.rhs, s.dimension, tuple(s.params), order, second)

    @property
    def recipe(self) -> dict[str, Any]:
        """Plain values for a file."""
        return {**super().recipe, "method": self.motion.method, "period": self.system.length}

    @classmethod
    def from_recipe(cls, source: Any, recipe: Mapping[str, Any]) -> Stroboscopic:
        """Return the specification of a recipe."""
        if not isinstance(source, ForcedSystem):
            raise no_source(source, recipe)
        if source.length != recipe["period"]:
            raise ValueError(
                f"source has the period {source.length!r}, not {recipe['period']!r}: give the same parameters, "
                "or for a map of flow_map the system with that period"
            )
        return cls(source, **{name: recipe[name] for name in ("phase", "rtol", "atol", "method", "max_steps")})


def method_of(point_map: PointMap) -> str:
    """Return the name of the integration method of a stroboscopic map, the chosen one for "auto"; "" for others."""
    return point_map.spec.motion.method if isinstance(point_map.spec, Stroboscopic) else ""


def carried(point_map: PointMap, points: Floats, phase: float) -> Floats:
    """Return where the flow takes points (n, dimension) from the phase of a map until the next time of another one."""
    spec = point_map.without_table.spec
    if not isinstance(spec, Stroboscopic):
        raise ValueError(f"phase={phase!r}: {point_map!r} has none; give a stroboscopic map")
    system, ahead = spec.system, (phase - spec.phase) % 1.0
    orbits = Orbits.starting(points.copy())
    if ahead > 0.0:
        begin, time, method = spec.phase * system.length, ahead * system.length, spec.motion.method
        motion = flow(spec.formulas, begin, time, spec.rtol, spec.atol, method, spec.max_steps)
        FlowAdvance(motion, *turns_of(system.axes))(orbits, 1)
    return orbits.points


def absolute_tolerances(atol: Any, axes: Sequence[Coordinate]) -> Any:
    """Return an absolute tolerance as it is, or those of all coordinates as a tuple."""
    if isinstance(atol, Mapping):
        names = [axis.name for axis in axes]
        if unknown := sorted(set(atol) - set(names), key=str):
            raise ValueError(f"atol={shown(atol)}: there is no {unknown[0]!r}; coordinates are {', '.join(names)}")
        atol = [atol.get(name, _ATOL) for name in names]
    elif not is_sequence(atol):
        return atol
    values = real_array("atol", atol, "a number, or one for each coordinate")
    if values.shape != (len(axes),):
        raise ValueError(f"atol={shown(atol)}: give one number, or one for each of {len(axes)} coordinates")
    return tuple(finite_number("atol", value, above=0.0) for value in values.tolist())


def with_further(atol: Any, count: int) -> Any:
    """Return an absolute tolerance of a system with some states more."""
    return (*atol, *count * (max(atol),)) if isinstance(atol, tuple) else atol


def check_tolerances(spec: Any) -> None:
    """Check the tolerances and the number of steps of a new specification."""
    set_field = functools.partial(object.__setattr__, spec)
    set_field("atol", absolute_tolerances(spec.atol, spec.system.axes))
    set_field("rtol", finite_number("rtol", spec.rtol, at_least=SMALLEST_TOLERANCE, at_most=LARGEST_TOLERANCE))
    if not isinstance(spec.atol, tuple):
        set_field("atol", finite_number("atol", spec.atol, at_least=SMALLEST_TOLERANCE))
    if hasattr(spec, "max_steps"):
        set_field("max_steps", whole_number("max_steps", spec.max_steps, at_least=4, at_most=MOST_STEPS))
