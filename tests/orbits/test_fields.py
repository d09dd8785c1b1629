"""Finite-time exponents over a grid: exact values, both directions, and their relation to basins."""

from math import log, pi

import matplotlib.pyplot as plt
import numpy as np
import pytest

import systems
from cellmap import CellGrid, discrete_map, plot, set_threads, stroboscopic_map
from cellmap._compiled.kernels.stretching import append_steps
from cellmap.maps import jacobian
from cellmap.orbits import finite_time_exponents

SQUARE = CellGrid((-1.0, -1.0), (1.0, 1.0), (7, 5))


@pytest.mark.parametrize("dimension", [1, 2, 3, 4])
def test_a_linear_map_is_exact(linear, dimension):
    """Logarithms of the singular values of the power of the matrix, from NumPy's decomposition of that power."""
    matrix = np.random.default_rng(dimension).normal(size=(dimension, dimension))
    grid = CellGrid((-1.0,) * dimension, (1.0,) * dimension, tuple(range(2, 2 + dimension)))
    field = finite_time_exponents(linear(matrix), grid, 6)
    values = np.linalg.svd(np.linalg.matrix_power(matrix, 6), compute_uv=False)
    assert field.forward == pytest.approx(np.full(grid.shape, log(values[0]) / 6.0), rel=1e-12)
    assert field.backward == pytest.approx(np.full(grid.shape, -log(values[-1]) / 6.0), rel=1e-9)


def test_no_digits_are_lost_after_many_steps(linear):
    """The singular values 3^1000 and 0.1^1000 are beyond floating point, and their ratio is so after 11 steps."""
    field = finite_time_exponents(linear(np.diag([3.0, 0.1])), CellGrid((-1.0, -1.0), (1.0, 1.0), (1, 1)), 1000)
    assert field.forward[0, 0] == pytest.approx(log(3.0), rel=1e-12)
    assert field.backward[0, 0] == pytest.approx(log(10.0), rel=1e-12)


def test_the_derivative_of_the_flow():
    strobe = stroboscopic_map(systems.forced_pendulum())
    grid = CellGrid((-pi, -4.0), (pi, 4.0), (6, 4))
    field = finite_time_exponents(strobe, grid, 3)
    values = np.linalg.svd(jacobian(strobe, grid.centres(), 3), compute_uv=False)
    assert field.forward == pytest.approx(np.log(values[..., 0]) / 3.0, rel=1e-9)
    assert field.backward == pytest.approx(-np.log(values[..., 1]) / 3.0, rel=1e-6)
    assert field.forward - field.backward == pytest.approx(-0.2 * 2.0 * pi, abs=1e-9)  # the area shrinks by damping
    assert field.per_time == pytest.approx(field.forward / (2.0 * pi))
    assert field.images == pytest.approx(strobe.iterate(grid.centres(), 3).points, abs=1e-6)


def test_the_way_back_is_that_of_the_inverse_map():
    """Henon's inverse is known: the forward exponent of it at the image is the backward exponent."""
    henon = systems.henon_map()
    inverse = discrete_map(lambda x, p: (x[1] / 0.3, x[0] - 1.0 + 1.4 * (x[1] / 0.3) ** 2), {}, ("x", "y"))
    grid = CellGrid((-0.5, -0.1), (0.5, 0.1), (4, 3))
    field = finite_time_exponents(henon, grid, 3)
    values = np.linalg.svd(jacobian(inverse, field.images, 3), compute_uv=False)
    assert field.backward == pytest.approx(np.log(values[..., 0]) / 3.0, rel=1e-9)


def test_orbits_that_end_have_no_exponent():
    field = finite_time_exponents(systems.henon_map(), CellGrid((-5.0, -5.0), (5.0, 5.0), (11, 11)), 30)
    kept = systems.henon_map().iterate(field.grid.centres(), 30).status == 0
    assert np.array_equal(np.isfinite(field.forward), kept)
    assert np.array_equal(np.isfinite(field.images).all(axis=-1), kept)
    assert 0 < kept.sum() < kept.size
    assert f"{(~kept).sum()} orbits terminated" in repr(field)


