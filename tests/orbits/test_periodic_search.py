"""Periodic orbits: all in a window, their kinds, Jury's criterion."""

from collections import Counter
from math import cos, exp, pi, sin

import numpy as np
import pytest

from cellmap import (
    CellGrid,
    ForcedSystem,
    angle,
    continue_orbit,
    discrete_map,
    find_periodic_orbits,
    periodic_orbit,
    stroboscopic_map,
)
from cellmap.bifurcations import switch_branch
from cellmap.orbits import Attractor, Kind, OrbitKind, jury_margins
from systems import henon_map, standard_map

WINDOW = CellGrid((-pi, -500.0), (pi, 500.0), (120, 120))


def test_all_cycles_of_the_henon_map():
    # Biham, Wenzel, Physical Review Letters 63 (1989) 819: numbers of cycles; the saddle off the attractor besides.
    known = {1: 2, 2: 1, 4: 1, 6: 2, 7: 4, 8: 7, 9: 6, 10: 10}
    orbits = find_periodic_orbits(henon_map(), CellGrid((-2, -1), (2, 1), (100, 100)), longest_period=10)
    assert Counter(o.period for o in orbits) == known
    for orbit in orbits:
        rounding = 1e-14 * np.linalg.norm(orbit.matrix) ** 2
        assert np.linalg.det(orbit.matrix) == pytest.approx((-0.3) ** orbit.period, abs=rounding)
    first = next(o for o in orbits if o.kind is OrbitKind.FLIP_SADDLE)
    x = (-0.7 + np.sqrt(0.49 + 5.6)) / 2.8
    np.testing.assert_allclose(first.points, [[x, 0.3 * x]], rtol=1e-13)
    slope = -1.4 * x
    np.testing.assert_allclose(
        sorted(first.multipliers.real), [slope - np.sqrt(slope**2 + 0.3), slope + np.sqrt(slope**2 + 0.3)], rtol=1e-12
    )


def test_orbits_of_the_driven_pendulum(pendulum):
    orbits = find_periodic_orbits(pendulum, WINDOW)
    assert Counter(o.name for o in orbits) == {"saddle": 4, "stable focus": 4}
    assert sorted(o.rotations[0] for o in orbits) == [-1, -1, 0, 0, 0, 0, 1, 1]
    for orbit in orbits:
        assert np.linalg.det(orbit.matrix) == pytest.approx(exp(-0.2), rel=1e-10)  # Liouville
        assert orbit.is_stable == (orbit.kind is OrbitKind.FOCUS)
        assert orbit.rotation_number == (float(orbit.rotations[0]), 0.0)
    inverted = next(o for o in orbits if o.is_stable and abs(o.points[0, 0]) > 3.1)
    assert inverted.multipliers[0] == pytest.approx(0.865837958746 + 0.262783907940j, rel=1e-11)
    rotation = next(o for o in orbits if o.is_stable and o.rotations[0] == 1)
    np.testing.assert_allclose(rotation.points[0] / [1.0, 100 * pi], [2.520339579944, 1.019933227842], rtol=1e-10)


def test_fixed_points_of_the_standard_map():
    # On the cylinder y may rise by a period: only (0, 0) and (pi, 0) are fixed; traces are 2 + K and 2 - K.
    k = 0.9
    orbits = find_periodic_orbits(standard_map(k), CellGrid((-pi, -pi), (pi, pi), (64, 64)))
    assert {o.kind for o in orbits} == {OrbitKind.SADDLE, OrbitKind.CENTRE}
    for orbit in orbits:
        expected = 2 + k if orbit.kind is OrbitKind.SADDLE else 2 - k
        assert np.trace(orbit.matrix) == pytest.approx(expected, rel=1e-12)
        assert not orbit.is_stable


