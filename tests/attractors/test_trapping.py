"""Neighbourhoods of attractors: every orbit from inside them goes to that attractor."""

from math import exp, pi, sqrt, tanh

import numpy as np
import pytest
from small_maps import distance, grid_of, points_inside

import systems
from cellmap import (
    Attractor,
    CellGrid,
    ForcedSystem,
    PointMap,
    discrete_map,
    find_attractors,
    find_basins,
    stroboscopic_map,
)
from cellmap.attractors.regions.trapping import trapping_neighbourhood
from cellmap.maps.coordinates import difference
from cellmap.orbits import Kind
from cellmap.orbits.newton import stable_orbit

LIMITS = {
    "pendulum, 3 mm": (systems.driven_pendulum(), ((-pi, -500.0), (pi, 500.0))),
    "vertically driven": (systems.dimensionless_pendulum(0.5, 0.1, 0.03), ((-pi, -4.0), (pi, 4.0))),
    "Duffing": (systems.two_well_duffing(), ((-2.2, -2.2), (2.2, 2.2))),
}


@pytest.fixture(scope="module", params=LIMITS)
def case(request) -> tuple[ForcedSystem, PointMap, np.ndarray, tuple[Attractor, ...]]:
    """A system, its map, the window, and the attractors that are found from it."""
    system, window = LIMITS[request.param]
    exact = stroboscopic_map(system)
    return system, exact, np.array(window), find_attractors(exact, grid_of(*window, 24))


def test_attractors_are_stable_periodic_orbits_in_neighbourhoods_of_some_size(case):
    _, exact, window, found = case
    for a in found:
        moved = exact.iterate(a.points, a.period).unwrapped - a.points
        assert moved == pytest.approx(np.broadcast_to(np.multiply(a.rotations, [2 * pi, 0.0]), moved.shape), abs=1e-6)
        step = exact(a.points)
        assert difference(step, np.roll(a.points, -1, axis=0), exact.coordinates) == pytest.approx(0.0, abs=1e-6)
        assert (np.abs(a.multipliers) < 1).all()
        assert a.neighbourhood.centres == pytest.approx(a.points)
        assert a.neighbourhood.contraction < 1
        assert 1 / np.sqrt(np.linalg.eigvalsh(a.neighbourhood.metrics)).max() > 1e-6
    points = np.concatenate([a.points for a in found])
    apart = np.abs(difference(points[:, None], points[None], exact.coordinates) / np.ptp(window, axis=0)).max(axis=-1)
    np.fill_diagonal(apart, 1.0)
    assert apart.min() > 1e-4  # none is found twice


def test_one_period_shortens_the_distance(case):
    """At random places, none of which the verification has seen, and of which none is in two neighbourhoods."""
    _, exact, _, found = case
    for a in found:
        inside = points_inside(a, 2000)
        before, after = distance(a, inside), distance(a, exact.iterate(inside, a.period).points)
        assert before.max() <= 1
        assert (after / before).max() < 1
        some = inside[:, :400].reshape(-1, exact.dimension)
        for b in (b for b in found if b is not a):
            assert distance(b, np.broadcast_to(some, (b.period, *some.shape))).min() > 1


# --- searches find the same ones, whatever the initial conditions


def assert_same(found, again) -> None:
    """The same points in the same cyclic order; which of them comes first may depend on the window."""
    assert [(a.kind, a.period, a.rotations) for a in again] == [(a.kind, a.period, a.rotations) for a in found]
    for a, b in zip(found, again, strict=True):
        assert any(np.roll(b.points, k, axis=0) == pytest.approx(a.points, abs=1e-8) for k in range(a.period))


def test_mirror_images_stand_side_by_side(case):
    """(theta, v) -> (-theta, -v) maps the vertically driven pendulums to themselves."""
    _, exact, _, found = case
    if exact.name not in ("driven pendulum", "dimensionless pendulum"):
        return
    rotating = [a for a in found if a.kind is Kind.ROTATING]
    assert len(rotating) % 2 == 0
    for plus, minus in zip(rotating[::2], rotating[1::2], strict=True):
        assert plus.rotations[0] == -minus.rotations[0] > 0
        apart = np.abs(difference(plus.points[:, None], -minus.points[None], exact.coordinates)).max(axis=-1)
        assert apart.min(axis=1) == pytest.approx(0.0, abs=1e-8)


def test_order_of_initial_conditions_does_not_matter(case):
    _, exact, window, found = case
    shuffled = np.random.default_rng(0).permutation(grid_of(*window, 24).reshape(-1, 2))
    assert_same(found, find_attractors(exact, shuffled))


# --- exact results


