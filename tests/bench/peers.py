"""The same work by other programs: one period of a forced system for many initial conditions.

For the most part that is the driven pendulum

    theta'' + 0.08 theta' + (0.545 cos t + 0.1) sin theta = 0.

Each function returns a callable that maps points (n, 2) to images (n, 2), angles unwrapped, on one thread; compilation
is over when it is returned.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from math import cos, pi, sin
from typing import Any

import numpy as np
from numpy.typing import NDArray

import cellmap
from studies.work_precision.peers import Map, diffrax, heyoka
from studies.work_precision.peers import scipy_stacked as stacked

Points = NDArray[np.float64]
PERIOD = 2 * pi


def best_time(work: Callable[[], Any], rounds: int = 5) -> float:
    """Return the shortest time of several rounds, after one to warm up."""
    work()
    times = []
    for _ in range(rounds):
        began = time.perf_counter()
        work()
        times.append(time.perf_counter() - began)
    return min(times)


def best_times(works: Sequence[Callable[[], Any]], seconds: float = 1.0, rounds: int = 5) -> list[float]:
    """Return the shortest times of several pieces of work that run on this thread, alternately, under one load.

    Time is that of the processor: what other programs take in between does not count.  There are so many rounds at
    least, and more until the seconds are over.
    """
    best = [np.inf for _ in works]
    first = time.thread_time()
    while rounds > 0 or time.thread_time() < first + seconds:
        rounds -= 1
        for k, work in enumerate(works):
            began = time.thread_time()
            work()
            best[k] = min(best[k], time.thread_time() - began)
    return best


def pendulum_rhs(t: float, x: Any, p: Any) -> Any:
    """Right-hand side as a user of cellmap writes it."""
    theta, v = x
    return v, -p.damping * v - (p.drive * cos(t) + p.pull) * sin(theta)


def pendulum() -> cellmap.ForcedSystem:
    """Return the system."""
    params = {"damping": 0.08, "drive": 0.545, "pull": 0.1}
    return cellmap.ForcedSystem(pendulum_rhs, params, PERIOD, (cellmap.angle("theta"), "v"), name="pendulum")


def ours(tolerance: float, method: str = "auto") -> Callable[[Points], Points]:
    """Return cellmap's exact map."""
    exact = cellmap.stroboscopic_map(pendulum(), rtol=tolerance, atol=tolerance, method=method)
    exact.iterate(np.zeros((64, 2)), 1)
    return lambda initial_conditions: exact.iterate(initial_conditions, 1).unwrapped


def heyoka_batches(tolerance: float, periods: int = 1, equation: Sequence[float] = (0.08, 0.545, 0.1)) -> Map:
    """Return heyoka's batch mode for the pendulum with other coefficients."""
    damping, drive, pull = equation
    return heyoka(pendulum().with_params(damping=damping, drive=drive, pull=pull), tolerance, periods)


def heyoka_system(rhs: Callable[..., Any], system: cellmap.ForcedSystem, tolerance: float, periods: int = 1) -> Map:
    """Return heyoka's batch mode for another right-hand side with the parameters of a system."""
    other = cellmap.ForcedSystem(rhs, system.params, system.period, system.coordinates, name=system.name)
    return heyoka(other, tolerance, periods)


def scipy_stacked(tolerance: float) -> Map:
    """Return SciPy's DOP853 with all initial conditions stacked into one system."""
    return stacked(pendulum(), tolerance)


def diffrax_vmap(tolerance: float) -> Map:
    """Return diffrax's Dopri8 under vmap and jit."""
    return diffrax(pendulum(), tolerance)


def pynamicalsys_loop(tolerance: float) -> Callable[[Points], Points]:
    """Return pynamicalsys' adaptive integrator, one initial condition at a time as its interface has it."""
    import numba
    from pynamicalsys import ContinuousDynamicalSystem

    @numba.njit
    def field(t: float, u: Points, p: Points) -> Points:
        return np.array([u[1], -0.08 * u[1] - (0.545 * np.cos(t) + 0.1) * np.sin(u[0])])

    system = ContinuousDynamicalSystem(equations_of_motion=field, system_dimension=2, number_of_parameters=0)
    system.integrator("rk45", atol=np.float64(tolerance), rtol=np.float64(tolerance))

    def run(initial_conditions: Points) -> Points:
        return np.array([system.evolve_system(start, PERIOD) for start in initial_conditions])

    return run