def test_a_direction_that_vanishes(linear):
    field = finite_time_exponents(linear([[2.0, 0.0], [0.0, 0.0]]), SQUARE, 3)
    assert field.forward == pytest.approx(np.full(SQUARE.shape, log(2.0)))
    assert (field.backward == np.inf).all()
    nothing = finite_time_exponents(linear([[0.0, 0.0], [0.0, 0.0]]), SQUARE, 3)
    assert (nothing.forward == -np.inf).all()
    assert (nothing.backward == np.inf).all()


def test_slices_and_single_cells():
    """An axis of one cell is held at its centre; nothing is divided by the number of cells."""
    strobe = stroboscopic_map(systems.two_well_duffing())
    whole = finite_time_exponents(strobe, CellGrid((-1.0, -0.5), (1.0, 0.5), (9, 3)), 2)
    row = finite_time_exponents(strobe, CellGrid((-1.0, -1e-3), (1.0, 1e-3), (9, 1)), 2)
    assert row.forward[:, 0] == pytest.approx(whole.forward[:, 1], rel=1e-12)
    one = finite_time_exponents(strobe, CellGrid((-1.0, -0.5), (1.0, 0.5), (1, 1)), 2)
    assert one.forward[0, 0] == pytest.approx(whole.forward[4, 1], rel=1e-12)


def test_the_same_bits_for_any_number_of_threads():
    grid = CellGrid((-1.0, -1.0), (1.0, 1.0), (60, 50))
    results = []
    for count in (1, 2):
        set_threads(count)
        results.append(finite_time_exponents(systems.henon_map(), grid, 5))
    assert np.array_equal(results[0].forward, results[1].forward, equal_nan=True)
    assert np.array_equal(results[0].backward, results[1].backward, equal_nan=True)


def test_the_kernel_inverts_with_pivots():
    """Against NumPy's inverse, on matrices whose first pivot is 0."""
    steps = np.random.default_rng(5).normal(size=(4, 3, 3))
    steps[:, 0, 0] = 0.0
    there, back = (np.broadcast_to(np.eye(3), (4, 3, 3)).copy() for _ in range(2))
    size_there, size_back = np.zeros(4), np.zeros(4)
    append_steps(steps, there, size_there, back, size_back)
    append_steps(steps, there, size_there, back, size_back)
    twice = steps @ steps
    assert there * np.exp(size_there)[:, None, None] == pytest.approx(twice, rel=1e-9, abs=1e-12)
    assert back * np.exp(size_back)[:, None, None] == pytest.approx(np.linalg.inv(twice), rel=1e-8, abs=1e-10)


def test_the_figure():
    field = finite_time_exponents(stroboscopic_map(systems.forced_pendulum()), CellGrid((-pi, -4), (pi, 4), (9, 6)), 2)
    ax = plot.exponent_field(field, per_time=True)
    drawn = np.asarray(ax.collections[0].get_array()).reshape(6, 9)
    assert drawn == pytest.approx(field.per_time.T)
    back = plot.exponent_field(field, backward=True)
    assert np.asarray(back.collections[0].get_offsets()) == pytest.approx(field.images.reshape(-1, 2))
    line = finite_time_exponents(systems.logistic_map(), CellGrid((0,), (1,), (5,)), 2)
    for backward, places in ((False, line.grid.axis(0)), (True, line.images[:, 0])):
        curve = np.asarray(plot.exponent_field(line, backward=backward).get_lines()[0].get_xydata())
        assert curve[:, 0] == pytest.approx(places)
        known = line.backward if backward else line.forward
        assert curve[:, 1] == pytest.approx(np.where(np.isfinite(known), known, np.nan), nan_ok=True)
    cat = discrete_map(lambda x, p: (2 * x[0], x[1] / 2, x[2]), {}, ("x", "y", "z"))
    solid = finite_time_exponents(cat, CellGrid((0, 0, 0), (1, 1, 1), (2, 2, 2)), 2)
    with pytest.raises(ValueError, match="two axes of more than one cell"):
        plot.exponent_field(solid)
    plt.close("all")
