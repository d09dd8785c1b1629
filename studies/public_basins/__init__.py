"""Basins of a public collection, with default arguments: 56 multistable systems from Wagemakers' "The Basins Zoo".

Flows and maps from mechanics, optics, electronics, biology and economy, of two to nine dimensions, with basins that
are smooth, fractal, riddled, intermingled or have Wada boundaries (Wagemakers, arXiv 2504.01580, with the programs of
https://github.com/awage/BasinsCollection).  Formulas, parameters and windows are those of the collection; a flow
without a drive is looked at in equal intervals.  No argument of `find_basins` is chosen but a limit of time.  For each
system there are the attractors found, what is undecided and why, and the time beside that of following as many orbits
without asking where they end.

Must come out: the number of attractors where it is known from symmetry, a closed form or the paper, in parentheses;
fractions of nine systems, to three standard errors of what SciPy or plain iteration gives.
"""

from __future__ import annotations

import time
import warnings
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from math import ceil, isnan, nan, sqrt
from pathlib import Path
from textwrap import fill

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from cellmap import Basins, Label, find_basins, plot

from . import autonomous, discrete, forced
from .case import Case

CASES = {
    case.name: case for room in (forced, autonomous, discrete) for case in vars(room).values() if isinstance(case, Case)
}
"""All systems by name."""

TELLING = (
    *("duffing", "pendulum", "genetic_switch", "slim_fractal", "duopoly", "forced_logistic", "grebogi", "weak_henon"),
    *("triopoly", "sporadical"),
)
"""Systems whose attractors are known, and fractions of all but one, at the least cost."""

LIMIT = 60.0  # seconds for each system


@dataclass(frozen=True, eq=False)
class Row:
    """Basins of a case, and the processor seconds that they took, and plain iteration of as many periods."""

    case: Case
    basins: Basins
    seconds: float
    iteration: float

    @property
    def kinds(self) -> Counter[str]:
        """How many attractors there are of each kind, and how many ends."""
        ends = Counter({"end": sum(label <= Label.ENDED for label in self.basins.fractions)})
        return Counter(str(attractor.kind) for attractor in self.basins.attractors) + ends

    def percent(self, *labels: Label) -> float:
        """Return how many of the initial conditions have one of some labels."""
        return 100.0 * float(np.isin(self.basins.labels, labels).mean())

    @property
    def ratio(self) -> float:
        """Processor seconds beside those of plain iteration; NaN where the limit of time came before all labels."""
        return self.seconds / self.iteration if self.iteration else nan

    @property
    def deviation(self) -> float:
        """Largest difference of a fraction from the known one, in standard errors of both samples; NaN without."""
        size, known = self.basins.labels.size, np.sort(self.case.counts) / max(self.case.orbits, 1)
        counts = [part.count for label, part in self.basins.fractions.items() if label >= 0 or label <= Label.ENDED]
        if not known.size or known.size != len(counts):
            return nan
        errors = np.sqrt(known * (1.0 - known) * (1.0 / size + 1.0 / self.case.orbits))
        return float((np.abs(np.sort(counts) / size - known) / errors).max())

    @property
    def reason(self) -> str:
        """Most frequent reason for what is undecided."""
        if self.percent(Label.UNLABELLED):
            return "not done within the limit of time"
        return max(self.basins.undecided, key=self.basins.undecided.__getitem__, default="")


def measured(case: Case, cells: int, limit: float = LIMIT) -> Row:
    """Find the basins of a case with default arguments."""
    point_map, initial_conditions = case.make(), case.initial_conditions(cells)
    with warnings.catch_warnings(action="ignore"):  # the table says what warnings do
        find_basins(point_map, np.reshape(_states(case, 2), (-1, point_map.dimension))[:1], max_periods=100)
        began = time.process_time()
        basins = find_basins(point_map, initial_conditions, max_seconds=limit)
        found = time.process_time()
        point_map.iterate(_states(case, cells), 10)
    return Row(case, basins, found - began, (time.process_time() - found) * basins.cost.steps / basins.labels.size / 10)


def _states(case: Case, cells: int) -> np.ndarray:
    """Return initial conditions as an array."""
    places = case.initial_conditions(cells)
    return places if isinstance(places, np.ndarray) else places.centres()


def compute(cases: Iterable[Case], cells: int, limit: float = LIMIT) -> list[Row]:
    """Find the basins of all cases, and tell of each."""
    print("s: processor seconds; ratio: to following as many periods; off: from known fractions, in standard errors")
    print("system                undecided   gone      s  ratio  off  attractors; what is known; why undecided")
    rows = []
    for case in cases:
        rows.append(measured(case, cells, limit))
        report(rows[-1])
    return rows


def report(row: Row) -> None:
    """Print what came out of a case."""
    case = row.case
    undecided = row.percent(Label.UNDECIDED, Label.UNLABELLED, Label.OUT_OF_STEPS)
    found = ", ".join(f"{number} {kind}" for kind, number in row.kinds.items())
    known = f"{case.published}{'' if case.attractors is None else f' ({case.attractors})'}"
    print(
        f"{case.name:21} {undecided:8.2f} % {row.percent(Label.DIVERGED):4.0f} % {row.seconds:6.1f} "
        f"{_dashed(row.ratio, 6)} {_dashed(row.deviation, 4)}  {'; '.join(filter(None, (found, known, row.reason)))}",
        flush=True,
    )


def _dashed(value: float, width: int) -> str:
    """Return a number, or a dash where it is not known."""
    return f"{'-' if isnan(value) else f'{value:.1f}':>{width}}"


def draw(rows: list[Row]) -> Figure:
    """Draw the basins of all cases."""
    columns = ceil(sqrt(len(rows)))
    lines = -(-len(rows) // columns)
    figure, axes = plt.subplots(
        lines, columns, figsize=(1.9 * columns, 2.15 * lines), layout="constrained", squeeze=False
    )
    for ax in axes.flat[len(rows) :]:
        ax.set_axis_off()
    for ax, row in zip(axes.flat, rows, strict=False):
        plot.basins(row.basins, ax=ax, legend=False, show_attractors=False, plane=row.case.plane)
        ax.set(xlabel="", ylabel="", xticks=[], yticks=[])
        ax.set_title(fill(row.case.title, 24), fontsize=7.0)
    return figure


def main(quick: bool, output: Path) -> None:
    """Compute, print and draw; quickly those whose numbers are known."""
    rows = compute([CASES[name] for name in TELLING], 40) if quick else compute(CASES.values(), 100)
    figure = draw(rows)
    figure.savefig(output / "public_basins.png", dpi=90)
    plt.close(figure)
