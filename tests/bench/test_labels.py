"""Labels of initial conditions: against look-ups and heyoka, on two threads, live, over a parameter, of very many.

A billion initial conditions on a cluster of one machine take an hour, and a few gigabytes of the disk; by hand:
``python tests/bench/test_labels.py 31623 4`` (side of the image, workers).
"""

from __future__ import annotations

import multiprocessing
import sys
import tempfile
import time
from itertools import pairwise
from math import pi, sin
from pathlib import Path

import numpy as np
import pytest
from peers import best_time, heyoka_batches

import cellmap
from cellmap import CellGrid, angle, discrete_map, find_basins, interpolated_map, stroboscopic_map
from cellmap.attractors import continue_attractors
from cellmap.attractors.settling.settle import Catalogue
from cellmap.basins import LiveBasins, continue_basins, refine_basins
from cellmap.maps.coordinates import wrap
from systems import (
    dimensionless_parameters,
    dimensionless_pendulum,
    double_pendulum,
    duffing_oscillator,
    forced_pendulum,
    two_well_duffing,
    ueda_oscillator,
)

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
    initial_conditions = GRID.centres().reshape(-1, 2)
    look_ups = best_time(lambda: icm.iterate(initial_conditions, 20), rounds=5)
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


def kicked_rotor(nu=0.02, kick=4.0):
    """The dissipative standard map, whose attractors are the more numerous the smaller its dissipation."""

    def rule(x, p):
        momentum = (1.0 - p.nu) * x[1] + p.kick * sin(x[0])
        return x[0] + momentum, momentum

    return discrete_map(rule, {"nu": nu, "kick": kick}, (angle("theta"), "p"))


SLOW = {
    "Ueda's oscillator, chaotic": (lambda: stroboscopic_map(ueda_oscillator()), (4.0, 6.0), 300),
    "forced two-well Duffing, chaotic": (
        lambda: stroboscopic_map(two_well_duffing(damping=0.25, forcing=0.4)),
        (2.2, 2.2),
        300,
    ),
    "Ueda's oscillator, table": (
        lambda: interpolated_map(
            stroboscopic_map(ueda_oscillator()), CellGrid((-5.0, -9.0), (5.0, 9.0), (256, 256)), outside="integrate"
        ),
        (4.0, 6.0),
        300,
    ),
    "forced two-well Duffing, regular": (lambda: stroboscopic_map(two_well_duffing()), (2.2, 2.2), 300),
    "dissipative standard map": (kicked_rotor, (pi, pi), 200),
}


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", SLOW)
def test_chaos_and_many_attractors(say, name):
    make, half, side = SLOW[name]
    point_map, grid = make(), CellGrid([-h for h in half], half, (side, side))
    find_basins(point_map, CellGrid(grid.lower, grid.upper, (8, 8)))
    began, cpu = time.perf_counter(), time.process_time()
    basins = find_basins(point_map, grid)
    wall, spent = time.perf_counter() - began, time.process_time() - cpu
    say(f"{side} x {side}, {name}: {wall:.2f} s, {spent:.2f} s of all threads, {len(basins.attractors)} attractors")


def five_attractors(step):
    """Five attractors of a hardening Duffing oscillator, whose forcing changes a little with each step."""
    return stroboscopic_map(duffing_oscillator(0.08, 0.0, 1.0, 0.2 * (1.0 + 1e-4 * step), 1.0))


def rotor(step):
    system = forced_pendulum()
    name, value = next(iter(system.params.items()))
    return stroboscopic_map(system.with_params(**{name: value * (1.0 + 1e-4 * step)}))


CHANGED = {
    "pendulum at 3 mm": (lambda step: exact(0.003 + 1e-5 * step), (pi, WINDOW), (pi, 1.3 * WINDOW), 128),
    "pendulum at 10 mm": (lambda step: exact(0.010 + 1e-5 * step), (pi, WINDOW), (pi, 1.3 * WINDOW), 128),
    "five-attractor Duffing": (five_attractors, (1.0, 1.0), (1.6, 1.6), 128),
    "forced pendulum": (rotor, (pi, 4.0), (pi, 5.0), 192),
}


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("side", [125, 500])
@pytest.mark.parametrize("name", CHANGED)
def test_a_parameter_is_changed(say, name, side):
    make, half, reach, cells = CHANGED[name]
    grid = CellGrid([-h for h in half], half, (side, side))
    nodes = CellGrid([-r for r in reach], reach, (cells, cells))
    known = find_basins(interpolated_map(make(0), nodes), grid).attractors
    parts = []
    for step in range(1, 6):
        times = [time.perf_counter()]
        point_map = make(step)
        times.append(time.perf_counter())
        changed = interpolated_map(point_map, nodes)
        times.append(time.perf_counter())
        known = continue_attractors(changed, known)
        times.append(time.perf_counter())
        find_basins(changed, grid, attractors=known)
        times.append(time.perf_counter())
        parts.append([1e3 * (after - before) for before, after in pairwise(times)])
    best = [min(column) for column in zip(*parts, strict=True)]
    stages = ("map", "table", "attractors", "labels")
    listed = ", ".join(f"{stage} {ms:.0f}" for stage, ms in zip(stages, best, strict=True))
    say(f"{side} x {side}, {name}, parameter changed: {sum(best):.0f} ms ({listed})")


