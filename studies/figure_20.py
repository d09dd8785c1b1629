"""Figures 20 and 21 of the report: the flipping mode of the double pendulum at 24 Hz.

Links of 3.2 cm with equal masses.  Figure 20 is the phase portrait of the state (inner link up, outer link down), here
after a push that is too weak; figure 21 shows both angles while a stronger push flips them into (down, up).  The report
gives neither amplitude nor damping: 7 mm and 5 /s in both joints are chosen here, within the range where the two
flipping states are the only equilibria that are stable.  A push is a rate given at once to the inner or to the outer
link; all pushes of a scan go through the map together.

Must come out (tests/REFERENCES.md): without damping this range is 4.452842149 to 9.546244854 mm, the window of
both flipping states, while (0, 0) is lost at 3.523140841 mm and (π, π) is never stable.

The report conjectures that links separate in these states.  They do not: in each linear mode both links swing, with
amplitudes that are printed.  What sets the two states apart is that with equal links both have the same modes, and so
the same window.  A strong push flips the pendulum by way of a long irregular motion, so nearby pushes may end
differently; the least push that leaves the state is sharp.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator
from numpy.typing import NDArray

from cellmap import PointMap, stroboscopic_map, trajectory
from cellmap.bifurcations import FloquetResult, floquet_multipliers
from cellmap.maps import Trajectory
from systems import double_pendulum

from ._chains import Window, equilibria, first_window, normal_modes, text_of

STATES = equilibria(2)
UP_DOWN, DOWN_UP = np.array(STATES["(π, 0)"]), np.array(STATES["(0, π)"])
SYSTEM = double_pendulum(mass_2=1.0, amplitude=0.007, frequency=24.0, damping=5.0)
LINKS = {"inner": 2, "outer": 3}  # places of their rates in the state
STRONGEST = 120.0  # push (rad/s)
SETTLED = 400  # periods after which nearly all have come to rest
NEAR = 1e-3  # distance in angles (rad) that is at rest in a state


@dataclass(frozen=True, eq=False)
class Scan:
    """Where pushes to one link lead: 1 flipped, 0 back, -1 neither after 400 periods; and the least that does not."""

    pushes: NDArray[np.float64]
    ends: NDArray[np.int64]
    least: tuple[float, float]
    quickest: float
    periods: int


@dataclass(frozen=True, eq=False)
class Result:
    """Windows of the equilibria by damping, multipliers, scans by link, a motion that returns and one that flips."""

    windows: dict[float, dict[str, Window]]
    multipliers: dict[str, FloquetResult]
    scans: dict[str, Scan]
    returning: Trajectory
    flipping: Trajectory


def pushed(link: str, pushes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the state (up, down) with a rate given to one link."""
    initial_conditions = np.tile(UP_DOWN, (len(pushes), 1))
    initial_conditions[:, LINKS[link]] = pushes
    return initial_conditions


