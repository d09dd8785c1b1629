"""Effective potentials against closed formulas, quadrature and multipliers of fast drives."""

from __future__ import annotations

from collections.abc import Callable
from math import acos, cos, pi, sin, sqrt
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

from cellmap import ForcedSystem, angle
from systems import (
    ACCELERATION,
    ANGULAR_ACCELERATION,
    ConstantTorque,
    Effect,
    Gravity,
    HarmonicDrive,
    HorizontalDrive,
    Pendulum,
    QuadraticDrag,
    RotatingDrive,
    SquareDrive,
    Terms,
    TiltedDrive,
    TorqueDrive,
    TriangleDrive,
    VerticalDrive,
    ViscousDamping,
    compound_pendulum,
    double_pendulum,
    drive_units,
    driven_pendulum,
    effective_potential,
    find_well,
    quantity,
    sampled_drive,
    scene,
    slow_equilibrium,
    stick_slip_oscillator,
)

G, L, W = 9.8, 0.0272, 2.0 * pi * 50.0
ANGLES = np.linspace(-4.0, 4.0, 101)


@pytest.mark.parametrize(("amplitude", "critical"), [(0.003, 0.927068123), (0.004, 1.226427972)])
def test_kapitza(amplitude: float, critical: float) -> None:
    """V_eff/(m l^2) = -(g/l) cos theta + (A w sin theta)^2/(4 l^2), and cos theta_c = -2 g l/(A w)^2."""
    potential = effective_potential(driven_pendulum(amplitude=amplitude))
    speed = amplitude * W
    expected = -G / L * np.cos(ANGLES) + (speed * np.sin(ANGLES)) ** 2 / (4.0 * L * L)
    assert potential(ANGLES) / L**2 == pytest.approx(expected, rel=1e-13, abs=1e-10)
    slope = G / L * np.sin(ANGLES) + speed**2 * np.sin(2.0 * ANGLES) / (4.0 * L * L)
    assert potential.gradient(ANGLES)[:, 0] / L**2 == pytest.approx(slope, rel=1e-12, abs=1e-10)
    well = find_well(potential)
    assert well.critical_angle == pytest.approx(critical, abs=5e-10)
    exact = acos(-2.0 * G * L / speed**2)
    assert (well.lower, well.upper) == pytest.approx((exact, 2.0 * pi - exact), abs=1e-12)
    depth = -G * L * cos(exact) + (speed * sin(exact)) ** 2 / 4.0 - G * L
    assert well.depths == pytest.approx((depth, depth), rel=1e-11)
    assert well.frequency == pytest.approx(sqrt(speed**2 / (2.0 * L * L) - G / L) / (2.0 * pi), rel=1e-11)


def test_kapitzas_frequency_is_published() -> None:
    """REFERENCES.md, the report's pendulum."""
    assert find_well(effective_potential(driven_pendulum())).frequency == pytest.approx(2.465691357, abs=5e-10)


SPEED = 0.003 * W
DRIVES: dict[str, tuple[Effect, Callable[[Any], Any]]] = {
    "vertical": (VerticalDrive(0.003, 50.0, phase=0.7), lambda q: (SPEED * np.sin(q)) ** 2 / 4.0),
    "horizontal": (HorizontalDrive(0.003, 50.0), lambda q: (SPEED * np.cos(q)) ** 2 / 4.0),
    "tilted": (TiltedDrive(0.003, 50.0, tilt=0.4), lambda q: (SPEED * np.sin(q + 0.4)) ** 2 / 4.0),
    "circle": (RotatingDrive(0.003, 0.003, 50.0), lambda q: SPEED**2 / 4.0 + 0.0 * q),
    "ellipse": (
        RotatingDrive(0.003, -0.001, 50.0),
        lambda q: W**2 * ((0.003 * np.sin(q)) ** 2 + (0.001 * np.cos(q)) ** 2) / 4.0,
    ),
    "torque": (TorqueDrive(500.0, 50.0), lambda q: (L * 500.0 / W) ** 2 / 4.0 + 0.0 * q),
    "harmonics": (
        HarmonicDrive((0.002, 0.001, 0.0005), (0.1, 0.2, 0.3), 50.0),
        lambda q: (0.002**2 + (2.0 * 0.001) ** 2 + (3.0 * 0.0005) ** 2) * (W * np.sin(q)) ** 2 / 4.0,
    ),
    "sixty harmonics": (
        HarmonicDrive((*[0.0] * 59, 5e-5), (0.0,) * 60, 50.0),
        lambda q: (60.0 * 5e-5 * W * np.sin(q)) ** 2 / 4.0,
    ),
    "none": (VerticalDrive(0.0, 50.0), lambda q: 0.0 * q),
}


