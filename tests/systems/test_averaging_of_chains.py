"""Effective potentials of pendulums with several joints."""

from __future__ import annotations

from math import pi, sqrt

import numpy as np
import pytest
from scipy.integrate import quad_vec

import systems
from cellmap import ForcedSystem
from cellmap.bifurcations import floquet_multipliers

G, L, W = 9.8, 0.0272, 2.0 * pi * 50.0
ANGLES = np.linspace(-4.0, 4.0, 101)
INVERTED = (pi, 0.0)


def _double_by_hand(system: ForcedSystem, angles: tuple[float, float]) -> float:
    """-g sum mu_i l_i cos theta_i + <xi' M xi'>/2, with xi' from plain accelerations by quadrature."""
    p = system.parameters
    lengths, mu = np.array([p.length_1, p.length_2]), np.array([p.mass_1 + p.mass_2, p.mass_2])
    across = np.array([[mu[0], mu[1]], [mu[1], mu[1]]]) * np.outer(lengths, lengths)
    mass = across * np.cos(np.subtract.outer(angles, angles))
    period = system.length

    def acceleration(t: float) -> np.ndarray:
        return np.array(system.derivative(t, (*angles, 0.0, 0.0))[2:])

    mean = quad_vec(acceleration, 0.0, period)[0] / period
    # Integrating by parts, the velocity of zero mean is the mean of t times the acceleration to come.
    nodes, weights = np.polynomial.legendre.leggauss(40)
    nodes, weights = 0.5 * (nodes + 1.0), 0.5 * weights
    forward = np.array([acceleration(period * u) - mean for u in nodes])

    def velocity(v: float) -> np.ndarray:
        to_v = np.array([acceleration(period * u * v) - mean for u in nodes])
        return period * (v * weights @ to_v + (weights * nodes) @ forward)

    kinetic = sum(w * velocity(v) @ mass @ velocity(v) for v, w in zip(nodes, weights, strict=True)) / 2.0
    return float(kinetic - p.gravity * (mu * lengths) @ np.cos(angles))


@pytest.mark.parametrize(
    "drive",
    [
        systems.VerticalDrive(0.006, 50.0),
        systems.TiltedDrive(0.006, 50.0, tilt=0.3, phase=0.5),
        systems.RotatingDrive(0.006, 0.002, 50.0),
        systems.TorqueDrive(3000.0, 50.0),
        systems.HarmonicDrive((0.004, 0.002), (0.0, 1.0), 50.0),
    ],
    ids=lambda d: type(d).__name__,
)
def test_two_joints(drive: systems.Effect) -> None:
    system = systems.scene(
        systems.Chain((0.032, 0.04), (1.0, 0.25)), systems.Gravity(G), drive, systems.ViscousDamping(10.0)
    )
    potential = systems.effective_potential(system)
    for angles in ((0.3, -1.2), (2.0, 0.5), (3.0, 3.1)):
        assert float(potential(*angles)) == pytest.approx(_double_by_hand(system, angles), rel=1e-11)
    grid = potential(ANGLES[:, None], ANGLES[None, :7])
    assert grid.shape == (101, 7)
    assert grid[13, 5] == pytest.approx(float(potential(ANGLES[13], ANGLES[5])), rel=1e-14)


@pytest.mark.parametrize("down", [(True, True), (True, False), (False, True), (False, False)])
def test_slow_modes_of_the_double_pendulum(down: tuple[bool, bool]) -> None:
    """A mode of eigenvalue lambda swings as a pendulum of length 1/abs(lambda): g lambda + (A w lambda)^2/2."""
    place = [0.0 if d else pi for d in down]
    r = 1.25
    mean, spread = (r, sqrt(r * r - r)) if down[0] == down[1] else (0.0, sqrt(r))
    sign = -1.0 if down == (False, False) else 1.0
    eigenvalues = sign * np.array([mean - spread, mean + spread]) / 0.032
    rest = systems.slow_equilibrium(systems.effective_potential(systems.double_pendulum()), place)
    expected = G * eigenvalues + (0.006 * W * eigenvalues) ** 2 / 2.0
    assert rest.squares == pytest.approx(np.sort(expected), rel=1e-10)
    assert rest.stable
    assert rest.frequencies == pytest.approx(np.sqrt(np.sort(expected)) / (2.0 * pi), rel=1e-10)


@pytest.mark.thorough
def test_slow_modes_of_three_links_against_multipliers_of_a_fast_drive() -> None:
    """At A w fixed the multipliers' frequencies tend to the averaged ones, with an error in proportion to 1/f^2."""
    system, upright = systems.triple_pendulum(damping=0.0, frequency=100.0, amplitude=0.004), (pi, pi, pi)
    averaged = systems.slow_equilibrium(systems.effective_potential(system), upright).frequencies
    frequencies = np.array([1e3, 2e3, 1e4, 2e4])
    swept = {"frequency": frequencies, "amplitude": 0.4 / frequencies}
    found = floquet_multipliers(system, (*upright, 0.0, 0.0, 0.0), swept, rtol=1e-13)
    slow = np.sort(np.angle(found.multipliers), axis=-1)[:, 3:] * frequencies[:, None] / (2.0 * pi)
    errors = np.abs(slow / averaged - 1.0)
    assert errors[0] / errors[1] == pytest.approx([4.0] * 3, rel=0.1)
    assert errors[2] / errors[3] == pytest.approx([4.0] * 3, rel=0.01)
    assert (4.0 * slow[3] - slow[2]) / 3.0 == pytest.approx(averaged, rel=1e-8)


def test_one_joint_against_multipliers_of_a_fast_drive() -> None:
    averaged = systems.find_well(systems.effective_potential(systems.driven_pendulum())).frequency
    frequencies = np.array([500.0, 5e3, 5e4])
    swept = {"frequency": frequencies, "amplitude": 0.15 / frequencies}
    found = floquet_multipliers(systems.driven_pendulum(damping=0.0), INVERTED, swept, rtol=1e-13)
    errors = np.angle(found.multipliers[:, 0]) * frequencies / (2.0 * pi) / averaged - 1.0
    assert errors[:-1] / errors[1:] == pytest.approx([100.0, 100.0], rel=0.02)
    assert abs(errors[-1]) < 1e-8
