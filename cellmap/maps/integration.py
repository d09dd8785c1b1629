"""Flow of a system over an interval of time, integrated in SIMD lanes."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._compiled.codegen.kernel import (
    PeriodKernel,
    flow_kernel,
    switching_kernel,
    tangent_flow_kernel,
    traced_function,
    traced_switching,
    why_untraced,
)
from .._compiled.codegen.linear import values
from .._compiled.kernels.periods import PROBE, Motion, integrate
from .coordinates import turns_of
from .orbit_batch import Orbits, legs
from .system import ForcedSystem

_FORCING_SAMPLES = 2048  # looks at the forcing of a period; a pulse between two of them may be missed
_RUNGS_PER_OCTAVE = 4
_OF_EVENTS = frozenset({"auto", "Taylor"})  # methods that locate events
_SAFETY = 2.0  # error expected of the steps that are chosen, under the tolerance by this factor


def flow(
    system: ForcedSystem, begin: float, length: float, rtol: float, atol: float, method: str, max_steps: int
) -> Flow:
    """Return the motion of a system from the time `begin` over a time `length`.

    The tolerance is meant for the whole of that time, as :func:`stroboscopic_map` describes it.
    """
    turn = turns_of(system.axes)[1]
    return Flow(
        kernel=_kernel(system, method, rtol),
        parameters=_values(system),
        begin=begin,
        length=length,
        rtol=rtol,
        atol=atol,
        max_steps=max_steps,
        largest=np.where(turn > 0, 0.5 * turn, np.inf),
        fewest_steps=_fewest_steps(system, length, max(rtol, atol)),
    )


def tangent_flow(system: ForcedSystem, begin: float, length: float, tolerance: float, max_steps: int) -> Flow | None:
    """Return the motion of states with one tangent vector each, 2 d components; None without known derivatives."""
    names, kernel = tuple(system.params), None
    if has_events(system):
        kernel = switching_kernel((system.rhs, system.switches), system.dimension, names, tolerance, True)
    elif not unknown_formulas(system):
        kernel = tangent_flow_kernel(system.rhs, system.dimension, names, tolerance)
    if kernel is None:
        return None
    largest = np.full(2 * system.dimension, np.inf)
    fewest = _fewest_steps(system, length, tolerance)
    return Flow(kernel, _values(system), begin, length, tolerance, tolerance, max_steps, largest, fewest)


def _kernel(system: ForcedSystem, method: str, rtol: float) -> PeriodKernel:
    names = tuple(system.params)
    if system.switches is None and not (has_events(system) and method in _OF_EVENTS):
        return flow_kernel(system.rhs, system.dimension, names, method, rtol, not unknown_formulas(system))
    if method not in _OF_EVENTS:
        raise ValueError(f"method={method!r}: a discontinuous right-hand side needs method='Taylor'")
    kernel = switching_kernel((system.rhs, system.switches), system.dimension, names, rtol, False)
    if kernel is None:
        reason = unknown_formulas(system)
        raise TypeError(
            f"rhs of {system.name} has switches and must therefore be plain arithmetic, branches, and analytic "
            "functions of math" + (reason and f" ({reason})")
        )
    return kernel


def unknown_formulas(system: ForcedSystem) -> str:
    """Return the reason why the formulas of a right-hand side are not known; empty if they are."""
    if system.switches is None:
        return why_untraced(system.rhs, system.dimension, system.params)
    traced = traced_switching((system.rhs, system.switches), system.dimension, tuple(system.params))
    return traced if isinstance(traced, str) else ""


def has_events(system: ForcedSystem) -> bool:
    """Whether a right-hand side has switches, or branches that can be located."""
    if system.switches is not None:
        return True
    if unknown_formulas(system):
        return False
    traced = traced_switching((system.rhs, None), system.dimension, tuple(system.params))
    return not isinstance(traced, str) and traced.is_analytic


def _values(system: ForcedSystem) -> NDArray[np.float64]:
    return np.array([float(v) for v in system.params.values()])


def _fewest_steps(system: ForcedSystem, length: float, tolerance: float) -> int:
    """Return the steps without which the integrator might step over a part of the forcing and not see it.

    They follow from the harmonics of the right-hand side at two states that move the image by more than the tolerance.
    """
    fewest = max((steps_of_harmonics(s, tolerance / system.length) for s in _forcing(system)), default=1)
    return max(1, int(np.ceil(fewest * length / system.length)))


@functools.lru_cache(maxsize=16)
def _forcing(system: ForcedSystem) -> list[NDArray[np.float64]]:
    """Return the right-hand side over a period at two states, shape (times, dimension) each, where it is finite."""
    times = np.linspace(0.0, system.length, _FORCING_SAMPLES, endpoint=False)
    found = []
    for size in (0.1, 1.1):
        state = tuple(size + 0.1 * j for j in range(system.dimension))
        try:
            samples = _derivatives(system, times, state)
        except (ValueError, ZeroDivisionError, OverflowError):
            continue  # outside the domain of the right-hand side
        if np.isfinite(samples).all():
            found.append(samples)
    return found


def _derivatives(system: ForcedSystem, times: NDArray[np.float64], state: tuple[float, ...]) -> NDArray[np.float64]:
    """Return the right-hand side at many times, shape (times, dimension), from its formulas where they are known.

    Jumps are met as events: what is returned is the smooth side on which the state is at the time 0.
    """
    names, signs = tuple(system.params), tuple[float, ...]()
    if has_events(system):
        in_modes = traced_switching((system.rhs, system.switches), system.dimension, names)
        traced = None if isinstance(in_modes, str) else in_modes.free_motion
        signs = () if isinstance(in_modes, str) else in_modes.signs_at(0.0, state, tuple(system.params.values()))
    else:
        traced = None if unknown_formulas(system) else traced_function(system.rhs, system.dimension, names)
    if traced is not None:
        found = values(traced.outputs, times, state, _values(system), signs)
        return np.stack([np.broadcast_to(f, len(times)) for f in found], axis=1)
    with np.errstate(all="ignore"):
        return np.array([system.derivative(t, state) for t in times.tolist()])


def steps_of_harmonics(samples: NDArray[np.float64], least: float = 0.0) -> int:
    """Return half the number of the highest harmonic of samples of a period, shape (times, ...), at least 1.

    Harmonics count from a strength of `least` on, and from a ten-millionth of that of the strongest.
    """
    strength = np.abs(np.fft.rfft(samples, axis=0))[1:] / len(samples)
    floor = np.maximum(1e-12 * np.abs(samples).max(axis=0), least)
    present = (strength > 1e-7 * strength.max(axis=0)) & (strength > floor)
    return max(1, int((np.flatnonzero(present.reshape(len(present), -1).any(axis=1)).max(initial=0) + 2) // 2))


@dataclass(frozen=True, eq=False)
class Flow:
    """The motion of a system over a stretch of time, compiled, with its tolerance.  Call it with orbits."""

    kernel: PeriodKernel
    parameters: NDArray[np.float64]
    begin: float
    length: float
    rtol: float
    atol: float
    max_steps: int
    largest: NDArray[np.float64]
    fewest_steps: int

    @functools.cached_property
    def numbers(self) -> Motion:
        """The numbers that the integrator takes."""
        ladder, tolerance = self._ladder, max(self.rtol, self.atol)
        margin = self.kernel.margin(tolerance)
        context = self.kernel.advance.context
        if self.kernel.own_steps:
            numbers = [self.rtol / margin, self.atol / margin, self.max_steps, *self.largest]
            context = np.array(numbers, dtype=np.float64).view(np.int64)
        return Motion(
            function=self.kernel.advance.address,
            context=context,
            parameters=self.parameters,
            begin=float(self.begin),
            length=float(self.length),
            largest=self.largest,
            rtol=self.rtol / margin,
            atol=self.atol / margin,
            digit=margin / tolerance,
            ladder=ladder,
            lowest=min(int(np.searchsorted(ladder, self.fewest_steps)), len(ladder) - 1),
            probe=int(np.searchsorted(ladder, PROBE)),
            highest_climb=3 * _RUNGS_PER_OCTAVE,
            order=self.kernel.estimate_order,
            safety=_SAFETY,
            trial=self.kernel.trial,
        )

    @property
    def _ladder(self) -> NDArray[np.int64]:
        """Numbers of steps to choose from, four to an octave."""
        rungs = np.unique([round(4 * 2 ** (k / _RUNGS_PER_OCTAVE)) for k in range(30 * _RUNGS_PER_OCTAVE)])
        return np.unique(np.minimum(rungs, self.max_steps))

    def __call__(self, orbits: Orbits) -> None:
        """Move orbits on in place, angles unwrapped, each with the steps it needs."""
        anywhere = np.zeros(orbits.points.shape[1])
        self.advance(orbits, 1, anywhere, anywhere)

    def advance(self, orbits: Orbits, periods: int, lower: NDArray[np.float64], turn: NDArray[np.float64]) -> None:
        """Move orbits on by some periods in place, with angles brought back into their turns."""
        for some in legs(periods, len(orbits)):
            steps = integrate(self.numbers, orbits.points, orbits.turns, orbits.status, lower, turn, some)
            orbits.work.evaluations += steps * self.kernel.stages