def cubic(a: float) -> PointMap:
    """x' = a x + x^3: the basin of 0 ends at sqrt(1 - a)."""
    return discrete_map(_cubic, {"a": a}, ("x",))


def _cubic(x, p):
    return (p.a * x[0] + x[0] ** 3,)


@pytest.mark.parametrize("a", [-0.99, -0.9, -0.3, 0.0, 0.5, 0.9, 0.99, 0.999, 0.9994, 0.99999])
def test_neighbourhood_stays_in_the_basin_of_a_cubic_map(a):
    """It ends where abs(a) + x^2 reaches what is allowed, (3 + abs(a))/4, or a quarter of the window before."""
    extent = np.array([4.0])
    attractor = stable_orbit(cubic(a), np.zeros(1), 1, extent)
    n = trapping_neighbourhood(cubic(a), attractor, extent)
    assert n is not None
    radius = 1 / sqrt(n.metrics[0, 0, 0])
    if a >= 0:
        largest = sqrt(0.75 * (1 - a))
        assert 0.7 * largest < radius <= largest
    else:
        assert radius < sqrt(1 - a)
    assert n.contraction < 1


@pytest.mark.parametrize("a", [0.9, 0.9994])
def test_neighbourhood_of_a_slow_node_in_the_plane(a):
    """The slow direction shrinks by 0.06 % a step, the other one by half."""
    slow = discrete_map(lambda x, p: (p.a * x[0] + 0.3 * x[0] ** 3 + x[1], 0.5 * x[1]), {"a": a}, ("x", "y"))
    extent = np.array([4.0, 4.0])
    attractor = stable_orbit(slow, np.zeros(2), 1, extent)
    n = trapping_neighbourhood(slow, attractor, extent)
    assert n is not None
    initial_conditions = points_inside(with_neighbourhood(attractor, n), 100)[0]
    ends = slow.iterate(initial_conditions, int(20 / (1 - a))).points
    assert np.abs(ends).max() < 1e-3


FLIPS = {
    # x' = -0.99 x + x^2: the quadratic terms of two consecutive periods cancel; the boundary is at 1.99.
    "straightened": (lambda x, p: (-0.99 * x[0] + x[0] ** 2,), 0.5, 1.99),
    # x' = -0.99 x - x^3: a repelling cycle of two at +-0.1.
    "bent": (lambda x, p: (-0.99 * x[0] - x[0] ** 3,), 0.05, 0.1),
}


@pytest.mark.parametrize("name", FLIPS)
def test_neighbourhood_close_to_a_flip(name):
    """The multiplier is 0.01 short of -1, and a square of at most 0.0075 is allowed; two periods have none."""
    function, least, boundary = FLIPS[name]
    flip, extent = discrete_map(function, {}, ("x",)), np.array([4.0])
    attractor = stable_orbit(flip, np.zeros(1), 1, extent)
    n = trapping_neighbourhood(flip, attractor, extent)
    assert least < 1 / sqrt(n.metrics[0, 0, 0]) < boundary
    inside = points_inside(with_neighbourhood(attractor, n), 1000)[0]
    assert (np.abs(flip.iterate(inside, 2).points) < np.abs(inside)).all()
    assert 0.99 < n.contraction < 1


@pytest.mark.parametrize("dimension", [1, 2, 3, 4])
def test_shear_is_taken_into_account(dimension):
    """x_j' = 0.8 x_j + 5 x_(j+1): lengths grow for a while, though every orbit ends at 0."""
    shear = discrete_map(_sheared, {}, tuple("abcd"[:dimension]))
    extent = np.full(dimension, 2.0)
    attractor = stable_orbit(shear, np.zeros(dimension), 1, extent)
    n = trapping_neighbourhood(shear, attractor, extent)
    a = with_neighbourhood(attractor, n)
    inside = points_inside(a, 4000)
    assert (distance(a, shear(inside)) < distance(a, inside)).all()
    half_widths = np.sqrt(np.diagonal(np.linalg.inv(n.metrics[0])))
    assert (half_widths <= extent / 4 * (1 + 1e-12)).all()


def _sheared(x, p):
    return tuple(0.8 * a + 5.0 * b for a, b in zip(x, (*x[1:], 0.0), strict=True))


def with_neighbourhood(attractor: Attractor, neighbourhood) -> Attractor:
    return Attractor(
        attractor.kind,
        attractor.period,
        attractor.points,
        attractor.rotations,
        attractor.multipliers,
        attractor.exponents,
        attractor.coordinates,
        neighbourhood,
    )


# --- structure much smaller than the window


