"""Figure 17 of the report: least amplitude that keeps the inverted state, over frequency, for its two rods.

Twice: where the Floquet multipliers of the inverted state come inside the unit circle, and by simulation as in the
report, where a release at rest 0.05 rad from upright, with the pivot at its highest, has not fallen by a quarter of a
turn after some cycles.  All frequencies and amplitudes are simulated in one batch, and brackets cut together.

Damping is 2.5, twice: viscous (1/s), where the two must agree but for the finite angle and the finite time, and dry
(rad/s^2), which fits the measured decay of the 6.9 cm rod.  Dry friction has no multipliers, for a rod stands still
within a small angle of upright; there the undamped ones are the reference.  The friction of the 3.1 cm rod is not known
apart, and taken to be the same angular deceleration.  Below 5 Hz the range of amplitudes that hold the state gets so
narrow that a release may miss it, and find none, or a swing about upright at a larger amplitude.

Measured points are drawn where a file figure_17_measured.csv stands beside this one, with a heading
frequency_hz,amplitude_mm; those of the report lie between 15 and 35 Hz.

Must come out: sqrt(2 g l)/w at high frequencies, sqrt(6.9/3.1) times as much for the long rod as for the short one;
and by averaging, a release from 0.05 rad that is given time needs 0.0625 % more than the multipliers say.
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

from cellmap import ForcedSystem, PointMap, critical_values, stroboscopic_map, swept_map
from cellmap.coordinates import wrap
from systems import driven_pendulum
from systems.compound import LONG_ROD, SHORT_ROD

MEASURED = Path(__file__).parent / "figure_17_measured.csv"
RANGE = (15.0, 35.0)  # Hz, of the report's measurements
GRAVITY = 9.8
RELEASE = 0.05  # rad from upright
FALLEN = 0.5 * pi
FINITE_ANGLE = cos(RELEASE) ** -0.5 - 1.0  # by averaging, how much more amplitude puts the barrier beyond the release
RATIOS = np.linspace(0.5, 2.5, 129)  # of the amplitudes tried, to sqrt(2 g l)/w
PARTS, ROUNDS = 16, 5  # brackets of the ratio are cut to 2e-8
FRICTIONS = {"viscous": {"damping": 2.5}, "dry": {"damping": 0.0, "friction": 2.5}}
RODS = {"6.9 cm": LONG_ROD, "3.1 cm": SHORT_ROD}


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
        kept = stays_up(strobe, cuts * scale, frequencies, cycles)
        first = np.argmax(kept, axis=0)[None]
        low, high = (np.take_along_axis(cuts, np.maximum(first - k, 0), axis=0) for k in (1, 0))
        cuts = low + (high - low) * np.arange(PARTS + 1)[:, None] / PARTS
    return np.where(kept.any(axis=0), high[0] * scale, np.nan)


def stays_up(
    strobe: PointMap, amplitudes: NDArray[np.float64], frequencies: NDArray[np.float64], cycles: int
) -> NDArray[np.bool_]:
    """Tell which releases have not fallen at the end of any of so many cycles; whole turns are falls."""
    states = np.stack(np.broadcast_arrays(pi - RELEASE, 0.0, amplitudes, frequencies), axis=-1).reshape(-1, 4)
    rows = np.arange(len(states))
    for _ in range(cycles):
        # From the tilt before: whole turns that the seam at pi gives and takes do not add up.
        tilt = np.remainder(states[:, 0], 2.0 * pi) - pi
        images = strobe.iterate(states, 1)
        up = np.abs(tilt + images.unwrapped[:, 0] - states[:, 0]) < FALLEN
        states, rows = wrap(images.points[up], strobe.coordinates), rows[up]
    return np.isin(np.arange(amplitudes.size), rows).reshape(amplitudes.shape)


def measured(path: Path = MEASURED) -> NDArray[np.float64] | None:
    """Read measured points (n, 2), in Hz and mm, if there are any."""
    if not path.exists():
        return None
    table = np.atleast_1d(np.genfromtxt(path, delimiter=",", names=True))
    if table.dtype.names != ("frequency_hz", "amplitude_mm"):
        raise ValueError(f"{path}: its heading must be frequency_hz,amplitude_mm")
    points = np.stack([table["frequency_hz"], table["amplitude_mm"]], axis=-1)
    if not (np.isfinite(points) & (points > 0.0)).all():
        raise ValueError(f"{path}: give positive numbers alone")
    return points


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


def draw(curves: list[Curve], points: NDArray[np.float64] | None) -> Figure:
    """Draw amplitudes, one panel a rod, with measured points if there are any; below, release against multipliers."""
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
        if points is not None:
            ax.plot(points[:, 0], points[:, 1], "o", color="white", mec="black", label="measured")
        below.axhline(100.0 * FINITE_ANGLE, color="0.5", lw=0.8)
        below.set(xlabel="frequency, Hz", xlim=(0.0, 40.0), ylim=(-5.0, 5.0))
        ax.set(title=f"Rod of {rod}", yscale="log")
        ax.legend(fontsize="x-small")
    panels[0, 0].set_ylabel("least amplitude, mm")
    panels[1, 0].set_ylabel("release against multipliers, %")
    return figure


def main(quick: bool, output: Path) -> None:
    """Compute and draw."""
    curves = compute(np.arange(8.0, 41.0, 8.0), (50, 200)) if quick else compute(np.arange(2.0, 40.25, 0.5), (50, 500))
    figure = draw(curves, measured())
    figure.savefig(output / "figure_17.png", dpi=100)
    plt.close(figure)
