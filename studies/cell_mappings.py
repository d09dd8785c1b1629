"""Cell mappings side by side: simple, generalized, set-oriented and interpolated, on one Duffing oscillator.

x'' + 0.08 x' + x^3 = 0.2 cos t has five attractors; basins are computed on [-1, 1] x [-0.5, 1].  Each method labels the
same initial conditions, and each label is compared with that of exact integration to 1e-13.  Simple and generalized
cell mapping use cells of a wider window, which holds all attractors, as large as the pixels; interpolation grids have
cells of twice that side.  Cells that end outside the wider window count as escaped, and as wrong.  Subdivision finds
the attractors from boxes that are fine only around invariant sets, for the basins of an interpolated map (hybrid); the
last row certifies a basin image.

What each is best for: simple cell mapping, a first look at an unknown system, every cell once; generalized cell
mapping, noise, chances and expected times; subdivision, small attractors, saddles, and three or four dimensions;
interpolated cell mapping, the basin image itself, with certificates for each label; direct integration, the check of
all.

Must come out, as it does elsewhere on 401 x 401 cells and with interpolation on 201 x 201: a simple cell mapping
mislabels some 14 % with one period in a step and some 3 % with several; a generalized one loses small attractors unless
it takes several; interpolation of order 3 mislabels at most 0.5 %.
"""

from __future__ import annotations

import time
import tracemalloc
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from cellmap import (
    Attractor,
    Basins,
    CellGrid,
    PointMap,
    certify,
    find_basins,
    interpolated_map,
    plot,
    stroboscopic_map,
)
from cellmap.maps.coordinates import difference
from cellmap.sets import find_attractors_by_subdivision, generalized_cell_mapping, simple_cell_mapping
from systems import duffing_oscillator

LOWER, UPPER = np.array([-1.0, -0.5]), np.array([1.0, 1.0])
BEFORE, BEHIND = np.array([0.8, 0.8]), np.array([0.8, 0.7])  # what the wider window has more at its corners
SAMPLES = (3, 3)  # of a cell, in a generalized cell mapping
BISECTIONS = 4  # of the boxes, along each axis, in a search by subdivision
COARSER = 2  # sides of the cells of tables, in pixels
DRAWN = ("direct", "simple, 1 period", "simple, 8 periods", "generalized, 1 period", "generalized, 8 periods", "ICM 3")


@dataclass(frozen=True, eq=False)
class Row:
    """What a method finds, and what that costs."""

    name: str
    basins: Basins
    found: int
    lost: float
    wrong: float
    seconds: float
    memory: float


def windows(pixel: float) -> tuple[CellGrid, CellGrid, CellGrid]:
    """Return the window, the wider one with cells of the same size, and the cells of tables."""

    def cells(lower: NDArray[np.float64], upper: NDArray[np.float64], side: float) -> CellGrid:
        return CellGrid(tuple(lower), tuple(upper), tuple(np.round((upper - lower) / side).astype(int)))

    wide = LOWER - BEFORE, UPPER + BEHIND
    return cells(LOWER, UPPER, pixel), cells(*wide, pixel), cells(*wide, COARSER * pixel)


def methods(exact: PointMap, pixel: float) -> dict[str, Callable[[], Basins]]:
    """Return all methods by name, as functions without arguments that return basins of the window or a wider one."""
    window, wide, nodes = windows(pixel)

    def simple(periods: int) -> Callable[[], Basins]:
        return lambda: simple_cell_mapping(exact, wide, periods).basins()

    def generalized(periods: int) -> Callable[[], Basins]:
        return lambda: generalized_cell_mapping(exact, wide, SAMPLES, periods).basins()

    def interpolated(order: int) -> Callable[[], Basins]:
        return lambda: find_basins(interpolated_map(exact, nodes, order, outside="integrate"), window)

    def hybrid() -> Basins:
        found = find_attractors_by_subdivision(exact, CellGrid(wide.lower, wide.upper, (8, 8)), BISECTIONS)
        table = interpolated_map(exact, nodes, 5, outside="integrate")
        return find_basins(table, window, attractors=found.attractors)

    return {
        "direct": lambda: find_basins(exact, window),
        "simple, 1 period": simple(1),
        "simple, 4 periods": simple(4),
        "simple, 8 periods": simple(8),
        "generalized, 1 period": generalized(1),
        "generalized, 4 periods": generalized(4),
        "generalized, 8 periods": generalized(8),
        **{f"ICM {order}": interpolated(order) for order in (1, 3, 5)},
        "hybrid: subdivision, ICM 5": hybrid,
        "ICM 5, certified": lambda: certify(interpolated(5)(), max_cost=float("inf")).basins,
    }


