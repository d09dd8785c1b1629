"""Basin stability of one machine at an infinite bus, beside its linear stability (Menck et al. 2013; Stender 2022).

theta'' = P - 0.1 theta' - sin theta: synchrony is a fixed point for abs(P) < 1, where all its exponents are -0.05, so
that linear stability does not tell how near the end is.  From P_c on there is a second attractor, on which the machine
turns at another frequency; for small damping P_c is 4/pi times the damping, to first order (Levi, Hoppensteadt,
Miranker, Quarterly of Applied Mathematics 36 (1978) 167).  Basin stability falls from 1 at P_c to 0 at 1 (Menck,
Heitzig, Marwan, Kurths, Nature Physics 9 (2013) 89).  Disturbances are uniform in all phases and in angular velocities
up to 10, as in the table of Stender and Hoffmann, Nonlinear Dynamics 107 (2022) 1451, where P = 0.5.

Must come out: 0.152 at P = 0.5; P_c = 0.1273 to the first order in the damping; 1 below it; an exponent of -0.05.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import asin, pi
from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from cellmap import find_attractors, stroboscopic_map
from cellmap.analysis.resilience import NodeStability, node_stability
from systems import power_grid

DAMPING = 0.1
TABLE = 0.5, 0.152  # power, basin stability
FIRST_ORDER = 4.0 * DAMPING / pi
POWERS = (0.05, 0.1, 0.12, 0.14, 0.16, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.97)
QUICK_POWERS = (0.1, 0.16, 0.3, 0.5, 0.9)
BUS = stroboscopic_map(power_grid((0.5,), ((0, 1),), coupling=1.0, damping=DAMPING, frequency=2.0 * pi))
NODE = {"1": {"theta_1": (-pi, pi), "omega_1": (-10.0, 10.0)}}


@dataclass(frozen=True, eq=False)
class Result:
    """Basin stability at each power, and the interval in which the running solution appears."""

    powers: tuple[float, ...]
    rows: list[NodeStability]
    onset: tuple[float, float]


def stability_at(power: float, n_samples: int) -> NodeStability:
    """Return basin stability of synchrony at one power."""
    at = BUS.with_params(power_1=power)
    synchrony = find_attractors(at, [[asin(power), 0.0]])
    return node_stability(at, 0, NODE, n_samples, synchrony, max_periods=400)


def onset_of_running(steps: int, periods: int = 2000) -> tuple[float, float]:
    """Return powers without and with a running solution, by bisection; it begins with the mean frequency P/damping."""
    low, high = 0.5 * FIRST_ORDER, 2.0 * FIRST_ORDER
    for _ in range(steps):
        power = 0.5 * (low + high)
        end = BUS.with_params(power_1=power).iterate([[pi, power / DAMPING]], periods)
        if abs(end.points[0, 1]) < 1e-6:
            low = power
        else:
            high = power
    return low, high


def compute(powers: tuple[float, ...], n_samples: int) -> Result:
    """Compute everything and print it."""
    result = Result(powers, [stability_at(power, n_samples) for power in powers], onset_of_running(16))
    print("power  basin stability  exponent per unit of time")
    for power, row in zip(result.powers, result.rows, strict=True):
        found = f"{row.fractions[0]:.4f} +- {row.standard_errors[0]:.4f}"
        print(f"{power:5.2f}  {found:17}  {row.exponent:8.4f}")
    print(f"published at {TABLE[0]}: {TABLE[1]}")
    print(f"running solution from P = {result.onset[1]:.4f} on; to first order {FIRST_ORDER:.4f}")
    return result


def draw(result: Result) -> Figure:
    """Draw basin stability, with the published value, and linear stability over the power."""
    figure, ax = plt.subplots(figsize=(7.0, 4.0), layout="constrained")
    fractions = [row.fractions[0] for row in result.rows]
    errors = [row.standard_errors[0] for row in result.rows]
    ax.errorbar(result.powers, fractions, errors, fmt="o-", ms=4.0, capsize=3.0, label="basin stability")
    ax.plot(*TABLE, "x", color="black", ms=9.0, label="Stender and Hoffmann (2022)")
    ax.plot(result.powers, [-row.exponent / (0.5 * DAMPING) for row in result.rows], "--", label="decay, 2/damping")
    ax.axvline(result.onset[1], color="0.6", linewidth=1.0, label="running solution appears")
    ax.set(xlabel="P", ylabel="stability of synchrony", xlim=(0.0, 1.0), ylim=(0.0, 1.1))
    ax.legend(frameon=False)
    return figure


def main(quick: bool, output: Path) -> None:
    """Compute, print and draw."""
    result = compute(QUICK_POWERS, 1000) if quick else compute(POWERS, 10_000)
    figure = draw(result)
    figure.savefig(output / "basin_stability.png", dpi=150)
    plt.close(figure)