def test_a_linear_map_has_the_kinds_of_its_multipliers():
    params = dict.fromkeys("abcd", 0.0)
    linear = discrete_map(lambda x, p: (p.a * x[0] + p.b * x[1], p.c * x[0] + p.d * x[1]), params, ("x", "y"))
    for name, entries in {
        "stable node": (0.5, 0.0, 0.0, -0.2),
        "unstable node": (1.5, 0.0, 0.0, 2.0),
        "stable focus": (0.5, -0.5, 0.5, 0.5),
        "unstable focus": (1.5, -0.5, 0.5, 1.5),
        "saddle": (1.5, 0.0, 0.0, 0.5),
        "flip saddle": (-1.5, 0.0, 0.0, 0.5),
        "centre": (cos(1.0), -sin(1.0), sin(1.0), cos(1.0)),
    }.items():
        here = linear.with_params(**dict(zip("abcd", entries, strict=True)))
        assert periodic_orbit(here, [0.3, -0.2]).name == name


@pytest.mark.parametrize("dimension", [1, 2, 3, 4, 6])
def test_jury_agrees_with_the_eigenvalues(dimension):
    rng = np.random.default_rng(dimension)
    seen = set()
    for _ in range(300):
        matrix = rng.normal(size=(dimension, dimension)) / dimension**0.5
        stable = bool(np.abs(np.linalg.eigvals(matrix)).max() < 1.0)
        margins = jury_margins(matrix)
        assert margins.shape == (max(dimension + 1, 2),)
        assert bool((margins > 0).all()) == stable
        seen.add(stable)
    assert seen == {True, False}


def test_newton_begins_far_away(pendulum):
    # The saddle beside the inverted state, from guesses up to a quarter of a radian and many rad/s away.
    saddle = periodic_orbit(pendulum, [2.13, 0.9])
    for guess in ([2.0, 15.0], [2.3, -10.0], [1.95, -5.0]):
        np.testing.assert_allclose(periodic_orbit(pendulum, guess).points, saddle.points, rtol=1e-9)
    assert periodic_orbit(pendulum, [0.1, 0.0], period=6).period == 1


def test_no_orbit_is_said():
    translation = discrete_map(lambda x, p: (x[0] + 1.0 + 0.1 * sin(x[0]),), {}, ("x",))
    with pytest.raises(ValueError, match="no orbit of period 1"):
        periodic_orbit(translation, [0.3])
    assert find_periodic_orbits(translation, CellGrid((-3,), (3,), (50,))) == ()


def test_an_angle_may_rotate():
    circle = discrete_map(lambda x, p: (x[0] + 2 * pi + 0.5 * sin(x[0]),), {}, (angle("theta"),))
    orbits = find_periodic_orbits(circle, CellGrid((-pi,), (pi,), (40,)))
    assert [(o.rotations, round(float(o.multipliers[0].real), 12)) for o in orbits] == [((1,), 1.5), ((1,), 0.5)]


@pytest.mark.parametrize(
    ("a", "b", "extent", "cells", "longest"),
    [(6.0, 0.3, 4.0, 150, 7), pytest.param(10.0, -1.0, 5.0, 250, 6, marks=pytest.mark.thorough)],
)
def test_each_orbit_of_a_horseshoe_is_found_once(a, b, extent, cells, longest):
    # Devaney, Nitecki, Communications in Mathematical Physics 67 (1979) 137: one orbit for each binary Lyndon word.
    henon = discrete_map(lambda x, p: (a - x[0] ** 2 + b * x[1], x[0]), {}, ("x", "y"))
    found = find_periodic_orbits(henon, CellGrid([-extent] * 2, [extent] * 2, [cells] * 2), longest_period=longest)
    assert Counter(o.period for o in found) == dict(zip(range(1, longest + 1), (2, 1, 2, 3, 6, 9, 18), strict=False))


@pytest.mark.parametrize(("omega", "part"), [(0.5, 2.0), (0.7, 0.0), (0.9, 0.9)])
def test_a_saddle_with_large_multipliers_is_found_from_nearby(omega, part):
    # Between two wells, to first order in epsilon: x = -epsilon cos(omega t)/(1 + omega^2), with multipliers of some
    # exp(2 pi/omega): 1e3 to 3e5.
    def rhs(t, x, p):
        return x[1], x[0] - x[0] ** 3 + p.epsilon * (cos(p.omega * t) - x[1])

    wells = ForcedSystem(
        rhs, {"epsilon": 0.01, "omega": omega}, period=lambda p: 2.0 * pi / p.omega, coordinates=("x", "v")
    )
    expected = -0.01 / (1.0 + omega**2)
    orbit = periodic_orbit(stroboscopic_map(wells), [part * expected, 0.0])
    np.testing.assert_allclose(orbit.points, [[expected, 0.0]], atol=1e-4)
    assert abs(orbit.multipliers[0]) == pytest.approx(exp(2.0 * pi / omega), rel=0.1)


