"""Scenes: what an effect costs, dry friction against viscous, the double pendulum against heyoka."""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from math import atan, cos, pi, sin, sqrt
from operator import add
from typing import Any

import numpy as np
import pytest
from peers import best_times, heyoka_system

from cellmap import ForcedSystem, PointMap, stroboscopic_map
from cellmap.maps.integration import flow
from systems import (
    ConstantTorque,
    Effect,
    Gravity,
    HarmonicDrive,
    HorizontalDrive,
    Pendulum,
    QuadraticDrag,
    RotatingDrive,
    SquareDrive,
    TiltedDrive,
    TorqueDrive,
    TorsionSpring,
    TriangleDrive,
    VerticalDrive,
    ViscousDamping,
    double_pendulum,
    driven_pendulum,
    scene,
)

RATES = (30.0, 100.0)
"""Half-widths (rad/s) of the windows."""


def pendulum_initial_conditions(count: int, rate: float) -> np.ndarray:
    return np.random.default_rng(0).uniform((-pi, -rate), (pi, rate), (count, 2))


def double_initial_conditions(count: int, rate: float) -> np.ndarray:
    return np.random.default_rng(0).uniform((-pi, -pi, -rate, -rate), (pi, pi, rate, rate), (count, 4))


# Terms by hand: mostly in the order in which the scene has them, some as one would rather write them.

Handwritten = Callable[..., Any]


def by_hand(pivot: Handwritten, *at_joint: Handwritten) -> Handwritten:
    def rhs(t: float, x: Any, p: Any, s: Any = ()) -> tuple[float, float]:
        theta, v = x
        acceleration = pivot(t, theta, p, s)
        if at_joint:
            acceleration = acceleration + reduce(add, [term(theta, v, p, s) for term in at_joint])
        return v, acceleration

    return rhs


def vertical(t: float, theta: float, p: Any, s: Any) -> float:
    w = 2 * pi * p.frequency
    lift = -(p.amplitude * w * w) * cos(w * t + p.phase)
    return -((p.gravity + lift) / p.length) * sin(theta)


def horizontal(t: float, theta: float, p: Any, s: Any) -> float:
    w = 2 * pi * p.frequency
    push = -(p.amplitude * w * w) * cos(w * t + p.phase)
    return -(p.gravity / p.length) * sin(theta) + -(push / p.length) * cos(theta)


def tilted(t: float, theta: float, p: Any, s: Any) -> float:
    w = 2 * pi * p.frequency
    along = -(p.amplitude * w * w) * cos(w * t + p.phase)
    lift, push = cos(p.tilt) * along, sin(p.tilt) * along
    return -((p.gravity + lift) / p.length) * sin(theta) + -(push / p.length) * cos(theta)


def rotating(t: float, theta: float, p: Any, s: Any) -> float:
    w = 2 * pi * p.frequency
    lift = -(p.vertical_amplitude * w * w) * cos(w * t + p.phase)
    push = (p.horizontal_amplitude * w * w) * sin(w * t + p.phase)
    return -((p.gravity + lift) / p.length) * sin(theta) + -(push / p.length) * cos(theta)


def alternating(t: float, theta: float, p: Any, s: Any) -> float:
    return -(p.gravity / p.length) * sin(theta) + p.torque * cos(2 * pi * p.frequency * t + p.phase)


def harmonic(t: float, theta: float, p: Any, s: Any) -> float:
    w = 2 * pi * p.frequency
    lift = -p.amplitude_1 * w**2 * cos(w * t + p.phase_1)
    lift -= p.amplitude_2 * (2 * w) ** 2 * cos(2 * w * t + p.phase_2)
    lift -= p.amplitude_3 * (3 * w) ** 2 * cos(3 * w * t + p.phase_3)
    return -(p.gravity + lift) / p.length * sin(theta)


def square(t: float, theta: float, p: Any, s: Any) -> float:
    return -((p.gravity + -p.acceleration * s[0]) / p.length) * sin(theta)


def smooth_square(t: float, theta: float, p: Any, s: Any) -> float:
    c, e = cos(2 * pi * p.frequency * t + p.phase), p.smoothing
    lift = -p.acceleration * (c * sqrt((1 + e * e) / (c * c + e * e)))
    return -((p.gravity + lift) / p.length) * sin(theta)


def triangle(t: float, theta: float, p: Any, s: Any) -> float:
    rotated = 2 * pi * p.frequency * t + p.phase
    lift = -p.acceleration * ((4 / pi) * atan(cos(rotated) / (1 + s[0] * sin(rotated))))
    return -((p.gravity + lift) / p.length) * sin(theta)


def smooth_triangle(t: float, theta: float, p: Any, s: Any) -> float:
    rotated, e = 2 * pi * p.frequency * t + p.phase, p.smoothing
    wave = atan(cos(rotated) / sqrt(sin(rotated) ** 2 + e * e)) / atan(1 / e)
    return -(p.gravity - p.acceleration * wave) / p.length * sin(theta)


def viscous(theta: float, v: float, p: Any, s: Any) -> float:
    return -p.damping * v


