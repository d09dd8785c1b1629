"""Figure 19 of the report: basins of the driven pendulum at five amplitudes of the pivot.

Rod of 2.72 cm, 50 Hz, viscous damping 10 /s, 500 x 500 initial conditions over the circle and |theta'| <= 100 rad/s,
and over |theta'| <= 500 rad/s where rotations have basins too.  Each basin image is computed by interpolated cell
mapping twice: orbits that leave the window have escaped (the report's grey), or are continued with the exact map.
Direct integration of the same initial conditions gives the number of wrong labels.

Must come out (tests/REFERENCES.md): on 200 x 200 cells and |theta'| <= 100, hanging / inverted 40000 / 0 at 2 mm
and 32896 / 7104 at 3 mm; boundaries are smooth up to 4 mm and fractal at 10 mm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from cellmap import Attractor, Basins, CellGrid, find_basins, interpolated_map, plot, save_basins, stroboscopic_map
from cellmap.orbits import Kind
from systems import driven_pendulum

from ._unsettled import unsettled_basins

AMPLITUDES = (0.0, 0.002, 0.003, 0.004, 0.010)
WINDOWS = (100.0, 500.0)


@dataclass(frozen=True, eq=False)
class Panel:
    """One amplitude in one window: basins with orbits lost, with none lost, and by direct integration."""

    amplitude: float
    window: float
    lost: Basins
    kept: Basins
    direct: Basins
    tabulation: float

    @property
    def wrong(self) -> float:
        """Fraction of the labels that differ from those of direct integration."""
        return float((self.kept.labels != self.direct.labels).mean())


def compute(cells: int, table: int) -> list[Panel]:
    """Find the basins of all panels."""
    panels = []
    for window in WINDOWS:
        grid = CellGrid((-pi, -window), (pi, window), (cells, cells))
        nodes = CellGrid((-pi, -window), (pi, window), (table, table))
        for amplitude in AMPLITUDES:
            exact = stroboscopic_map(driven_pendulum(amplitude=amplitude))
            direct = find_basins(exact, grid, progress=True)
            losing = interpolated_map(exact, nodes, outside="escape")
            keeping = interpolated_map(exact, nodes, outside="integrate")
            panels.append(
                Panel(
                    amplitude,
                    window,
                    unsettled_basins(losing, grid, attractors=direct.attractors),  # it is drawn how many escape
                    find_basins(keeping, grid),
                    direct,
                    keeping.cost.seconds,
                )
            )
            report(panels[-1])
    return panels


def report(panel: Panel) -> None:
    """Print what came out of a panel."""
    kept, direct = panel.kept, panel.direct
    print(f"\nA = {1e3 * panel.amplitude:g} mm, |theta'| <= {panel.window:g} rad/s")
    for label, fraction in kept.fractions.items():
        fractions = f"{100 * fraction.fraction:8.4f} +- {100 * fraction.standard_error:.4f} %"
        print(f"  {fractions}  {repr(kept.attractors[label]) if label >= 0 else kept.label_name(label)}")
    escaped = panel.lost.fractions.get(-1)
    print(f"  escaped: {100 * escaped.fraction if escaped else 0.0:.3f} % of the orbits, where they are not continued")
    print(
        f"  {panel.tabulation:.3f} s to interpolate and check, {kept.cost.seconds:.3f} s to label; directly "
        f"{direct.cost.seconds:.3f} s; {100 * panel.wrong:.4f} % of the labels differ"
    )


def draw(panels: Sequence[Panel], window: float) -> Figure:
    """Draw one window: above with the orbits that leave the window in grey, below with all of them continued."""
    row = [p for p in panels if p.window == window]
    figure, axes = plt.subplots(
        2, len(row), figsize=(3.0 * len(row), 6.2), layout="constrained", sharex=True, sharey=True, squeeze=False
    )
    for column, panel in enumerate(row):
        for ax, basins in zip(axes[:, column], (panel.lost, panel.kept), strict=True):
            colours = {k: _colour(a) for k, a in enumerate(basins.attractors)}
            plot.basins(basins, ax=ax, colours=colours, legend=False, show_attractors=basins is panel.kept)
            ax.set_title(f"A = {1e3 * panel.amplitude:g} mm")
            ax.label_outer()
    figure.suptitle(
        "Driven pendulum, 50 Hz: hanging white, inverted black, rotations blue and orange, others green, lost grey"
    )
    return figure


def _colour(attractor: Attractor) -> str:
    if attractor.kind is Kind.FIXED_POINT:
        return "white" if np.cos(attractor.points[0, 0]) > 0 else "black"
    if attractor.kind is Kind.ROTATING:
        return "#0072B2" if attractor.rotations[0] > 0 else "#E69F00"
    return "#009E73"


def main(quick: bool, output: Path) -> None:
    """Compute, store and draw."""
    panels = compute(cells=100 if quick else 500, table=128 if quick else 512)
    images = {}
    for panel in panels:
        place = f"{1e3 * panel.amplitude:g} mm, {panel.window:g} rad per s"
        images[f"{place}, lost"] = panel.lost
        images[f"{place}, kept"] = panel.kept
    save_basins(images, output / "figure_19.h5")
    for window in WINDOWS:
        figure = draw(panels, window)
        figure.savefig(output / f"figure_19_{window:g}.png", dpi=100)
        plt.close(figure)
