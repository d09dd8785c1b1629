"""Period doublings to chaos: the driven pendulum beyond the limits of stability of its equilibria.

The report asks for the cascade as future work.  Two pendulums: its rod of 2.72 cm at 50 Hz with damping 10 /s, over the
amplitude, and one at its principal resonance with weak damping (alpha = 0.25, gamma = 0.05, dimensionless), over beta.
Where a multiplier of an equilibrium passes -1, a swing of twice the drive's period appears.  After half its period the
swing is its own mirror image, and such an orbit cannot double: it first loses its symmetry in a pitchfork bifurcation,
and the asymmetric orbits double without end.  Everything is computed twice: bifurcations by continuation, and the
long-time behaviour of orbits by brute force.

Must come out: the hanging and the inverted state of the rod double at 12.210173235 and 12.542910208 mm, and at weak
damping the hanging one at beta = 0.050027335537 (tests/REFERENCES.md); a pitchfork stands between the first and
the second doubling of an equilibrium; ratios of gaps tend to Feigenbaum's 4.669201609; at beta = 0.55 the pendulum
tumbles chaotically.

Further results: with damping 10 /s chaos is rare.  Beyond its doublings the hanging swing is chaotic over 3e-4 mm, and
then ends; by that time hardly any orbit converges to it.  Its basin is lost to rotations, which from there on attract
all initial conditions but those of other swings near 31.5 mm.  Tumbling is a transient of some dozens of periods: up to
40 mm no chaotic attractor is found.  With weak damping the swings end in the same way at beta = 0.3355.  There
rotations double, too, up to 0.4516, and shortly afterwards a chaotic (tumbling) attractor attracts all orbits.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from cellmap import bifurcation_diagram, find_basins, periodic_orbit, plot, stroboscopic_map
from cellmap.basins import BasinContinuation, continue_basins
from cellmap.bifurcations import BifurcationDiagram, Cascade, period_doubling_cascade
from cellmap.orbits import Kind
from systems import dimensionless_pendulum, driven_pendulum

FEIGENBAUM = 4.669201609
PRECISE: dict[str, Any] = {"rtol": 1e-12, "atol": 1e-12}
ROD = driven_pendulum(amplitude=0.012)
WEAK = dimensionless_pendulum(alpha=0.25, beta=0.04, gamma=0.05)
TUMBLING = 0.55
LIMITS = {ROD.name: (11.5e-3, 16.5e-3), WEAK.name: (0.02, 0.7)}
LARGEST = 40e-3  # amplitude up to which tumbling is sought (m)
LINES = 20  # of a table that is printed, about
CLASSES = {"rest and swings": "#56B4E9", "rotations": "#E69F00", "tumbling": "#CC79A7", "undecided": "black"}


@dataclass(frozen=True, eq=False)
class Route:
    """Results over one parameter: cascades by the orbit that begins them, followed orbits, fractions of basins."""

    cascades: dict[str, Cascade]
    diagram: BifurcationDiagram
    basins: BasinContinuation


@dataclass(frozen=True, eq=False)
class Result:
    """Both routes; the end of the hanging swing; settling times in periods, by amplitude."""

    rod: Route
    weak: Route
    end: BifurcationDiagram
    waits: dict[float, NDArray[np.int32]]


def rod_cascades(doublings: int) -> dict[str, Cascade]:
    """Return the cascades that begin with the equilibria of the report's rod."""
    exact = stroboscopic_map(ROD, **PRECISE)
    return {
        state: period_doubling_cascade(exact, periodic_orbit(exact, [place, 0.0]), "amplitude", 0.02, doublings)
        for state, place in (("hanging", 0.0), ("inverted", pi))
    }


def weak_cascades(doublings: int) -> dict[str, Cascade]:
    """Return the cascades of the hanging state and of the rotations (both have the same) at weak damping."""
    exact = stroboscopic_map(WEAK, **PRECISE)
    rotating = exact.with_params(beta=0.3)
    return {
        "hanging": period_doubling_cascade(exact, periodic_orbit(exact, [0.0, 0.0]), "beta", 0.7, doublings),
        "rotation": period_doubling_cascade(rotating, periodic_orbit(rotating, [2.85, 0.83]), "beta", 0.7, doublings),
    }


def end_of_swing(cascade: Cascade, values: int) -> BifurcationDiagram:
    """Follow the orbit that is born in the fourth doubling through the accumulation, until it is gone."""
    begin, last = 0.5 * (cascade.values[3] + cascade.values[4]), cascade.accumulation
    over = np.linspace(begin, 2.0 * last - begin, values)
    born = next(branch for branch in cascade.branches if branch.period == cascade.periods[3])
    start = born.orbits_at(float(begin))[0].points[0]
    periods = 200 + values
    return bifurcation_diagram(
        stroboscopic_map(ROD), cascade.parameter, over, start, follow="up", transient=periods, periods=periods
    )


