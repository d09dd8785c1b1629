"""Stability of the four equilibria of the double pendulum, over frequency, amplitude, masses and lengths.

The report's future work asks for this map.  Its links of 3.2 cm carry equal masses, or an outer mass of a quarter; both
joints are free, or damped as in the reference set (10 /s).  Without damping each state decouples into two single
pendulums, which gives its window a second time.

Must come out (tests/REFERENCES.md): at 24 Hz with equal masses and without damping, (0, 0) is stable below
3.523140841 mm, both flipping states (0, π) and (π, 0) from 4.452842149 to 9.546244854 mm, and (π, π) never.  All four
are stable together at some amplitude only above 41.136433 Hz (equal masses) or 21.418270 Hz (a quarter).  The reference
set, of 50 Hz and a quarter, loses (0, π) in a Neimark-Sacker bifurcation at 12.532158062 mm.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from scipy.optimize import brentq

from cellmap import ForcedSystem
from cellmap.bifurcations import StabilityMap
from systems import double_pendulum

from ._chains import (
    Window,
    draw_maps,
    equilibria,
    first_window,
    normal_modes,
    overlap,
    stability_maps,
    stable_windows,
    text_of,
    windows_of_modes,
)

STATES = equilibria(2)
MOST = 0.03  # amplitude up to which windows are sought (m)
MASS_RATIOS = (0.05, 0.1, 0.25, 0.5, 1.0, 2.0, 5.0)
LENGTH_RATIOS = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0)


@dataclass(frozen=True, eq=False)
class Result:
    """Windows of stability by case and state, thresholds of frequency by mass ratio, and maps by title."""

    windows: dict[str, dict[str, tuple[tuple[Window, str], ...]]]
    decoupled: dict[str, float]
    thresholds: dict[float, float]
    by_mass: dict[float, dict[str, Window]]
    by_length: dict[float, dict[str, Window]]
    maps: dict[str, dict[str, StabilityMap]]


def pendulum(
    mass_ratio: float = 0.25, frequency: float = 50.0, damping: float = 0.0, length_ratio: float = 1.0
) -> ForcedSystem:
    """Return a double pendulum with an inner link of 3.2 cm.

    All are one system with other parameters, so that damped and undamped ones share what is compiled.
    """
    return double_pendulum().with_params(
        mass_2=mass_ratio, length_2=0.032 * length_ratio, frequency=frequency, damping=damping
    )


def together(system: ForcedSystem) -> Window:
    """Return the amplitudes at which all four states are stable; NaN where one of them never is."""
    return overlap([first_window(system, state, MOST) for state in STATES.values()])


def threshold(mass_ratio: float, lower: float = 16.0, upper: float = 60.0, step: float = 2.0) -> float:
    """Return the frequency (Hz) from which on all four states, undamped, are stable together at some amplitude."""

    def width(frequency: float) -> float:
        least, most = together(pendulum(mass_ratio, frequency))
        return most - least

    frequencies = np.arange(lower, upper + step, step)
    widths = [width(f) for f in frequencies.tolist()]
    opens = next(k for k in range(1, len(widths)) if widths[k - 1] < 0.0 <= widths[k])
    return float(brentq(width, frequencies[opens - 1], frequencies[opens], xtol=1e-12, rtol=1e-14))


def compute(points: int) -> Result:
    """Find windows, thresholds and maps."""
    cases = {
        "24 Hz, equal masses, undamped": pendulum(1.0, 24.0),
        "50 Hz, m2 = m1/4, undamped": pendulum(),
        "50 Hz, m2 = m1/4, 10 /s (reference set)": pendulum(damping=10.0),
    }
    windows = {
        title: {name: stable_windows(system, state, MOST) for name, state in STATES.items()}
        for title, system in cases.items()
    }
    decoupled = {
        title: _deviation(system, windows[title]) for title, system in cases.items() if not system.params["damping"]
    }
    frequency = ("frequency", np.linspace(10.0, 80.0, points))
    amplitude = ("amplitude", np.linspace(1e-4, 0.015, points))
    mass = ("mass_2", np.geomspace(0.01, 10.0, points))
    length = ("length_2", 0.032 * np.linspace(0.1, 3.0, points))
    planes = {
        "Equal masses, undamped": (pendulum(1.0), frequency),
        "Equal masses, 10 /s": (pendulum(1.0, damping=10.0), frequency),
        "m2 = m1/4, undamped": (pendulum(), frequency),
        "m2 = m1/4, 10 /s": (pendulum(damping=10.0), frequency),
        "50 Hz, equal lengths, undamped": (pendulum(), mass),
        "50 Hz, m2 = m1/4, undamped": (pendulum(), length),
    }
    return Result(
        windows,
        decoupled,
        {ratio: threshold(ratio) for ratio in (1.0, 0.25)},
        {ratio: _windows(pendulum(ratio)) for ratio in MASS_RATIOS},
        {ratio: _windows(pendulum(length_ratio=ratio)) for ratio in LENGTH_RATIOS},
        {title: stability_maps(system, STATES, x, amplitude) for title, (system, x) in planes.items()},
    )


def _windows(system: ForcedSystem) -> dict[str, Window]:
    return {name: first_window(system, state, MOST) for name, state in STATES.items()}


def _deviation(system: ForcedSystem, windows: dict[str, tuple[tuple[Window, str], ...]]) -> float:
    """Largest difference between the windows of the chain and of the single pendulums, where there are any."""
    worst = 0.0
    for name, state in STATES.items():
        lower, upper = windows_of_modes(system, state, MOST)
        if windows[name] and lower < upper:
            worst = max(worst, *np.abs(np.subtract(windows[name][0][0], (lower, upper))).tolist())
        elif windows[name] or lower < upper:
            worst = np.inf
    return worst


def report(result: Result) -> None:
    """Print critical amplitudes, thresholds and how windows depend on the ratios."""
    for title, found in result.windows.items():
        print(f"{title}: stable amplitudes (mm)")
        for name, windows in found.items():
            texts = [f"{text_of(window)} ({lost})" for window, lost in windows]
            print(f"  {name}: {', '.join(texts) or 'none'}")
        if title in result.decoupled:
            print(f"  single pendulums of the linear modes agree to {1e3 * result.decoupled[title]:.1e} mm")
    for ratio, frequency in result.thresholds.items():
        print(f"all four stable together, m2/m1 = {ratio:g}, undamped: above {frequency:.6f} Hz")
    for what, table in (("m2/m1", result.by_mass), ("l2/l1", result.by_length)):
        print(f"first stable amplitudes (mm) at 50 Hz, undamped\n  {what:>6}  " + "  ".join(f"{n:>18}" for n in STATES))
        for ratio, first in table.items():
            row = "  ".join(f"{text_of(window, 4):>18}" for window in first.values())
            print(f"  {ratio:6g}  {row}  together {text_of(overlap(list(first.values())), 4)}")
    for name, state in STATES.items():
        values, _ = normal_modes((0.032, 0.032), (1.0, 1.0), state)
        lengths = ", ".join(f"{'hanging' if v > 0 else 'inverted'} {100 / abs(v):.4f} cm" for v in values)
        print(f"equal masses, {name}: {lengths}")


def draw(result: Result) -> Figure:
    """Draw all maps."""
    figure, axes = plt.subplots(2, 3, figsize=(15.0, 9.0), layout="constrained")
    for k, (ax, (title, maps)) in enumerate(zip(axes.T.flat, result.maps.items(), strict=True)):
        draw_maps(figure, ax, maps, legend=k == 0)
        ax.set_title(title)
        name = next(iter(maps.values())).parameters[0]
        if name == "mass_2":
            ax.set(xscale="log", xlabel="$m_2/m_1$")
        else:
            ax.set_xlabel("frequency (Hz)" if name == "frequency" else "length of the outer link (m)")
    figure.suptitle("Double pendulum, inner link 3.2 cm: stable equilibria")
    return figure


def main(quick: bool, output: Path) -> None:
    """Compute, tell and draw."""
    result = compute(40 if quick else 300)
    report(result)
    figure = draw(result)
    figure.savefig(output / "double_stability.png", dpi=100)
    plt.close(figure)
