"""Stroboscopic maps: states of a forced system one period apart, integrated in SIMD lanes."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .checks import finite_number, one_of, whole_number
from .codegen.kernel import (
    PeriodKernel,
    flow_kernel,
    switching_kernel,
    tangent_flow_kernel,
    traces_faithfully,
)
from .codegen.methods import METHOD_NAMES
from .coordinates import turns_of
from .jacobian import NotDifferentiableError, tangent_by_lanes
from .kernels.blocks import pack, unpack, wrap_rows
from .kernels.ladder import DIVERGED, MISSED, next_rungs, sort_by_rung
from .kernels.options import LANES
from .pointmap import Orbits, PointMap, Status
from .system import ForcedSystem

SMALLEST_TOLERANCE = 1e-14
LARGEST_TOLERANCE = 0.1
MOST_STEPS = 2**31
_FORCING_SAMPLES = 2048  # looks at the forcing of a period; a pulse between two of them may be missed
_PROBE = 16  # steps a period of the first trial step
_RUNGS_PER_OCTAVE = 4
_SAFETY = 2.0  # error expected of the steps that are chosen, under the tolerance by this factor


def stroboscopic_map(
    system: ForcedSystem,
    phase: float = 0.0,
    rtol: float = 1e-9,
    atol: float = 1e-9,
    method: str = "auto",
    max_steps: int = 16384,
) -> PointMap:
    """Return the map from a state to the state one period later.

    Every image meets ``error <= atol + rtol * abs(image)`` in each component by the estimate of the integrator, summed
    over the period with a margin for what the flow stretches (for an angle, ``abs(image)`` counts at most half a turn).
    Each start takes the number of steps that its own error asks for, so its image does not depend on its neighbours.
    A start that misses the tolerance with `max_steps` keeps its best value and the status INACCURATE.

    Parameters
    ----------
    system : ForcedSystem
        The system.
    phase : float, optional
        Where in the forcing period the section lies, in turns: the section is at ``t = phase * period``.
    rtol, atol : float, optional
        Relative and absolute tolerance of one period, at least 1e-14.
    method : {"auto", "DOP853", "RK45", "Taylor"}, optional
        Dormand and Prince's methods of order 8 and 5, or a Taylor series whose order follows from the tolerance;
        "auto" takes the cheaper of Taylor and DOP853.
    max_steps : int, optional
        Most steps a period.

    Returns
    -------
    PointMap
        The exact map, vectorised over starts and run on all threads.

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
    if not isinstance(system, ForcedSystem):
        raise TypeError(f"system={system!r}: give a ForcedSystem")
    phase = finite_number("phase", phase)
    rtol = finite_number("rtol", rtol, at_least=SMALLEST_TOLERANCE, at_most=LARGEST_TOLERANCE)
    atol = finite_number("atol", atol, at_least=SMALLEST_TOLERANCE)
    one_of("method", method, METHOD_NAMES)
    max_steps = whole_number("max_steps", max_steps, at_least=4, at_most=MOST_STEPS)
    symbolic = system.switches is not None or traces_faithfully(system.rhs, system.dimension, system.params)
    kernel = _kernel(system, method, rtol, symbolic)
    lower, turn = turns_of(system.axes)
    largest = np.where(turn > 0, 0.5 * turn, np.inf)
    fewest = _fewest_steps(system, max(rtol, atol))
    integrator = _Integrator(kernel, system, phase, rtol, atol, max_steps, largest, fewest)

    def advance(orbits: Orbits, periods: int) -> None:
        for _ in range(periods):
            for now in orbits.living():
                integrator.one_period(now)
                wrap_rows(now.points, now.turns, lower, turn)

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
            "method": kernel.method,
            "max_steps": max_steps,
            "period": system.length,
        },
        period=system.length,
        tolerance=(rtol, atol),
        tangent=functools.partial(_tangent, system, phase, min(rtol, 1e-12), max_steps, fewest, symbolic),
    )


def _kernel(system: ForcedSystem, method: str, rtol: float, symbolic: bool) -> PeriodKernel:
    names = tuple(system.params)
    if system.switches is None:
        return flow_kernel(system.rhs, system.dimension, names, method, rtol, symbolic)
    if method not in {"auto", "Taylor"}:
        raise ValueError(f"method={method!r}: a right-hand side that jumps is integrated by method='Taylor'")
    kernel = switching_kernel((system.rhs, system.switches), system.dimension, names, rtol, False)
    if kernel is None:
        raise TypeError(
            f"rhs of {system.name} has switches and must therefore be plain arithmetic and analytic functions of math "
            "for fixed signs, without branches on the state: write branches with the signs s"
        )
    return kernel


