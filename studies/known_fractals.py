"""Sets whose dimensions are known, and what the library finds for them: computed, exact, error.

Point sets lie as they are built, shifted, and turned by an angle that has nothing to do with them; label images hold
sets as boundaries.  Must come out: every dimension within 0.01 of the exact one (Falconer, Fractal Geometry, 2003;
for the cascade Halsey et al., Physical Review A 33 (1986) 1141).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import log, pi, sqrt
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from cellmap import plot
from cellmap.analysis import Fit
from cellmap.analysis.fractal import boundary_dimension, box_dimension, generalized_dimensions

Points = NDArray[np.float64]

CANTOR, TRIANGLE, KOCH = log(2) / log(3), log(3) / log(2), log(4) / log(3)
WEIGHT = 0.3  # of the left part of the cascade
ANGLE = 0.5


@dataclass(frozen=True, eq=False)
class Row:
    """One line of the table."""

    name: str
    placed: str
    fit: Fit
    exact: float

    @property
    def error(self) -> float:
        """Computed minus exact dimension."""
        return self.fit.slope - self.exact


def line(n: int) -> Points:
    """Return equally spaced points on a line."""
    return np.stack([np.linspace(0.0, 1.0, n), np.zeros(n)], axis=1)


def square(n: int) -> Points:
    """Return a filled square, as a lattice."""
    x = (np.arange(n) + 0.5) / n
    return np.stack(np.meshgrid(x, x, indexing="ij"), axis=-1).reshape(-1, 2)


def cantor_line(level: int) -> Points:
    """Return the middle points of the intervals of Cantor's set after some divisions."""
    x = np.array([0.5])
    for _ in range(level):
        x = np.concatenate([x / 3.0, x / 3.0 + 2.0 / 3.0])
    return x


def cantor(level: int) -> Points:
    """Return Cantor's middle-third set, on a line in the plane."""
    x = cantor_line(level)
    return np.stack([x, np.zeros(len(x))], axis=1)


def cantor_square(level: int) -> Points:
    """Return the product of two Cantor sets."""
    x = cantor_line(level)
    return np.stack(np.meshgrid(x, x, indexing="ij"), axis=-1).reshape(-1, 2)


def copies(maps: list[tuple[Points, Points]], points: Points, level: int) -> Points:
    """Return the images of points under all chains of maps x -> A x + b."""
    for _ in range(level):
        points = np.concatenate([points @ a.T + b for a, b in maps])
    return points


def sierpinski(level: int) -> Points:
    """Return Sierpinski's triangle, by the corners of its parts."""
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, sqrt(3.0) / 2.0]])
    return copies([(np.eye(2) / 2.0, c / 2.0) for c in corners], corners, level)


def koch(level: int) -> Points:
    """Return Koch's curve, by the ends of its pieces, in their order."""
    rotations = [rotation_by(a) / 3.0 for a in (0.0, pi / 3.0, -pi / 3.0, 0.0)]
    ends = [[0.0, 0.0], [1.0 / 3.0, 0.0], [0.5, sqrt(3.0) / 6.0], [2.0 / 3.0, 0.0]]
    return copies([(a, np.array(b)) for a, b in zip(rotations, ends, strict=True)], np.zeros((1, 2)), level)


def rotation_by(angle: float) -> Points:
    """Return the matrix of a rotation."""
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def snowflake_labels(cells: int, level: int, angle: float = 0.0) -> NDArray[np.int16]:
    """Return the inside of Koch's snowflake, rotated, as 1 on an image of 0."""
    side = np.vstack([koch(level), [[1.0, 0.0]]])
    centre = np.array([0.5, -sqrt(3.0) / 6.0])
    outline = np.concatenate([(side - centre) @ rotation_by(-2.0 * pi * k / 3.0).T for k in range(3)])
    outline = (outline @ rotation_by(angle).T + 0.65) / 1.3 * cells - 0.5
    return filled(outline, cells)


def filled(outline: Points, cells: int) -> NDArray[np.int16]:
    """Return which cell centres, at whole numbers, a closed outline holds: each crossing to the left changes sides."""
    (x, y), (u, v) = outline.T, np.roll(outline, -1, axis=0).T
    first, last = np.ceil(np.minimum(y, v)).astype(int), np.ceil(np.maximum(y, v)).astype(int)
    edge = np.repeat(np.arange(len(x)), last - first)
    row = np.arange(len(edge)) - np.repeat(np.cumsum(last - first) - (last - first), last - first) + first[edge]
    crossing = x[edge] + (row - y[edge]) / (v - y)[edge] * (u - x)[edge]
    changes = np.zeros((cells + 1, cells), np.int16)
    np.add.at(changes, (np.clip(np.ceil(crossing).astype(int), 0, cells), row), 1)
    return np.asarray(np.cumsum(changes[:-1], axis=0) % 2, dtype=np.int16)


def sierpinski_labels(level: int) -> NDArray[np.int16]:
    """Return the odd numbers in Pascal's triangle."""
    i = np.arange(2**level)
    return ((i[:, None] & i[None, :]) == 0).astype(np.int16)


