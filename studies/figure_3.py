"""Figure 3 of the report: the effective potential, and the critical angle of release that grows with the drive.

For the report's rod of 2.72 cm at 50 Hz, V_eff/(m l^2) = -(g/l) cos theta + (A w sin theta)^2/(4 l^2) by Kapitza, with
wells at both equilibria and barriers at cos theta_c = 2 g l/(A w)^2 from upright.  Averaging knows neither damping nor
the moment of release.  Beside it stand the true limits: the angles, on both sides, up to which a release at rest comes
back upright, by exact integration with damping 10 /s.  They depend on the phase, for the slow motion begins with
minus the fast velocity of that moment; they are nearest to theta_c where the pivot is at rest, at its top or bottom.

Must come out: theta_c = 0.927068123 rad at 3 mm and 1.226427972 rad at 4 mm; the inverted state is really stable from
2.329021135978 mm on.  Towards 10 mm boundaries become fractal, and limits are those of the angles tried.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from math import acos, cos, pi
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from cellmap import ForcedSystem
from systems import (
    EffectivePotential,
    IslandWarning,
    ReleaseLimits,
    Well,
    driven_pendulum,
    effective_potential,
    find_well,
    release_limits,
)

DRAWN = (0.0, 0.002, 0.003, 0.004, 0.006, 0.010)
PUBLISHED = {0.003: 0.927068123, 0.004: 1.226427972}


@dataclass(frozen=True, eq=False)
class Release:
    """One amplitude: the well by averaging, Kapitza's angle by his formula, and the true limits."""

    amplitude: float
    well: Well
    formula: float
    limits: ReleaseLimits


@dataclass(frozen=True, eq=False)
class Result:
    potentials: dict[float, EffectivePotential]
    releases: list[Release]


def compute(amplitudes: NDArray[np.float64], phases: NDArray[np.float64]) -> Result:
    """Find potentials, wells and limits of release."""
    potentials = {a: effective_potential(driven_pendulum(amplitude=a)) for a in DRAWN}
    releases = []
    for amplitude in amplitudes.tolist():
        system = driven_pendulum(amplitude=amplitude)
        well = find_well(effective_potential(system))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", IslandWarning)  # the report prints the errors
            limits = release_limits(system, pi, phases)
        releases.append(Release(amplitude, well, _kapitza_angle(system), limits))
    result = Result(potentials, releases)
    report(result)
    return result


def _kapitza_angle(system: ForcedSystem) -> float:
    p = system.parameters
    return acos(2.0 * p.gravity * p.length / (2.0 * pi * p.frequency * p.amplitude) ** 2)


def kapitza_potential(system: ForcedSystem, angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return Kapitza's potential by his formula, per mass (m^2/s^2)."""
    p = system.parameters
    lift = 0.0 if "amplitude" not in system.params else 2.0 * pi * p.frequency * p.amplitude
    return -p.gravity * p.length * np.cos(angles) + (lift * np.sin(angles)) ** 2 / 4.0


def report(result: Result) -> None:
    """Print errors of the averages against the formula, and angles side by side."""
    angles = np.linspace(-pi, pi, 1001)
    worst = max(np.abs(v(angles) - kapitza_potential(v.system, angles)).max() for v in result.potentials.values())
    print(f"largest difference of the potential to Kapitza's formula: {worst:.1e} m^2/s^2")
    for amplitude, published in PUBLISHED.items():
        well = find_well(effective_potential(driven_pendulum(amplitude=amplitude)))
        print(f"theta_c at {1e3 * amplitude:g} mm: {well.critical_angle:.9f} rad, and published {published:.9f}")
    phases = result.releases[0].limits.phases
    print("\nTrue limits of release (rad) by phase of the drive, in periods; 0 is the pivot at its top.")
    print(
        "  A, mm    theta_c  formula-  "
        + "".join(f"  {p:7.3f}" for p in phases)
        + "   two sides differ by, largest error"
    )
    for r in result.releases:
        lower, upper = r.limits.lower, r.limits.upper
        row = f"{1e3 * r.amplitude:7.3f}  {r.well.critical_angle:9.6f}  {r.formula - r.well.critical_angle:8.0e}  "
        print(
            row
            + "".join(f"  {a:7.4f}" for a in upper)
            + f"   {np.abs(upper - lower).max():.0e}  {r.limits.error.max():.0e}"
        )


def draw(result: Result) -> Figure:
    """Draw potentials, and angles over the amplitude."""
    figure, (curves, widths) = plt.subplots(1, 2, figsize=(13.0, 4.6), layout="constrained")
    angles = np.linspace(-0.5 * pi, 1.5 * pi, 721)
    for k, (amplitude, potential) in enumerate(result.potentials.items()):
        scaled = potential(angles) / potential.system.parameters.length**2
        curves.plot(angles, scaled, color=plt.get_cmap("viridis")(k / len(DRAWN)), label=f"{1e3 * amplitude:g} mm")
    curves.set(
        xlabel=r"$\theta$, rad (0 hangs, $\pi$ is upright)", ylabel=r"$V_{eff}/(m \ell^2)$, 1/s$^2$", ylim=(None, 1500)
    )
    curves.set_title("Effective potential")
    curves.legend(title="amplitude", fontsize="small")
    least = min(r.amplitude for r in result.releases) * np.sqrt(cos(result.releases[0].formula))
    fine = np.linspace(least, max(r.amplitude for r in result.releases), 400)
    widths.plot(1e3 * fine, np.arccos(np.minimum(1.0, (least / fine) ** 2)), "k-", label="by averaging (Kapitza)")
    amplitudes = [1e3 * r.amplitude for r in result.releases]
    for k, phase in enumerate(result.releases[0].limits.phases):
        colour = plt.get_cmap("twilight")(0.1 + 0.8 * phase)
        for side, mark in (("upper", "^"), ("lower", "v")):
            found = [getattr(r.limits, side)[k] for r in result.releases]
            label = f"{side} side, phase {phase:g}" if side == "upper" else None
            widths.plot(amplitudes, found, mark, ls=":", lw=0.7, ms=4.0, mfc="none", color=colour, label=label)
    widths.set(xlabel="amplitude, mm", ylabel="critical angle from upright, rad", title="Largest angle of release")
    widths.legend(fontsize="x-small", loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def main(quick: bool, output: Path) -> None:
    """Compute and draw."""
    amplitudes = np.array([0.003, 0.004, 0.008]) if quick else np.linspace(0.0025, 0.0100, 31)
    result = compute(amplitudes, np.arange(4) / 4 if quick else np.arange(8) / 8)
    figure = draw(result)
    figure.savefig(output / "figure_3.png", dpi=100)
    plt.close(figure)
