"""Newton's method in the search for attractors."""

from __future__ import annotations

from math import pi, sin, sqrt

import numpy as np
import pytest
from small_maps import CIRCLE, circle, logistic

from cellmap import discrete_map
from cellmap.maps.tangent import tangent
from cellmap.orbits.newton import newton, stable_orbit


@pytest.mark.parametrize("period", [1, 2, 3])
def test_newton_finds_unstable_points_too(period):
    """All solutions of P^q(x) = x for the logistic map at 4: sin^2(pi k / (2^q +- 1))."""
    exact = [sin(pi * k / (2**period + s)) ** 2 for s in (-1, 1) for k in range(2**period)]
    guesses = np.array(exact)[:, None] + 1e-3
    points, settled = newton(logistic(4.0), guesses, np.full(len(guesses), period), np.ones(1))
    assert settled.all()
    assert points[:, 0] == pytest.approx(exact, abs=1e-12)


def test_newton_takes_a_period_for_each_guess():
    points, settled = newton(logistic(3.2), np.array([[0.68], [0.5], [0.51]]), np.array([1, 1, 2]), np.ones(1))
    assert settled.all()
    assert points[:, 0] == pytest.approx([1 - 1 / 3.2, 1 - 1 / 3.2, (4.2 - sqrt(0.84)) / 6.4], abs=1e-12)


def test_newton_gives_up_where_there_is_nothing():
    """x + 1 + x^2 has no fixed point; a rigid rotation by half a circle has no isolated ones."""
    rising = discrete_map(lambda x, p: (x[0] + 1.0 + x[0] ** 2,), {}, ("x",))
    assert not newton(rising, np.array([[0.3], [-2.0]]), np.ones(2, int), np.ones(1))[1].any()
    assert not newton(circle(0.5, 0.0), CIRCLE, np.full(30, 2), np.full(1, 2 * pi))[1].any()


def test_newton_does_not_wander_far():
    halves = discrete_map(lambda x, p: (0.5 * x[0],), {}, ("x",))
    far, near = newton(halves, np.array([[0.7], [0.3]]), np.ones(2, int), np.ones(1))[1]
    assert (far, near) == (False, True)


@pytest.mark.parametrize("multiple", [1, 2, 3])
def test_least_period_is_taken(multiple):
    a = stable_orbit(logistic(3.2), np.array([(4.2 - sqrt(0.84)) / 6.4]), 2 * multiple, np.ones(1))
    assert a is not None
    assert a.period == 2


@pytest.mark.parametrize("r", [3.0, 3.2])
def test_neutral_and_unstable_points_are_not_stable(r):
    assert stable_orbit(logistic(r), np.array([1 - 1 / r]), 1, np.ones(1)) is None


def test_derivatives_are_kept_where_points_hardly_move_in_many_dimensions(monkeypatch):
    """x -> 1/2 x + 1/4 x^2 + ..., six coordinates; the solution is where x = 1/2 x + 1/4 x_next^2 + 1/10."""
    directions = []

    def counted(point_map, points, periods, states):
        directions.append(states)
        return tangent(point_map, points, periods, states)

    monkeypatch.setattr("cellmap.orbits.newton.tangent", counted)
    six = discrete_map(
        lambda x, p: tuple(0.5 * x[i] + 0.25 * x[(i + 1) % 6] ** 2 + 0.1 for i in range(6)), {}, tuple("abcdef")
    )
    exact = 1.0 - sqrt(0.6)  # x^2 / 4 - x / 2 + 1/10 = 0
    guesses = np.full((2, 6), exact) + np.random.default_rng(0).uniform(-1e-7, 1e-7, (2, 6))
    points, settled = newton(six, guesses, np.ones(2, int), np.ones(6))
    assert settled.all()
    assert points == pytest.approx(np.full((2, 6), exact), abs=1e-14)
    assert directions[0] == 6 and set(directions[1:]) == {1}
