"""Drives: the acceleration of the pivot is what it is said to be, and is the second derivative of its place."""

from __future__ import annotations

from collections.abc import Callable
from math import asin, cos, pi, sin
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from cellmap import ForcedSystem, stroboscopic_map
from cellmap._compiled.codegen.kernel import traced_function
from cellmap._compiled.codegen.trace import STATEFUL
from systems import (
    DryFriction,
    Effect,
    Gravity,
    HarmonicDrive,
    HorizontalDrive,
    Pendulum,
    RotatingDrive,
    SquareDrive,
    TiltedDrive,
    TorqueDrive,
    TriangleDrive,
    VerticalDrive,
    ViscousDamping,
    driven_pendulum,
    sampled_drive,
    scene,
)

F, W, PHASE = 3.0, 6.0 * pi, 0.4
TIMES = np.linspace(0.0, 1.0 / F, 241)[:-1] + 1e-3 / 3.0


def acceleration(drive: Effect, t: float) -> tuple[float, float]:
    """Acceleration (right, up) of the pivot that a pendulum of length 1 feels: at its side and at its bottom."""
    system = scene(Pendulum(1.0), drive)
    return -system.derivative(t, (0.0, 0.0))[1], -system.derivative(t, (pi / 2, 0.0))[1]


def places(drive: Effect, t: Any) -> NDArray[np.float64]:
    system = scene(Pendulum(1.0), drive)
    return system.output("positions", t, np.zeros((*np.shape(t), 2)))[..., :2]


def triangle(a: float) -> float:
    return 2.0 / pi * asin(cos(a))


DRIVES: list[tuple[Effect, Callable[[float], tuple[float, float]]]] = [
    (VerticalDrive(0.2, F, PHASE), lambda a: (0.0, -0.2 * W**2 * cos(a))),
    (HorizontalDrive(0.2, F, PHASE), lambda a: (-0.2 * W**2 * cos(a), 0.0)),
    (TiltedDrive(0.2, F, 0.3, PHASE), lambda a: (-0.2 * sin(0.3) * W**2 * cos(a), -0.2 * cos(0.3) * W**2 * cos(a))),
    (RotatingDrive(0.2, 0.1, F, PHASE), lambda a: (0.1 * W**2 * sin(a), -0.2 * W**2 * cos(a))),
    (
        HarmonicDrive((0.2, 0.0, 0.03), (PHASE, 0.0, 3 * PHASE + 1.0), F),
        lambda a: (0.0, -(W**2) * (0.2 * cos(a) + 9 * 0.03 * cos(3 * a + 1.0))),
    ),
    (SquareDrive(70.0, F, PHASE), lambda a: (0.0, -70.0 * np.sign(cos(a)))),
    (TriangleDrive(70.0, F, PHASE), lambda a: (0.0, -70.0 * triangle(a))),
    (
        SquareDrive(70.0, F, PHASE, smoothing=0.2),
        lambda a: (0.0, -70.0 * cos(a) * (1.04 / (cos(a) ** 2 + 0.04)) ** 0.5),
    ),
    (
        TriangleDrive(70.0, F, PHASE, smoothing=0.2),
        lambda a: (0.0, -70.0 * np.arctan(cos(a) / (sin(a) ** 2 + 0.04) ** 0.5) / np.arctan(5.0)),
    ),
]
EVERY = pytest.mark.parametrize(("drive", "wave"), DRIVES, ids=[type(d).__name__ for d, _ in DRIVES])


@EVERY
def test_the_acceleration_of_the_pivot(drive: Effect, wave: Callable[[float], tuple[float, float]]) -> None:
    for t in TIMES:
        assert acceleration(drive, t) == pytest.approx(wave(W * t + PHASE), rel=1e-12, abs=1e-11)


@EVERY
def test_the_place_of_the_pivot(drive: Effect, wave: Callable[[float], tuple[float, float]]) -> None:
    """Second differences of the place, and a mean of zero."""
    h = 1e-4
    before, now, after = (places(drive, TIMES + s) for s in (-h, 0.0, h))
    seen = (before - 2.0 * now + after) / h**2
    expected = np.array([wave(W * t + PHASE) for t in TIMES])
    smooth = np.abs(np.array([wave(W * (t + s) + PHASE) for t in TIMES for s in (-h, h)])).reshape(-1, 2, 2)
    away = np.ptp(smooth, axis=1).max(axis=1) < 5.0  # not across an edge
    away &= np.min([np.abs(np.cos(W * TIMES + PHASE)), np.abs(np.sin(W * TIMES + PHASE))], axis=0) > 2.0 * W * h
    assert away.sum() > 200
    assert seen[away] == pytest.approx(expected[away], rel=1e-4, abs=2e-2)
    assert np.abs(now.mean(axis=0)).max() < 1e-5


