"""Figure 13 of the report: decay of the free swing of the rod of 3.1 cm.

The report gives no coefficient for this rod.  Taken here is figure 13 as the rod of 3.1 cm, and figures 15 and 16,
which the study `decay` is about, as that of 6.9 cm.  Both hang in the same bearing, and there are two ways to carry
its dry friction of 2.5 rad/s^2 over from one to the other: the same coefficient, or the same torque on rods of the
same mass, so that the coefficient is larger by (6.9/3.1)^2.  Both are shown, with a viscous damping of 2.5 /s for
comparison, released at the 1.28 rad of the report's fit.

Must come out: halts of the simulated motion at the angles that follow from energy alone, to 2e-6 rad, with an angle of
rest within asin(friction l/g) that differs from zero; with dry friction the profile ends after a finite time, with
viscous damping it does not.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from cellmap import trajectory
from cellmap.maps import Trajectory
from systems import LONG_ROD, SHORT_ROD
from systems.lab.free_swings.damping_fits import free_pendulum

from ._dry_friction import GRAVITY, resting_bound, turning_angles

RELEASE = 1.28  # rad
SECONDS = 15.0
SAMPLES = 512
FRICTION = 2.5  # rad/s^2, of the rod of 6.9 cm
FRICTIONS = {"same coefficient": FRICTION, "same torque": FRICTION * (LONG_ROD / SHORT_ROD) ** 2}
VISCOUS = 2.5  # 1/s


@dataclass(frozen=True, eq=False)
class Decay:
    """A simulated swing, its halts (time and angle), and the angles of halts that follow from energy."""

    motion: Trajectory
    times: NDArray[np.float64]
    halts: NDArray[np.float64]
    by_energy: NDArray[np.float64]


def compute(seconds: float = SECONDS) -> dict[str, Decay]:
    """Let the rod swing with each kind of damping."""
    found = {}
    for name, friction in FRICTIONS.items():
        motion = swing({"friction": friction}, seconds)
        found[f"dry, {name}: {friction:.3g} rad/s²"] = Decay(
            motion, *halts(motion), turning_angles(RELEASE, friction, SHORT_ROD)
        )
    motion = swing({"damping": VISCOUS}, seconds)
    found[f"viscous, {VISCOUS:g} /s"] = Decay(motion, *halts(motion), np.empty(0))
    return found


def swing(coefficients: dict[str, float], seconds: float) -> Trajectory:
    """Return the motion after a release from rest."""
    system = free_pendulum(SHORT_ROD, coefficients, GRAVITY)
    return trajectory(system, [RELEASE, 0.0], ceil(seconds / system.length), SAMPLES)


def halts(motion: Trajectory) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return times and angles at which the rod turns, interpolated between samples, and where it comes to rest."""
    angles, rates = motion.states.T
    moving = np.flatnonzero(rates)
    reversals = 1 + np.flatnonzero(rates[1:-1] * rates[2:] < 0.0)
    # Between two samples the rate goes through zero almost in a straight line, and the angle follows it.
    fraction = rates[reversals] / (rates[reversals] - rates[reversals + 1])
    step = motion.times[1]
    times = np.concatenate([[0.0], motion.times[reversals] + fraction * step])
    places = np.concatenate([angles[:1], angles[reversals] + 0.5 * fraction * step * rates[reversals]])
    if moving[-1] + 1 < len(rates):
        times, places = np.append(times, motion.times[moving[-1] + 1]), np.append(places, angles[-1])
    return times, places


def report(result: dict[str, Decay]) -> None:
    """Print how the swings end."""
    for name, found in result.items():
        if not len(found.by_energy):
            print(f"{name}: {len(found.halts)} halts in {found.motion.times[-1]:.2f} s, and no rest")
            continue
        friction = found.motion.system.params["friction"]
        far = np.abs(found.halts - found.by_energy).max()
        bound = resting_bound(friction, SHORT_ROD)
        print(
            f"{name}: rest after {len(found.halts) - 1} half swings and {found.times[-1]:.3f} s at "
            f"{found.halts[-1]:+.6f} rad, within {bound:.6f}; halts by energy differ by at most "
            f"{far:.1e} rad"
        )


def draw(result: dict[str, Decay]) -> Figure:
    """Draw the swings and their profiles."""
    figure, axes = plt.subplots(len(result), 1, figsize=(10.0, 8.0), layout="constrained", sharex=True, sharey=True)
    for ax, (name, found) in zip(axes, result.items(), strict=True):
        ax.plot(found.motion.times, found.motion.states[:, 0], lw=0.6, color="0.6")
        ax.plot(found.times, np.abs(found.halts), "o", ms=3.0, color="#0072B2", label="halts")
        if len(found.by_energy):
            ax.plot(found.times, np.abs(found.by_energy), "-", lw=0.8, color="#D55E00", label="by energy")
        ax.set(title=name, ylabel="angle (rad)")
        ax.legend(fontsize="small", loc="upper right")
    axes[-1].set_xlabel("time (s)")
    return figure


def main(quick: bool, output: Path) -> None:
    """Compute, tell and draw."""
    result = compute()
    report(result)
    figure = draw(result)
    figure.savefig(output / "figure_13.png", dpi=100)
    plt.close(figure)
