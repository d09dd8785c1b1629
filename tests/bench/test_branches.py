"""What branches, impacts, and cycles of autonomous systems cost: one thread where maps are compared."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from math import asin, cos, pi, sin

import numpy as np
import pytest

from cellmap import CellGrid, ForcedSystem, angle, find_basins, stroboscopic_map
from cellmap.orbits import Kind

QV = ("q", "v")
POINTS = np.random.default_rng(0).uniform(-1.5, 1.5, (4096, 2))


def duffing(t, x, p):
    return x[1], x[0] - x[0] ** 3 - 0.25 * x[1] + p.force * cos(t)


def stop(t, x, p):
    push = p.k * (x[0] - 1.0) if x[0] > 1.0 else 0.0
    return x[1], -x[0] - push - 0.1 * x[1] + p.force * cos(t)


def named_stop(t, x, p, s):
    return x[1], -x[0] - 0.5 * (1.0 + s[0]) * p.k * (x[0] - 1.0) - 0.1 * x[1] + p.force * cos(t)


def rubs(t, x, p):
    return x[1], -x[0] - p.k * np.sign(x[1]) - 0.1 * x[1] + p.force * cos(t)


def named_rubs(t, x, p, s):
    return x[1], -x[0] - p.k * s[0] - 0.1 * x[1] + p.force * cos(t)


def chopped(t, x, p):
    return x[1], -x[0] - (p.k if x[0] + 0.3 * x[1] > 0.5 else 0.0) - 0.1 * x[1] + p.force * cos(t)


def named_chopped(t, x, p, s):
    return x[1], -x[0] - p.k * 0.5 * (1.0 + s[0]) - 0.1 * x[1] + p.force * cos(t)


PAIRS = {
    "soft impact": (stop, named_stop, lambda t, x, p: (x[0] - 1.0,), 20.0),
    "dry friction": (rubs, named_rubs, lambda t, x, p: (x[1],), 0.1),
    "relay": (chopped, named_chopped, lambda t, x, p: (x[0] + 0.3 * x[1] - 0.5,), 0.3),
}


def cpu_seconds(*runs: Callable[[], object]) -> list[float]:
    """Least CPU seconds of each of several runs, taken in turn; the first ones compile."""
    best = [np.inf] * len(runs)
    for turn in range(9):
        for i, run in enumerate(runs):
            begin = time.process_time()
            run()
            if turn:
                best[i] = min(best[i], time.process_time() - begin)
    return best


@pytest.mark.parametrize("name", PAIRS)
def test_an_if_against_switches(say, one_thread, name):
    plain, named, surface, k = PAIRS[name]
    params = {"k": k, "force": 0.9}
    first = stroboscopic_map(ForcedSystem(plain, params, 2 * pi, QV))
    second = stroboscopic_map(ForcedSystem(named, params, 2 * pi, QV, switches=surface))
    ours, theirs = cpu_seconds(lambda: first.iterate(POINTS, 4), lambda: second.iterate(POINTS, 4))
    cost = 1e6 * ours / (4 * len(POINTS))
    say(f"{name}: a plain `if` {cost:.3g} us a period, {ours / theirs:.3f} of `switches` (1.05)")


def test_soft_impact_against_duffing(say, one_thread):
    """Maps, and whole basins of 200^2."""
    soft = stroboscopic_map(ForcedSystem(stop, {"k": 20.0, "force": 0.9}, 2 * pi, QV))
    smooth = stroboscopic_map(ForcedSystem(duffing, {"force": 0.2}, 2 * pi, QV))
    grid = CellGrid((-2, -2), (2, 2), (100, 100))
    maps = cpu_seconds(lambda: soft.iterate(POINTS, 4), lambda: smooth.iterate(POINTS, 4))
    basins = cpu_seconds(lambda: find_basins(soft, grid), lambda: find_basins(smooth, grid))
    say(f"soft impact in Duffing oscillators: map {maps[0] / maps[1]:.2f}, basins {basins[0] / basins[1]:.2f} (4)")


def test_constant_torque(say):
    """A fixed point, and a rotation whose period is another than that of the map: 150 x 150, from nothing."""

    def pendulum(t, x, p):
        return x[1], 0.5 - 0.1 * x[1] - sin(x[0])

    system = ForcedSystem(pendulum, {}, 2 * pi, (angle("theta"), "v"))
    begin = time.perf_counter()
    basins = find_basins(stroboscopic_map(system), CellGrid((-pi + asin(0.5), -10), (pi + asin(0.5), 10), (150, 150)))
    seconds = time.perf_counter() - begin
    fractions = {a.kind: (basins.labels == k).mean() for k, a in enumerate(basins.attractors)}
    say(
        f"constant torque 0.5, damping 0.1: {seconds:.2f} s (5); fixed point {fractions[Kind.FIXED_POINT]:.5f}, "
        f"rotation {fractions[Kind.QUASIPERIODIC]:.5f}"
    )


def test_textbook_systems(say):
    """10^4 random initial conditions of each, from nothing but the compiler's own loops."""
    from tests.textbook.textbook_systems import BRANCHING, IMPACTS, SMOOTH, STIFF

    taken = {}
    for name, (system, grid) in {**SMOOTH, **BRANCHING, **STIFF, **IMPACTS}.items():
        places = np.random.default_rng(0).uniform(grid.lower, grid.upper, (10_000, grid.dimension))
        begin = time.process_time(), time.perf_counter()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            basins = find_basins(stroboscopic_map(system), places)
        taken[name] = time.perf_counter() - begin[1], time.process_time() - begin[0]
        undecided = (basins.labels < 0).mean()
        print(
            f"{name}: {taken[name][0]:.2f} s, CPU {taken[name][1]:.2f} s, without an attractor {undecided:.4f}",
            flush=True,
        )
    slow = {name: round(wall, 1) for name, (wall, _) in taken.items() if wall > 20.0}
    total = sum(wall for wall, _ in taken.values())
    say(f"{len(taken)} textbook systems, 10^4 initial conditions each: {total:.0f} s; above 20 s: {slow}")
