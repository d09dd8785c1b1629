"""Effective potentials and their wells against closed formulas, quadrature and multipliers of fast drives; releases."""

from collections.abc import Callable
from math import acos, asin, cos, inf, pi, sin, sqrt
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad, quad_vec

import systems
from cellmap import ForcedSystem
from cellmap.bifurcations import floquet_multipliers
from cellmap.orbits import Kind

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


def test_a_compound_pendulum() -> None:
    """In J: mass distance g cos theta, and (mass distance A w sin theta)^2/(4 inertia)."""
    moment, inertia = 0.004 * 0.05175, 1.4283e-5
    expected = -moment * G * np.cos(ANGLES) + (moment * SPEED * np.sin(ANGLES)) ** 2 / (4.0 * inertia)
    assert systems.effective_potential(systems.compound_pendulum())(ANGLES) == pytest.approx(expected, rel=1e-12)


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
        pytest.param(systems.TiltedDrive(0.006, 50.0, tilt=0.3, phase=0.5), marks=pytest.mark.thorough),
        systems.RotatingDrive(0.006, 0.002, 50.0),
        pytest.param(systems.TorqueDrive(3000.0, 50.0), marks=pytest.mark.thorough),
        pytest.param(systems.HarmonicDrive((0.004, 0.002), (0.0, 1.0), 50.0), marks=pytest.mark.thorough),
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


def test_one_joint_against_multipliers_of_a_fast_drive() -> None:
    averaged = systems.find_well(systems.effective_potential(systems.driven_pendulum())).frequency
    frequencies = np.array([500.0, 5e3, 5e4])
    swept = {"frequency": frequencies, "amplitude": 0.15 / frequencies}
    found = floquet_multipliers(systems.driven_pendulum(damping=0.0), (pi, 0.0), swept, rtol=1e-13)
    errors = np.angle(found.multipliers[:, 0]) * frequencies / (2.0 * pi) / averaged - 1.0
    assert errors[:-1] / errors[1:] == pytest.approx([100.0, 100.0], rel=0.02)
    assert abs(errors[-1]) < 1e-8


def test_wells_that_are_not_symmetric() -> None:
    """A tilted drive moves the well, and one barrier is nearer: zeros of g sin q/l + (A w/l)^2 sin(2 (q + tilt))/4."""
    system = systems.scene(systems.Pendulum(L), systems.Gravity(G), systems.TiltedDrive(0.004, 50.0, tilt=0.2))
    well = systems.find_well(systems.effective_potential(system))
    fast = (0.004 * W) ** 2
    for place in (well.angle, well.lower, well.upper):
        assert G * L * sin(place) + fast * sin(2.0 * (place + 0.2)) / 4.0 == pytest.approx(0.0, abs=1e-13)
    assert well.depths[0] != pytest.approx(well.depths[1], rel=0.1)
    assert well.critical_angle == min(well.angle - well.lower, well.upper - well.angle)


def test_a_steady_torque_tilts_the_potential() -> None:
    """Per mass it adds -torque l^2 theta, and the hanging well moves to sin theta = torque l/g."""
    pushed = systems.scene(
        systems.Pendulum(L), systems.Gravity(G), systems.ConstantTorque(100.0), systems.VerticalDrive(0.0, 50.0)
    )
    potential = systems.effective_potential(pushed)
    assert potential(ANGLES) == pytest.approx(-G * L * np.cos(ANGLES) - 100.0 * L * L * ANGLES, rel=1e-11, abs=1e-12)
    well = systems.find_well(potential, near=0.0)
    tilted = asin(100.0 * L / G)
    assert (well.angle, well.upper) == pytest.approx((tilted, pi - tilted), abs=1e-12)
    chain = systems.effective_potential(
        systems.scene(
            systems.Chain((0.1, 0.1), (2.0, 1.0)),
            systems.Gravity(G),
            systems.ConstantTorque(5.0),
            systems.VerticalDrive(0.003, 50.0),
        )
    )
    assert chain.torque == pytest.approx([2.0 * 0.01 * 5.0, 0.0], rel=1e-10, abs=1e-12)


def test_a_spring_has_a_well_without_barriers() -> None:
    sprung = systems.scene(
        systems.Pendulum(L), systems.TorsionSpring(500.0, rest=0.3), systems.VerticalDrive(0.0, 50.0)
    )
    potential = systems.effective_potential(sprung)
    assert potential(ANGLES) == pytest.approx(250.0 * L * L * (ANGLES - 0.3) ** 2, rel=1e-12)
    well = systems.find_well(potential, near=0.0)
    assert (well.lower, well.upper, well.depths) == (-inf, inf, (inf, inf))
    assert (well.angle, well.frequency) == pytest.approx((0.3, sqrt(500.0) / (2.0 * pi)), rel=1e-11)


def test_wells_just_born() -> None:
    """A part in a million above sqrt(2 g l)/w barriers are 1.4 mrad away; below it there is no well."""
    least = sqrt(2.0 * G * L) / W
    above = systems.find_well(systems.effective_potential(systems.driven_pendulum(amplitude=least * (1.0 + 1e-6))))
    assert above.critical_angle == pytest.approx(acos((1.0 + 1e-6) ** -2), rel=1e-7)
    with pytest.raises(ValueError, match="no well"):
        systems.find_well(systems.effective_potential(systems.driven_pendulum(amplitude=least * (1.0 - 1e-6))))


@pytest.mark.thorough
def test_release_limits_are_those_of_plain_integration(scipy_images: Callable[..., Any]) -> None:
    system = systems.driven_pendulum()
    limits = systems.release_limits(system, phases=[0.25, 0.6], angles=64, tolerance=1e-9)
    assert limits.lower == pytest.approx(limits.upper, abs=1e-8)
    assert limits.error.tolist() == [1e-9, 1e-9]
    assert cos(limits.attractor.points[0, 0]) == pytest.approx(-1.0)
    for phase, limit in zip(limits.phases, limits.upper, strict=True):
        initial_conditions = [(pi + limit - 1e-6, 0.0), (pi + limit + 1e-6, 0.0)]
        back, gone = scipy_images(system, initial_conditions, phase, 100.0, rtol=1e-9)
        assert abs(back[0] - pi) < 1e-2
        assert abs(gone[0] - pi) > 1.0


@pytest.mark.thorough
def test_release_limits_with_dry_friction() -> None:
    """All of the sticking set (REFERENCES.md) comes back, and the stick-slip cycle beyond it does not."""
    limits = systems.release_limits(systems.driven_pendulum(damping=0.0, friction=10.0), angles=32)
    assert 0.000889213 < limits.upper[0] < 0.00182768
    assert limits.attractor.kind == Kind.EQUILIBRIA