def compute(pixel: float) -> tuple[Basins, list[Row]]:
    """Label the window by exact integration, and by each method."""
    system = duffing_oscillator(damping=0.08, linear=0.0, cubic=1.0, forcing=0.2, frequency=1.0)
    exact, window = stroboscopic_map(system), windows(pixel)[0]
    reference = find_basins(stroboscopic_map(system, rtol=1e-13, atol=1e-13), window)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # tables are too coarse
        for work in methods(exact, 0.05).values():
            work()  # compiles
    return reference, [measured(name, work, reference) for name, work in methods(exact, pixel).items()]


def measured(name: str, work: Callable[[], Basins], reference: Basins) -> Row:
    """Run a method, and compare what it finds."""
    tracemalloc.start()
    began = time.perf_counter()
    basins = work()
    seconds = time.perf_counter() - began
    memory = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    basins = translated(within(basins, reference), reference)
    found = len(np.unique(basins.labels[basins.labels >= 0]))
    wrong = float((basins.labels != reference.labels).mean())
    return Row(name, basins, found, float((basins.labels < 0).mean()), wrong, seconds, memory)


def within(basins: Basins, reference: Basins) -> Basins:
    """Cut the window of the reference out of a wider one with the same cells."""
    assert basins.grid is not None and reference.grid is not None
    first = np.round((LOWER - np.array(basins.grid.lower)) / basins.grid.widths).astype(int)
    part = tuple(slice(k, k + n) for k, n in zip(first, reference.grid.shape, strict=True))
    return replace(basins, labels=basins.labels[part], settling_time=basins.settling_time[part], grid=reference.grid)


def translated(basins: Basins, reference: Basins) -> Basins:
    """Give labels the numbers that the attractors have in the reference."""
    number = [nearest(a, reference.attractors) for a in basins.attractors]
    return replace(
        basins,
        labels=np.array([*number, -3, -2, -1], np.int16)[basins.labels],
        attractors=reference.attractors,
    )


def nearest(attractor: Attractor, others: tuple[Attractor, ...]) -> int:
    """Return the number of the attractor with a point closest to the first one of this."""

    def distance(other: Attractor) -> float:
        apart = difference(other.points, attractor.points[0], attractor.coordinates)
        return float(np.linalg.norm(apart, axis=-1).min())

    return int(np.argmin([distance(other) for other in others]))


def report(reference: Basins, rows: list[Row]) -> str:
    """Print and return the table."""
    assert reference.grid is not None
    size = " x ".join(map(str, reference.grid.shape))
    lines = [
        f"{size} pixels, {len(reference.attractors)} attractors by exact integration to 1e-13",
        "",
        "| method | attractors | lost (%) | wrong (%) | seconds | memory (MB) |",
        "|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {r.name} | {r.found} | {100 * r.lost:.2f} | {100 * r.wrong:.2f} | {r.seconds:.2f} | {r.memory / 1e6:.0f} |"
        for r in rows
    ]
    text = "\n".join(lines)
    print(text)
    return text


def draw(rows: list[Row]) -> Figure:
    """Draw basins by some of the methods, with what each mislabels."""
    figure, panels = plt.subplots(2, 3, figsize=(13.0, 8.0), layout="constrained", sharex=True, sharey=True)
    by_name = {row.name: row for row in rows}
    for panel, name in zip(panels.flat, DRAWN, strict=True):
        plot.basins(by_name[name].basins, ax=panel, legend=False)
        panel.set_title(f"{name}: {100 * by_name[name].wrong:.2f} % wrong")
    return figure


def main(quick: bool, output: Path) -> None:
    """Compute and draw."""
    reference, rows = compute(pixel=0.01 if quick else 0.005)
    (output / "cell_mappings.md").write_text(report(reference, rows) + "\n", encoding="utf-8")
    figure = draw(rows)
    figure.savefig(output / "cell_mappings.png", dpi=100)
    plt.close(figure)
