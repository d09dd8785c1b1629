"""Units: every part in other units and back, and the same orbits in both."""

from math import pi, sqrt
from typing import Any

import numpy as np
import pytest

import systems
from systems.units import parameter_units

W = 100.0 * pi
DRIVES: list[Any] = [
    systems.VerticalDrive(0.003, 50.0, 0.2),
    systems.HorizontalDrive(0.003, 50.0, 0.2),
    systems.TiltedDrive(0.003, 50.0, 0.4, 0.2),
    systems.RotatingDrive(0.003, 0.002, 50.0, 0.2),
    systems.TorqueDrive(800.0, 50.0, 0.2),
    systems.HarmonicDrive((0.003, 0.001), (0.2, 0.7), 50.0),
    systems.SquareDrive(200.0, 50.0, 0.2, 0.1),
    systems.SquareDrive(200.0, 50.0, 0.2),
    systems.TriangleDrive(200.0, 50.0, 0.2, 0.1),
]
STEADY: list[Any] = [
    systems.Gravity(9.8),
    systems.ViscousDamping(10.0),
    systems.QuadraticDrag(0.1),
    systems.DryFriction(2.5),
    systems.TorsionSpring(50.0, 0.3),
    systems.ConstantTorque(20.0),
]
BODIES: list[Any] = [
    systems.Pendulum(0.0272),
    systems.CompoundPendulum(0.3, 0.0004, 0.03),
    systems.Chain((0.03, 0.02, 0.04), (0.1, 0.3, 0.2)),
]
UNITS = systems.Units(length=0.3, time=0.07, mass=2.5)


@pytest.mark.parametrize("part", [*DRIVES, *STEADY, *BODIES], ids=repr)
def test_there_and_back(part: systems.Part) -> None:
    there = systems.in_units(part, UNITS)
    assert type(there) is type(part)
    assert systems.in_units(there, UNITS.inverse).parameters == pytest.approx(part.parameters, rel=1e-14)


@pytest.mark.parametrize("part", [*DRIVES, *STEADY, *BODIES], ids=repr)
def test_written_units_are_those_by_which_values_change(part: systems.Part) -> None:
    """The powers of length, time and mass in a written unit, against how the value is converted."""
    powers = {
        "m": (1, 0, 0),
        "kg": (0, 0, 1),
        "kg m²": (2, 0, 1),
        "m/s²": (1, -2, 0),
        "Hz": (0, -1, 0),
        "1/s": (0, -1, 0),
    }
    powers |= {"rad/s²": (0, -2, 0), "1/s²": (0, -2, 0), "rad": (0, 0, 0), "1/rad": (0, 0, 0)}
    there = systems.in_units(part, UNITS).parameters
    for name, unit in parameter_units(part.parameters).items():
        assert there[name] * UNITS.of(powers[unit]) == pytest.approx(part.parameters[name], rel=1e-14)


@pytest.mark.parametrize("body", BODIES, ids=repr)
@pytest.mark.parametrize("drive", DRIVES, ids=repr)
def test_the_equation_of_motion_in_other_units(body: Any, drive: Any) -> None:
    """Accelerations, switches, places and energies, all effects at once."""
    here, there = systems.scene(body, *STEADY, drive), systems.scene(body, *STEADY, drive, units=UNITS)
    assert there.rhs is here.rhs
    assert there.length == pytest.approx(here.length / 0.07, rel=1e-14)
    assert not any(c.unit.endswith("/s") for c in there.axes)
    n = body.joints
    x = np.random.default_rng(0).uniform(-2.0, 2.0, 2 * n)
    scale = np.repeat([1.0, 1.0 / 0.07], n)
    t = 0.0031
    assert there.fun(t / 0.07, x / scale) == pytest.approx(here.fun(t, x) / scale * 0.07, rel=1e-11)
    assert there.signs(t / 0.07, x / scale) == here.signs(t, tuple(x))
    assert there.output("positions", t / 0.07, x / scale) == pytest.approx(
        here.output("positions", t, x) / 0.3, rel=1e-11
    )
    per_mass = isinstance(body, systems.Pendulum)
    energy = 0.3**2 / 0.07**2 * (1.0 if per_mass else 2.5)
    assert there.output("energy", t / 0.07, x / scale) == pytest.approx(here.output("energy", t, x) / energy, rel=1e-11)


def test_the_names_of_the_dimensionless_numbers() -> None:
    """alpha = g/(l w^2), beta = A/l, gamma/w, delta/w^2."""
    units = systems.drive_units(0.0272, 50.0)
    scaled = systems.dimensionless_parameters(0.0272, 0.003, 50.0, 10.0, friction=2.5)
    assert scaled == pytest.approx(
        {"alpha": 9.8 / (0.0272 * W**2), "beta": 0.003 / 0.0272, "gamma": 10.0 / W, "delta": 2.5 / W**2}, rel=1e-14
    )
    assert systems.in_units(systems.DryFriction(2.5), units).friction == scaled["delta"]
    assert systems.in_units(systems.VerticalDrive(0.003, 50.0), units).frequency == pytest.approx(0.5 / pi, rel=1e-15)
    back = systems.physical_parameters(**scaled, length=0.0272, frequency=50.0)
    assert back == pytest.approx(
        {"length": 0.0272, "amplitude": 0.003, "frequency": 50.0, "damping": 10.0, "gravity": 9.8, "friction": 2.5}
    )
    assert systems.driven_pendulum(**back).params["friction"] == pytest.approx(2.5)
    there, here = systems.dimensionless_pendulum(**scaled), systems.driven_pendulum(**back)
    assert there.fun(0.7, np.array([0.4, 0.2])) == pytest.approx(
        here.fun(0.7 / W, np.array([0.4, 0.2 * W])) / [W, W**2], rel=1e-12
    )
    places = here.output("positions", 0.7 / W, (0.4, 0.2 * W)) / 0.0272
    assert there.output("positions", 0.7, (0.4, 0.2)) == pytest.approx(places, rel=1e-12)
    assert "delta" not in systems.dimensionless_parameters(0.0272, 0.003, 50.0, 10.0)


def test_the_axes_of_the_stability_map() -> None:
    """Omega = f/f0, epsilon = A w0^2/g = A/l, and alpha = 1/Omega^2, beta = epsilon."""
    axes = systems.stability_coordinates(0.0272, 0.003, 50.0)
    w0 = sqrt(9.8 / 0.0272)
    assert axes == pytest.approx({"frequency_ratio": W / w0, "amplitude_ratio": 0.003 * w0**2 / 9.8}, rel=1e-14)
    scaled = systems.dimensionless_parameters(0.0272, 0.003, 50.0, 0.0)
    assert scaled["alpha"] == pytest.approx(axes["frequency_ratio"] ** -2, rel=1e-14)
    assert scaled["beta"] == pytest.approx(axes["amplitude_ratio"], rel=1e-14)
    back = systems.from_stability_coordinates(**axes, length=0.0272)
    assert back == pytest.approx({"length": 0.0272, "amplitude": 0.003, "frequency": 50.0, "gravity": 9.8}, rel=1e-14)
    assert systems.in_units(systems.Gravity(1.62), systems.swing_units(0.3, 1.62)).gravity == pytest.approx(
        1.0, rel=1e-15
    )


def test_a_period_of_ones_own_is_converted() -> None:
    system = systems.scene(systems.Pendulum(1.0), systems.Gravity(9.8), period=2.0, units=systems.Units(time=0.5))
    assert system.length == 4.0
