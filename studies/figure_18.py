"""Figure 18 of the report: swings of the inverted pendulum at 35, 38, 41 and 45 Hz, all else being equal.

The report sees the pendulum within 0.12 rad of the upright position at 35 Hz and within 0.05 rad at 45 Hz, and explains
it by a deeper well of the effective potential.  It does not say which rod, amplitude, friction or release it used.
Where the inverted state is stable and the drive exactly vertical it attracts, so nothing swings for ever: what is seen
is the way back to rest.  Assumed here are the rod of 3.1 cm, the sine drive of the report's models, its measured
friction of 2.5 read as dry (rad/s^2), and a release from rest at t = 0.  Two numbers that are not known remain,
amplitude and angle of release, and they follow from the two swings that are known; so the figure is matched by fitting,
and what the fit says is how near to the limit of stability the drive must have been.

Must come out: swings of 0.12 and 0.05 rad with the dry friction, with a weak viscous one and without any, at amplitudes
a few per cent above the least that holds the pendulum up at 35 Hz.  Only without friction does the swing at 35 Hz reach
as far to both sides, as the report has it; with friction it goes far to one side and creeps back.  With viscous
damping of 10 /s, which reproduces figure 19, no amplitude matches: the motion dies before the well can show.  A drive
tilted by one or two degrees keeps the pendulum moving for ever and its farthest points match as well, but they lie on
one side.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, pi
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.optimize import brentq

from cellmap import ForcedSystem, trajectory
from cellmap.bifurcations import critical_values
from cellmap.maps import Trajectory
from systems import Gravity, Pendulum, TiltedDrive, ViscousDamping, driven_pendulum, scene

LENGTH = 0.031
PORTRAITS = (35.0, 38.0, 41.0, 45.0)
SEEN = {35.0: 0.12, 45.0: 0.05}  # swings in the report (rad)
WATCHED = 2.0  # time within which a swing is looked for (s)
SETTLED = 4.0  # time after which the strongly damped rod repeats itself (s)
SAMPLES = 32
FRICTIONS = {"dry 2.5 rad/s²": (0.0, 2.5), "none": (0.0, 0.0), "viscous 2.5 /s": (2.5, 0.0)}
STRONG = 10.0  # viscous damping that reproduces figure 19 (1/s)


@dataclass(frozen=True)
class Release:
    """Amplitude of the drive (m) and angle of release (rad) that give the report's swings, by way of friction."""

    amplitude: float
    angle: float
    damping: float
    friction: float

    def motion(self, frequency: float, seconds: float = WATCHED) -> Trajectory:
        """Return the motion after the release."""
        return release(pendulum(self.amplitude, frequency, self.damping, self.friction), self.angle, seconds)

    def swing(self, frequency: float) -> float:
        """Return how far the pendulum gets from the upright position (rad)."""
        return float(departure(self.motion(frequency)).max())


@dataclass(frozen=True)
class Tilt:
    """Amplitude (m) and tilt (rad) of a drive that gives the report's swings for ever, with where they lie (rad)."""

    amplitude: float
    tilt: float
    ranges: dict[float, tuple[float, float]]


@dataclass(frozen=True, eq=False)
class Result:
    """Limit of stability by frequency, matching releases, strongest ratio of swings with strong damping, and curves."""

    limits: dict[float, float]
    releases: dict[str, Release]
    strong_ratio: float
    tilted: Tilt
    portraits: dict[str, dict[float, Trajectory]]
    late: dict[float, float]
    frequencies: NDArray[np.float64]
    curves: dict[str, NDArray[np.float64]]


def pendulum(amplitude: float, frequency: float, damping: float = 0.0, friction: float = 0.0) -> ForcedSystem:
    """Return the rod on a sine drive; those with dry friction are one system, and those without another."""
    if friction:
        return driven_pendulum(LENGTH, amplitude, frequency, damping, friction=friction, phase=-pi / 2)
    return driven_pendulum(LENGTH, amplitude, frequency, phase=-pi / 2).with_params(damping=damping)


