"""Figures 15 and 16 of the report: decay of a free swing, and the damping that follows from it.

The report lets a rod swing freely, fits the parabola a t^2 + b t + c to its decay profile, a = 0.0082 +- 0.000687, b =
-0.1979 +- 0.0054, c = 1.28 +- 0.009 (95 %), reads it as linear and so as dry friction, and finds the coefficient, about
2.5, by least squares of a simulated against the measured series, which part after 6 or 7 periods.  It does not say
which rod these figures show; taken here is that of 6.9 cm, and the study `figure_13` is about that of 3.1 cm.
Its data are not at hand, so a film is made of a rod whose profile has that very parabola, at 200 frames a second and
with noise of the report's RMSE, and everything is measured from that film.

First, which rods have that parabola?  At 1.28 rad a swing is so wide that the profile of dry friction is no line and
that of viscous damping no exponential: viscous damping alone already comes with 59 % of the curvature that its
exponential would have, the report's fraction being 54 %.  So the parabola alone does not tell, and what does is its
scatter and the length of the film: for each length there is one mixture of viscous damping and dry friction.

Must come out: the parabola of the report; the mixture that the film was made with, within the errors; dry friction
alone at 2.6 rad/s^2, near the report's 2.5, with residuals twice the noise; viscous damping alone refused.  With other
seeds, 95 % intervals that hold the truth in about 95 % of the films.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, pi, sqrt
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.optimize import least_squares

from cellmap import trajectory
from systems import LONG_ROD
from systems.lab import (
    DampingFits,
    Estimate,
    MotionFit,
    QuadraticDecay,
    effective_length,
    fit_damping,
    fit_motion,
    free_pendulum,
    natural_frequency,
    quadratic_decay,
    swing_envelope,
)
from systems.lab.free_swings.decay_models import decaying
from systems.lab.free_swings.swing_extremes import slowing

REPORT = np.array([0.0082, -0.1979, 1.28])
INTERVALS = np.array([0.000687, 0.0054, 0.009])
RMSE = 0.006664
GRAVITY = 9.8
FRAMES = 200.0  # a second
FILMS = (4.0, 5.0, 6.0, 7.0, 8.0)  # lengths that the report's film may have had (s)
FILM = 6.0  # length taken here
ZERO = 0.01  # by how much the camera's vertical is off (rad)
EARLY = 6.5  # periods that the report's simulation follows its series


@dataclass(frozen=True)
class Rod:
    """A rod with the report's parabola: damping (1/s), friction (rad/s^2), amplitude at the start (rad)."""

    film: float
    damping: float
    friction: float
    amplitude: float

    @property
    def coefficients(self) -> dict[str, float]:
        return {"damping": self.damping, "friction": self.friction}


@dataclass(frozen=True, eq=False)
class Result:
    """Rods that fit the report, the film of one of them, and what was measured from it."""

    rods: list[Rod]
    rod: Rod
    times: NDArray[np.float64]
    angles: NDArray[np.float64]
    parabola: QuadraticDecay
    first: MotionFit
    frequency: Estimate
    fits: DampingFits
    early: MotionFit
    covered: dict[str, tuple[int, int]]


def with_parabola(film: float) -> Rod:
    """Return the rod whose extremes, one each half swing of a film, have the parabola of the report."""
    w = sqrt(GRAVITY / LONG_ROD)
    times = np.arange(0.0, film, pi / w * float(slowing(0.8)))

    def off(q: NDArray[np.float64]) -> NDArray[np.float64]:
        profile = decaying(q[0], {"damping": q[1], "friction": q[2]}, w, times)
        return np.asarray((np.polyfit(times, profile, 2) - REPORT) / INTERVALS)

    found = least_squares(off, [1.28, 0.2, 1.5], bounds=([1.0, 0.0, 0.0], [2.0, 2.0, 5.0]))
    return Rod(film, float(found.x[1]), float(found.x[2]), float(found.x[0]))


