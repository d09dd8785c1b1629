"""Stability of the eight equilibria of the triple pendulum, over frequency and amplitude.

The report asks for the triple pendulum as future work.  Three links of 3.2 cm carry equal masses; the joints are free,
or damped at 10 /s.  Without damping every state decouples into three single pendulums, which gives its window a second
time.  Amplitudes at 100 Hz are read off the maps, whose frequencies include it and whose boundaries are refined.

Must come out (tests/REFERENCES.md): at 100 Hz without damping all eight states are stable from 1.955039 to
2.268102 mm.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from cellmap.bifurcations import StabilityMap
from systems import triple_pendulum

from ._chains import Window, draw_maps, equilibria, intervals, overlap, stability_maps, text_of, windows_of_modes

STATES = equilibria(3)
FREQUENCY = 100.0
LEAST, MOST = 5e-5, 0.006  # amplitudes (m)
DAMPINGS = (0.0, 10.0)


@dataclass(frozen=True, eq=False)
class Result:
    """Maps, windows at 100 Hz by damping and state, and windows of the undamped single pendulums by state."""

    maps: dict[float, dict[str, StabilityMap]]
    windows: dict[float, dict[str, Window]]
    decoupled: dict[str, Window]


def compute(points: int) -> Result:
    """Find the maps and what they say at 100 Hz."""
    frequencies = np.unique(np.append(np.linspace(40.0, 160.0, points), FREQUENCY))
    x, y = ("frequency", frequencies), ("amplitude", np.linspace(LEAST, MOST, points))
    # Damped and undamped alike are one system, which is compiled once for each state.
    systems = {damping: triple_pendulum().with_params(damping=damping) for damping in DAMPINGS}
    maps = {damping: stability_maps(system, STATES, x, y) for damping, system in systems.items()}
    windows = {damping: {name: window_at(found) for name, found in some.items()} for damping, some in maps.items()}
    decoupled = {name: windows_of_modes(systems[0.0], state, MOST) for name, state in STATES.items()}
    return Result(maps, windows, decoupled)


def window_at(found: StabilityMap, frequency: float = FREQUENCY) -> Window:
    """Return the first interval of amplitudes that is stable at one of the frequencies of a map; NaN without one."""
    column = found.columns.x == frequency
    changes = zip(found.columns.y[column].tolist(), found.columns.above[column].tolist(), strict=True)
    at_first = bool(found.unstable[0, found.x == frequency][0] == 0)
    windows = intervals(list(changes), at_first, float(found.y[-1]))
    return windows[0] if windows else (np.nan, np.nan)


def report(result: Result) -> None:
    """Print the windows at 100 Hz."""
    for damping, windows in result.windows.items():
        print(f"stable amplitudes (mm) at {FREQUENCY:g} Hz, joint damping {damping:g} /s")
        for name, window in windows.items():
            print(f"  {name}: {text_of(window)}")
        print(f"  all eight: {text_of(overlap(list(windows.values())), 6)}")
    worst = max(np.abs(np.subtract(result.windows[0.0][name], w)).max() for name, w in result.decoupled.items())
    print(f"single pendulums of the undamped linear modes agree to {1e3 * worst:.1e} mm")


def draw(result: Result) -> Figure:
    """Draw both maps."""
    figure, axes = plt.subplots(1, 2, figsize=(13.0, 5.0), layout="constrained", sharey=True)
    for ax, (damping, maps) in zip(axes, result.maps.items(), strict=True):
        draw_maps(figure, ax, maps, legend=ax is axes[-1])
        ax.set(title=f"Joint damping {damping:g} /s", xlabel="frequency (Hz)")
        ax.label_outer()
    figure.suptitle("Triple pendulum, links 3.2 cm, equal masses: stable equilibria")
    return figure


def main(quick: bool, output: Path) -> None:
    """Compute, tell and draw."""
    result = compute(40 if quick else 250)
    report(result)
    figure = draw(result)
    figure.savefig(output / "triple_stability.png", dpi=100)
    plt.close(figure)
