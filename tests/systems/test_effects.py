"""Friction, springs and torques at the joint; energies; compound pendulums."""

from __future__ import annotations

from collections import Counter
from itertools import permutations
from math import cos, pi, sin
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cellmap import stroboscopic_map
from cellmap._compiled.codegen.kernel import traced_function
from cellmap._compiled.codegen.trace import STATEFUL
from systems import (
    BASIN_ROD,
    LONG_ROD,
    SHORT_ROD,
    CompoundPendulum,
    ConstantTorque,
    DryFriction,
    Effect,
    Gravity,
    HorizontalDrive,
    Pendulum,
    QuadraticDrag,
    TorsionSpring,
    VerticalDrive,
    ViscousDamping,
    compound_pendulum,
    driven_pendulum,
    scene,
    uniform_rod,
)

X = (0.7, -3.0)
SMOOTH: dict[Effect, float] = {
    Gravity(9.8): -9.8 / 0.5 * sin(0.7),
    ViscousDamping(2.0): 6.0,
    TorsionSpring(4.0, 0.2): -2.0,
    ConstantTorque(1.5): 1.5,
    VerticalDrive(0.1, 1.0): 0.1 * (2.0 * pi) ** 2 / 0.5 * sin(0.7),
}
RUBBING: dict[Effect, float] = {QuadraticDrag(0.1): 0.9, DryFriction(2.5): 2.5}


@pytest.mark.parametrize(("effect", "expected"), {**SMOOTH, **RUBBING}.items(), ids=repr)
def test_each_effect_alone(effect: Effect, expected: float) -> None:
    system = scene(Pendulum(0.5), effect, period=1.0)
    assert system.derivative(0.0, X) == pytest.approx((-3.0, expected), rel=1e-13)
    assert (system.switches is not None) == (effect in RUBBING)
    assert set(system.params) == {"length", *effect.parameters}


def test_all_effects_together() -> None:
    system = scene(Pendulum(0.5), *SMOOTH, *RUBBING)
    assert system.derivative(0.0, X) == pytest.approx((-3.0, sum([*SMOOTH.values(), *RUBBING.values()])), rel=1e-13)


def test_both_rubbing_effects_share_the_switch() -> None:
    system = scene(Pendulum(0.5), *RUBBING, period=1.0)
    assert system.switches is not None
    assert system.switches(0.0, X, system.parameters) == (-3.0,)
    assert system.derivative(0.0, X, (0.25,))[1] == pytest.approx(-0.25 * (0.1 * 9.0 + 2.5))
    assert system.derivative(0.0, (0.7, 0.0))[1] == 0.0  # the mean of both sides


def test_an_absent_friction_leaves_no_switch() -> None:
    system = driven_pendulum(friction=0.0)
    assert system.switches is None
    assert system.rhs is scene(Pendulum(1.0), Gravity(9.8), VerticalDrive(0.1, 1.0), ViscousDamping(1.0)).rhs
    assert driven_pendulum(friction=2.5).params["friction"] == 2.5
    assert driven_pendulum(friction=2.5).rhs is driven_pendulum(friction=1.0).rhs


@pytest.mark.parametrize(
    ("effects", "lanes"),
    [
        ((TorsionSpring(1.0, 0.1),), {"mul": 1, "sub": 1}),
        ((ConstantTorque(1.0),), {}),
        ((HorizontalDrive(0.1, 1.0),), {"cos": 1, "mul": 1}),
        ((Gravity(9.8), ConstantTorque(1.0)), {"sin": 1, "mul": 1, "add": 1}),
    ],
)
def test_an_absent_effect_leaves_nothing_behind(effects: tuple[Effect, ...], lanes: dict[str, int]) -> None:
    system = scene(Pendulum(1.0), *effects, period=1.0)
    trace = traced_function(system.rhs, 2, tuple(system.params))
    assert trace is not None
    levels = trace.levels()
    assert Counter(n.operation for n in levels if n.arguments and levels[n] == STATEFUL) == lanes
    assert not any(n.operation == "constant" and n.value == 0.0 for n in levels)


def test_the_order_of_effects_does_not_matter() -> None:
    effects = (Gravity(9.8), HorizontalDrive(0.1, 1.0), DryFriction(2.5), TorsionSpring(3.0))
    expected = scene(Pendulum(0.5), *effects).derivative(0.1, X)
    for order in permutations(effects):
        assert scene(Pendulum(0.5), *order).derivative(0.1, X) == pytest.approx(expected, rel=1e-13)


