"""Interpolated cell maps: order of convergence, angles, windows, fallback cells, bad input."""

from __future__ import annotations

import json
import tracemalloc
from math import cos, exp, fabs, floor, pi, sin, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import systems
from cellmap import (
    CellGrid,
    PointMap,
    Status,
    angle,
    discrete_map,
    find_basins,
    interpolated_map,
    set_threads,
    stroboscopic_map,
)
from cellmap.maps import rebuild_map
from cellmap.maps.interpolation.interpolated import table_memory

ORDERS = (1, 3, 5)
COARSE = 1e6  # a tolerance that leaves no cell to the exact map


def circle(x, p):
    return (x[0] + 0.4 + 0.9 * sin(x[0]) + 0.2 * cos(2 * x[0]),)


def line(x, p):
    return (0.7 * sin(2 * x[0]) + 0.1 * x[0] ** 2,)


def torus(x, p):
    return x[0] + 0.5 * sin(x[1]), x[1] + 0.3 + 0.8 * sin(x[0]) * cos(x[1])


def cylinder(x, p):
    y = 0.8 * x[1] + 0.5 * sin(x[0])
    return x[0] + y, y


def plane(x, p):
    return 0.6 * x[0] + 0.3 * sin(x[1]), 0.5 * x[1] + 0.4 * cos(x[0] - x[1])


def tube(x, p):
    return x[0] + x[1] + 0.2 * sin(x[0]), 0.6 * x[1] + 0.3 * cos(x[0] + x[2]), 0.5 * sin(x[2] + x[1])


def coupled_standard_maps(x, p):
    """Two standard maps with a coupling (Froeschle 1972)."""
    a, b, u, v = x
    u = u + 0.3 * sin(a) + 0.1 * sin(a + b)
    v = v + 0.2 * sin(b) + 0.1 * sin(a + b)
    return a + u, b + v, u, v


# Function, coordinates, window, and for each order the cells of the coarsest table of a doubling sequence.
SMOOTH = {
    "circle": (circle, (angle("a"),), ((-pi,), (pi,)), {1: (64,), 3: (32,), 5: (24,)}),
    "line": (line, ("x",), ((-1.0,), (1.5,)), {1: (64,), 3: (32,), 5: (16,)}),
    "torus": (torus, (angle("a"), angle("b")), ((-pi, -pi), (pi, pi)), {1: (32, 32), 3: (24, 24), 5: (16, 16)}),
    "cylinder": (cylinder, (angle("a"), "v"), ((-pi, -1.0), (pi, 1.0)), {1: (32, 16), 3: (24, 16), 5: (16, 8)}),
    "plane": (plane, ("x", "y"), ((-1.0, -2.0), (1.0, 1.0)), {1: (24, 32), 3: (16, 24), 5: (8, 12)}),
    "tube": (tube, (angle("a"), "u", "v"), ((-pi, -1, -1), (pi, 1, 1)), {1: (24, 8, 8), 3: (16, 6, 6), 5: (16, 6, 6)}),
    "coupled standard maps": (
        coupled_standard_maps,
        (angle("a"), angle("b"), "u", "v"),
        ((-pi, -pi, -1.0, -1.0), (pi, pi, 1.0, 1.0)),
        {1: (12, 12, 4, 4), 3: (10, 10, 2, 2), 5: (10, 10, 1, 1)},
    ),
}


def exact_map(name: str) -> PointMap:
    function, coordinates, *_ = SMOOTH[name]
    return discrete_map(function, {}, coordinates)


def tabulated(name: str, shape: tuple[int, ...], order: int = 5, **options) -> PointMap:
    return interpolated_map(exact_map(name), CellGrid(*SMOOTH[name][2], shape), order, **options)


def errors_at(icm: PointMap, points: np.ndarray) -> np.ndarray:
    return np.abs(icm.iterate(points, 1).unwrapped - icm.exact.iterate(points, 1).unwrapped).max(axis=-1)


@pytest.fixture(scope="module")
def pendulum() -> PointMap:
    return stroboscopic_map(systems.driven_pendulum(), rtol=1e-12, atol=1e-12)


@pytest.fixture(scope="module")
def pendulum_table(pendulum) -> PointMap:
    return interpolated_map(pendulum, CellGrid((-pi, -100.0), (pi, 100.0), (64, 64)))


# --- order of convergence

LARGE = ("tube", "coupled standard maps")


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.slow) if n in LARGE else n for n in SMOOTH])
def test_order_of_convergence(name, order):
    """The error falls as h^(order + 1): slope of log(error) over three tables, each twice as fine."""
    coarsest = SMOOTH[name][3][order]
    levels = 2 if len(coarsest) == 4 else 3
    shapes = [tuple(n * 2**k for n in coarsest) for k in range(levels)]
    errors = [tabulated(name, shape, order, tolerance=COARSE).error(4000).percentile_99 for shape in shapes]
    slope = -np.polyfit(range(levels), np.log2(errors), 1)[0]
    assert errors[-1] > 1e-13, "the finest table is at the limit of rounding, where no order can be seen"
    assert slope == pytest.approx(order + 1, abs=0.35)


