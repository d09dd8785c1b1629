"""Ways to make interpolated maps faster: evaluation, multi-period steps, four dimensions."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from math import pi

import numpy as np
import pytest
from numpy.typing import NDArray
from peers import best_times

from cellmap import CellGrid, ForcedSystem, PointMap, find_basins, interpolated_map, stroboscopic_map
from systems import dimensionless_parameters, dimensionless_pendulum, double_pendulum, two_well_duffing

pytestmark = pytest.mark.usefixtures("one_thread")

SPEED = 2 * pi * 50
PERIODS = 50
HALF = 1e-3  # half the width of an axis that a slice cuts

Say = Callable[[str], None]


def pendulum(amplitude: float, damping: float = 10.0) -> ForcedSystem:
    """Figure 19's pendulum."""
    values = dimensionless_parameters(length=0.0272, frequency=50.0, amplitude=amplitude, damping=damping)
    return dimensionless_pendulum(**values)


def windows() -> Iterator[tuple[str, ForcedSystem, CellGrid]]:
    """Systems with the windows of their initial conditions."""
    width = 100 / SPEED
    for amplitude in (0.002, 0.003, 0.004, 0.010):
        yield f"A = {1e3 * amplitude:g} mm", pendulum(amplitude), CellGrid((-pi, -width), (pi, width), (250, 250))
    yield "two-well Duffing", two_well_duffing(), CellGrid((-2.2, -2.2), (2.2, 2.2), (250, 250))


def table(point_map: PointMap, window: CellGrid, cells: int, order: int = 5, max_step: int = 1) -> PointMap:
    """Interpolate on 1.3 times the window along what is not an angle."""
    wider = [1.0 if c.period else 1.3 for c in point_map.coordinates]
    nodes = CellGrid(tuple(np.multiply(window.lower, wider)), tuple(np.multiply(window.upper, wider)), (cells, cells))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return interpolated_map(point_map, nodes, order, "integrate", max_step=max_step)


def iterations(
    maps: Sequence[PointMap], initial_conditions: NDArray[np.float64], periods: int
) -> list[Callable[[], object]]:
    """Return the work of iterating starts by each map."""
    return [partial(icm.iterate, initial_conditions, periods) for icm in maps]


def test_cost_of_a_look_up(say: Say) -> None:
    """Per orbit and period on one thread, alternately so that all see one load."""
    _, system, window = list(windows())[1]
    point_map = stroboscopic_map(system)
    initial_conditions = window.centres().reshape(-1, 2)
    settings = [(order, cells) for order in (1, 3, 5) for cells in (64, 128, 256, 512)]
    maps = [table(point_map, window, cells, order) for order, cells in settings]
    times = best_times(iterations(maps, initial_conditions, 20), seconds=4.0)
    direct = best_times(iterations([point_map], initial_conditions, 1))[0] / len(initial_conditions)
    for (order, cells), seconds in zip(settings, times, strict=True):
        each = seconds / 20 / len(initial_conditions)
        say(f"look-up of order {order} in {cells} x {cells} cells: {1e9 * each:.1f} ns, 1/{direct / each:.0f} image")


def test_multi_period_steps(say: Say) -> None:
    """Iteration alone, against single periods of the same table, and the error of 50 periods."""
    for name, system, window in windows():
        point_map = stroboscopic_map(system, rtol=1e-9, atol=1e-9)
        initial_conditions = window.centres().reshape(-1, 2)
        reference = stroboscopic_map(system, rtol=1e-13, atol=1e-13).iterate(initial_conditions, PERIODS).unwrapped
        for cells in (128, 256):
            max_steps = (1, 2, 4, 8, 16)
            maps = [table(point_map, window, cells, max_step=max_step) for max_step in max_steps]
            times = best_times(iterations(maps, initial_conditions, PERIODS), seconds=0.5, rounds=2)
            parts = []
            for max_step, icm, seconds in zip(max_steps, maps, times, strict=True):
                error = np.median(np.abs(icm.iterate(initial_conditions, PERIODS).unwrapped - reference).max(axis=-1))
                parts.append(f"step {max_step} {times[0] / seconds:.2f} ({error:.0e})")
            say(f"{name}, {cells} x {cells}, times as fast as single periods (median error): {', '.join(parts)}")


