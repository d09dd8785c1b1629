"""Dimension of the pendulum's basin boundary against the amplitude of its pivot.

Rod of 2.72 cm, 50 Hz, viscous damping 10 /s, angles over the circle and |theta'| <= 100 rad/s, as in figure 19 of the
report, whose amplitudes are 0 to 10 mm; here they go on through the loss of stability of the hanging state (12.210 mm)
and of the inverted one (12.543 mm).  At each amplitude the boundary between all basins is measured twice: by pairs of
initial conditions (uncertainty exponent, with binomial errors), and by boxes, on lines where these meet enough of it
and else in a basin image.  Below 2.329 mm only the hanging state is stable, and there is no boundary.

Must come out: smooth boundaries up to 4 mm; 1.75 to 1.83 at 10 mm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from cellmap import Basins, CellGrid, find_basins, interpolated_map, plot, stroboscopic_map
from cellmap.analysis.fractal.uncertainty import uncertainty_exponent
from cellmap.analysis.fractal.uncertainty_fits import FRACTAL, SMOOTH, UncertaintyExponent
from cellmap.bifurcations import critical_values
from systems import driven_pendulum

from ._boundary import Boxes, box_counts

AMPLITUDES = (
    *(0.0, 2.0, 2.4, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 8.5, 8.75, 9.0, 9.25, 9.5, 9.75, 10.0, 10.25, 10.5, 11.0, 11.5),
    *(12.0, 12.1, 12.2, 12.22, 12.3, 12.4, 12.5, 12.54, 12.55, 12.6, 12.8, 13.0),
)
"""Amplitudes in mm."""

QUICK_AMPLITUDES = (0.0, 4.0, 8.0, 10.0, 12.2, 12.6)
STATES = {"hanging": (0.0, 0.0), "inverted": (pi, 0.0)}
DRAWN = (4.0, 10.0, 12.2)
PUBLISHED = {10.0: (1.75, 1.83)}
WINDOW = 100.0
_TABLE = CellGrid((-pi, -1.5 * WINDOW), (pi, 1.5 * WINDOW), (512, 512))


@dataclass(frozen=True, eq=False)
class Row:
    """One amplitude (mm): basins, and the dimension of their boundary in two ways."""

    amplitude: float
    basins: Basins
    pairs: UncertaintyExponent
    boxes: Boxes


@dataclass(frozen=True, eq=False)
class Result:
    """All amplitudes, and those (mm) at which a state of rest gains or loses its stability."""

    rows: list[Row]
    changes: dict[str, list[float]]


def compute(
    amplitudes: Sequence[float], pairs: int, uncertain: int, cells: int, lines: int, line_cells: int, side: int
) -> Result:
    """Measure the boundary at all amplitudes."""
    rows = []
    for amplitude in amplitudes:
        exact = stroboscopic_map(driven_pendulum(amplitude=1e-3 * amplitude))
        icm = interpolated_map(exact, _TABLE, outside="integrate")
        basins = find_basins(icm, CellGrid((-pi, -WINDOW), (pi, WINDOW), (cells, cells)))
        measured = uncertainty_exponent(basins, max_pairs=pairs, min_uncertain=uncertain)
        rows.append(Row(amplitude, basins, measured, box_counts(basins, lines, line_cells, side)))
        report_row(rows[-1])
    changes = {
        name: [1e3 * c.value for c in critical_values(driven_pendulum(), state, "amplitude", 1e-4, 0.014)]
        for name, state in STATES.items()
    }
    result = Result(rows, changes)
    report(result)
    return result


def report_row(row: Row) -> None:
    """Print what came out at one amplitude."""
    pairs = row.pairs
    if pairs.fit is None:
        measured = pairs.verdict
    else:
        measured = f"{pairs.boundary_dimension:.4f} +- {pairs.standard_error:.4f} by {pairs.pairs.sum():,} pairs over "
        measured += f"{pairs.decades:.1f} decades ({pairs.verdict}); {row.boxes!r}"
    known = PUBLISHED.get(row.amplitude)
    must = f"; must be {known[0]} to {known[1]}" if known else ""
    print(f"A = {row.amplitude:5.2f} mm, {len(row.basins.attractors)} attractors: {measured}{must}", flush=True)


def report(result: Result) -> None:
    """Print what is said of the boundary at which amplitudes, and where states of rest change their stability."""
    for verdict in (SMOOTH, FRACTAL):
        found = [r.amplitude for r in result.rows if r.pairs.verdict == verdict]
        if found:
            print(f"{verdict} by pairs of initial conditions: {min(found):g} to {max(found):g} mm")
    for name, values in result.changes.items():
        print(f"{name} state gains or loses stability at {', '.join(f'{v:.6f}' for v in values)} mm")


def draw(result: Result) -> Figure:
    """Draw the dimension against the amplitude, and basins at three of them."""
    figure = plt.figure(figsize=(13.0, 8.0), layout="constrained")
    panels = figure.subplot_mosaic("aaa;bcd", height_ratios=(1.2, 1.0))
    main_panel = panels["a"]
    bounded = [r for r in result.rows if r.pairs.fit is not None]
    x = np.array([r.amplitude for r in bounded])
    pairs = np.array([(r.pairs.boundary_dimension, 2.0 * r.pairs.standard_error) for r in bounded])
    boxes = np.array([(r.boxes.dimension, 2.0 * r.boxes.standard_error) for r in bounded])
    main_panel.errorbar(
        x - 0.015, pairs[:, 0], pairs[:, 1], fmt="o", markersize=4, capsize=2, color="#0072B2", label="pairs of points"
    )
    main_panel.errorbar(
        x + 0.015, boxes[:, 0], boxes[:, 1], fmt="s", markersize=4, capsize=2, color="#E69F00", label="boxes"
    )
    for (name, values), style in zip(result.changes.items(), ("--", ":"), strict=True):
        for k, value in enumerate(values):
            label = f"{name} state gains or loses stability" if k == 0 else None
            main_panel.axvline(value, color="0.4", linestyle=style, linewidth=1.0, label=label)
    main_panel.axhline(1.0, color="0.7", linewidth=0.8)
    main_panel.set(xlabel="amplitude of the pivot (mm)", ylabel="dimension of the boundary", ylim=(0.9, 2.05))
    main_panel.set_title("Driven pendulum, 50 Hz: bars are two standard errors")
    main_panel.legend(fontsize="small", loc="upper left")
    for key, amplitude in zip("bcd", DRAWN, strict=True):
        row = result.rows[int(np.argmin([abs(r.amplitude - amplitude) for r in result.rows]))]
        plot.basins(row.basins, ax=panels[key], legend=False)
        panels[key].set_title(f"A = {row.amplitude:g} mm")
    return figure


def main(quick: bool, output: Path) -> None:
    """Compute and draw."""
    if quick:
        result = compute(QUICK_AMPLITUDES, pairs=60_000, uncertain=150, cells=100, lines=4, line_cells=2**13, side=500)
    else:
        result = compute(AMPLITUDES, pairs=1_000_000, uncertain=1000, cells=400, lines=16, line_cells=2**17, side=2000)
    figure = draw(result)
    figure.savefig(output / "boundary_dimension.png", dpi=100)
    plt.close(figure)
