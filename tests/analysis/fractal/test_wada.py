"""Wada basins: constructed images, published parameters of the forced pendulum, and what is not concluded."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

import systems
from cellmap import CellGrid, discrete_map, find_basins, interpolated_map, plot, stroboscopic_map
from cellmap.analysis.fractal import wada_grid, wada_merging


def stripes(width, basins=3, shape=(120, 90)):
    return np.arange(shape[0])[:, None] // width % basins + np.zeros(shape, int)


def sectors(cells=200):
    """Three smooth basins that meet in one point."""
    x = (np.arange(cells) + 0.5) / cells - 0.5
    return np.floor((np.arctan2(x[:, None], x[None, :]) + pi) / (2 * pi / 3)).astype(int)


def pendulum(forcing):
    exact = stroboscopic_map(systems.forced_pendulum(forcing=forcing))
    return interpolated_map(exact, CellGrid((-pi, -8.0), (pi, 9.0), (384, 768)), outside="integrate")


def window(cells):
    return CellGrid((-pi, -2.0), (pi, 4.0), (cells, cells))


def newton(x, p):
    square, product = x[0] ** 2 - x[1] ** 2, 2.0 * x[0] * x[1]
    size = 3.0 * (square**2 + product**2)
    return 2.0 * x[0] / 3.0 + square / size, 2.0 * x[1] / 3.0 - product / size


@pytest.fixture(scope="module")
def roots():
    """Basins of Newton's method for z^3 = 1."""
    return find_basins(discrete_map(newton, {}, ("x", "y")), CellGrid((-2.0, -1.5), (2.02, 1.53), (90, 60)))


# --- merging


@pytest.mark.parametrize("shape", [(120, 90), (90, 120), (200, 40)])
def test_merged_stripes(shape):
    """Columns of one cell in three colours are Wada; wide stripes are not (REFERENCES.md)."""
    assert wada_merging(stripes(1, shape=shape)).verdict == "Wada"
    assert wada_merging(stripes(1, shape=shape).T).verdict == "Wada"
    wide = wada_merging(stripes(30, shape=shape))
    assert wide.verdict == "not"
    assert wide.apart.max() > 0.4


@pytest.mark.parametrize("labels", [stripes(1, 2), stripes(30, 2), np.random.default_rng(0).integers(0, 2, (90, 90))])
def test_two_basins_are_not_wada(labels):
    found = wada_merging(labels)
    assert found.verdict == "not"
    assert found.largest.max() == 0.0


def test_distances_are_known():
    """Stripes of ten: the merged boundaries are one stripe apart, and next to it where they share a basin."""
    found = wada_merging(stripes(10, 3, (30, 40)), radius=2)
    assert found.basins == (0, 1, 2)
    assert found.largest[0, 2] == 10.0  # the cells of 0 | 1 lie at 9 and 10, those of 1 | 2 at 19 and 20
    assert found.median[0, 2] == 9.5
    assert found.largest[1, 0] == 10.0
    assert found.apart[0, 2] == 1.0
    assert found.cells == 4 * 40


def test_circles():
    """On a circle stripes 0 1 2 meet again: each basin has two boundaries."""
    line = wada_merging(stripes(10, 3, (30, 40)))
    circle = wada_merging(stripes(10, 3, (30, 40)), wraps=(True, False))
    assert (line.cells, circle.cells) == (4 * 40, 6 * 40)
    assert circle.verdict == "not"


def test_basins_that_meet_in_a_point_are_not_wada():
    for labels in (sectors(), sectors(100)):
        assert wada_merging(labels).verdict == "not"


def test_partially_wada():
    """One half in stripes of one cell of three colours, the other in wide stripes of two of them."""
    labels = np.concatenate([stripes(1, 3, (120, 60)), stripes(10, 2, (120, 60))], axis=1)
    assert wada_merging(labels).verdict == "partially"


def test_labels_without_a_basin():
    """Cells without a basin bound none: two basins with gaps between them have no boundary."""
    labels = stripes(10, 3, (60, 40))
    gaps = np.where(labels == 2, -1, labels)
    assert wada_merging(gaps).basins == (0, 1)
    assert wada_merging(np.where(labels == 1, -3, labels)).cells == 2 * 40  # 2 | 0 alone
    assert wada_merging(np.where(labels == 2, -2, labels), include=(-2,)).basins == (-2, 0, 1)
    fine = stripes(1).astype(float)
    fine[:40, :40] = np.nan
    assert wada_merging(fine).verdict == "Wada"
    assert wada_merging(np.zeros((50, 50), int)).verdict == "not"


