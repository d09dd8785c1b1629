"""Scenes: only the effects that are present are in the kernel."""

from __future__ import annotations

from collections import Counter
from dataclasses import FrozenInstanceError, dataclass, fields
from math import cos, inf, nan, pi, sin
from typing import Any

import numpy as np
import pytest

from cellmap import ForcedSystem, stroboscopic_map
from cellmap._compiled.codegen.kernel import flow_kernel, traced_function
from cellmap._compiled.codegen.methods import choose_method
from cellmap._compiled.codegen.period import period_text
from cellmap._compiled.codegen.trace import STATEFUL, TIMED, Trace
from cellmap._compiled.machine_code import machine_code
from systems import (
    Effect,
    Gravity,
    Pendulum,
    Terms,
    VerticalDrive,
    ViscousDamping,
    dimensionless_pendulum,
    driven_pendulum,
    scene,
)
from systems.dimensionless import ScaledDamping, ScaledGravity, ScaledPendulum, ScaledVerticalDrive
from systems.forces import total

GRAVITY, DRIVE, DAMPING = Gravity(9.8), VerticalDrive(0.003, 50.0), ViscousDamping(10.0)


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
        ((GRAVITY,), {"sin": 1, "mul": 1}, {}),
        ((DAMPING,), {"mul": 1}, {}),
        ((), {}, {}),
    ],
)
def test_an_absent_effect_leaves_nothing_behind(
    effects: tuple[Effect, ...], in_lanes: dict[str, int], before_lanes: dict[str, int]
) -> None:
    """Operations of the lane loop are those of the effects present; the drive's cosine stands before it."""
    system = scene(Pendulum(0.0272), *effects, period=0.02)
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
    nothing = (Gravity(0.0), VerticalDrive(0.0, 50.0), ViscousDamping(0.0))
    for k, effect in enumerate((GRAVITY, DRIVE, DAMPING)):
        effects = [*nothing[:k], effect, *nothing[k + 1 :]]
        with_zeros = scene(Pendulum(1.0), *effects)
        without = scene(Pendulum(1.0), effect, period=0.02)
        assert with_zeros.rhs is without.rhs
        assert with_zeros.params == without.params
        assert with_zeros.length == without.length == 0.02
    assert kernel_text(driven_pendulum(amplitude=0.0)) == kernel_text(
        scene(Pendulum(1.0), GRAVITY, DAMPING, period=1.0)
    )
    assert list(driven_pendulum(amplitude=0.0, damping=0.0, gravity=0.0).params) == ["length"]


def test_the_kernel_is_that_of_a_right_hand_side_written_by_hand() -> None:
    def by_hand(t: float, x: Any, p: Any) -> tuple[float, float]:
        theta, v = x
        w = 2.0 * pi * p.frequency
        acceleration = -(p.amplitude * w * w) * cos(w * t + p.phase)
        return v, -((p.gravity + acceleration) / p.length) * sin(theta) + -p.damping * v

    system = driven_pendulum()
    hand = ForcedSystem(by_hand, system.params, system.length, system.axes)
    for method in ("DOP853", "RK45", "Taylor"):
        assert kernel_text(system, method) == kernel_text(hand, method)
    advance = [flow_kernel(s.rhs, 2, tuple(s.params), "auto", 1e-9).advance for s in (system, hand)]
    assert advance[0] is advance[1]


def test_equal_structures_share_their_right_hand_side() -> None:
    assert driven_pendulum(amplitude=0.002, damping=3.0).rhs is driven_pendulum().rhs
    assert driven_pendulum(damping=0.0).rhs is not driven_pendulum().rhs
    assert dimensionless_pendulum().rhs is not driven_pendulum().rhs


def test_a_sweep_compiles_nothing() -> None:
    stroboscopic_map(driven_pendulum())([1.0, 0.0])
    compiled = machine_code.cache_info().misses
    for amplitude in (0.001, 0.002, 0.010):
        for frequency in (30.0, 60.0):
            stroboscopic_map(driven_pendulum(amplitude=amplitude, frequency=frequency))([1.0, 0.0])
    assert machine_code.cache_info().misses == compiled


def test_the_order_of_effects_does_not_matter() -> None:
    initial_conditions = np.random.default_rng(0).uniform(-3.0, 3.0, (50, 2)) * [1.0, 30.0]
    images = stroboscopic_map(scene(Pendulum(0.0272), GRAVITY, DRIVE, DAMPING))(initial_conditions)
    assert stroboscopic_map(scene(Pendulum(0.0272), DAMPING, DRIVE, GRAVITY))(initial_conditions) == pytest.approx(
        images, rel=1e-9, abs=1e-9
    )


@dataclass(frozen=True)
class Spring(Effect):
    """Torsion spring, an effect as a user would add it."""

    stiffness: float

    @property
    def terms(self) -> Terms:
        return Terms(joint=lambda t, angle, rate, p: -p.stiffness * sin(angle))

    @property
    def vanishes(self) -> bool:
        return self.stiffness == 0.0


def test_a_new_effect_is_one_record() -> None:
    system = scene(Pendulum(2.0), Gravity(4.0), Spring(3.0), period=1.0)
    assert system.params == {"length": 2.0, "gravity": 4.0, "stiffness": 3.0}
    assert system.derivative(0.0, (0.5, 1.0)) == pytest.approx((1.0, -5.0 * sin(0.5)), rel=1e-15)