def release(system: ForcedSystem, angle: float, seconds: float = WATCHED) -> Trajectory:
    """Return the motion after a release from rest at an angle from the upright position."""
    return trajectory(system, [pi - angle, 0.0], periods=ceil(seconds / system.length), samples_per_period=SAMPLES)


def departure(motion: Trajectory) -> NDArray[np.float64]:
    """Return angles from the upright position (rad)."""
    return np.abs(motion.states[:, 0] - pi)


def match(damping: float, friction: float, least: float) -> Release:
    """Return the release that swings as far as the report says at both frequencies."""
    (slow, far), (fast, near) = SEEN.items()

    def angle(amplitude: float) -> float:
        def excess(tilt: float) -> float:
            return Release(amplitude, tilt, damping, friction).swing(slow) - far

        return float(brentq(excess, 1e-4, far, xtol=1e-7))

    def excess(amplitude: float) -> float:
        return Release(amplitude, angle(amplitude), damping, friction).swing(fast) - near

    amplitude = float(brentq(excess, least, 1.2 * least, xtol=1e-8))
    return Release(amplitude, angle(amplitude), damping, friction)


def match_tilt(least: float) -> Tilt:
    """Return the tilted drive whose lasting motion reaches as far as the report says at both frequencies."""
    (slow, far), (fast, near) = SEEN.items()

    def lasting(amplitude: float, tilt: float, frequency: float) -> tuple[float, float]:
        drive = TiltedDrive(amplitude, frequency, tilt, -pi / 2)
        system = scene(Pendulum(LENGTH), Gravity(9.8), drive, ViscousDamping(STRONG), name="tilted drive")
        angles = release(system, tilt, SETTLED).states[-SAMPLES:, 0] - pi
        return float(angles.min()), float(angles.max())

    def reach(amplitude: float, tilt: float, frequency: float) -> float:
        return float(np.abs(lasting(amplitude, tilt, frequency)).max())

    def tilt_of(amplitude: float) -> float:
        # The fixed point moves in proportion to a small tilt: two secant steps are as good as a root.
        tilt = 0.01
        for _ in range(3):
            tilt *= far / reach(amplitude, tilt, slow)
        return tilt

    amplitude = float(
        brentq(lambda a: reach(a, tilt_of(a), fast) - near, 1.1 * least, 1.4 * least, xtol=1e-7, rtol=1e-6)
    )
    tilt = tilt_of(amplitude)
    return Tilt(amplitude, tilt, {f: lasting(amplitude, tilt, f) for f in SEEN})


def compute(points: int) -> Result:
    """Find the limits of stability and what matches, and sweep the frequency."""
    limits = {f: _limit(f) for f in PORTRAITS}
    least = limits[35.0]
    releases = {
        name: match(*friction, 1.003 * least if friction[1] else 1.01 * least) for name, friction in FRICTIONS.items()
    }
    chosen = releases["dry 2.5 rad/s²"]
    weak = [Release(a * least, 0.02, STRONG, 0.0) for a in np.linspace(1.0005, 1.3, 20)]
    ratios = [r.swing(35.0) / r.swing(45.0) for r in weak]
    frequencies = np.linspace(34.9, 50.0, points)
    curves = {name: np.array([r.swing(f) for f in frequencies.tolist()]) for name, r in releases.items()}
    long = {f: chosen.motion(f, 10.0) for f in PORTRAITS}
    late = {f: float(departure(m)[-int(f) * SAMPLES :].max()) for f, m in long.items()}
    shown = ("none", "dry 2.5 rad/s²")
    portraits = {name: {f: releases[name].motion(f) for f in PORTRAITS} for name in shown}
    return Result(limits, releases, max(ratios), match_tilt(least), portraits, late, frequencies, curves)


