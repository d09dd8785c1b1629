"""Equilibria of chains of pendulums: their names, their windows of stability, the single pendulums they consist of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise, product
from math import pi

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap, to_rgba
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter
from numpy.typing import NDArray
from scipy.linalg import eigh

from cellmap import ForcedSystem, plot, stability_map
from cellmap.bifurcations import Crossing, StabilityMap, critical_values, floquet_multipliers
from systems import driven_pendulum

State = tuple[float, ...]
Window = tuple[float, float]
Axis = tuple[str, NDArray[np.float64]]

LEAST = 1e-5  # amplitude from which windows are sought (m)
CURVES = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "#000000", "#8C6D1F")


def equilibria(links: int) -> dict[str, State]:
    """Return all equilibria with their angular velocities, by names such as "(0, π)"."""
    states = {}
    for angles in product((0.0, pi), repeat=links):
        name = ", ".join("π" if a else "0" for a in angles)
        states[f"({name})"] = (*angles, *[0.0] * links)
    return states


def stable_windows(system: ForcedSystem, state: State, most: float) -> tuple[tuple[Window, str], ...]:
    """Return the intervals of amplitudes up to `most` where an equilibrium is stable, and how each of them ends."""
    changes = critical_values(system, state, "amplitude", LEAST, most)
    at_first = floquet_multipliers(system, state, {"amplitude": LEAST}).unstable == 0
    windows = intervals([(c.value, c.above) for c in changes], bool(at_first), most)
    lost = {c.value: c.crossing.name for c in changes}
    return tuple((window, lost.get(window[1], "still stable")) for window in windows)


def intervals(changes: Sequence[tuple[float, int]], stable_at_first: bool, most: float) -> tuple[Window, ...]:
    """Return the intervals that are stable between changes: values with the number of unstable multipliers above."""
    edges = [(0.0, 0 if stable_at_first else 1), *sorted(changes), (most, 1)]
    return tuple((low, high) for (low, unstable), (high, _) in pairwise(edges) if unstable == 0)


def first_window(system: ForcedSystem, state: State, most: float) -> Window:
    """Return the first interval of amplitudes where an equilibrium is stable; NaN without one."""
    windows = stable_windows(system, state, most)
    return windows[0][0] if windows else (np.nan, np.nan)


def text_of(window: Window, digits: int = 9) -> str:
    """Write an interval of amplitudes in mm."""
    low, high = window
    return f"{1e3 * low:.{digits}f} to {1e3 * high:.{digits}f}" if low < high else "none"


def overlap(windows: Sequence[Window]) -> Window:
    """Return what intervals have in common: its upper end is below the lower one where that is nothing."""
    lower, upper = np.array(windows).T
    return float(lower.max()), float(upper.min())


def normal_modes(
    lengths: Sequence[float], masses: Sequence[float], state: State
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return lambda of every undamped linear mode about an equilibrium, and the links' deviations in it as columns.

    Each mode is a single pendulum of length 1/abs(lambda), hanging if lambda is above 0 and inverted if it is below.
    """
    below = np.cumsum(np.array(masses, dtype=float)[::-1])[::-1]
    rods, signs = np.array(lengths, dtype=float), np.cos(state[: len(lengths)])
    outer = np.maximum.outer(np.arange(len(rods)), np.arange(len(rods)))
    inertia = below[outer] * np.outer(rods * signs, rods * signs)
    values, shapes = eigh(np.diag(below * rods * signs), inertia)
    return values, shapes


def windows_of_modes(system: ForcedSystem, state: State, most: float) -> Window:
    """Return the first window of an undamped chain from the single pendulums into which it decouples."""
    links = len(state) // 2
    lengths, masses = ([system.params[f"{name}_{i + 1}"] for i in range(links)] for name in ("length", "mass"))
    values, _ = normal_modes(lengths, masses, state)
    single = driven_pendulum().with_params(
        damping=0.0, frequency=system.params["frequency"], gravity=system.params["gravity"]
    )
    return overlap(
        [
            first_window(single.with_params(length=1.0 / abs(v)), (0.0 if v > 0.0 else pi, 0.0), most)
            for v in values.tolist()
        ]
    )


def stability_maps(system: ForcedSystem, states: Mapping[str, State], x: Axis, y: Axis) -> dict[str, StabilityMap]:
    """Return the stability map of every equilibrium over two parameters."""
    return {name: stability_map(system, state, x, y, progress=True) for name, state in states.items()}


def draw_maps(figure: Figure, ax: Axes, maps: Mapping[str, StabilityMap], legend: bool = False) -> None:
    """Draw how many equilibria are stable, with the boundary of each on top, paler where a complex pair crosses."""
    some = next(iter(maps.values()))
    number = sum((m.unstable == 0).astype(int) for m in maps.values())
    shades = ListedColormap([str(1.0 - 0.55 * k / len(maps)) for k in range(len(maps) + 1)])
    norm = BoundaryNorm(np.arange(len(maps) + 2) - 0.5, shades.N)
    mesh = ax.pcolormesh(some.x, some.y, number, cmap=shades, norm=norm, rasterized=True)
    if legend:
        figure.colorbar(mesh, ax=ax, label="stable equilibria", ticks=range(len(maps) + 1))
    for colour, (name, found) in zip(CURVES, maps.items(), strict=False):
        colours = {**dict.fromkeys(Crossing, colour), Crossing.NEIMARK_SACKER: to_rgba(colour, 0.5)}
        plot.stability_map(found, ax=ax, colours=colours, background=False, legend=False)
        ax.plot([], [], color=colour, label=name)
    ax.set_ylabel("amplitude (mm)")
    ax.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{1e3 * y:g}"))
    if legend:
        ax.legend(fontsize="x-small", title="limits of")
