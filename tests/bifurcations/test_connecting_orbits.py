"""Connecting orbits: rigorous values of tangencies of the Henon map, an exact limit, and Melnikov's formulas."""

from dataclasses import replace
from math import cos, cosh, pi, sin, sqrt

import numpy as np
import pytest

from cellmap import ForcedSystem, angle, discrete_map, periodic_orbit, stroboscopic_map
from cellmap.bifurcations import connecting_orbits, continue_connection, continue_tangency


def henon(a, b):
    """The map of Arai and Mischaikow, (x, y) -> (a - x^2 + b y, x)."""
    return discrete_map(lambda x, p: (p.a - x[0] ** 2 + p.b * x[1], x[0]), {"a": a, "b": b}, ("x", "y"))


@pytest.fixture(scope="module")
def outer():
    exact = henon(1.4, -0.3)
    return connecting_orbits(exact, periodic_orbit(exact, [-2.0, -2.0]), max_steps=17, n_samples=4096)[0]


def test_an_orbit_is_one(outer):
    exact = henon(1.4, -0.3)
    np.testing.assert_allclose(exact(outer.points[:-1]), outer.points[1:], atol=1e-12)
    np.testing.assert_allclose(outer.source, [-2.0, -2.0], atol=1e-12)
    assert outer.homoclinic and not replace(outer, target=np.add(outer.target, [0, 1])).homoclinic
    distances = np.abs(outer.points - outer.source).max(axis=1)
    assert distances[[0, -1]].max() < 1e-4
    assert distances.max() > 3.0


# Arai, Mischaikow (2006): the tangency of the outer fixed point at b = -0.3, of the inner one at b = 0.3.
def test_the_outer_tangency_and_its_curve(outer):
    (touching,) = continue_connection(outer, "a", 1.25, 1.45).tangencies
    assert 1.314527109319 - 2e-12 <= touching.value <= 1.314527109334 + 2e-12
    assert touching.gains
    assert abs(touching.orbit.angle) < 1e-5
    curve = continue_tangency(touching, ("a", "b"), (1.2, 2.2), (-0.4, 0.0), step=0.1)
    # Without memory of x the map is the quadratic one, whose orbit 0 -> a -> a - a^2 meets the fixed point at a = 2.
    end = curve.values[np.argmax(curve.values[:, 1])]
    np.testing.assert_allclose(end, [2.0, 0.0], atol=1e-10)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("force", "coordinate", "saddle", "critical"),
    [
        (lambda x: x - x**3, "x", 0.0, lambda w: 4.0 * cosh(pi * w / 2.0) / (3.0 * sqrt(2.0) * pi * w)),
        (lambda x: -sin(x), angle("theta"), pi, lambda w: 4.0 / pi * cosh(pi * w / 2.0)),
    ],
    ids=["duffing", "pendulum"],
)
def test_melnikov(force, coordinate, saddle, critical):
    # Guckenheimer, Holmes (1983), 4.5: zeros of Melnikov's function from gamma / delta on, here with omega = 2.
    omega, deviations = 2.0, []

    def rhs(t, x, p):
        return x[1], force(x[0]) + p.epsilon * (p.gamma * cos(p.omega * t) - p.delta * x[1])

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


def test_a_branch_ends_where_a_saddle_changes_its_stability():
    exact = discrete_map(lambda x, p: (1 - p.a * x[0] ** 2 + x[1], p.b * x[0]), {"a": 1.2, "b": 0.3}, ("x", "y"))
    one, two = periodic_orbit(exact, [0.6, 0.2]), periodic_orbit(exact, [-0.5, 0.3], 2)
    orbit = connecting_orbits(exact, one, two, max_steps=16, n_samples=2048)[0]
    branch = continue_connection(orbit, "a", 0.7, 1.3)
    assert branch.ends == ("a saddle changes its stability", "left the interval")
    # The period-2 orbit doubles its period there, in closed form.
    assert 0.0 < branch.values[0] - (0.7**2 + 0.25 * 1.3**2) < 0.05


def test_bad_arguments(outer):
    exact = henon(1.4, -0.3)
    node, saddle = periodic_orbit(henon(0.1, -0.3), [0.1, 0.1]), periodic_orbit(exact, [-2.0, -2.0])
    for call, message in (
        (lambda: connecting_orbits(exact, node), "give a saddle with one unstable multiplier"),
        (lambda: connecting_orbits(exact, saddle, radius=0.9), r"radius=0\.9"),
        (lambda: continue_connection(outer, "a", 1.5, 1.6), r"must contain the present value 1\.4"),
        (lambda: continue_connection(outer, "c", 1.5, 1.6), "parameter='c'"),
    ):
        with pytest.raises(ValueError, match=message):
            call()


def test_several_orbits_connect_a_saddle_with_itself():
    """The horseshoe of Henon's map (x, y) -> (5.4 - x^2 - 0.9 y, x): at least two, all different, all orbits."""
    exact = henon(5.4, -0.9)
    found = connecting_orbits(exact, periodic_orbit(exact, [-4.0, -4.0]), max_steps=17)
    assert len(found) >= 2
    for orbit in found:
        np.testing.assert_allclose(exact(orbit.points[:-1]), orbit.points[1:], atol=1e-10)
    farthest = [o.points[np.abs(o.points - o.source).max(axis=1).argmax()] for o in found]
    apart = np.abs(np.subtract.outer(farthest, farthest).diagonal(axis1=1, axis2=3)).max(axis=-1)
    assert (apart + 10 * np.eye(len(found))).min() > 1e-3
