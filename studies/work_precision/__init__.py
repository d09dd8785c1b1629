"""What accuracy costs in time: the same work by several methods, seconds against error.

Exact maps against images in 80 bits, next to other programs where these are installed; interpolated maps of order 1, 3
and 5 against their size; basin images, wrong labels against seconds; plans and their outcome; exponents and dimensions
of known value.
Everything is measured in one run on one machine, which the page describes.
"""

from __future__ import annotations

import os
import platform
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import matplotlib.pyplot as plt

import cellmap

from . import basin_images, maps, measures, plans
from .chart import Chart, draw_all

PARTS: dict[str, tuple[str, Callable[[bool], list[Chart]]]] = {
    "exact_maps": ("Exact maps", maps.exact_maps),
    "tables": ("Tables", maps.tables),
    "basins": ("Basin images", basin_images.compare),
    "plans": ("Plans and what became of them", plans.outcomes),
    "measures": ("Exponents and dimensions", measures.compare),
}
"""Name of its figure, title and work of each part."""


def machine() -> str:
    """Describe the machine and the versions of what runs on it."""
    model = platform.processor() or platform.machine()
    if (info := Path("/proc/cpuinfo")).exists():
        names = [line.split(":")[1].strip() for line in info.read_text().splitlines() if line.startswith("model name")]
        model = names[0] if names else model
    packages = ", ".join(f"{name} {version(name)}" for name in ("numpy", "scipy", "numba", "cellmap-dynamics"))
    threads = f"{os.cpu_count()} cores, {cellmap.thread_count()} threads"
    return f"{model}, {threads}; Python {platform.python_version()}, {packages}"


def main(quick: bool, output: Path) -> None:
    """Measure everything, print and write tables, draw figures."""
    lines = [f"Measured on: {machine()}.", ""]
    print(lines[0])
    for name, (title, work) in PARTS.items():
        charts = work(quick)
        figure = draw_all(charts)
        figure.savefig(output / f"work_precision_{name}.png", dpi=100)
        plt.close(figure)
        tables = "\n\n".join(chart.table() for chart in charts)
        print(f"\n{title}\n\n{tables}", flush=True)
        lines += [f"### {title}", "", f"![{title}](work_precision_{name}.png)", "", tables, ""]
    (output / "work_precision.md").write_text("\n".join(lines), encoding="utf-8")
