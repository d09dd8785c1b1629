"""Where the boundary between two wells becomes fractal: Melnikov's criterion, manifolds, dimensions (Moon, Li 1985).

x'' + 0.15 x' - x (1 - x^2)/2 = f cos 0.8333 t.  To first order in damping and force, the distance between the stable
and the unstable manifold of the saddle between the wells is Melnikov's integral along the loop x = sqrt(2) sech(t/s) of
the oscillator without either, with s = sqrt(2).  It changes its sign from f_c = s/(3 pi) d cosh(pi w/s)/w on.  Three
measurements stand beside it: the force from which on the unstable manifold does enter the other well's basin, and the
dimension of the boundary between the wells against the force, by pairs of points and by boxes.  Attractors in the same
well count as one; above f = 0.1 they fill both wells, and the boundary between them is measured.

Must come out: f_c = 0.0881; a smooth boundary below, a fractal one above; dimension 1.776 +- 0.01 at f = 0.10.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import cosh, pi, sqrt, tanh
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from scipy.integrate import quad

from cellmap import Basins, CellGrid, find_basins, interpolated_map, periodic_orbit, plot, stroboscopic_map
from cellmap.analysis.fractal.uncertainty import uncertainty_exponent
from cellmap.analysis.fractal.uncertainty_fits import UncertaintyExponent
from cellmap.maps import jacobian
from systems import moon_li_duffing

from ._boundary import Boxes, box_counts

DAMPING, FREQUENCY = 0.15, 0.8333
FORCINGS = (0.02, 0.05, 0.07, 0.08, 0.086, 0.088, 0.0885, 0.089, 0.09, 0.092, 0.095, 0.098, 0.10, 0.105, 0.11)
QUICK_FORCINGS = (0.05, 0.08, 0.095, 0.10)
PUBLISHED = {0.10: (1.776, 0.01)}
WINDOW = CellGrid((-2.0, -2.0), (2.0, 2.0), (400, 400))
_BEGINNING = 1e-5  # of the piece of the unstable manifold, from the saddle


@dataclass(frozen=True, eq=False)
class Row:
    """One force: basins, and the dimension of the boundary between the wells in two ways."""

    forcing: float
    basins: Basins
    pairs: UncertaintyExponent
    boxes: Boxes


@dataclass(frozen=True, eq=False)
class Result:
    """Critical forces by formula, by quadrature and by the manifolds, and what was measured at each force."""

    formula: float
    quadrature: float
    tangency: tuple[float, float]
    rows: list[Row]


def critical_forcing(damping: float = DAMPING, frequency: float = FREQUENCY) -> float:
    """Return the force from which on Melnikov's function has zeros, by its closed form."""
    return sqrt(2.0) * damping * cosh(pi * frequency / sqrt(2.0)) / (3.0 * pi * frequency)


def critical_forcing_by_quadrature(damping: float = DAMPING, frequency: float = FREQUENCY) -> float:
    """Return the same from the integrals: damping times that of v^2, over the amplitude of that of v cos w(t + t0)."""

    def velocity(t: float) -> float:
        return -tanh(t / sqrt(2.0)) / cosh(t / sqrt(2.0))

    lost = quad(lambda t: velocity(t) ** 2, 0.0, 60.0, epsabs=1e-13)[0]
    gained = abs(quad(lambda t: velocity(t) * np.sin(frequency * t), 0.0, 60.0, epsabs=1e-13, limit=200)[0])
    return damping * lost / gained


def wells(basins: Basins) -> Callable[[np.ndarray], np.ndarray] | None:
    """Return a rule for the well in which points stay for ever; None where attractors are not each in one well."""
    sides = [np.unique(np.sign(a.points[:, 0])) for a in basins.attractors]
    regions = [a.neighbourhood for a in basins.attractors if a.neighbourhood is not None]
    if len(sides) <= 2 or any(len(s) > 1 for s in sides) or len(regions) < len(sides):
        return None

    def well(points: np.ndarray) -> np.ndarray:
        number = np.full(len(points), -1)
        for side, region in zip(sides, regions, strict=True):
            for centre, metric in zip(region.centres, region.metrics, strict=True):
                apart = points - centre
                number[np.einsum("ni,ij,nj->n", apart, metric, apart) <= 1.0] = int(side[0] > 0)
        return number

    return well


def merged(basins: Basins) -> np.ndarray:
    """Return the labels with all attractors of a well as one, where each attractor is in one well."""
    sides = [np.unique(np.sign(a.points[:, 0])) for a in basins.attractors]
    if any(len(s) > 1 for s in sides):
        return basins.labels
    return np.where(basins.labels >= 0, np.array([int(s[0] > 0) for s in sides])[basins.labels], basins.labels)


def wrong_side(forcing: float, points: int) -> int:
    """Count the points of the saddle's right unstable branch, on a piece from one to its image, that end in the left.

    As long as the manifolds do not cross, the right branch is in the basin of the right well, the stable manifold being
    its boundary.
    """
    strobe = stroboscopic_map(moon_li_duffing(DAMPING, forcing, FREQUENCY))
    # The motion on the hilltop to first order: x = Re(z exp(i w t)).
    z = forcing / complex(-(FREQUENCY**2) - 0.5, DAMPING * FREQUENCY)
    saddle = periodic_orbit(strobe, (z.real, -FREQUENCY * z.imag))
    multipliers, directions = np.linalg.eig(jacobian(strobe, saddle.points[0]))
    assert abs(saddle.points[0, 0]) < 0.2 and multipliers.real.max() > 1.0, "this is no saddle on the hilltop"
    stretch, direction = multipliers.real.max(), directions[:, np.argmax(multipliers.real)].real
    direction *= np.sign(direction[0])
    lengths = _BEGINNING * stretch ** np.linspace(0.0, 1.0, points, endpoint=False)
    found = find_basins(strobe, saddle.points[0] + lengths[:, None] * direction)
    left = [k for k, a in enumerate(found.attractors) if a.points[:, 0].mean() < 0.0]
    return int(np.isin(found.labels, left).sum())


