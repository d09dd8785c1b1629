"""Trajectories: states of a forced system within the periods of its stroboscopic map."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._lib.arrays import Floats
from .._lib.checks import claim_memory, finite_number, whole_number
from .._lib.computed import computed_once
from .._lib.signatures import checked
from .._lib.threads import run_over, slices
from .coordinates import state_points, turns_of, wrap
from .integration import Flow, flow
from .orbit_batch import CHUNK, Orbits, Status
from .point_map import Iterate, PointMap, history, warn_of_tolerance
from .stroboscopic import MAX_STEPS, Stroboscopic
from .system import ForcedSystem

_FINEST = 1e-15  # tolerance between two samples that rounding leaves within reach


@dataclass(frozen=True, eq=False)
class Trajectory:
    """States of a forced system at equally spaced times, for one or many initial conditions.

    Parameters
    ----------
    system : ForcedSystem
        The system.
    times : ndarray, shape (n,)
        Times, in the unit of the period.
    states : ndarray, shape (n, ..., dimension)
        States at these times, angles unwrapped; NaN once an orbit has terminated.
    status : ndarray of uint8, shape (...)
        A :class:`Status` for each initial condition.
    samples : int
        Samples in a period; ``states[::samples]`` are points of the stroboscopic map.
    """

    system: ForcedSystem
    times: Floats
    states: Floats
    status: NDArray[np.uint8]
    samples: int

    def __repr__(self) -> str:
        return (
            f"Trajectory({self.system.name}: {self.status.size:,} initial conditions, {self.periods:,} periods of "
            f"{self.samples} samples)"
        )

    @property
    def periods(self) -> int:
        """Number of periods."""
        return (len(self.times) - 1) // self.samples

    @property
    def wrapped(self) -> Floats:
        """States with wrapped angles, shape (n, ..., dimension)."""
        return wrap(self.states, self.system.axes)

    @property
    def strobe(self) -> Floats:
        """Points of the stroboscopic map, angles wrapped, shape (periods + 1, ..., dimension)."""
        return wrap(self.states[:: self.samples], self.system.axes)

    @checked
    def output(self, name: str) -> Floats:
        """Return one of the system's outputs along the trajectory.

        Parameters
        ----------
        name : str
            One of the `outputs` of the system.

        Returns
        -------
        ndarray, shape (n, ..., components)
            Values; NaN once an orbit has terminated.

        Raises
        ------
        ValueError
            For a name that the system does not have.
        """
        present = np.isfinite(self.states).all(axis=-1)
        times = np.broadcast_to(self.times.reshape(-1, *(1,) * (present.ndim - 1)), present.shape)
        values = self.system.output(name, times[present], self.states[present])
        result = np.full((*present.shape, values.shape[-1]), np.nan)
        result[present] = values
        return result


@checked
def trajectory(
    system: ForcedSystem,
    initial_conditions: ArrayLike,
    periods: int,
    samples_per_period: int = 64,
    phase: float = 0.0,
    rtol: float = 1e-9,
    atol: ArrayLike | Mapping[str, float] = 1e-9,
    method: str = "auto",
    max_steps: int = 16384,
    progress: bool = False,
) -> Trajectory:
    """Integrate a forced system and return its states at equally spaced times.

    The stroboscopic map takes the initial conditions from period to period; the samples in each period are then
    integrated from its first point.  The stroboscopic points are therefore those of :func:`stroboscopic_map`, and every
    sample satisfies ``error <= atol + rtol * abs(state)``, by the integrator's estimate, relative to the exact solution
    from the last stroboscopic point.

    Parameters
    ----------
    system : ForcedSystem
        The system.
    initial_conditions : array_like, shape (..., dimension)
        Initial conditions at ``t = phase * period``.
    periods : int
        Periods of the forcing, at least 1.
    samples_per_period : int, optional
        States recorded in each period.
    phase : float, optional
        Phase of the forcing at the initial time, as a fraction of the period.
    rtol, atol
        Relative and absolute tolerance of one period, as for :func:`stroboscopic_map`.
    method : {"auto", "DOP853", "RK45", "Taylor"}, optional
        Integration method, as for :func:`stroboscopic_map`.
    max_steps : int, optional
        Largest number of steps in a period, and between two samples.
    progress : bool, optional
        Show a bar on a terminal for work of more than two seconds.

    Returns
    -------
    Trajectory
        ``periods * samples_per_period + 1`` times and states, the initial ones included.

    Raises
    ------
    TypeError, ValueError
        For arguments out of range, or a right-hand side that cannot be compiled.
    MemoryError
        If the states need more memory than is free.

    Warns
    -----
    ToleranceWarning
        If the integrator missed its tolerance; the orbits concerned have the status INACCURATE.

    Examples
    --------
    >>> from math import pi
    >>> def rhs(t, x, p):
    ...     q, v = x
    ...     return v, -q
    >>> oscillator = ForcedSystem(rhs, {}, 2 * pi, ("q", "v"), outputs={"energy": lambda t, x, p: (x[0]**2 + x[1]**2,)})
    >>> motion = trajectory(oscillator, [1.0, 0.0], periods=2, samples_per_period=4)
    >>> motion.states[:, 0].round(6) + 0.0
    array([ 1.,  0., -1.,  0.,  1.,  0., -1.,  0.,  1.])
    >>> motion.strobe.shape
    (3, 2)
    >>> motion.output("energy")[:, 0].round(6)
    array([1., 1., 1., 1., 1., 1., 1., 1., 1.])
    """
    spec = Stroboscopic(system, phase, rtol, atol, method, max_steps)
    places = state_points("initial_conditions", initial_conditions, system.axes)
    periods = whole_number("periods", periods, at_least=1)
    samples_per_period = whole_number("samples_per_period", samples_per_period, at_least=1)
    count, moments = places.size // system.dimension, periods * samples_per_period + 1
    needed = moments * (places.nbytes + 8) + 6 * (periods + 1) * places.nbytes
    what = f"{moments:,} states of {count:,} initial conditions"
    claim_memory(what, needed, "take fewer periods, samples or initial conditions")
    sampler = Sampler(spec, samples_per_period)
    states, status = sampler.states(places.reshape(count, system.dimension), periods, progress)
    times = (phase + np.arange(moments) / samples_per_period) * system.length
    shape = (moments, *places.shape)
    return Trajectory(system, times, states.reshape(shape), status.reshape(shape[1:-1]), samples_per_period)


@dataclass(frozen=True, eq=False)
class Sampler:
    """Motion of a stroboscopic map between samples at equal distances in time."""

    spec: Stroboscopic
    samples: int

    @computed_once
    def strobe(self) -> PointMap:
        """The stroboscopic map."""
        return self.spec.build()

    @computed_once
    def motion(self) -> Flow:
        """The motion from the first sample of a period to the second one."""
        spec, count = self.spec, self.samples
        rtol = max(spec.rtol / count, _FINEST)
        atol = np.maximum(np.divide(spec.atol, count), np.minimum(spec.atol, _FINEST))
        length, method = spec.system.length / count, spec.motion.method
        return flow(spec.formulas, spec.motion.begin, length, rtol, atol, method, spec.max_steps)

    def states(self, places: Floats, periods: int, progress: bool = False) -> tuple[Floats, NDArray[np.uint8]]:
        """Return states (times, count, d), with NaN once orbits have terminated, and statuses (count,)."""
        system, strobe, samples = self.spec.system, self.strobe, self.samples
        lower, turn = turns_of(system.axes)
        count, d = places.shape
        start = Orbits.starting(places.copy())
        start.wrap(lower, turn)  # angles are unwrapped from where they were given
        strobed = history(strobe, places, periods, progress)
        points, rotations = strobed.points, strobed.rotations + start.rotations
        states = np.empty((periods * samples + 1, count, d))
        states[::samples] = points + rotations * turn
        states[0] = places
        ends = strobed.status[:-1].ravel()
        within = Orbits(points[:-1].reshape(-1, d), rotations[:-1].reshape(-1, d), ends)
        cells = states[:-1].reshape(periods, samples, count, d)

        def fill(part: slice) -> None:
            period, start = np.divmod(np.arange(part.start, part.stop), count)
            begins, done = self.motion.begin + np.arange(samples - 1.0) * self.motion.length, 1
            for found in self.motion.sample(within[part], begins, turn):
                for k in range(found.shape[1]):
                    cells[period, done + k, start] = found[:, k]
                done += found.shape[1]

        label = f"trajectories of {system.name}" if progress else None
        run_over(slices(len(within), CHUNK), fill, label)
        status = np.maximum(strobed.status[-1], within.status.reshape(periods, count).max(axis=0))
        over = status >= Status.ESCAPED
        if over.any():
            rest = states[:, over]
            rest[np.logical_or.accumulate(np.isnan(rest).any(axis=-1), axis=0)] = np.nan
            states[:, over] = rest
        warn_of_tolerance(status, strobe)
        return states, status


@checked
def integrate(
    system: ForcedSystem,
    initial_conditions: ArrayLike,
    begin: float,
    duration: float,
    rtol: float = 1e-9,
    atol: ArrayLike | Mapping[str, float] = 1e-9,
    method: str = "auto",
    max_steps: int = MAX_STEPS,
) -> Iterate:
    """Integrate a forced system from one time over a duration that need not be a period.

    Parameters
    ----------
    system : ForcedSystem
        The system.
    initial_conditions : array_like, shape (..., dimension)
        Initial conditions at the time `begin`.
    begin : float
        Initial time, in the unit of the period.
    duration : float
        Time over which the system is integrated, above 0.
    rtol, atol
        Relative and absolute tolerance of the final states, as for :func:`stroboscopic_map`.
    method : {"auto", "DOP853", "RK45", "Taylor"}, optional
        Integration method, as for :func:`stroboscopic_map`.
    max_steps : int, optional
        Largest number of steps.

    Returns
    -------
    Iterate
        Final states.

    Raises
    ------
    TypeError, ValueError
        For arguments out of range, or a right-hand side that cannot be compiled.

    Warns
    -----
    ToleranceWarning
        If the integrator missed its tolerance; the orbits concerned have the status INACCURATE.

    Examples
    --------
    >>> from math import pi, sin
    >>> driven = ForcedSystem(lambda t, x, p: (sin(t),), {}, 2 * pi, ("x",))
    >>> integrate(driven, [0.0], begin=pi / 2, duration=pi / 2).points.round(9)
    array([1.])
    """
    places = state_points("initial_conditions", initial_conditions, system.axes)
    spec = Stroboscopic(system, 0.0, rtol, atol, method, max_steps)
    begin, duration = finite_number("begin", begin), finite_number("duration", duration, above=0.0)
    motion = flow(spec.formulas, begin, duration, spec.rtol, spec.atol, spec.method, spec.max_steps)
    orbits = Orbits.starting(places.reshape(-1, system.dimension).copy())
    run_over(slices(len(orbits), CHUNK), lambda part: motion(orbits[part]))
    orbits.wrap(*turns_of(system.axes))
    if orbits.status.any():
        warn_of_tolerance(orbits.status, spec.build())
    shape = places.shape
    return Iterate(
        orbits.points.reshape(shape), orbits.rotations.reshape(shape), orbits.status.reshape(shape[:-1]), system.axes
    )
