"""Stroboscopic maps: states of a forced system one period apart, integrated in SIMD lanes."""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from .._compiled.codegen.methods import METHOD_NAMES
from .._lib.checks import finite_number, one_of, whole_number
from .._lib.signatures import checked
from .coordinates import turns_of
from .integration import Flow, flow, tangent_flow
from .orbit_batch import Orbits
from .parameters_as_states import swept_system
from .point_map import Family, Origin, PointMap
from .system import ForcedSystem
from .tangent import NotDifferentiableError, tangent_by_lanes

SMALLEST_TOLERANCE = 1e-14
LARGEST_TOLERANCE = 0.1
MOST_STEPS = 2**31
_TANGENT_TOLERANCE = 1e-12  # or that of the map, if it is finer


@checked
def stroboscopic_map(
    system: ForcedSystem,
    phase: float = 0.0,
    rtol: float = 1e-9,
    atol: float = 1e-9,
    method: str = "auto",
    max_steps: int = 16384,
) -> PointMap:
    """Return the stroboscopic (Poincaré) map of a forced system, from a state to the state one period later.

    Every image satisfies ``error <= atol + rtol * abs(image)`` in each component by the integrator's estimate, summed
    over the period with a margin for the growth of errors along the flow (for an angle, ``abs(image)`` counts as half a
    period at most).  The number of steps of each initial condition follows from its own error, so that its image does
    not depend on the others.  An initial condition that misses the tolerance with `max_steps` keeps its best value and
    gets the status INACCURATE.

    Parameters
    ----------
    system : ForcedSystem
        The system.
    phase : float, optional
        Phase of the forcing at the section, as a fraction of the period: the section is at ``t = phase * period``.
    rtol, atol : float, optional
        Relative and absolute tolerance of one period, at least 1e-14.
    method : {"auto", "DOP853", "RK45", "Taylor"}, optional
        Dormand and Prince's methods of order 8 and 5, or a Taylor series whose order follows from the tolerance; "auto"
        chooses the cheaper of Taylor and DOP853.
    max_steps : int, optional
        Largest number of steps in a period.

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
    Experimental Mathematics 14 (2005) 99.

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
    >>> strobe.iterate([3.0, 4.0], 1).turns
    array([4, 0])
    """
    phase = finite_number("phase", phase)
    rtol = finite_number("rtol", rtol, at_least=SMALLEST_TOLERANCE, at_most=LARGEST_TOLERANCE)
    atol = finite_number("atol", atol, at_least=SMALLEST_TOLERANCE)
    one_of("method", method, METHOD_NAMES)
    max_steps = whole_number("max_steps", max_steps, at_least=4, at_most=MOST_STEPS)
    begin, length = phase * system.length, system.length
    motion = flow(system, begin, length, rtol, atol, method, max_steps)
    lower, turn = turns_of(system.axes)

    def advance(orbits: Orbits, periods: int) -> None:
        motion.advance(orbits, periods, lower, turn)

    @functools.cache
    def with_tangent() -> Flow | None:
        return tangent_flow(system, begin, length, min(rtol, _TANGENT_TOLERANCE), max_steps)

    def tangent(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        carried = with_tangent()
        if carried is None:
            raise NotDifferentiableError(f"no derivatives of the right-hand side of {system.name} are known")
        return tangent_by_lanes(carried, points, system.dimension)

    def again(other: ForcedSystem) -> PointMap:
        return stroboscopic_map(other, phase, rtol, atol, method, max_steps)

    def swept(names: tuple[str, ...]) -> PointMap | None:
        further = swept_system(system, names)
        return None if further is None else again(further)

    return PointMap(
        name=system.name,
        coordinates=system.axes,
        params=system.params,
        advance=advance,
        recipe={
            "kind": "stroboscopic",
            "phase": phase,
            "rtol": rtol,
            "atol": atol,
            "method": motion.kernel.method,
            "max_steps": max_steps,
            "period": system.length,
        },
        period=system.length,
        tolerance=(rtol, atol),
        tangent=tangent,
        family=Family(at=lambda params: again(system.with_params(**params)), swept=swept),
        origin=Origin(stroboscopic_map, (system, phase, rtol, atol, method, max_steps), advance),
    )