def test_pendulum_converges_with_order_six(pendulum):
    errors = []
    for n in (32, 64):
        grid = CellGrid((-pi, -100.0), (pi, 100.0), (n, n))
        errors.append(interpolated_map(pendulum, grid, tolerance=COARSE).error(4000).median)
    assert 5.5 < np.log2(errors[0] / errors[1]) < 7.0


def test_four_dimensional_table_is_accurate():
    """Order 5 on 20 x 20 x 2 x 2 cells: (h^6 / 720) max |f''''''| of the sines, with h = pi/10, is 3e-7."""
    icm = tabulated("coupled standard maps", (20, 20, 2, 2))
    assert icm.error(4000).largest < 3e-7
    assert not icm.table.rough.any()


# --- ends and branch cuts


@pytest.mark.parametrize("order", ORDERS)
def test_ends_of_an_interval_are_as_accurate_as_its_middle(order):
    """A displacement whose derivatives are the same everywhere in size: sin x over many turns."""
    exact = discrete_map(lambda x, p: (x[0] + sin(x[0]),), {}, ("x",))
    icm = interpolated_map(exact, CellGrid((0.0,), (20 * pi,), (400,)), order, tolerance=COARSE)
    places = np.linspace(0.0, 20 * pi, 40_001)[:, None]
    error = errors_at(icm, places)
    at_the_ends = max(error[:400].max(), error[-400:].max())  # four cells at each end
    assert at_the_ends <= 1.5 * error[4000:-4000].max()


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("lower", [-pi, 0.0, 1.0, -2.5])
def test_seam_is_as_accurate_as_the_rest_of_the_circle(order, lower):
    exact = discrete_map(lambda x, p: (x[0] + 2.0 + sin(12 * x[0]),), {}, (angle("a"),))
    icm = interpolated_map(exact, CellGrid((lower,), (lower + 2 * pi,), (240,)), order, tolerance=COARSE)
    everywhere = errors_at(icm, np.linspace(-pi, pi, 20_001)[:, None])
    for seam in (-pi, lower):
        near = np.linspace(seam - 0.05, seam + 0.05, 801)[:, None]
        assert errors_at(icm, near).max() <= 1.01 * everywhere.max()


@pytest.mark.parametrize("arc", [(-1.0, 1.0), (2.5, 4.5), (-4.0, -2.0), (-pi, 0.0), (0.0, pi)])
def test_partial_arc_of_an_angle(arc):
    """An arc may lie across the cut of the circle; what is outside of it escapes."""
    exact = exact_map("circle")
    icm = interpolated_map(exact, CellGrid((arc[0],), (arc[1],), (60,)), outside="escape")
    rotations = 2 * pi * np.arange(-2, 3)[:, None, None]
    inside = np.linspace(arc[0] + 1e-9, arc[1] - 1e-9, 501)[:, None] + rotations
    assert icm.iterate(inside, 1).points == pytest.approx(exact(inside), abs=1e-8)
    outside = np.linspace(arc[1] + 1e-6, arc[0] + 2 * pi - 1e-6, 101)[:, None] + rotations
    assert (icm.iterate(outside, 1).status == Status.ESCAPED).all()


@given(
    lower=st.floats(-20, 20),
    theta=st.floats(-50, 50),
    v=st.floats(-1, 1),
    rotations=st.integers(-3, 3),
)
def test_angles_wrap_whatever_the_cut_of_the_grid(lower, theta, v, rotations):
    icm = _cylinder_from(lower)
    image = icm.iterate([theta, v], 1)
    turned = icm.iterate([theta + 2 * pi * rotations, v], 1)
    exact = icm.exact.iterate([theta, v], 1)
    assert -pi <= image.points[0] < pi
    # At the cut of the angle two images may lie at both of its sides.
    for other in (turned, exact):
        shift = (image.points[0] - other.points[0] + pi) % (2 * pi) - pi
        assert shift == pytest.approx(0.0, abs=1e-7)
        assert image.points[1] == pytest.approx(other.points[1], abs=1e-7)


_CYLINDERS: dict[float, PointMap] = {}


def _cylinder_from(lower: float) -> PointMap:
    """An interpolation grid whose angle begins at one of a few places within one and a half periods."""
    place = round(lower * 0.4, 0) / 1.7
    if place not in _CYLINDERS:
        grid = CellGrid((place, -1.0), (place + 2 * pi, 1.0), (48, 24))
        _CYLINDERS[place] = interpolated_map(exact_map("cylinder"), grid)
    return _CYLINDERS[place]


def test_turns_are_counted():
    exact = discrete_map(lambda x, p: (x[0] + 2 * pi * p.rate + 0.1 * sin(x[0]),), {"rate": 2.6}, (angle("a"),))
    icm = interpolated_map(exact, CellGrid((-pi,), (pi,), (64,)))
    initial_conditions = np.linspace(-3, 3, 41)[:, None]
    ours, theirs = icm.iterate(initial_conditions, 50), exact.iterate(initial_conditions, 50)
    assert np.array_equal(ours.rotations, theirs.rotations)
    assert ours.unwrapped == pytest.approx(theirs.unwrapped, abs=1e-9)


