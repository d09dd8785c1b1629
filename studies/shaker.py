"""The drive of a pivot from the record of an accelerometer: how well it is recovered, and what that does to stability.

Records of a sine, of two harmonics and of a triangle wave are made with noise, offset, drift, a converter's steps,
uneven times, lost samples and saturation, and the drive is recovered from each.  Over many seeds the errors are
compared with the error bars.  The peak-to-peak volts of a noisy record, as an oscilloscope shows them, are too large:
the noise adds to both extremes.  Those of the fit are not.  At last a recovered drive goes into a scene, and the
amplitude at which the inverted pendulum gains stability under that very drive is compared with the true one.

Must come out: 95 % of the errors within 1.96 error bars, for white and for coloured noise, where bars that take
coloured noise for white cover less; critical amplitudes that agree within the errors carried over from the covariance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import pi
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from cellmap.bifurcations import critical_values
from systems import Effect, Gravity, HarmonicDrive, Pendulum, TriangleDrive, VerticalDrive, ViscousDamping, scene
from systems.lab import (
    RecoveredDrive,
    acceleration_from_volts,
    displacement_amplitude,
    record_acceleration,
    recover_drive,
    volts_from_acceleration,
)

Array = NDArray[np.float64]

SINE = VerticalDrive(0.003, 47.37, 3.1)
TWO = HarmonicDrive((0.003, 0.0004), (3.1, -1.0), 43.37)
TRIANGLE = TriangleDrive(300.0, 41.3, 0.4)
TRIANGLE_HARMONICS = np.array([1.0, 3.0, 5.0, 7.0])
EVEN = np.arange(2000) / 2000.0
ROD, GRAVITY, DAMPING = 0.0272, 9.8, 10.0


@dataclass(frozen=True, eq=False)
class Case:
    """A record with faults, and the drive that was recovered from it."""

    name: str
    drive: Effect
    times: Array
    record: Array
    recovered: RecoveredDrive


def true_harmonics(drive: Effect, count: int) -> tuple[Array, Array]:
    """Return true amplitudes (m) and phases of the harmonics of a drive; NaN phases where there is no harmonic."""
    order = np.arange(1, count + 1)
    if isinstance(drive, TriangleDrive):
        # (2/pi) asin cos has the odd harmonics 8/(pi k)^2; twice integrated, they fall by another square.
        heights = np.where(order % 2 == 1, 8.0 * drive.acceleration / (pi * order) ** 2, 0.0)
        phases = np.where(order % 2 == 1, order * drive.phase, np.nan)
        return heights / (2.0 * pi * drive.frequency * order) ** 2, phases
    pairs = (
        zip(drive.amplitudes, drive.phases, strict=True)
        if isinstance(drive, HarmonicDrive)
        else [(drive.parameters["amplitude"], drive.parameters["phase"])]
    )
    known = list(pairs) + [(0.0, np.nan)] * count
    return np.array([a for a, _ in known[:count]]), np.array([p for _, p in known[:count]])


def wrapped(angle: Array) -> Array:
    """Return angles between -pi and pi."""
    return np.angle(np.exp(1j * angle))


def cases() -> list[Case]:
    """Make and read the records."""
    rng = np.random.default_rng(5)
    uneven = np.sort(rng.uniform(0.0, 1.0, 2000))
    # Volts at 0.1 V per g, with a converter of 10 bits over 5 V.
    volts = record_acceleration(SINE, EVEN, noise=0.03, offset=0.4, full_scale=5.0, bits=10, volts_per_g=0.1, rng=1)
    made = [
        ("sine, in volts, 10 bits", SINE, EVEN, acceleration_from_volts(volts)),
        ("sine, drift and coloured noise", SINE, EVEN, _made(SINE, noise=30.0, noise_time=0.004, drift=100.0)),
        ("sine, saturated at 220 m/s²", SINE, EVEN, _made(SINE, noise=5.0, full_scale=220.0)),
        ("sine, 3 periods", SINE, EVEN[:127], _made(SINE, noise=3.0)[:127]),
        ("two harmonics, uneven times", TWO, uneven, record_acceleration(TWO, uneven, 5.0, offset=9.8, rng=2)),
        ("two harmonics, 60 % lost", TWO, EVEN, _made(TWO, noise=5.0, missing=0.6)),
        ("triangle", TRIANGLE, EVEN, _made(TRIANGLE, noise=5.0)),
    ]
    return [Case(name, drive, t, a, recover_drive(t, a)) for name, drive, t, a in made]


def _made(drive: Effect, **faults: float) -> Array:
    return record_acceleration(drive, EVEN, offset=9.8, rng=3, **faults)  # type: ignore[arg-type]


def deviations(drive: Effect, found: RecoveredDrive) -> Array:
    """Return errors of frequency, amplitudes and phases in units of the error bars; the triangle's odd ones alone."""
    amplitudes, phases = true_harmonics(drive, len(found.amplitudes))
    there = np.isfinite(phases)
    return np.concatenate(
        [
            [(found.frequency - drive.parameters["frequency"]) / found.frequency_error],
            ((found.amplitudes - amplitudes) / found.amplitude_errors)[there],
            (wrapped(found.phases - phases) / found.phase_errors)[there],
        ]
    )


