"""The same map by other programs, those that are installed: functions from points (n, d) to unwrapped images (n, d).

All of them run on one thread.  What they compile is compiled when the function is returned.
"""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cellmap import ForcedSystem
from cellmap._compiled.codegen.rebind import rebind

Map = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def scipy_each(system: ForcedSystem, tolerance: float) -> Map:
    """Return SciPy's DOP853, one initial condition at a time."""
    from scipy.integrate import solve_ivp

    p = system.parameters

    def run(initial_conditions: NDArray[np.float64]) -> NDArray[np.float64]:
        span = (0.0, system.length)
        return np.array(
            [
                solve_ivp(
                    lambda t, x: system.rhs(t, tuple(x), p), span, s, method="DOP853", rtol=tolerance, atol=tolerance
                ).y[:, -1]
                for s in initial_conditions
            ]
        )

    return run


def scipy_stacked(system: ForcedSystem, tolerance: float) -> Map:
    """Return SciPy's DOP853 with all initial conditions stacked into one system."""
    from scipy.integrate import solve_ivp

    rhs: Any = rebind(system.rhs, {"sin": np.sin, "cos": np.cos})
    p, d = system.parameters, system.dimension

    def run(initial_conditions: NDArray[np.float64]) -> NDArray[np.float64]:
        n = len(initial_conditions)

        def fun(t: float, y: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.concatenate([np.broadcast_to(f, n) for f in rhs(t, tuple(y.reshape(d, n)), p)])

        done = solve_ivp(
            fun, (0.0, system.length), initial_conditions.T.ravel(), method="DOP853", rtol=tolerance, atol=tolerance
        )
        return np.asarray(done.y[:, -1].reshape(d, n).T)

    return run


def numbalsoda(system: ForcedSystem, tolerance: float) -> Map:
    """Return numbalsoda's dop853, one initial condition at a time."""
    from numbalsoda import dop853, lsoda_sig

    numba: Any = importlib.import_module("numba")  # whose types know less than it does

    d, p, rhs = system.dimension, system.parameters, numba.njit(rebind(system.rhs, {}, numba.njit))

    def field(t: float, u: Any, du: Any, _: Any) -> None:
        y = numba.carray(u, (d,))
        state = (y[0], y[1]) if d == 2 else (y[0], y[1], y[2], y[3])
        slope = rhs(t, state, p)
        for j in range(d):
            du[j] = slope[j]

    address, times, nothing = numba.cfunc(lsoda_sig)(field).address, np.array([0.0, system.length]), np.zeros(1)

    def every(initial_conditions: NDArray[np.float64]) -> NDArray[np.float64]:
        images = np.empty_like(initial_conditions)
        for i in range(len(initial_conditions)):
            images[i] = dop853(address, initial_conditions[i], times, nothing, rtol=tolerance, atol=tolerance)[0][-1]
        return images

    mapped: Map = numba.njit(every)
    mapped(np.zeros((1, d)))
    return mapped


def heyoka(system: ForcedSystem, tolerance: float, periods: int = 1) -> Map:
    """Return heyoka's Taylor method in batch mode; several periods a call leave little overhead of calls.

    Of the size that it recommends, and twice that, which is faster on processors with longer vectors, the faster one.
    """
    import heyoka as hy

    states = hy.make_vars(*[f"x{j}" for j in range(system.dimension)])
    field: Any = rebind(system.rhs, {"sin": hy.sin, "cos": hy.cos})(hy.time, states, system.parameters)
    equations = list(zip(states, field, strict=True))

    def in_batches(size: int) -> Map:
        integrator = hy.taylor_adaptive_batch(equations, np.zeros((len(states), size)), tol=tolerance)

        def run(initial_conditions: NDArray[np.float64]) -> NDArray[np.float64]:
            images = np.empty_like(initial_conditions)
            for i in range(0, len(initial_conditions), size):
                batch = initial_conditions[np.minimum(np.arange(i, i + size), len(initial_conditions) - 1)]
                integrator.set_time(np.zeros(size))
                integrator.state[:] = batch.T
                integrator.propagate_until(np.full(size, periods * system.length))
                images[i : i + size] = integrator.state.T[: len(initial_conditions) - i]
            return images

        return run

    tried = [in_batches(factor * hy.recommended_simd_size()) for factor in (1, 2)]
    some = np.random.default_rng(0).uniform(-1.0, 1.0, (256, len(states)))

    def seconds(run: Map) -> float:
        taken = []
        for _ in range(5):
            began = time.thread_time()
            run(some)
            taken.append(time.thread_time() - began)
        return min(taken)

    return min(tried, key=seconds)


def diffrax(system: ForcedSystem, tolerance: float) -> Map:
    """Return diffrax's Dopri8 under vmap and jit."""
    import diffrax as dfx
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    rhs: Any = rebind(system.rhs, {"sin": jnp.sin, "cos": jnp.cos})
    p = system.parameters

    def field(t: Any, y: Any, _: Any) -> Any:
        return jnp.stack([jnp.asarray(f) for f in rhs(t, tuple(y), p)])

    controller = dfx.PIDController(rtol=tolerance, atol=tolerance)

    def one(y: Any) -> Any:
        term = dfx.ODETerm(field)
        return dfx.diffeqsolve(
            term, dfx.Dopri8(), 0.0, system.length, None, y, stepsize_controller=controller, max_steps=4096
        ).ys[-1]

    every = jax.jit(jax.vmap(one))
    return lambda initial_conditions: np.asarray(every(jnp.asarray(initial_conditions)).block_until_ready())


PEERS: dict[str, tuple[Callable[[ForcedSystem, float], Map], str, int]] = {
    "SciPy DOP853, one by one": (scipy_each, "scipy", 16),
    "SciPy DOP853, stacked": (scipy_stacked, "scipy", 4096),
    "numbalsoda dop853": (numbalsoda, "numbalsoda", 1024),
    "diffrax Dopri8": (diffrax, "diffrax", 4096),
    "heyoka, batches": (heyoka, "heyoka", 4096),
}
"""Programs by name: the function that returns their map, the package, and the number of initial conditions."""


def installed() -> list[str]:
    """Return the names of the programs that are installed."""
    return [name for name, (_, package, _) in PEERS.items() if find_spec(package) is not None]
