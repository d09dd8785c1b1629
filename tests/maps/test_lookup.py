"""Evaluation of interpolated maps against SciPy's B-splines."""

from __future__ import annotations

import re
from math import ceil, cos, pi, sin
from typing import Any

import numpy as np
import pytest
from maps_to_interpolate import ORDERS, circle, cylinder, line, torus
from scipy.interpolate import BSpline, NdBSpline
from scipy.ndimage import map_coordinates

from cellmap import CellGrid, PointMap, angle, discrete_map, interpolated_map
from cellmap._compiled.codegen.lookup import BLOCK, lookup_kernel
from cellmap._compiled.codegen.spline_sum import WIDTH, basis_polynomials
from cellmap.maps.orbit_batch import Orbits


def plane(x, p):
    return 0.6 * x[0] + 0.3 * sin(x[1]), 0.5 * x[1] - 0.2 * x[0] ** 2


def space(x, p):
    return 0.5 * x[0] + 0.2 * sin(x[1] * x[2]), 0.6 * x[1] + 0.1 * cos(x[0]), 0.4 * x[2] - 0.3 * x[0] * x[1]


def four(x, p):
    a, b, u, v = x
    u, v = 0.8 * u + 0.2 * sin(a) + 0.1 * sin(a + b), 0.8 * v + 0.2 * sin(b) + 0.1 * sin(a + b)
    return a + u, b + v, u, v


TABLES = {
    "circle": (circle, (angle("a"),), CellGrid((-pi,), (pi,), (24,))),
    "line": (line, ("x",), CellGrid((-1.0,), (1.5,), (20,))),
    "torus": (torus, (angle("a"), angle("b")), CellGrid((-pi, -pi), (pi, pi), (24, 18))),
    "cylinder": (cylinder, (angle("a"), "v"), CellGrid((-pi, -1.0), (pi, 1.0), (20, 12))),
    "plane": (plane, ("x", "y"), CellGrid((-1.0, -2.0), (1.0, 1.0), (12, 16))),
    "space": (space, ("x", "y", "z"), CellGrid((-1.0,) * 3, (1.0, 1.5, 2.0), (6, 8, 7))),
    "four": (four, (angle("a"), angle("b"), "u", "v"), CellGrid((-pi, -pi, -1, -1), (pi, pi, 1, 1), (8, 9, 5, 6))),
}


def interpolated(name: str, order: int, tolerance: float = 1e6) -> PointMap:
    function, coordinates, grid = TABLES[name]
    return interpolated_map(discrete_map(function, {}, coordinates), grid, order, tolerance=tolerance)


def places_in(grid: CellGrid, number: int = 500) -> np.ndarray:
    return np.random.default_rng(1).uniform(grid.lower, grid.upper, (number, grid.dimension))


def test_columns_of_an_array_may_lie_one_behind_the_other():
    point_map, points = interpolated("plane", 3), places_in(TABLES["plane"][2])
    columns = np.asfortranarray(points)
    orbits = Orbits.starting(columns)
    point_map.advance(orbits, 3)
    assert np.array_equal(columns, point_map.iterate(points, 3).points)


@pytest.mark.parametrize("order", ORDERS)
def test_basis_is_the_cardinal_spline(order):
    spline = BSpline.basis_element(np.arange(order + 2.0))
    places = np.linspace(0.0, 1.0, 17)[:-1]
    for k, row in enumerate(basis_polynomials(order)):
        assert np.polynomial.polynomial.polyval(places, row) == pytest.approx(spline(places + order - k), abs=1e-15)


@pytest.mark.parametrize("order", ORDERS)
def test_basis_adds_up_to_one(order):
    total = np.sum(basis_polynomials(order), axis=0)
    assert total == pytest.approx([1.0] + [0.0] * order, abs=1e-15)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("name", TABLES)
def test_look_up_equals_scipys_tensor_spline(name, order):
    icm = interpolated(name, order)
    table = icm.table
    points = places_in(table.grid)
    knots = tuple(
        a + (np.arange(n + 2 * order + 1) - order) * w
        for a, n, w in zip(table.grid.lower, table.grid.shape, table.grid.widths, strict=True)
    )
    displacement = NdBSpline(knots, table.coefficients, order)(points)
    assert icm.iterate(points, 1).unwrapped - points == pytest.approx(displacement, abs=1e-13)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("name", ["circle", "torus"])
def test_periodic_table_equals_ndimage(name, order):
    function, coordinates, grid = TABLES[name]
    exact = discrete_map(function, {}, coordinates)
    icm = interpolated(name, order)
    nodes = np.stack(np.meshgrid(*(grid.edges(j)[:-1] for j in range(grid.dimension)), indexing="ij"), axis=-1)
    moved = exact.iterate(nodes, 1).unwrapped - nodes
    points = places_in(grid)
    places = ((points - grid.lower) / grid.widths).T
    expected = np.stack(
        [map_coordinates(moved[..., j], places, order=order, mode="grid-wrap") for j in range(grid.dimension)], axis=-1
    )
    assert icm.iterate(points, 1).unwrapped - points == pytest.approx(expected, abs=1e-13)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("name", TABLES)