def drag(theta: float, v: float, p: Any, s: Any) -> float:
    return -p.drag * (v * v) * s[0]


def spring(theta: float, v: float, p: Any, s: Any) -> float:
    return -p.stiffness * (theta - p.rest)


def constant(theta: float, v: float, p: Any, s: Any) -> float:
    return p.constant_torque


def dry(theta: float, v: float, p: Any, s: Any) -> float:
    return -p.friction * s[0]


DRIVE = VerticalDrive(0.003, 50.0)
SCENES: dict[str, tuple[tuple[Effect, ...], Handwritten]] = {
    "vertical drive": ((DRIVE,), by_hand(vertical)),
    "horizontal drive": ((HorizontalDrive(0.003, 50.0),), by_hand(horizontal)),
    "tilted drive": ((TiltedDrive(0.003, 50.0, tilt=0.3),), by_hand(tilted)),
    "rotating drive": ((RotatingDrive(0.003, 0.002, 50.0),), by_hand(rotating)),
    "torque drive": ((TorqueDrive(1e4, 50.0),), by_hand(alternating)),
    "three harmonics": ((HarmonicDrive((0.003, 4e-4, 1e-4), (0.0, 1.0, 2.0), 50.0),), by_hand(harmonic)),
    "smooth square wave": ((SquareDrive(296.0, 50.0, smoothing=0.3),), by_hand(smooth_square)),
    "smooth triangle wave": ((TriangleDrive(296.0, 50.0, smoothing=0.3),), by_hand(smooth_triangle)),
    "square wave": ((SquareDrive(296.0, 50.0),), by_hand(square)),
    "triangle wave": ((TriangleDrive(296.0, 50.0),), by_hand(triangle)),
    "vertical drive + constant torque": ((DRIVE, ConstantTorque(20.0)), by_hand(vertical, constant)),
}
ADDED: dict[str, tuple[Effect, Handwritten]] = {
    "viscous damping": (ViscousDamping(10.0), viscous),
    "torsion spring": (TorsionSpring(300.0, 0.1), spring),
    "quadratic drag": (QuadraticDrag(0.1), drag),
}
for number in range(1, len(ADDED) + 1):
    kinds, terms = zip(*list(ADDED.values())[:number], strict=True)
    SCENES[f"vertical drive + {' + '.join(list(ADDED)[:number])}"] = (DRIVE, *kinds), by_hand(vertical, *terms)


def kernel_of(system: ForcedSystem) -> Any:
    return flow(system, 0.0, system.length, 1e-9, 1e-9, "auto", 16384).kernel.advance


def test_effects_against_terms_by_hand(say, one_thread):
    """Where the formulas are equal so is the kernel: one time, measured twice."""
    initial_conditions = pendulum_initial_conditions(8192, 100.0)
    base = stroboscopic_map(scene(Pendulum(0.0272), Gravity(9.8), DRIVE))
    say("scenes of a pendulum with gravity: time against terms by hand, and against the vertical drive alone")
    for name, (effects, rhs) in SCENES.items():
        system = scene(Pendulum(0.0272), Gravity(9.8), *effects)
        hand = ForcedSystem(rhs, system.params, system.period, system.coordinates, switches=system.switches)
        ours, theirs = stroboscopic_map(system), stroboscopic_map(hand)
        assert ours(initial_conditions) == pytest.approx(theirs(initial_conditions), rel=1e-9, abs=1e-9)
        works = [lambda m=m: m.iterate(initial_conditions, 1) for m in (ours, theirs, base)]
        scene_time, hand_time, base_time = best_times(works, seconds=0.5)
        same = "the same kernel" if kernel_of(system) is kernel_of(hand) else "another kernel"
        say(f"  {name}: {scene_time / hand_time:.3f} of the time by hand ({same}); {scene_time / base_time:.2f}")


def friction_cases() -> dict[str, tuple[ForcedSystem, ForcedSystem, Callable[[int, float], np.ndarray], int]]:
    single, double = driven_pendulum(), double_pendulum()
    return {
        "pendulum, friction 10 rad/s^2": (
            single,
            driven_pendulum(damping=0.0, friction=10.0),
            pendulum_initial_conditions,
            16384,
        ),
        "pendulum, friction 300 rad/s^2": (
            single,
            driven_pendulum(damping=0.0, friction=300.0),
            pendulum_initial_conditions,
            16384,
        ),
        "double pendulum, friction 10 rad/s^2": (
            double,
            double_pendulum(damping=0.0, friction=10.0),
            double_initial_conditions,
            2048,
        ),
    }