# --- leaving the window


def test_orbits_that_leave_have_escaped_for_ever():
    exact = discrete_map(lambda x, p: (x[0] + 0.3, 0.5 * x[1]), {}, ("x", "y"))
    icm = interpolated_map(exact, CellGrid((0.0, -1.0), (1.0, 1.0), (20, 20)), outside="escape")
    orbit = icm.orbit([[0.05, 0.5], [0.95, 0.5], [2.0, 0.0], [0.5, 1.5]], 6)
    gone = np.array([[0] * 5 + [1] * 2, [0] * 2 + [1] * 5, [0] + [1] * 6, [0] + [1] * 6], bool).T
    assert np.array_equal(orbit.status == Status.ESCAPED, gone)
    assert np.array_equal(np.isnan(orbit.points).all(axis=-1), gone)
    assert np.array_equal(np.isnan(orbit.points).any(axis=-1), gone)
    assert orbit.points[:5, 0, 0] == pytest.approx(0.05 + 0.3 * np.arange(5), abs=1e-12)


def test_iterating_at_once_and_step_by_step_escape_alike():
    icm = tabulated("cylinder", (32, 16), outside="escape")
    initial_conditions = np.random.default_rng(2).uniform([-pi, -1], [pi, 1], (300, 2))
    at_once, orbit = icm.iterate(initial_conditions, 12), icm.orbit(initial_conditions, 12)
    assert 0 < np.count_nonzero(at_once.status == Status.ESCAPED) < 300
    assert np.array_equal(at_once.points, orbit.points[-1], equal_nan=True)
    assert np.array_equal(at_once.status, orbit.status[-1])


@pytest.mark.parametrize("name", SMOOTH)
def test_the_exact_map_carries_orbits_outside(name):
    lower, upper = map(np.array, SMOOTH[name][2])
    shape = tuple(2 * n for n in SMOOTH[name][3][5])
    icm = tabulated(name, shape, outside="integrate")
    middle, half = (lower + upper) / 2, (upper - lower) / 2
    initial_conditions = middle + half * np.random.default_rng(3).uniform(-3.0, 3.0, (200, len(half)))
    exact = icm.exact.iterate(initial_conditions, 4)
    image = icm.iterate(initial_conditions, 4)
    assert np.array_equal(image.status, exact.status)
    assert image.unwrapped == pytest.approx(exact.unwrapped, rel=1e-5, abs=1e-4)


def test_outside_images_are_the_exact_ones_to_the_bit(pendulum, pendulum_table):
    icm = interpolated_map(pendulum, pendulum_table.table.grid, outside="integrate")
    far = np.random.default_rng(4).uniform([-pi, 101.0], [pi, 400.0], (100, 2))
    assert np.array_equal(icm(far), pendulum(far))


def test_orbits_that_swing_out_and_return_agree_with_the_exact_map(pendulum):
    icm = interpolated_map(pendulum, CellGrid((-pi, -60.0), (pi, 60.0), (128, 128)), outside="integrate")
    initial_conditions = np.random.default_rng(5).uniform([-pi, -200], [pi, 200], (200, 2))
    exact, image = pendulum.iterate(initial_conditions, 15), icm.iterate(initial_conditions, 15)
    difference = np.abs(image.unwrapped - exact.unwrapped) / [1.0, 100.0]
    assert np.median(difference) < 1e-10
    assert difference.max() < 1e-6


# --- cells that a table cannot serve

ROUGH = {
    "kink": lambda x, p: (fabs(x[0] - 0.1234) - 0.5,),
    "jump": lambda x, p: (0.3 * floor(1.7 * x[0]) + 0.2 * x[0],),
    "root": lambda x, p: (0.3 * sqrt(fabs(x[0] - 0.4)),),
    "narrow hill": lambda x, p: (0.5 * x[0] + 0.4 * exp(-(((x[0] - 0.3) / 0.01) ** 2)),),
}
STEPS = {
    "kink": (0.1234,),
    "jump": (-1.0 / 1.7, 0.0, 1.0 / 1.7),
    "root": (0.4,),
    "narrow hill": (0.3,),
}


@pytest.mark.filterwarnings("ignore:.* of the cells are fallback cells:UserWarning")
@pytest.mark.parametrize("tolerance", [1e-3, 1e-6])
@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("name", ROUGH)
def test_rough_cells_are_found_and_left_to_the_exact_map(name, order, tolerance):
    exact = discrete_map(ROUGH[name], {}, ("x",))
    icm = interpolated_map(exact, CellGrid((-1.0,), (1.0,), (200,)), order, "integrate", tolerance)
    places = np.linspace(-1.0, 1.0, 20_003)[:, None]
    assert errors_at(icm, places).max() < 3 * tolerance
    cells = icm.table.grid.locate(np.array(STEPS[name])[:, None])
    if not (name == "kink" and order == 1 and tolerance == 1e-3):  # there a straight line is good enough
        assert (icm.table.rough[cells] | icm.table.rough[cells - 1]).all()  # a jump at a node is in the cell below


