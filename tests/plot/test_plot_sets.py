"""Figures of box sets, Morse graphs and transfer operators."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
import pytest

from cellmap import CellGrid, discrete_map, plot
from cellmap.sets import BoxSet, morse_graph, transfer_operator

mpl.use("Agg")

CUBIC = discrete_map(
    lambda x, p: (1.5 * x[0] - x[0] ** 3 / 2, 1.5 * x[1] - x[1] ** 3 / 2), {}, ("x", "y"), name="two cubics"
)
TENT = discrete_map(lambda x, p: (1 - abs(2 * x[0] - 1),), {}, ("x",))


def test_boxes_are_drawn_where_they_are():
    some = BoxSet(CellGrid((0, 0), (4, 2), (4, 2)), [1, 6])
    ax = plot.boxes(some, names=("q", "v"), facecolor="red")
    corners = [path.vertices[:4] for path in ax.collections[0].get_paths()]
    np.testing.assert_allclose(corners[0], [[0, 1], [1, 1], [1, 2], [0, 2]])
    np.testing.assert_allclose(corners[1], [[3, 0], [4, 0], [4, 1], [3, 1]])
    assert (ax.get_xlim(), ax.get_ylim(), ax.get_xlabel()) == ((0, 4), (0, 2), "$q$")


def test_values_are_colours_and_heights():
    some = BoxSet(CellGrid((0, 0, 0), (1, 1, 1), (2, 2, 2)), [1, 6])
    ax = plot.boxes(some, values=[3.0, 5.0], coordinates=(2, 0))
    assert ax.collections[0].get_array().tolist() == [3.0, 5.0]
    line = plot.boxes(BoxSet(CellGrid((0,), (1,), (4,)), [1, 3]), values=[2.0, 7.0])
    assert [patch.get_height() for patch in line.patches] == [2.0, 7.0]
    with pytest.raises(ValueError, match="one for each of the 2 boxes"):
        plot.boxes(some, values=[1.0])


def test_morse_sets_have_colours_and_arrows():
    graph = morse_graph(CUBIC, CellGrid((-1.7, -1.7), (1.6, 1.6), (2, 2)), 5, periods=3)
    ax = plot.morse_graph(graph)
    assert len(ax.collections) == 9 and len(ax.texts) == 12
    assert sum("attracting" in t.get_text() for t in ax.get_legend().get_texts()) == 4


def test_operators():
    operator = transfer_operator(BoxSet.full(CellGrid((0,), (1,), (32,))), TENT)
    ax = plot.eigenvector(operator)
    np.testing.assert_allclose([patch.get_height() for patch in ax.patches], 1.0)
    plot.eigenvector(operator, index=1)
    ax = plot.eigenvalues(operator, n_eigenvalues=4)
    assert ax.lines[1].get_xdata()[0] == pytest.approx(1.0)
    plane = transfer_operator(BoxSet.full(CellGrid((-1, -1), (1, 1), (9, 9))), CUBIC, 5)
    assert plot.eigenvector(plane, index=1).collections
