"""Connecting orbits: rigorous values of tangencies of the Henon map, an exact limit, and Melnikov's formulas."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import cos, cosh, pi, sin, sqrt
from typing import Any

import numpy as np
import pytest

from cellmap import Coordinate, ForcedSystem, PointMap, angle, discrete_map, periodic_orbit, stroboscopic_map
from cellmap.bifurcations import (
    ConnectingOrbit,
    connecting_orbits,
    continue_connection,
    continue_tangency,
)


def henon(a: float, b: float) -> PointMap:
    """The map of Arai and Mischaikow, (x, y) -> (a - x^2 + b y, x)."""
    return discrete_map(lambda x, p: (p.a - x[0] ** 2 + p.b * x[1], x[0]), {"a": a, "b": b}, ("x", "y"))


@pytest.fixture(scope="module")
def outer() -> ConnectingOrbit:
    exact = henon(1.4, -0.3)
    return connecting_orbits(exact, periodic_orbit(exact, [-2.0, -2.0]), max_steps=17, n_samples=4096)[0]


def test_an_orbit_is_one(outer: ConnectingOrbit) -> None:
    exact = henon(1.4, -0.3)
    np.testing.assert_allclose(exact(outer.points[:-1]), outer.points[1:], atol=1e-12)
    np.testing.assert_allclose(outer.source, [-2.0, -2.0], atol=1e-12)
    assert outer.homoclinic
    distances = np.abs(outer.points - outer.source).max(axis=1)
    assert distances[[0, -1]].max() < 1e-4
    assert distances.max() > 3.0


# Arai, Mischaikow (2006): the tangency of the outer fixed point at b = -0.3, of the inner one at b = 0.3.
def test_the_outer_tangency_and_its_curve(outer: ConnectingOrbit) -> None:
    (touching,) = continue_connection(outer, "a", 1.25, 1.45).tangencies
    assert 1.314527109319 - 2e-12 <= touching.value <= 1.314527109334 + 2e-12
    assert touching.gains
    assert abs(touching.orbit.angle) < 1e-5
    curve = continue_tangency(touching, ("a", "b"), (1.2, 2.2), (-0.4, 0.0), step=0.1)
    # Without memory of x the map is the quadratic one, whose orbit 0 -> a -> a - a^2 meets the fixed point at a = 2.
    end = curve.values[np.argmax(curve.values[:, 1])]
    np.testing.assert_allclose(end, [2.0, 0.0], atol=1e-10)


def test_the_inner_tangency() -> None:
    exact = henon(1.4, 0.3)
    inner = connecting_orbits(exact, periodic_orbit(exact, [0.9, 0.9]), max_steps=30)
    values = [
        t.value for orbit in inner[:8] for t in continue_connection(orbit, "a", 1.3, 1.45, max_points=150).tangencies
    ]
    assert any(1.392419807915 - 2e-12 <= value <= 1.392419807931 + 2e-12 for value in values)


def test_a_heteroclinic_tangency_tends_to_the_crisis_of_the_quadratic_map() -> None:
    exact = henon(1.5, 0.3)
    inner, outer = periodic_orbit(exact, [0.9, 0.9]), periodic_orbit(exact, [-1.6, -1.6])
    orbits = connecting_orbits(exact, inner, outer, max_steps=26, n_samples=4096)
    assert not orbits[0].homoclinic
    values = {}
    for orbit in orbits[:4]:
        for touching in continue_connection(orbit, "a", 1.35, 1.55).tangencies:
            values[touching.value] = touching
    first = values[min(values)]
    # The crisis at b = 0.3 is at a = 1.427 (Grebogi, Ott, Yorke 1983).
    assert first.value == pytest.approx(1.427, abs=5e-4)
    curve = continue_tangency(first, ("a", "b"), (1.3, 2.2), (0.0, 0.4), step=0.1)
    np.testing.assert_allclose(curve.values[np.argmin(curve.values[:, 1])], [2.0, 0.0], atol=1e-10)


def duffing(t: float, x: Sequence[float], p: Any) -> tuple[float, float]:
    return x[1], x[0] - x[0] ** 3 + p.epsilon * (p.gamma * cos(p.omega * t) - p.delta * x[1])


def pendulum(t: float, x: Sequence[float], p: Any) -> tuple[float, float]:
    return x[1], -sin(x[0]) + p.epsilon * (p.gamma * cos(p.omega * t) - p.delta * x[1])


@pytest.mark.parametrize(
    ("rhs", "coordinate", "saddle", "critical"),
    [
        (duffing, "x", 0.0, lambda w: 4.0 * cosh(pi * w / 2.0) / (3.0 * sqrt(2.0) * pi * w)),
        (pendulum, angle("theta"), pi, lambda w: 4.0 / pi * cosh(pi * w / 2.0)),
    ],
    ids=["duffing", "pendulum"],
)
def test_melnikov(
    rhs: Callable[..., Any], coordinate: str | Coordinate, saddle: float, critical: Callable[[float], float]
) -> None:
    # Guckenheimer, Holmes (1983), 4.5: zeros of Melnikov's function from gamma / delta on, here with omega = 2.
    omega, deviations = 2.0, []
    for epsilon in (0.02, 0.01):
        params = {"epsilon": epsilon, "gamma": 1.5 * critical(omega), "delta": 1.0, "omega": omega}
        exact = stroboscopic_map(ForcedSystem(rhs, params, 2 * pi / omega, (coordinate, "v")), rtol=1e-12, atol=1e-12)
        orbit = connecting_orbits(exact, periodic_orbit(exact, [saddle, 0.0]), max_steps=11, n_samples=2048)[0]
        branch = continue_connection(orbit, "gamma", 0.8 * critical(omega), 1.6 * critical(omega))
        (touching,) = branch.tangencies
        assert touching.gains
        deviations.append(touching.value / critical(omega) - 1.0)
    assert abs(deviations[1]) < 0.01
    assert deviations[0] / deviations[1] == pytest.approx(4.0, abs=0.02)  # order 2 in epsilon


def in_three_dimensions(x: Any, p: Any) -> Any:
    """The Hénon map beside a contraction, in coordinates in which the plane of its orbits is curved."""
    image = p.a - x[0] ** 2 + p.b * x[1], x[0]
    return *image, 0.3 * image[0] * image[1] + 0.4 * (x[2] - 0.3 * x[0] * x[1])


def in_four_dimensions(x: Any, p: Any) -> Any:
    """The same beside a spiral."""
    image, u, v = (p.a - x[0] ** 2 + p.b * x[1], x[0]), x[2] - 0.3 * x[0] * x[1], x[3] - 0.2 * sin(x[0])
    first = 0.3 * image[0] * image[1] + 0.5 * u - 0.6 * v + 0.1 * u * v
    return *image, first, 0.2 * sin(image[0]) + 0.6 * u + 0.5 * v


@pytest.mark.parametrize("function", [in_three_dimensions, in_four_dimensions])
def test_more_dimensions(function: Any, outer: ConnectingOrbit) -> None:
    names = ("x", "y", "z", "w")[: 3 if function is in_three_dimensions else 4]
    exact = discrete_map(function, {"a": 1.4, "b": -0.3}, names)
    saddle = periodic_orbit(exact, [-2.0, -2.0, 1.2, 0.2 * sin(-2.0)][: len(names)])
    orbit = connecting_orbits(exact, saddle, max_steps=20, n_samples=4096)[0]
    x, y, z = orbit.points.T[:3]
    np.testing.assert_allclose(z, 0.3 * x * y, atol=1e-9)
    np.testing.assert_allclose(x[1:], 1.4 - x[:-1] ** 2 - 0.3 * y[:-1], atol=1e-9)
    branch = continue_connection(orbit, "a", 1.2, 1.5)
    assert [t.value for t in branch.tangencies] == pytest.approx([1.3145271093265], abs=1e-10)
    curve = continue_tangency(branch.tangencies[0], ("a", "b"), (1.2, 1.6), (-0.4, -0.2), step=0.2)
    (touching,) = continue_connection(outer, "a", 1.25, 1.45).tangencies
    expected = continue_tangency(touching, ("a", "b"), (1.2, 1.6), (-0.4, -0.2), step=0.2)
    np.testing.assert_allclose(curve.values[[0, -1]], expected.values[[0, -1]], rtol=1e-8)


def test_a_branch_ends_where_a_saddle_changes_its_stability() -> None:
    exact = discrete_map(lambda x, p: (1 - p.a * x[0] ** 2 + x[1], p.b * x[0]), {"a": 1.2, "b": 0.3}, ("x", "y"))
    one, two = periodic_orbit(exact, [0.6, 0.2]), periodic_orbit(exact, [-0.5, 0.3], 2)
    orbit = connecting_orbits(exact, one, two, max_steps=16, n_samples=2048)[0]
    branch = continue_connection(orbit, "a", 0.7, 1.3)
    assert branch.ends == ("a saddle changes its stability", "left the interval")
    # The period-2 orbit doubles its period there, in closed form.
    assert 0.0 < branch.values[0] - (0.7**2 + 0.25 * 1.3**2) < 0.05


def test_bad_arguments(outer: ConnectingOrbit) -> None:
    exact = henon(1.4, -0.3)
    node = periodic_orbit(henon(0.1, -0.3), [0.1, 0.1])
    saddle = periodic_orbit(exact, [-2.0, -2.0])
    with pytest.raises(ValueError, match="give a saddle with one unstable multiplier"):
        connecting_orbits(exact, node)
    with pytest.raises(ValueError, match=r"radius=0\.9"):
        connecting_orbits(exact, saddle, radius=0.9)
    with pytest.raises(ValueError, match=r"must contain the present value 1\.4"):
        continue_connection(outer, "a", 1.5, 1.6)
    with pytest.raises(ValueError, match="parameter='c'"):
        continue_connection(outer, "c", 1.5, 1.6)