def _limit(frequency: float) -> float:
    changes = critical_values(pendulum(0.003, frequency), (pi, 0.0), "amplitude", 1e-4, 0.01)
    return next(c.value for c in changes if c.gains)


def report(result: Result) -> None:
    """Print what matches the report's swings, and what does not."""
    for frequency, limit in result.limits.items():
        print(f"{frequency:g} Hz: inverted state gains stability at {1e3 * limit:.6f} mm (undamped, 3.1 cm)")
    least = result.limits[35.0]
    for name, found in result.releases.items():
        swings = ", ".join(f"{f:g} Hz {found.swing(f):.4f}" for f in PORTRAITS)
        angles = found.motion(35.0).states[:, 0] - pi
        print(
            f"friction {name}: A = {1e3 * found.amplitude:.4f} mm ({100 * (found.amplitude / least - 1):+.2f} % of the "
            f"limit), released at {found.angle:.5f} rad; swings within (rad): {swings}; at 35 Hz from "
            f"{angles.min():+.4f} to {angles.max():+.4f}"
        )
    late = ", ".join(f"{f:g} Hz {angle:.4f}" for f, angle in result.late.items())
    print(f"with the dry friction, within the tenth second (rad): {late}")
    print(
        f"viscous damping {STRONG:g} /s: the swing at 35 Hz is at most {result.strong_ratio:.3f} times that at 45 Hz; "
        f"the report has {SEEN[35.0] / SEEN[45.0]:.1f}"
    )
    ranges = ", ".join(f"{f:g} Hz {low:+.4f} to {high:+.4f}" for f, (low, high) in result.tilted.ranges.items())
    print(
        f"drive tilted by {np.degrees(result.tilted.tilt):.2f} degrees, A = {1e3 * result.tilted.amplitude:.3f} mm: "
        f"for ever between (rad) {ranges}"
    )


def draw(result: Result) -> Figure:
    """Draw the portraits, and the swings against the frequency."""
    figure = plt.figure(figsize=(14.0, 7.0), layout="constrained")
    halves: NDArray[Any] = np.asarray(figure.subfigures(1, 2, width_ratios=(1.3, 1.0)))
    left, right = halves
    panels: NDArray[Any] = left.subplots(2, 2, sharex=True, sharey=True)
    for ax, frequency in zip(panels.flat, PORTRAITS, strict=True):
        for (name, motions), colour in zip(result.portraits.items(), ("#009E73", "#0072B2"), strict=True):
            angles, rates = motions[frequency].states[:, 0] - pi, motions[frequency].states[:, 1]
            ax.plot(angles, rates, lw=0.5, color=colour, alpha=0.45)
            points = {"ms": 3.0, "color": colour, "mec": "black", "mew": 0.3}
            ax.plot(angles[::SAMPLES], rates[::SAMPLES], "o", label=f"friction: {name}", **points)
        ax.set(title=f"{frequency:g} Hz", xlabel="angle from upright (rad)", ylabel="rate (rad/s)")
        ax.label_outer()
    panels[0, 0].legend(fontsize="x-small")
    left.suptitle("Two seconds after the release; points once a period")
    ax = right.subplots()
    for (name, curve), colour in zip(result.curves.items(), ("#0072B2", "#009E73", "#E69F00"), strict=True):
        ax.plot(result.frequencies, np.where(curve < 0.5, curve, np.nan), color=colour, label=f"friction: {name}")
    ax.plot(list(SEEN), list(SEEN.values()), "k*", ms=12, label="report")
    ax.set(xlabel="frequency (Hz)", ylabel="largest angle from upright (rad)", ylim=(0.0, 0.2))
    ax.legend()
    right.suptitle("Swing after the same release")
    return figure


def main(quick: bool, output: Path) -> None:
    """Compute, tell and draw."""
    result = compute(8 if quick else 152)
    report(result)
    figure = draw(result)
    figure.savefig(output / "figure_18.png", dpi=100)
    plt.close(figure)