@pytest.mark.parametrize("order", ORDERS)
def test_smooth_cells_far_from_a_jump_stay_in_the_table(order):
    exact = discrete_map(ROUGH["jump"], {}, ("x",))
    icm = interpolated_map(exact, CellGrid((-1.0,), (1.0,), (400,)), order, tolerance=1e-6)
    distance = np.abs(icm.table.grid.axis(0)[:, None] - STEPS["jump"]).min(axis=1) / icm.table.grid.widths[0]
    assert not icm.table.rough[distance > 20].any()


def test_jump_along_a_circle_in_the_plane():
    """Cells that the circle crosses, away from their centres as well, have their exact images."""

    def disc(x, p):
        return 0.5 * x[0] + 0.3 * floor(1.5 * (x[0] ** 2 + x[1] ** 2)), 0.5 * x[1]

    exact = discrete_map(disc, {}, ("x", "y"))
    icm = interpolated_map(exact, CellGrid((-1.0, -1.0), (1.0, 1.0), (100, 100)), outside="integrate", tolerance=0.01)
    points = np.random.default_rng(6).uniform(-1.0, 1.0, (50_000, 2))
    assert (errors_at(icm, points) > 0.05).mean() < 1e-3


@pytest.mark.filterwarnings("ignore:.* of the cells are fallback cells:UserWarning")
@pytest.mark.parametrize("outside", ["escape", "integrate"])
@pytest.mark.parametrize("order", ORDERS)
def test_window_with_starts_that_have_no_image(order, outside):
    """sqrt(x - 0.1) is not a number below 0.1; its orbits have diverged under both maps."""
    exact = discrete_map(lambda x, p: (sqrt(x[0] - 0.1) - 0.2,), {}, ("x",))
    icm = interpolated_map(exact, CellGrid((-1.0,), (1.0,), (200,)), order, outside, tolerance=1e-6)
    places = np.linspace(-0.999, 0.999, 2002)[:, None]
    ours, theirs = icm.iterate(places, 1), exact.iterate(places, 1)
    assert np.array_equal(ours.status, theirs.status)
    assert (ours.status[places[:, 0] < 0.1] == Status.DIVERGED).all()
    assert ours.points == pytest.approx(theirs.points, abs=3e-6, nan_ok=True)
    assert np.isinf(icm.table.indicator[:100]).all()


def test_window_without_any_image_is_left_to_the_exact_map():
    exact = discrete_map(lambda x, p: (sqrt(x[0] - 5.0),), {}, ("x",))
    with pytest.warns(UserWarning, match="100 % of the cells are fallback cells"):
        icm = interpolated_map(exact, CellGrid((-1.0,), (1.0,), (20,)))
    assert icm.iterate([[0.3]], 1).status.tolist() == [Status.DIVERGED]


@pytest.mark.parametrize("order", ORDERS)
def test_indicator_is_the_largest_error_in_a_cell_in_cell_widths(order):
    icm = tabulated("plane", (32, 48), order, tolerance=COARSE)
    grid = icm.table.grid
    inside = np.stack(np.meshgrid(*[np.linspace(-0.5, 0.5, 11)] * 2), axis=-1).reshape(-1, 1, 1, 2)
    errors = (errors_at(icm, grid.centres() + inside * grid.widths) / grid.widths[0]).max(axis=0)
    assert icm.table.indicator == pytest.approx(errors, rel=0.1, abs=0.03 * errors.max())


def power(x, p):
    """Return multiples of z^2, z^4 and z^6, whose derivatives of these orders are constant."""
    re, im = x[0] * x[0] - x[1] * x[1], 2.0 * x[0] * x[1]
    fourth = re * re - im * im, 2.0 * re * im
    sixth = fourth[0] * re - fourth[1] * im, fourth[0] * im + fourth[1] * re
    return tuple(p.two * a + p.four * b + p.six * c for a, b, c in zip((re, im), fourth, sixth, strict=True))


@pytest.mark.parametrize(
    ("order", "name", "error"), [(1, "two", 1 / 4), (3, "four", 24 / 192), (5, "six", 720 / 15360)]
)
def test_errors_that_cancel_at_the_centres_count(order, name, error):
    """The real part of z^n is n! in its n-th derivative along x, and n! or -n! along y; the imaginary part has none.

    With opposite signs (n = 2 and 6) the errors h^n n!/8 .. n!/15360 along the axes cancel at the centre of a square
    cell, and either of them is alone at the middle of an edge; with equal signs (n = 4) they add up there.
    """
    exact = discrete_map(power, {"two": 0.0, "four": 0.0, "six": 0.0, name: 0.01}, ("x", "y"))
    grid = CellGrid((-1.0, -1.0), (1.0, 1.0), (8, 8))
    icm = interpolated_map(exact, grid, order, tolerance=COARSE)
    measured = errors_at(icm, grid.centres() + (np.array([0.0, 0.0] if order == 3 else [0.5, 0.0]) * grid.widths))
    expected = 0.01 * error * grid.widths[0] ** (order + 1)
    # At the edges of the window the end of the spline, some nodes past them, is still felt.
    assert measured == pytest.approx(expected, rel=0.03)
    assert icm.table.indicator == pytest.approx(expected / grid.widths[0], rel=0.06)


