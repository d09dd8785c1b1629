"""Cells of an interpolation grid in which the exact map is used, and the errors by which they are found."""

from math import pi, sin, sqrt

import numpy as np
import pytest
from maps_to_interpolate import COARSE, NONSMOOTH, ORDERS, errors_at, exact_map, interpolated

from cellmap import CellGrid, Status, discrete_map, interpolated_map

STEPS = {"kink": (0.1234,), "jump": (-1.0 / 1.7, 0.0, 1.0 / 1.7), "root": (0.4,), "narrow hill": (0.3,)}


@pytest.mark.filterwarnings("ignore:.* of the cells are fallback cells:UserWarning")
@pytest.mark.parametrize("tolerance", [1e-3, 1e-6])
@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("name", NONSMOOTH)
def test_fallback_cells_are_found_and_evaluated_with_the_exact_map(name, order, tolerance):
    exact = discrete_map(NONSMOOTH[name], {}, ("x",))
    icm = interpolated_map(exact, CellGrid((-1.0,), (1.0,), (200,)), order, "integrate", tolerance)
    places = np.linspace(-1.0, 1.0, 20_003)[:, None]
    assert errors_at(icm, places).max() < 3 * tolerance
    cells = icm.table.grid.locate(np.array(STEPS[name])[:, None])
    if not (name == "kink" and order == 1 and tolerance == 1e-3):  # there a straight line is good enough
        assert (
            icm.table.fallback[cells] | icm.table.fallback[cells - 1]
        ).all()  # a jump at a node is in the cell below


@pytest.mark.filterwarnings("ignore:.* of the cells are fallback cells:UserWarning")
@pytest.mark.parametrize("outside", ["escape", "integrate"])
@pytest.mark.parametrize("order", ORDERS)
def test_window_with_initial_conditions_that_have_no_image(order, outside):
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
    icm = interpolated("plane", (32, 48), order, tolerance=COARSE)
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


@pytest.mark.parametrize(("order", "cells", "fraction"), [(1, 16, 0.05), (3, 12, 1e-3), (5, 9, 1e-4)])
@pytest.mark.filterwarnings("ignore:.* of the cells are fallback cells:UserWarning")
def test_default_tolerance_is_a_fraction_of_a_cell(order, cells, fraction):
    grid = CellGrid((-pi,), (pi,), (cells,))
    lax, default = (interpolated_map(exact_map("circle"), grid, order, tolerance=t) for t in (COARSE, None))
    assert not lax.table.fallback.any()
    assert np.array_equal(default.table.fallback, lax.table.indicator > fraction)
    assert 0 < default.table.fallback.mean() < 1


def test_warns_where_most_cells_are_fallback_cells():
    noise = discrete_map(lambda x, p: (sin(1e4 * x[0]),), {}, ("x",))
    with pytest.warns(UserWarning, match="too coarse or the map not smooth; take more cells"):
        interpolated_map(noise, CellGrid((-1.0,), (1.0,), (50,)))


@pytest.mark.filterwarnings("ignore:.* of the cells are fallback cells:UserWarning")
@pytest.mark.parametrize("outside", ["escape", "integrate"])
@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("shape", [(1, 1), (2, 1), (1, 2), (2, 2), (3, 1)])
def test_grids_of_very_few_cells(shape, order, outside):
    """A strict tolerance leaves them to the exact map; every image in the window is right all the same."""
    icm = interpolated("cylinder", shape, order, outside=outside, tolerance=1e-6)
    assert icm.table.coefficients.shape == (shape[0] + order, shape[1] + order, 2)
    centres = icm.table.grid.centres()
    assert errors_at(icm, centres).max() < 1e-6