def test_multi_period_steps_of_basins(say: Say) -> None:
    """The slower orbits settle, the more multi-period steps gain."""
    for damping in (10.0, 1.0):
        point_map = stroboscopic_map(pendulum(0.003, damping), rtol=1e-9, atol=1e-9)
        window = CellGrid((-pi, -100 / SPEED), (pi, 100 / SPEED), (250, 250))
        max_steps = (1, 4, 8, 16)
        maps = [table(point_map, window, 128, max_step=max_step) for max_step in max_steps]
        times = best_times([partial(find_basins, icm, window) for icm in maps], rounds=3)
        found = [find_basins(m, window) for m in maps]
        settled = found[0].settling_time.mean()
        for max_step, seconds, basins in zip(max_steps[1:], times[1:], found[1:], strict=True):
            labels = 100 * (basins.labels != found[0].labels).mean()
            periods = 100 * (basins.settling_time != found[0].settling_time).mean()
            say(
                f"basins at {damping:g} /s, settled after {settled:.0f} periods: step {max_step} "
                f"{times[0] / seconds:.2f} times as fast, {labels:.4f} % of labels and {periods:.4f} % of "
                "settling times differ"
            )


def test_tables_in_four_dimensions(say: Say) -> None:
    """Tables of the double pendulum against a slice of 200 x 200 starts at rest, integrated."""
    point_map = stroboscopic_map(double_pendulum())
    grid = CellGrid((-pi, -pi, -HALF, -HALF), (pi, pi, HALF, HALF), (200, 200, 1, 1))
    initial_conditions = grid.centres().reshape(-1, 4)
    find_basins(point_map, initial_conditions[:100])
    four_dimensional_table(point_map, 4)  # compile
    began = time.thread_time()
    basins = find_basins(point_map, grid)
    direct = time.thread_time() - began
    image = direct / basins.cost.steps
    say(f"double pendulum: slice integrated in {basins.cost.steps / 1e6:.1f} million images")
    for cells in (16, 24):
        began = time.thread_time()
        icm = four_dimensional_table(point_map, cells)
        made = time.thread_time() - began
        lower, upper = icm.table.grid.lower, icm.table.grid.upper
        places = np.random.default_rng(0).uniform(lower, upper, (20_000, 4))
        by_cells = places[np.lexsort(np.floor((places - lower) / icm.table.grid.widths).T[::-1])]
        works = [partial(icm.iterate, initial_conditions, 10), partial(icm, places), partial(icm, by_cells)]
        along, mixed, ordered = best_times(works, rounds=3)
        gains = [
            image * n / seconds
            for n, seconds in ((10 * len(initial_conditions), along), (20_000, mixed), (20_000, ordered))
        ]
        say(
            f"  {cells}^4 cells, order 3: made in {made / direct:.2f} of that time, median error of one period "
            f"{icm.error(4000).median:.0e}; look-ups {gains[0]:.0f} times as fast as images along orbits, "
            f"{gains[1]:.0f} times in random places, {gains[2]:.0f} times where these are sorted by cells"
        )
    needed = 64**2 * 77**2 + 64**4  # nodes, with those past the ends of the rates, and centres
    fraction = needed / icm.cost.steps * made / direct
    say(f"  64^4 cells: {needed / 1e6:.0f} million images, {fraction:.0f} times the time of the slice")


def four_dimensional_table(point_map: PointMap, cells: int) -> PointMap:
    """Interpolate over all angular velocities that orbits from rest reach."""
    nodes = CellGrid((-pi, -pi, -65.0, -65.0), (pi, pi, 65.0, 65.0), (cells,) * 4)
    return interpolated_map(point_map, nodes, 3, "integrate", tolerance=1e9)
