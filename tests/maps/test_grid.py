"""Cells: every place in exactly one of them."""

import math
from math import inf, nan, nextafter, pi

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import cellmap._lib.checks
from cellmap import (
    CellGrid,
    Coordinate,
    ForcedSystem,
    angle,
    find_basins,
    load_basins,
    plot,
    save_basins,
    stroboscopic_map,
)
from cellmap.analysis.fractal import image_uncertainty_exponent, uncertainty_exponent

finite = st.floats(-1e300, 1e300)


@st.composite
def axes(draw: st.DrawFn, wraps: bool | None = None) -> CellGrid:
    """Grids of one axis, from the narrowest window that has cells to the widest."""
    lower, upper = sorted((draw(finite), draw(finite)))
    assume(lower < upper)
    cells = draw(st.integers(1, 1000))
    wrap = draw(st.booleans()) if wraps is None else wraps
    try:
        return CellGrid((lower,), (upper,), (cells,), (wrap,))
    except ValueError:
        assume(False)
        raise


@given(axes(wraps=False), st.lists(finite, min_size=1, max_size=20))
def test_outside_is_minus_one_and_inside_is_a_cell(grid: CellGrid, places: list[float]) -> None:
    cells = grid.locate(np.array(places)[:, None])
    for x, cell in zip(places, cells, strict=True):
        assert (0 <= cell < grid.size) if grid.lower[0] <= x < grid.upper[0] else cell == -1


@given(axes())
def test_a_cell_owns_its_lower_edge_and_not_its_upper_one(grid: CellGrid) -> None:
    n, edges = grid.size, grid.edges(0)
    assert np.array_equal(grid.locate(edges[:-1, None]), np.arange(n))
    below = np.nextafter(edges[1:], -inf)
    assert np.array_equal(grid.locate(below[:, None]), np.arange(n))
    assert grid.locate([grid.upper[0]]) == (0 if grid.wraps[0] else -1)
    assert grid.locate([nextafter(grid.lower[0], -inf)]) == (n - 1 if grid.wraps[0] else -1)


@given(st.floats(1e-300, 1e300), st.integers(1, 1000), st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=20))
def test_symmetric_windows_have_cells_that_are_mirror_images(half: float, n: int, fractions: list[float]) -> None:
    grid = CellGrid((-half,), (half,), (n,))
    for places in (grid.axis(0), grid.edges(0), grid.along(0, np.arange(-9, n + 10))):
        assert np.array_equal(places, -places[::-1])
    points = np.array(fractions)[:, None] * half
    assume(not np.isin(np.append(points, -points), grid.edges(0)).any())
    assert np.array_equal(grid.locate(-points), n - 1 - grid.locate(points))


@given(st.floats(-50.0, 50.0), st.integers(-5, 5), st.integers(1, 400))
def test_full_rotations_do_not_matter(x: float, rotations: int, cells: int) -> None:
    # Dyadic cells and places: adding turns is exact.
    x = round(x * 64) / 64
    grid = CellGrid((-4.0,), (4.0,), (2 ** (cells % 7),), (True,))
    assert grid.locate([x]) == grid.locate([x + 8.0 * rotations])


@pytest.mark.parametrize("place", [nan, inf, -inf])
@pytest.mark.parametrize("wraps", [False, True])
def test_what_is_no_place_is_in_no_cell(place: float, wraps: bool) -> None:
    assert CellGrid((-1.0,), (1.0,), (4,), (wraps,)).locate([place]) == -1
    assert CellGrid((-1.0, 0.0), (1.0, 1.0), (4, 4), (wraps, False)).locate([place, 0.5]) == -1


def test_cells_are_numbered_row_by_row() -> None:
    grid = CellGrid((0.0, 0.0, 0.0), (2.0, 3.0, 4.0), (2, 3, 4))
    assert np.array_equal(grid.locate(grid.centres()), np.arange(24).reshape(2, 3, 4))
    assert grid.locate([1.5, 2.5, 0.5]) == 1 * 12 + 2 * 4
    assert grid.locate([1.5, 3.5, 0.5]) == -1


def test_centres_edges_and_widths() -> None:
    grid = CellGrid((-1.0, 0.0), (1.0, 1.0), (4, 2))
    assert np.array_equal(grid.widths, [0.5, 0.5])
    assert np.array_equal(grid.axis(0), [-0.75, -0.25, 0.25, 0.75])
    assert np.array_equal(grid.edges(1), [0.0, 0.5, 1.0])
    assert np.array_equal(grid.centres()[3, 1], [0.75, 0.75])
    assert (grid.dimension, grid.size) == (2, 8)


def test_axes_wrap_where_they_cover_one_period() -> None:
    coordinates = (angle("theta"), Coordinate("v"))
    assert CellGrid((-pi, -1.0), (pi, 1.0), (4, 4)).on(coordinates).wraps == (True, False)
    assert CellGrid((0.0, -1.0), (2 * pi, 1.0), (4, 4)).on(coordinates).wraps == (True, False)
    assert CellGrid((-1.0, -pi), (1.0, pi), (4, 4)).on(coordinates).wraps == (False, False)


def test_memory_is_refused_before_it_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cellmap._lib.checks, "memory_available", lambda: 10**9)
    grid = CellGrid((0.0, 0.0), (1.0, 1.0), (10**4, 10**4))
    with pytest.raises(MemoryError, match=r"100,000,000 cells needs 1.6 GB and 1 GB are free: take fewer cells"):
        grid.centres()
    assert math.isclose(grid.size, 1e8)
    assert "10000 x 10000 cells" in str(grid)


def wells(t, x, p):
    return x[1], x[0] - x[0] ** 3 - 0.3 * x[1], x[0] - x[2]


MAP = stroboscopic_map(ForcedSystem(wells, {}, 1.0, ("x", "v", "z")))
SLICE = CellGrid((-2, -2, 0.5), (2, 2, 0.5), (12, 12, 1))


def test_a_slice_is_where_it_is_said_to_be(tmp_path):
    """Its labels are those of initial conditions with the value of the slice; it survives a file."""
    basins = find_basins(MAP, SLICE)
    centres = SLICE.centres()
    assert (centres[..., 2] == 0.5).all()
    listed = find_basins(MAP, centres.reshape(-1, 3))
    assert np.array_equal(basins.labels.ravel(), listed.labels)
    assert basins.verify(50).wrong == 0
    save_basins(basins, tmp_path / "slice.h5")
    assert load_basins(tmp_path / "slice.h5").grid == SLICE
    ax = plot.basins(basins)
    assert (ax.get_ylabel(), ax.get_title()) == ("$v$", "wells, $z$ = 0.5")
    assert uncertainty_exponent(basins, max_pairs=5000).dimension == 2
    assert image_uncertainty_exponent(basins).dimension == 2