def test_nodes_have_their_exact_images(name, order):
    icm = interpolated(name, order)
    grid = icm.table.grid
    corners = [grid.edges(j)[:-1] if grid.wraps[j] else grid.edges(j) for j in range(grid.dimension)]
    nodes = np.stack(np.meshgrid(*corners, indexing="ij"), axis=-1).reshape(-1, grid.dimension)
    assert icm.iterate(nodes, 1).unwrapped == pytest.approx(icm.exact.iterate(nodes, 1).unwrapped, abs=1e-12)


@pytest.mark.parametrize("count", [1, 2, BLOCK - 1, BLOCK, BLOCK + 1, 3 * BLOCK + 5])
def test_image_does_not_depend_on_the_neighbours(count):
    icm = interpolated("cylinder", 5)
    points = places_in(icm.table.grid, count)
    together = icm.iterate(points, 3)
    for i in {0, count // 2, count - 1}:
        alone = icm.iterate(points[i], 3)
        assert np.array_equal(alone.points, together.points[i], equal_nan=True)


def test_rows_stop_where_the_table_ends_and_keep_their_periods():
    # The table of the shift x -> x + 1 with four cells on [0, 4]: linear, coefficients 1 everywhere.
    look_up = lookup_kernel(1, 1)
    table = np.concatenate([np.ones(5), np.zeros(WIDTH)])
    points, rotations, left = (
        np.array([[0.5], [3.5], [-0.5], [np.nan], [1.0]]),
        np.zeros((5, 1), np.int64),
        np.full(5, 3),
    )
    reach = np.array([1, 1, 0, 1], np.uint8)
    window = (np.zeros(1), np.ones(1), np.array([4]), np.zeros(1))
    line = (np.array([-np.inf]), np.zeros(1))
    look_up(points, rotations, left, table, np.array([1, 5]), *window, reach, *line)
    assert points[:, 0] == pytest.approx([2.5, 4.5, -0.5, np.nan, 2.0], nan_ok=True)
    assert left.tolist() == [1, 2, 3, 3, 2]


def test_a_row_that_stops_leaves_its_lane_to_another():
    """More rows than a block has, each with its own number of periods, and some that leave at once."""
    look_up = lookup_kernel(1, 1)
    n = 5 * BLOCK + 3
    rng = np.random.default_rng(2)
    initial_conditions, periods = rng.uniform(-1.0, 9.0, n), rng.integers(0, 12, n)
    points, rotations, left = initial_conditions[:, None].copy(), np.zeros((n, 1), np.int64), periods.copy()
    table = np.concatenate([np.ones(11), np.zeros(WIDTH)])
    window = (np.zeros(1), np.ones(1), np.array([10]), np.zeros(1))
    line = (np.array([-np.inf]), np.zeros(1))
    look_up(points, rotations, left, table, np.array([1, 11]), *window, np.zeros(0, np.uint8), *line)
    made = np.where(initial_conditions < 0.0, 0, np.minimum(periods, np.floor(11.0 - initial_conditions)))
    assert left.tolist() == (periods - made).tolist()
    assert points[:, 0] == pytest.approx(initial_conditions + made, abs=1e-14)


# --- tables of several periods

STEPS = np.array([1e-6, 1e-3, 1.0])  # what the maps over 1, 2 and 4 periods add here, to distinguish them


def steps_made(periods: int, reach: int) -> list[int]:
    """Count the look-ups in each of three tables that a row makes where its cell allows `reach` of them."""
    table = np.concatenate([*(np.full(1001, step) for step in STEPS), np.zeros(WIDTH)])
    points, rotations, left = np.zeros((1, 1)), np.zeros((1, 1), np.int64), np.array([periods])
    window = (np.zeros(1), np.ones(1), np.array([1000]), np.zeros(1))
    line = (np.array([-np.inf]), np.zeros(1))
    allowed = np.full(1000, reach, np.uint8)
    lookup_kernel(1, 1)(points, rotations, left, table, np.array([1, 1001]), *window, allowed, *line)
    assert left[0] == 0
    made = round(points[0, 0] / STEPS[0])
    return [made % 1000, made // 1000 % 1000, made // 1_000_000]


@pytest.mark.parametrize("periods", range(12))
def test_a_row_takes_the_longest_step_that_its_cell_and_its_periods_allow(periods):
    assert steps_made(periods, 1) == [periods, 0, 0]
    assert steps_made(periods, 2) == [periods % 2, periods // 2, 0]
    assert steps_made(periods, 3) == [periods % 2, periods % 4 // 2, periods // 4]


# --- the compiled kernel

PACKED_FLOOR = re.compile(r"\b(v?roundpd|vrndscalepd)\b|\bfrintm\s+v\d+\.2d")
PACKED_SUM = re.compile(r"\b(v?(add|mul|fmadd\d+)pd)\b|\bf(add|mul|mla)(\.2d)?\s+v\d+\.2d")


def assembly_of(order: int) -> str:
    look_up: Any = lookup_kernel(2, order)
    assembly: str = look_up.machine_code.assembly
    return assembly


@pytest.mark.parametrize("order", ORDERS)
def test_places_rotations_and_sums_are_vector_code(order):
    """Two floors bring places into the circle, two find cells and two rotations; each row takes so many products."""
    assembly = assembly_of(order)
    assert len(PACKED_FLOOR.findall(assembly)) >= 6
    assert len(PACKED_SUM.findall(assembly)) >= (order + 1) * ceil((order + 1) * 2 / WIDTH)
