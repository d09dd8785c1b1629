"""Effective potentials against closed formulas, quadrature, multipliers of fast drives and plain integration."""

from __future__ import annotations

from collections.abc import Callable
from math import acos, asin, cos, inf, pi, sin, sqrt
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad, quad_vec

from cellmap import ForcedSystem, angle
from cellmap.bifurcations import floquet_multipliers
from cellmap.orbits import Kind
from systems import (
    ACCELERATION,
    ANGULAR_ACCELERATION,
    Chain,
    ConstantTorque,
    Effect,
    Gravity,
    HarmonicDrive,
    HorizontalDrive,
    IslandWarning,
    Pendulum,
    QuadraticDrag,
    RotatingDrive,
    SquareDrive,
    Terms,
    TiltedDrive,
    TorqueDrive,
    TorsionSpring,
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
    release_limits,
    sampled_drive,
    scene,
    slow_equilibrium,
    stick_slip_oscillator,
    triple_pendulum,
)

G, L, W = 9.8, 0.0272, 2.0 * pi * 50.0
ANGLES = np.linspace(-4.0, 4.0, 101)
INVERTED = (pi, 0.0)


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
        VerticalDrive(0.006, 50.0),
        TiltedDrive(0.006, 50.0, tilt=0.3, phase=0.5),
        RotatingDrive(0.006, 0.002, 50.0),
        TorqueDrive(3000.0, 50.0),
        HarmonicDrive((0.004, 0.002), (0.0, 1.0), 50.0),
    ],
    ids=lambda d: type(d).__name__,
)
def test_two_joints(drive: Effect) -> None:
    system = scene(Chain((0.032, 0.04), (1.0, 0.25)), Gravity(G), drive, ViscousDamping(10.0))
    potential = effective_potential(system)
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
    rest = slow_equilibrium(effective_potential(double_pendulum()), place)
    expected = G * eigenvalues + (0.006 * W * eigenvalues) ** 2 / 2.0
    assert rest.squares == pytest.approx(np.sort(expected), rel=1e-10)
    assert rest.stable
    assert rest.frequencies == pytest.approx(np.sqrt(np.sort(expected)) / (2.0 * pi), rel=1e-10)


def test_slow_modes_of_three_links_against_multipliers_of_a_fast_drive() -> None:
    """At A w fixed the multipliers' frequencies tend to the averaged ones, with an error in proportion to 1/f^2."""
    system, upright = triple_pendulum(damping=0.0, frequency=100.0, amplitude=0.004), (pi, pi, pi)
    averaged = slow_equilibrium(effective_potential(system), upright).frequencies
    frequencies = np.array([1e3, 2e3, 1e4, 2e4])
    swept = {"frequency": frequencies, "amplitude": 0.4 / frequencies}
    found = floquet_multipliers(system, (*upright, 0.0, 0.0, 0.0), swept, rtol=1e-13)
    slow = np.sort(np.angle(found.multipliers), axis=-1)[:, 3:] * frequencies[:, None] / (2.0 * pi)
    errors = np.abs(slow / averaged - 1.0)
    assert errors[0] / errors[1] == pytest.approx([4.0] * 3, rel=0.1)
    assert errors[2] / errors[3] == pytest.approx([4.0] * 3, rel=0.01)
    assert (4.0 * slow[3] - slow[2]) / 3.0 == pytest.approx(averaged, rel=1e-8)


def test_one_joint_against_multipliers_of_a_fast_drive() -> None:
    averaged = find_well(effective_potential(driven_pendulum())).frequency
    frequencies = np.array([500.0, 5e3, 5e4])
    swept = {"frequency": frequencies, "amplitude": 0.15 / frequencies}
    found = floquet_multipliers(driven_pendulum(damping=0.0), INVERTED, swept, rtol=1e-13)
    errors = np.angle(found.multipliers[:, 0]) * frequencies / (2.0 * pi) / averaged - 1.0
    assert errors[:-1] / errors[1:] == pytest.approx([100.0, 100.0], rel=0.02)
    assert abs(errors[-1]) < 1e-8


def test_wells_that_are_not_symmetric() -> None:
    """A tilted drive moves the well, and one barrier is nearer: zeros of g sin q/l + (A w/l)^2 sin(2 (q + tilt))/4."""
    system = scene(Pendulum(L), Gravity(G), TiltedDrive(0.004, 50.0, tilt=0.2))
    well = find_well(effective_potential(system))
    fast = (0.004 * W) ** 2
    for place in (well.angle, well.lower, well.upper):
        assert G * L * sin(place) + fast * sin(2.0 * (place + 0.2)) / 4.0 == pytest.approx(0.0, abs=1e-13)
    assert well.depths[0] != pytest.approx(well.depths[1], rel=0.1)
    assert well.critical_angle == min(well.angle - well.lower, well.upper - well.angle)


