"""Evaluation of interpolated maps against SciPy's B-splines."""

import re
from itertools import product
from math import ceil
from typing import Any

import numpy as np
import pytest
from maps_to_interpolate import COARSE, ORDERS, interpolated
from scipy.interpolate import BSpline, NdBSpline
from two_tiers import at_once

from cellmap import CellGrid, PointMap, Status, angle, discrete_map, interpolated_map
from cellmap._compiled.codegen.lookup import BLOCK, lookup_kernel
from cellmap._compiled.codegen.spline_sum import WIDTH, basis_polynomials
from cellmap.maps.orbit_batch import Orbits

SHAPES = {
    "circle": (24,),
    "line": (20,),
    "torus": (24, 18),
    "cylinder": (20, 12),
    "plane": (12, 16),
    "tube": (6, 8, 7),
    "coupled standard maps": (8, 9, 5, 6),
}


def table_of(name: str, order: int) -> PointMap:
    return interpolated(name, SHAPES[name], order, tolerance=COARSE)


def places_in(grid: CellGrid, number: int = 500) -> np.ndarray:
    return np.random.default_rng(1).uniform(grid.lower, grid.upper, (number, grid.dimension))


def test_columns_of_an_array_may_lie_one_behind_the_other():
    point_map = table_of("plane", 3)
    points = places_in(point_map.table.grid)
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
@pytest.mark.parametrize("name", SHAPES)
def test_look_up_equals_scipys_tensor_spline(name, order):
    icm = table_of(name, order)
    table = icm.table
    points = places_in(table.grid)
    knots = tuple(
        a + (np.arange(n + 2 * order + 1) - order) * w
        for a, n, w in zip(table.grid.lower, table.grid.shape, table.grid.widths, strict=True)
    )
    displacement = NdBSpline(knots, table.coefficients, order)(points)
    assert icm.iterate(points, 1).unwrapped - points == pytest.approx(displacement, abs=1e-13)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("name", SHAPES)
def test_nodes_have_their_exact_images(name, order):
    icm = table_of(name, order)
    grid = icm.table.grid
    corners = [grid.edges(j)[:-1] if grid.wraps[j] else grid.edges(j) for j in range(grid.dimension)]
    nodes = np.stack(np.meshgrid(*corners, indexing="ij"), axis=-1).reshape(-1, grid.dimension)
    assert icm.iterate(nodes, 1).unwrapped == pytest.approx(icm.exact.iterate(nodes, 1).unwrapped, abs=1e-12)


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


def edges_and_neighbours(grid: CellGrid, axis: int) -> np.ndarray:
    edges = np.asarray(grid.edges(axis))
    return np.concatenate([np.nextafter(edges, -np.inf), edges, np.nextafter(edges, np.inf)])


def linear(dimension: int, angles: int = 0) -> PointMap:
    """Splines of every degree have its images to rounding; angles advance by a constant."""

    def step(x, p):
        return tuple(x[j] + 0.3 if j < angles else 0.5 * x[j] + 0.1 * x[j - 1] * (j > angles) for j in range(dimension))

    axes = [angle(f"a{j}") if j < angles else f"x{j}" for j in range(dimension)]
    return discrete_map(step, {}, axes)


SIZES = {1: (64,), 2: (16, 8), 3: (4, 8, 2), 4: (2, 1, 2, 4)}


@pytest.mark.parametrize(
    ("dimension", "order"), at_once([(d, k) for d in SIZES for k in (1, 3, 5) if (d, k) != (4, 5)], later=[(4, 5)])
)
def test_points_at_edges_of_cells(dimension, order) -> None:
    """All edges with the numbers before and behind them, in all combinations; cells are powers of two and begin at 0.

    What is in the window, its edges included, has its image; what is a rounding beyond has left.
    """
    shape = SIZES[dimension]
    grid = CellGrid((0.0,) * dimension, tuple(n / 4 for n in shape), shape)
    exact = linear(dimension)
    points = np.array(list(product(*(edges_and_neighbours(grid, j) for j in range(dimension)))))
    inside = ((points >= grid.lower) & (points <= grid.upper)).all(axis=1)
    expected = exact.iterate(points, 1).points
    image = interpolated_map(exact, grid, order, "escape").iterate(points, 1)
    assert np.array_equal(image.status == Status.ESCAPED, ~inside)
    assert image.points[inside] == pytest.approx(expected[inside], abs=1e-14)
    carried = interpolated_map(exact, grid, order, outside="integrate").iterate(points, 1)
    assert (carried.status == Status.OK).all()
    assert np.array_equal(carried.points[~inside], expected[~inside])
    assert np.array_equal(carried.points[inside], image.points[inside])
