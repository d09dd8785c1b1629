"""No damping and much damping."""

from __future__ import annotations

from collections.abc import Iterator
from math import exp, pi, sin, sqrt

import numpy as np
from scipy.special import ellipj, ellipk

from cellmap import Basins, CellGrid, Status, find_basins, stroboscopic_map
from cellmap.maps import jacobian
from systems import double_pendulum, driven_pendulum

from .._unsettled import unsettled_basins
from .case import TIGHT, Finding, agrees, at_most, hard_case, is_so
from .frozen import NO_DRIVE, damped, error, image

ROD, GRAVITY = 0.0272, 9.8
FREE_RATE = sqrt(GRAVITY / ROD)
FREE = driven_pendulum(amplitude=NO_DRIVE, damping=0.0)


@hard_case(
    "No damping, no drive, for 10,000 periods",
    why="Nothing forgives: an integrator's errors add up for ever, and a drift of the energy would look like damping.",
    expected="The energy and, by Jacobi's elliptic functions, the state itself after 10,000 periods (200 s); the "
    "period 4 K(sin(a/2))/w0 of swings of 3 rad.",
)
def free_swings() -> Iterator[Finding]:
    periods = 10_000
    angles = np.array([0.1, 1.0, 2.0, 3.0])
    initial_conditions = np.stack([angles, np.zeros(4)], axis=-1)
    ends = stroboscopic_map(FREE, **TIGHT).iterate(initial_conditions, periods).points
    before, after = (FREE.output("energy", 0.0, x).sum(axis=-1) for x in (initial_conditions, ends))
    yield at_most("largest change of the energy, in units of g l", np.abs(after - before).max() / GRAVITY / ROD, 1e-11)
    sine, *_ = ellipj(FREE_RATE * periods * FREE.length + ellipk(np.sin(angles / 2) ** 2), np.sin(angles / 2) ** 2)
    exact = 2.0 * np.arcsin(np.sin(angles / 2) * sine)
    yield at_most("largest error of the angle (rad)", np.abs(ends[:, 0] - exact).max(), 1e-7)
    full = 4.0 * ellipk(sin(1.5) ** 2) / FREE_RATE
    yield agrees("period of swings of 3 rad (s)", full, 0.851124077002, 1e-12)
    swing = stroboscopic_map(FREE.with_params(frequency=1.0 / full), **TIGHT)
    yield at_most("distance from the start after that period", np.abs(swing([3.0, 0.0]) - [3.0, 0.0]).max(), 1e-10)


@hard_case(
    "Nothing attracts",
    why="Every orbit of an undamped system goes on for ever; something is always close to something.",
    expected="No attractor; every initial condition undecided.",
)
def nothing_attracts() -> Iterator[Finding]:
    for amplitude in (NO_DRIVE, 0.003):
        exact = stroboscopic_map(driven_pendulum(amplitude=amplitude, damping=0.0))
        basins = unsettled_basins(exact, CellGrid((-pi, -60.0), (pi, 60.0), (4, 4)), max_periods=50)
        drive = f"driven by {1e3 * amplitude:g} mm" if amplitude > NO_DRIVE else "not driven"
        yield is_so(f"{drive}: no attractor, 16 of 16 orbits undecided", not basins.attractors and _undecided(basins))


def _undecided(basins: Basins) -> bool:
    return bool((basins.labels == -3).all())


