"""Basin entropy and the test for fractal boundaries: exact values, published ones, and what is not said."""

from math import log, pi

import numpy as np
import pytest

import systems
from cellmap import CellGrid, find_basins, plot
from cellmap.analysis.fractal import basin_entropy, fractal_boundary_test, smooth_boundary_entropy
from cellmap.analysis.fractal.randomness_test import _clustered_error
from cellmap.analysis.fractal.uncertainty_fits import SMOOTH

SEEDS = [0, *(pytest.param(seed, marks=pytest.mark.thorough) for seed in (1, 2))]


@pytest.fixture(scope="module")
def grebogi():
    return find_basins(systems.grebogi_ott_yorke_map(), CellGrid((0.0, -0.5), (2 * pi, 0.5), (300, 300)))


def mixed(basins=2, shape=(300, 300)):
    return np.random.default_rng(0).integers(0, basins, shape)


def disc(cells, radius=0.3):
    x = (np.arange(cells) + 0.5) / cells - 0.5
    return np.hypot(*np.meshgrid(x, x)) < radius


def stripes(width, basins=3):
    return np.arange(400)[:, None] // width % basins + np.zeros((400, 400), int)


# --- entropy


def test_map_of_grebogi_ott_and_yorke_where_it_was_published():
    """0.403 and 0.603 to all digits, of initial conditions on the edges of the window too (Daza et al. 2016).

    Half a cell makes a difference of 0.005: the boundary is as fine as the cells, and no two images of it are alike.
    """
    axes = np.linspace(0.0, 2 * pi, 300), np.linspace(-0.5, 0.5, 300)
    initial_conditions = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    labels = find_basins(systems.grebogi_ott_yorke_map(), initial_conditions).labels
    found = basin_entropy(labels, box_size=6)
    assert (found.entropy, found.boundary_entropy) == pytest.approx((0.403, 0.603), abs=5e-4)
    assert found.count == 2500 and 0.002 < max(found.standard_error, found.boundary_error) < 0.007
    at_random = basin_entropy(labels, box_size=6, n_positions=2500)
    for name in ("entropy", "boundary_entropy"):
        assert getattr(at_random, name) == pytest.approx(getattr(found, name), abs=0.02)


def test_known_boxes():
    """A box that two basins halve: ln 2; one quarter of another basin: 0.5623."""
    found = basin_entropy([[0, 0, 1, 1, 2, 2], [0, 0, 1, 2, 2, 0]], box_size=2)
    quarter = -0.25 * log(0.25) - 0.75 * log(0.75)
    assert found.boxes == pytest.approx(np.array([[0.0, quarter, quarter]]))
    assert found.entropy == pytest.approx(2 * quarter / 3)
    assert found.boundary_entropy == pytest.approx(quarter)
    assert (found.boundary_count, found.basins) == (2, 3)


@pytest.mark.parametrize("basins", [2, 3, 5])
def test_mixed_basins_reach_their_number(basins):
    """ln k but for (k - 1)/(2 n) in boxes of n cells (Miller 1955)."""
    found = basin_entropy(mixed(basins), box_size=20)
    assert found.entropy == pytest.approx(log(basins) - (basins - 1) / 800, abs=4 * found.standard_error)
    assert found.above_ln2 == found.fractal == (basins > 2)


def test_any_dimension_and_boxes_that_are_not_square():
    solid = np.arange(4)[:, None, None] // 2 + np.zeros((4, 6, 5), int)
    found = basin_entropy(solid, box_size=(4, 2, 5))
    assert found.boxes.shape == (1, 3, 1)
    assert found.entropy == pytest.approx(log(2))
    line = basin_entropy([0, 0, 0, 1, 1, 1, 1], box_size=2)
    assert line.boxes == pytest.approx([0.0, log(2), 0.0])


def test_cells_without_a_basin_do_not_count():
    labels = np.array([[0, 1, -1, -1, 0, 0], [0, 1, -3, 1, 0, -2]])
    found = basin_entropy(labels, box_size=2)
    assert found.boxes == pytest.approx(np.array([[log(2), np.nan, 0.0]]), nan_ok=True)
    counted = basin_entropy(labels, box_size=2, include=(-2,))
    assert counted.boxes[0, 2] == pytest.approx(-0.25 * log(0.25) - 0.75 * log(0.75))
    with pytest.raises(ValueError, match="no box has basins in half"):
        basin_entropy([[0, -1], [-1, -1]], box_size=2)


