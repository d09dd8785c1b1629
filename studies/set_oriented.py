"""Sets of boxes: Henon's attractor with manifolds, a cycle of six sets, and all that recurs in a driven pendulum.

Must come out: boxes that cover Henon's attractor (2775 boxes of 1024 a side on [-3, 3]^2 hold it); six eigenvalues of
the transfer operator of z' = exp(-2 pi i / 3) ((abs(z)^2 - 1.7) z + conj(z)^2 / 2) at the sixth roots of unity
(Dellnitz and Junge, SIAM Journal on Numerical Analysis 36, 1999, 491), to four digits; for the forced pendulum
theta'' + 0.2 theta' + sin theta = 2 cos t both attracting fixed points, each in an attracting Morse set of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, pi, sin
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from cellmap import CellGrid, discrete_map, periodic_orbit, plot, stroboscopic_map
from cellmap.sets import (
    BoxSet,
    MorseGraph,
    TransferOperator,
    morse_graph,
    relative_attractor,
    stable_set,
    transfer_operator,
    unstable_set,
)
from systems import forced_pendulum, henon_map

FIXED_POINTS = [(-0.4728, 2.0371), (-0.4782, -0.6082)]


def cyclic(x: Sequence[float], p: Any) -> tuple[float, float]:
    u, v = x
    grown = u * u + v * v - 1.7
    a, b = grown * u + 0.5 * (u * u - v * v), grown * v - u * v
    c, s = cos(2 * pi / 3), -sin(2 * pi / 3)
    return c * a - s * b, s * a + c * b


def henon_sets(depth: int) -> tuple[BoxSet, BoxSet, BoxSet, int]:
    """Return cover of the attractor, both manifolds of the saddle on it, and how many boxes an orbit misses."""
    henon = henon_map()
    window = CellGrid((-3, -3), (3, 3), (1, 1))
    saddle = periodic_orbit(henon, [0.6, 0.2]).points
    cover = relative_attractor(henon, window, depth)
    orbit = henon.orbit([[0.1, 0.1]], 100_000).points[100:, 0]
    missed = len(BoxSet.of_points(cover.grid, orbit) - cover)
    return cover, unstable_set(henon, saddle, cover.grid), stable_set(henon, saddle, window, depth), missed


def cycle_operator(depth: int) -> TransferOperator:
    point_map = discrete_map(cyclic, {}, ("x", "y"), name="cycle of six sets")
    boxes = relative_attractor(point_map, CellGrid((-1.5, -1.5), (1.5, 1.5), (4, 4)), depth)
    return transfer_operator(boxes, point_map, samples=6)


def pendulum_graph(depth: int) -> MorseGraph:
    point_map = stroboscopic_map(forced_pendulum())
    return morse_graph(point_map, CellGrid((-pi, -4), (pi, 4), (16, 16)), depth, samples=6)


def draw(henon: tuple[BoxSet, ...], operator: TransferOperator, graph: MorseGraph, where: Path) -> None:
    figure, axes = plt.subplots(2, 2, figsize=(10, 9), layout="constrained")
    cover, unstable, stable = henon
    plot.boxes(stable, names=("x", "y"), ax=axes[0, 0], facecolor="#E69F00", label="stable manifold")
    plot.boxes(cover, names=("x", "y"), ax=axes[0, 0], facecolor="0.8", label="relative attractor")
    plot.boxes(unstable, names=("x", "y"), ax=axes[0, 0], facecolor="#0072B2", label="unstable manifold")
    axes[0, 0].set(xlim=(-2, 2), ylim=(-2, 2), title="Henon's map")
    axes[0, 0].legend(loc="lower right")
    plot.eigenvector(operator, index=1, ax=axes[0, 1])
    axes[0, 1].set(aspect="equal", title="second eigenvector, a cycle of six sets")
    plot.eigenvalues(operator, n_eigenvalues=12, ax=axes[1, 0])
    plot.morse_graph(graph, ax=axes[1, 1])
    axes[1, 1].set(title="Morse sets of the forced pendulum")
    figure.savefig(where, dpi=120)
    plt.close(figure)


def main(quick: bool, output: Path) -> None:
    *henon, missed = henon_sets(8 if quick else 10)
    print(f"Henon: {henon[0]} cover the relative attractor; boxes of an orbit that are missed: {missed} (must be 0)")
    operator = cycle_operator(4 if quick else 5)
    roots = np.exp(2j * pi * np.arange(6) / 6)
    off = np.abs(operator.cycle(6).eigenvalues - roots).max()
    print(f"Cycle of six sets: eigenvalues within {off:.1e} of the sixth roots of unity (must be below 1e-4)")
    graph = pendulum_graph(4 if quick else 6)
    holders = [k for point in FIXED_POINTS for k, boxes in enumerate(graph.sets) if boxes.contains(point)]
    print(f"Forced pendulum: {graph}; fixed points in the sets {holders}, attracting are {list(graph.sinks)}")
    draw(tuple(henon), operator, graph, output / "set_oriented.png")