def cantor_labels(level: int, dimension: int) -> NDArray[np.int16]:
    """Return which of 3**level intervals hold Cantor's set, in as many dimensions."""
    one = np.ones(1, bool)
    for _ in range(level):
        one = np.concatenate([one, np.zeros(len(one), bool), one])
    label = one
    for _ in range(dimension - 1):
        label = label[..., None] & one
    return label.astype(np.int16)


def cascade(level: int) -> tuple[Points, Points]:
    """Return places and weights of a multiplicative measure on Cantor's set."""
    weights = np.ones(1)
    for _ in range(level):
        weights = np.concatenate([WEIGHT * weights, (1.0 - WEIGHT) * weights])
    return cantor_line(level)[:, None], weights


def cascade_dimension(q: float) -> float:
    """Return D_q of that measure."""
    p = np.array([WEIGHT, 1.0 - WEIGHT])
    if q == 1.0:
        return float(-(p * np.log(p)).sum() / log(3.0))
    return float(np.log((p**q).sum()) / (1.0 - q) / log(3.0))


def point_sets(quick: bool) -> dict[str, tuple[Callable[[], Points], float]]:
    """Return all point sets by name, with their dimensions."""
    return {
        "line": (lambda: line(100_001 if quick else 200_001), 1.0),
        "filled square": (lambda: square(1500 if quick else 3000), 2.0),
        "Cantor set": (lambda: cantor(14 if quick else 17), CANTOR),
        "Cantor set, squared": (lambda: cantor_square(9 if quick else 10), 2.0 * CANTOR),
        "Sierpinski triangle": (lambda: sierpinski(11 if quick else 13), TRIANGLE),
        "Koch curve": (lambda: koch(9 if quick else 10), KOCH),
    }


def images(quick: bool) -> dict[str, tuple[NDArray[np.int16], float, int | None]]:
    """Return label images by name, with the dimension of the boundary and how many samples a box takes (None: all)."""
    cells = 1024 if quick else 2048
    x = (np.arange(cells) + 0.5) / cells - 0.5
    stripes = np.repeat(cantor_labels(7, 1)[:, None], cells, axis=1)
    # The curve has structure below one cell, as boundaries of basins have.
    return {
        "straight boundary": ((x[:, None] < 0.3 * x + 0.1).astype(np.int16), 1.0, None),
        "disc": ((x[:, None] ** 2 + x**2 < 0.1).astype(np.int16), 1.0, None),
        "two labels at random": (np.random.default_rng(0).integers(0, 2, (cells, cells), np.int16), 2.0, None),
        "Cantor set, in 1-D": (cantor_labels(11 if quick else 13, 1), CANTOR, None),
        "Cantor stripes": (stripes, 1.0 + CANTOR, None),
        "Koch snowflake": (snowflake_labels(2 * cells, 8), KOCH, 2),
        "Koch snowflake, turned": (snowflake_labels(2 * cells, 8, ANGLE), KOCH, 2),
    }


def compute(quick: bool) -> list[Row]:
    """Measure all sets."""
    rows = []
    for name, (build, exact) in point_sets(quick).items():
        points = build()
        for placed, moved in (
            ("as built", points),
            ("shifted", points + np.array([0.1234, 0.777])),
            ("turned", points @ rotation_by(ANGLE).T),
        ):
            rows.append(Row(name, placed, box_dimension(moved, n_offsets=4).fit, exact))
    for name, (labels, exact, samples) in images(quick).items():
        rows.append(Row(name, "image", boundary_dimension(labels, lattice=samples, n_offsets=16).fit, exact))
    places, weights = cascade(12 if quick else 16)
    spectrum = generalized_dimensions(places, (0.0, 1.0, 2.0, 3.0), weights=weights)
    rows.extend(Row(f"cascade, D_{q:g}", "weights", fit, cascade_dimension(q)) for q, fit in spectrum)
    return rows


def report(rows: list[Row]) -> str:
    """Write the table as Markdown."""
    lines = ["| set | as | computed | exact | error |", "|---|---|---|---|---|"]
    for row in rows:
        found = f"{row.fit.slope:.4f} ± {row.fit.standard_error:.4f}"
        lines.append(f"| {row.name} | {row.placed} | {found} | {row.exact:.4f} | {row.error:+.4f} |")
    return "\n".join(lines) + "\n"


def draw(rows: list[Row]) -> Figure:
    """Draw the counts of the turned sets with their lines."""
    rotated = [row for row in rows if row.placed == "turned"]
    figure, axes = plt.subplots(2, 3, figsize=(13.0, 7.5), layout="constrained")
    for ax, row in zip(axes.flat, rotated, strict=True):
        plot.fit(row.fit, ax=ax)
        ax.set_title(f"{row.name}: exactly {row.exact:.4f}")
    return figure


def main(quick: bool, output: Path) -> None:
    """Compute, print, write and draw."""
    rows = compute(quick)
    table = report(rows)
    print(table, end="")
    print(f"largest error {max(abs(row.error) for row in rows):.4f} (must be below {0.03 if quick else 0.01})")
    (output / "known_fractals.md").write_text(table, encoding="utf-8")
    figure = draw(rows)
    figure.savefig(output / "known_fractals.png", dpi=100)
    plt.close(figure)