@hard_case(
    "Volumes in phase space",
    why="An integrator may meet its tolerance and still shrink or swell volumes; over thousands of periods this "
    "decides whether anything attracts.",
    expected="Liouville's theorem: the determinant of the map's derivative is exp(-damping T) at every state of a "
    "single pendulum, and (m1 + m2 sin² D)/(m1 + m2 sin² D') for an undamped double one whose relative angle "
    "goes from D to D'.",
)
def volumes() -> Iterator[Finding]:
    rng = np.random.default_rng(0)
    initial_conditions = rng.uniform(-1.0, 1.0, (40, 2)) * (pi, 100.0)
    for damping in (0.0, 10.0):
        worst = 0.0
        for amplitude in (0.003, 0.01, 0.1):
            matrices = jacobian(
                stroboscopic_map(driven_pendulum(amplitude=amplitude, damping=damping)), initial_conditions
            )
            worst = max(worst, _determinant_error(matrices, np.full(40, exp(-0.02 * damping))))
        yield at_most(
            f"damping {damping:g} /s: largest error of 120 determinants, by the size of their terms", worst, 1e-11
        )
    initial_conditions = rng.uniform(-1.0, 1.0, (40, 4)) * (pi, pi, 30.0, 30.0)
    exact = stroboscopic_map(double_pendulum(damping=0.0))
    ends = exact.iterate(initial_conditions, 1).unwrapped
    inertia, later = (1.0 + 0.25 * np.sin(x[:, 0] - x[:, 1]) ** 2 for x in (initial_conditions, ends))
    yield at_most(
        "double pendulum: largest error of 40 determinants, by the size of their terms",
        _determinant_error(jacobian(exact, initial_conditions), inertia / later),
        1e-8,
    )


def _determinant_error(matrices: np.ndarray, exact: np.ndarray) -> float:
    """Largest error, relative to the product of the lengths of the rows (Hadamard's bound) where that exceeds 1."""
    terms = np.maximum(1.0, np.prod(np.linalg.norm(matrices, axis=-1), axis=-1))
    return float((np.abs(np.linalg.det(matrices) - exact) / terms).max())


@hard_case(
    "Tiny damping",
    why="At 0.01 /s a motion needs 69,000 periods to lose a factor of 1,000. What has come close looks settled.",
    expected="Multipliers of the hanging state of size exp(-damping T/2); nothing settled after 50 periods.",
)
def tiny_damping() -> Iterator[Finding]:
    exact = stroboscopic_map(driven_pendulum(damping=0.01))
    sizes = np.abs(np.linalg.eigvals(jacobian(exact, [0.0, 0.0])))
    yield at_most("error of the size of both multipliers", float(np.abs(sizes - exp(-1e-4)).max()), 1e-11)
    basins = unsettled_basins(exact, CellGrid((-pi, -100.0), (pi, 100.0), (8, 8)), max_periods=50)
    yield is_so("64 of 64 orbits undecided after 50 periods", _undecided(basins))


@hard_case(
    "Huge damping: stiff equations",
    why="Explicit methods are stable only in steps of a few 1/damping, however slowly the solution moves.",
    expected="The frozen images, or a status that says that they are not to be trusted, never a wrong one with the "
    "status OK. With more steps allowed, the image itself.",
)
def huge_damping() -> Iterator[Finding]:
    for damping in (1e4, 1e5, 1e6, 1e7):
        name = f"damping {damping:g} /s"
        rotations = f"damping times period {damping * damped(damping).system.length:,.0f}"
        found = image(name)
        status = Status(int(found.status)).name
        if found.status <= Status.INACCURATE:
            yield at_most(f"{rotations}: status {status}, error", error(name, found), 1e-9)
        else:
            yield is_so(f"{rotations}: status {status}, no image", bool(np.isnan(found.points).all()))
    more = image("damping 1e+07 /s", max_steps=2**20)
    yield at_most("200,000 with a million steps allowed: status OK, error", error("damping 1e+07 /s", more), 1e-9)
    yield is_so("its status is OK", bool(more.status == Status.OK))


@hard_case(
    "Huge damping: creeping to rest",
    why="One multiplier of the hanging state all but vanishes, the other is next to 1.",
    expected="The hanging state attracts all orbits; its slow multiplier is that of the linear equation, about exp(-g "
    "T/(l damping)).",
)
def creeping() -> Iterator[Finding]:
    exact = stroboscopic_map(driven_pendulum(damping=1e3, amplitude=NO_DRIVE))
    basins = find_basins(exact, [[0.3, 0.0], [-1.0, 50.0], [2.5, -50.0]], max_periods=5000)
    yield is_so(
        "one attractor, which attracts all orbits", len(basins.attractors) == 1 and bool((basins.labels == 0).all())
    )
    slow = 0.5 * (sqrt(1e6 - 4.0 * FREE_RATE**2) - 1e3)
    yield agrees("slow multiplier", float(basins.attractors[0].multipliers[0].real), exp(slow * 0.02), 1e-11)