@pytest.mark.parametrize("half_width", [1.0, 10.0, 100.0, 1e3, 1e6])
def test_neighbourhood_ends_at_the_boundary_however_wide_the_window(half_width):
    """x' = tanh 2x has attractors at +-0.9575 and its boundary at 0."""
    two = discrete_map(lambda x, p: (tanh(2 * x[0]),), {}, ("x",))
    extent = np.array([2 * half_width])
    attractor = stable_orbit(two, two.iterate([0.5], 200).points, 1, extent)
    n = trapping_neighbourhood(two, attractor, extent)
    assert 1 / sqrt(n.metrics[0, 0, 0]) < attractor.points[0, 0]


@pytest.mark.parametrize("width", [0.04, 0.02, 0.01])
def test_hole_in_the_neighbourhood_is_seen(width):
    """x' = x/2 near 0, but a hill of some percent of the window at 0.325 throws orbits over to the attractor at 2."""

    def hill(x, p):
        push = 3.0 * exp(-(((x[0] - 0.325) / p.width) ** 2))
        return (0.5 * x[0] + push + 1.0 / (1.0 + exp(-40.0 * (x[0] - 1.0))),)

    two = discrete_map(hill, {"width": width}, ("x",))
    for a in find_attractors(two, np.linspace(-1, 3, 100)[:, None]):
        inside = points_inside(a, 4000).reshape(-1, 1)
        assert np.abs(two.iterate(inside, 200).points - a.points[0]).max() < 1e-6


def test_a_superstable_cycle() -> None:
    # x -> -1.5 x + 0.5 x^3 has the cycle 1 -> -1 -> 1 through both of its critical points.
    exact = discrete_map(lambda x, p: (-1.5 * x[0] + 0.5 * x[0] ** 3,), {}, ("x",))
    basins = find_basins(exact, CellGrid((-2.4,), (2.4,), (97,)))
    assert [a.period for a in basins.attractors] == [2]
    assert basins.verify(200).wrong == 0


# --- many dimensions, from Lyapunov functions and few images


D = 6
RATES = np.array([0.9, 0.8, -0.7, 0.6, 0.5, 0.4])
AXES = np.eye(D) - np.full((D, D), 2.0 / D)  # a mirror


def cubic_step(x, p):
    """Return y -> a y + b y^3 for each coordinate y along the axes: |y| < sqrt((1 - |a|) / b) is the basin of 0."""
    mean = sum(x) / D
    y = [v - 2.0 * mean for v in x]
    z = [a * v + (p.b if a > 0 else -p.b) * v * v * v for a, v in zip(RATES.tolist(), y, strict=True)]
    mean = sum(z) / D
    return tuple(v - 2.0 * mean for v in z)


def test_the_region_lies_in_the_basin_that_is_known_exactly():
    six = discrete_map(cubic_step, {"b": 1.0}, tuple(f"x{i}" for i in range(D)))
    (origin,) = find_attractors(six, np.random.default_rng(2).uniform(-0.3, 0.3, (8, D)) @ AXES)
    region = origin.neighbourhood
    assert origin.verified and 0.9 < region.contraction < 1.0
    # The farthest points of the ellipsoid along the axes, against the borders of the basin.
    reach = np.sqrt(np.diag(AXES @ np.linalg.inv(region.metrics[0]) @ AXES.T))
    border = np.sqrt(1.0 - np.abs(RATES))
    assert (reach < border).all()
    assert (reach / border).max() > 0.1


def test_orbits_from_the_whole_region_of_a_cycle_come_to_it():
    """Beyond its period-doubling at a = -1 the first coordinate has the cycle y = +-sqrt(-1 - a) of y -> a y + y^3."""

    def step(x, p):
        return (-1.2 * x[0] + x[0] * x[0] * x[0], *(0.5 * x[i] + 0.3 * x[i - 1] * x[i - 1] for i in range(1, D)))

    cycles = find_attractors(
        discrete_map(step, {"b": 1.0}, tuple(f"x{i}" for i in range(D))),
        np.random.default_rng(3).uniform(-0.3, 0.3, (64, D)),
    )
    (cycle,) = cycles
    assert cycle.period == 2 and cycle.verified
    assert np.abs(cycle.points[:, 0]) == pytest.approx(np.sqrt(0.2), rel=1e-9)
    roots = np.linalg.cholesky(np.linalg.inv(cycle.neighbourhood.metrics))
    sphere = np.random.default_rng(4).standard_normal((2, 512, D))
    points = cycle.points[:, None] + np.einsum(
        "pij,pnj->pni", roots, sphere / np.linalg.norm(sphere, axis=-1, keepdims=True)
    )
    for _ in range(200):
        points = np.stack(step(points.T, None), axis=0).T
    apart = np.abs(points - cycle.points[:, None]).max(axis=-1)
    assert apart.max() < 1e-9