def _tangent(
    system: ForcedSystem,
    phase: float,
    tolerance: float,
    max_steps: int,
    fewest: int,
    symbolic: bool,
    points: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Images and derivatives from the variational equation, one lane for each direction."""
    d = system.dimension
    names, kernel = tuple(system.params), None
    if system.switches is not None:
        kernel = switching_kernel((system.rhs, system.switches), d, names, tolerance, True)
    elif symbolic:
        kernel = tangent_flow_kernel(system.rhs, d, names, tolerance)
    if kernel is None:
        raise NotDifferentiableError(f"no derivatives of the right-hand side of {system.name} are known")
    integrator = _Integrator(kernel, system, phase, tolerance, tolerance, max_steps, np.full(2 * d, np.inf), fewest)
    return tangent_by_lanes(integrator.one_period, points, d)


def _fewest_steps(system: ForcedSystem, tolerance: float) -> int:
    """Return the steps a period without which the integrator might step over a part of the forcing and not see it.

    That is half the number of the highest harmonic that the right-hand side has at one of two states, counting those
    that move the image by more than the tolerance and have a ten-millionth of the strength of the strongest.
    """
    times = np.arange(_FORCING_SAMPLES) * (system.length / _FORCING_SAMPLES)
    fewest = 1
    for size in (0.1, 1.1):
        state = tuple(size + 0.1 * j for j in range(system.dimension))
        try:
            with np.errstate(all="ignore"):
                samples = np.array([system.derivative(t, state) for t in times.tolist()])
        except (ValueError, ZeroDivisionError, OverflowError):
            continue  # outside the domain of the right-hand side
        if np.isfinite(samples).all():
            strength = np.abs(np.fft.rfft(samples, axis=0))[1:] / _FORCING_SAMPLES
            floor = np.maximum(1e-12 * np.abs(samples).max(axis=0), tolerance / system.length)
            present = (strength > 1e-7 * strength.max(axis=0)) & (strength > floor)
            fewest = max(fewest, int((np.flatnonzero(present.any(axis=1)).max(initial=0) + 2) // 2))
    return fewest


@dataclass(frozen=True, eq=False)
class _Integrator:
    """A compiled period with its tolerance."""

    kernel: PeriodKernel
    system: ForcedSystem
    phase: float
    rtol: float
    atol: float
    max_steps: int
    largest: NDArray[np.float64]
    fewest_steps: int

    @functools.cached_property
    def _parameters(self) -> NDArray[np.float64]:
        return np.array([float(v) for v in self.system.params.values()])

    @functools.cached_property
    def _ladder(self) -> NDArray[np.int64]:
        """Numbers of steps to choose from, four to an octave."""
        rungs = np.unique([round(4 * 2 ** (k / _RUNGS_PER_OCTAVE)) for k in range(30 * _RUNGS_PER_OCTAVE)])
        return np.unique(np.minimum(rungs, self.max_steps))

    def one_period(self, orbits: Orbits) -> None:
        """Move orbits on by one period in place, angles unwrapped, each with the steps it needs."""
        starts, images = orbits.points.copy(), orbits.points
        ladder, n = self._ladder, len(starts)
        before = np.full((n, 2), -1.0)
        lowest = min(int(np.searchsorted(ladder, self.fewest_steps)), len(ladder) - 1)
        ratios = np.empty(n)
        members, taken = np.arange(n), np.full(n, np.searchsorted(ladder, _PROBE))
        # One step of a sixteenth of the period tells how many steps the whole of it will take.
        self._integrate(starts, members, 1, self.system.length / _PROBE, images, ratios)
        ratios *= _PROBE
        first = True
        while len(members):
            rungs = np.empty(len(members), np.int64)
            leap = 3 * _RUNGS_PER_OCTAVE
            order = self.kernel.estimate_order
            next_rungs(members, taken, ratios, before, order, first, lowest, ladder, _SAFETY, leap, rungs)
            if not first:
                missed = members[rungs == MISSED]
                orbits.status[missed] = Status.INACCURATE
                # An image without one right digit is none.
                tolerance = max(self.rtol, self.atol) / self.kernel.margin(max(self.rtol, self.atol))
                orbits.end(missed[ratios[missed] * tolerance > 1.0], Status.DIVERGED)
                orbits.end(members[rungs == DIVERGED], Status.DIVERGED)
            again = int(np.count_nonzero(rungs >= 0))
            ordered, taken, ends = np.empty(again, np.int64), np.empty(again, np.int64), np.empty(len(ladder), np.int64)
            sort_by_rung(members, rungs, len(ladder), ordered, taken, ends)
            members, first = ordered, False
            begin = 0
            for steps, end in zip(ladder.tolist(), ends.tolist(), strict=True):
                if end > begin:
                    self._integrate(starts, members[begin:end], steps, self.system.length, images, ratios)
                    begin = end

    def _integrate(
        self,
        starts: NDArray[np.float64],
        members: NDArray[np.int64],
        steps: int,
        length: float,
        images: NDArray[np.float64],
        ratios: NDArray[np.float64],
    ) -> None:
        """Integrate some starts over a time with a number of steps, in full blocks of lanes."""
        blocks = np.empty((-(-len(members) // LANES), starts.shape[1], LANES))
        errors = np.empty_like(blocks)
        pack(starts, members, blocks)
        begin = self.phase * self.system.length
        self.kernel.advance(blocks, np.full(len(blocks), steps), begin, length, self._parameters, errors)
        margin = self.kernel.margin(max(self.rtol, self.atol))
        unpack(blocks, errors, members, images, ratios, self.largest, self.rtol / margin, self.atol / margin)