@pytest.mark.parametrize(("order", "cells", "share"), [(1, 16, 0.05), (3, 12, 1e-3), (5, 9, 1e-4)])
@pytest.mark.filterwarnings("ignore:.* of the cells are fallback cells:UserWarning")
def test_default_tolerance_is_a_share_of_a_cell(order, cells, share):
    grid = CellGrid((-pi,), (pi,), (cells,))
    lax, default = (interpolated_map(exact_map("circle"), grid, order, tolerance=t) for t in (COARSE, None))
    assert not lax.table.rough.any()
    assert np.array_equal(default.table.rough, lax.table.indicator > share)
    assert 0 < default.table.rough.mean() < 1


def test_warns_where_most_cells_are_rough():
    noise = discrete_map(lambda x, p: (sin(1e4 * x[0]),), {}, ("x",))
    with pytest.warns(UserWarning, match="too coarse or the map not smooth; take more cells"):
        interpolated_map(noise, CellGrid((-1.0,), (1.0,), (50,)))


@pytest.mark.filterwarnings("ignore:.* of the cells are fallback cells:UserWarning")
@pytest.mark.parametrize("outside", ["escape", "integrate"])
@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("shape", [(1, 1), (2, 1), (1, 2), (2, 2), (3, 1)])
def test_grids_of_very_few_cells(shape, order, outside):
    """A strict tolerance leaves them to the exact map; every image in the window is right all the same."""
    icm = tabulated("cylinder", shape, order, outside=outside, tolerance=1e-6)
    assert icm.table.coefficients.shape == (shape[0] + order, shape[1] + order, 2)
    centres = icm.table.grid.centres()
    assert errors_at(icm, centres).max() < 1e-6


def test_zero_periods_change_nothing(pendulum_table):
    initial_conditions = np.array([[0.3, 20.0], [-2.0, 500.0]])
    assert np.array_equal(pendulum_table.iterate(initial_conditions, 0).points, initial_conditions)


# --- the measured error


def test_error_is_the_known_error_of_a_parabola():
    """Straight lines between the nodes of a x^2 are off by a h^2 f (1 - f) at the place f of a cell.

    With f uniform, |f - 1/2| has its median at 1/4 and exceeds 1/200 in 99 % of the cell.
    """
    a, n = 0.3, 50
    icm = interpolated_map(
        discrete_map(lambda x, p: (p.a * x[0] ** 2,), {"a": a}, ("x",)), CellGrid((-1.0,), (1.0,), (n,)), order=1
    )
    error = icm.error(100_000)
    scale = a * (2 / n) ** 2
    assert error.points == 100_000
    assert error.largest == pytest.approx(scale / 4, rel=1e-4)
    assert error.percentile_99 == pytest.approx(scale * (1 / 4 - 1 / 200**2), rel=1e-4)
    assert error.median == pytest.approx(scale * 3 / 16, rel=0.01)


def test_error_is_reproducible(pendulum_table):
    first, again, other = pendulum_table.error(500), pendulum_table.error(500), pendulum_table.error(500, rng=1)
    assert (first.median, first.percentile_99, first.largest) == (again.median, again.percentile_99, again.largest)
    assert first.median != other.median


@pytest.mark.filterwarnings("ignore:.* of the cells are fallback cells:UserWarning")
def test_error_counts_the_points_that_have_an_image():
    icm = tabulated("line", (100,), outside="escape")
    assert icm.error(1000).points == 1000
    exact = discrete_map(lambda x, p: (sqrt(x[0]),), {}, ("x",))
    half = interpolated_map(exact, CellGrid((-1.0,), (1.5,), (100,)))
    assert half.error(20_000).points == pytest.approx(0.6 * 20_000, rel=0.03)


def test_exact_map_has_no_error_to_measure(pendulum):
    with pytest.raises(ValueError, match="is exact"):
        pendulum.error()


def test_error_of_the_wrong_number_of_points(pendulum_table):
    with pytest.raises(ValueError, match="n_samples=0"):
        pendulum_table.error(0)


# --- the same bits, the recipe, the memory


@pytest.mark.parametrize("outside", ["escape", "integrate"])
def test_bits_do_not_depend_on_threads(pendulum, outside):
    grid = CellGrid((-pi, -60.0), (pi, 60.0), (100, 100))
    initial_conditions = np.random.default_rng(7).uniform([-pi, -90], [pi, 90], (20_000, 2))
    results = []
    for threads in (1, 2, 3):
        set_threads(threads)
        icm = interpolated_map(pendulum, grid, outside=outside)
        image = icm.iterate(initial_conditions, 10)
        results.append((icm.table.coefficients, icm.table.indicator, image.points, image.rotations, image.status))
    for other in results[1:]:
        for a, b in zip(results[0], other, strict=True):
            assert np.array_equal(a, b, equal_nan=a.dtype.kind == "f")


