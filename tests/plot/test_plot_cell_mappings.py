"""Figures of cell mappings."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
import pytest

import systems
from cellmap import CellGrid, plot, stroboscopic_map
from cellmap.sets import generalized_cell_mapping, simple_cell_mapping

mpl.use("Agg")
import matplotlib.pyplot as plt


@pytest.fixture(scope="module")
def wells():
    return stroboscopic_map(systems.two_well_duffing()), CellGrid((-2, -2.5), (2, 2), (40, 45))


def test_groups_have_colours_and_periodic_cells_are_black(wells):
    mapping = simple_cell_mapping(*wells)
    ax = plot.cell_mapping(mapping)
    (image,) = ax.get_images()
    assert image.get_extent() == [-2.0, 2.0, -2.5, 2.0]
    drawn = np.asarray(image.get_array())
    assert drawn.shape == (45, 40, 3)
    black = np.argwhere((drawn == 0).all(axis=-1))
    periodic = np.argwhere(((mapping.steps == 0) & (mapping.groups >= 0)).T)
    np.testing.assert_array_equal(black, periodic)


def test_steps(wells):
    mapping = simple_cell_mapping(*wells, periods=3)
    ax = plot.cell_mapping(mapping, ax=plt.figure().add_subplot(), show_steps=True)
    drawn = np.ma.filled(np.ma.asarray(ax.get_images()[0].get_array(), float), np.nan)
    expected = np.where(mapping.groups >= 0, 3.0 * mapping.steps, np.nan).T
    np.testing.assert_array_equal(drawn, expected)


def test_probabilities_and_domiciles(wells):
    chain = generalized_cell_mapping(*wells, samples=(2, 2))
    for number in (0, -1):
        image = plot.absorption(chain, group=number).get_images()[0]
        assert image.get_clim() == (0.0, 1.0)
        np.testing.assert_array_equal(np.asarray(image.get_array()), chain.absorption[..., number].T)
    image = plot.absorption(chain).get_images()[0]
    np.testing.assert_array_equal(np.asarray(image.get_array()), chain.domiciles.T)


def test_measures(wells):
    chain = generalized_cell_mapping(*wells, samples=(2, 2))
    drawn = np.ma.asarray(plot.invariant_measure(chain).get_images()[0].get_array())
    assert np.count_nonzero(np.isfinite(np.ma.filled(drawn, np.nan))) == len(chain.closed[0].cells)
    line = generalized_cell_mapping(systems.logistic_map(4.0), CellGrid((0,), (1 + 1e-9,), (100,)))
    (curve,) = plot.invariant_measure(line).get_lines()
    np.testing.assert_array_equal(curve.get_ydata(), line.density())


def test_bad_input(wells):
    chain = generalized_cell_mapping(*wells, samples=(1, 1))
    with pytest.raises(TypeError, match="CellMapping"):
        plot.cell_mapping(chain)
    with pytest.raises(TypeError, match="CellChain"):
        plot.absorption(3)
    with pytest.raises(TypeError, match="CellChain"):
        plot.invariant_measure(None)
    with pytest.raises(ValueError, match="group=99"):
        plot.absorption(chain, group=99)
    with pytest.raises(ValueError, match="two axes"):
        plot.cell_mapping(simple_cell_mapping(systems.logistic_map(4.0), CellGrid((0,), (1,), (100,))))