@EVERY
def test_the_period_of_a_drive(drive: Effect, wave: Any) -> None:
    system = scene(Pendulum(1.0), drive, Gravity(9.8))
    assert system.length == 1.0 / F
    assert system.with_params(frequency=5.0).length == 0.2
    assert scene(Pendulum(1.0), drive).rhs is not system.rhs
    assert scene(Pendulum(2.0), drive).rhs is scene(Pendulum(1.0), drive).rhs


@EVERY
def test_angles_are_those_of_a_pivot_that_moves(drive: Effect, wave: Any) -> None:
    """Newton: the force on the mass, its acceleration less gravity, points along the rod."""
    system = scene(Pendulum(1.5), drive, Gravity(9.8))
    t, x = 0.07, (0.8, 2.0)
    signs = system.signs(t, x)
    angular = system.derivative(t, x, signs or None)[1]
    across = np.array([cos(x[0]), sin(x[0])])
    along = np.array([sin(x[0]), -cos(x[0])])
    pivot = np.array(wave(W * t + PHASE))
    force = pivot + 1.5 * (angular * across - x[1] ** 2 * along) + [0.0, 9.8]
    assert force @ across == pytest.approx(0.0, abs=1e-10)


def test_the_torque_at_the_joint() -> None:
    system = scene(Pendulum(1.0), TorqueDrive(2.0, F, PHASE))
    for t in TIMES[::20]:
        assert system.derivative(t, (0.3, 1.0)) == pytest.approx((1.0, 2.0 * cos(W * t + PHASE)), rel=1e-13)
    assert system.output("positions", 0.3, (0.0, 0.0)).tolist() == [0.0, 0.0, 0.0, -1.0]


def test_switches_of_sharp_waves() -> None:
    """Time alone decides them; they follow those of the joint."""
    square = scene(Pendulum(1.0), SquareDrive(70.0, F, PHASE), DryFriction(1.0))
    assert square.switches is not None
    assert square.switches(0.05, (0.3, 2.0), square.parameters) == (2.0, pytest.approx(cos(W * 0.05 + PHASE)))
    assert square.derivative(0.05, (pi / 2, 2.0), (0.5, -1.0)) == pytest.approx((2.0, -0.5 - 70.0))
    both = scene(Pendulum(1.0), TriangleDrive(70.0, F, PHASE))
    assert both.switches is not None
    assert both.switches(0.05, (0.3, 2.0), both.parameters) == (pytest.approx(sin(W * 0.05 + PHASE)),)
    assert scene(Pendulum(1.0), SquareDrive(70.0, F, PHASE, 0.1)).switches is None


def test_a_sharp_triangle_is_smooth_beyond_its_tips() -> None:
    """With the sign held, the formula of a slope goes on in a straight line past its ends."""
    system = scene(Pendulum(1.0), TriangleDrive(70.0, F))
    t = np.linspace(-0.15, 0.15, 25) + 0.25 / F  # the slope ends at 0 and at 0.5 / F = 0.167
    values = np.array([system.derivative(s, (pi / 2, 0.0), (1.0,))[1] for s in t])
    assert values == pytest.approx(70.0 * (1.0 - 4.0 * F * t), rel=1e-12, abs=1e-12)


@pytest.mark.parametrize(
    ("drive", "edges"),
    [
        (SquareDrive(200.0, 50.0), (0.005, 0.015)),
        (TriangleDrive(200.0, 50.0), (0.01,)),
    ],
)
def test_the_map_under_a_sharp_wave(drive: Effect, edges: tuple[float, ...]) -> None:
    """Against SciPy, from edge to edge."""
    system = scene(Pendulum(0.0272), Gravity(9.8), drive, ViscousDamping(5.0))
    state, ic = np.array([1.0, 5.0]), 0.0
    for end in (*edges, 0.02):
        signs = system.signs(0.5 * (ic + end), tuple(state))
        solution = solve_ivp(
            lambda t, y, s=signs: system.derivative(t, tuple(y), s),
            (ic, end),
            state,
            "DOP853",
            rtol=1e-12,
            atol=1e-12,
        )
        state, ic = solution.y[:, -1], end
    assert stroboscopic_map(system)([1.0, 5.0]) == pytest.approx(state, rel=1e-7)


def test_the_smooth_wave_tends_to_the_sharp_one() -> None:
    for kind in (SquareDrive, TriangleDrive):
        sharp, smooth = kind(70.0, F, PHASE), kind(70.0, F, PHASE, smoothing=1e-4)
        away = TIMES[(np.abs(np.cos(W * TIMES + PHASE)) > 0.1) & (np.abs(np.sin(W * TIMES + PHASE)) > 0.1)]
        for t in away[::10]:
            assert acceleration(smooth, t)[1] == pytest.approx(acceleration(sharp, t)[1], rel=2e-3)
        peak = 70.0 / W**2
        assert places(smooth, TIMES) == pytest.approx(places(sharp, TIMES), abs=1e-4 * peak)


