"""Label images and what is read off them: missing cells, neighbours round circles, specks, and halves of fits."""

from __future__ import annotations

import numpy as np
import pytest

from cellmap import CellGrid, discrete_map, find_basins
from cellmap._compiled.kernels.boxes import NO_BASIN
from cellmap._lib.fit import fit_line
from cellmap.analysis.fractal import basin_entropy, generalized_dimensions
from cellmap.analysis.fractal.boundary_dimensions import without_specks
from cellmap.analysis.fractal.label_images import LabelImage, label_image
from cellmap.analysis.fractal.uncertainty_fits import _halves
from cellmap.analysis.fractal.wada_search import _centres

CELLS = np.arange(30, dtype=np.int16).reshape(6, 5)


def test_masked_cells_and_nan_are_missing():
    """Of masked floats both are; of masked whole numbers what is masked; and of plain floats NaN."""
    labels = np.array([[0.0, 1.0, np.nan], [1.0, 0.0, 1.0]])
    mask = np.array([[False, True, False], [False, False, True]])
    whole = np.ma.MaskedArray(np.nan_to_num(labels).astype(int), mask)
    for source, missing in (
        (np.ma.MaskedArray(labels, mask), mask | np.isnan(labels)),
        (np.ma.MaskedArray(labels, np.zeros((2, 3), bool)), np.isnan(labels)),
        (labels, np.isnan(labels)),
        (whole, mask),
        (np.nan_to_num(labels), np.zeros((2, 3), bool)),
    ):
        image = label_image(source)
        assert np.array_equal(image.numbers == NO_BASIN, missing)
        assert np.array_equal(image.numbers[~missing], np.nan_to_num(labels)[~missing])
        assert image.ignored == pytest.approx(missing.mean())
        assert image.complete == (not missing.any())


def test_circles_stay_circles_where_steps_go_into_them():
    image = LabelImage(np.zeros((6, 5, 6), np.int16), (0,), (True, True, False))
    assert image.every(2, (0, 1, 1)).wraps == (True, False, False)
    assert image.every(2, (0, 1, 1)).numbers.shape == (3, 2, 3)
    assert image.every(5, (0, 0, 0)).wraps == (False, True, False)
    plain = LabelImage(CELLS, (0,), (False, False)).every(2, (1, 0))
    assert plain.numbers.tolist() == [[5, 7, 9], [15, 17, 19], [25, 27, 29]]


@pytest.mark.parametrize("wraps", [False, True])
def test_neighbours_are_one_cell_away_unless_said(wraps):
    image = LabelImage(CELLS, (0,), (wraps, False))
    pairs = {(int(a), int(b)) for one, other in image.neighbours(0) for a, b in zip(one.flat, other.flat, strict=True)}
    inner = {(5 * i + j, 5 * i + j + 5) for i in range(5) for j in range(5)}
    assert pairs == inner | ({(25 + j, j) for j in range(5)} if wraps else set())
    three = [
        (int(a), int(b)) for one, other in image.neighbours(0, 3) for a, b in zip(one.flat, other.flat, strict=True)
    ]
    assert len(three) == (30 if wraps else 15) and all((b - a) % 30 == 15 for a, b in three)


def test_specks_take_the_label_around_them():
    """Groups of up to four cells, by their own label alone: one of 1 between 0 and 2 is one, five cells are none."""
    numbers = np.zeros((12, 12), np.int16)
    numbers[:, 6:] = 2
    numbers[5, 6] = 1  # beside both
    numbers[2, 1:5] = 1
    numbers[9, 1:6] = 1
    numbers[0, 9:11] = NO_BASIN
    found = without_specks(LabelImage(numbers, (0, 1, 2), (False, False))).numbers
    assert found[5, 6] in (0, 2)
    assert (found[2] == numbers[1]).all()
    rest = np.ones(numbers.shape, bool)
    rest[5, 6], rest[2, 1:5] = False, False
    assert np.array_equal(found[rest], numbers[rest])


def test_halves_of_a_window_have_their_own_slopes():
    """The coarse half, where x is large, has the slope 1 and the fine one 3."""
    x = np.arange(12.0)
    y = np.where(x < 6, 3.0 * x, 15.0 + 1.0 * (x - 5))
    halves = _halves(fit_line(x, y, (0, 11)))
    assert halves is not None
    assert [slope for slope, _ in halves] == pytest.approx([1.0, 3.0])
    assert _halves(fit_line(x[:5], y[:5], (0, 4))) is None


def test_boxes_lie_in_a_tiling_or_at_random():
    labels = np.indices((40, 40)).sum(axis=0) // 20 % 2
    tiled, drawn = basin_entropy(labels), basin_entropy(labels, n_positions=50)
    assert {f"{v}" for v in vars(tiled).values() if isinstance(v, str)} >= {"tiling"}
    assert {f"{v}" for v in vars(drawn).values() if isinstance(v, str)} >= {"random"}


def test_boxes_that_cannot_be_numbered_are_refused():
    points = np.random.default_rng(0).random((2000, 1))
    with pytest.raises(ValueError, match="cannot be numbered"):
        generalized_dimensions(points, sizes=[0.1, 0.05, 1e-20])


def test_centres_of_another_region_are_labelled_there():
    wells = discrete_map(lambda x, p: (1.5 * x[0] - 0.5 * x[0] ** 3, 0.5 * x[1]), {}, ("x", "y"))
    basins = find_basins(wells, CellGrid((-1.2, -1.0), (1.2, 1.0), (12, 10)))
    region = CellGrid((0.1, -1.0), (1.0, 1.0), (5, 4))
    assert _centres(basins, None, (), None, 200)[1] is basins.labels
    for source in (basins, wells):
        states, labels = _centres(source, region, (), None, 200)
        assert states.region == region and labels.shape == (5, 4)
        assert len(np.unique(labels)) == 1
    ruled = _centres(basins, None, (), lambda x: np.where(x[:, 0] > 0.5, 3, -1), 200)[1]
    assert ruled.shape == (12, 10) and set(np.unique(ruled[6:])) == {3}
