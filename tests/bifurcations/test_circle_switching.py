"""Invariant circles from Neimark-Sacker bifurcations, attracting and repelling, against circles in closed form."""

from math import cos, pi, sin

import numpy as np
import pytest
from cases import branch_at_rest, quotient, thorough

from cellmap import discrete_map
from cellmap.bifurcations import switch_circle


def subcritical(x, p):
    """w -> w (1 + mu + s - s^2) exp(i (1.1 + 0.3 s)) with s = |w|^2, in the coordinate z = w / (1 - c w).

    Circles are at mu = s^2 - s: repelling ones from 0 back to the fold at -1/4, from there on attracting ones.
    """
    u, v = quotient(x[0], x[1], 1 + p.c * x[0], p.c * x[1])
    s = u * u + v * v
    size, turn = 1 + p.mu + s - s * s, 1.1 + 0.3 * s
    u, v = size * (u * cos(turn) - v * sin(turn)), size * (u * sin(turn) + v * cos(turn))
    return quotient(u, v, 1 - p.c * u, -p.c * v)


def beside_a_contraction(x, p):
    """The same beside a contraction, on a curved surface."""
    image = subcritical(x[:2], p)
    return *image, 0.5 * image[0] * image[1] + 0.9 * (x[2] - 0.5 * x[0] * x[1])


def plane():
    return discrete_map(subcritical, {"mu": -0.1, "c": 0.3}, ("x", "y"))


@pytest.mark.parametrize("dimension", [2, thorough(3)])
def test_a_repelling_circle_and_its_fold(dimension):
    space = discrete_map(beside_a_contraction, {"mu": -0.1, "c": 0.3}, ("x", "y", "z"))
    branch = branch_at_rest(plane() if dimension == 2 else space, "mu", -0.4, 0.2)
    (bifurcation,) = branch.bifurcations
    circles = switch_circle(branch, bifurcation, -0.4, 0.2)
    assert circles.ends == ("bifurcation", "left the interval")
    s = (2.0 * pi * circles.rotation - 1.1) / 0.3
    np.testing.assert_allclose(circles.values, s * s - s, atol=1e-9)
    assert circles.values.min() == pytest.approx(-0.25, abs=1e-3)
    assert circles.values[-1] == pytest.approx(0.2)
    expected = np.log(np.abs(1.0 + 2.0 * s - 4.0 * s * s))  # d/dr of r (1 + mu + r^2 - r^4)
    largest = expected if dimension == 2 else np.maximum(expected, np.log(0.9))
    # Means over an orbit converge slowly where both exponents across the circle are nearly equal.
    apart = np.full(len(s), True) if dimension == 2 else np.abs(expected - np.log(0.9)) > 0.2
    np.testing.assert_allclose(circles.exponents[apart], largest[apart], atol=1e-8 if dimension == 2 else 1e-5)
    np.testing.assert_allclose(circles.exponents, largest, atol=1e-3)
    assert circles.invariance_errors.max() < 1e-8
    if dimension == 2:
        np.testing.assert_allclose(circles.decay[5:], -np.log(0.3 * np.sqrt(s[5:])), rtol=0.05)


def test_a_circle_is_where_it_should_be():
    branch = branch_at_rest(plane(), "mu", -0.4, 0.2)
    circles = switch_circle(branch, branch.bifurcations[0], -0.4, 0.2, max_points=12)
    circle, mu = circles.circles[-1], circles.values[-1]
    assert circle is not None
    x, y = circle.points(np.arange(40) / 40.0, circles.coordinates)[0].T
    u, v = quotient(x, y, 1 + 0.3 * x, 0.3 * y)
    np.testing.assert_allclose(u * u + v * v, 0.5 - np.sqrt(0.25 + mu), atol=1e-9)
