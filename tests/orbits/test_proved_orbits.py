"""Orbits that are proved, against exact values."""

from itertools import pairwise
from math import pi, sin, sqrt

import mpmath
import numpy as np
import pytest

from cellmap import ForcedSystem, angle, discrete_map, periodic_orbit, stroboscopic_map
from cellmap.orbits import NotProvedError, contraction, prove_orbit
from cellmap.orbits.contraction import contraction_balls

HENON = discrete_map(lambda x, p: (1 - p.a * x[0] ** 2 + x[1], p.b * x[0]), {"a": 1.4, "b": 0.3}, ("x", "y"))
LOGISTIC = discrete_map(lambda x, p: (p.r * x[0] * (1 - x[0]),), {"r": 3.835}, ("x",))


def test_saddle_of_henon_is_where_its_equation_says():
    found = prove_orbit(HENON, periodic_orbit(HENON, [0.6, 0.2]))
    with mpmath.workdps(40):
        a, b = mpmath.mpf(1.4), mpmath.mpf(0.3)
        x = (b - 1 + mpmath.sqrt((1 - b) ** 2 + 4 * a)) / (2 * a)
        for exact, near, radius in zip((x, b * x), found.points[0], found.radii[0], strict=True):
            assert abs(exact - mpmath.mpf(near)) <= radius < 1e-14
        roots = [-a * x - s * mpmath.sqrt((a * x) ** 2 + b) for s in (1, -1)]
        for root, centre, radius in zip(roots, found.multipliers, found.multiplier_radii, strict=True):
            assert abs(root - mpmath.mpc(centre)) <= radius < 1e-12
    assert (found.stable, found.unstable_directions, found.is_least) == (False, 1, True)
    assert "saddle" in repr(found)
    # The other fixed point is (-1.131354, ...), and not in the box where the first one is alone.
    assert found.unique_within[0, 0] < 0.631354 + 1.131354


@pytest.mark.parametrize("every", [14, pytest.param(1, marks=pytest.mark.thorough)])
def test_three_periodic_window_of_the_logistic_map(every):
    """Born at 1 + sqrt(8), and stable until it doubles its period at 3.841499 (Strogatz 1994, 10.4)."""
    values = np.linspace(3.829, 3.8414, 100)
    for low, high in list(pairwise(values))[::every]:
        here = LOGISTIC.with_params(r=0.5 * (low + high))
        found = prove_orbit(here, periodic_orbit(here, [0.5], 3), {"r": (low, high)})
        assert found.stable and found.is_least and found.parameters == {"r": (low, high)}
    born = 1.0 + sqrt(8.0)
    with pytest.raises(NotProvedError, match="intervals of parameters"):
        prove_orbit(LOGISTIC, periodic_orbit(LOGISTIC, [0.5], 3), {"r": (born - 1e-3, born + 1e-2)})


def test_an_orbit_gone_round_twice_has_no_least_period():
    once = periodic_orbit(LOGISTIC, [0.5], 3)
    twice = prove_orbit(LOGISTIC, np.concatenate([once.points, once.points]))
    assert twice.period == 6 and not twice.is_least and twice.stable


def test_orbit_on_a_circle_with_rotations():
    """Each step is a full rotation less half of sin: fixed at the angle 0, with multiplier 1 - 0.5."""
    rotating = discrete_map(lambda x, p: (x[0] + 2 * pi - 0.5 * sin(x[0]),), {}, (angle("theta"),))
    found = prove_orbit(rotating, [[0.0]])
    assert found.stable and found.radii[0, 0] < 1e-13 and found.is_least


@pytest.mark.thorough
def test_equilibria_of_a_pendulum():
    """Over a period T the multipliers are exp(r T), with r**2 + g r - 1 = 0 for the upper one."""
    pendulum = stroboscopic_map(
        ForcedSystem(lambda t, x, p: (x[1], -p.g * x[1] - sin(x[0])), {"g": 0.2}, 1.0, (angle("theta"), "v"))
    )
    lower, upper = prove_orbit(pendulum, [[0.0, 0.0]]), prove_orbit(pendulum, [[pi, 0.0]])
    assert lower.stable and upper.unstable_directions == 1
    assert upper.radii.max() < 1e-13
    rates = np.array([-0.1 + sqrt(1.01), -0.1 - sqrt(1.01)])
    assert (np.abs(upper.multipliers - np.exp(rates)) <= upper.multiplier_radii + 1e-15).all()
    assert upper.multiplier_radii.max() < 1e-10


def test_failures_are_no_numbers():
    """The maximum of 0 and NaN is 0 to Python: what has no enclosure must not contract."""
    pole = discrete_map(lambda x, p: (x[0] / 2 + 1e-3 / (x[0] - 0.25) * 0.0,), {}, ("x",))
    balls = contraction_balls(pole, np.array([[0.0]]), np.array([2.0]))
    assert balls is not None and balls.radius * 2.0 < 0.25 / balls.frames[0, 0, 0] * balls.frames[0, 0, 0] + 1e-9
    assert contraction_balls(HENON, periodic_orbit(HENON, [0.6, 0.2]).points, np.ones(2)) is None
    with pytest.raises(NotProvedError):
        prove_orbit(HENON, [[0.5, 0.5]])


def test_a_bound_that_is_not_known_contracts_nothing(monkeypatch):
    """Where the square of a derivative overflows, on some processors."""
    half = discrete_map(lambda x, p: (0.5 * x[0],), {}, ("x",))
    whole = contraction_balls(half, np.zeros((1, 1)), np.ones(1))
    assert whole is not None and whole.radius == 0.5  # as wide as the extent, where nothing stops it
    monkeypatch.setattr(contraction, "stretch_above", lambda matrices: np.full(len(matrices.mid), np.nan))
    assert contraction_balls(half, np.zeros((1, 1)), np.ones(1)) is None
