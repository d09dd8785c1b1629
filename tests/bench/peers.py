"""The same work by other programs: one period of a forced system for many starts.

For the most part that is the driven pendulum

    theta'' + 0.08 theta' + (0.545 cos t + 0.1) sin theta = 0.

Each function returns a callable that maps starts (n, 2) to images (n, 2), angles unwrapped, on one thread; compilation
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
from cellmap.codegen.rebind import rebind

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
    """Return the shortest times of several pieces of work that run on this thread, in turns so that all see one load.

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
    return lambda starts: exact.iterate(starts, 1).unwrapped


def heyoka_batches(tolerance: float, periods: int = 1, equation: Sequence[float] = (0.08, 0.545, 0.1)) -> Any:
    """Return heyoka's batch mode, batch after batch of starts; several periods a call leave no call overhead."""
    import heyoka

    damping, drive, pull = equation
    theta, v = heyoka.make_vars("theta", "v")
    field = -damping * v - (drive * heyoka.cos(heyoka.time) + pull) * heyoka.sin(theta)
    size = heyoka.recommended_simd_size()
    integrator = heyoka.taylor_adaptive_batch([(theta, v), (v, field)], np.zeros((2, size)), tol=tolerance)
    return batch_after_batch(integrator, size, periods * PERIOD)


def heyoka_system(
    rhs: Callable[..., Any], system: cellmap.ForcedSystem, tolerance: float, periods: int = 1
) -> Callable[[Points], Points]:
    """Return heyoka's batch mode for a right-hand side written with :mod:`math`, with the parameters of a system."""
    import heyoka

    states = heyoka.make_vars(*[f"x{j}" for j in range(system.dimension)])
    field = rebind(rhs, {"sin": heyoka.sin, "cos": heyoka.cos})(heyoka.time, states, system.parameters)
    size = heyoka.recommended_simd_size()
    equations = list(zip(states, field, strict=True))
    integrator = heyoka.taylor_adaptive_batch(equations, np.zeros((len(states), size)), tol=tolerance)
    return batch_after_batch(integrator, size, periods * system.length)


def batch_after_batch(integrator: Any, size: int, length: float) -> Callable[[Points], Points]:
    """Return a function that integrates starts with an integrator of heyoka for a time."""

    def run(starts: Points) -> Points:
        images = np.empty_like(starts)
        for i in range(0, len(starts), size):
            integrator.set_time(np.zeros(size))
            integrator.state[:] = starts[i : i + size].T
            integrator.propagate_until(np.full(size, length))
            images[i : i + size] = integrator.state.T
        return images

    return run


def scipy_stacked(tolerance: float) -> Callable[[Points], Points]:
    """Return SciPy's DOP853 with all starts stacked into one system."""
    from scipy.integrate import solve_ivp

    def run(starts: Points) -> Points:
        n = len(starts)

        def fun(t: float, y: Points) -> Points:
            theta, v = y[:n], y[n:]
            return np.concatenate([v, -0.08 * v - (0.545 * np.cos(t) + 0.1) * np.sin(theta)])

        done = solve_ivp(fun, (0.0, PERIOD), starts.T.ravel(), method="DOP853", rtol=tolerance, atol=tolerance)
        return np.asarray(done.y[:, -1].reshape(2, n).T)

    return run


def diffrax_vmap(tolerance: float) -> Callable[[Points], Points]:
    """Return diffrax's Dopri8 under vmap and jit."""
    import diffrax
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)

    def field(t: Any, y: Any, _: Any) -> Any:
        return jnp.stack([y[1], -0.08 * y[1] - (0.545 * jnp.cos(t) + 0.1) * jnp.sin(y[0])])

    controller = diffrax.PIDController(rtol=tolerance, atol=tolerance)

    def one(y: Any) -> Any:
        term, solver = diffrax.ODETerm(field), diffrax.Dopri8()
        done = diffrax.diffeqsolve(term, solver, 0.0, PERIOD, 0.1, y, stepsize_controller=controller, max_steps=4096)
        return done.ys[-1]

    every = jax.jit(jax.vmap(one))

    def run(starts: Points) -> Points:
        return np.asarray(every(jnp.asarray(starts)).block_until_ready())

    return run


def pynamicalsys_loop(tolerance: float) -> Callable[[Points], Points]:
    """Return pynamicalsys' adaptive integrator, one start at a time as its interface has it."""
    import numba
    from pynamicalsys import ContinuousDynamicalSystem

    @numba.njit
    def field(t: float, u: Points, p: Points) -> Points:
        return np.array([u[1], -0.08 * u[1] - (0.545 * np.cos(t) + 0.1) * np.sin(u[0])])

    system = ContinuousDynamicalSystem(equations_of_motion=field, system_dimension=2, number_of_parameters=0)
    system.integrator("rk45", atol=np.float64(tolerance), rtol=np.float64(tolerance))

    def run(starts: Points) -> Points:
        return np.array([system.evolve_system(start, PERIOD) for start in starts])

    return run