def test_a_steady_torque_tilts_the_potential() -> None:
    """Per mass it adds -torque l^2 theta, and the hanging well moves to sin theta = torque l/g."""
    pushed = scene(Pendulum(L), Gravity(G), ConstantTorque(100.0), VerticalDrive(0.0, 50.0))
    potential = effective_potential(pushed)
    assert potential(ANGLES) == pytest.approx(-G * L * np.cos(ANGLES) - 100.0 * L * L * ANGLES, rel=1e-11, abs=1e-12)
    well = find_well(potential, near=0.0)
    tilted = asin(100.0 * L / G)
    assert (well.angle, well.upper) == pytest.approx((tilted, pi - tilted), abs=1e-12)
    chain = effective_potential(
        scene(Chain((0.1, 0.1), (2.0, 1.0)), Gravity(G), ConstantTorque(5.0), VerticalDrive(0.003, 50.0))
    )
    assert chain.torque == pytest.approx([2.0 * 0.01 * 5.0, 0.0], rel=1e-10, abs=1e-12)


def test_a_spring_has_a_well_without_barriers() -> None:
    sprung = scene(Pendulum(L), TorsionSpring(500.0, rest=0.3), VerticalDrive(0.0, 50.0))
    potential = effective_potential(sprung)
    assert potential(ANGLES) == pytest.approx(250.0 * L * L * (ANGLES - 0.3) ** 2, rel=1e-12)
    well = find_well(potential, near=0.0)
    assert (well.lower, well.upper, well.depths) == (-inf, inf, (inf, inf))
    assert (well.angle, well.frequency) == pytest.approx((0.3, sqrt(500.0) / (2.0 * pi)), rel=1e-11)


def test_wells_just_born() -> None:
    """A part in a million above sqrt(2 g l)/w barriers are 1.4 mrad away; below it there is no well."""
    least = sqrt(2.0 * G * L) / W
    above = find_well(effective_potential(driven_pendulum(amplitude=least * (1.0 + 1e-6))))
    assert above.critical_angle == pytest.approx(acos((1.0 + 1e-6) ** -2), rel=1e-7)
    with pytest.raises(ValueError, match="no well"):
        find_well(effective_potential(driven_pendulum(amplitude=least * (1.0 - 1e-6))))


def test_release_limits_are_those_of_plain_integration(scipy_images: Callable[..., Any]) -> None:
    system = driven_pendulum()
    limits = release_limits(system, phases=[0.25, 0.6], angles=64, tolerance=1e-9)
    assert limits.lower == pytest.approx(limits.upper, abs=1e-8)
    assert limits.error.tolist() == [1e-9, 1e-9]
    assert cos(limits.attractor.points[0, 0]) == pytest.approx(-1.0)
    for phase, limit in zip(limits.phases, limits.upper, strict=True):
        initial_conditions = [(pi + limit - 1e-6, 0.0), (pi + limit + 1e-6, 0.0)]
        back, gone = scipy_images(system, initial_conditions, phase, 100.0, rtol=1e-9)
        assert abs(back[0] - pi) < 1e-2
        assert abs(gone[0] - pi) > 1.0


def test_release_limits_at_ten_millimetres_hold_what_finer_scans_find() -> None:
    """Plain scans give 1.6723 and 0.9457 (256 angles), 1.6597 and 0.9235 (2,048), 1.6596 and 0.8990 (16,384)."""
    system = driven_pendulum(amplitude=0.010)
    with pytest.warns(IslandWarning, match="angles=256: islands of other basins"):
        limits = release_limits(system, phases=[0.0, 0.5], angles=256, tolerance=1e-5)
    for known in ([1.6597, 0.9235], [1.6596, 0.8990]):
        assert (limits.upper - limits.error < known).all()
    assert (limits.upper < [1.6600, 0.9240]).all()
    assert (limits.error < 0.1).all()


@pytest.mark.slow
def test_release_limits_with_dry_friction() -> None:
    """All of the sticking set (REFERENCES.md) comes back, and the stick-slip cycle beyond it does not."""
    limits = release_limits(driven_pendulum(damping=0.0, friction=10.0), angles=32)
    assert 0.000889213 < limits.upper[0] < 0.00182768
    assert limits.attractor.kind == Kind.EQUILIBRIA


def test_release_limits_of_a_deep_well_are_all_angles() -> None:
    """Without the drive every release ends hanging, except one from exactly upright."""
    still = scene(Pendulum(L), Gravity(G), VerticalDrive(0.0, 50.0), ViscousDamping(20.0))
    limits = release_limits(still, near=0.0, angles=16, tolerance=1e-9)
    assert limits.upper == pytest.approx([pi], abs=1e-8)
    assert "1 phases, from 3.14159 to 3.14159 rad" in repr(limits)


def test_release_limits_of_unstable_states_are_refused() -> None:
    with pytest.raises(ValueError, match="ends on no attractor"):
        release_limits(driven_pendulum(damping=0.0), angles=4, max_periods=10)
    with pytest.raises(ValueError, match="give a pendulum of one joint"):
        release_limits(double_pendulum())
    with pytest.raises(TypeError, match="give a ForcedSystem"):
        release_limits("pendulum")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="phases=nan: give a finite number"):
        release_limits(driven_pendulum(), phases=[np.nan])


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