@pytest.mark.parametrize("name", DRIVES)
def test_every_drive(name: str) -> None:
    """Half the mean square of the fast velocity, worked out by hand."""
    drive, kinetic = DRIVES[name]
    system = scene(Pendulum(L), Gravity(G), drive, ViscousDamping(10.0))
    expected = -G * L * np.cos(ANGLES) + kinetic(ANGLES)
    assert effective_potential(system)(ANGLES) == pytest.approx(expected, rel=1e-12, abs=1e-13)


def test_sharp_waves_that_are_just_smooth_enough() -> None:
    """A sharp square wave moves its pivot at up to a T/4, with a mean square of (a T)^2/48; corners take 1 % of it."""
    system = scene(Pendulum(L), Gravity(G), SquareDrive(300.0, 50.0, smoothing=0.005))
    lift = float(effective_potential(system)(pi / 2.0))
    assert 2.0 * lift == pytest.approx((300.0 * 0.02) ** 2 / 48.0, rel=0.01)


@pytest.mark.parametrize("kind", [SquareDrive, TriangleDrive])
def test_smooth_waves(kind: type[SquareDrive]) -> None:
    """The mean square of the pivot's velocity by quadrature; a wave of cosines rests at its tops."""
    system = scene(Pendulum(L), Gravity(G), kind(300.0, 50.0, smoothing=0.1))

    def velocity(t: float) -> float:
        return quad(lambda u: -L * system.derivative(u, (pi / 2.0, 0.0))[1] - G, 0.0, t, epsabs=1e-12)[0]

    square = quad(lambda t: velocity(t) ** 2, 0.0, 0.005, epsabs=1e-12)[0] / 0.005
    expected = -G * L * np.cos(ANGLES) + square * np.sin(ANGLES) ** 2 / 2.0
    assert effective_potential(system)(ANGLES) == pytest.approx(expected, rel=1e-10, abs=1e-12)


def test_a_sampled_drive() -> None:
    """An accelerometer's record of one cosine is the vertical drive."""
    times = np.arange(32) / 32
    drive = sampled_drive((-0.003 * W * W * np.cos(2.0 * pi * times)).tolist(), 50.0)
    sampled = effective_potential(scene(Pendulum(L), Gravity(G), drive))
    assert sampled(ANGLES) == pytest.approx(effective_potential(driven_pendulum())(ANGLES), rel=1e-12)


def test_a_compound_pendulum() -> None:
    """In J: mass distance g cos theta, and (mass distance A w sin theta)^2/(4 inertia)."""
    moment, inertia = 0.004 * 0.05175, 1.4283e-5
    expected = -moment * G * np.cos(ANGLES) + (moment * SPEED * np.sin(ANGLES)) ** 2 / (4.0 * inertia)
    assert effective_potential(compound_pendulum())(ANGLES) == pytest.approx(expected, rel=1e-12)


def test_units() -> None:
    """Energies are measured in l^2 w^2, and angles are the same."""
    effects = Gravity(G), VerticalDrive(0.003, 50.0), ViscousDamping(10.0)
    scaled = effective_potential(scene(Pendulum(L), *effects, units=drive_units(L, 50.0)))
    plain = effective_potential(scene(Pendulum(L), *effects))
    assert scaled(ANGLES) * (L * W) ** 2 == pytest.approx(plain(ANGLES), rel=1e-12, abs=1e-14)
    assert find_well(scaled).critical_angle == pytest.approx(find_well(plain).critical_angle, abs=1e-12)


