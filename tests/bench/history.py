"""CPU seconds of a few jobs at this commit, added to ``docs/bench_history.csv``, and a figure of all commits.

``python tests/bench/history.py`` takes half a minute.  Times are the least of some repetitions, on one thread, divided
by that of a loop of NumPy on the same machine in the same minute.  Differences of a tenth are noise.
"""

from __future__ import annotations

import csv
import os
import subprocess
import sys
import time
from collections.abc import Callable
from datetime import date
from math import cos, pi
from pathlib import Path

import matplotlib as mpl
import numpy as np

import cellmap
from cellmap import (
    CellGrid,
    ForcedSystem,
    bifurcation_diagram,
    discrete_map,
    find_basins,
    interpolated_map,
    lyapunov_spectrum,
    set_threads,
    stroboscopic_map,
)

mpl.use("Agg")
import matplotlib.pyplot as plt

ROOT = Path(__file__).parents[2]
LIBRARY = Path(cellmap.__file__).parents[1]
"""Of another commit, where ``PYTHONPATH`` names its folder."""

TABLE = ROOT / "docs" / "bench_history.csv"
FIGURE = ROOT / "docs" / "_static" / "bench_history.svg"
COLUMNS = ["commit", "date", "job", "unit_s", "ratio"]


def duffing() -> ForcedSystem:
    def rhs(t, x, p):
        return x[1], x[0] - x[0] ** 3 - p.delta * x[1] + p.gamma * cos(p.omega * t)

    return ForcedSystem(rhs, {"delta": 0.15, "gamma": 0.2, "omega": 1.0}, 2 * pi, ("q", "v"), name="Duffing")


def jobs() -> dict[str, Callable[[], object]]:
    strobe, grid = stroboscopic_map(duffing()), CellGrid((-2.2, -2.2), (2.2, 2.2), (150, 150))
    icm, points = interpolated_map(strobe, grid), grid.centres().reshape(-1, 2)[::20]
    logistic = discrete_map(lambda x, p: (p.r * x[0] * (1 - x[0]),), {"r": 3.5}, ("x",))
    values = np.linspace(2.8, 4.0, 400)
    program = "from cellmap import CellGrid, find_basins, interpolated_map, stroboscopic_map"
    return {
        "import": lambda: subprocess.run([sys.executable, "-c", program], cwd=LIBRARY, check=True),
        "exact images": lambda: strobe.iterate(points, 20),
        "interpolated map": lambda: interpolated_map(strobe, grid),
        "labels, interpolated": lambda: find_basins(icm, grid),
        "labels, exact": lambda: find_basins(strobe, CellGrid(grid.lower, grid.upper, (50, 50))),
        "exponents": lambda: lyapunov_spectrum(strobe, points[:200], 100),
        "bifurcation diagram": lambda: bifurcation_diagram(logistic, "r", values, [0.3], follow="none"),
    }


def seconds(job: Callable[[], object], repetitions: int = 2) -> float:
    """Return the CPU seconds of a job and its children, the least of some repetitions."""
    found = []
    for _ in range(repetitions):
        begin = sum(time_of() for time_of in CLOCKS)
        job()
        found.append(sum(time_of() for time_of in CLOCKS) - begin)
    return min(found)


def children() -> float:
    return os.times().children_user + os.times().children_system


CLOCKS = (time.process_time, children)


def unit() -> float:
    """Return the CPU seconds of sums and sines of a fixed number of floats."""
    x = np.linspace(0.0, 1.0, 200_000)
    return seconds(lambda: [np.sin(x + k).sum() for k in range(40)], 5)


def measure() -> list[dict[str, str]]:
    """Return the rows of this commit."""
    set_threads(1)
    commit = subprocess.run(
        ["git", "-C", str(Path(cellmap.__file__).parent), "log", "-1", "--format=%h %cs"],
        capture_output=True,
        text=True,
    ).stdout.split() or ["unknown", date.today().isoformat()]
    rows = []
    for name, job in jobs().items():
        job()  # compiles
        one = unit()
        rows.append(dict(zip(COLUMNS, [*commit, name, f"{one:.4f}", f"{seconds(job) / one:.3g}"], strict=True)))
    return rows


def draw(rows: list[dict[str, str]]) -> None:
    """Draw the ratios of all commits, relative to the first of each job."""
    commits = list(dict.fromkeys(row["commit"] for row in rows))
    _, ax = plt.subplots(figsize=(7.5, 3.6), layout="constrained")
    for job in dict.fromkeys(row["job"] for row in rows):
        own = [row for row in rows if row["job"] == job]
        first = float(own[0]["ratio"])
        ax.plot(
            [commits.index(row["commit"]) for row in own], [float(row["ratio"]) / first for row in own], "o-", label=job
        )
    ax.set(yscale="log", ylabel="time, first commit = 1")
    ax.set_xticks(range(len(commits)), commits, rotation=30, ha="right", fontsize="small")
    ax.legend(fontsize="small", ncols=2, frameon=False)
    plt.rcParams["svg.hashsalt"] = "cellmap"
    plt.savefig(FIGURE, metadata={"Date": None})


if __name__ == "__main__":
    known = list(csv.DictReader(TABLE.open(encoding="utf-8"))) if TABLE.exists() else []
    new = measure()
    rows = [row for row in known if row["commit"] != new[0]["commit"]] + new
    with TABLE.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    draw(rows)
    for row in new:
        print(f"{row['job']:22} {row['ratio']:>7} x {row['unit_s']} s")
