"""Friction, springs and torques at the joint; energies; compound pendulums."""

from itertools import permutations
from math import cos, pi, sin
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import systems

X = (0.7, -3.0)
SMOOTH: dict[systems.Effect, float] = {
    systems.Gravity(9.8): -9.8 / 0.5 * sin(0.7),
    systems.ViscousDamping(2.0): 6.0,
    systems.TorsionSpring(4.0, 0.2): -2.0,
    systems.ConstantTorque(1.5): 1.5,
    systems.VerticalDrive(0.1, 1.0): 0.1 * (2.0 * pi) ** 2 / 0.5 * sin(0.7),
}
RUBBING: dict[systems.Effect, float] = {systems.QuadraticDrag(0.1): 0.9, systems.DryFriction(2.5): 2.5}


@pytest.mark.parametrize(("effect", "expected"), {**SMOOTH, **RUBBING}.items(), ids=repr)
def test_each_effect_alone(effect: systems.Effect, expected: float) -> None:
    system = systems.scene(systems.Pendulum(0.5), effect, period=1.0)
    assert system.derivative(0.0, X) == pytest.approx((-3.0, expected), rel=1e-13)
    assert (system.switches is not None) == (effect in RUBBING)
    assert set(system.params) == {"length", *effect.parameters}


def test_all_effects_together() -> None:
    system = systems.scene(systems.Pendulum(0.5), *SMOOTH, *RUBBING)
    assert system.derivative(0.0, X) == pytest.approx((-3.0, sum([*SMOOTH.values(), *RUBBING.values()])), rel=1e-13)


def test_both_rubbing_effects_share_the_switch() -> None:
    system = systems.scene(systems.Pendulum(0.5), *RUBBING, period=1.0)
    assert system.switches is not None
    assert system.switches(0.0, X, system.parameters) == (-3.0,)
    assert system.derivative(0.0, X, (0.25,))[1] == pytest.approx(-0.25 * (0.1 * 9.0 + 2.5))
    assert system.derivative(0.0, (0.7, 0.0))[1] == 0.0  # the mean of both sides


def test_an_absent_friction_leaves_no_switch() -> None:
    system = systems.driven_pendulum(friction=0.0)
    assert system.switches is None
    assert (
        system.rhs
        is systems.scene(
            systems.Pendulum(1.0), systems.Gravity(9.8), systems.VerticalDrive(0.1, 1.0), systems.ViscousDamping(1.0)
        ).rhs
    )
    assert systems.driven_pendulum(friction=2.5).params["friction"] == 2.5
    assert systems.driven_pendulum(friction=2.5).rhs is systems.driven_pendulum(friction=1.0).rhs


def test_the_order_of_effects_does_not_matter() -> None:
    effects = (
        systems.Gravity(9.8),
        systems.HorizontalDrive(0.1, 1.0),
        systems.DryFriction(2.5),
        systems.TorsionSpring(3.0),
    )
    expected = systems.scene(systems.Pendulum(0.5), *effects).derivative(0.1, X)
    for order in permutations(effects):
        assert systems.scene(systems.Pendulum(0.5), *order).derivative(0.1, X) == pytest.approx(expected, rel=1e-13)


def test_a_spring_keeps_angles_on_the_line() -> None:
    system = systems.scene(systems.Pendulum(0.5), systems.Gravity(9.8), systems.TorsionSpring(4.0), period=1.0)
    assert not any(c.is_angle for c in system.axes)
    assert [c.unit for c in system.axes] == ["rad", "rad/s"]
    assert (
        systems.scene(systems.Pendulum(0.5), systems.Gravity(9.8), systems.TorsionSpring(0.0), period=1.0)
        .axes[0]
        .is_angle
    )


@pytest.mark.parametrize("body", [systems.Pendulum(0.5), systems.CompoundPendulum(2.0, 0.6, 0.5)])
@pytest.mark.parametrize(
    "effects", [(systems.Gravity(9.8), systems.TorsionSpring(5.0, 0.3)), (systems.TorsionSpring(5.0),)]
)
def test_energy_is_kept_by_what_keeps_it(body: Any, effects: tuple[systems.Effect, ...]) -> None:
    system = systems.scene(body, *effects, period=1.0)
    solution = solve_ivp(system.fun, (0.0, 3.0), (2.5, 1.0), method="DOP853", rtol=1e-12, atol=1e-12)
    energies = system.output("energy", solution.t, solution.y.T)
    assert np.ptp(energies[:, 0]) > 0.01
    assert energies.sum(axis=-1) == pytest.approx(energies[0].sum(), rel=1e-9)


def test_energies_of_a_pendulum() -> None:
    system = systems.driven_pendulum(length=2.0, amplitude=0.1)
    assert system.output("energy", 0.0, (0.3, 3.0)) == pytest.approx([18.0, -19.6 * cos(0.3)])  # the drive has none
    rod = systems.scene(
        systems.CompoundPendulum(2.0, 0.6, 0.5), systems.Gravity(9.8), systems.TorsionSpring(5.0), period=1.0
    )
    assert rod.output("energy", 0.0, (0.3, 3.0)) == pytest.approx([2.7, -9.8 * cos(0.3) + 0.6 * 2.5 * 0.09])
    assert systems.scene(systems.Pendulum(1.0), period=1.0).output("energy", 0.0, (0.3, 3.0)).tolist() == [4.5, 0.0]


def test_a_compound_pendulum_moves_as_the_point_at_its_effective_length() -> None:
    for length in (systems.LONG_ROD, systems.SHORT_ROD, systems.BASIN_ROD):
        rod = systems.uniform_rod(length, mass=0.3)
        assert rod.effective_length == pytest.approx(length, rel=1e-15)
        assert rod.inertia == pytest.approx(0.3 * (1.5 * length) ** 2 / 3.0, rel=1e-14)
        system = systems.scene(
            rod, systems.Gravity(9.8), systems.VerticalDrive(0.003, 50.0), systems.ViscousDamping(10.0)
        )
        assert system.fun(0.003, np.array(X)) == pytest.approx(
            systems.driven_pendulum(length).fun(0.003, np.array(X)), rel=1e-13
        )
    assert systems.compound_pendulum(0.3, 0.75 * 0.3 * 0.0272**2, 0.75 * 0.0272).fun(
        0.01, np.array(X)
    ) == pytest.approx(systems.driven_pendulum().fun(0.01, np.array(X)), rel=1e-13)
    place = systems.scene(systems.uniform_rod(2.0), systems.Gravity(9.8), period=1.0).output(
        "positions", 0.0, (pi / 2, 0.0)
    )
    assert place == pytest.approx([0.0, 0.0, 1.5, 0.0])
