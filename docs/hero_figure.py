"""Draw the figures of the README: ``python docs/hero_figure.py``, which takes some ten seconds."""

from __future__ import annotations

import io
import re
from math import pi
from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.figure import Figure
from PIL import Image

from cellmap import Basins, CellGrid, find_basins, find_periodic_orbits, interpolated_map, plot, stroboscopic_map
from cellmap.analysis.boundary import Manifold, saddle_manifold
from systems import driven_pendulum

HERE = Path(__file__).parent
WIDTH, HEIGHT = 1200, 480
HANGING, INVERTED, SWING, LEFT, RIGHT = "#12355b", "#f2a541", "#2a9d8f", "#8ecae6", "#d1495b"


def compute() -> tuple[Basins, list[Manifold]]:
    """Find the basins at an amplitude of 10 mm, and the unstable manifolds of two saddles."""
    strobe = stroboscopic_map(driven_pendulum(amplitude=0.010))
    window = CellGrid((-pi, -290.0), (pi, 290.0), (WIDTH, HEIGHT))
    nodes = CellGrid((-pi, -600.0), (pi, 600.0), (800, 800))
    saddles = [o for o in find_periodic_orbits(strobe, window) if o.kind == "saddle" and abs(o.points[0, 1]) < 50.0]
    unstable = [saddle_manifold(strobe, o, "unstable", window, length=14.0) for o in saddles]
    return find_basins(interpolated_map(strobe, nodes), window), unstable


def colours(basins: Basins) -> dict[int, str]:
    """Choose a colour for each attractor by its winding number, period and angle."""
    chosen = {}
    for label, attractor in enumerate(basins.attractors):
        winding = float(attractor.rotation_number[0])
        resting = INVERTED if abs(attractor.points[0, 0]) > 1.0 else HANGING
        chosen[label] = (RIGHT if winding > 0 else LEFT) if winding else (resting if attractor.period == 1 else SWING)
    return chosen


def main() -> None:
    """Draw the basins without a frame, and what the first program draws."""
    basins, unstable = compute()
    figure = plt.figure(figsize=(WIDTH / 100, HEIGHT / 100), dpi=100)
    ax = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    plot.basins(basins, ax=ax, colours=colours(basins), legend=False, show_attractors=False)
    plot.manifolds(unstable, ax=ax, width=0.8)
    for line in ax.lines:
        line.set_color("white")
    ax.get_legend().remove()
    ax.set_axis_off()
    ax.set(title="", xlim=(-pi, pi), ylim=(-290.0, 290.0))
    store(figure, "basins.png", 24)
    draw_first_program()


def draw_first_program() -> None:
    """Run the first program of the README, and store what it draws."""
    text = (HERE.parent / "README.md").read_text(encoding="utf-8")
    plt.close("all")
    exec(re.search(r"^```python\n(.*?)^```", text, re.DOTALL | re.MULTILINE)[1], {"__name__": "__main__"})
    store(plt.gcf(), "first_program.png", 12)


def store(figure: Figure, name: str, colours: int) -> None:
    """Store a figure with few colours."""
    file = io.BytesIO()
    figure.savefig(file)
    image = Image.open(file).convert("P", palette=Image.Palette.ADAPTIVE, colors=colours)
    image.save(HERE / "_static" / name, optimize=True)


if __name__ == "__main__":
    main()
