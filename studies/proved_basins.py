"""Figure 19 of the report as theorems: what is proved of the basins of the driven pendulum.

Rod of 2.72 cm, 50 Hz, viscous damping 10 /s, over the circle and |theta'| <= 100 rad/s.  Labels of whole cells are
proved by interval arithmetic; what is drawn pale has no proof.  The areas are lower bounds, in rad^2/s.  For the
inverted state the study also proves that it exists and is stable for all amplitudes of an interval.

Must come out: no proved label differs from direct integration; with one split at least 98 % of the window at 4 mm (500
x 500 cells); areas that add up to no more than the window's; the inverted state stable from 3.0 to 3.1 mm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from cellmap import Basins, CellGrid, PointMap, find_basins, interpolated_map, plot, stroboscopic_map
from cellmap.basins import Proof, prove
from cellmap.orbits import ProvedOrbit, prove_orbit
from systems import dimensionless_parameters, dimensionless_pendulum

AMPLITUDES = (0.002, 0.003, 0.004, 0.010)
SPEED = 2.0 * pi * 50.0  # of the drive, the unit of velocities (rad/s)
WINDOW = 100.0 / SPEED
INTERVAL = (0.0030, 0.0031)  # of amplitudes, in metres
PIECES = 25  # into which it is cut


@dataclass(frozen=True, eq=False)
class Panel:
    """One amplitude: labels by direct integration, and what is proved."""

    amplitude: float
    direct: Basins
    proof: Proof

    @property
    def differing(self) -> int:
        """Number of proved labels that are not those of direct integration."""
        known = self.proof.labels >= 0
        return int(np.count_nonzero(self.proof.labels[known] != self.direct.labels[known]))


def compute(amplitudes: Sequence[float], cells: int, table: int) -> list[Panel]:
    """Find the basins at all amplitudes, and prove what can be proved."""
    panels = []
    grid = CellGrid((-pi, -WINDOW), (pi, WINDOW), (cells, cells))
    for amplitude in amplitudes:
        exact = _map(amplitude)
        reach = CellGrid((-pi, -1.5 * WINDOW), (pi, 1.5 * WINDOW), (table, table))
        basins = find_basins(interpolated_map(exact, reach), grid)
        direct = find_basins(exact, grid, attractors=basins.attractors)
        panels.append(Panel(amplitude, direct, prove(basins, progress=True)))
        report(panels[-1])
    return panels


def _map(amplitude: float) -> PointMap:
    return stroboscopic_map(dimensionless_pendulum(**_parameters(amplitude)))


def _parameters(amplitude: float) -> dict[str, float]:
    return dimensionless_parameters(length=0.0272, amplitude=amplitude, frequency=50.0, damping=10.0)


def report(panel: Panel) -> None:
    """Print what came out of a panel."""
    proof = panel.proof
    print(f"\nA = {1e3 * panel.amplitude:g} mm: {100 * proof.share:.2f} % of the window proved")
    for label, area in proof.areas.items():
        name, balls = proof.basins.label_name(label), proof.attractors.get(label)
        rate = "not proved to exist" if balls is None else f"contraction {balls.rate:.4f}"
        print(f"  {name}: at least {np.floor(10.0 * SPEED * area) / 10.0:.1f} rad^2/s, {rate}")
    print(f"  {panel.differing} proved labels differ from direct integration")


def inverted_states() -> list[ProvedOrbit]:
    """Prove the inverted state for all amplitudes of the interval, piece by piece."""
    ends = [_parameters(amplitude) for amplitude in INTERVAL]
    betas = np.linspace(ends[0]["beta"], ends[1]["beta"], PIECES + 1)
    found = []
    for low, high in zip(betas[:-1].tolist(), betas[1:].tolist(), strict=True):
        exact = stroboscopic_map(dimensionless_pendulum(**{**ends[0], "beta": 0.5 * (low + high)}))
        found.append(prove_orbit(exact, [[pi, 0.0]], {"beta": (low, high)}))
    return found


def draw(panels: Sequence[Panel]) -> Figure:
    """Draw what is proved, beside one another."""
    columns = min(2, len(panels))
    rows = -(-len(panels) // columns)
    figure, axes = plt.subplots(
        rows, columns, figsize=(7.5 * columns, 6.0 * rows), layout="constrained", sharey=True, squeeze=False
    )
    for ax, panel in zip(axes.flat, panels, strict=True):
        plot.proof(panel.proof, ax=ax)
        ax.set_title(f"A = {1e3 * panel.amplitude:g} mm: {np.floor(1e3 * panel.proof.share) / 10:.1f} % proved")
        ax.label_outer()
    return figure


def main(quick: bool, output: Path) -> None:
    """Compute, prove and draw."""
    panels = compute(AMPLITUDES[2:3] if quick else AMPLITUDES, cells=200 if quick else 500, table=256)
    states = inverted_states()
    low, high = INTERVAL
    radius = max(float(s.radii.max()) for s in states)
    stable = all(s.stable for s in states)
    print(
        f"\ninverted state for all amplitudes from {1e3 * low:g} to {1e3 * high:g} mm: "
        f"{'stable' if stable else 'stability not proved'}, within {radius:.1e} of (pi, 0)"
    )
    figure = draw(panels)
    figure.savefig(output / "proved_basins.png", dpi=100)
    plt.close(figure)