def sample(fastest: float, initial_conditions: int) -> NDArray[np.float64]:
    """Return random initial conditions over the circle and all angular velocities up to the fastest."""
    return np.random.default_rng(0).uniform((-pi, -fastest), (pi, fastest), (initial_conditions, 2))


def compute(values: int, initial_conditions: int, doublings: int) -> Result:
    """Follow all cascades, sample orbits and basins over both parameters, and measure how long orbits tumble."""
    rod, weak = stroboscopic_map(ROD), stroboscopic_map(WEAK)
    cascades = rod_cascades(doublings)
    amplitude, beta = (np.linspace(*LIMITS[name], values) for name in (ROD.name, WEAK.name))
    settled: dict[str, Any] = {"follow": "up", "transient": 4 * values + 100, "periods": values + 64}
    states = np.array([[0.05, 0.0], [pi - 0.05, 0.0]])
    few = max(8, values // 8)
    wide = np.append(np.linspace(*LIMITS[ROD.name], few), np.linspace(17e-3, LARGEST, few))
    window = sample(500.0, initial_conditions)
    rods = Route(
        cascades,
        bifurcation_diagram(rod, "amplitude", amplitude, states, **settled),
        continue_basins(rod, "amplitude", wide, window, progress=True),
    )
    slow = Route(
        weak_cascades(doublings),
        bifurcation_diagram(weak, "beta", beta, states[0], **settled),
        continue_basins(weak, "beta", np.linspace(0.04, 0.7, few), sample(3.0, initial_conditions // 2), progress=True),
    )
    waits = {a: find_basins(rod.with_params(amplitude=a), window).settling_time for a in (10e-3, 16e-3, 20e-3, LARGEST)}
    return Result(rods, slow, end_of_swing(cascades["hanging"], 2 * values), waits)


def basin_fractions(basins: BasinContinuation) -> dict[str, NDArray[np.float64]]:
    """Return the fractions of orbits that rest or swing, rotate, tumble or are undecided, at each value."""
    found = {name: np.zeros(len(basins.values)) for name in CLASSES}
    names = {Kind.ROTATING: "rotations", Kind.CHAOTIC: "tumbling"}
    for k, attractors in enumerate(basins.attractors):
        for label, fraction in zip(basins.labels, basins.fractions[k], strict=True):
            kind = attractors[label].kind if label in attractors else None
            name = "undecided" if label < 0 else names.get(kind, "rest and swings") if kind else "rest and swings"
            found[name][k] += fraction
    return found


def chaotic_end(diagram: BifurcationDiagram) -> tuple[float, float, float]:
    """Return where a swing is first chaotic, where it is gone, and its largest exponent in between."""
    swings = _swings(diagram)
    chaos = diagram.chaotic[0] & swings
    first, gone = float(diagram.values[chaos][0]), float(diagram.values[~swings][0])
    return first, gone, float(diagram.exponents[0, chaos, 0].max())


def _swings(diagram: BifurcationDiagram) -> NDArray[np.bool_]:
    """Return where all recorded angles are within pi/2 of hanging."""
    return np.abs(diagram.points[0, :, :, 0]).max(axis=-1) < 0.5 * pi


def report(result: Result) -> None:
    """Print bifurcations, ratios, exponents, fractions and times."""
    for title, route, unit, factor in (
        ("rod of 2.72 cm, 50 Hz, 10 /s", result.rod, " mm", 1e3),
        ("alpha = 0.25, gamma = 0.05", result.weak, "", 1.0),
    ):
        print(f"{title}: {route.diagram.parameter}")
        for state, cascade in route.cascades.items():
            print(f"  {state}: {cascade.end}")
            for branch, b in zip(cascade.branches, cascade.bifurcations, strict=True):
                print(f"    period {branch.period:3d} to {factor * b.value:.10f}{unit}, {b.kind}")
            print(f"    ratios {', '.join(f'{r:.4f}' for r in cascade.ratios)} (Feigenbaum {FEIGENBAUM})")
            print(f"    they accumulate at {factor * cascade.accumulation:.8f}{unit}")
        parts = basin_fractions(route.basins)
        print(f"  {'':10s}" + "".join(f"{name:>18s}" for name in parts))
        for k in range(0, len(route.basins.values), max(1, len(route.basins.values) // LINES)):
            row = "".join(f"{100 * part[k]:16.2f} %" for part in parts.values())
            print(f"  {factor * route.basins.values[k]:10.4f}{row}")
        print(
            f"  at all {len(route.basins.values)} values: tumbling at most {100 * parts['tumbling'].max():.2f} %",
            end=", ",
        )
        print(f"undecided at most {100 * parts['undecided'].max():.2f} %")
        print(f"  of {route.basins.counts[0].sum()} starts at each value; standard errors up to", end=" ")
        print(f"{100 * route.basins.standard_errors.max():.2f} %")
    first, gone, most = chaotic_end(result.end)
    print(
        f"the hanging swing of the rod is chaotic from {1e3 * first:.6f} mm and gone at {1e3 * gone:.6f} mm", end=", "
    )
    print(f"with exponents up to {most:.3f} a period")
    for a, times in result.waits.items():
        print(f"settled at {1e3 * a:g} mm: half of the orbits in {np.median(times):g} periods, all in {times.max()}")
    weak = result.weak.diagram
    k = int(np.abs(weak.values - TUMBLING).argmin())
    largest, error = weak.exponents[0, k, 0], weak.standard_errors[0, k, 0]
    print(f"tumbling at beta = {weak.values[k]:.4f}: largest exponent {largest:.3f} +- {error:.3f} a period", end=", ")
    print("chaotic" if weak.chaotic[0, k] else "not chaotic")


def draw(result: Result) -> Figure:
    """Draw points, exponents and fractions of both routes, and the end of the rod's swing beside the ratios."""
    figure, axes = plt.subplots(3, 3, figsize=(15.0, 11.0), layout="constrained", height_ratios=(2.0, 1.0, 1.0))
    columns = (result.rod.diagram, result.end, result.weak.diagram)
    titles = ("Rod, 50 Hz, 10 /s", "The end of its hanging swing", "Weak damping, at resonance")
    for (top, middle, _), diagram, title in zip(axes.T, columns, titles, strict=True):
        plot.bifurcation_diagram(diagram, ax=top, size=2.0)
        top.set_title(title)
        if legend := top.get_legend():
            legend.remove()
        middle.axhline(0.0, color="0.6", linewidth=0.8)
        for own in diagram.exponents[..., 0]:
            middle.plot(diagram.values, own, linewidth=0.8)
        middle.set_ylabel("largest exponent")
        for ax in (top, middle):
            ax.set_xlim(diagram.values[0], diagram.values[-1])
    for column, route in ((0, result.rod), (2, result.weak)):
        # What is unstable, and the mirror images, only continuation knows.
        for cascade in route.cascades.values():
            plot.branches(cascade.branches[:4], ax=axes[0, column], colour="0.4", legend=False)
        _draw_fractions(axes[2, column], route)
    axes[0, 1].set_ylim(*_around(result.end))
    ratios = axes[2, 1]
    for route, marker in ((result.rod, "o"), (result.weak, "s")):
        for state, cascade in route.cascades.items():
            away = np.abs(cascade.ratios - FEIGENBAUM)
            ratios.semilogy(np.arange(1, away.size + 1), away, marker=marker, label=f"{route.diagram.system}, {state}")
    ratios.set(xlabel="ratio of gaps, in their order", ylabel=f"distance from {FEIGENBAUM}")
    ratios.legend(fontsize="x-small")
    return figure


def _draw_fractions(ax: Axes, route: Route) -> None:
    parts = basin_fractions(route.basins)
    ax.stackplot(route.basins.values, list(parts.values()), colors=list(CLASSES.values()), labels=list(parts), lw=0.0)
    low, high = LIMITS[route.diagram.system]
    ax.set(
        xlim=(low, min(high, route.basins.values[-1])),
        ylim=(0.0, 1.0),
        xlabel=route.basins.parameter,
        ylabel="initial_conditions",
    )
    ax.legend(fontsize="x-small", loc="lower left")


def _around(diagram: BifurcationDiagram) -> tuple[float, float]:
    """Return the heights between which the swing is, with some space."""
    low, high = np.percentile(diagram.points[0, _swings(diagram)][..., 0], (0.5, 99.5))
    return float(low - 0.1 * (high - low)), float(high + 0.1 * (high - low))


def main(quick: bool, output: Path) -> None:
    """Compute, tell and draw."""
    result = compute(60, 100, 5) if quick else compute(400, 1000, 8)
    report(result)
    figure = draw(result)
    figure.savefig(output / "cascade.png", dpi=100)
    plt.close(figure)
