"""Interpolated cell maps: order of convergence, angles, windows, measured errors, memory."""

import json
import tracemalloc
from math import pi, sin, sqrt

import numpy as np
import pytest
from maps_to_interpolate import COARSE, ORDERS, SMOOTH, exact_map, interpolated
from two_tiers import at_once

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


@pytest.fixture(scope="module")
def pendulum() -> PointMap:
    return stroboscopic_map(systems.driven_pendulum(), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("name", at_once(["circle", "line", "torus", "cylinder", "plane"], later=SMOOTH))
def test_order_of_convergence(name, order):
    """The error falls as h^(order + 1): slope of log(error) over three tables, each twice as fine."""
    coarsest = SMOOTH[name][3][order]
    levels = 2 if len(coarsest) == 4 else 3
    shapes = [tuple(n * 2**k for n in coarsest) for k in range(levels)]
    errors = [interpolated(name, shape, order, tolerance=COARSE).error(4000).percentile_99 for shape in shapes]
    slope = -np.polyfit(range(levels), np.log2(errors), 1)[0]
    assert errors[-1] > 1e-13, "the finest table is at the limit of rounding, where no order can be seen"
    assert slope == pytest.approx(order + 1, abs=0.35)


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


def test_orbits_that_leave_have_escaped_for_ever():
    exact = discrete_map(lambda x, p: (x[0] + 0.3, 0.5 * x[1]), {}, ("x", "y"))
    icm = interpolated_map(exact, CellGrid((0.0, -1.0), (1.0, 1.0), (20, 20)), outside="escape")
    orbit = icm.orbit([[0.05, 0.5], [0.95, 0.5], [2.0, 0.0], [0.5, 1.5]], 6)
    gone = np.array([[0] * 5 + [1] * 2, [0] * 2 + [1] * 5, [0] + [1] * 6, [0] + [1] * 6], bool).T
    assert np.array_equal(orbit.status == Status.ESCAPED, gone)
    assert np.array_equal(np.isnan(orbit.points).all(axis=-1), gone)
    assert np.array_equal(np.isnan(orbit.points).any(axis=-1), gone)
    assert orbit.points[:5, 0, 0] == pytest.approx(0.05 + 0.3 * np.arange(5), abs=1e-12)


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


@pytest.mark.filterwarnings("ignore:.* of the cells are fallback cells:UserWarning")
def test_error_counts_the_points_that_have_an_image():
    icm = interpolated("line", (100,), outside="escape")
    first, again, other = icm.error(1000), icm.error(1000), icm.error(1000, rng=1)
    assert first.points == 1000 and repr(first) == repr(again) and first.median != other.median
    exact = discrete_map(lambda x, p: (sqrt(x[0]),), {}, ("x",))
    half = interpolated_map(exact, CellGrid((-1.0,), (1.5,), (100,)))
    error = half.error(20_000)
    assert error.fallback > 0.4 * 20_000  # no image, and beside the edge
    assert error.points + error.fallback == 20_000
    stairs = discrete_map(lambda x, p: (np.floor(737.3 * x[0]),), {}, ("x",))
    nothing = interpolated_map(stairs, CellGrid((-1.0,), (1.0,), (20,))).error(1000)
    assert (nothing.points, nothing.fallback, np.isnan(nothing.largest)) == (0, 1000, True)


@pytest.mark.parametrize(("outside", "max_step"), [("escape", 1), ("integrate", 1), ("integrate", 4)])
def test_bits_do_not_depend_on_threads_or_neighbours(pendulum, outside, max_step):
    grid = CellGrid((-pi, -60.0), (pi, 60.0), (100, 100))
    initial_conditions = np.random.default_rng(7).uniform([-pi, -90], [pi, 90], (20_000, 2))
    results = []
    for threads in (1, 2, 3):
        set_threads(threads)
        icm = interpolated_map(pendulum, grid, outside=outside, max_step=max_step)
        image = icm.iterate(initial_conditions, 10)
        results.append((icm.table.coefficients, icm.table.indicator, image.points, image.rotations, image.status))
    for other in results[1:]:
        for a, b in zip(results[0], other, strict=True):
            assert np.array_equal(a, b, equal_nan=a.dtype.kind == "f")
    for i in (0, 77, 19_999):
        assert np.array_equal(icm.iterate(initial_conditions[i], 10).points, image.points[i], equal_nan=True)


@pytest.mark.parametrize("order", at_once([5], later=[1, 3]))
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


@pytest.mark.parametrize("max_step", [1, 4])
def test_refusal_follows_the_memory_that_is_free(pendulum, monkeypatch, max_step):
    """Tables of several periods, here of 1, 2 and 4, need their memory."""
    grid = CellGrid((-pi, -100.0), (pi, 100.0), (128, 64)).on(pendulum.coordinates)
    needed = table_memory(grid, 5, max_step)
    assert needed == (1 if max_step == 1 else 3) * table_memory(grid, 5)
    monkeypatch.setattr("cellmap._lib.checks._ALWAYS_FREE", 0)
    monkeypatch.setattr("cellmap._lib.checks.memory_available", lambda: needed - 1)
    with pytest.raises(MemoryError, match="an interpolation grid of 128 x 64 cells"):
        interpolated_map(pendulum, grid, max_step=max_step)
    monkeypatch.setattr("cellmap._lib.checks.memory_available", lambda: needed)
    interpolated_map(pendulum, grid, max_step=max_step)


@pytest.fixture(scope="module")
def tables(pendulum) -> list[PointMap]:
    """The pendulum whose cells take up to eight periods at once, and one period."""
    grid = CellGrid((-pi, -100.0), (pi, 100.0), (128, 128))
    return [interpolated_map(pendulum, grid, outside="integrate", max_step=max_step) for max_step in (8, 1)]


PLACES = np.random.default_rng(11).uniform([-pi, -130.0], [pi, 130.0], (3000, 2))


def test_multi_period_steps_end_where_single_periods_end(tables):
    """The map of one period is the same."""
    multiple, single = tables
    assert np.array_equal(multiple.iterate(PLACES, 1).points, single.iterate(PLACES, 1).points)
    assert np.array_equal(multiple.orbit(PLACES[:50], 6).points, single.orbit(PLACES[:50], 6).points)
    assert np.array_equal(multiple.table.coefficients, single.table.coefficients)
    assert np.array_equal(multiple.table.fallback, single.table.fallback)
    for periods in (2, 3, 7, 8, 9, 31, 50):
        ours, theirs = multiple.iterate(PLACES, periods), single.iterate(PLACES, periods)
        difference = np.abs(ours.unwrapped - theirs.unwrapped) / [1.0, 100.0]
        assert np.median(difference) < 5e-9  # a tenth of what is allowed at the centre of a cell
        assert (difference > 1e-6).mean() < 0.01  # orbits that separate exponentially
        assert np.array_equal(ours.status, theirs.status)


@pytest.mark.parametrize("name", ["cylinder", "plane", "torus"])
def test_orbits_escape_in_multi_period_steps_as_in_single_periods(name):
    shape = tuple(2 * n for n in SMOOTH[name][3][5])
    single, multiple = (
        interpolated(name, shape, outside="escape", tolerance=1e-3, max_step=max_step) for max_step in (1, 4)
    )
    initial_conditions = np.random.default_rng(12).uniform(*SMOOTH[name][2], (5000, 2))
    for periods in (4, 12):
        ours, theirs = multiple.iterate(initial_conditions, periods), single.iterate(initial_conditions, periods)
        assert (ours.status == theirs.status).mean() > 0.999
        assert np.array_equal(ours.status == Status.ESCAPED, np.isnan(ours.points).all(axis=-1))


@pytest.mark.parametrize("max_step", [1, 4])
def test_rotations_are_counted(max_step):
    exact = discrete_map(lambda x, p: (x[0] + 2 * pi * p.rate + 0.1 * sin(x[0]),), {"rate": 2.6}, (angle("a"),))
    icm = interpolated_map(exact, CellGrid((-pi,), (pi,), (64,)), max_step=max_step)
    initial_conditions = np.linspace(-3, 3, 41)[:, None]
    ours, theirs = icm.iterate(initial_conditions, 51), exact.iterate(initial_conditions, 51)
    assert np.array_equal(ours.rotations, theirs.rotations)
    assert ours.unwrapped == pytest.approx(theirs.unwrapped, abs=1e-9)


def test_a_chaotic_attractor_is_looked_at_in_single_periods():
    """Its cover is entered and left again, and no multi-period step may hide a visit: the same labels and times."""
    exact = systems.henon_map()
    nodes, grid = (CellGrid((-2.0, -2.0), (2.0, 2.0), (n, n)) for n in (64, 20))
    single, multiple = (interpolated_map(exact, nodes, outside="integrate", max_step=max_step) for max_step in (1, 4))
    expected = find_basins(single, grid, 500)
    assert expected.attractors[0].cover is not None
    # Of the same cover: one that is sampled from orbits of other rounding has other boxes.
    found = find_basins(multiple, grid, 500, attractors=expected.attractors)
    assert [a.points is b.points for a, b in zip(found.attractors, expected.attractors, strict=True)] == [True]
    assert np.array_equal(found.settling_time, expected.settling_time)
    assert np.array_equal(found.labels, expected.labels)


def test_the_step_is_kept_by_the_recipe_and_the_family(tables, pendulum):
    multiple = tables[0]
    assert multiple.recipe["leap"] == multiple.with_params(amplitude=0.0025).recipe["leap"] == 8
    again = rebuild_map(systems.driven_pendulum(), json.loads(json.dumps(multiple.recipe)))
    assert np.array_equal(again.iterate(PLACES, 13).points, multiple.iterate(PLACES, 13).points)
    assert (multiple.exact, multiple.period, multiple.params) == (pendulum, pendulum.period, pendulum.params)
    assert multiple.table.grid.wraps == (True, False) and multiple.cost.seconds > 0
    assert "interpolated of driven pendulum" in repr(multiple) and "order 5" in repr(multiple.table)
