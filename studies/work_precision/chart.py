"""Time against error: the records that every part returns, their figures and their tables."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

_MARKERS = "osD^vP*Xh<>"


@dataclass(frozen=True)
class Run:
    """One piece of work: program or method, its setting, what it took, how far it was off, and what more is to say."""

    series: str
    setting: str
    seconds: float
    error: float
    more: str = ""


@dataclass(frozen=True)
class Chart:
    """Runs of the same work, with what `seconds` and `error` mean."""

    title: str
    seconds: str
    error: str
    runs: tuple[Run, ...]
    floor: float = 1e-17

    def draw(self, ax: Axes) -> None:
        """Draw seconds against error, a line for each series."""
        for number, name in enumerate(dict.fromkeys(r.series for r in self.runs)):
            runs = [r for r in self.runs if r.series == name]
            errors, seconds = [max(r.error, self.floor) for r in runs], [r.seconds for r in runs]
            ax.plot(errors, seconds, marker=_MARKERS[number % len(_MARKERS)], markersize=4, linewidth=1, label=name)
        ax.set(xscale="log", yscale="log", xlabel=self.error, ylabel=self.seconds, title=self.title)
        ax.title.set_fontsize("medium")
        ax.invert_xaxis()
        ax.grid(alpha=0.3)

    def table(self) -> str:
        """Return the runs as a Markdown table."""
        lines = [f"| {self.title} | setting | {self.seconds} | {self.error} | |", "|---|---|---|---|---|"]
        lines += [f"| {r.series} | {r.setting} | {r.seconds:.3g} | {r.error:.2g} | {r.more} |" for r in self.runs]
        return "\n".join(lines)


def draw_all(charts: Sequence[Chart]) -> Figure:
    """Draw charts side by side, three in a row, each with a legend."""
    rows = -(-len(charts) // 3)
    figure, axes = plt.subplots(rows, 3, figsize=(15.0, 4.6 * rows), squeeze=False, layout="constrained")
    for chart, ax in zip(charts, axes.flat, strict=False):
        chart.draw(ax)
        ax.legend(fontsize="x-small", framealpha=0.6)
    for ax in axes.flat[len(charts) :]:
        ax.set_visible(False)
    return figure


def best_seconds(work: Callable[[], Any], rounds: int) -> float:
    """Return the shortest wall time of several rounds, after one to warm up."""
    work()
    taken = []
    for _ in range(rounds):
        began = time.perf_counter()
        work()
        taken.append(time.perf_counter() - began)
    return min(taken)


def largest(errors: np.ndarray) -> float:
    """Return the largest error, infinite where an image is missing."""
    worst = float(np.abs(errors).max())
    return worst if np.isfinite(worst) else np.inf
