"""Scenes with several effects of a kind, and with a number for each joint, against equations written by hand."""

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, pi, sin
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import systems
from cellmap import ForcedSystem, stroboscopic_map
from cellmap._compiled.codegen.kernel import traced_function

CHAIN = systems.Chain(lengths=(0.11, 0.07), masses=(0.3, 0.5))
STATE = (0.7, -0.4, 3.0, -2.0)
GRAVITY = systems.Gravity(9.8)


def two_links(torques: tuple[float, float], x: tuple[float, ...]) -> NDArray[np.float64]:
    """Accelerations of two links by Lagrange's equation, with the angular accelerations of the joints."""
    (l1, l2), (m1, m2) = CHAIN.lengths, CHAIN.masses
    a, b, u, v = x
    mass = [[(m1 + m2) * l1 * l1, m2 * l1 * l2 * cos(a - b)], [m2 * l1 * l2 * cos(a - b), m2 * l2 * l2]]
    inner, outer = (m1 * l1 * l1 * torque for torque in torques)
    force = [
        -m2 * l1 * l2 * sin(a - b) * v * v - (m1 + m2) * 9.8 * l1 * sin(a) + inner - outer,
        m2 * l1 * l2 * sin(a - b) * u * u - m2 * 9.8 * l2 * sin(b) + outer,
    ]
    return np.linalg.solve(mass, force)


R1, R2 = STATE[2], STATE[3] - STATE[2]
AT_EACH_JOINT: dict[systems.Effect, tuple[float, float]] = {
    systems.ViscousDamping((5.0, 2.0)): (-5.0 * R1, -2.0 * R2),
    systems.ViscousDamping((0.0, 2.0)): (0.0, -2.0 * R2),
    systems.ViscousDamping((5.0, 0.0)): (-5.0 * R1, 0.0),
    systems.DryFriction((1.5, 4.0)): (-1.5, 4.0),
    systems.DryFriction((0.0, 4.0)): (0.0, 4.0),
    systems.QuadraticDrag((0.2, 0.3)): (-0.2 * R1**2, 0.3 * R2**2),
    systems.TorsionSpring((3.0, 7.0), 0.1): (-3.0 * (0.7 - 0.1), -7.0 * (-1.1 - 0.1)),
    systems.TorsionSpring(3.0, (0.1, -0.2)): (-3.0 * (0.7 - 0.1), -3.0 * (-1.1 + 0.2)),
}


@pytest.mark.parametrize(("effect", "torques"), AT_EACH_JOINT.items(), ids=repr)
def test_each_joint_has_its_own_number(effect: systems.Effect, torques: tuple[float, float]) -> None:
    system = systems.scene(CHAIN, GRAVITY, effect, period=1.0)
    assert system.derivative(0.0, STATE)[2:] == pytest.approx(two_links(torques, STATE), rel=1e-13)


def test_equal_numbers_are_one_number() -> None:
    one, each = (
        systems.scene(CHAIN, GRAVITY, systems.ViscousDamping(c), systems.DryFriction(d), period=1.0)
        for c, d in ((5, 2), ([5, 5], [2, 2]))
    )
    for x in np.random.default_rng(0).uniform(-3.0, 3.0, (20, 4)):
        assert one.derivative(0.0, x) == each.derivative(0.0, x)


def test_a_joint_without_friction_has_no_switch_and_no_term() -> None:
    outer = systems.scene(CHAIN, GRAVITY, systems.DryFriction((0.0, 4.0)), period=1.0)
    both = systems.scene(CHAIN, GRAVITY, systems.DryFriction((1.5, 4.0)), period=1.0)
    assert outer.switches is not None and both.switches is not None
    assert outer.switches(0.0, STATE, outer.parameters) == (R2,)
    assert both.switches(0.0, STATE, both.parameters) == (R1, R2)
    assert "friction_1" not in outer.params
    damped = [systems.scene(CHAIN, GRAVITY, systems.ViscousDamping(c), period=1.0) for c in ((0.0, 2.0), (5.0, 2.0))]
    traces = [traced_function(system.rhs, 4, tuple(system.params)) for system in damped]
    sizes = [sum(bool(node.arguments) for node in trace.levels()) for trace in traces if trace is not None]
    assert sizes[0] < sizes[1]
    assert (
        systems.scene(CHAIN, GRAVITY, systems.ViscousDamping((0.0, 0.0)), period=1.0).rhs
        is systems.scene(CHAIN, GRAVITY, period=1.0).rhs
    )