LIVE = {
    "pendulum, 3 mm": (lambda: table(exact(0.003), 128), GRID, "beta", 1e-4),
    "pendulum, 10 mm": (lambda: table(exact(0.010), 128), GRID, "beta", 1e-4),
    "Duffing": (
        lambda: interpolated_map(stroboscopic_map(two_well_duffing()), CellGrid((-2.5, -2.5), (2.5, 2.5), (192, 192))),
        CellGrid((-2.2, -2.2), (2.2, 2.2), (500, 500)),
        None,
        1e-4,
    ),
    "forced pendulum": (
        lambda: interpolated_map(stroboscopic_map(forced_pendulum()), CellGrid((-pi, -5.0), (pi, 5.0), (192, 192))),
        CellGrid((-pi, -4.0), (pi, 4.0), (500, 500)),
        None,
        1e-4,
    ),
}


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", LIVE)
def test_live_images_after_a_change(say, name):
    """Times from the request to the first preview, an image of a quarter of the places, and the complete image."""
    make, grid, parameter, step = LIVE[name]
    point_map = make()
    parameter = parameter or next(iter(point_map.params))
    live, value, seen = LiveBasins(point_map, grid), point_map.params[parameter], []
    live.image()
    for k in range(1, 7):
        began, times = time.perf_counter(), {}
        for frame in live.frames({parameter: value * (1.0 + k * step)}):
            times.setdefault("complete" if frame.complete else frame.stride, 1e3 * (time.perf_counter() - began))
        seen.append(times)
    best = {stage: min(times.get(stage, 1e9) for times in seen) for stage in (8, 4, 2, "complete")}
    listed = ", ".join(f"{'stride ' if stage != 'complete' else ''}{stage} {ms:.0f}" for stage, ms in best.items())
    say(f"live 500 x 500, {name}, parameter changed, ms: {listed}")


def test_refinement(say, icm):
    """What coarse images cost on top of a whole one."""
    known = find_basins(icm, GRID).attractors
    whole = best_time(lambda: find_basins(icm, GRID, attractors=known))
    refined = best_time(lambda: list(refine_basins(icm, GRID, attractors=known)))
    first = best_time(lambda: next(refine_basins(icm, GRID, attractors=known)))
    say(f"refinement of 500 x 500: {refined / whole:.2f} times a whole call; first image after {1e3 * first:.0f} ms")


def heyoka_labels(numbers, catalogue_of, periods):
    """Label some initial conditions a period of heyoka's at a time, and leave out those that are captured."""
    values = dimensionless_parameters(length=0.0272, frequency=50.0, amplitude=0.004, damping=10.0)
    run = heyoka_batches(1e-9, equation=(values["gamma"], -values["beta"], values["alpha"]))
    point_map = exact(0.004)
    catalogue = Catalogue.of(catalogue_of, point_map)
    states = GRID.centres().reshape(-1, 2)[numbers]
    run(states[:64])
    labels, active = np.full(len(states), -3), np.arange(len(states))
    began = time.perf_counter()
    for k in range(periods + 1):
        owners = catalogue.owners_of(states[active])
        labels[active] = np.where(owners >= 0, owners, -3)
        active = active[owners < 0]
        if not len(active) or k == periods:
            break
        # It takes whole batches.
        padded = np.concatenate([active, np.repeat(active[:1], -len(active) % 8)])
        states[active] = wrap(run(states[padded]), point_map.coordinates)[: len(active)]
    return labels, time.perf_counter() - began


