"""Chains of pendulums, against the Lagrangian, the mass-matrix form and the numbers of tests/REFERENCES.md."""

from math import cos, pi, sin

import numpy as np
import pytest
from chain_equations import LINKS, MASSES, dense, relative

import systems
from cellmap import ForcedSystem
from cellmap._compiled.codegen.kernel import traced_function
from cellmap._compiled.codegen.trace import STATEFUL


@pytest.mark.parametrize("links", [1, 2, 3, 5, 8])
def test_the_mass_matrix_form(links: int) -> None:
    """All effects at once: gravity, a drive in both directions, every kind of friction, springs, torque."""
    effects = (
        systems.Gravity(9.8),
        systems.RotatingDrive(0.004, 0.007, 3.0, 0.3),
        systems.ViscousDamping(1.5),
        systems.QuadraticDrag(0.2),
        systems.DryFriction(2.5),
        systems.TorsionSpring(6.0, 0.2),
        systems.ConstantTorque(1.1),
    )
    system = systems.scene(systems.Chain(LINKS[:links], MASSES[:links]), *effects)
    rng = np.random.default_rng(links)
    w = 6.0 * pi
    for t in (0.0, 0.1, 0.27):
        x = rng.uniform(-4.0, 4.0, 2 * links)
        s = rng.uniform(-1.0, 1.0, links)
        angle, rate = relative(x[:links]), relative(x[links:])
        joints = -1.5 * rate - 0.2 * rate**2 * s - 2.5 * s - 6.0 * (angle - 0.2)
        joints[0] += 1.1
        up = 9.8 - 0.004 * w * w * cos(w * t + 0.3)
        aside = 0.007 * w * w * sin(w * t + 0.3)
        expected = dense(system, links, up, aside, joints, x)
        seen = system.derivative(t, tuple(x), tuple(s))
        assert seen[:links] == tuple(x[links:])
        assert seen[links:] == pytest.approx(expected, rel=1e-11, abs=1e-11)


def operations(system: ForcedSystem) -> int:
    trace = traced_function(system.rhs, system.dimension, tuple(system.params))
    assert trace is not None
    return sum(1 for n, level in trace.levels().items() if n.arguments and level == STATEFUL)


def test_the_right_hand_side_grows_with_the_number_of_links() -> None:
    counts = [operations(systems.chain_pendulum(LINKS[:n], MASSES[:n])) for n in range(1, 9)]
    steps = np.diff(counts)[1:]
    assert (steps == steps[-1]).sum() >= 5
    assert counts[1] <= 45 and counts[7] <= 330
    assert operations(systems.double_pendulum(damping=0.0)) <= 35


def test_chains_of_as_many_links_share_their_right_hand_side() -> None:
    params = systems.double_pendulum(0.3, 0.2, 0.7, 0.4).params
    assert [params[name] for name in ("length_1", "length_2", "mass_1", "mass_2")] == [0.3, 0.2, 0.7, 0.4]
    assert systems.double_pendulum().rhs is systems.chain_pendulum((1.0, 2.0), (3.0, 4.0)).rhs
    assert systems.double_pendulum().rhs is not systems.triple_pendulum().rhs
    assert systems.double_pendulum(friction=0.0).switches is None
    assert (
        systems.double_pendulum(friction=1.0).rhs
        is systems.double_pendulum(friction=2.0).rhs
        is not systems.double_pendulum().rhs
    )


def test_places_of_the_masses() -> None:
    system = systems.triple_pendulum(1.0, 2.0, 3.0, amplitude=0.5, frequency=1.0)
    x = (pi / 2, 0.0, pi, 0.0, 0.0, 0.0)
    assert system.output("positions", 0.0, x) == pytest.approx([0.0, 0.5, 1.0, 0.5, 1.0, -1.5, 1.0, 1.5], abs=1e-15)
    assert system.output("positions", [0.25, 0.5], [x, x]).shape == (2, 8)
