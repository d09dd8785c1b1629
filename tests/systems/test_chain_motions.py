"""Motions of chains of pendulums: small ones, periods, limits of masses, energy, damping and friction."""

from itertools import product
from math import pi

import numpy as np
import pytest
from chain_equations import LINKS, MASSES, dense, relative
from scipy.integrate import solve_ivp

import systems
from cellmap import stroboscopic_map
from cellmap._compiled.codegen.rebind import rebind

W = 2.0 * pi * 50.0


def test_the_double_pendulum_after_one_period() -> None:
    strobe = stroboscopic_map(systems.double_pendulum(damping=0.0), rtol=1e-12, atol=1e-12)
    scale = np.array([1.0, 1.0, W, W])
    expected = (2.039335961693, 0.736205328087, 0.119529455898, 0.271635760474)
    assert strobe(np.array([1.0, -0.5, 0.2, 0.1]) * scale) / scale == pytest.approx(expected, abs=1e-11)


def test_a_light_outer_mass_leaves_the_single_pendulum() -> None:
    """Mass ratio 1e-6: REFERENCES.md has a difference of 5.7e-7 in units of the drive."""
    strobe = stroboscopic_map(systems.double_pendulum(mass_2=1e-6, damping=0.0), rtol=1e-12, atol=1e-12)
    single = stroboscopic_map(systems.driven_pendulum(0.032, 0.006, 50.0, 0.0), rtol=1e-12, atol=1e-12)
    image = strobe(np.array([1.0, -0.5, 0.2 * W, 0.1 * W]))[[0, 2]] / [1.0, W]
    difference = np.abs(image - single([1.0, 0.2 * W]) / [1.0, W]).max()
    assert difference == pytest.approx(5.7e-7, abs=5e-9)


@pytest.mark.parametrize("ratio", [1e-9, 1e9])
def test_extreme_masses_keep_their_digits(ratio: float) -> None:
    """The elimination from the tip subtracts nothing that is nearly equal."""
    import mpmath

    system = systems.double_pendulum(mass_1=1.0, mass_2=ratio)
    x = (1.0, -0.5, 60.0, 30.0)
    with mpmath.workdps(40):
        rhs = rebind(system.rhs, {"sin": mpmath.sin, "cos": mpmath.cos})
        exact = rhs(mpmath.mpf(0), tuple(map(mpmath.mpf, x)), system.parameters)
        assert system.derivative(0.0, x) == pytest.approx([float(v) for v in exact], rel=1e-14)


def test_energy_is_kept_by_what_keeps_it() -> None:
    """Gravity and springs, no drive and no friction."""
    for effects in ((systems.Gravity(9.8), systems.TorsionSpring(30.0, 0.4)), ()):
        system = systems.scene(systems.Chain(LINKS[:4], MASSES[:4]), *effects, period=1.0)
        ic = np.array([1.0, -2.0, 0.5, 3.0, 4.0, -2.0, 0.0, 1.0])
        solution = solve_ivp(system.fun, (0.0, 1.0), ic, method="DOP853", rtol=1e-12, atol=1e-12)
        energies = system.output("energy", solution.t, solution.y.T)
        assert not effects or np.ptp(energies[:, 0]) > 1e-3
        assert energies.sum(axis=-1) == pytest.approx(energies[0].sum(), rel=1e-9)


def test_viscous_damping_takes_what_the_joints_take() -> None:
    """d(energy)/dt = -gamma m_1 l_1^2 (sum of the squares of relative rates)."""
    system = systems.chain_pendulum(LINKS[:3], MASSES[:3], amplitude=0.0, damping=3.0)
    x = np.array([0.4, 2.0, -1.0, 3.0, -1.0, 2.0])
    derivative = system.fun(0.0, x)
    h = 1e-6
    slope = (system.output("energy", 0.0, x + h * derivative) - system.output("energy", 0.0, x - h * derivative)).sum()
    lost = 3.0 * MASSES[0] * LINKS[0] ** 2 * (relative(x[3:]) ** 2).sum()
    assert slope / (2.0 * h) == pytest.approx(-lost, rel=1e-7)


def test_dry_friction_acts_on_relative_rates() -> None:
    system = systems.double_pendulum(friction=2.5, damping=0.0, amplitude=0.0)
    x = (0.3, 0.2, 3.0, 1.0)
    assert system.switches is not None
    assert system.switches(0.0, x, system.parameters) == (3.0, -2.0)
    assert system.signs(0.0, (0.3, 0.2, 3.0, 3.0)) == (1.0, 0.0)
    free = systems.double_pendulum(damping=0.0, amplitude=0.0)
    for signs in product((-1.0, 0.0, 0.4, 1.0), repeat=2):
        joints = -2.5 * np.array(signs)
        expected = dense(free, 2, 9.8, 0.0, joints, np.array(x))
        assert system.derivative(0.0, x, signs)[2:] == pytest.approx(expected, rel=1e-13)
    corners = [np.array(system.derivative(0.0, x, s)) for s in ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0))]
    assert corners[0] + corners[3] == pytest.approx(corners[1] + corners[2], rel=1e-13)  # affine: no product of signs
