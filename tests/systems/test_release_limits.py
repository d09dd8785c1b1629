"""Wells of effective potentials, and the angles from which a released pendulum returns."""

from __future__ import annotations

from collections.abc import Callable
from math import acos, asin, cos, inf, pi, sin, sqrt
from typing import Any

import numpy as np
import pytest

import systems
from cellmap.orbits import Kind

G, L, W = 9.8, 0.0272, 2.0 * pi * 50.0
ANGLES = np.linspace(-4.0, 4.0, 101)


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


def test_release_limits_at_ten_millimetres_hold_what_finer_scans_find() -> None:
    """Plain scans give 1.6723 and 0.9457 (256 angles), 1.6597 and 0.9235 (2,048), 1.6596 and 0.8990 (16,384)."""
    system = systems.driven_pendulum(amplitude=0.010)
    with pytest.warns(systems.IslandWarning, match="angles=256: islands of other basins"):
        limits = systems.release_limits(system, phases=[0.0, 0.5], angles=256, tolerance=1e-5)
    for known in ([1.6597, 0.9235], [1.6596, 0.8990]):
        assert (limits.upper - limits.error < known).all()
    assert (limits.upper < [1.6600, 0.9240]).all()
    assert (limits.error < 0.1).all()


@pytest.mark.thorough
def test_release_limits_with_dry_friction() -> None:
    """All of the sticking set (REFERENCES.md) comes back, and the stick-slip cycle beyond it does not."""
    limits = systems.release_limits(systems.driven_pendulum(damping=0.0, friction=10.0), angles=32)
    assert 0.000889213 < limits.upper[0] < 0.00182768
    assert limits.attractor.kind == Kind.EQUILIBRIA


def test_release_limits_of_a_deep_well_are_all_angles() -> None:
    """Without the drive every release ends hanging, except one from exactly upright."""
    still = systems.scene(
        systems.Pendulum(L), systems.Gravity(G), systems.VerticalDrive(0.0, 50.0), systems.ViscousDamping(20.0)
    )
    limits = systems.release_limits(still, near=0.0, angles=16, tolerance=1e-9)
    assert limits.upper == pytest.approx([pi], abs=1e-8)
    assert "1 phases, from 3.14159 to 3.14159 rad" in repr(limits)