def coverage(seeds: int) -> dict[str, Array]:
    """Return deviations over many seeds, by kind of record; records with another number of harmonics are left out."""
    times = np.arange(500) / 1000.0

    def uneven(seed: int) -> tuple[Array, Array]:
        t = np.sort(np.random.default_rng(seed).uniform(0.0, 0.5, 500))
        return t, record_acceleration(TWO, t, 10.0, rng=seed)

    kinds: dict[str, tuple[Effect, Callable[[int], tuple[Array, Array]], str]] = {
        "white": (TWO, lambda s: (times, record_acceleration(TWO, times, 10.0, rng=s)), "coloured"),
        "uneven times": (TWO, uneven, "coloured"),
        "coloured": (TWO, lambda s: (times, record_acceleration(TWO, times, 20.0, 0.005, rng=s)), "coloured"),
        "coloured, taken for white": (
            TWO,
            lambda s: (times, record_acceleration(TWO, times, 20.0, 0.005, rng=s)),
            "white",
        ),
    }
    found = {}
    for name, (drive, make, noise) in kinds.items():
        rows = []
        for seed in range(seeds):
            one = recover_drive(*make(seed), noise=noise)
            if len(one.amplitudes) == 2:
                rows.append(deviations(drive, one))
        found[name] = np.array(rows)
        fractions = 100.0 * (np.abs(found[name]) < 1.96).mean(axis=0)
        told = ", ".join(f"{s:.1f}" for s in fractions)
        print(f"  {name:26s} {told} % of {len(rows)} (of {seeds}; f, A1, A2, phase 1, phase 2; expected 95)")
    return found


def noise_bias(levels: Array, seeds: int) -> tuple[Array, Array]:
    """Return amplitudes (m) by (21), from the extremes of a record and from its fit, for each level of noise."""
    from_extremes, from_fit = np.empty((2, len(levels), seeds))
    for i, level in enumerate(levels):
        for seed in range(seeds):
            volts = record_acceleration(SINE, EVEN, noise=level, volts_per_g=0.1, rng=seed)
            from_extremes[i, seed] = displacement_amplitude(np.ptp(volts), SINE.frequency)
            found = recover_drive(EVEN, acceleration_from_volts(volts))
            from_fit[i, seed] = displacement_amplitude(volts_from_acceleration(found.peak_to_peak), found.frequency)
    return from_extremes, from_fit


def critical_amplitude(amplitudes: Array, phases: Array, frequency: float) -> float:
    """Return the first amplitude (m) at which the inverted rod gains stability; the other harmonics keep theirs."""
    drive = HarmonicDrive(tuple(amplitudes.tolist()), tuple(phases.tolist()), frequency)
    system = scene(Pendulum(ROD), Gravity(GRAVITY), drive, ViscousDamping(DAMPING))
    found = critical_values(system, (pi, 0.0), "amplitude_1", 0.5 * amplitudes[0], 1.5 * amplitudes[0], n_points=64)
    return float(next(c.value for c in found if c.gains))


def carried_over(found: RecoveredDrive) -> tuple[float, float]:
    """Return the critical first amplitude (m) under a recovered drive, and its error from the covariance."""
    center = np.concatenate([[found.frequency], found.amplitudes, found.phases])
    errors = np.sqrt(found.covariance.diagonal())
    count = len(found.amplitudes)

    def at(place: Array) -> float:
        return critical_amplitude(place[1 : 1 + count], place[1 + count :], float(place[0]))

    slopes = np.array(
        [
            (at(center + step) - at(center - step)) / (2.0 * size)
            for size, step in zip(errors, np.diag(errors), strict=True)
        ]
    )
    return at(center), float(np.sqrt(slopes @ found.covariance @ slopes))


def report(found: list[Case]) -> None:
    """Print true and recovered drives."""
    for case in found:
        got = case.recovered
        amplitudes, phases = true_harmonics(case.drive, len(got.amplitudes))
        print(f"\n{case.name}: {got.samples} samples, {got.missing} missing, {got.clipped} clipped")
        true = case.drive.parameters["frequency"]
        print(f"  frequency {got.frequency:.5f} +- {got.frequency_error:.5f} Hz, true {true:g}")
        for k in np.flatnonzero(np.isfinite(phases)):
            print(
                f"  A{k + 1} {1e3 * got.amplitudes[k]:.5f} +- {1e3 * got.amplitude_errors[k]:.5f} mm, true "
                f"{1e3 * amplitudes[k]:.5f}; phase {got.phases[k]:+.4f} +- {got.phase_errors[k]:.4f}, true "
                f"{wrapped(phases[k]):+.4f}"
            )