@pytest.mark.parametrize("shape", [(400, 12), (90, 6), (9, 9)])
def test_narrow_images_take_a_smaller_radius(shape):
    assert wada_merging(stripes(1, 3, shape)).verdict == "Wada"
    assert wada_merging(stripes(1, 3, shape).T).verdict == "Wada"
    assert wada_merging(stripes(3, 3, shape)).verdict == "not"
    assert wada_merging(stripes(1, 2, shape)).verdict == "not"


# --- the grid method


@pytest.mark.thorough
def test_wada_pendulum():
    """th'' + 0.2 th' + sin th = 1.66 cos t has three Wada basins (Nusse, Ott, Yorke 1995; Daza et al. 2015)."""
    point_map = pendulum(1.66)
    assert wada_merging(find_basins(point_map, window(400))).verdict == "Wada"
    found = wada_grid(find_basins(point_map, window(100)), refinements=12)
    assert len(found.basins) == 3
    assert found.verdict == "Wada"
    assert found.fractions[0, 3] < 0.8  # the centres alone do not tell
    assert (np.diff(found.boxes[:, 3]) >= 0).all()
    assert found.fractions[8, 2] < 0.5 * found.fractions[6, 2]
    assert (found.boxes.sum(axis=1) == 100 * 100).all()
    assert found.colours.shape == (100, 100)


def test_smooth_basins_are_not_wada_on_the_grid():
    """Sectors that meet in one point, from a rule, on a grid that is not square."""
    still = discrete_map(lambda x, p: (x[0] + 0.0 * x[1], x[1]), {}, ("x", "y"))

    def sector(points):
        return np.floor((np.arctan2(points[:, 1], points[:, 0]) + pi) / (2.001 * pi / 3)).astype(int)

    found = wada_grid(still, CellGrid((-1, -1), (1, 1), (80, 60)), outcome=sector, refinements=8)
    assert found.basins == (0, 1, 2)
    assert found.verdict == "not"
    assert found.fractions[-1, 3] < 0.1


@pytest.mark.parametrize("cells", [0.1, 0.5, 1.0, 1.5])
def test_smooth_basins_as_narrow_as_boxes_are_not_wada(cells):
    """Each box has all of three basins around it, but no point of the boundary has."""
    still = discrete_map(lambda x, p: (x[0], x[1]), {}, ("x", "y"))
    region = CellGrid((-2.0, -1.0), (2.02, 1.0), (90, 40))

    def stripe(points):
        return np.floor(points[:, 0] / (cells * region.widths[0]) + 1000.0).astype(int) % 3

    found = wada_grid(still, region, outcome=stripe)
    assert found.fractions[-1, 3] > 0.3
    assert found.verdict == "not"
    assert found.closer.tolist() == [0, 0, 400, 0]
    assert replace(found, closer=np.array([0, 0, 380, 20])).verdict == "not"  # a twentieth has three basins


def test_newtons_method_for_three_roots_is_wada(roots):
    """The boundary of the basins of z^3 = 1 is the Julia set of Newton's map, which all three share (Peitgen 1986)."""
    found = wada_grid(roots)
    assert found.verdict == "Wada"
    assert found.closer[3] > 0.98 * found.closer.sum() > 350
    for unresolved in (wada_grid(roots, refinements=0), wada_grid(roots, max_points=100)):
        assert unresolved.verdict == "not"


def test_initial_conditions_without_a_basin_have_no_colour():
    """A strip that diverges does not add a colour, unless it is counted."""
    cubic = discrete_map(lambda x, p: (x[0] ** 3, x[1] / 2), {}, ("x", "y"))

    def rule(points):
        return np.where(np.abs(points[:, 0]) < 0.5, 0, -1)

    region = CellGrid((-2, -1), (2, 1), (60, 30))
    apart = wada_grid(cubic, region, outcome=rule)
    assert apart.basins == (0,)
    assert apart.boundary == 0
    both = wada_grid(cubic, region, outcome=rule, include=(-2,))
    assert both.basins == (-2, 0)
    assert both.verdict == "not"
    assert both.boundary == 4 * 30


def test_plots(roots):
    found = wada_grid(roots, refinements=5)
    assert plot.wada(found).get_xlabel() == "step"
    assert plot.wada(wada_merging(stripes(1))).get_title() == "Wada"
    with pytest.raises(TypeError, match="give a WadaGrid"):
        plot.wada(3)
