"""Basins of the double pendulum with all four equilibria stable, and with swings about the symmetric ones.

Reference set: 50 Hz, links of 3.2 cm, m2 = m1/4, 6 mm, damping 10 /s in both joints.  Three slices of its space of four
dimensions: over both angles at rest, over both angles with both links rotating once a period, and over both angular
velocities from the flipping state (inner link up, outer link down).  Fractions of a box in all four dimensions come
from random initial conditions, so they have standard errors.  At 9.5 mm (0, 0) and (π, π) have doubled their periods.

Must come out (tests/REFERENCES.md): of 60 x 60 initial conditions at rest 1286 / 596 / 976 / 742 go to (0, 0)
/ (0, π) / (π, 0) / (π, π), none is undecided, and at most 5 may differ.
"""

from __future__ import annotations

import resource
import sys
import time
from dataclasses import dataclass
from math import pi
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from cellmap import Attractor, Basins, CellGrid, find_basins, plot, save_basins, stroboscopic_map
from cellmap.basins.label_store import basins_memory
from cellmap.orbits import Kind
from systems import double_pendulum

REFERENCE = CellGrid((-pi, -pi, -1.0, -1.0), (pi, pi, 1.0, 1.0), (60, 60, 1, 1))
ROTATING = 100.0 * pi  # angular velocity of one rotation a period (rad/s)
FASTEST = 400.0  # angular velocities of the box (rad/s)
AMPLITUDES = (0.006, 0.0095)
HALF = 1e-3  # half the width of an axis that a slice cuts


@dataclass(frozen=True, eq=False)
class Measured:
    """Basins with what they cost: wall and processor seconds, and the largest memory of the process so far (bytes)."""

    basins: Basins
    wall: float
    processor: float
    memory: int


def measured(amplitude: float, initial_conditions: CellGrid | np.ndarray) -> Measured:
    """Find basins of the reference set at an amplitude, and what they cost."""
    point_map = stroboscopic_map(double_pendulum(amplitude=amplitude))
    wall, processor = time.perf_counter(), time.process_time()
    basins = find_basins(point_map, initial_conditions, progress=True)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    unit = 1 if sys.platform == "darwin" else 1024
    return Measured(basins, time.perf_counter() - wall, time.process_time() - processor, peak * unit)


def angle_slice(cells: int, rate: float) -> CellGrid:
    """Return a slice over both angles, both links having one rate."""
    return CellGrid((-pi, -pi, rate - HALF, rate - HALF), (pi, pi, rate + HALF, rate + HALF), (cells, cells, 1, 1))


def rate_slice(cells: int) -> CellGrid:
    """Return a slice over both angular velocities from the flipping state (π, 0)."""
    near = (pi - HALF, -HALF), (pi + HALF, HALF)
    return CellGrid((*near[0], -FASTEST, -FASTEST), (*near[1], FASTEST, FASTEST), (1, 1, cells, cells))


def box(initial_conditions: int) -> np.ndarray:
    """Return random initial conditions over both circles and all angular velocities up to the fastest."""
    most = np.array([pi, pi, FASTEST, FASTEST])
    return np.random.default_rng(0).uniform(-most, most, (initial_conditions, 4))


def compute(cells: int, side: int, initial_conditions: int) -> dict[str, Measured]:
    """Find the basins of all slices and boxes, and tell of each."""
    plans: dict[str, tuple[float, CellGrid | np.ndarray]] = {
        "at rest, 60 x 60": (AMPLITUDES[0], REFERENCE),
        "both links turning once a period": (AMPLITUDES[0], angle_slice(side, ROTATING)),
        "rates from (π, 0)": (AMPLITUDES[0], rate_slice(side)),
        **{f"box, {1e3 * a:g} mm": (a, box(initial_conditions)) for a in AMPLITUDES},
        "at rest": (AMPLITUDES[0], angle_slice(cells, 0.0)),
    }
    found = {}
    for title, (amplitude, where) in plans.items():
        found[title] = measured(amplitude, where)
        report(title, found[title])
    return found


def report(title: str, found: Measured) -> None:
    """Print fractions, attractors and cost of one set of initial conditions."""
    basins = found.basins
    print(f"{title}: {basins.labels.size:,} initial conditions, A =  {1e3 * basins.params['amplitude']:g} mm")
    for label, part in basins.fractions.items():
        name = repr(basins.attractors[label]) if label >= 0 else basins.label_name(label)
        print(f"  {part.count:8d}  {100 * part.fraction:8.4f} +- {100 * part.standard_error:.4f} %  {name}")
    print(
        f"  {found.wall:.1f} s ({found.processor:.1f} s of processors), {basins.cost.steps:,} periods; labels and "
        f"times {basins_memory(basins.labels.size) / 2**20:.1f} MiB, process at most {found.memory / 2**20:.0f} MiB"
    )


def colour(attractor: Attractor) -> str:
    """Return the colour of an attractor, the same in all images."""
    inner, outer, *_ = attractor.points[0]
    if attractor.kind is Kind.FIXED_POINT:
        return {(1, 1): "#FFFFFF", (1, -1): "#56B4E9", (-1, 1): "#E69F00", (-1, -1): "#000000"}[
            (int(np.sign(np.cos(inner))), int(np.sign(np.cos(outer))))
        ]
    if attractor.kind is Kind.ROTATING:
        if attractor.rotations[0] == attractor.rotations[1]:
            return "#009E73" if attractor.rotations[0] > 0 else "#CC79A7"
        return "#D55E00"
    return "#0072B2"


def draw(found: dict[str, Measured]) -> Figure:
    """Draw the slices."""
    slices = {title: found[title].basins for title in found if found[title].basins.grid is not None}
    del slices["at rest, 60 x 60"]
    figure, axes = plt.subplots(1, len(slices), figsize=(5.2 * len(slices), 5.4), layout="constrained")
    named: dict[str, str] = {}
    for ax, (title, basins) in zip(axes, slices.items(), strict=True):
        colours = {k: colour(a) for k, a in enumerate(basins.attractors)}
        plot.basins(basins, ax=ax, colours=colours, legend=False, show_attractors=title == "at rest")
        ax.set(title=title, aspect="equal")
        named |= {a.name: colours[k] for k, a in enumerate(basins.attractors)}
    patches = [Patch(facecolor=c, edgecolor="0.3", label=name) for name, c in named.items()]
    figure.legend(handles=patches, loc="outside lower center", ncols=3, fontsize="small")
    figure.suptitle("Double pendulum, 50 Hz, 6 mm, damping 10 /s: where it ends")
    return figure


def main(quick: bool, output: Path) -> None:
    """Compute, store and draw."""
    found = compute(100, 60, 1000) if quick else compute(1000, 500, 100_000)
    save_basins({title: m.basins for title, m in found.items()}, output / "flipping_basins.h5")
    figure = draw(found)
    figure.savefig(output / "flipping_basins.png", dpi=100)
    plt.close(figure)
