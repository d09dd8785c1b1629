"""Scales far apart."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from math import asin, cos, pi, sin, sqrt
from typing import Any

import numpy as np

from cellmap import ForcedSystem, Status, angle, stroboscopic_map
from cellmap.maps import ToleranceWarning, jacobian
from systems import double_pendulum, driven_pendulum

from .case import TIGHT, Finding, agrees, at_most, hard_case, is_so
from .damping import FREE_RATE, GRAVITY, ROD
from .frozen import NO_DRIVE, OSCILLATOR_START, PROBLEMS, error, frozen_image, image, table


@hard_case(
    "Large drive",
    why="A pivot that moves 10 m at 50 Hz accelerates a rod of 2.7 cm 100,000 times as strongly as gravity does; "
    "it whips round within a period, and errors grow on the way.",
    expected="The frozen images at 0.1, 1 and 10 m; mirror images bit for bit; at 10,000,000,000 m, where a period "
    "takes more steps than are allowed, no image, and a warning that says so.",
)
def large_drive() -> Iterator[Finding]:
    for amplitude in (0.1, 1.0, 10.0):
        found = image(f"amplitude {amplitude:g} m")
        yield at_most(f"{amplitude:g} m: error", error(f"amplitude {amplitude:g} m", found), 1e-9)
    exact = stroboscopic_map(driven_pendulum(amplitude=1.0))
    initial_conditions = np.random.default_rng(1).uniform(-1.0, 1.0, (100, 2)) * (3.0, 100.0)
    yield is_so(
        "1 m: 100 images are mirror images bit for bit",
        bool((exact(initial_conditions) == -exact(-initial_conditions)).all()),
    )
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always", ToleranceWarning)
        ends = stroboscopic_map(driven_pendulum(amplitude=1e10)).iterate(initial_conditions, 1)
    lost = bool((ends.status == Status.OUT_OF_STEPS).all()) and "100 of 100 orbits" in str(said[-1].message)
    yield is_so("1e10 m: all 100 orbits are out of steps, and a warning says so", lost)


@hard_case(
    "Inverted state at a large drive",
    why="From 12.5 mm on the inverted state is unstable; near 103 mm it is stable again, in a window of 0.9 mm.",
    expected="Stable at 103 mm, unstable at 101.5 and at 104.5 mm.",
)
def resurrection() -> Iterator[Finding]:
    for amplitude, stable in ((0.1015, False), (0.1030, True), (0.1045, False)):
        exact = stroboscopic_map(driven_pendulum(amplitude=amplitude))
        largest = np.abs(np.linalg.eigvals(jacobian(exact, [pi, 0.0]))).max()
        yield is_so(f"{1e3 * amplitude:g} mm: largest multiplier {largest:.4f}", (largest < 1.0) == stable)


@hard_case(
    "Very high frequency at small amplitude",
    why="The pivot moves micrometres while the slow motion takes 20,000 periods; its rate follows from the trace "
    "of the map only with most digits cancelled.",
    expected="Frozen images after a millisecond; the frequency of slow swings about upright tends to Kapitza's "
    "2.465691357 Hz with the inverse square of the frequency of the drive.",
)
def high_frequency() -> Iterator[Finding]:
    yield at_most(
        "error at 5, 50 and 500 kHz", max(error(f"{f:g} Hz", image(f"{f:g} Hz")) for f in (5e3, 5e4, 5e5)), 1e-10
    )
    kapitza = sqrt((2.0 * pi * 0.15 / ROD) ** 2 / 2.0 - FREE_RATE**2) / (2.0 * pi)
    yield agrees("Kapitza's frequency (Hz)", kapitza, 2.465691357, 1e-9)
    off = {}
    for f in (5e2, 5e3, 5e4):
        system = driven_pendulum(amplitude=0.15 / f, frequency=f, damping=0.0)
        matrix = jacobian(stroboscopic_map(system), [pi, 0.0])
        # Without damping the two diagonal entries are equal, and sin² = -m12 m21 needs no difference of near numbers.
        slow = asin(sqrt(-matrix[0, 1] * matrix[1, 0])) * f / (2.0 * pi)
        off[f] = slow / kapitza - 1.0
        yield at_most(f"slow frequency at {f:g} Hz, {slow:.9f} Hz: relative distance", abs(off[f]), 20.0 / f**2)
    yield agrees("distance at 0.5 kHz over that at 5 kHz", off[5e2] / off[5e3], 100.0, 1.0)


@hard_case(
    "Mass ratio 1e-6",
    why="An outer link of a millionth of the mass should not matter to the inner one, yet has to be followed.",
    expected="The frozen images; the inner link moves as a single pendulum does, up to a difference in proportion to "
    "the mass ratio.",
)
def light_outer_mass() -> Iterator[Finding]:
    for name in ("mass ratio 1e-06", "mass ratio 1e-08"):
        yield at_most(f"{name}: error of the image", error(name, image(name)), 1e-9)
    single = stroboscopic_map(driven_pendulum(length=0.032, damping=0.0), **TIGHT).iterate([0.5, 3.0], 1)
    difference = [frozen_image(name)[[0, 2]] - single.unwrapped for name in ("mass ratio 1e-06", "mass ratio 1e-08")]
    yield at_most("difference from the single pendulum at 1e-6 (rad)", abs(difference[0][0]), 1e-6)
    yield agrees("that difference over the one at 1e-8", difference[0][0] / difference[1][0], 100.0, 0.1)


@hard_case(
    "Mass ratios 1e6 and 1e8",
    why="A light mass between pivot and heavy bob has a mode of 3.9 kHz and of 39 kHz: 80 and 800 swings in a "
    "period of the drive.",
    expected="The frozen images; multipliers of the hanging state on the unit circle at the angles of both modes, at "
    "1e5 and 1e6; the energy over 25 periods.",
)
def heavy_outer_mass() -> Iterator[Finding]:
    for name in ("mass ratio 1e+06", "mass ratio 1e+08"):
        yield at_most(f"{name}: error of the image", error(name, image(name)), 1e-9)
    for ratio in (1e5, 1e6):
        system = double_pendulum(mass_2=ratio, damping=0.0, amplitude=NO_DRIVE)
        matrix = jacobian(stroboscopic_map(system, max_steps=2**18), np.zeros(4))
        values = np.linalg.eigvals(matrix)
        r = 1.0 + ratio
        # r - sqrt(r² - r) without cancellation
        modes = np.sqrt(np.array([r + sqrt(r * r - r), r / (r + sqrt(r * r - r))]) * GRAVITY / 0.032)
        exact = np.concatenate([np.exp(1j * modes * 0.02), np.exp(-1j * modes * 0.02)])
        worst = max(np.abs(values - z).min() for z in exact)
        yield at_most(
            f"{ratio:g}: error of the multipliers, {modes[0] / 2 / pi:,.0f} Hz among them", float(worst), 1e-7
        )
    system = double_pendulum(mass_2=1e6, damping=0.0, amplitude=NO_DRIVE)
    rest, start = np.zeros(4), np.array([0.3, 0.3001, 0.0, 0.0])
    end = stroboscopic_map(system).iterate(start, 25)
    lowest, before, after = (system.output("energy", 0.0, x).sum() for x in (rest, start, end.points))
    change = abs(after - before) / (before - lowest)
    yield at_most("1e6: relative change of the energy over 25 periods, rods all but in line", float(change), 1e-9)


@hard_case(
    "A whip",
    why="A light mass between the pivot and a bob of 10,000 or 1,000,000 times its mass is whipped round where "
    "the rods come into line, in a hundred-thousandth of a period, where steps that are all equally long are too many.",
    expected="The frozen images after three periods, each at the tolerance 1e-9, or a status that says that they are "
    "not to be trusted. With more steps allowed, the image for 10,000.",
)
def whip() -> Iterator[Finding]:
    for name, steps in (("whip 1e4", 16384), ("whip 1e4", 2**18), ("whip 1e6", 16384)):
        found = image(name, max_steps=steps)
        status = Status(int(found.status))
        what = (
            f"mass ratio {PROBLEMS[name].system.params['mass_2']:,.0f}, at most {steps:,} steps: status {status.name}"
        )
        if status is Status.DIVERGED:
            yield is_so(f"{what}, no image", bool(np.isnan(found.points).all()))
        else:
            yield at_most(f"{what}, error", error(name, found), 3e-9 if status is Status.OK else 1e-6)
        if steps > 16384:
            yield is_so("its status is OK", status is Status.OK)


@hard_case(
    "Tiny and huge periods",
    why="Periods of 1e-8 s and 1e8 s: numbers in the right-hand side as small and as large as 1e16.",
    expected="The map of the period 1 s, in the units of its own period. An absolute tolerance is in the units of the "
    "state: rates of 1e-8 rad/s need one to match, here 1e-14.",
)
def periods() -> Iterator[Finding]:
    def scaled(period: float) -> np.ndarray:
        system = driven_pendulum(0.1, 0.01, 1.0 / period, 0.3 / period, gravity=1.0 / period**2)
        initial_conditions = np.array([[1.0, 0.5], [-2.0, 3.0], [3.1, -7.0]]) / [1.0, period]
        return stroboscopic_map(system, rtol=1e-12, atol=1e-14).iterate(initial_conditions, 3).unwrapped * [1.0, period]

    unit = scaled(1.0)
    for period in (1e-8, 1e-4, 1e4, 1e8):
        worst = np.abs(scaled(period) - unit).max()
        yield at_most(f"{period:g} s: largest difference", worst, 1e-10)


@hard_case(
    "Parameters from 1e-8 to 1e8",
    why="Damped, driven, linear oscillators of all 125 triples of stiffness, damping and drive: overdamped by "
    "1e16, or with 10,000 swings a period.",
    expected="The closed form, frozen from 80 digits, wherever the status is OK; elsewhere a status that says so.",
)
def parameters() -> Iterator[Finding]:
    def rhs(t: float, x: Any, p: Any) -> tuple[float, float]:
        return x[1], -p.damping * x[1] - p.stiffness * x[0] + p.drive * cos(t)

    tame = 0
    errors: dict[Status, list[float]] = {status: [] for status in Status}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ToleranceWarning)
        for row in table()["oscillators"]:
            values = dict(zip(("stiffness", "damping", "drive"), row[:3], strict=True))
            found = stroboscopic_map(ForcedSystem(rhs, values, 2.0 * pi, ("x", "v"))).iterate(OSCILLATOR_START, 1)
            # A drive of 1e8 passes through numbers of its own size, and so does their rounding.
            size = 1.0 + np.abs(row[3:]) + 1e-6 * values["drive"]
            tame += found.status == Status.OK and (row[0] <= 1e4 or row[1] > 1.0)
            errors[Status(int(found.status))].append(float((np.abs(found.points - row[3:]) / size).max()))
    ok, rough, none = (errors[status] for status in (Status.OK, Status.INACCURATE, Status.DIVERGED))
    yield at_most(f"{len(ok)} of 125 have the status OK; their largest error", max(ok), 2e-9)
    yield at_most(f"{len(rough)} have the status INACCURATE; their largest error", max(rough, default=0.0), 1e-6)
    yield is_so(f"{len(none)} have no image, all of them NaN", bool(np.isnan(none).all()))
    yield is_so("none of these has the stiffness 1e8 with a damping of at most 1", len(ok) == tame)
    yield is_so("of the 110 others one at most is not OK, whose drive of 1e8 leaves too large a rounding", tame >= 109)


@hard_case(
    "Fast rotation",
    why="3,183 rotations a period: an unwrapped angle loses a digit for every power of ten, and a missed rotation"
    " does not show in a wrapped one.",
    expected="After 100 periods the frozen number of rotations, 318,310, exactly, and the angle to the rounding of the "
    "angular velocity; a free rotor of 1,000.25 rotations a period returns after 50,000 periods with each counted.",
)
def fast_rotation() -> Iterator[Finding]:
    name = "rate 1e6 rad/s"
    found, exact = image(name, **TIGHT), frozen_image(name)
    rotations = round((exact[0] - found.points[0]) / (2.0 * pi))
    yield is_so(f"{int(found.rotations[0]):,} rotations, as frozen", int(found.rotations[0]) == rotations)
    yield at_most("error of the angle after 318,310 rotations (rad)", abs(found.unwrapped[0] - exact[0]), 1e-7)

    def rotor(t: float, x: Any, p: Any) -> tuple[float, float]:
        return x[1], 0.0 * sin(x[0])

    system = ForcedSystem(rotor, {}, 1.0, (angle("x", "turns", period=1.0, lower=0.0), "rate"))
    end = stroboscopic_map(system).iterate([0.125, 1000.25], 50_000)
    yield is_so(f"{int(end.rotations[0]):,} turns of the rotor", int(end.rotations[0]) == 50_012_500)
    yield at_most("error of its angle (turns)", abs(end.points[0] - 0.125), 1e-12)
