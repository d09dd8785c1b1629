"""Figures of box sets, Morse graphs, transfer operators, cell mappings, fits, dimensions and certificates."""

import numpy as np
import pytest

import systems
from cellmap import CellGrid, discrete_map, find_basins, plot, stroboscopic_map
from cellmap.analysis.boundary import chaotic_saddle
from cellmap.basins import prove
from cellmap.sets import generalized_cell_mapping, simple_cell_mapping

CUBIC = discrete_map(
    lambda x, p: (1.5 * x[0] - x[0] ** 3 / 2, 1.5 * x[1] - x[1] ** 3 / 2), {}, ("x", "y"), name="two cubics"
)
TENT = discrete_map(lambda x, p: (1 - abs(2 * x[0] - 1),), {}, ("x",))


@pytest.fixture(scope="module")
def wells():
    return stroboscopic_map(systems.two_well_duffing()), CellGrid((-2, -2.5), (2, 2), (40, 45))


@pytest.fixture(scope="module")
def chain(wells):
    return generalized_cell_mapping(*wells, samples=(2, 2))


def test_what_cannot_be_shown(wells, chain):
    with pytest.raises(TypeError, match="CellMapping"):
        plot.cell_mapping(chain)
    with pytest.raises(ValueError, match="group=99"):
        plot.absorption(chain, group=99)
    with pytest.raises(ValueError, match="two axes"):
        plot.cell_mapping(simple_cell_mapping(systems.logistic_map(4.0), CellGrid((0,), (1,), (100,))))


def test_proved_cells_and_balls_do_not_widen_the_window():
    """The attractor (10, 0) of a contraction may be outside of the window, a slice of three dimensions."""
    shift = discrete_map(lambda x, p: (x[0] / 2 + 5, x[1] / 2, x[2] / 2), {}, ("x", "y", "z"))
    for window, cells in (((-1.0, 1.0, -1.0, 1.0), (6, 4, 1)), ((9.0, 11.0, 3.0, 5.0), (6, 2, 1))):
        left, right, bottom, top = window
        grid = CellGrid((left, bottom, 0), (right, top, 0), cells)
        ax = plot.proof(prove(find_basins(shift, grid), splits=0))
        assert (*ax.get_xlim(), *ax.get_ylim()) == window
        assert ax.get_lines()[0].get_xydata() == pytest.approx(np.array([[10.0, 0.0]]), abs=1e-9)


def test_chaotic_saddles_are_drawn_in_a_plane_or_against_their_images():
    tent = discrete_map(lambda x, p: (1.5 - 3 * abs(x[0] - 0.5),), {}, ("x",))
    (drawn,) = plot.chaotic_saddle(chaotic_saddle(tent, CellGrid((0,), (1,), (1,)), n_points=50)).get_lines()
    x, after = drawn.get_xydata().T
    assert after == pytest.approx(1.5 - 3 * np.abs(x - 0.5), abs=1e-6)
    plane = discrete_map(lambda x, p: (1.5 - 3 * abs(x[0] - 0.5), x[1] / 4), {}, ("x", "y"))
    ax = plot.chaotic_saddle(chaotic_saddle(plane, CellGrid((0, -1), (1, 1), (2, 2)), n_points=50))
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$x$", "$y$")
