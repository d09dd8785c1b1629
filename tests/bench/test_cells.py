"""Cell mappings of a million cells: seconds and memory."""

from __future__ import annotations

import resource
import time
from collections.abc import Callable

import numpy as np

from cellmap import CellGrid, PointMap, interpolated_map, stroboscopic_map, thread_count
from cellmap._compiled.kernels.chains import unravel
from cellmap.sets import generalized_cell_mapping, simple_cell_mapping
from cellmap.sets.markov import components_of
from systems import dimensionless_pendulum, two_well_duffing

MILLION = (1000, 1000)


def wells() -> tuple[PointMap, CellGrid]:
    window = (-2.2, -2.2), (2.2, 2.2)
    table = interpolated_map(stroboscopic_map(two_well_duffing()), CellGrid(*window, (400, 400)), outside="integrate")
    return table, CellGrid(*window, MILLION)


def shaken() -> tuple[PointMap, CellGrid]:
    window = (-np.pi, -4.0), (np.pi, 4.0)
    exact = stroboscopic_map(dimensionless_pendulum(0.5, 0.1, 0.03))
    return interpolated_map(exact, CellGrid(*window, (400, 400)), outside="integrate"), CellGrid(*window, MILLION)


def gigabytes() -> float:
    """Largest memory of this process so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6


def test_unravelling(say: Callable[[str], None]) -> None:
    """Wanted: 0.1 s for a million cells."""
    mapping = simple_cell_mapping(*wells())
    cases = {
        "two-well Duffing": mapping.images.ravel(),
        "random": np.random.default_rng(0).integers(-1, 10**6, 10**6),
        "one long way": np.minimum(np.arange(10**6) + 1, 10**6 - 1),
    }
    out = [np.empty(10**6, np.int32) for _ in range(3)]
    for name, images in cases.items():
        seconds = []
        for _ in range(5):
            began = time.perf_counter()
            unravel(images, *out)
            seconds.append(time.perf_counter() - began)
        say(f"unravelling a million cells, {name}: {min(seconds):.4f} s")


def test_chains(say: Callable[[str], None]) -> None:
    """Wanted: two minutes and 4 GB for a million cells with 25 samples, classes and absorption."""
    for name, system, noise in (
        ("two-well Duffing by table", wells, None),
        ("shaken pendulum by table", shaken, None),
        ("the same with noise, a class of 120,000 cells that is left late", shaken, 0.02),
    ):
        point_map, grid = system()
        began = time.perf_counter()
        chain = generalized_cell_mapping(point_map, grid, noise=noise)
        made = time.perf_counter() - began
        began = time.perf_counter()
        components_of(chain.matrix)
        sorted_out = time.perf_counter() - began
        began = time.perf_counter()
        assert chain.absorption.sum(axis=-1).min() > 1.0 - 1e-6
        absorbed = time.perf_counter() - began
        say(
            f"chain of a million cells, 25 samples, {thread_count()} threads, {name}: {made:.1f} s, components "
            f"{sorted_out:.2f} s, absorption in {len(chain.closed)} classes {absorbed:.2f} s, "
            f"{gigabytes():.2f} GB so far"
        )