def test_springs_of_joints_store_energy() -> None:
    system = systems.scene(CHAIN, systems.TorsionSpring((3.0, 7.0), 0.1), period=1.0)
    stored = 0.3 * 0.11**2 * 0.5 * (3.0 * 0.6**2 + 7.0 * 1.2**2)
    assert system.output("energy", 0.0, STATE)[1] == pytest.approx(stored, rel=1e-13)
    assert not any(c.period for c in system.axes)


# --- several drives, and several effects of a kind


def pushed_twice(t: float, x: Any, p: Any) -> tuple[float, float]:
    """The pendulum under a fast shaker and a slow torque, by hand."""
    theta, v = x
    w, u = 2.0 * pi * p.vertical_drive_frequency, 2.0 * pi * p.torque_drive_frequency
    lift = -(p.vertical_drive_amplitude * w * w) * cos(w * t + p.vertical_drive_phase)
    torque = p.torque_drive_torque * cos(u * t + p.torque_drive_phase)
    return v, -((p.gravity + lift) / p.length) * sin(theta) + -p.damping * v + torque


SHAKER, SLOW = systems.VerticalDrive(0.003, 50.0, 0.3), systems.TorqueDrive(20.0, 25.0, 0.1)


def test_two_drives_are_those_of_an_equation_written_by_hand(scipy_images: Callable[..., NDArray[np.float64]]) -> None:
    system = systems.scene(systems.Pendulum(0.0272), GRAVITY, SHAKER, systems.ViscousDamping(10.0), SLOW)
    assert system.length == 0.04
    assert system.params == {
        "length": 0.0272,
        "gravity": 9.8,
        "damping": 10.0,
        **{f"vertical_drive_{name}": v for name, v in SHAKER.parameters.items()},
        **{f"torque_drive_{name}": v for name, v in SLOW.parameters.items()},
    }
    hand = ForcedSystem(pushed_twice, system.params, 0.04, system.axes)
    initial_conditions = np.random.default_rng(0).uniform(-3.0, 3.0, (5, 2))
    for t, x in zip((0.0, 0.003, 0.011, 0.017, 0.031), initial_conditions, strict=True):
        assert system.derivative(t, x) == pytest.approx(hand.derivative(t, x), rel=1e-14)
    images = stroboscopic_map(system, rtol=1e-12, atol=1e-12).iterate(initial_conditions, 1).unwrapped
    assert images == pytest.approx(scipy_images(hand, initial_conditions), rel=1e-9, abs=1e-9)


def test_effects_of_one_kind_are_numbered() -> None:
    drives = systems.HorizontalDrive(0.01, 2.0), systems.HorizontalDrive(0.02, 3.0, 0.5)
    springs = systems.TorsionSpring(3.0), systems.TorsionSpring(5.0, 0.2)
    system = systems.scene(systems.Pendulum(0.5), *drives, *springs)
    assert system.length == pytest.approx(1.0)
    assert system.params["horizontal_drive_1_frequency"] == 2.0
    assert system.params["horizontal_drive_2_phase"] == 0.5
    pull = [-d.amplitude * (2 * pi * d.frequency) ** 2 * cos(2 * pi * d.frequency * 0.1 + d.phase) for d in drives]
    expected = -sum(pull) / 0.5 * cos(0.7) - 3.0 * 0.7 - 5.0 * 0.5
    assert system.derivative(0.1, (0.7, -3.0)) == pytest.approx((-3.0, expected), rel=1e-13)
    assert system.output("energy", 0.1, (0.7, 0.0))[1] == pytest.approx(0.25 * (1.5 * 0.49 + 2.5 * 0.25))
    place = sum(d.amplitude * cos(2 * pi * d.frequency * 0.1 + d.phase) for d in drives)
    assert system.output("positions", 0.1, (0.0, 0.0))[:2] == pytest.approx([place, 0.0])


