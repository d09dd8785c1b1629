"""Stability maps, branches and the flipping modes' basins, against as many periods of the exact map."""

from __future__ import annotations

import resource
import time
from collections.abc import Callable
from math import pi

import numpy as np
from peers import best_time

import cellmap
from cellmap import ForcedSystem, continue_orbit, find_basins, periodic_orbit, stability_map, stroboscopic_map
from cellmap.bifurcations import attractor_atlas, floquet_multipliers, period_doubling_cascade
from systems import double_pendulum, driven_pendulum, logistic_map

SIDE = 1000
FREQUENCIES, AMPLITUDES = np.linspace(20.0, 80.0, SIDE), np.linspace(0.5e-3, 14e-3, SIDE)


def million_periods(system: ForcedSystem, rates: float) -> float:
    """Seconds for one period of a million initial conditions, by the exact map at 1e-9."""
    exact = stroboscopic_map(system)
    half = system.dimension // 2
    span = np.array([pi] * half + [rates] * half)
    initial_conditions = np.random.default_rng(0).uniform(-span, span, (SIDE * SIDE, system.dimension))
    exact(initial_conditions[:1000])
    return best_time(lambda: exact(initial_conditions), rounds=3)


def test_stability_maps(say: Callable[[str], None]) -> None:
    for system, state, rates in (
        (driven_pendulum(), (pi, 0.0), 100.0),
        (double_pendulum(), (pi, 0.0, 0.0, 0.0), 100.0),
    ):
        axes = ("frequency", FREQUENCIES), ("amplitude", AMPLITUDES)
        few = ("frequency", FREQUENCIES[::100]), ("amplitude", AMPLITUDES[::100])
        stability_map(system, state, *few)
        periods = million_periods(system, rates)
        mapping = best_time(lambda: stability_map(system, state, *axes), rounds=2)  # noqa: B023
        grid = dict(zip(("frequency", "amplitude"), np.meshgrid(FREQUENCIES, AMPLITUDES), strict=True))
        floquet_multipliers(system, state, {k: v[:2, :2] for k, v in grid.items()}, rtol=1e-9)
        alone = best_time(lambda: floquet_multipliers(system, state, grid, rtol=1e-9), rounds=2)  # noqa: B023
        say(
            f"{system.name}, 1000 x 1000 parameters: stability map with boundaries (1e-13) {mapping:.2f} s, "
            f"{mapping / periods:.1f} times a million periods of the map at 1e-9 ({periods:.2f} s); "
            f"multipliers alone (1e-9) {alone:.2f} s, {alone / periods:.1f} times"
        )


def test_stability_map_of_a_rotation(say: Callable[[str], None]) -> None:
    exact = stroboscopic_map(driven_pendulum(amplitude=3e-3), rtol=1e-12, atol=1e-12)
    rotation = periodic_orbit(exact, [2.52, 320.4])
    axes = ("frequency", np.linspace(40.0, 60.0, 300)), ("amplitude", np.linspace(1e-3, 6e-3, 300))
    stability_map(exact, rotation, ("frequency", [49.0, 50.0, 51.0]), ("amplitude", [2.9e-3, 3e-3, 3.1e-3]))
    seconds = best_time(lambda: stability_map(exact, rotation, *axes), rounds=2)
    say(f"rotation of the pendulum followed over 300 x 300 parameters: {seconds:.2f} s")


def test_an_atlas(say: Callable[[str], None]) -> None:
    exact = stroboscopic_map(driven_pendulum(), rtol=1e-6, atol=1e-6)
    side = (np.arange(8) + 0.5) / 8.0
    states = np.stack(np.meshgrid(-pi + 2.0 * pi * side, -400.0 + 800.0 * side), axis=-1).reshape(-1, 2)
    attractor_atlas(exact, ("frequency", [49.0, 50.0]), ("amplitude", [2e-3, 3e-3]), states, curves=0)
    axes = ("frequency", np.linspace(20.0, 80.0, 300)), ("amplitude", np.linspace(0.5e-3, 10e-3, 300))
    wall, processor = time.perf_counter(), time.process_time()
    atlas = attractor_atlas(exact, *axes, states, max_periods=300)
    wall, processor = time.perf_counter() - wall, time.process_time() - processor
    say(
        f"atlas of the driven pendulum, 300 x 300 parameters x 64 initial conditions on {cellmap.thread_count()} "
        f"threads: {wall:.1f} s, {processor:.0f} s of processor time; {len(atlas.curves)} curves lie on "
        f"{100.0 * atlas.explained:.1f} % of the borders, "
        f"{atlas.undecided.sum()} of {64 * atlas.number.size} orbits undecided"
    )


def test_a_branch_of_a_thousand_points(say: Callable[[str], None]) -> None:
    for system, guess in (
        (driven_pendulum(amplitude=3e-3), (2.52, 320.4)),
        (double_pendulum(), (0.0, pi, 0.0, 0.0)),
    ):
        exact = stroboscopic_map(system, rtol=1e-12, atol=1e-12)
        orbit = periodic_orbit(exact, guess)
        continue_orbit(exact, orbit, "amplitude", 2e-3, 12e-3, max_points=3)
        began = time.perf_counter()
        branch = continue_orbit(exact, orbit, "amplitude", 2e-3, 12e-3, step=5e-4, max_points=1000)
        seconds = time.perf_counter() - began
        say(f"{system.name}: branch of {len(branch.values)} points {seconds:.2f} s")


def test_a_cascade(say: Callable[[str], None]) -> None:
    logistic = logistic_map(2.8)
    began = time.perf_counter()
    cascade = period_doubling_cascade(logistic, periodic_orbit(logistic, [0.6]), "mu", 4.0, doublings=7)
    say(f"logistic map, 7 doublings: {time.perf_counter() - began:.1f} s, last ratio {cascade.ratios[-1]:.6f}")


def test_flipping_modes(say: Callable[[str], None]) -> None:
    exact = stroboscopic_map(double_pendulum())
    exact(np.zeros((100, 4)))
    angles = -pi + (np.arange(SIDE) + 0.5) * (2.0 * pi / SIDE)
    first, second = np.meshgrid(angles, angles, indexing="ij")
    initial_conditions = np.stack([first, second, np.zeros_like(first), np.zeros_like(first)], axis=-1)
    find_basins(exact, initial_conditions[::50, ::50])
    began = time.perf_counter()
    basins = find_basins(exact, initial_conditions)
    seconds = time.perf_counter() - began
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    counts = " / ".join(str(f.count) for f in basins.fractions.values())
    say(
        f"flipping modes, 1000 x 1000 starts on {cellmap.thread_count()} threads: {seconds:.1f} s for "
        f"{basins.cost.steps / 1e6:.1f} million periods, at most {peak:.0f} MiB in this process; counts {counts}"
    )
