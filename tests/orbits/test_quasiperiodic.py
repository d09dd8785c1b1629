"""Invariant circles and tori that are known in closed form."""

from math import cos, pi, sin, sqrt

import numpy as np
import pytest

from cellmap import angle, discrete_map, find_attractors
from cellmap.orbits.invariant_circle import drift, fitted_circle
from cellmap.orbits.invariant_torus import fitted_torus

GOLDEN = 0.5 * (sqrt(5.0) - 1.0)


def turned(x, p):
    """z -> z exp(2 pi i omega) (1.1 - abs(z)^2 / 10): the circle of radius 1 attracts."""
    grown = 1.1 - 0.1 * (x[0] * x[0] + x[1] * x[1])
    c, s = cos(2 * pi * p.omega), sin(2 * pi * p.omega)
    return grown * (c * x[0] - s * x[1]), grown * (s * x[0] + c * x[1])


def carried(x, p):
    """An angle that turns by omega, and a coordinate that it drives."""
    return x[0] + 2 * pi * p.omega, 0.5 * x[1] + 0.3 * sin(x[0])


PLANE = discrete_map(turned, {"omega": GOLDEN}, ("x", "y"))
CYLINDER = discrete_map(carried, {"omega": GOLDEN}, (angle("theta"), "y"))


@pytest.mark.parametrize("omega", [GOLDEN, 1.0 - GOLDEN, 0.1 * sqrt(2.0)])
def test_a_circle_in_the_plane(omega):
    """Its phase goes counterclockwise, whichever way the orbit goes."""
    found, _ = fitted_circle(PLANE.with_params(omega=omega), np.array([1.0, 0.0]), np.ones(2), 0)
    circle = found.circle
    assert circle.frequency == pytest.approx(omega, abs=1e-10)
    assert abs(circle.frequency - omega) <= circle.frequency_error + 1e-14
    points = circle.points(np.arange(8) / 8, PLANE.coordinates)[0]
    assert np.hypot(*points.T) == pytest.approx(np.ones(8), abs=1e-8)
    turns = np.diff(np.unwrap(np.arctan2(points[:, 1], points[:, 0])))
    assert turns == pytest.approx(np.full(7, pi / 4), abs=1e-8)
    assert circle.rotation_numbers.tolist() == [0.0, 0.0]


@pytest.mark.parametrize(("omega", "largest"), [(GOLDEN, 1e-9), (0.25 + 2e-5 / pi, 1e-5)])
def test_a_curve_around_a_cylinder(omega, largest):
    """y = Im c exp(i theta), where c exp(2 pi i omega) = c/2 + 0.3; at some 1/4 + 6e-6 orbits are longer."""
    cylinder = CYLINDER.with_params(omega=omega)
    found, _ = fitted_circle(cylinder, cylinder.iterate([0.3, 0.0], 200).points, np.full(2, 2 * pi), 0)
    assert found.circle.rotation_numbers == pytest.approx([omega, 0.0], abs=1e-12)
    theta, y = found.circle.points(np.arange(16) / 16, CYLINDER.coordinates)[0].T
    c = 0.3 / (np.exp(2j * pi * omega) - 0.5)
    assert y == pytest.approx((c * np.exp(1j * theta)).imag, abs=largest)
    assert found.circle.invariance_error < 1e-3


def test_a_drift_close_to_a_resonance():
    """Each step is off a quarter of a full rotation by 1e-5 of it."""
    near = CYLINDER.with_params(omega=0.25 + 1e-5)
    found = drift(near, near.iterate([0.3, 0.0], 200).points, np.full(2, 2 * pi))
    assert found.denominator == 4
    assert found.numbers == pytest.approx((0.25 + 1e-5, 0.0), abs=1e-12)
    assert drift(CYLINDER.with_params(omega=0.25), np.array([0.3, 0.0]), np.full(2, 2 * pi)) is None  # it comes to rest


@pytest.mark.parametrize("second", [sqrt(3.0) - 1.0, sqrt(2.0) - 1.0 + 0.0031])
def test_a_torus_of_two_frequencies(second):
    """Those that are nearly the same take a longer orbit."""
    omegas = sqrt(2.0) - 1.0, second
    twice = discrete_map(
        lambda x, p: (x[0] + 2 * pi * omegas[0], x[1] + 2 * pi * omegas[1], 0.4 * x[2] + 0.2 * sin(x[0] + x[1])),
        {},
        (angle("a"), angle("b"), "z"),
    )
    torus = fitted_torus(twice, twice.iterate([0.1, 0.2, 0.0], 100).points)
    assert torus.rotation_numbers == pytest.approx([*omegas, 0.0], abs=1e-10)
    assert torus.invariance_error < 1e-6
    a, b, z = torus.points(np.random.default_rng(0).random((20, 2)), twice.coordinates).T
    c = 0.2 / (np.exp(2j * pi * sum(omegas)) - 0.4)
    assert z == pytest.approx((c * np.exp(1j * (a + b))).imag, abs=1e-6)


def test_names_say_the_rotation_number():
    (circle,) = find_attractors(PLANE, [[0.5, 0.0]], max_periods=600)
    assert circle.name == f"quasi-periodic, rotation number {GOLDEN:.6g}"
