"""Neighbourhoods of attractors: every orbit from inside them goes to that attractor."""

from __future__ import annotations

from dataclasses import replace
from math import exp, pi, sqrt, tanh

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import systems
from cellmap import (
    Attractor,
    CellGrid,
    ForcedSystem,
    PointMap,
    angle,
    discrete_map,
    find_attractors,
    find_basins,
    interpolated_map,
    stroboscopic_map,
)
from cellmap._compiled.codegen.rebind import rebind
from cellmap.attractors import continue_attractors
from cellmap.attractors.continued import orbits_followed
from cellmap.attractors.trapping import _COARSE_AHEAD, extent_of_motion, still_trapping, trapping_neighbourhood
from cellmap.maps import side_by_side
from cellmap.maps.coordinates import difference
from cellmap.orbits.newton import stable_orbit

CASES = {
    "pendulum, 2 mm": (systems.driven_pendulum(amplitude=0.002), ((-pi, -100.0), (pi, 100.0))),
    "pendulum, 3 mm": (systems.driven_pendulum(), ((-pi, -500.0), (pi, 500.0))),
    "pendulum, 10 mm": (systems.driven_pendulum(amplitude=0.010), ((-pi, -500.0), (pi, 500.0))),
    "Duffing": (systems.two_well_duffing(), ((-2.2, -2.2), (2.2, 2.2))),
    "forced pendulum": (systems.forced_pendulum(), ((-pi, -4.0), (pi, 4.0))),
    "vertically driven": (systems.dimensionless_pendulum(0.5, 0.1, 0.03), ((-pi, -4.0), (pi, 4.0))),
    "inverted": (systems.dimensionless_pendulum(-0.1, 0.545, 0.2), ((-pi, -4.0), (pi, 4.0))),
    "lightly damped": (systems.dimensionless_pendulum(0.1, 0.3, 0.01), ((-pi, -2.0), (pi, 2.0))),
}


@pytest.fixture(scope="module", params=CASES)
def case(request) -> tuple[ForcedSystem, PointMap, tuple[Attractor, ...]]:
    system, window = CASES[request.param]
    exact = stroboscopic_map(system)
    return system, exact, find_attractors(exact, CellGrid(*window, (40, 40)).centres())


def points_inside(a: Attractor, number: int, seed: int = 0) -> np.ndarray:
    """Random points of every ellipsoid, shape (period, number, dimension), half of them close to its surface."""
    n = a.neighbourhood
    rng = np.random.default_rng(seed)
    d = n.centres.shape[1]
    directions = rng.standard_normal((len(n.centres), number, d))
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    radius = np.where(np.arange(number) % 2, 1.0 - 1e-9, rng.uniform(0, 1, number) ** (1 / d))
    roots = np.linalg.cholesky(np.linalg.inv(n.metrics))
    return n.centres[:, None] + np.einsum("qij,qnj->qni", roots, radius[:, None] * directions)


def distance(a: Attractor, points: np.ndarray) -> np.ndarray:
    """Distance to the centre of each point's own ellipsoid, in its metric; points (period, number, dimension)."""
    shift = difference(points, a.neighbourhood.centres[:, None], a.coordinates)
    return np.sqrt(np.einsum("qni,qij,qnj->qn", shift, a.neighbourhood.metrics, shift))


def distance_to_orbit(a: Attractor, points: np.ndarray, extent: np.ndarray) -> np.ndarray:
    return np.abs(difference(points[:, None], a.points, a.coordinates) / extent).max(axis=-1).min(axis=-1)


def test_every_attractor_has_a_neighbourhood_of_some_size(case):
    for a in case[2]:
        assert a.neighbourhood.centres == pytest.approx(a.points)
        assert a.neighbourhood.contraction < 1
        half_widths = 1 / np.sqrt(np.linalg.eigvalsh(a.neighbourhood.metrics))
        assert half_widths.min() > 1e-6


def test_one_period_shortens_the_distance(case):
    """At random places, none of which the verification has seen."""
    _, exact, found = case
    for a in found:
        inside = points_inside(a, 4000)
        before, after = distance(a, inside), distance(a, exact.iterate(inside, a.period).points)
        assert before.max() <= 1
        assert (after / before).max() < 1


