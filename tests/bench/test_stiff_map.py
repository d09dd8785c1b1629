"""Exact maps of stiff systems against SciPy with a compiled right-hand side: one thread, CPU seconds."""

from __future__ import annotations

import time

import numpy as np
import pytest
from scipy.integrate import odeint, solve_ivp

from cellmap import ForcedSystem, stroboscopic_map
from tests.reference.stiff import CASES

ORBITS = {"cellmap": 512, "scipy": 8}


def cpu_seconds(run) -> float:
    """CPU seconds of the second call; the first one compiles."""
    run()
    begin = time.process_time()
    run()
    return time.process_time() - begin


@pytest.mark.parametrize("tolerance", [1e-6, 1e-9])
@pytest.mark.parametrize("name", ["van der Pol, mu = 100", "van der Pol, mu = 1000", "tanh(1000 v)"])
def test_against_scipy(say, one_thread, name, tolerance):
    """A compiled right-hand side called by LSODA (odeint) and by Radau, orbit by orbit."""
    numba = pytest.importorskip("numba")
    case = CASES[name]
    names = [f"x{j}" for j in range(len(case.initial_condition))]
    system = ForcedSystem(case.rhs, case.params, case.period, names)
    strobe = stroboscopic_map(system, rtol=tolerance, atol=tolerance)
    places = np.random.default_rng(0).uniform(-2.0, 2.0, (ORBITS["cellmap"], len(names)))
    ours = cpu_seconds(lambda: strobe.iterate(places, 1)) / len(places)
    compiled, p = numba.njit(case.rhs), system.parameters
    few = places[: ORBITS["scipy"]]

    def lsoda():
        return [odeint(compiled, x, (0.0, case.period), (p,), tfirst=True, rtol=tolerance, atol=tolerance, mxstep=10**6)
                for x in few]  # fmt: skip

    def radau():
        return [solve_ivp(compiled, (0.0, case.period), x, "Radau", args=(p,), rtol=tolerance, atol=tolerance)
                for x in few[:2]]  # fmt: skip

    theirs = {"LSODA": cpu_seconds(lsoda) / len(few), "Radau": cpu_seconds(radau) / 2}
    ratios = ", ".join(
        f"{peer} {1e3 * seconds:.3g} ms ({seconds / ours:.3g} times)" for peer, seconds in theirs.items()
    )
    say(f"{name}, {tolerance:g}: cellmap {1e3 * ours:.3g} ms a period, {ratios}")