class _Pushed(Effect):
    """A drive with a mean: its weight is no steady effect, so the energy does not hold it."""

    strength: float = quantity(ACCELERATION)

    @property
    def terms(self) -> Terms:
        return Terms(vertical=_push, period=_one_second)

    @property
    def vanishes(self) -> bool:
        return False


def _push(t: float, p: Any) -> float:
    return 3.0 + cos(2.0 * pi * t)


def _one_second(p: Any) -> float:
    return 1.0


class _Cogging(Effect):
    """Stores energy, of which it does not tell."""

    strength: float = quantity(ANGULAR_ACCELERATION)

    @property
    def terms(self) -> Terms:
        return Terms(joint=_cog)

    @property
    def vanishes(self) -> bool:
        return False


def _cog(t: float, angle: float, rate: float, p: Any) -> float:
    return -5.0 * sin(4.0 * angle)


def _bent(t: float, x: Any, p: Any) -> tuple[float, float]:
    return 0.5 * x[1] ** 2, abs(x[0])


@pytest.mark.parametrize(
    ("system", "error", "message"),
    [
        ("pendulum", TypeError, "give a ForcedSystem"),
        (driven_pendulum(friction=1.0), TypeError, "leave out dry friction and drag, and smooth its waves"),
        (
            scene(Pendulum(L), QuadraticDrag(0.1), VerticalDrive(0.003, 50.0)),
            TypeError,
            "right-hand side is discontinuous",
        ),
        (scene(Pendulum(L), Gravity(G), SquareDrive(300.0, 50.0)), TypeError, "smooth its waves"),
        (stick_slip_oscillator(), TypeError, "discontinuous"),
        (ForcedSystem(lambda t, x, p: (x[1], -x[0]), {}, 1.0, ("q", "v")), ValueError, "give a scene"),
        (
            ForcedSystem(lambda t, x, p: (-x[0], x[1]), {}, 1.0, ("q", "v"), outputs={"energy": _bent}),
            ValueError,
            "with the angles and angular velocities of joints",
        ),
        (
            ForcedSystem(lambda t, x, p: (x[1], -1.0), {}, 1.0, (angle("q"), "v"), outputs={"energy": _bent}),
            TypeError,
            "not analytic",
        ),
        (scene(Pendulum(L), Gravity(G), _Pushed()), ValueError, "a drive without a mean"),
        (scene(Pendulum(L), Gravity(G), _Cogging(), VerticalDrive(0.003, 50.0)), ValueError, "the term `stored`"),
        (
            scene(Pendulum(L), Gravity(G), SquareDrive(300.0, 50.0, smoothing=1e-4)),
            ValueError,
            "give its waves more smoothing",
        ),
    ],
)
def test_bad_systems_are_refused(system: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        effective_potential(system)


def test_bad_angles_are_refused() -> None:
    single, double = effective_potential(driven_pendulum()), effective_potential(double_pendulum())
    with pytest.raises(ValueError, match="give 2, one array for each joint, and not 1"):
        double(0.0)
    with pytest.raises(ValueError, match="give finite numbers"):
        single([0.0, np.nan])
    with pytest.raises(TypeError, match="give real numbers"):
        single("up")
    with pytest.raises(ValueError, match="give one of a single joint"):
        find_well(double)
    with pytest.raises(TypeError, match="give an EffectivePotential"):
        find_well(driven_pendulum())  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="does not swing in every direction"):
        _ = slow_equilibrium(effective_potential(driven_pendulum(amplitude=0.002)), pi).frequencies
    with pytest.raises(ValueError, match="begin nearer to one"):
        slow_equilibrium(effective_potential(scene(Pendulum(L), VerticalDrive(0.0, 50.0), ConstantTorque(1.0))), 0.0)