def test_scenes_that_branch_compile_too() -> None:
    """Terms that cannot be traced are compiled as they are: nested functions, no loop over a tuple of them."""

    @dataclass(frozen=True)
    class OneSided(Spring):
        @property
        def terms(self) -> Terms:
            return Terms(joint=_one_sided)

    free = scene(Pendulum(1.0), Gravity(1.0), ViscousDamping(0.1), period=0.5)
    stopped = scene(Pendulum(1.0), Gravity(1.0), OneSided(2.0), ViscousDamping(0.1), period=0.5)
    exact, without = stroboscopic_map(stopped), stroboscopic_map(free)
    ic = [-1.0, 0.0]  # stays below zero for half a unit of time
    assert exact(ic) == pytest.approx(without(ic), abs=1e-8)
    pushed = exact([1.0, 0.0])
    assert np.isfinite(pushed).all() and pushed[1] < without([1.0, 0.0])[1] - 0.1


def _one_sided(t: float, angle: float, rate: float, p: Any) -> float:
    return -p.stiffness * sin(angle) if sin(angle) > 0.0 else 0.0


def test_sums_of_terms() -> None:
    terms = [lambda t, p: t, lambda t, p: 10.0 * p, lambda t, p: 100.0]
    assert total(terms)(1.0, 2.0) == 121.0
    assert total(terms[:1]) is terms[0]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda v: Gravity(v), "gravity"),
        (lambda v: VerticalDrive(v, 50.0), "amplitude"),
        (lambda v: VerticalDrive(0.003, v), "frequency"),
        (lambda v: VerticalDrive(0.003, 50.0, v), "phase"),
        (lambda v: ViscousDamping(v), "damping"),
        (lambda v: Pendulum(v), "length"),
        (lambda v: ScaledGravity(v), "alpha"),
        (lambda v: ScaledVerticalDrive(v), "beta"),
        (lambda v: ScaledDamping(v), "gamma"),
    ],
)
def test_parameters_of_parts_are_checked(make: Any, message: str) -> None:
    for bad in (nan, inf, -inf):
        with pytest.raises(ValueError, match=f"{message}=.*: give a finite number"):
            make(bad)
    for bad in (None, "1", 1j, [[1.0]]):  # damping may be a sequence, of numbers
        with pytest.raises(TypeError, match=f"{message}(_1)?=.*: give one real number"):
            make(bad)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ViscousDamping(-1.0), "damping=-1.0: give a number of at least 0"),
        (lambda: ScaledDamping(-1e-9), "gamma=-1e-09: give a number of at least 0"),
        (lambda: VerticalDrive(-0.003, 50.0), "amplitude=-0.003: give a number of at least 0"),
        (lambda: VerticalDrive(0.003, 0.0), "frequency=0.0: give a number above 0"),
        (lambda: VerticalDrive(0.003, -50.0), "frequency=-50.0: give a number above 0"),
        (lambda: Pendulum(0.0), "length=0.0: give a number above 0"),
        (lambda: Pendulum(-1.0), "length=-1.0: give a number above 0"),
        (lambda: driven_pendulum(damping=-1.0), "damping=-1.0: give a number of at least 0"),
        (lambda: driven_pendulum(length=0.0), "length=0.0: give a number above 0"),
        (lambda: scene(Pendulum(1.0), GRAVITY), "period=None: .* there are none. Give period="),
        (lambda: scene(Pendulum(1.0), DRIVE, VerticalDrive(0.1, pi)), "periods 0.02, 0.31831, .* Give frequencies"),
        (lambda: scene(Pendulum(1.0), GRAVITY, period=-1.0), "period=-1.0: give a number above 0"),
        (lambda: scene(Pendulum(1.0), GRAVITY, DRIVE, period=0.017), "give the period of the forcing"),
    ],
)
def test_bad_scenes_are_refused(make: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()


@pytest.mark.parametrize("make", [lambda: scene(GRAVITY, DRIVE), lambda: scene(Pendulum(1.0), 9.8, DRIVE)])  # type: ignore[arg-type]
def test_what_is_no_body_and_no_effect_is_refused(make: Any) -> None:
    with pytest.raises(TypeError, match=r"give (a body|effects), such as"):
        make()


def test_parts_are_records() -> None:
    assert VerticalDrive(0.003, 50) == VerticalDrive(0.003, 50.0, 0.0)
    assert [f.name for f in fields(VerticalDrive)] == list(DRIVE.parameters)
    with pytest.raises(FrozenInstanceError):
        DRIVE.amplitude = 1.0  # type: ignore[misc]
    assert repr(DAMPING) == "ViscousDamping(damping=10.0)"


def test_a_period_of_ones_own_choice() -> None:
    twice = scene(Pendulum(0.0272), GRAVITY, DRIVE, DAMPING, period=0.04)
    once = driven_pendulum()
    assert stroboscopic_map(twice)([1.0, 5.0]) == pytest.approx(
        stroboscopic_map(once).iterate([1.0, 5.0], 2).points, abs=1e-7
    )


def test_scaled_parts_have_no_dimension() -> None:
    assert ScaledPendulum().parameters == {}
    assert not any(c.unit for c in ScaledPendulum().coordinates[1:])