def test_a_spring_keeps_angles_on_the_line() -> None:
    system = scene(Pendulum(0.5), Gravity(9.8), TorsionSpring(4.0), period=1.0)
    assert not any(c.is_angle for c in system.axes)
    assert [c.unit for c in system.axes] == ["rad", "rad/s"]
    assert stroboscopic_map(system)([20.0, 0.0]) != pytest.approx(stroboscopic_map(system)([20.0 - 6.0 * pi, 0.0]))
    assert scene(Pendulum(0.5), Gravity(9.8), TorsionSpring(0.0), period=1.0).axes[0].is_angle


@pytest.mark.parametrize("body", [Pendulum(0.5), CompoundPendulum(2.0, 0.6, 0.5)])
@pytest.mark.parametrize("effects", [(Gravity(9.8),), (Gravity(9.8), TorsionSpring(5.0, 0.3)), (TorsionSpring(5.0),)])
def test_energy_is_kept_by_what_keeps_it(body: Any, effects: tuple[Effect, ...]) -> None:
    system = scene(body, *effects, period=1.0)
    solution = solve_ivp(system.fun, (0.0, 3.0), (2.5, 1.0), method="DOP853", rtol=1e-12, atol=1e-12)
    energies = system.output("energy", solution.t, solution.y.T)
    assert np.ptp(energies[:, 0]) > 0.01
    assert energies.sum(axis=-1) == pytest.approx(energies[0].sum(), rel=1e-9)


def test_energies_of_a_pendulum() -> None:
    system = driven_pendulum(length=2.0, amplitude=0.1)
    assert system.output("energy", 0.0, (0.3, 3.0)) == pytest.approx([18.0, -19.6 * cos(0.3)])  # the drive has none
    rod = scene(CompoundPendulum(2.0, 0.6, 0.5), Gravity(9.8), TorsionSpring(5.0), period=1.0)
    assert rod.output("energy", 0.0, (0.3, 3.0)) == pytest.approx([2.7, -9.8 * cos(0.3) + 0.6 * 2.5 * 0.09])
    assert scene(Pendulum(1.0), period=1.0).output("energy", 0.0, (0.3, 3.0)).tolist() == [4.5, 0.0]


def test_a_compound_pendulum_moves_as_the_point_at_its_effective_length() -> None:
    for length in (LONG_ROD, SHORT_ROD, BASIN_ROD):
        rod = uniform_rod(length, mass=0.3)
        assert rod.effective_length == pytest.approx(length, rel=1e-15)
        assert rod.inertia == pytest.approx(0.3 * (1.5 * length) ** 2 / 3.0, rel=1e-14)
        system = scene(rod, Gravity(9.8), VerticalDrive(0.003, 50.0), ViscousDamping(10.0))
        assert system.fun(0.003, np.array(X)) == pytest.approx(
            driven_pendulum(length).fun(0.003, np.array(X)), rel=1e-13
        )
    assert compound_pendulum(0.3, 0.75 * 0.3 * 0.0272**2, 0.75 * 0.0272).fun(0.01, np.array(X)) == pytest.approx(
        driven_pendulum().fun(0.01, np.array(X)), rel=1e-13
    )
    place = scene(uniform_rod(2.0), Gravity(9.8), period=1.0).output("positions", 0.0, (pi / 2, 0.0))
    assert place == pytest.approx([0.0, 0.0, 1.5, 0.0])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: DryFriction(-1.0), "friction=-1.0: give a number of at least 0"),
        (lambda: QuadraticDrag(-1.0), "drag=-1.0: give a number of at least 0"),
        (lambda: TorsionSpring(float("inf")), "stiffness=inf: give a finite number"),
        (lambda: CompoundPendulum(0.0, 1.0, 1.0), "mass=0.0: give a number above 0"),
        (lambda: CompoundPendulum(1.0, 1.0, 2.0), "inertia=1.0: about the pivot it is at least mass x distance"),
        (lambda: uniform_rod(0.0), "effective_length=0.0: give a number above 0"),
        (lambda: driven_pendulum(friction=-1.0), "friction=-1.0: give a number of at least 0"),
    ],
)
def test_bad_effects_are_refused(make: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()
