"""Figure 17 of the report: least amplitude that keeps the inverted state, over frequency, for its two rods.

Twice: where the Floquet multipliers of the inverted state come inside the unit circle, and by simulation as in the
report, where a release at rest 0.05 rad from upright, with the pivot at its highest, has not fallen by pi/2 after
some cycles.  All frequencies and amplitudes are simulated in one batch, and brackets cut together.

Damping is 2.5, twice: viscous (1/s), where the two must agree but for the finite angle and the finite time, and dry
(rad/s^2), which fits the measured decay of the 6.9 cm rod.  With dry friction there are no multipliers, for a rod
sticks within a small angle of upright; the undamped ones are the reference.  The friction of the 3.1 cm rod is not
known, and taken to be the same angular deceleration.  Below 5 Hz the range of amplitudes that hold the state gets so
narrow that a release may miss it, and find none, or a swing about upright at a larger amplitude.

White dots over the curve of the short rod are measured points, 15 to 35 Hz as in the report: of a synthetic experiment,
in which the drive is raised by 2 % at a time until a release stays up, and its amplitude read off a noisy record of an
accelerometer.  Where a file figure_17_measured.csv stands beside this one, with a heading frequency_hz,amplitude_mm or
frequency_hz,amplitude_mm,amplitude_error_mm, its points are drawn as well.  A second figure has the dots over the map
of stability of the inverted state.

Must come out: sqrt(2 g l)/w at high frequencies, sqrt(6.9/3.1) times as much for the long rod as for the short one;
by averaging, a release from 0.05 rad that is given time needs 0.0625 % more than the multipliers say; and the synthetic
points agree with the curve of the multipliers within their errors, by chi-square.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, pi
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from cellmap import ForcedSystem, PointMap, plot, stability_map, stroboscopic_map
from cellmap.bifurcations import StabilityMap, critical_values
from cellmap.maps import swept_map
from systems import LONG_ROD, SHORT_ROD, driven_pendulum
from systems.lab import (
    BoundaryComparison,
    StabilityPoints,
    compare_with_boundary,
    measure_least_amplitudes,
    read_stability_points,
)
from systems.synthetic.stability_experiment import stays_up

MEASURED = Path(__file__).parent / "figure_17_measured.csv"
RANGE = (15.0, 35.0)  # Hz, of the report's measurements
GRAVITY = 9.8
RELEASE = 0.05  # rad from upright
FINITE_ANGLE = cos(RELEASE) ** -0.5 - 1.0  # by averaging, how much more amplitude puts the barrier beyond the release
RATIOS = np.linspace(0.5, 2.5, 129)  # of the amplitudes tried, to sqrt(2 g l)/w
PARTS, ROUNDS = 16, 5  # brackets of the ratio are cut to 2e-8
FRICTIONS = {"viscous": {"damping": 2.5}, "dry": {"damping": 0.0, "friction": 2.5}}
RODS = {"6.9 cm": LONG_ROD, "3.1 cm": SHORT_ROD}
MEASURED_ROD = "3.1 cm"
STEP = 0.02  # by which the drive is raised in the synthetic experiment


@dataclass(frozen=True, eq=False)
class Curve:
    """Least amplitudes (m) of one rod with one kind of friction: by multipliers, and by release for each hold."""

    rod: str
    friction: str
    frequencies: NDArray[np.float64]
    floquet: NDArray[np.float64]
    released: dict[int, NDArray[np.float64]]


def compute(frequencies: NDArray[np.float64], holds: Sequence[int]) -> list[Curve]:
    """Find all curves, with releases held for so many cycles; NaN where no amplitude keeps the rod up."""
    curves = []
    for rod, length in RODS.items():
        hyperbola = np.sqrt(2.0 * GRAVITY * length) / (2.0 * pi * frequencies)
        for friction, given in FRICTIONS.items():
            system = driven_pendulum(length=length, gravity=GRAVITY, **given)
            strobe = swept_map(stroboscopic_map(system), "amplitude", "frequency")
            smooth = driven_pendulum(length=length, gravity=GRAVITY, damping=given["damping"])
            floquet = np.array([_gained(smooth, f, a) for f, a in zip(frequencies, hyperbola, strict=True)])
            released = {hold: least_kept(strobe, frequencies, hyperbola, hold) for hold in holds}
            curves.append(Curve(rod, friction, frequencies, floquet, released))
    report(curves)
    return curves


def _gained(system: ForcedSystem, frequency: float, scale: float) -> float:
    """Least amplitude at which the inverted state gains stability."""
    there = system.with_params(frequency=frequency)
    found = critical_values(there, (pi, 0.0), "amplitude", RATIOS[0] * scale, RATIOS[-1] * scale)
    return next((c.value for c in found if c.gains), np.nan)


def least_kept(
    strobe: PointMap, frequencies: NDArray[np.float64], scale: NDArray[np.float64], cycles: int
) -> NDArray[np.float64]:
    """Return the least amplitudes from which a release stays up for so many cycles, sought in multiples of a scale."""
    cuts = np.broadcast_to(RATIOS[:, None], (RATIOS.size, frequencies.size))
    for _ in range(ROUNDS):
        kept = stays_up(strobe, cuts * scale, frequencies, cycles, RELEASE)
        first = np.argmax(kept, axis=0)[None]
        low, high = (np.take_along_axis(cuts, np.maximum(first - k, 0), axis=0) for k in (1, 0))
        cuts = low + (high - low) * np.arange(PARTS + 1)[:, None] / PARTS
    return np.where(kept.any(axis=0), high[0] * scale, np.nan)


def synthetic(frequencies: NDArray[np.float64], cycles: int) -> StabilityPoints:
    """Measure the short rod with viscous damping; the synthetic experiment knows nothing of the curve."""
    system = driven_pendulum(length=RODS[MEASURED_ROD], gravity=GRAVITY, **FRICTIONS["viscous"])
    scale = np.sqrt(2.0 * GRAVITY * RODS[MEASURED_ROD]) / (2.0 * pi * frequencies)
    return measure_least_amplitudes(
        system, frequencies, 0.8 * scale, 1.5 * scale, STEP, RELEASE, cycles, rng=17, rod=MEASURED_ROD
    )


def measured(path: Path = MEASURED) -> StabilityPoints | None:
    """Read measured points, if there are any."""
    return read_stability_points(path, MEASURED_ROD) if path.exists() else None


def inverted_map(frequencies: NDArray[np.float64], amplitudes: NDArray[np.float64]) -> StabilityMap:
    """Map the stability of the inverted state of the short rod over the drives (Hz, m)."""
    system = driven_pendulum(length=RODS[MEASURED_ROD], gravity=GRAVITY, **FRICTIONS["viscous"])
    return stability_map(system, (pi, 0.0), ("frequency", frequencies), ("amplitude", amplitudes))


def compare(curves: list[Curve], points: StabilityPoints, name: str) -> BoundaryComparison | None:
    """Print measured points beside the curve of the multipliers."""
    curve = next(c for c in curves if (c.rod, c.friction) == (points.rod, "viscous"))
    system = driven_pendulum(length=RODS[points.rod], gravity=GRAVITY, **FRICTIONS["viscous"])
    scale = np.sqrt(2.0 * GRAVITY * RODS[points.rod]) / (2.0 * pi * points.frequencies)
    # The curve is worked out at the points themselves where it reaches them, so that nothing is interpolated.
    inside = (points.frequencies >= curve.frequencies.min()) & (points.frequencies <= curve.frequencies.max())
    nodes, first = np.unique(points.frequencies[inside], return_index=True)
    heights = np.array([_gained(system, f, a) for f, a in zip(nodes, scale[inside][first], strict=True)])
    found = compare_with_boundary(points, nodes, heights) if len(nodes) else None
    print(f"\n{points.rod} rod, {name} points against multipliers, viscous 2.5 /s")
    if found is None:
        print("  no point lies within the curve")
        return None
    errors = np.full(len(points.frequencies), np.nan) if points.amplitude_errors is None else points.amplitude_errors
    print("   f, Hz    measured, mm         multipliers, mm  ratio")
    for f, a, e, x, r in zip(points.frequencies, points.amplitudes, errors, found.expected, found.ratios, strict=True):
        print(f"{f:8.4g}  {1e3 * a:9.4f} +- {1e3 * e:.4f}  {1e3 * x:15.4f}  {r:.4f}")
    print(
        f"rms {1e3 * found.rms:.4f} mm; chi-square {found.chi_square:.2f} of {found.compared}, p = {found.p_value:.3f}"
    )
    return found


def report(curves: list[Curve]) -> None:
    """Print the amplitudes side by side."""
    for curve in curves:
        reference = "multipliers" if curve.friction == "viscous" else "undamped multipliers"
        print(f"\n{curve.rod} rod, friction {curve.friction} 2.5: least amplitude by {reference}, and by release")
        print(
            "   f, Hz  sqrt(2gl)/w, mm  multipliers, mm"
            + "".join(f"  {h:4d} cycles, mm  diff, %" for h in curve.released)
        )
        hyperbola = np.sqrt(2.0 * GRAVITY * RODS[curve.rod]) / (2.0 * pi * curve.frequencies)
        for k, frequency in enumerate(curve.frequencies):
            row = f"{frequency:8.4g}  {1e3 * hyperbola[k]:15.6f}  {1e3 * curve.floquet[k]:15.6f}"
            for found in curve.released.values():
                row += f"  {1e3 * found[k]:15.6f}  {100.0 * (found[k] / curve.floquet[k] - 1.0):+7.3f}"
            print(row)
    print(f"\nmore amplitude for a release from {RELEASE:g} rad, by averaging: {100.0 * FINITE_ANGLE:+.4f} %")
    for friction in FRICTIONS:
        long, short = (next(c for c in curves if (c.rod, c.friction) == (rod, friction)) for rod in RODS)
        print(
            f"friction {friction}: long over short rod at {long.frequencies[-1]:g} Hz "
            f"{long.floquet[-1] / short.floquet[-1]:.6f}, and sqrt(6.9/3.1) = {np.sqrt(LONG_ROD / SHORT_ROD):.6f}"
        )


def draw(
    curves: list[Curve], measurements: dict[str, StabilityPoints], comparisons: dict[str, BoundaryComparison | None]
) -> Figure:
    """Draw amplitudes, one panel a rod, with measured points on top; below, release against multipliers."""
    figure, panels = plt.subplots(
        2, len(RODS), figsize=(11.0, 7.0), layout="constrained", sharex=True, sharey="row", height_ratios=(2, 1)
    )
    for (ax, below), rod in zip(panels.T, RODS, strict=True):
        ax.axvspan(*RANGE, color="0.95", label="range of the measurements")
        for curve, colour in zip([c for c in curves if c.rod == rod], ("#0072B2", "#D55E00"), strict=True):
            kind, style = ("viscous 2.5 /s", "-") if curve.friction == "viscous" else ("undamped", ":")
            ax.plot(curve.frequencies, 1e3 * curve.floquet, style, color=colour, label=f"multipliers, {kind}")
            for (hold, found), mark in zip(curve.released.items(), "ox", strict=True):
                looks = {"marker": mark, "ls": "", "color": colour, "ms": 4.0, "mfc": "none"}
                ax.plot(curve.frequencies, 1e3 * found, **looks, label=f"release, {curve.friction}, {hold} cycles")
                below.plot(curve.frequencies, 100.0 * (found / curve.floquet - 1.0), **looks)
        for (name, points), fill in zip(measurements.items(), ("white", "0.7"), strict=False):
            if points.rod != rod:
                continue
            dots = {"fmt": "o", "mfc": fill, "mec": "black", "ecolor": "black", "ms": 5.0, "capsize": 2.0, "zorder": 4}
            errors = points.amplitude_errors
            spread = None if errors is None else 1e3 * errors
            ax.errorbar(points.frequencies, 1e3 * points.amplitudes, spread, **dots, label=name)
            if (against := comparisons[name]) is not None:
                spread = None if errors is None else 100.0 * errors / against.expected
                below.errorbar(points.frequencies, 100.0 * (against.ratios - 1.0), spread, **dots)
        below.axhline(100.0 * FINITE_ANGLE, color="0.5", lw=0.8)
        below.set(xlabel="frequency, Hz", xlim=(0.0, 40.0), ylim=(-5.0, 5.0))
        ax.set(title=f"Rod of {rod}", yscale="log")
        ax.legend(fontsize="x-small")
    panels[0, 0].set_ylabel("least amplitude, mm")
    panels[1, 0].set_ylabel("against multipliers, %")
    return figure


def draw_map(stability: StabilityMap, points: StabilityPoints, name: str) -> Figure:
    """Draw measured points over the map of stability of the inverted state."""
    figure, ax = plt.subplots(figsize=(7.0, 5.0), layout="constrained")
    plot.stability_map(stability, ax=ax, measured=points.table)
    ax.set(xlabel="frequency, Hz", ylabel="amplitude, mm", title=f"Inverted state of the rod of {points.rod}, {name}")
    ax.yaxis.set_major_formatter(lambda value, _: f"{1e3 * value:g}")
    return figure


def main(quick: bool, output: Path) -> None:
    """Compute and draw."""
    curves = compute(np.arange(8.0, 41.0, 8.0), (50, 200)) if quick else compute(np.arange(2.0, 40.25, 0.5), (50, 500))
    rates = np.linspace(*RANGE, 5 if quick else 21)
    measurements = {"synthetic measurement": synthetic(rates, 500 if quick else 2000)}
    if (points := measured()) is not None:
        measurements["measured"] = points
    comparisons = {name: compare(curves, each, name) for name, each in measurements.items()}
    figure = draw(curves, measurements, comparisons)
    figure.savefig(output / "figure_17.png", dpi=100)
    plt.close(figure)
    name, points = list(measurements.items())[-1]
    size = (17, 40) if quick else (61, 160)
    stability = inverted_map(np.linspace(10.0, 40.0, size[0]), np.linspace(0.0005, 0.02, size[1]))
    figure = draw_map(stability, points, name)
    figure.savefig(output / "figure_17_map.png", dpi=100)
    plt.close(figure)