def filmed(rod: Rod, seed: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return times and angles of a film of a rod that is released at rest."""
    system = free_pendulum(LONG_ROD, {n: v for n, v in rod.coefficients.items() if v > 0.0}, GRAVITY)
    samples = round(FRAMES * system.length)
    motion = trajectory(system, [rod.amplitude, 0.0], round(rod.film / system.length), samples)
    noise = np.random.default_rng(seed).normal(0.0, RMSE, motion.times.size)
    return motion.times, motion.states[:, 0] + ZERO + noise


def compute(seeds: int) -> Result:
    """Find rods, film one, measure it, and repeat with other noise."""
    rods = [with_parabola(film) for film in FILMS]
    rod = rods[FILMS.index(FILM)]
    times, angles = filmed(rod, 0)
    envelope = swing_envelope(times, angles)
    fits = fit_damping(times, angles)
    system = free_pendulum(LONG_ROD, {"friction": 2.5}, GRAVITY)
    part = times <= EARLY * system.length * float(slowing(1.1))
    early = fit_motion(system, times[part], angles[part], ["length", "friction"], zero=True)
    result = Result(
        rods,
        rod,
        times,
        angles,
        quadratic_decay(envelope, start_time=0.0),
        first_period(times, angles),
        natural_frequency(envelope),
        fits,
        early,
        coverage(rod, seeds),
    )
    report(result)
    return result


def first_period(times: NDArray[np.float64], angles: NDArray[np.float64]) -> MotionFit:
    """Fit length and viscous damping to the first period alone."""
    system = free_pendulum(LONG_ROD, {"damping": 0.2}, GRAVITY)
    part = times <= system.length * float(slowing(REPORT[2]))
    return fit_motion(system, times[part], angles[part], ["length", "damping"], zero=True)


def coverage(rod: Rod, seeds: int) -> dict[str, tuple[int, int]]:
    """Count the films whose 95 % intervals hold the truth, and how many there were."""
    true = {"length": LONG_ROD, **rod.coefficients}
    held = dict.fromkeys(true, 0)
    for seed in range(1, seeds + 1):
        best = fit_damping(*filmed(rod, seed), kinds=["viscous and dry"]).best
        for name, value in true.items():
            low, high = best.interval(name)
            held[name] += low <= value <= high
    return {name: (count, seeds) for name, count in held.items()}


def report(result: Result) -> None:
    """Print what was found beside what is true."""
    print("rods of 6.9 cm with the parabola of the report, by the length of the film:")
    print("  film, s  damping, 1/s  friction, rad/s^2  amplitude, rad")
    for rod in result.rods:
        print(f"  {rod.film:7.1f}  {rod.damping:12.4f}  {rod.friction:17.4f}  {rod.amplitude:14.4f}")
    print(f"\nfilm of {result.rod.film:g} s, {FRAMES:g} frames/s, noise {RMSE:g} rad: {result.parabola.envelope}")
    reach = result.parabola.half_widths()
    for name, found, width, said, interval in zip(
        "abc", result.parabola.coefficients, reach, REPORT, INTERVALS, strict=True
    ):
        print(f"  {name} = {found:.4f} +- {width:.4f}; report {said:.4f} +- {interval:.4f}")
    print(f"  RMSE {result.parabola.rmse:.4f}; report {RMSE}; curvature {result.parabola.curvature:.2f} of exponential")
    w = result.frequency
    print(f"  half swings: w = {w} rad/s, l = {effective_length(w, GRAVITY)} m; true {LONG_ROD}")
    print(f"  motion of the first period, viscous: {result.first}")
    print("\nby the profile alone:")
    assert result.fits.profile is not None
    for model in result.fits.profile.models:
        print(f"  {model}, chi^2 {model.chi_square:.3g}")
    print("by the motion:")
    for kind, fit in result.fits.fits.items():
        print(f"  {kind}: {fit}, correlation of residuals {fit.correlation:.2f}, AICc {fit.aicc:.1f}")
    print(f"  true: damping {result.rod.damping:.4f}, friction {result.rod.friction:.4f}, length {LONG_ROD}")
    print(f"\ndry friction alone, first {EARLY:g} periods: {result.early}; report: about 2.5")
    held = ", ".join(f"{name} {count} of {films}" for name, (count, films) in result.covered.items())
    print(f"95 % intervals that hold the truth: {held}")


def draw(result: Result) -> Figure:
    """Draw the profile, the series, and what each kind of damping leaves."""
    figure, (top, middle, below) = plt.subplots(
        3, 1, figsize=(10.0, 11.0), layout="constrained", sharex=True, height_ratios=(1.2, 1.0, 1.0)
    )
    envelope, t = result.parabola.envelope, result.times
    top.errorbar(
        envelope.times,
        envelope.amplitudes,
        2.0 * envelope.standard_errors,
        fmt="o",
        color="black",
        ms=4.0,
        label="film",
    )
    dense = np.linspace(envelope.times[0], t[-1], 400)
    top.plot(dense, np.polyval(REPORT, dense), "--", color="0.5", label="parabola of the report")
    top.plot(dense, result.parabola(dense), color="#D55E00", lw=1.0, label="parabola of least squares")
    assert result.fits.profile is not None
    for kind, colour in (("viscous", "#009E73"), ("dry", "#CC79A7"), ("viscous and dry", "#0072B2")):
        top.plot(dense, result.fits.profile[kind](dense), color=colour, lw=1.0, label=f"averaged, {kind}")
        residuals = result.fits.fits[kind].residuals[:, 0]
        below.plot(t, residuals, color=colour, lw=0.7, label=f"{kind}: RMSE {result.fits.fits[kind].rmse:.4f} rad")
    top.set(ylabel="distance from rest at the extremes (rad)", title="Figure 15: decay profile", ylim=(0.0, None))
    middle.plot(t, result.angles, ".", color="0.5", ms=2.0, label="film")
    middle.plot(t, result.fits.best.simulated[:, 0], color="#0072B2", lw=0.9, label=result.fits.kind)
    early, last = result.early, result.early.times[-1]
    start = [early.estimates["start theta"], early.estimates["start theta'"]]
    went_on = trajectory(early.system, start, ceil(t[-1] / early.system.length), 100)
    label = f"dry, fitted to {EARLY:g} periods"
    middle.plot(
        went_on.times, went_on.states[:, 0] + early.estimates["zero theta"], color="#CC79A7", lw=0.9, label=label
    )
    middle.axvline(last, color="#CC79A7", lw=0.8, ls=":")
    middle.set(ylabel="angle (rad)", title="Figure 16: measured and simulated series")
    below.set(ylim=(-0.06, 0.06))
    below.set(xlabel="time (s)", ylabel="measured less simulated (rad)", title="What each kind of damping leaves")
    for ax, columns in ((top, 2), (middle, 1), (below, 3)):
        ax.legend(fontsize="small", loc="upper right", ncols=columns)
    return figure


def main(quick: bool, output: Path) -> None:
    """Compute and draw."""
    figure = draw(compute(2 if quick else 100))
    figure.savefig(output / "decay.png", dpi=100)
    plt.close(figure)