@pytest.mark.parametrize(("r", "periods"), [(3.0, [1, 1]), (3.0 + 1e-7, [1, 1, 2]), (1.0 + 6.0**0.5, [1, 1, 2])])
def test_orbits_at_a_period_doubling_are_found_once(r, periods):
    """At 3 and 1 + sqrt 6 the logistic map doubles a period: P^2 - x, and P^4 - x, have a triple zero there."""
    logistic = discrete_map(lambda x, p: (p.r * x[0] * (1.0 - x[0]),), {"r": r}, ("x",))
    found = find_periodic_orbits(logistic, CellGrid((-0.21,), (1.2,), (300,)), longest_period=4)
    assert [o.period for o in found] == periods
    # In the plane, at the period doubling a = 3 (1 - b)^2 / 4 of the Henon map.
    henon = discrete_map(lambda x, p: (1 - p.a * x[0] ** 2 + x[1], 0.3 * x[0]), {"a": 0.75 * 0.7**2}, ("x", "y"))
    found = find_periodic_orbits(henon, CellGrid((-3.0, -2.0), (3.0, 2.0), (60, 60)), longest_period=2)
    assert [o.period for o in found] == [1, 1]


def test_the_equations_of_orbits_along_a_branch_of_henons_map():
    """Born at a = -(1 - b)^2/4, where it folds; doubled at 3 (1 - b)^2/4, from where a branch of period two goes."""
    b, henon = 0.3, henon_map(0.2, 0.3)
    branch = continue_orbit(henon, periodic_orbit(henon, [0.5, 0.2]), "a", -0.2, 0.6, step=0.1, max_points=40)
    near = np.abs(branch.points[:, 0]) < 10.0
    a, x = branch.values[near], branch.points[near, 0]
    assert 1 - a * x * x + b * x == pytest.approx(x, abs=1e-10)
    roots = np.sort_complex([np.roots([1.0, 2 * q * y, -b]) for q, y in zip(a, x, strict=True)])
    assert np.sort_complex(branch.multipliers[near]) == pytest.approx(roots, abs=1e-8)
    assert [found.value for found in branch.bifurcations] == pytest.approx([-0.1225, 0.3675], abs=1e-10)
    doubled = switch_branch(branch, branch.bifurcations[-1], 0.3, 0.9)
    orbit = doubled.orbits_at(0.8)[0]
    assert np.linalg.det(orbit.matrix) == pytest.approx(b**2)
    assert orbit.points.sum(axis=0)[0] == pytest.approx((1 - b) / 0.8)  # the sum of both points is (1 - b)/a


def test_a_point_on_the_branch_cut_of_an_angle_is_on_its_lower_side():
    """Newton's method comes to pi from below or to -pi from above; the fixed point of u + sin(u) / 2 is one of them."""
    swinging = discrete_map(lambda x, p: (x[0] + 0.5 * sin(x[0]),), {}, (angle("u"),))
    places = [periodic_orbit(swinging, [guess]).points[0, 0] for guess in (3.0, 3.1, -3.1, -3.0)]
    assert places == pytest.approx([-pi] * 4, abs=1e-13)


@pytest.mark.parametrize(
    ("kind", "period", "name"),
    [
        (Kind.EQUILIBRIA, 1, "equilibria around (0.5)"),
        (Kind.CONTINUUM, 1, "continuum of fixed points around (0.5)"),
        (Kind.CONTINUUM, 3, "continuum of cycles of period 3 around (0.5)"),
        (Kind.QUASIPERIODIC, 0, "quasi-periodic"),
        (Kind.CHAOTIC, 0, "chaotic"),
    ],
)
def test_names_of_attractors(kind, period, name):
    points, none = np.array([[0.0], [0.5], [1.0]]), np.zeros(1)
    coordinates = discrete_map(lambda x, p: x, {}, ("x",)).coordinates
    assert Attractor(kind, period, points, (0,), none.astype(complex), none, coordinates).name == name
