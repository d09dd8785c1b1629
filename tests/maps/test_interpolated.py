"""Interpolated cell maps: order of convergence, angles, windows, measured errors, memory."""

from __future__ import annotations

import json
import tracemalloc
from math import pi, sin, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from maps_to_interpolate import COARSE, ORDERS, SMOOTH, errors_at, exact_map, interpolated

from cellmap import (
    CellGrid,
    PointMap,
    Status,
    angle,
    discrete_map,
    interpolated_map,
    set_threads,
)
from cellmap.maps.interpolation.interpolated import table_memory

# --- order of convergence


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("name", SMOOTH)
def test_order_of_convergence(name, order):
    """The error falls as h^(order + 1): slope of log(error) over three tables, each twice as fine."""
    coarsest = SMOOTH[name][3][order]
    levels = 2 if len(coarsest) == 4 else 3
    shapes = [tuple(n * 2**k for n in coarsest) for k in range(levels)]
    errors = [interpolated(name, shape, order, tolerance=COARSE).error(4000).percentile_99 for shape in shapes]
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
    icm = interpolated("coupled standard maps", (20, 20, 2, 2))
    assert icm.error(4000).largest < 3e-7
    assert not icm.table.fallback.any()


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
def test_branch_cut_is_as_accurate_as_the_rest_of_the_circle(order, lower):
    exact = discrete_map(lambda x, p: (x[0] + 2.0 + sin(12 * x[0]),), {}, (angle("a"),))
    icm = interpolated_map(exact, CellGrid((lower,), (lower + 2 * pi,), (240,)), order, tolerance=COARSE)
    everywhere = errors_at(icm, np.linspace(-pi, pi, 20_001)[:, None])
    for cut in (-pi, lower):
        near = np.linspace(cut - 0.05, cut + 0.05, 801)[:, None]
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
    rotated = icm.iterate([theta + 2 * pi * rotations, v], 1)
    exact = icm.exact.iterate([theta, v], 1)
    assert -pi <= image.points[0] < pi
    # At the cut of the angle two images may lie at both of its sides.
    for other in (rotated, exact):
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


def test_rotations_are_counted():
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
    icm = interpolated("cylinder", (32, 16), outside="escape")
    initial_conditions = np.random.default_rng(2).uniform([-pi, -1], [pi, 1], (300, 2))
    at_once, orbit = icm.iterate(initial_conditions, 12), icm.orbit(initial_conditions, 12)
    assert 0 < np.count_nonzero(at_once.status == Status.ESCAPED) < 300
    assert np.array_equal(at_once.points, orbit.points[-1], equal_nan=True)
    assert np.array_equal(at_once.status, orbit.status[-1])


@pytest.mark.parametrize("name", SMOOTH)
def test_the_exact_map_carries_orbits_outside(name):
    lower, upper = map(np.array, SMOOTH[name][2])
    shape = tuple(2 * n for n in SMOOTH[name][3][5])
    icm = interpolated(name, shape, outside="integrate")
    middle, half = (lower + upper) / 2, (upper - lower) / 2
    initial_conditions = middle + half * np.random.default_rng(3).uniform(-3.0, 3.0, (200, len(half)))
    exact = icm.exact.iterate(initial_conditions, 4)
    image = icm.iterate(initial_conditions, 4)
    assert np.array_equal(image.status, exact.status)
    assert image.unwrapped == pytest.approx(exact.unwrapped, rel=1e-5, abs=1e-4)


def test_outside_images_are_the_exact_ones_to_the_bit(pendulum, interpolated_pendulum):
    icm = interpolated_map(pendulum, interpolated_pendulum.table.grid, outside="integrate")
    far = np.random.default_rng(4).uniform([-pi, 101.0], [pi, 400.0], (100, 2))
    assert np.array_equal(icm(far), pendulum(far))


def test_orbits_that_swing_out_and_return_agree_with_the_exact_map(pendulum):
    icm = interpolated_map(pendulum, CellGrid((-pi, -60.0), (pi, 60.0), (128, 128)), outside="integrate")
    initial_conditions = np.random.default_rng(5).uniform([-pi, -200], [pi, 200], (200, 2))
    exact, image = pendulum.iterate(initial_conditions, 15), icm.iterate(initial_conditions, 15)
    difference = np.abs(image.unwrapped - exact.unwrapped) / [1.0, 100.0]
    assert np.median(difference) < 1e-10
    assert difference.max() < 1e-6


def test_zero_periods_change_nothing(interpolated_pendulum):
    initial_conditions = np.array([[0.3, 20.0], [-2.0, 500.0]])
    assert np.array_equal(interpolated_pendulum.iterate(initial_conditions, 0).points, initial_conditions)


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


def test_error_is_reproducible(interpolated_pendulum):
    first, again, other = (
        interpolated_pendulum.error(500),
        interpolated_pendulum.error(500),
        interpolated_pendulum.error(500, rng=1),
    )
    assert (first.median, first.percentile_99, first.largest) == (again.median, again.percentile_99, again.largest)
    assert first.median != other.median


@pytest.mark.filterwarnings("ignore:.* of the cells are fallback cells:UserWarning")
def test_error_counts_the_points_that_have_an_image():
    icm = interpolated("line", (100,), outside="escape")
    assert icm.error(1000).points == 1000
    exact = discrete_map(lambda x, p: (sqrt(x[0]),), {}, ("x",))
    half = interpolated_map(exact, CellGrid((-1.0,), (1.5,), (100,)))
    error = half.error(20_000)
    assert error.fallback > 0.4 * 20_000  # no image, and beside the edge
    assert error.points + error.fallback == 20_000


def test_exact_map_has_no_error_to_measure(pendulum):
    with pytest.raises(ValueError, match="is exact"):
        pendulum.error()


def test_error_of_the_wrong_number_of_points(interpolated_pendulum):
    with pytest.raises(ValueError, match="n_samples=0"):
        interpolated_pendulum.error(0)


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


def test_map_describes_itself(pendulum, interpolated_pendulum):
    assert interpolated_pendulum.exact is pendulum
    assert interpolated_pendulum.period == pendulum.period
    assert interpolated_pendulum.params == pendulum.params
    assert interpolated_pendulum.table.grid.wraps == (True, False)
    assert interpolated_pendulum.cost.seconds > 0
    assert "interpolated of driven pendulum" in repr(interpolated_pendulum)
    assert "order 5" in repr(interpolated_pendulum.table)
    assert len(repr(interpolated_pendulum)) < 300


@pytest.mark.parametrize("order", ORDERS)
def test_memory_is_what_was_stated(order):
    """At most three tables, and beside them a few slices of 8192 orbits for each thread."""
    set_threads(1)
    interpolated("cylinder", (4, 4), order, tolerance=COARSE)  # compile
    tracemalloc.start()
    try:
        icm = interpolated("cylinder", (1200, 800), order)
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
