"""Labels of initial conditions: against look-ups alone, on two threads, and after a change of a parameter."""

from __future__ import annotations

import time
from itertools import pairwise
from math import pi

import pytest
from peers import best_time

import cellmap
from cellmap import CellGrid, find_basins, interpolated_map, stroboscopic_map
from cellmap.attractors import continue_attractors
from systems import dimensionless_parameters, dimensionless_pendulum

SPEED = 2 * pi * 50  # rad/s of the drive: figure 19's pendulum in units of it
WINDOW = 100 / SPEED
GRID = CellGrid((-pi, -WINDOW), (pi, WINDOW), (500, 500))


def exact(amplitude):
    values = dimensionless_parameters(length=0.0272, frequency=50.0, amplitude=amplitude, damping=10.0)
    return stroboscopic_map(dimensionless_pendulum(**values))


def table(point_map, cells=256):
    nodes = CellGrid((-pi, -1.3 * WINDOW), (pi, 1.3 * WINDOW), (cells, cells))
    return interpolated_map(point_map, nodes, outside="integrate")


@pytest.fixture(scope="module")
def icm():
    return table(exact(0.004))


def test_basins_in_look_ups(say, icm):
    starts = GRID.centres().reshape(-1, 2)
    look_ups = best_time(lambda: icm.iterate(starts, 20), rounds=5)
    cases = {"4 mm, table": icm, "10 mm, table": table(exact(0.010)), "10 mm, exact map": exact(0.010)}
    for name, point_map in cases.items():
        taken = best_time(lambda m=point_map: find_basins(m, GRID), rounds=5)
        say(f"basins of 500 x 500, {name}: {taken:.3f} s, {taken / look_ups:.1f} times 20 look-ups of each")


@pytest.mark.parametrize("side", [500, 1500])
def test_labels_on_two_threads(say, icm, side):
    grid = CellGrid(GRID.lower, GRID.upper, (side, side))
    known, seconds = find_basins(icm, GRID).attractors, []
    for threads in (1, 2):
        cellmap.set_threads(threads)
        seconds.append(best_time(lambda: find_basins(icm, grid, attractors=known), rounds=5))
    cellmap.set_threads(None)
    say(f"labels of {side} x {side}: two threads {seconds[0] / seconds[1]:.2f} times as fast as one")


@pytest.mark.parametrize("amplitude", [0.003, 0.010])
def test_a_parameter_is_changed(say, amplitude):
    grid = CellGrid(GRID.lower, GRID.upper, (125, 125))
    known = find_basins(table(exact(amplitude), 128), grid).attractors
    parts = []
    for step in range(1, 6):
        times = [time.perf_counter()]
        point_map = exact(amplitude + 1e-5 * step)
        times.append(time.perf_counter())
        changed = table(point_map, 128)
        times.append(time.perf_counter())
        known = continue_attractors(changed, known)
        times.append(time.perf_counter())
        find_basins(changed, grid, attractors=known)
        times.append(time.perf_counter())
        parts.append([1e3 * (after - before) for before, after in pairwise(times)])
    best = [min(column) for column in zip(*parts, strict=True)]
    names = ("map", "table", "attractors", "labels")
    listed = ", ".join(f"{name} {ms:.0f}" for name, ms in zip(names, best, strict=True))
    say(f"125 x 125, pendulum at {1e3 * amplitude:g} mm, parameter changed: {sum(best):.0f} ms ({listed})")
