"""Effective potentials against closed formulas, quadrature and multipliers of fast drives."""

from __future__ import annotations

from collections.abc import Callable
from math import acos, cos, pi, sin, sqrt
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

import systems

G, L, W = 9.8, 0.0272, 2.0 * pi * 50.0
ANGLES = np.linspace(-4.0, 4.0, 101)


@pytest.mark.parametrize(("amplitude", "critical"), [(0.003, 0.927068123), (0.004, 1.226427972)])
def test_kapitza(amplitude: float, critical: float) -> None:
    """V_eff/(m l^2) = -(g/l) cos theta + (A w sin theta)^2/(4 l^2), and cos theta_c = -2 g l/(A w)^2."""
    potential = systems.effective_potential(systems.driven_pendulum(amplitude=amplitude))
    speed = amplitude * W
    expected = -G / L * np.cos(ANGLES) + (speed * np.sin(ANGLES)) ** 2 / (4.0 * L * L)
    assert potential(ANGLES) / L**2 == pytest.approx(expected, rel=1e-13, abs=1e-10)
    slope = G / L * np.sin(ANGLES) + speed**2 * np.sin(2.0 * ANGLES) / (4.0 * L * L)
    assert potential.gradient(ANGLES)[:, 0] / L**2 == pytest.approx(slope, rel=1e-12, abs=1e-10)
    well = systems.find_well(potential)
    assert well.critical_angle == pytest.approx(critical, abs=5e-10)
    exact = acos(-2.0 * G * L / speed**2)
    assert (well.lower, well.upper) == pytest.approx((exact, 2.0 * pi - exact), abs=1e-12)
    depth = -G * L * cos(exact) + (speed * sin(exact)) ** 2 / 4.0 - G * L
    assert well.depths == pytest.approx((depth, depth), rel=1e-11)
    assert well.frequency == pytest.approx(sqrt(speed**2 / (2.0 * L * L) - G / L) / (2.0 * pi), rel=1e-11)


SPEED = 0.003 * W
DRIVES: dict[str, tuple[systems.Effect, Callable[[Any], Any]]] = {
    "vertical": (systems.VerticalDrive(0.003, 50.0, phase=0.7), lambda q: (SPEED * np.sin(q)) ** 2 / 4.0),
    "horizontal": (systems.HorizontalDrive(0.003, 50.0), lambda q: (SPEED * np.cos(q)) ** 2 / 4.0),
    "tilted": (systems.TiltedDrive(0.003, 50.0, tilt=0.4), lambda q: (SPEED * np.sin(q + 0.4)) ** 2 / 4.0),
    "circle": (systems.RotatingDrive(0.003, 0.003, 50.0), lambda q: SPEED**2 / 4.0 + 0.0 * q),
    "ellipse": (
        systems.RotatingDrive(0.003, -0.001, 50.0),
        lambda q: W**2 * ((0.003 * np.sin(q)) ** 2 + (0.001 * np.cos(q)) ** 2) / 4.0,
    ),
    "torque": (systems.TorqueDrive(500.0, 50.0), lambda q: (L * 500.0 / W) ** 2 / 4.0 + 0.0 * q),
    "harmonics": (
        systems.HarmonicDrive((0.002, 0.001, 0.0005), (0.1, 0.2, 0.3), 50.0),
        lambda q: (0.002**2 + (2.0 * 0.001) ** 2 + (3.0 * 0.0005) ** 2) * (W * np.sin(q)) ** 2 / 4.0,
    ),
    "sixty harmonics": (
        systems.HarmonicDrive((*[0.0] * 59, 5e-5), (0.0,) * 60, 50.0),
        lambda q: (60.0 * 5e-5 * W * np.sin(q)) ** 2 / 4.0,
    ),
    "none": (systems.VerticalDrive(0.0, 50.0), lambda q: 0.0 * q),
}


@pytest.mark.parametrize("name", DRIVES)
def test_every_drive(name: str) -> None:
    """Half the mean square of the fast velocity, worked out by hand."""
    drive, kinetic = DRIVES[name]
    system = systems.scene(systems.Pendulum(L), systems.Gravity(G), drive, systems.ViscousDamping(10.0))
    expected = -G * L * np.cos(ANGLES) + kinetic(ANGLES)
    assert systems.effective_potential(system)(ANGLES) == pytest.approx(expected, rel=1e-12, abs=1e-13)


def test_sharp_waves_that_are_just_smooth_enough() -> None:
    """A sharp square wave moves its pivot at up to a T/4, with a mean square of (a T)^2/48; corners take 1 % of it."""
    system = systems.scene(systems.Pendulum(L), systems.Gravity(G), systems.SquareDrive(300.0, 50.0, smoothing=0.005))
    lift = float(systems.effective_potential(system)(pi / 2.0))
    assert 2.0 * lift == pytest.approx((300.0 * 0.02) ** 2 / 48.0, rel=0.01)


@pytest.mark.parametrize("kind", [systems.SquareDrive, systems.TriangleDrive])
def test_smooth_waves(kind: type[systems.SquareDrive]) -> None:
    """The mean square of the pivot's velocity by quadrature; a wave of cosines rests at its tops."""
    system = systems.scene(systems.Pendulum(L), systems.Gravity(G), kind(300.0, 50.0, smoothing=0.1))

    def velocity(t: float) -> float:
        return quad(lambda u: -L * system.derivative(u, (pi / 2.0, 0.0))[1] - G, 0.0, t, epsabs=1e-12)[0]

    square = quad(lambda t: velocity(t) ** 2, 0.0, 0.005, epsabs=1e-12)[0] / 0.005
    expected = -G * L * np.cos(ANGLES) + square * np.sin(ANGLES) ** 2 / 2.0
    assert systems.effective_potential(system)(ANGLES) == pytest.approx(expected, rel=1e-10, abs=1e-12)


def test_a_sampled_drive() -> None:
    """An accelerometer's record of one cosine is the vertical drive."""
    times = np.arange(32) / 32
    drive = systems.sampled_drive((-0.003 * W * W * np.cos(2.0 * pi * times)).tolist(), 50.0)
    sampled = systems.effective_potential(systems.scene(systems.Pendulum(L), systems.Gravity(G), drive))
    assert sampled(ANGLES) == pytest.approx(systems.effective_potential(systems.driven_pendulum())(ANGLES), rel=1e-12)


def test_a_compound_pendulum() -> None:
    """In J: mass distance g cos theta, and (mass distance A w sin theta)^2/(4 inertia)."""
    moment, inertia = 0.004 * 0.05175, 1.4283e-5
    expected = -moment * G * np.cos(ANGLES) + (moment * SPEED * np.sin(ANGLES)) ** 2 / (4.0 * inertia)
    assert systems.effective_potential(systems.compound_pendulum())(ANGLES) == pytest.approx(expected, rel=1e-12)


def test_units() -> None:
    """Energies are measured in l^2 w^2, and angles are the same."""
    effects = systems.Gravity(G), systems.VerticalDrive(0.003, 50.0), systems.ViscousDamping(10.0)
    scaled = systems.effective_potential(
        systems.scene(systems.Pendulum(L), *effects, units=systems.drive_units(L, 50.0))
    )
    plain = systems.effective_potential(systems.scene(systems.Pendulum(L), *effects))
    assert scaled(ANGLES) * (L * W) ** 2 == pytest.approx(plain(ANGLES), rel=1e-12, abs=1e-14)
    assert systems.find_well(scaled).critical_angle == pytest.approx(systems.find_well(plain).critical_angle, abs=1e-12)