def test_recipe_says_how_the_map_was_made(pendulum):
    grid = CellGrid((-pi, -50.0), (pi, 60.0), (32, 24))
    recipe = interpolated_map(pendulum, grid, order=3, outside="integrate", tolerance=0.5).recipe
    assert json.loads(json.dumps(recipe)) == {
        "kind": "interpolated",
        "order": 3,
        "outside": "integrate",
        "tolerance": 0.5,
        "lower": [-pi, -50.0],
        "upper": [pi, 60.0],
        "shape": [32, 24],
        "exact": dict(pendulum.recipe),
    }


def test_map_describes_itself(pendulum, pendulum_table):
    assert pendulum_table.exact is pendulum
    assert pendulum_table.period == pendulum.period
    assert pendulum_table.params == pendulum.params
    assert pendulum_table.table.grid.wraps == (True, False)
    assert pendulum_table.cost.seconds > 0
    assert "interpolated of driven pendulum" in repr(pendulum_table)
    assert "order 5" in repr(pendulum_table.table)
    assert len(repr(pendulum_table)) < 300


@pytest.mark.parametrize("order", ORDERS)
def test_memory_is_what_was_stated(order):
    """At most three tables, and beside them a few slices of 8192 orbits for each thread."""
    set_threads(1)
    tabulated("cylinder", (4, 4), order, tolerance=COARSE)  # compile
    tracemalloc.start()
    try:
        icm = tabulated("cylinder", (1200, 800), order)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    stated, slices = table_memory(icm.table.grid, order), 20 * 8192 * 8 * 2
    assert stated <= 3 * icm.table.coefficients.nbytes
    assert icm.table.coefficients.nbytes < peak <= stated + slices


def test_table_that_does_not_fit_is_refused_before_it_is_begun(pendulum):
    with pytest.raises(MemoryError, match=r"1000000 x 1000000 cells .* needs .* TB and .* are free: take fewer cells"):
        interpolated_map(pendulum, CellGrid((-pi, -100.0), (pi, 100.0), (10**6, 10**6)))


def test_refusal_follows_the_memory_that_is_free(pendulum, monkeypatch):
    grid = CellGrid((-pi, -100.0), (pi, 100.0), (128, 64))
    needed = table_memory(grid.on(pendulum.coordinates), 5)
    monkeypatch.setattr("cellmap._lib.checks._ALWAYS_FREE", 0)
    monkeypatch.setattr("cellmap._lib.checks.memory_available", lambda: needed - 1)
    with pytest.raises(MemoryError, match="an interpolation grid of 128 x 64 cells"):
        interpolated_map(pendulum, grid)
    monkeypatch.setattr("cellmap._lib.checks._ALWAYS_FREE", 0)
    monkeypatch.setattr("cellmap._lib.checks.memory_available", lambda: needed)
    interpolated_map(pendulum, grid)


# --- several periods in one look-up


@pytest.fixture(scope="module")
def leaping(pendulum) -> PointMap:
    """The pendulum whose cells take up to eight periods at once."""
    return interpolated_map(pendulum, CellGrid((-pi, -100.0), (pi, 100.0), (128, 128)), outside="integrate", max_step=8)


@pytest.fixture(scope="module")
def single(pendulum) -> PointMap:
    return interpolated_map(pendulum, CellGrid((-pi, -100.0), (pi, 100.0), (128, 128)), outside="integrate")


PLACES = np.random.default_rng(11).uniform([-pi, -130.0], [pi, 130.0], (3000, 2))


@pytest.mark.parametrize("periods", [1, 2, 3, 7, 8, 9, 31, 50])
def test_leaps_end_where_single_periods_end(leaping, single, periods):
    ours, theirs = leaping.iterate(PLACES, periods), single.iterate(PLACES, periods)
    difference = np.abs(ours.unwrapped - theirs.unwrapped) / [1.0, 100.0]
    assert np.median(difference) < 5e-9  # a tenth of what is allowed at the centre of a cell
    assert (difference > 1e-6).mean() < 0.01  # orbits that separate exponentially
    assert np.array_equal(ours.status, theirs.status)


def test_the_map_of_one_period_is_the_same_with_leaps(leaping, single):
    assert np.array_equal(leaping.iterate(PLACES, 1).points, single.iterate(PLACES, 1).points)
    assert np.array_equal(leaping.orbit(PLACES[:50], 6).points, single.orbit(PLACES[:50], 6).points)
    assert np.array_equal(leaping.table.coefficients, single.table.coefficients)
    assert np.array_equal(leaping.table.rough, single.table.rough)


def test_leaps_agree_with_the_exact_map_to_the_tolerance(pendulum):
    """Cells whose multi-period step errs by more at their centres take shorter ones."""
    grid = CellGrid((-pi, -100.0), (pi, 100.0), (64, 64))
    single, tight, lax = (
        interpolated_map(pendulum, grid, 5, "integrate", tolerance, max_step=leap)
        for tolerance, leap in ((1e-6, 1), (1e-6, 8), (1e3, 8))
    )
    exact = pendulum.iterate(PLACES, 8).unwrapped
    off = [np.median(np.abs(m.iterate(PLACES, 8).unwrapped - exact).max(axis=-1)) for m in (single, tight, lax)]
    assert off[1] < off[0] + 1e-6
    assert off[2] > 1e-4


