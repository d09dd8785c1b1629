"""Searches find no attractor twice and none unstable, and the same ones whatever the initial conditions."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest
from small_maps import CIRCLE, LINE, _logistic, circle, grid_of, r

import systems
from cellmap import CellGrid, discrete_map, find_attractors, interpolated_map, stroboscopic_map
from cellmap._compiled.codegen.captured import captured
from cellmap.maps.coordinates import difference
from cellmap.orbits import Kind


def same_orbit(a: np.ndarray, b: np.ndarray) -> bool:
    """The same points in the same cyclic order; which of them comes first may depend on the window."""
    return any(np.roll(b, k, axis=0) == pytest.approx(a, abs=1e-8) for k in range(len(a)))


SEARCHES = {
    "pendulum, 3 mm": (systems.driven_pendulum(), ((-pi, -500.0), (pi, 500.0))),
    "pendulum, 10 mm": (systems.driven_pendulum(amplitude=0.010), ((-pi, -500.0), (pi, 500.0))),
    "Duffing": (systems.two_well_duffing(), ((-2.2, -2.2), (2.2, 2.2))),
    "vertically driven": (systems.dimensionless_pendulum(0.5, 0.1, 0.03), ((-pi, -4.0), (pi, 4.0))),
    # Light damping: many resonances, slow convergence.
    "lightly damped": (systems.dimensionless_pendulum(0.1, 0.3, 0.01), ((-pi, -2.0), (pi, 2.0))),
    "forced pendulum": (systems.forced_pendulum(), ((-pi, -4.0), (pi, 4.0))),
}


@pytest.fixture(scope="module", params=SEARCHES)
def search(request):
    system, window = SEARCHES[request.param]
    exact = stroboscopic_map(system)
    initial_conditions = grid_of(*window, 24)
    return exact, initial_conditions, window, find_attractors(exact, initial_conditions)


def test_no_attractor_is_found_twice(search):
    exact, _, window, found = search
    extent = np.subtract(window[1], window[0])
    points = np.concatenate([a.points for a in found])
    apart = np.abs(difference(points[:, None], points[None], exact.coordinates) / extent).max(axis=-1)
    np.fill_diagonal(apart, 1.0)
    assert apart.min() > 1e-4


def test_attractors_are_stable_periodic_orbits(search):
    exact, *_, found = search
    for a in found:
        moved = exact.iterate(a.points, a.period).unwrapped - a.points
        assert moved == pytest.approx(np.broadcast_to(np.multiply(a.rotations, [2 * pi, 0.0]), moved.shape), abs=1e-6)
        step = exact(a.points)
        assert difference(step, np.roll(a.points, -1, axis=0), exact.coordinates) == pytest.approx(0.0, abs=1e-6)
        assert (np.abs(a.multipliers) < 1).all()
        assert a.neighbourhood is not None


def test_mirror_images_stand_side_by_side(search):
    """(theta, v) -> (-theta, -v) maps the vertically driven pendulums to themselves."""
    exact, _, _, found = search
    if exact.name not in ("driven pendulum", "dimensionless pendulum"):
        return
    rotating = [a for a in found if a.kind is Kind.ROTATING]
    assert len(rotating) % 2 == 0
    for plus, minus in zip(rotating[::2], rotating[1::2], strict=True):
        assert plus.rotations[0] == -minus.rotations[0] > 0
        apart = np.abs(difference(plus.points[:, None], -minus.points[None], exact.coordinates)).max(axis=-1)
        assert apart.min(axis=1) == pytest.approx(0.0, abs=1e-8)


@pytest.mark.parametrize("seed", [0, 1])
def test_order_of_initial_conditions_does_not_matter(search, seed):
    exact, initial_conditions, _, found = search
    shuffled = np.random.default_rng(seed).permutation(initial_conditions.reshape(-1, 2))
    again = find_attractors(exact, shuffled)
    assert [(a.kind, a.period, a.rotations) for a in again] == [(a.kind, a.period, a.rotations) for a in found]
    for a, b in zip(found, again, strict=True):
        assert same_orbit(a.points, b.points)


def test_interpolated_map_has_the_attractors_of_the_exact_one(search):
    exact, initial_conditions, window, found = search
    icm = interpolated_map(exact, CellGrid(*np.multiply(window, ([1.0, 1.2],) * 2), (256, 256)), outside="integrate")
    again = find_attractors(icm, initial_conditions)
    assert [(a.kind, a.period, a.rotations) for a in again] == [(a.kind, a.period, a.rotations) for a in found]
    for a, b in zip(found, again, strict=True):
        assert same_orbit(a.points, b.points)


def test_known_attractors_are_kept(search):
    exact, initial_conditions, _, found = search
    again = find_attractors(exact, initial_conditions.reshape(-1, 2)[:4], attractors=found)
    assert [a.name for a in again] == [a.name for a in found]


def test_map_without_attractors():
    assert find_attractors(discrete_map(lambda x, p: (2 * x[0],), {}, ("x",)), LINE) == ()
    assert find_attractors(discrete_map(lambda x, p: (1 - 2 * abs(x[0]) + 2.0,), {}, ("x",)), LINE) == ()


def test_irrational_rotation_is_an_attractor():
    """The whole circle."""
    (attractor,) = find_attractors(circle(0.381966, 0.5), CIRCLE, max_periods=300)
    assert attractor.kind is Kind.QUASIPERIODIC


@pytest.mark.parametrize("rate", [1.0, 1.5, 2.0 / 3.0])
def test_neutral_orbits_are_no_attractors(rate):
    """A rigid rotation by a rational angle: every point is periodic, none attracts."""
    assert find_attractors(circle(rate, 0.0), CIRCLE, max_periods=300) == ()


def test_globals_with_the_names_of_parameters_are_not_read():
    """`p.r` reads no global `r`: its value costs nothing and rebuilds nothing."""
    assert not set(r[2:]) & set(captured(_logistic))
