"""Scenes: only the effects that are present are in the kernel."""

from collections import Counter
from math import cos, pi, sin
from typing import Any

import pytest

import systems
from cellmap import ForcedSystem, stroboscopic_map
from cellmap._compiled.codegen.kernel import flow_kernel, traced_function
from cellmap._compiled.codegen.methods import choose_method
from cellmap._compiled.codegen.period import period_text
from cellmap._compiled.codegen.trace import STATEFUL, TIMED, Trace
from cellmap._compiled.machine_code import machine_code

GRAVITY, DRIVE, DAMPING = systems.Gravity(9.8), systems.VerticalDrive(0.003, 50.0), systems.ViscousDamping(10.0)


def traced(system: ForcedSystem) -> Trace:
    result = traced_function(system.rhs, system.dimension, tuple(system.params))
    assert result is not None
    return result


def operations(system: ForcedSystem, level: int) -> Counter[str]:
    levels = traced(system).levels()
    return Counter(n.operation for n in levels if n.arguments and levels[n] == level)


def kernel_text(system: ForcedSystem, method: str = "DOP853") -> str:
    step: Any = choose_method(method, traced(system), 1e-9).write(traced(system))
    return period_text(step, system.dimension, len(system.params), 4)


@pytest.mark.parametrize(
    ("effects", "in_lanes", "before_lanes"),
    [
        ((GRAVITY, DRIVE, DAMPING), {"sin": 1, "mul": 2, "add": 1}, {"cos": 1}),
        ((GRAVITY, DRIVE), {"sin": 1, "mul": 1}, {"cos": 1}),
        ((DRIVE, DAMPING), {"sin": 1, "mul": 2, "add": 1}, {"cos": 1}),
        ((GRAVITY, DAMPING), {"sin": 1, "mul": 2, "add": 1}, {}),
        ((systems.TorsionSpring(1.0, 0.1),), {"mul": 1, "sub": 1}, {}),
        ((systems.ConstantTorque(1.0),), {}, {}),
        ((GRAVITY, systems.ConstantTorque(1.0)), {"sin": 1, "mul": 1, "add": 1}, {}),
        ((DAMPING,), {"mul": 1}, {}),
        ((), {}, {}),
    ],
)
def test_an_absent_effect_leaves_nothing_behind(effects, in_lanes, before_lanes):
    """Operations of the lane loop are those of the effects present; the drive's cosine stands before it."""
    system = systems.scene(systems.Pendulum(0.0272), *effects, period=0.02)
    assert operations(system, STATEFUL) == in_lanes
    timed = operations(system, TIMED)
    assert {f: n for f, n in timed.items() if f in {"sin", "cos"}} == before_lanes
    if not before_lanes:
        assert not timed
    for method, stages in (("DOP853", 12), ("RK45", 7)):
        text = kernel_text(system, method)
        assert text.count(" = call <4 x double> @lanes.sin.4(") == stages * in_lanes.get("sin", 0)
        assert "@lanes.cos" not in text
        assert ("call double @cos(" in text) == bool(before_lanes)


def test_a_vanishing_effect_is_an_absent_one() -> None:
    nothing = (systems.Gravity(0.0), systems.VerticalDrive(0.0, 50.0), systems.ViscousDamping(0.0))
    for k, effect in enumerate((GRAVITY, DRIVE, DAMPING)):
        effects = [*nothing[:k], effect, *nothing[k + 1 :]]
        with_zeros = systems.scene(systems.Pendulum(1.0), *effects)
        without = systems.scene(systems.Pendulum(1.0), effect, period=0.02)
        assert with_zeros.rhs is without.rhs
        assert with_zeros.params == without.params
        assert with_zeros.length == without.length == 0.02
    assert kernel_text(systems.driven_pendulum(amplitude=0.0)) == kernel_text(
        systems.scene(systems.Pendulum(1.0), GRAVITY, DAMPING, period=1.0)
    )
    assert list(systems.driven_pendulum(amplitude=0.0, damping=0.0, gravity=0.0).params) == ["length"]


def test_the_kernel_is_that_of_a_right_hand_side_written_by_hand() -> None:
    def by_hand(t: float, x: Any, p: Any) -> tuple[float, float]:
        theta, v = x
        w = 2.0 * pi * p.frequency
        acceleration = -(p.amplitude * w * w) * cos(w * t + p.phase)
        return v, -((p.gravity + acceleration) / p.length) * sin(theta) + -p.damping * v

    system = systems.driven_pendulum()
    hand = ForcedSystem(by_hand, system.params, system.length, system.axes)
    for method in ("DOP853", "RK45", "Taylor"):
        assert kernel_text(system, method) == kernel_text(hand, method)
    advance = [flow_kernel(s.rhs, 2, tuple(s.params), "auto", 1e-9).advance for s in (system, hand)]
    assert advance[0] is advance[1]


def test_a_sweep_compiles_nothing() -> None:
    stroboscopic_map(systems.driven_pendulum())([1.0, 0.0])
    compiled = machine_code.cache_info().misses
    for amplitude in (0.001, 0.002, 0.010):
        for frequency in (30.0, 60.0):
            stroboscopic_map(systems.driven_pendulum(amplitude=amplitude, frequency=frequency))([1.0, 0.0])
    assert machine_code.cache_info().misses == compiled
