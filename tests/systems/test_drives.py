"""Drives: the acceleration of the pivot is what it is said to be, and is the second derivative of its place."""

from collections.abc import Callable
from math import asin, cos, pi, sin
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import systems
from cellmap import ForcedSystem
from cellmap._compiled.codegen.kernel import traced_function
from cellmap._compiled.codegen.trace import STATEFUL

F, W, PHASE = 3.0, 6.0 * pi, 0.4
TIMES = np.linspace(0.0, 1.0 / F, 241)[:-1] + 1e-3 / 3.0


def accelerations(drive: systems.Effect, times: Any) -> list[tuple[float, float]]:
    """Accelerations (right, up) of the pivot that a pendulum of length 1 feels: at its side and at its bottom."""
    system = systems.scene(systems.Pendulum(1.0), drive)
    return [tuple(-system.derivative(t, (q, 0.0))[1] for q in (0.0, pi / 2)) for t in times]  # type: ignore[misc]


def places(drive: systems.Effect, t: Any) -> NDArray[np.float64]:
    system = systems.scene(systems.Pendulum(1.0), drive)
    return system.output("positions", t, np.zeros((*np.shape(t), 2)))[..., :2]


def triangle(a: float) -> float:
    return 2.0 / pi * asin(cos(a))


DRIVES: list[tuple[systems.Effect, Callable[[float], tuple[float, float]]]] = [
    (systems.VerticalDrive(0.2, F, PHASE), lambda a: (0.0, -0.2 * W**2 * cos(a))),
    (systems.HorizontalDrive(0.2, F, PHASE), lambda a: (-0.2 * W**2 * cos(a), 0.0)),
    (
        systems.TiltedDrive(0.2, F, 0.3, PHASE),
        lambda a: (-0.2 * sin(0.3) * W**2 * cos(a), -0.2 * cos(0.3) * W**2 * cos(a)),
    ),
    (systems.RotatingDrive(0.2, 0.1, F, PHASE), lambda a: (0.1 * W**2 * sin(a), -0.2 * W**2 * cos(a))),
    (
        systems.HarmonicDrive((0.2, 0.0, 0.03), (PHASE, 0.0, 3 * PHASE + 1.0), F),
        lambda a: (0.0, -(W**2) * (0.2 * cos(a) + 9 * 0.03 * cos(3 * a + 1.0))),
    ),
    (systems.SquareDrive(70.0, F, PHASE), lambda a: (0.0, -70.0 * np.sign(cos(a)))),
    (systems.TriangleDrive(70.0, F, PHASE), lambda a: (0.0, -70.0 * triangle(a))),
    (
        systems.SquareDrive(70.0, F, PHASE, smoothing=0.2),
        lambda a: (0.0, -70.0 * cos(a) * (1.04 / (cos(a) ** 2 + 0.04)) ** 0.5),
    ),
    (
        systems.TriangleDrive(70.0, F, PHASE, smoothing=0.2),
        lambda a: (0.0, -70.0 * np.arctan(cos(a) / (sin(a) ** 2 + 0.04) ** 0.5) / np.arctan(5.0)),
    ),
]
EVERY = pytest.mark.parametrize(("drive", "wave"), DRIVES, ids=[type(d).__name__ for d, _ in DRIVES])


@EVERY
def test_the_acceleration_of_the_pivot(drive: systems.Effect, wave: Callable[[float], tuple[float, float]]) -> None:
    for t, seen in zip(TIMES, accelerations(drive, TIMES), strict=True):
        assert seen == pytest.approx(wave(W * t + PHASE), rel=1e-12, abs=1e-11)


@EVERY
def test_the_place_of_the_pivot(drive: systems.Effect, wave: Callable[[float], tuple[float, float]]) -> None:
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
def test_the_period_of_a_drive(drive: systems.Effect, wave: Any) -> None:
    system = systems.scene(systems.Pendulum(1.0), drive, systems.Gravity(9.8))
    assert system.length == 1.0 / F
    assert system.with_params(frequency=5.0).length == 0.2
    assert systems.scene(systems.Pendulum(1.0), drive).rhs is not system.rhs
    assert systems.scene(systems.Pendulum(2.0), drive).rhs is systems.scene(systems.Pendulum(1.0), drive).rhs


