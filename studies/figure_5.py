"""Figures 5 and 6 of the report: outputs and phase portraits of the models of both pendulums.

The report's block diagrams give x, y, theta and theta' of the single pendulum and of both links of the double one, as
series and as phase portraits.  Which rods, drives and initial conditions it shows is not known.  Assumed here are the
rod of figure 19 at 3 mm and 50 Hz with a viscous damping of 10 /s, and a double pendulum of two rods of 3.2 cm, the
outer mass a quarter of the inner, at 6 mm and 50 Hz with undamped joints; initial conditions are those for which
states after one period are known to ten digits.  Angles count from the downward vertical in both; the report counts
them from the upward one in its equations (1) to (4).

Must come out: after one period (1.421985656355, 0.052018392069) of the single pendulum and (2.039335961693,
0.736205328087, 0.119529455898, 0.271635760474) of the double one, velocities in units of the drive's angular frequency;
masses that stay at the lengths of their rods from one another and from the pivot, whose height is A cos(w t).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from cellmap import ForcedSystem, trajectory
from cellmap.maps import Trajectory
from systems import double_pendulum, driven_pendulum

RATE = 2.0 * pi * 50.0  # of the drive (1/s)
SINGLE = (1.0, 0.1)  # initial angles (rad), then velocities in units of RATE
DOUBLE = (1.0, -0.5, 0.2, 0.1)
AFTER = {
    "single": (1.4219856563553754, 0.052018392069488984),
    "double": (2.039335961693, 0.736205328087, 0.119529455898, 0.271635760474),
}
"""States after one period, in the same units, found by two independent programs."""

SAMPLES = 64
COLOURS = ("#0072B2", "#E69F00")


@dataclass(frozen=True, eq=False)
class Outputs:
    """Motion of a model: the pivot and the masses from the pivot outwards.

    `positions` are x and y of each of them, shape (times, 1 + links, 2); `angles` and `rates` have shape
    (times, links).
    """

    motion: Trajectory
    positions: NDArray[np.float64]
    angles: NDArray[np.float64]
    rates: NDArray[np.float64]

    @property
    def lengths(self) -> NDArray[np.float64]:
        """Distances of the masses from one another, the first from the pivot, shape (times, links)."""
        return np.asarray(np.linalg.norm(np.diff(self.positions, axis=1), axis=-1))

    @property
    def after(self) -> NDArray[np.float64]:
        """State after one period, velocities in units of RATE."""
        links = self.angles.shape[1]
        return self.motion.states[self.motion.samples] / np.repeat([1.0, RATE], links)


def compute(periods: int) -> dict[str, Outputs]:
    """Follow both models over a number of periods."""
    return {
        "single": outputs(driven_pendulum(), SINGLE, periods),
        "double": outputs(double_pendulum(damping=0.0), DOUBLE, periods),
    }


def outputs(system: ForcedSystem, start: tuple[float, ...], periods: int) -> Outputs:
    """Return the outputs of one model."""
    links = len(start) // 2
    state = np.array(start) * np.repeat([1.0, RATE], links)
    motion = trajectory(system, state, periods, SAMPLES)
    places = np.asarray(motion.output("positions")).reshape(len(motion.times), 1 + links, 2)
    return Outputs(motion, places, motion.states[:, :links], motion.states[:, links:])


def report(result: dict[str, Outputs]) -> None:
    """Print the states after one period beside the known ones, and how well lengths are kept."""
    for name, found in result.items():
        far = np.abs(found.after - AFTER[name]).max()
        state = ", ".join(f"{v:.12f}" for v in found.after)
        print(f"{name} pendulum after one period: ({state}); known values differ by at most {far:.1e}")
        system = found.motion.system
        lengths = [v for k, v in system.params.items() if k.startswith("length")]
        height = system.params["amplitude"] * np.cos(RATE * found.motion.times)
        print(
            f"  rods keep their lengths to {np.abs(found.lengths - lengths).max():.1e} m, the pivot its height to "
            f"{np.abs(found.positions[:, 0, 1] - height).max():.1e} m"
        )


def draw(found: Outputs, title: str) -> Figure:
    """Draw x, y, theta and theta' against time on the left, phase portraits and paths on the right."""
    figure = plt.figure(figsize=(13.0, 8.0), layout="constrained")
    halves: NDArray[Any] = np.asarray(figure.subfigures(1, 2, width_ratios=(1.3, 1.0)))
    left, right = halves
    rows = left.subplots(4, 1, sharex=True)
    portrait, paths = right.subplots(2, 1)
    t, samples = found.motion.times, found.motion.samples
    for j, colour in zip(range(found.angles.shape[1]), COLOURS, strict=False):
        masses = found.positions[:, 1 + j]
        for ax, series in zip(rows, (1e3 * masses[:, 0], 1e3 * masses[:, 1], *angle_and_rate(found, j)), strict=True):
            ax.plot(t, series, lw=0.8, color=colour, label=f"link {j + 1}")
        portrait.plot(*angle_and_rate(found, j), lw=0.5, color=colour, alpha=0.6)
        stroboscopic = {"ms": 3.0, "color": colour, "mec": "black", "mew": 0.3, "ls": "none"}
        portrait.plot(found.angles[::samples, j], found.rates[::samples, j], "o", **stroboscopic)
        paths.plot(1e3 * masses[:, 0], 1e3 * masses[:, 1], lw=0.5, color=colour)
    for ax, name in zip(rows, ("x (mm)", "y (mm)", "θ (rad)", "θ' (rad/s)"), strict=True):
        ax.set_ylabel(name)
    rows[-1].set_xlabel("time (s)")
    if found.angles.shape[1] > 1:
        rows[0].legend(fontsize="small", ncols=2)
    portrait.set(xlabel="θ (rad)", ylabel="θ' (rad/s)", title="Phase portrait; points once a period")
    paths.set(xlabel="x (mm)", ylabel="y (mm)", title="Paths of the masses", aspect="equal")
    figure.suptitle(title)
    return figure


def angle_and_rate(found: Outputs, link: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return angle and angular velocity of one link."""
    return found.angles[:, link], found.rates[:, link]


def main(quick: bool, output: Path) -> None:
    """Compute, tell and draw."""
    result = compute(20 if quick else 50)
    report(result)
    titles = {"single": "Figure 5: single pendulum", "double": "Figure 6: double pendulum"}
    for name, number in (("single", 5), ("double", 6)):
        figure = draw(result[name], titles[name])
        figure.savefig(output / f"figure_{number}.png", dpi=100)
        plt.close(figure)