def test_labels_against_heyoka(say):
    pytest.importorskip("heyoka")
    basins, cores = find_basins(table(exact(0.004)), GRID), cellmap.thread_count()
    fraction = np.random.default_rng(0).permutation(GRID.size)[: GRID.size // 20 // (8 * cores) * 8 * cores]
    tasks = [(part, basins.attractors, 300) for part in np.array_split(fraction, cores)]
    with multiprocessing.get_context("spawn").Pool(cores) as pool:
        parts = pool.starmap(heyoka_labels, tasks)
    seconds = max(taken for _, taken in parts) * GRID.size / len(fraction)
    theirs = np.concatenate([labels for labels, _ in parts])
    for cells in (256, 96):
        ours = best_time(lambda cells=cells: find_basins(table(exact(0.004), cells), GRID), rounds=5)
        icm = table(exact(0.004), cells)
        same = float(np.mean(theirs == find_basins(icm, GRID).labels.ravel()[fraction]))
        say(
            f"labels of 500 x 500 at 4 mm, {cores} cores: heyoka batch 1e-9 with the same regions {seconds:.1f} s; "
            f"ours with map, search, and a table of {cells} x {cells} cells (median error {icm.error().median:.0e}) "
            f"{ours:.3f} s: {seconds / ours:.0f} times as fast; {100 * same:.2f} % of labels are equal"
        )


@pytest.mark.parametrize("amplitude", [0.003, 0.010], ids=["smooth", "fractal"])
@pytest.mark.filterwarnings("ignore")
def test_continuation(say, amplitude, values=100, side=250):
    grid, point_map = CellGrid(GRID.lower, GRID.upper, (side, side)), table(exact(amplitude), 128)
    beta = point_map.params["beta"] * np.linspace(1.0, 1.1, values)
    began = time.perf_counter()
    sweep = continue_basins(point_map, "beta", beta, grid)
    followed = time.perf_counter() - began
    began = time.perf_counter()
    for value in beta[:: values // 10]:
        find_basins(point_map.with_params(beta=float(value)), grid)
    alone = (time.perf_counter() - began) * values / 10
    say(
        f"{values} values x {side} x {side} from {1e3 * amplitude:.0f} mm: continue_basins {followed:.2f} s, "
        f"searched alone {alone / followed:.1f} times as long; labels audited, and different: "
        f"{sweep.audited.sum(axis=0)}; {sweep}"
    )


def test_a_parameter_is_dragged(say):
    """Previews of 250 x 250 while one parameter is changed in small steps, each until every place has a label."""
    for amplitude in (0.003, 0.010):
        point_map = table(exact(amplitude), 128)
        live, value, seen = LiveBasins(point_map, CellGrid(GRID.lower, GRID.upper, (250, 250))), 0.0, []
        live.image()
        for k in range(1, 31):
            value, times, began = point_map.params["beta"] * (1.0 + 2e-4 * k), {}, time.perf_counter()
            for frame in live.frames({"beta": value}):
                if not frame.preview:
                    break
                times[frame.stride] = 1e3 * (time.perf_counter() - began)
            seen.append(times)
        ms = {stride: float(np.median([times[stride] for times in seen[15:]])) for stride in (8, 4, 2, 1)}
        listed = ", ".join(f"stride {stride} {taken:.0f}" for stride, taken in ms.items())
        say(f"250 x 250 at {1e3 * amplitude:.0f} mm, one parameter dragged, ms to a preview: {listed}")


def test_slice_of_the_double_pendulum(say, side=1000):
    grid = CellGrid((-pi, -pi, -1e-3, -1e-3), (pi, pi, 1e-3, 1e-3), (side, side, 1, 1))
    point_map = stroboscopic_map(double_pendulum())
    find_basins(point_map, CellGrid(grid.lower, grid.upper, (10, 10, 1, 1)))
    began = time.perf_counter()
    basins = find_basins(point_map, grid)
    say(f"slice of the double pendulum, {side} x {side}: {time.perf_counter() - began:.1f} s; {basins}")


def most_memory():
    """Return the most memory that this process has had, in MB; `getrusage` counts that of the one that began it too."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) / 1024 for line in lines if line.startswith("VmHWM"))


def very_many(side, path, workers=0):
    """Label a large image with a checkpoint; return seconds, memory of this process, and the size of the file."""
    grid, point_map = CellGrid(GRID.lower, GRID.upper, (side, side)), table(exact(0.003))
    began = time.perf_counter()
    if workers:
        from distributed import Client

        with Client(n_workers=workers, threads_per_worker=1, dashboard_address=None) as client:
            find_basins(point_map, grid, checkpoint=path, client=client)
    else:
        find_basins(point_map, grid, checkpoint=path)
    return time.perf_counter() - began, most_memory(), path.stat().st_size / 2**20


def test_a_hundred_million(say, side=10_000):
    with tempfile.TemporaryDirectory() as folder, multiprocessing.get_context("spawn").Pool(1) as pool:
        seconds, memory, disk = pool.apply(very_many, (side, Path(folder) / "basins.h5"))
    say(f"{side**2:.0e} initial conditions with a checkpoint: {seconds:.1f} s, {memory:.0f} MB, file {disk:.0f} MB")


if __name__ == "__main__":
    print(very_many(int(sys.argv[1]), Path("very_many.h5"), int(sys.argv[2])))