@pytest.mark.parametrize("name", ROUGH)
@pytest.mark.filterwarnings("ignore:.* of the cells are fallback cells:UserWarning")
def test_leaps_across_what_is_not_smooth(name):
    exact = discrete_map(ROUGH[name], {}, ("x",))
    grid = CellGrid((-1.0,), (1.0,), (200,))
    places = np.linspace(-1.0, 1.0, 5003)[:, None]
    single, leaping = (interpolated_map(exact, grid, 5, "integrate", 1e-6, max_step=leap) for leap in (1, 4))
    difference = np.abs(leaping.iterate(places, 4).points - single.iterate(places, 4).points)
    assert np.median(difference) < 1e-6
    assert (difference > 1e-4).mean() < 0.01


@pytest.mark.parametrize("name", ["cylinder", "plane", "torus"])
def test_orbits_escape_in_leaps_as_in_single_periods(name):
    shape = tuple(2 * n for n in SMOOTH[name][3][5])
    single, leaping = (tabulated(name, shape, outside="escape", tolerance=1e-3, max_step=leap) for leap in (1, 4))
    initial_conditions = np.random.default_rng(12).uniform(*SMOOTH[name][2], (5000, 2))
    for periods in (4, 12):
        ours, theirs = leaping.iterate(initial_conditions, periods), single.iterate(initial_conditions, periods)
        assert (ours.status == theirs.status).mean() > 0.999
        assert np.array_equal(ours.status == Status.ESCAPED, np.isnan(ours.points).all(axis=-1))


def test_turns_are_counted_in_leaps():
    exact = discrete_map(lambda x, p: (x[0] + 2 * pi * p.rate + 0.1 * sin(x[0]),), {"rate": 2.6}, (angle("a"),))
    icm = interpolated_map(exact, CellGrid((-pi,), (pi,), (64,)), max_step=4)
    initial_conditions = np.linspace(-3, 3, 41)[:, None]
    ours, theirs = icm.iterate(initial_conditions, 51), exact.iterate(initial_conditions, 51)
    assert np.array_equal(ours.rotations, theirs.rotations)
    assert ours.unwrapped == pytest.approx(theirs.unwrapped, abs=1e-9)


def test_bits_of_leaps_do_not_depend_on_threads_or_neighbours(pendulum):
    results = []
    for threads in (1, 2, 3):
        set_threads(threads)
        icm = interpolated_map(pendulum, CellGrid((-pi, -60.0), (pi, 60.0), (64, 64)), outside="integrate", max_step=4)
        results.append(icm.iterate(np.tile(PLACES, (6, 1)), 11).points)
    assert np.array_equal(results[0], results[1])
    assert np.array_equal(results[0], results[2])
    for i in (0, 77, 2999):
        assert np.array_equal(icm.iterate(PLACES[i], 11).points, results[0][i])


@pytest.mark.parametrize("damping", [10.0, 2.0])
@pytest.mark.slow
def test_leaps_settle_starts_in_the_same_period(damping):
    """Within a multi-period step an orbit can enter a neighbourhood and not leave it, for that is trapping."""
    exact = stroboscopic_map(systems.driven_pendulum(amplitude=0.003, damping=damping))
    nodes, grid = (CellGrid((-pi, -v), (pi, v), (n, n)) for v, n in ((130.0, 128), (100.0, 120)))
    single, leaping = (
        find_basins(interpolated_map(exact, nodes, outside="integrate", max_step=leap), grid) for leap in (1, 8)
    )
    assert len(leaping.attractors) == len(single.attractors) == 2
    assert (leaping.labels != single.labels).mean() <= 1e-3
    assert (leaping.settling_time != single.settling_time).mean() <= 1e-3
    assert leaping.settling_time.min() == single.settling_time.min()


def test_starts_that_leave_the_window_or_do_not_settle_in_leaps():
    exact = stroboscopic_map(systems.driven_pendulum(amplitude=0.003))
    grid = CellGrid((-pi, -100.0), (pi, 100.0), (96, 96))
    for limit in (5, 11, 2000):
        single, leaping = (
            find_basins(interpolated_map(exact, grid, outside="escape", max_step=leap), grid, limit) for leap in (1, 4)
        )
        assert (leaping.labels != single.labels).mean() <= 2e-3
        assert (leaping.settling_time != single.settling_time).mean() <= 2e-3
        assert set(np.unique(leaping.labels)) == set(np.unique(single.labels))


def test_a_chaotic_attractor_is_looked_at_in_single_periods():
    """Its cover is entered and left again, and no multi-period step may hide a visit: the same labels and times."""
    exact = systems.henon_map()
    nodes, grid = (CellGrid((-2.0, -2.0), (2.0, 2.0), (n, n)) for n in (64, 20))
    single, leaping = (interpolated_map(exact, nodes, outside="integrate", max_step=leap) for leap in (1, 4))
    expected = find_basins(single, grid, 500)
    assert expected.attractors[0].cover is not None
    # Of the same cover: one that is sampled from orbits of other rounding has other boxes.
    found = find_basins(leaping, grid, 500, attractors=expected.attractors)
    assert found.attractors == expected.attractors
    assert np.array_equal(found.settling_time, expected.settling_time)
    assert np.array_equal(found.labels, expected.labels)


