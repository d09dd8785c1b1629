"""Figure 2 of the report: where the hanging and the inverted state are stable, over frequency and amplitude.

Omega = f/f0 and epsilon = A/l (Blackburn et al. 1992).  The exact curves are multipliers on the unit circle; besides
them stand Blackburn's approximations sqrt(2)/Omega (inverted state gained) and 0.450 + 1.799/Omega^2 (lost), with their
errors.  Damping is a family of curves, and at large drive stability comes back in narrow windows.

Must come out (tests/REFERENCES.md): for the report's rod at 50 Hz with damping 10 /s the inverted state is stable
from 2.329021135978 to 12.542910208 mm and again near 103 mm, the hanging one up to 12.210173235 mm; for large Omega the
upper limits tend to 0.454023 + 1.679195/Omega^2 (inverted) and 0.454023 - 1.679195/Omega^2 (hanging).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, to_rgba
from matplotlib.figure import Figure

from cellmap import ForcedSystem, plot, stability_map
from cellmap.bifurcations import CriticalValue, Crossing, StabilityMap, critical_values
from systems import driven_pendulum

STATES = {"hanging": (0.0, 0.0), "inverted": (pi, 0.0)}
DAMPINGS = (0.0, 0.5, 1.0, 2.0)  # over w0
RESURRECTION = 5.0  # largest epsilon of the wide map
CLASSES = ("neither", "hanging alone", "inverted alone", "both")
COLOURS = ("#FFFFFF", "#CFE3F1", "#F5DDB0", "#BFE0C8")
CURVES = {"hanging": "#0072B2", "inverted": "#D55E00"}


@dataclass(frozen=True, eq=False)
class Result:
    """Maps by damping and state, and the wide map of the undamped pendulum."""

    maps: dict[float, dict[str, StabilityMap]]
    wide: dict[str, StabilityMap]
    rod: dict[str, tuple[CriticalValue, ...]]


def scaled(damping: float = 0.0) -> ForcedSystem:
    """Return the pendulum with l = 1 and f0 = 1: its amplitude is epsilon and its frequency Omega."""
    return driven_pendulum(length=1.0, amplitude=0.1, frequency=10.0, damping=2.0 * pi * damping, gravity=4.0 * pi * pi)


def compute(points: int) -> Result:
    """Find all maps, and the limits of the report's rod."""
    frequencies = np.linspace(2.0, 20.0, points)
    maps = {damping: _both(scaled(damping), frequencies, np.linspace(0.002, 0.9, points)) for damping in DAMPINGS}
    wide = _both(scaled(), frequencies, np.linspace(0.002, RESURRECTION, 2 * points))
    rod = {state: critical_values(driven_pendulum(), place, "amplitude", 1e-4, 0.11) for state, place in STATES.items()}
    result = Result(maps, wide, rod)
    report(result)
    return result


def _both(system: ForcedSystem, frequencies: np.ndarray, amplitudes: np.ndarray) -> dict[str, StabilityMap]:
    axes = ("frequency", frequencies), ("amplitude", amplitudes)
    return {state: stability_map(system, place, *axes, progress=True) for state, place in STATES.items()}


def report(result: Result) -> None:
    """Print the limits of the report's rod, the asymptotes, and the errors of the approximations."""
    for state, found in result.rod.items():
        for c in found:
            change = "gained" if c.gains else "lost"
            print(f"{state} state {change} at A = {1e3 * c.value:.9f} mm ({c.crossing.name})")
    far = scaled().with_params(frequency=100.0)
    limits = {state: _first_loss(far, place) for state, place in STATES.items()}
    mean, slope = 0.5 * sum(limits.values()), 0.5 * (limits["inverted"] - limits["hanging"]) * 100.0**2
    print(f"upper limits at large Omega, from Omega = 100: {mean:.6f} +- {slope:.6f}/Omega^2")
    print("  Omega   gained at  sqrt(2)/Omega  error       lost at  0.450 + 1.799/Omega^2  error")
    for omega in (4.0, 6.0, 10.0, 20.0):
        system = scaled().with_params(frequency=omega)
        inverted = critical_values(system, STATES["inverted"], "amplitude", 0.01, 0.9)
        gained, lost = inverted[0].value, inverted[1].value
        lower, upper = sqrt(2.0) / omega, 0.450 + 1.799 / omega**2
        print(
            f"{omega:7g}  {gained:10.8f}  {lower:13.8f}  {100 * (lower / gained - 1):+6.2f} %  {lost:10.8f}"
            f"  {upper:21.8f}  {100 * (upper / lost - 1):+6.2f} %"
        )


def _first_loss(system: ForcedSystem, place: tuple[float, float]) -> float:
    return next(c.value for c in critical_values(system, place, "amplitude", 0.001, 0.6) if c.loses)


def draw(result: Result) -> Figure:
    """Draw regions with their curves, the family over damping, and the windows at large drive."""
    figure, (regions, family, windows) = plt.subplots(1, 3, figsize=(15.0, 4.8), layout="constrained")
    maps = result.maps[0.0]
    stable = {state: (m.unstable == 0).astype(int) for state, m in maps.items()}
    x, y = maps["hanging"].x, maps["hanging"].y
    regions.pcolormesh(
        x,
        y,
        stable["hanging"] + 2 * stable["inverted"],
        cmap=ListedColormap(COLOURS),
        vmin=-0.5,
        vmax=3.5,
        rasterized=True,
    )
    for label, colour in zip(CLASSES, COLOURS, strict=True):
        regions.fill_between([], [], color=colour, edgecolor="0.5", label=f"stable: {label}")
    for state, found in maps.items():
        _curve(regions, found, CURVES[state])
    regions.plot(x, sqrt(2.0) / x, "k--", lw=1.0, label=r"$\sqrt{2}/\Omega$")
    regions.plot(x, 0.450 + 1.799 / x**2, "k:", lw=1.3, label=r"$0.450 + 1.799/\Omega^2$")
    regions.set_title("Undamped, with Blackburn's approximations")
    for k, (damping, pair) in enumerate(result.maps.items()):
        shade = 0.25 + 0.75 * k / max(1, len(result.maps) - 1)
        for state, found in pair.items():
            _curve(family, found, to_rgba(CURVES[state], shade), label=f"{state}, {damping:g} $\\omega_0$")
    family.set_title("Damping")
    family.legend(fontsize="x-small", ncols=2)
    for state, found in result.wide.items():
        _curve(windows, found, CURVES[state], label=state)
    windows.set_title("Large drive, undamped: stability comes back")
    windows.legend(fontsize="x-small")
    regions.legend(fontsize="x-small", loc="upper right")
    for ax, top in ((regions, y[-1]), (family, y[-1]), (windows, RESURRECTION)):
        ax.set(xlim=(x[0], x[-1]), ylim=(0.0, top), xlabel=r"$\Omega = f/f_0$", ylabel=r"$\epsilon = A/l$")
    return figure


def _curve(ax: Axes, found: StabilityMap, colour: Any, label: str | None = None) -> None:
    """Draw the boundaries of a map in one colour."""
    plot.stability_map(found, ax=ax, colours=dict.fromkeys(Crossing, colour), background=False, legend=False)
    ax.plot([], [], color=colour, label=label)


def main(quick: bool, output: Path) -> None:
    """Compute and draw."""
    figure = draw(compute(60 if quick else 400))
    figure.savefig(output / "figure_2.png", dpi=100)
    plt.close(figure)