def distance(points: NDArray[np.float64], state: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the largest angle by which states differ from an equilibrium."""
    shift = points[..., :2] - state[:2]
    return np.abs(np.angle(np.exp(1j * shift))).max(axis=-1)


def ends_of(point_map: PointMap, link: str, pushes: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return 1 for a flip, 0 for a return, -1 for neither."""
    last = point_map.iterate(pushed(link, pushes), SETTLED).points
    return np.where(distance(last, DOWN_UP) < NEAR, 1, np.where(distance(last, UP_DOWN) < NEAR, 0, -1))


def scan(point_map: PointMap, link: str, count: int) -> Scan:
    """Follow pushes of all strengths, narrow the least that does not return, and find the quickest flip."""
    pushes = np.linspace(0.0, STRONGEST, count)
    ends = ends_of(point_map, link, pushes)
    first = int(np.argmax(ends != 0))
    low, high = pushes[first - 1], pushes[first]
    while high - low > 1e-9 * high:
        between = np.linspace(low, high, 64)
        first = int(np.argmax(ends_of(point_map, link, between) != 0))
        low, high = between[first - 1], between[first]
    flips = pushes[ends == 1]
    orbit = point_map.orbit(pushed(link, flips), SETTLED).points
    away = distance(orbit, DOWN_UP) >= 0.1
    # The first period after which an orbit stays near its end.
    arrival = SETTLED + 1 - np.argmax(away[::-1], axis=0)
    quickest = int(np.argmin(arrival))
    return Scan(pushes, ends, (float(low), float(high)), float(flips[quickest]), int(arrival[quickest]))


def compute(count: int) -> Result:
    """Find windows, multipliers and pushes, and the motions of both figures."""
    windows = {
        damping: {name: first_window(SYSTEM.with_params(damping=damping), s, 0.02) for name, s in STATES.items()}
        for damping in (0.0, SYSTEM.params["damping"])
    }
    multipliers = {name: floquet_multipliers(SYSTEM, state) for name, state in STATES.items()}
    point_map = stroboscopic_map(SYSTEM)
    scans = {link: scan(point_map, link, count) for link in LINKS}
    link, best = min(scans.items(), key=lambda item: item[1].periods)
    weak, strong = np.array([0.9 * best.least[0]]), np.array([best.quickest])
    returning = trajectory(SYSTEM, pushed(link, weak)[0], periods=60)
    flipping = trajectory(SYSTEM, pushed(link, strong)[0], periods=max(60, best.periods + 20))
    return Result(windows, multipliers, scans, returning, flipping)


def report(result: Result) -> None:
    """Print windows, multipliers, modes and pushes."""
    for damping, windows in result.windows.items():
        print(f"stable amplitudes (mm) at 24 Hz, equal masses, joint damping {damping:g} /s")
        for name, window in windows.items():
            print(f"  {name}: {text_of(window)}")
    print(f"at {1e3 * SYSTEM.params['amplitude']:g} mm and {SYSTEM.params['damping']:g} /s, largest multiplier")
    for name, found in result.multipliers.items():
        print(f"  {name}: {float(found.largest):.6f}")
    for name in ("(π, 0)", "(0, π)"):
        values, shapes = normal_modes((0.032, 0.032), (1.0, 1.0), STATES[name])
        for value, shape in zip(values, shapes.T, strict=True):
            kind = "hanging" if value > 0.0 else "inverted"
            print(
                f"  undamped mode of {name}: as a pendulum of {100 / abs(value):.4f} cm, {kind}; outer link / inner "
                f"link {shape[1] / shape[0]:+.4f}"
            )
    for link, scan in result.scans.items():
        flips, back, lost = (np.count_nonzero(scan.ends == k) for k in (1, 0, -1))
        print(
            f"pushes of the {link} link from 0 to {STRONGEST:g} rad/s: {flips} flip, {back} return, {lost} do neither "
            f"in {SETTLED} periods; least that does not return {scan.least[1]:.7f} rad/s"
        )
        print(
            f"  quickest flip on the scan: {scan.quickest:g} rad/s, there within 0.1 rad after {scan.periods} periods"
        )


def draw(result: Result) -> tuple[Figure, Figure]:
    """Draw the portrait of figure 20, and figure 21 above the scans of pushes."""
    portrait, panels = plt.subplots(1, 2, figsize=(10.0, 4.6), layout="constrained")
    motion = result.returning
    for j, (ax, link) in enumerate(zip(panels, LINKS, strict=True)):
        angles, rates = motion.states[:, j] - UP_DOWN[j], motion.states[:, j + 2]
        ax.plot(angles, rates, lw=0.8, color="0.55")
        ax.plot(angles[:: motion.samples], rates[:: motion.samples], "o", ms=4, color="#0072B2", mec="black", mew=0.4)
        ax.set(title=f"{link} link", xlabel="angle from the state (rad)", ylabel="rate (rad/s)")
    portrait.suptitle("Flipping state (up, down) at 24 Hz after a push that is too weak; points once a period")
    series, rows = plt.subplots(4, 1, figsize=(9.0, 8.5), layout="constrained", height_ratios=(3, 3, 1, 1))
    motion = result.flipping
    for j, (ax, link) in enumerate(zip(rows[:2], LINKS, strict=True)):
        multiples = motion.states[:, j] / pi
        ax.plot(motion.times, multiples, lw=0.8, color="0.4")
        ax.plot(motion.times[:: motion.samples], multiples[:: motion.samples], "o", ms=3, color="#0072B2")
        ax.yaxis.set_major_locator(MultipleLocator(1.0))
        ax.grid(axis="y")
        ax.set(ylabel=f"angle of the {link} link (π)", xlim=(0.0, motion.times[-1]))
    rows[0].set_title("(up, down) is flipped into (down, up): multiples of 2π are down, odd multiples of π up")
    rows[1].set_xlabel("time (s)")
    colours = ListedColormap(["#E69F00", "#FFFFFF", "#5C4770"])
    for ax, (link, found) in zip(rows[2:], result.scans.items(), strict=True):
        ax.imshow(found.ends[None, :], cmap=colours, vmin=-1, vmax=1, aspect="auto", extent=(0.0, STRONGEST, 0.0, 1.0))
        ax.set(yticks=[], xlabel=f"push of the {link} link (rad/s): violet flips, white returns, orange neither")
    return portrait, series


def main(quick: bool, output: Path) -> None:
    """Compute, tell and draw."""
    result = compute(121 if quick else 961)
    report(result)
    for number, figure in zip((20, 21), draw(result), strict=True):
        figure.savefig(output / f"figure_{number}.png", dpi=100)
        plt.close(figure)