def test_leap_is_kept_by_the_recipe_and_the_family(leaping, pendulum):
    assert leaping.recipe["leap"] == 8
    again = rebuild_map(systems.driven_pendulum(), json.loads(json.dumps(leaping.recipe)))
    assert np.array_equal(again.iterate(PLACES, 13).points, leaping.iterate(PLACES, 13).points)
    other = leaping.with_params(amplitude=0.0025)
    assert other.recipe["leap"] == 8


def test_tables_of_several_periods_need_their_memory(pendulum, monkeypatch):
    grid = CellGrid((-pi, -100.0), (pi, 100.0), (128, 64)).on(pendulum.coordinates)
    assert table_memory(grid, 5, 4) == 3 * table_memory(grid, 5)
    monkeypatch.setattr("cellmap._lib.checks._ALWAYS_FREE", 0)
    monkeypatch.setattr("cellmap._lib.checks.memory_available", lambda: table_memory(grid, 5))
    interpolated_map(pendulum, grid)
    with pytest.raises(MemoryError, match="an interpolation grid of 128 x 64 cells"):
        interpolated_map(pendulum, grid, max_step=4)


@pytest.mark.parametrize("leap", [0, -2, 3, 6, 2.5, "two"], ids=repr)
def test_leaps_that_are_none(pendulum, leap):
    with pytest.raises((ValueError, TypeError), match="max_step"):
        interpolated_map(pendulum, GRID, max_step=leap)


# --- bad input

GRID = CellGrid((-pi, -100.0), (pi, 100.0), (16, 16))
TURN_AND_A_HALF = CellGrid((-pi, -100.0), (2 * pi, 100.0), (16, 16))


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ((GRID, 2), ValueError, "order=2: choose one of 1, 3, 5"),
        ((GRID, 4), ValueError, "order=4: choose one of 1, 3, 5"),
        ((GRID, 0), ValueError, "order=0"),
        ((GRID, "cubic"), TypeError, "order='cubic': give a whole number"),
        ((GRID, 5, "reflect"), ValueError, "outside='reflect': choose one of 'escape', 'integrate'"),
        ((GRID, 5, "escape", 0.0), ValueError, "tolerance=0.0: give a number above 0"),
        ((GRID, 5, "escape", -1e-3), ValueError, "tolerance=-0.001"),
        ((GRID, 5, "escape", np.nan), ValueError, "tolerance=nan: give a finite number"),
        ((GRID, 5, "escape", np.inf), ValueError, "tolerance=inf"),
        ((GRID, 5, "escape", "small"), TypeError, "tolerance='small'"),
        ((CellGrid((0.0,), (1.0,), (8,)),), ValueError, "grid has 1 axes and the system 2 coordinates"),
        ((CellGrid((0.0,) * 3, (1.0,) * 3, (8,) * 3),), ValueError, "grid has 3 axes and the system 2 coordinates"),
        ((TURN_AND_A_HALF,), ValueError, "more than one period"),
        (((16, 16),), TypeError, "give a CellGrid"),
        ((None,), TypeError, "give a CellGrid"),
    ],
    ids=repr,
)
def test_bad_arguments(pendulum, arguments, error, message):
    with pytest.raises(error, match=message.replace("(", r"\(")):
        interpolated_map(pendulum, *arguments)


@pytest.mark.parametrize("exact", [None, systems.driven_pendulum(), np.zeros(2), len], ids=repr)
def test_something_that_is_no_map(exact):
    with pytest.raises(TypeError, match=r"exact=.*: give a PointMap, made by stroboscopic_map or discrete_map"):
        interpolated_map(exact, GRID)


def test_interpolated_map_of_an_interpolated_map(pendulum_table):
    with pytest.raises(TypeError, match="give an exact map"):
        interpolated_map(pendulum_table, GRID)


@pytest.mark.parametrize(
    ("lower", "upper", "shape", "message"),
    [
        ((1.0, 0.0), (0.0, 1.0), (4, 4), "empty or inverted"),
        ((0.0, 0.0), (0.0, 1.0), (4, 4), "empty or inverted"),
        ((0.0, np.nan), (1.0, 1.0), (4, 4), "finite corners"),
        ((0.0, 0.0), (np.inf, 1.0), (4, 4), "finite corners"),
        ((0.0, 0.0), (1.0, 1.0), (4, 0), "at least 1"),
        ((0.0, 0.0), (1.0, 1.0), (4, -3), "at least 1"),
        ((0.0, 0.0), (1.0,), (4, 4), "one entry for each coordinate"),
    ],
)
def test_windows_that_are_none(lower, upper, shape, message):
    with pytest.raises(ValueError, match=message):
        CellGrid(lower, upper, shape)


@pytest.mark.parametrize("points", [[np.nan, 0.0], [0.0, np.inf], [1.0], [[1.0, 2.0, 3.0]], "ab"], ids=repr)
def test_starts_that_are_none(pendulum_table, points):
    with pytest.raises((ValueError, TypeError), match="points"):
        pendulum_table(points)