def test_one_harmonic_is_the_vertical_drive() -> None:
    one = scene(Pendulum(0.0272), Gravity(9.8), HarmonicDrive((0.003,), (0.0,), 50.0), ViscousDamping(10.0))
    initial_conditions = np.random.default_rng(0).uniform(-3.0, 3.0, (20, 2)) * [1.0, 30.0]
    assert list(one.params) == ["length", "gravity", "amplitude_1", "phase_1", "frequency", "damping"]
    assert stroboscopic_map(one)(initial_conditions) == pytest.approx(
        stroboscopic_map(driven_pendulum())(initial_conditions), rel=1e-8, abs=1e-8
    )


def test_the_structure_of_harmonics_is_their_number() -> None:
    def made(n: int, size: float) -> ForcedSystem:
        return scene(Pendulum(1.0), HarmonicDrive((size,) * n, (0.1,) * n, F))

    assert made(5, 0.1).rhs is made(5, 0.2).rhs is not made(4, 0.1).rhs
    trace = traced_function(made(5, 0.1).rhs, 2, tuple(made(5, 0.1).params))
    assert trace is not None and trace.is_analytic
    levels = trace.levels()
    assert sorted(n.operation for n in levels if n.arguments and levels[n] == STATEFUL) == ["mul", "sin"]


@pytest.mark.parametrize("count", [3, 4, 7, 16])
def test_a_sampled_drive_passes_through_its_samples(count: int) -> None:
    samples = np.random.default_rng(count).normal(size=count)
    drive = sampled_drive(samples.tolist(), F)
    assert len(drive.amplitudes) == count // 2
    for j, value in enumerate(samples - samples.mean()):
        assert acceleration(drive, j / (count * F)) == pytest.approx((0.0, value), abs=1e-12)


def test_a_sampled_cosine_is_the_vertical_drive() -> None:
    times = np.arange(12) / (12 * F)
    drive = sampled_drive(-0.2 * W**2 * np.cos(W * times + PHASE), F, harmonics=2)  # type: ignore[arg-type]
    assert drive.amplitudes == pytest.approx((0.2, 0.0), abs=1e-15)
    assert drive.phases[0] == pytest.approx(PHASE, abs=1e-14)


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (
            lambda: HarmonicDrive((0.1, -0.1), (0.0, 0.0), F),
            ValueError,
            "amplitude_2=-0.1: give a number of at least 0",
        ),
        (lambda: HarmonicDrive((0.1,), (0.0, 0.0), F), ValueError, "phases=.*: give one for each of the 1 amplitudes"),
        (lambda: HarmonicDrive((), (), F), ValueError, r"amplitudes=\(\): give at least one number"),
        (lambda: SquareDrive(-1.0, F), ValueError, "acceleration=-1.0: give a number of at least 0"),
        (lambda: TriangleDrive(1.0, F, smoothing=-0.1), ValueError, "smoothing=-0.1: give a number of at least 0"),
        (lambda: TorqueDrive(1.0, 0.0), ValueError, "frequency=0.0: give a number above 0"),
        (lambda: TiltedDrive(1.0, F, float("nan")), ValueError, "tilt=nan: give a finite number"),
        (lambda: sampled_drive([1.0, 2.0], F), ValueError, "samples=.*: give at least 3 numbers"),
        (lambda: sampled_drive([1.0, 2.0, float("inf")], F), ValueError, r"samples\[2\]=inf: give a finite number"),
        (lambda: sampled_drive(3.0, F), TypeError, "samples=3.0: give a sequence"),  # type: ignore[arg-type]
        (lambda: sampled_drive([1.0] * 8, F, 5), ValueError, "harmonics=5: give a whole number of at most 4"),
    ],
)
def test_bad_drives_are_refused(make: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        make()


@pytest.mark.parametrize(
    "drive",
    [
        HorizontalDrive(0.0, F),
        TiltedDrive(0.0, F, 0.1),
        RotatingDrive(0.0, 0.0, F),
        TorqueDrive(0.0, F),
        HarmonicDrive((0.0, 0.0), (0.0, 1.0), F),
        SquareDrive(0.0, F),
        TriangleDrive(0.0, F),
    ],
)
def test_a_drive_of_no_strength_sets_the_period_alone(drive: Effect) -> None:
    system = scene(Pendulum(1.0), Gravity(9.8), drive)
    assert system.length == 1.0 / F
    assert list(system.params) == ["length", "gravity"]
    assert system.switches is None