def test_smooth_stripes_narrower_than_boxes_are_not_fractal():
    """Their boxes see three basins, and the entropy is above ln 2; next to each boundary it is smooth all the same."""
    found = basin_entropy(stripes(5), box_size=20)
    assert found.above_ln2
    assert not found.fractal
    assert not basin_entropy(disc(300), box_size=6).fractal


# --- the limit of a smooth boundary


def test_smooth_limits():
    """0.499999, 0.4395093, 0.39609176, 0.36319428, 0.33722572 in one to five dimensions (Puy et al. 2021)."""
    published = [0.499999, 0.4395093, 0.39609176, 0.36319428, 0.33722572]
    assert [smooth_boundary_entropy(d) for d in range(1, 6)] == pytest.approx(published, abs=2e-6)


def test_smooth_limit_of_boxes_against_random_lines():
    """Lines at random through a box of 5 x 5 cells, by direct simulation."""
    rng = np.random.default_rng(0)
    cells = np.argwhere(np.ones((5, 5))) - 2.0
    rotated = rng.uniform(0, 2 * pi, 200_000)
    place = rng.uniform(-3.0, 3.0, 200_000)
    fraction = (cells @ np.array([np.cos(rotated), np.sin(rotated)]) < place).mean(axis=0)
    inside = fraction[(fraction > 0) & (fraction < 1)]
    entropy = -inside * np.log(inside) - (1 - inside) * np.log(1 - inside)
    expected = smooth_boundary_entropy(2, np.argwhere(np.ones((5, 5))))
    assert entropy.mean() == pytest.approx(expected, abs=4 * entropy.std() / np.sqrt(len(entropy)))


# --- the test


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(
    "labels",
    [disc(400), disc(300, 0.1), np.add.outer(np.arange(200), 1.7 * np.arange(300)) > 250, stripes(40), stripes(20)],
)
def test_smooth_boundaries(labels, seed):
    found = fractal_boundary_test(labels, rng=seed)
    assert found.verdict == SMOOTH
    assert found.entropy == pytest.approx(found.smooth, abs=0.04)


def test_a_mixed_image():
    """ln 2 (Puy et al. 2021), but for 1/(2 n) in discs of n cells."""
    found = fractal_boundary_test(mixed(), radius=8)
    assert found.entropy == pytest.approx(log(2) - 0.5 / found.cells, abs=4 * found.standard_error)
    assert found.verdict == "fractal"


def test_errors_count_discs_that_lie_together_once():
    """Left half in stripes as narrow as discs, right half with one straight boundary: discs of a half are alike."""
    labels = np.hstack([stripes(8, 2)[:, :200], stripes(200, 2)[:, :200]])
    found = fractal_boundary_test(labels, radius=8)
    alone = found.entropies.std(ddof=1) / np.sqrt(len(found.entropies))
    assert 2.0 * alone < found.standard_error < 0.1
    # Over two parts of one value each it is that of two values, and as large if each value comes twice.
    for n, error in ((1, 0.5), (2, 0.5)):
        places, values = np.repeat([[8, 8], [390, 390]], n, axis=0), np.repeat([0.0, 1.0], n)
        assert _clustered_error(places, values, (400, 400), 8.0) == pytest.approx(error)


def test_fractal_boundaries(grebogi):
    assert fractal_boundary_test(grebogi).verdict == "fractal"


def test_nothing_is_said_without_a_boundary_or_with_few_discs():
    assert fractal_boundary_test(np.zeros((100, 80), int)).verdict == "no boundary"
    corner = np.zeros((300, 300), int)
    corner[:2, :2] = 1
    assert fractal_boundary_test(corner, radius=4).verdict == "no boundary"


def test_test_in_one_and_three_dimensions():
    line = (np.arange(2000) // 250) % 2
    assert fractal_boundary_test(line, radius=10).entropy == pytest.approx(0.5, abs=0.05)
    solid = np.arange(40)[:, None, None] // 20 + np.zeros((40, 30, 30), int)
    found = fractal_boundary_test(solid, radius=4, n_discs=500)
    assert found.smooth_range[0] - 2.0 * found.standard_error < found.entropy < found.smooth_range[1]
    assert found.verdict == "undetermined"  # 30 cells hold less than a decade of distances


def test_plots(grebogi):
    assert plot.basin_entropy(basin_entropy(grebogi, box_size=6)).get_ylabel() == "boxes"
    assert plot.basin_entropy(fractal_boundary_test(grebogi)).get_ylabel() == "discs"
    assert plot.basin_entropy(basin_entropy(np.zeros((9, 9), int))).get_xlabel() == "entropy"
    with pytest.raises(TypeError, match="give a BasinEntropy"):
        plot.basin_entropy(3)