def test_neighbourhoods_of_different_attractors_have_no_common_point(case):
    _, exact, found = case
    for a in found:
        inside = points_inside(a, 400).reshape(-1, exact.dimension)
        for b in found:
            if b is not a:
                apart = distance(b, np.broadcast_to(inside, (b.period, *inside.shape)))
                assert apart.min() > 1


def test_orbits_from_inside_converge_under_scipy(case):
    """SciPy's DOP853 on the plain right-hand side, all orbits as one system; convergence to 1e-3 of the window."""
    system, _, found = case
    for a in found:
        extent = np.ptp(points_inside(a, 50).reshape(-1, 2), axis=0)
        initial_conditions = points_inside(a, max(12 // a.period, 4), seed=1).reshape(-1, 2)
        rate = -np.log(np.abs(a.multipliers[0])) / a.period
        periods = a.period * int(np.ceil(min(np.log(1e3) / rate, 120) / a.period))
        ends = stacked_images(system, initial_conditions, periods)
        expected = max(10 * np.exp(-rate * periods), 1e-5)
        assert distance_to_orbit(a, ends, extent).max() < expected


def stacked_images(system: ForcedSystem, initial_conditions: np.ndarray, periods: int) -> np.ndarray:
    rhs, p, shape = rebind(system.rhs, {"sin": np.sin, "cos": np.cos}), system.parameters, initial_conditions.T.shape

    def fun(t, y):
        return np.concatenate(rhs(t, tuple(y.reshape(shape)), p))

    span = (0.0, periods * system.length)
    solution = solve_ivp(fun, span, initial_conditions.T.ravel(), "DOP853", rtol=1e-8, atol=1e-8, t_eval=span[1:])
    assert solution.success
    return solution.y[:, -1].reshape(shape).T


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


def test_surfaces_of_a_line_are_looked_at_by_the_hundred(monkeypatch):
    """They are 1 % apart and have two points each: some hundred lie between the first and the last."""
    monkeypatch.setattr(side_by_side, "thread_count", lambda: 1)  # several would share a batch that takes long
    sizes, exact = [], cubic(0.5)

    def counted(orbits, periods):
        sizes.append(len(orbits) // 2)
        exact.advance(orbits, periods)

    extent = np.array([4.0])
    attractor = stable_orbit(exact, np.zeros(1), 1, extent)
    assert trapping_neighbourhood(replace(exact, advance=counted), attractor, extent) is not None
    grown = [size for size in sizes if size > _COARSE_AHEAD]
    assert sum(grown) > 200
    assert len(grown) <= 4


@pytest.mark.parametrize("a", [0.9, 0.99, 0.9994])
def test_neighbourhood_of_a_slow_node_in_the_plane(a):
    """The slow direction shrinks by 0.06 % a step, the other one by half."""
    slow = discrete_map(lambda x, p: (p.a * x[0] + 0.3 * x[0] ** 3 + x[1], 0.5 * x[1]), {"a": a}, ("x", "y"))
    extent = np.array([4.0, 4.0])
    attractor = stable_orbit(slow, np.zeros(2), 1, extent)
    n = trapping_neighbourhood(slow, attractor, extent)
    assert n is not None
    initial_conditions = points_inside(with_neighbourhood(attractor, n), 1000)[0]
    ends = slow.iterate(initial_conditions, int(20 / (1 - a))).points
    assert np.abs(ends).max() < 1e-3


def test_neighbourhood_of_a_slow_node_is_wide_along_the_slow_direction():
    """x' = 0.997 x + 0.3 x y: of the parabola y = 2 x^2 that orbits come in on, a metric that weighs slow and fast
    displacements alike holds four times as much as the sum of all later squares, which is narrow along it."""
    slow = discrete_map(lambda x, p: (0.997 * x[0] + 0.3 * x[0] * x[1], 0.5 * x[1] + x[0] ** 2), {}, ("x", "y"))
    extent = np.array([2.0, 2.0])
    n = trapping_neighbourhood(slow, stable_orbit(slow, np.zeros(2), 1, extent), extent)
    assert 1 / sqrt(n.metrics[0, 0, 0]) > 0.03


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


@pytest.mark.parametrize(("a", "period"), [(1.04, 8), (1.054, 16), (1.24, 7)])
def test_surfaces_that_a_long_cycle_of_henons_map_costs(a, period):
    """Only two of its ellipsoids grow: some thirty surfaces a point, a cycle each, where all would take seventy."""
    henon = discrete_map(lambda x, p: (1 - p.a * x[0] ** 2 + x[1], 0.3 * x[0]), {"a": a}, ("x", "y"))
    attractor = stable_orbit(henon, henon.iterate([0.0, 0.0], 20_000).points, period, np.ones(2))
    assert attractor.period == period
    steps = 0

    def advance(orbits, periods):
        nonlocal steps
        steps += len(orbits) * periods
        henon.advance(orbits, periods)

    n = trapping_neighbourhood(replace(henon, advance=advance), attractor, np.ones(2))
    assert len(n.metrics) == period
    assert steps / (96 * period) < 40 * period


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


def test_linear_contraction_takes_a_quarter_of_the_window():
    halves = discrete_map(lambda x, p: (0.5 * x[0], 0.5 * x[1]), {}, ("x", "y"))
    extent = np.array([4.0, 8.0])
    n = trapping_neighbourhood(halves, stable_orbit(halves, np.zeros(2), 1, extent), extent)
    assert n.metrics[0] == pytest.approx(np.diag([1.0, 0.25]), rel=1e-9)
    assert n.contraction == pytest.approx(0.5, abs=0.01)


# --- structure much smaller than the window


@pytest.mark.parametrize("half_width", [1.0, 10.0, 100.0, 1e3, 1e6])
def test_neighbourhood_ends_at_the_boundary_however_wide_the_window(half_width):
    """x' = tanh 2x has attractors at +-0.9575 and its boundary at 0."""
    two = discrete_map(lambda x, p: (tanh(2 * x[0]),), {}, ("x",))
    extent = np.array([2 * half_width])
    attractor = stable_orbit(two, two.iterate([0.5], 200).points, 1, extent)
    n = trapping_neighbourhood(two, attractor, extent)
    assert 1 / sqrt(n.metrics[0, 0, 0]) < attractor.points[0, 0]


@pytest.mark.parametrize("half_width", [20.0, 200.0])
def test_neighbourhoods_in_a_wide_window(half_width):
    """Strongly damped, the two wells at -1 and 1 swallow far orbits within one period."""
    system = systems.two_well_duffing(damping=3.0)
    exact = stroboscopic_map(system)
    found = find_attractors(exact, CellGrid((-half_width,) * 2, (half_width,) * 2, (20, 20)).centres())
    for a in found:
        inside = points_inside(a, 2000).reshape(-1, 2)
        ends = exact.iterate(inside, 60).points
        assert distance_to_orbit(a, ends, np.ones(2)).max() < 1e-3


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


SLICED = {
    "pendulum": (systems.driven_pendulum, ((-pi, -400.0), (pi, 400.0)), (24, 24), (-pi, -1e-3), (pi, 1e-3)),
    "tiny window": (systems.two_well_duffing, ((-2.0, -2.0), (2.0, 2.0)), (24, 24), (0.1, 0.1), (0.101,) * 2),
    "double pendulum": (
        systems.double_pendulum,
        ((-pi, -pi, -200.0, -200.0), (pi, pi, 200.0, 200.0)),
        (3, 3, 3, 3),
        (-pi, -pi, -1e-3, -1e-3),
        (pi, pi, 1e-3, 1e-3),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", SLICED)
def test_regions_of_a_slice_are_those_of_the_whole_window(name):
    """In coordinates that a slice fixes the extent is that of the motion; continued attractors have theirs alike."""
    make, window, cells, lower, upper = SLICED[name]
    exact = stroboscopic_map(make())
    d = exact.dimension
    whole = find_attractors(exact, CellGrid(*window, cells).centres().reshape(-1, d))
    grid = CellGrid(lower, upper, tuple(8 if high - low > 1.0 else 1 for low, high in zip(lower, upper, strict=True)))
    basins = find_basins(exact, grid)
    extent = np.where(np.subtract(upper, lower) > 1.0, np.subtract(upper, lower), 1.0)
    ends = exact.iterate(grid.centres().reshape(-1, d), 400).points
    for k, a in enumerate(basins.attractors):
        inverse = [np.linalg.inv(b.neighbourhood.metrics) for b in (a, *continue_attractors(exact, [a], extent))]
        (same,) = (b for b in whole if distance_to_orbit(a, b.points, np.ones(d)).max() < 1e-6)
        full = np.linalg.det(np.linalg.inv(same.neighbourhood.metrics)).max() ** (0.5 / d)
        assert min(np.linalg.det(i).max() ** (0.5 / d) for i in inverse) > 0.7 * full
        assert distance_to_orbit(a, ends[basins.labels.ravel() == k], np.ones(d)).max() < 1e-3


def test_extent_of_motion_leaves_out_orbits_that_end_and_angles():
    """x -> x^2 from (0.5, 3): half of the orbits end; y -> 0.5 y + 10 goes from 0 to 20, an angle round and round."""
    away = discrete_map(lambda x, p: (x[0] ** 2, 0.5 * x[1] + 10.0, x[2] + 2.0), {}, ("x", "y", angle("a")))
    states = np.stack([np.linspace(0.5, 3.0, 64), np.zeros(64), np.zeros(64)], axis=-1)
    extent = extent_of_motion(away, states, np.array([2.5, 1.0, 2 * pi]))
    assert extent == pytest.approx([2.5, 4 * 20.0 - 3.0, 2 * pi], rel=1e-6)
    window = CellGrid((0.0, -1.0, -pi), (0.9, 30.0, pi), (8, 8, 8))
    assert extent_of_motion(interpolated_map(away, window), states, np.ones(3)).tolist() == [1.0, 1.0, 1.0]


def test_regions_of_other_parameters_once_they_are_verified() -> None:
    """Those of an attractor, moved with it, are about as wide as those of a new search, and as safe."""
    system = systems.driven_pendulum(amplitude=0.003)
    window = CellGrid((-pi, -500.0), (pi, 500.0), (6, 6))
    before, extent = stroboscopic_map(system), np.array([2 * pi, 1000.0])
    known = find_attractors(before, window.centres().reshape(-1, 2))
    after = stroboscopic_map(system.with_params(amplitude=0.0031))
    followed = orbits_followed(after, known, extent)
    assert len(followed) == len(known) == 4
    for orbit in followed.values():
        region = still_trapping(after, orbit, extent, orbit.neighbourhood)
        sought = trapping_neighbourhood(after, orbit, extent)
        assert region is not None and sought is not None
        sizes = [np.linalg.det(n.metrics[0]) ** -0.25 for n in (region, sought)]
        assert 0.7 < sizes[0] / sizes[1] < 1.2
        mine = with_neighbourhood(orbit, region)
        points = points_inside(mine, 200)
        assert (distance(mine, after(points)) <= region.contraction * distance(mine, points) + 1e-9).all()


@pytest.mark.parametrize("a", [0.3, 0.9])
def test_regions_that_were_too_wide_or_of_another_attractor_are_not_taken(a: float) -> None:
    """The basin of 0 under x -> a x + x^3 ends at sqrt(1 - a) (see `cubic`)."""
    exact, extent = cubic(a), np.array([4.0])
    (attractor,) = find_attractors(exact, [[0.1]])
    region = attractor.neighbourhood
    again = still_trapping(exact, attractor, extent, region)
    assert again is not None
    assert again.metrics[0, 0, 0] == pytest.approx(region.metrics[0, 0, 0], rel=0.05)
    wider = replace(region, metrics=region.metrics / 9.0)
    found = still_trapping(exact, attractor, extent, wider)
    assert found is None or found.metrics[0, 0, 0] ** -0.5 < sqrt(1.0 - a)
    two = replace(region, centres=np.zeros((2, 1)), metrics=np.ones((2, 1, 1)))
    assert still_trapping(exact, attractor, extent, two) is None
