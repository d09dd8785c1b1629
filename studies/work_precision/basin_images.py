"""Basin images: fractions of wrong labels against seconds, by direct integration and interpolated maps."""

from __future__ import annotations

import time
import warnings
from dataclasses import dataclass
from math import pi

import numpy as np

from cellmap import Basins, CellGrid, ForcedSystem, certify, find_basins, interpolated_map, stroboscopic_map
from cellmap.maps.coordinates import difference
from systems import dimensionless_pendulum, double_pendulum, driven_pendulum, two_well_duffing

from .chart import Chart, Run
from .problems import five_attractor_duffing

FINEST = 1e-13  # tolerance of the map whose labels are the reference


@dataclass(frozen=True)
class Scene:
    """A basin image: its system, its window, the window of interpolation, and the sizes of its grids."""

    title: str
    system: ForcedSystem
    grid: CellGrid
    reach: tuple[float, ...]
    sizes: tuple[int, ...] = (32, 64, 128, 256, 512)

    def at(self, cells: int) -> CellGrid:
        """Return the grid of a table with so many cells a side."""
        return CellGrid(tuple(-r for r in self.reach), self.reach, (cells,) * len(self.reach))


def scenes(cells: int) -> tuple[Scene, ...]:
    """Return all basin images, with `cells` cells a side."""

    def over(*window: float) -> CellGrid:
        return CellGrid(tuple(-w for w in window), window, (cells, cells))

    slice_ = CellGrid((-pi, -pi, -1.0, -1.0), (pi, pi, 1.0, 1.0), (cells // 2, cells // 2, 1, 1))
    inverted = dimensionless_pendulum(-0.1, 0.545, 0.2)
    return (
        Scene("smooth boundary (inverted pendulum)", inverted, over(pi, 4.0), (pi, 4.5)),
        Scene("fractal boundary (two-well Duffing)", two_well_duffing(), over(2.2, 2.2), (2.9, 2.9)),
        Scene("five-attractor Duffing", five_attractor_duffing(), over(1.0, 1.0), (1.6, 1.6)),
        Scene("dry friction", driven_pendulum(friction=20.0), over(pi, 60.0), (pi, 80.0), (64, 128, 256)),
        Scene("flipping modes (double pendulum)", double_pendulum(), slice_, (pi, pi, 150.0, 150.0), (16, 24)),
    )


def compare(quick: bool) -> list[Chart]:
    """Return a chart for each basin image."""
    chosen = scenes(60 if quick else 200)
    return [_chart(scene, quick) for scene in (chosen[:3] if quick else chosen)]


def _chart(scene: Scene, quick: bool) -> Chart:
    reference = find_basins(stroboscopic_map(scene.system, rtol=FINEST, atol=FINEST), scene.grid)
    runs = []
    for tolerance in (1e-3, 1e-6, 1e-9, 1e-12)[:: 2 if quick else 1]:
        exact = stroboscopic_map(scene.system, rtol=tolerance, atol=tolerance)
        exact(np.zeros((64, exact.dimension)))
        began = time.perf_counter()
        basins = find_basins(exact, scene.grid)
        runs.append(_run("direct", f"{tolerance:.0e}", time.perf_counter() - began, basins, reference))
    exact = stroboscopic_map(scene.system)
    for order in (1, 3, 5):
        for cells in scene.sizes[:2] if quick else scene.sizes:
            runs += _by_table(scene, exact, order, cells, reference)
    total = f"{reference.labels.size:,} orbits"
    return Chart(scene.title, f"s, {total}", "fraction of wrong labels", tuple(runs), 0.5 / reference.labels.size)


def _by_table(scene: Scene, exact: object, order: int, cells: int, reference: Basins) -> list[Run]:
    began = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of coarse grids, which are what is measured
        table = interpolated_map(exact, scene.at(cells), order=order, outside="integrate")  # type: ignore[arg-type]
    basins = find_basins(table, scene.grid)
    seconds = time.perf_counter() - began
    runs = [_run(f"table, order {order}", f"{cells} cells a side", seconds, basins, reference)]
    if order == 5 and table.dimension == 2:
        certificate = certify(basins, max_cost=float("inf"))
        seconds += certificate.cost.seconds
        run = _run("table, order 5, certified", f"{cells} cells a side", seconds, certificate.basins, reference)
        wrong = _numbers(certificate.basins, reference) != reference.labels
        kept = wrong & (certificate.evidence < 3)
        more = (
            f"{run.more}; {certificate.redone:,} redone, {certificate.open:,} open; wrong and not open: {kept.sum():,}"
        )
        runs.append(Run(run.series, run.setting, run.seconds, run.error, more))
    return runs


def _run(series: str, setting: str, seconds: float, basins: Basins, reference: Basins) -> Run:
    wrong = float((_numbers(basins, reference) != reference.labels).mean())
    errors = [np.mean(_numbers(basins, reference) == k) - f.fraction for k, f in reference.fractions.items()]
    found = f"{len(basins.attractors)} of {len(reference.attractors)} attractors"
    return Run(series, setting, seconds, wrong, f"{found}, fractions off by {100 * np.abs(errors).max():.2g} points")


def _numbers(basins: Basins, reference: Basins) -> np.ndarray:
    """Return labels by the numbers that the reference has for the attractors next to them; -9 for none."""
    number = {label: label for label in (-3, -2, -1)}
    for label, attractor in enumerate(basins.attractors):
        number[label] = -9
        for k, other in enumerate(reference.attractors):
            if (
                other.kind == attractor.kind
                and other.period == attractor.period
                and other.rotations == attractor.rotations
            ):
                apart = np.abs(difference(attractor.points[:1], other.points, basins.coordinates)).max(axis=-1).min()
                if apart < 1e-3 or not attractor.period:
                    number[label] = k
    keys = np.array(sorted(number))
    return np.array([number[k] for k in keys])[np.searchsorted(keys, basins.labels)]