def draw(found: list[Case], spread: dict[str, Array], levels: Array, biased: tuple[Array, Array]) -> Figure:
    """Draw three records with their fits; harmonics of the triangle, errors over seeds, and the bias of extremes."""
    figure, axes = plt.subplots(2, 3, figsize=(13.0, 7.0), layout="constrained")
    for ax, case in zip(axes[0], (found[2], found[5], found[6]), strict=True):
        shown = case.times < 3.2 / case.recovered.frequency
        fine = np.linspace(0.0, 3.2 / case.recovered.frequency, 600)
        ax.plot(1e3 * fine, case.recovered.reading(fine), color="#D55E00", lw=1.2, label="fit")
        ax.plot(1e3 * case.times[shown], case.record[shown], ".", color="#0072B2", ms=4.0, label="record")
        low, high = ax.get_ylim()
        ax.set(title=case.name, xlabel="time, ms", ylabel="acceleration, m/s²", ylim=(low, high + 0.25 * (high - low)))
        ax.legend(fontsize="small", loc="upper right", ncols=2)
    ax, case = axes[1, 0], found[6]
    count = len(case.recovered.amplitudes)
    order = np.arange(1, count + 1)
    true = true_harmonics(case.drive, count)[0]
    odd = true > 0.0
    ax.errorbar(
        *(order, 1e3 * case.recovered.amplitudes, 1e3 * case.recovered.amplitude_errors),
        **{
            "fmt": "o",
            "mfc": "white",
            "mec": "black",
            "ecolor": "black",
            "ms": 5.0,
            "capsize": 2.0,
            "label": "recovered",
        },
    )
    ax.plot(order[odd], 1e3 * true[odd], "x", color="#D55E00", label="true, odd harmonics alone")
    ax.set(title="Harmonics of the triangle", xlabel="harmonic", ylabel="amplitude of the height, mm", yscale="log")
    ax.set_xticks(order)
    ax.legend(fontsize="small")
    ax, edges = axes[1, 1], np.linspace(-4.0, 4.0, 33)
    for (name, values), colour in zip(spread.items(), ("#0072B2", "#009E73", "#E69F00", "#CC79A7"), strict=True):
        inside = 100.0 * (np.abs(values) < 1.96).mean()
        ax.hist(
            values.ravel(), edges, density=True, histtype="step", color=colour, lw=1.4, label=f"{name}: {inside:.1f} %"
        )
    fine = np.linspace(-4.0, 4.0, 200)
    ax.set_xlim(-9.0, 4.5)
    ax.plot(fine, np.exp(-0.5 * fine**2) / np.sqrt(2.0 * pi), "k:", lw=1.0, label="normal: 95 %")
    low, high = ax.get_ylim()
    ax.set(
        title="Errors over seeds, fraction within 1.96",
        xlabel="error / error bar",
        ylabel="density",
        ylim=(0.0, 1.1 * high),
    )
    ax.legend(fontsize="x-small", loc="upper left", framealpha=1.0)
    ax = axes[1, 2]
    for values, colour, name in zip(biased, ("#0072B2", "#D55E00"), ("highest less lowest sample", "fit"), strict=True):
        percent = 100.0 * (values / SINE.amplitude - 1.0)
        ax.errorbar(1e3 * levels, percent.mean(axis=1), percent.std(axis=1), fmt="o-", color=colour, ms=4.0, label=name)
    ax.axhline(0.0, color="0.5", lw=0.8)
    ax.set(title="Amplitude by (21)", xlabel="noise, mV", ylabel="error of the amplitude, %")
    ax.legend(fontsize="small")
    return figure


def main(quick: bool, output: Path) -> None:
    """Compute and draw."""
    found = cases()
    report(found)
    print("\nfraction of errors within 1.96 error bars")
    spread = coverage(60 if quick else 1000)
    levels = np.array([0.0, 0.02, 0.05, 0.1, 0.2])
    biased = noise_bias(levels, 4 if quick else 20)
    print("\namplitude by (21), mm, true 3: from the extremes of the record, and from the fit")
    for level, rough, fitted in zip(levels, *biased, strict=True):
        print(f"  noise {level:4.2f} V: {1e3 * rough.mean():.4f}, {1e3 * fitted.mean():.4f}")
    true = critical_amplitude(np.array(TWO.amplitudes), np.array(TWO.phases), TWO.frequency)
    print(f"\nfirst amplitude at which the inverted rod gains stability; under the true drive {1e3 * true:.5f} mm")
    for case in found[4:6]:
        value, error = carried_over(case.recovered)
        print(f"  {case.name}: {1e3 * value:.5f} +- {1e3 * error:.5f} mm, off by {(value - true) / error:+.2f} errors")
    figure = draw(found, spread, levels, biased)
    figure.savefig(output / "shaker.png", dpi=100)
    plt.close(figure)