def tangency(points: int, halvings: int) -> tuple[float, float]:
    """Bracket the force at which the manifolds of the saddle begin to cross."""
    low, high = 0.085, 0.095
    for _ in range(halvings):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if wrong_side(middle, points) else (middle, high)
    return low, high


def compute(
    forcings: Sequence[float],
    pairs: int,
    cells: int,
    lines: int,
    line_cells: int,
    side: int,
    points: int,
    halvings: int,
) -> Result:
    """Measure all."""
    rows = []
    grid = CellGrid(WINDOW.lower, WINDOW.upper, (cells, cells))
    for forcing in forcings:
        exact = stroboscopic_map(moon_li_duffing(DAMPING, forcing, FREQUENCY))
        table = CellGrid((-2.5, -2.5), (2.5, 2.5), (512, 512))
        basins = find_basins(interpolated_map(exact, table, outside="integrate"), grid)
        counted = uncertainty_exponent(basins, outcome=wells(basins), max_pairs=pairs, min_uncertain=1000)
        rows.append(Row(forcing, basins, counted, box_counts(basins, lines, line_cells, side, merged)))
        report_row(rows[-1])
    result = Result(critical_forcing(), critical_forcing_by_quadrature(), tangency(points, halvings), rows)
    report(result)
    return result


def report_row(row: Row) -> None:
    """Print what came out at one force."""
    p = row.pairs
    text = f"f = {row.forcing:.4f}, {len(row.basins.attractors)} attractors: {p.boundary_dimension:.4f} +- "
    text += (
        f"{p.standard_error:.4f} by {p.pairs.sum():,} pairs over {p.decades:.1f} decades ({p.verdict}); {row.boxes!r}"
    )
    known = PUBLISHED.get(row.forcing)
    print(text + (f"; must be {known[0]} +- {known[1]}" if known else ""), flush=True)


def report(result: Result) -> None:
    """Print the critical forces."""
    low, high = result.tangency
    print(f"Melnikov's critical force: {result.formula:.6f} by formula, {result.quadrature:.6f} by quadrature; 0.0881")
    off = 100.0 * (high / result.formula - 1.0)
    print(
        f"manifolds of the saddle cross from f = {high:.7f} on (bracket {high - low:.0e}), {off:+.2f} % off Melnikov's"
    )


def draw(result: Result) -> Figure:
    """Draw dimensions against the force, and two basin images, below and above the critical force."""
    figure, (panel, *images) = plt.subplots(1, 3, figsize=(15.0, 4.8), layout="constrained", width_ratios=(1.5, 1, 1))
    x = np.array([r.forcing for r in result.rows])
    pairs = np.array([(r.pairs.boundary_dimension, 2.0 * r.pairs.standard_error) for r in result.rows])
    boxes = np.array([(r.boxes.dimension, 2.0 * r.boxes.standard_error) for r in result.rows])
    panel.errorbar(x - 1e-4, *pairs.T, fmt="o", markersize=4, capsize=2, color="#0072B2", label="pairs of points")
    panel.errorbar(x + 1e-4, *boxes.T, fmt="s", markersize=4, capsize=2, color="#E69F00", label="boxes")
    panel.axvline(result.formula, color="0.4", linestyle="--", label=f"Melnikov: {result.formula:.4f}")
    panel.axvspan(*result.tangency, color="#D55E00", label=f"manifolds touch: {np.mean(result.tangency):.4f}")
    for forcing, (value, error) in PUBLISHED.items():
        panel.errorbar(forcing, value, error, fmt="s", color="black", markerfacecolor="none", label="reference")
    panel.axhline(1.0, color="0.7", linewidth=0.8)
    panel.set(xlabel="force f", ylabel="dimension of the boundary", ylim=(0.9, 2.05), title="Moon and Li's oscillator")
    panel.legend(fontsize="small")
    below = max((r for r in result.rows if r.forcing < result.formula), key=lambda r: r.forcing)
    above = min(result.rows, key=lambda r: abs(r.forcing - 0.10))
    for ax, row in zip(images, (below, above), strict=True):
        plot.basins(row.basins, ax=ax, legend=False)
        ax.set_title(f"f = {row.forcing:g}")
    return figure


def main(quick: bool, output: Path) -> None:
    """Compute and draw."""
    if quick:
        sizes = {"cells": 100, "lines": 4, "line_cells": 2**16, "side": 500}
        result = compute(QUICK_FORCINGS, pairs=60_000, points=1000, halvings=6, **sizes)
    else:
        sizes = {"cells": 400, "lines": 16, "line_cells": 2**17, "side": 2000}
        result = compute(FORCINGS, pairs=2_000_000, points=20_000, halvings=16, **sizes)
    figure = draw(result)
    figure.savefig(output / "melnikov.png", dpi=100)
    plt.close(figure)
