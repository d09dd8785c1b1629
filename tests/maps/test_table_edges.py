"""Points at the edges of the cells of tables in one to four dimensions, and a rounding before and behind them."""

from __future__ import annotations

from itertools import product
from math import pi

import numpy as np
import pytest

from cellmap import CellGrid, PointMap, Status, angle, discrete_map, interpolated_map


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
    ("dimension", "order"),
    [pytest.param(d, k, marks=pytest.mark.slow) if (d, k) == (4, 5) else (d, k) for d in SIZES for k in (1, 3, 5)],
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


@pytest.mark.parametrize("dimension", SIZES)
def test_points_at_edges_of_cells_of_any_width(dimension) -> None:
    """Windows whose edges are no round numbers, angles among them."""
    rng = np.random.default_rng(dimension)
    for angles in range(2):
        exact = linear(dimension, angles)
        for _ in range(8 if dimension < 4 else 2):
            lower, shape = rng.uniform(-3, 3, dimension), [max(3, n // 2) for n in SIZES[dimension]]
            upper = np.where(np.arange(dimension) < angles, lower + 2 * pi, lower + rng.uniform(0.1, 5, dimension))
            grid = CellGrid(tuple(lower), tuple(upper), tuple(shape))
            table = interpolated_map(exact, grid, 3 if dimension < 4 else 1, "escape")
            edges = np.array(list(product(*(grid.edges(j) for j in range(dimension)))))
            image = table.iterate(edges, 1)
            assert (image.status == Status.OK).all()
            assert image.unwrapped == pytest.approx(exact.iterate(edges, 1).unwrapped, abs=1e-13)
            near = np.array(list(product(*(edges_and_neighbours(grid, j) for j in range(dimension)))))
            image = table.iterate(near, 1)
            stayed = image.status == Status.OK
            assert stayed.mean() > 0.3
            assert image.unwrapped[stayed] == pytest.approx(exact.iterate(near[stayed], 1).unwrapped, abs=1e-13)
