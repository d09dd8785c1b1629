"""Dry friction."""

from __future__ import annotations

from collections.abc import Iterator
from math import asin, pi, sin

import numpy as np

from cellmap import stroboscopic_map
from systems import driven_pendulum

from .case import Finding, agrees, at_most, hard_case, is_so
from .damping import GRAVITY, ROD

FRICTION = 10.0
DRIVE = 0.003 * (2.0 * pi * 50.0) ** 2 / ROD
"""Largest angular acceleration by the pivot at 3 mm (1/s^2)."""

LIMIT = asin(FRICTION / (GRAVITY / ROD + DRIVE))
"""Distance (rad) from hanging or upright up to which the drive never overcomes the friction."""


@hard_case(
    "Sticking that never ends",
    why="A continuum of equilibria: each is a fixed point, none attracts in the usual sense, and an integrator "
    "that chatters about zero rate creeps.",
    expected="A release at rest up to asin(friction/(g/l + A w²/l)) = 0.000889214 rad from hanging or upright stays "
    "there bit for bit; beyond it slips. A little farther out a stick-slip cycle, 0.00182768 rad from "
    "upright.",
)
def permanent_sticking() -> Iterator[Finding]:
    yield agrees("the limit (rad)", LIMIT, 0.000889214, 5e-10)
    exact = stroboscopic_map(driven_pendulum(friction=FRICTION, damping=0.0))
    offsets = np.linspace(-1.0, 1.0, 41) * LIMIT * (1.0 - 1e-6)
    for name, centre in (("hanging", 0.0), ("upright", -pi)):
        angles = centre + offsets
        angles = angles[angles >= -pi] if centre else angles
        initial_conditions = np.stack([angles, np.zeros(len(angles))], axis=-1)
        ends = exact.iterate(initial_conditions, 1000).points
        yield is_so(
            f"{name}: {len(angles)} starts at rest for 1,000 periods, bit for bit",
            bool((ends == initial_conditions).all()),
        )
    outside = np.array([[1.01 * LIMIT, 0.0], [-1.01 * LIMIT, 0.0]])
    slipped = exact(outside) - outside
    yield is_so("releases beyond it by 1 % slip towards hanging", bool(slipped[0, 0] < 0.0 < slipped[1, 0]))
    cycle = exact.iterate([[-pi + 0.0018, 0.0], [-pi + 0.002, 0.0], [-pi + 0.001, 0.0]], 2000).points
    yield agrees("angle of the stick-slip cycle from upright (rad)", float(cycle[0, 0]) + pi, 0.00182768, 5e-9)
    yield at_most("starts on both sides meet in it, apart by", float(np.ptp(cycle, axis=0).max()), 1e-10)
    yield at_most("and return after a period to within", float(np.abs(exact(cycle) - cycle).max()), 1e-10)


@hard_case(
    "Drive just at the friction limit",
    why="The joint lets go for an instant in each period, if at all: an event that two roots of a polynomial "
    "enclose as they merge.",
    expected="Beyond the limit by a relative e the joint slips in each period by 4.5 friction e²/(c w²), c = A w²/(g +"
    " A w²), to leading order, and comes to rest; below it stays. (Closer than 1e-6 to the limit, slips of "
    "less than 1e-15 rad are let pass.)",
)
def at_the_limit() -> Iterator[Finding]:
    exact = stroboscopic_map(driven_pendulum(friction=FRICTION, damping=0.0))
    fraction = DRIVE / (GRAVITY / ROD + DRIVE)
    for e in (1e-2, 1e-3, 1e-4):
        start = np.array([asin(sin(LIMIT) * (1.0 + e)), 0.0])
        slip = start - exact(start)
        leading = 4.5 * FRICTION * e * e / (fraction * (2.0 * pi * 50.0) ** 2)
        yield agrees(f"e = {e:g}: slip {slip[0]:.3g} rad, by the leading order", slip[0] / leading, 1.0, 2.0 * e + 1e-4)
        yield is_so("at rest at the end of the period", bool(slip[1] == 0.0))
    inside = np.stack([np.arcsin(sin(LIMIT) * (1.0 - np.array([1e-3, 1e-5, 1e-6]))), np.zeros(3)], axis=-1)
    yield is_so("below by e = 1e-3, 1e-5, 1e-6: bit for bit at rest", bool((exact(inside) == inside).all()))
    touching = np.stack([np.arcsin(sin(LIMIT) * (1.0 - np.array([1e-8, 1e-10, 0.0]))), np.zeros(3)], axis=-1)
    yield at_most("below by 1e-8, 1e-10 and 0: moves (rad) by", float(np.abs(exact(touching) - touching).max()), 1e-15)


@hard_case(
    "Dry friction without gravity",
    why="No force but the friction: it stops the rotor at one instant and must not turn it round, and from then "
    "on nothing moves.",
    expected="The angle gains rate²/(2 friction), the rate falls by friction T a period until it is zero, and stays "
    "zero.",
)
def friction_alone() -> Iterator[Finding]:
    system = driven_pendulum(friction=FRICTION, damping=0.0, gravity=0.0, amplitude=0.0)
    exact = stroboscopic_map(system)
    initial_conditions = np.array([[0.1, 1.0], [0.1, -3.0], [2.0, 100.0], [0.0, 0.2], [0.0, 0.2 + 1e-9], [1.0, 0.0]])
    once = exact.iterate(initial_conditions, 1).unwrapped
    rates = np.sign(initial_conditions[:, 1]) * np.maximum(np.abs(initial_conditions[:, 1]) - FRICTION * 0.02, 0.0)
    yield at_most("largest error of the rate after a period (rad/s)", float(np.abs(once[:, 1] - rates).max()), 1e-12)
    ends = exact.iterate(initial_conditions, 501)
    stopped = initial_conditions[:, 0] + initial_conditions[:, 1] * np.abs(initial_conditions[:, 1]) / (2.0 * FRICTION)
    yield at_most(
        "largest error of the angle at rest, after up to 80 rotations (rad)",
        float(np.abs(ends.unwrapped[:, 0] - stopped).max()),
        1e-9,
    )
    yield is_so("all angular velocities are exactly zero", bool((ends.points[:, 1] == 0.0).all()))
    later = exact.iterate(ends.points, 1000).points
    yield is_so("1,000 periods later nothing has moved by a bit", bool((later == ends.points).all()))