def test_the_torque_at_the_joint() -> None:
    system = systems.scene(systems.Pendulum(1.0), systems.TorqueDrive(2.0, F, PHASE))
    for t in TIMES[::20]:
        assert system.derivative(t, (0.3, 1.0)) == pytest.approx((1.0, 2.0 * cos(W * t + PHASE)), rel=1e-13)
    assert system.output("positions", 0.3, (0.0, 0.0)).tolist() == [0.0, 0.0, 0.0, -1.0]


def test_switches_of_sharp_waves() -> None:
    """Time alone decides them; they follow those of the joint."""
    square = systems.scene(systems.Pendulum(1.0), systems.SquareDrive(70.0, F, PHASE), systems.DryFriction(1.0))
    assert square.switches is not None
    assert square.switches(0.05, (0.3, 2.0), square.parameters) == (2.0, pytest.approx(cos(W * 0.05 + PHASE)))
    assert square.derivative(0.05, (pi / 2, 2.0), (0.5, -1.0)) == pytest.approx((2.0, -0.5 - 70.0))
    both = systems.scene(systems.Pendulum(1.0), systems.TriangleDrive(70.0, F, PHASE))
    assert both.switches is not None
    assert both.switches(0.05, (0.3, 2.0), both.parameters) == (pytest.approx(sin(W * 0.05 + PHASE)),)
    assert systems.scene(systems.Pendulum(1.0), systems.SquareDrive(70.0, F, PHASE, 0.1)).switches is None


def test_a_sharp_triangle_is_smooth_beyond_its_tips() -> None:
    """With the sign held, the formula of a slope goes on in a straight line past its ends."""
    system = systems.scene(systems.Pendulum(1.0), systems.TriangleDrive(70.0, F))
    t = np.linspace(-0.15, 0.15, 25) + 0.25 / F  # the slope ends at 0 and at 0.5 / F = 0.167
    values = np.array([system.derivative(s, (pi / 2, 0.0), (1.0,))[1] for s in t])
    assert values == pytest.approx(70.0 * (1.0 - 4.0 * F * t), rel=1e-12, abs=1e-12)


def test_the_structure_of_harmonics_is_their_number() -> None:
    def made(n: int, size: float) -> ForcedSystem:
        return systems.scene(systems.Pendulum(1.0), systems.HarmonicDrive((size,) * n, (0.1,) * n, F))

    assert made(5, 0.1).rhs is made(5, 0.2).rhs is not made(4, 0.1).rhs
    trace = traced_function(made(5, 0.1).rhs, 2, tuple(made(5, 0.1).params))
    assert trace is not None and trace.is_analytic
    levels = trace.levels()
    assert sorted(n.operation for n in levels if n.arguments and levels[n] == STATEFUL) == ["mul", "sin"]


@pytest.mark.parametrize("count", [3, 16])
def test_a_sampled_drive_passes_through_its_samples(count: int) -> None:
    samples = np.random.default_rng(count).normal(size=count)
    drive = systems.sampled_drive(samples.tolist(), F)
    assert len(drive.amplitudes) == count // 2
    seen = accelerations(drive, np.arange(count) / (count * F))
    assert np.array(seen) == pytest.approx(np.stack([0.0 * samples, samples - samples.mean()], axis=1), abs=1e-12)


def test_a_sampled_cosine_is_the_vertical_drive() -> None:
    times = np.arange(12) / (12 * F)
    drive = systems.sampled_drive(-0.2 * W**2 * np.cos(W * times + PHASE), F, harmonics=2)  # type: ignore[arg-type]
    assert drive.amplitudes == pytest.approx((0.2, 0.0), abs=1e-15)
    assert drive.phases[0] == pytest.approx(PHASE, abs=1e-14)


@pytest.mark.parametrize(
    "drive",
    [
        systems.HorizontalDrive(0.0, F),
        systems.TiltedDrive(0.0, F, 0.1),
        systems.RotatingDrive(0.0, 0.0, F),
        systems.TorqueDrive(0.0, F),
        systems.HarmonicDrive((0.0, 0.0), (0.0, 1.0), F),
        systems.SquareDrive(0.0, F),
        systems.TriangleDrive(0.0, F),
    ],
)
def test_a_drive_of_no_strength_sets_the_period_alone(drive: systems.Effect) -> None:
    system = systems.scene(systems.Pendulum(1.0), systems.Gravity(9.8), drive)
    assert system.length == 1.0 / F
    assert list(system.params) == ["length", "gravity"]
    assert system.switches is None
