"""500 x 500 orbits over 50 periods, by interpolated map and by heyoka's batch mode on the same cores."""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
import time
import tracemalloc
from math import pi

import numpy as np
import pytest
from peers import best_time, heyoka_batches

import cellmap
from cellmap import CellGrid, find_basins, interpolated_map, stroboscopic_map
from systems import dimensionless_parameters, dimensionless_pendulum

PERIODS = 50
SPEED = 2 * pi * 50  # rad/s of the drive: figure 19's pendulum in units of it
WINDOW = 100 / SPEED
GRID = CellGrid((-pi, -WINDOW), (pi, WINDOW), (500, 500))
ROD = {"length": 0.0272, "frequency": 50.0, "damping": 10.0}
PARAMETERS = dimensionless_parameters(amplitude=0.003, **ROD)


def exact(tolerance=1e-9):
    return stroboscopic_map(dimensionless_pendulum(**PARAMETERS), rtol=tolerance, atol=tolerance)


def table(cells=256, order=5, point_map=None, max_step=1):
    nodes = CellGrid((-pi, -1.3 * WINDOW), (pi, 1.3 * WINDOW), (cells, cells))
    return interpolated_map(point_map or exact(), nodes, order=order, outside="integrate", max_step=max_step)


def heyoka_slice(numbers):
    """Integrate some starts over all periods in a process of its own; return the seconds that the integration took."""
    alpha, beta, gamma = (PARAMETERS[name] for name in ("alpha", "beta", "gamma"))
    run = heyoka_batches(1e-9, periods=PERIODS, equation=(gamma, -beta, alpha))
    initial_conditions = GRID.centres().reshape(-1, 2)[numbers]
    run(initial_conditions[:64])
    began = time.perf_counter()
    run(initial_conditions)
    return time.perf_counter() - began


def test_image_against_heyoka(say):
    pytest.importorskip("heyoka")
    initial_conditions = GRID.centres().reshape(-1, 2)
    point_map = exact()
    # A tenth of the orbits, spread over the grid, in one process for each core.
    cores = cellmap.thread_count()
    fraction = np.arange(0, len(initial_conditions), 10)[: len(initial_conditions) // 10 // (8 * cores) * 8 * cores]
    with multiprocessing.get_context("spawn").Pool(cores) as pool:
        seconds = max(pool.map(heyoka_slice, np.array_split(fraction, cores))) * len(initial_conditions) / len(fraction)
    say(f"picture of 500 x 500 starts, 50 periods, {cores} cores: heyoka batch 1e-9 {seconds:.2f} s")
    reference = exact(1e-13).iterate(initial_conditions, PERIODS).unwrapped
    settings = ((5, 128, 1), (5, 256, 1), (5, 512, 1), (3, 512, 1), (3, 256, 2), (5, 96, 4), (5, 128, 4), (5, 256, 8))
    for order, cells, max_step in settings:
        setting = (cells, order, point_map, max_step)
        taken = best_time(lambda s=setting: table(*s).iterate(initial_conditions, PERIODS))
        error = np.median(
            np.abs(table(*setting).iterate(initial_conditions, PERIODS).unwrapped - reference).max(axis=-1)
        )
        say(
            f"  order {order}, {cells} x {cells}, steps of {max_step}: {taken:.3f} s with tabulation, "
            f"median error {error:.1e}: {seconds / taken:.0f} times as fast"
        )
    direct = best_time(lambda: point_map.iterate(initial_conditions, PERIODS), rounds=1)
    say(f"  cellmap's exact map: {direct:.2f} s, {seconds / direct:.1f} times as fast")


def test_labels_against_direct_integration(say):
    cases = [(a, w) for w in (100, 500) for a in (0.002, 0.003, 0.004, 0.010)]
    for amplitude, window in cases:
        width = window / SPEED
        system = dimensionless_pendulum(**dimensionless_parameters(amplitude=amplitude, **ROD))
        point_map, grid = stroboscopic_map(system), CellGrid((-pi, -width), (pi, width), (500, 500))
        nodes = CellGrid((-pi, -1.3 * width), (pi, 1.3 * width), (512, 512))
        icm = interpolated_map(point_map, nodes, outside="integrate")
        wrong = (find_basins(icm, grid).labels != find_basins(point_map, grid).labels).mean()
        say(f"A = {1e3 * amplitude:g} mm, {window} rad/s: {100 * wrong:.4f} % of labels differ from direct integration")


def test_threads_initial_conditions_and_periods(say):
    icm, point_map = table(), exact()
    initial_conditions = GRID.centres().reshape(-1, 2)
    work = {
        "look-ups": lambda k=PERIODS: icm.iterate(initial_conditions, k),
        "exact map": lambda: point_map.iterate(initial_conditions, 2),
        "tabulation": lambda: table(1024, 5, point_map),
        "labels": lambda: find_basins(icm, CellGrid(GRID.lower, GRID.upper, (1500, 1500))),
    }
    for name, run in work.items():
        times = []
        for threads in (1, 2):
            cellmap.set_threads(threads)
            times.append(best_time(run, rounds=4))
        cellmap.set_threads(None)
        say(f"{name}: two threads {times[0] / times[1]:.2f} times as fast as one")
    base = best_time(work["look-ups"])
    half = best_time(lambda: icm.iterate(initial_conditions[: len(initial_conditions) // 2], PERIODS))
    double = best_time(lambda: work["look-ups"](k=2 * PERIODS))
    say(f"look-ups: half the starts cost {half / base:.2f}, twice the periods {double / base:.2f}")


def test_memory(say):
    point_map = exact()
    nodes = CellGrid((-pi, -WINDOW), (pi, WINDOW), (1024, 1024))
    initial_conditions = CellGrid((-pi, -WINDOW), (pi, WINDOW), (1000, 1000))
    find_basins(interpolated_map(point_map, nodes, outside="integrate"), initial_conditions)
    tracemalloc.start()
    icm = interpolated_map(point_map, nodes, outside="integrate")
    basins = find_basins(icm, initial_conditions)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    kept = icm.table.coefficients.nbytes + basins.labels.nbytes + basins.settling_time.nbytes
    say(f"memory: at most {peak / kept:.2f} times table, labels and settling times ({kept / 1e6:.0f} MB)")


PROGRAM = """
import time; began = time.perf_counter()
import cellmap
print(f"{time.perf_counter() - began:.2f}", end=" ")
from math import cos, pi
from cellmap import CellGrid, ForcedSystem, find_basins, interpolated_map, stroboscopic_map

def rhs(t, x, p):
    q, v = x
    return v, q - q**3 - p.delta * v + p.gamma * cos(p.omega * t)

duffing = ForcedSystem(rhs, {"delta": 0.15, "gamma": 0.2, "omega": 1.0}, period=2 * pi, coordinates=("q", "v"))
grid = CellGrid(lower=(-2.2, -2.2), upper=(2.2, 2.2), shape=(500, 500))
find_basins(interpolated_map(stroboscopic_map(duffing), grid), grid)
print(f"{time.perf_counter() - began:.2f}")
"""


def test_first_basins_of_a_new_system(say, tmp_path):
    environment = {**os.environ, "CELLMAP_CACHE_DIR": str(tmp_path), "NUMBA_CACHE_DIR": str(tmp_path / "numba")}
    for which in ("first", "second"):
        done = subprocess.run(
            [sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True, check=True
        )
        imported, total = done.stdout.split()
        say(f"{which} process: import {imported} s, first basins of a new system {total} s")