def test_sharp_waves_have_their_own_switches() -> None:
    system = systems.scene(
        systems.Pendulum(0.5),
        systems.SquareDrive(30.0, 2.0),
        systems.SquareDrive(10.0, 1.0, 0.4),
        systems.DryFriction(0.5),
    )
    assert system.switches is not None
    clocks = (-3.0, cos(4 * pi * 0.1), cos(2 * pi * 0.1 + 0.4))
    assert system.switches(0.1, (0.7, -3.0), system.parameters) == pytest.approx(clocks)
    expected = (30.0 * np.sign(clocks[1]) + 10.0 * np.sign(clocks[2])) / 0.5 * sin(0.7) + 0.5
    assert system.derivative(0.1, (0.7, -3.0))[1] == pytest.approx(expected, rel=1e-13)


def test_names_depend_on_the_effects_and_not_on_their_values() -> None:
    quiet = systems.scene(systems.Pendulum(0.0272), GRAVITY, systems.VerticalDrive(0.0, 50.0), SLOW)
    assert quiet.params["torque_drive_frequency"] == 25.0
    assert quiet.length == 0.04
    assert not any(name.startswith("vertical") for name in quiet.params)
    loud, louder = (
        systems.scene(systems.Pendulum(0.0272), GRAVITY, systems.VerticalDrive(a, 50.0), SLOW) for a in (0.003, 0.004)
    )
    assert loud.rhs is louder.rhs
    resting = systems.scene(
        systems.Pendulum(0.0272), GRAVITY, systems.VerticalDrive(0.0, 50.0), systems.TorqueDrive(0.0, 20.0)
    )
    assert resting.length == pytest.approx(0.1)
    assert set(resting.params) == {"length", "gravity"}


@dataclass(frozen=True)
class Weathervane(systems.Effect):
    """An effect that has a parameter of the pendulum, and a branch."""

    length: float = systems.quantity(systems.NUMBER)
    push: float = systems.quantity(systems.ANGULAR_ACCELERATION)

    @property
    def terms(self) -> systems.Terms:
        return systems.Terms(joint=one_sided)

    @property
    def vanishes(self) -> bool:
        return False


def one_sided(t: float, angle: float, rate: float, p: Any) -> float:
    push = 0.0
    while sin(angle) > push + p.length:  # a loop that cannot be traced
        push = push + p.push
    return -push


def test_an_effect_with_a_parameter_of_the_body_gets_the_prefix_and_compiles_as_it_is() -> None:
    system = systems.scene(systems.Pendulum(0.5), GRAVITY, Weathervane(0.25, 0.1), period=0.1)
    assert system.params == {"length": 0.5, "gravity": 9.8, "weathervane_length": 0.25, "weathervane_push": 0.1}
    assert traced_function(system.rhs, 2, tuple(system.params)) is None

    state = (1.2, 0.3)
    expected = (0.3, -9.8 / 0.5 * sin(1.2) - 0.7)  # 0.25 + 7 pushes is above sin 1.2
    assert system.derivative(0.0, state) == pytest.approx(expected, rel=1e-14)


@pytest.mark.thorough
def test_an_effect_that_cannot_be_traced_compiles_as_it_is() -> None:
    system = systems.scene(systems.Pendulum(0.5), systems.Gravity(0.0), Weathervane(0.25, 0.1), period=0.1)
    moved = (stroboscopic_map(system)((1.2, 0.3)) - (1.2, 0.3)) / system.length
    assert moved == pytest.approx((0.3 - 0.5 * 0.7 * system.length, -0.7), rel=1e-6)


def test_with_params_keeps_the_common_period() -> None:
    system = systems.scene(systems.Pendulum(0.0272), GRAVITY, SHAKER, SLOW)
    faster = system.with_params(vertical_drive_frequency=60.0, torque_drive_frequency=30.0)
    assert faster.length == pytest.approx(1 / 30.0)
    with pytest.raises(ValueError, match="period"):
        system.with_params(torque_drive_frequency=30.0)