@pytest.mark.parametrize("name", friction_cases())
def test_dry_friction_against_viscous(say, one_thread, name):
    smooth, approximate, initial_conditions_in, count = friction_cases()[name]
    if approximate.dimension == 2:
        hand = ForcedSystem(
            by_hand(vertical, dry),
            approximate.params,
            approximate.period,
            approximate.coordinates,
            switches=approximate.switches,
        )
        assert kernel_of(hand) is kernel_of(approximate)
    for rate in RATES:
        initial_conditions = initial_conditions_in(count, rate)
        maps = [stroboscopic_map(system) for system in (smooth, approximate)]
        for periods in (1, 50):
            # Later on many stick: the last period begins with the orbits that the earlier ones have left active.
            some = initial_conditions if periods == 1 else maps[1].iterate(initial_conditions, periods - 1).points
            viscous_time, dry_time = best_times([lambda m=m, x=some: m.iterate(x, 1) for m in maps], seconds=0.5)
            say(
                f"{name}, rates +-{rate:g} rad/s, period {periods}: {dry_time / viscous_time:.2f} times the time of "
                f"viscous damping 10/s; {count / dry_time:,.0f} periods/s"
            )


def double_by_hand(t: float, x: Any, p: Any) -> tuple[float, ...]:
    """Write the equations of the double pendulum solved for the accelerations, as textbooks have them."""
    a, b, u, v = x
    w = 2 * pi * p.frequency
    weight = p.gravity - p.amplitude * w * w * cos(w * t + p.phase)
    m, n, k, l = p.mass_1, p.mass_2, p.length_1, p.length_2  # noqa: E741
    d = a - b
    fraction = m + n * sin(d) ** 2
    first = n * (k * u * u * sin(2 * d) + 2 * l * v * v * sin(d))
    first += weight * ((2 * m + n) * sin(a) + n * sin(a - 2 * b))
    second = n * l * v * v * sin(2 * d) + (m + n) * (2 * k * u * u * sin(d) + weight * (sin(2 * a - b) - sin(b)))
    first, second = -first / (2 * k * fraction), second / (2 * l * fraction)
    if hasattr(p, "damping"):
        inner, outer = -p.damping * m * k * k * u, -p.damping * m * k * k * (v - u)
        inner = inner - outer
        determinant = n * k * k * l * l * fraction
        first += (n * l * l * inner - n * k * l * cos(d) * outer) / determinant
        second += ((m + n) * k * k * outer - n * k * l * cos(d) * inner) / determinant
    return u, v, first, second


PERIODS = 5  # a call of heyoka, so that the overhead of its calls from Python counts little
FORMS = {"the scene's equations": None, "textbook equations": double_by_hand}


@pytest.mark.parametrize("damping", [0.0, 10.0])
def test_double_pendulum_against_heyoka(say, one_thread, damping):
    """Errors are those of one period, in units of 1 + abs(image), which is how both programs weigh them."""
    pytest.importorskip("heyoka")
    system, initial_conditions = double_pendulum(damping=damping), double_initial_conditions(2048, 100.0)
    reference = stroboscopic_map(system, rtol=1e-14, atol=1e-14).iterate(initial_conditions, 1).unwrapped
    forms = {name: rhs or system.rhs for name, rhs in FORMS.items()}

    def error(images: np.ndarray) -> float:
        return float((np.abs(images - reference) / (1.0 + np.abs(reference))).max())

    ours: dict[tuple[str, float], PointMap] = {}
    for tolerance in (3e-10, 1e-9, 2e-9, 4e-9, 8e-9, 1.6e-8, 3.2e-8, 6.4e-8):
        for name, rhs in forms.items():
            if rhs is system.rhs or tolerance == 1e-9:
                form = ForcedSystem(rhs, system.params, system.period, system.coordinates)
                ours[name, tolerance] = stroboscopic_map(form, rtol=tolerance, atol=tolerance)
    peers = [(name, tolerance) for name in forms for tolerance in (1e-9, 1e-10, 1e-11)]
    works = [lambda m=m: m.iterate(initial_conditions, PERIODS) for m in ours.values()]
    runs = [heyoka_system(forms[name], system, tolerance, PERIODS) for name, tolerance in peers]
    works += [lambda run=run: run(initial_conditions) for run in runs]
    times = best_times(works, seconds=3.0)
    own_times, peer_times = dict(zip(ours, times, strict=False)), dict(zip(peers, times[len(ours) :], strict=True))
    own_errors = {key: error(m.iterate(initial_conditions, 1).unwrapped) for key, m in ours.items()}
    for key in ours:
        if key[1] == 1e-9:
            rate = PERIODS * len(initial_conditions) / own_times[key]
            say(
                f"double pendulum, damping {damping:g}/s, {key[0]}: cellmap 1e-9: {rate:,.0f} periods/s, largest error "
                f"{own_errors[key]:.1e}"
            )
    best = ("the scene's equations", 1e-9)
    for key in peers:
        own = error(heyoka_system(forms[key[0]], system, key[1])(initial_conditions))
        able = [taken for k, taken in own_times.items() if own_errors[k] <= own]
        at_equal = f"{peer_times[key] / min(able):.2f} times as fast at no larger error" if able else "none as accurate"
        say(
            f"  heyoka {key[1]:g}, {key[0]}: largest error {own:.1e}; cellmap is {at_equal}, "
            f"{peer_times[key] / own_times[best]:.2f} times at its own 1e-9"
        )
