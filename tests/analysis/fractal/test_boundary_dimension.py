"""Box counting of boundaries: exact images in any dimension, published boundaries, what must not be concluded."""

from math import pi

import numpy as np
import pytest

import systems
from cellmap import CellGrid, discrete_map, find_basins, interpolated_map, stroboscopic_map
from cellmap._compiled.kernels.boxes import NO_BASIN
from cellmap.analysis import fit_line
from cellmap.analysis.fractal import boundary_dimension
from cellmap.analysis.fractal.boundary_dimensions import without_specks
from cellmap.analysis.fractal.label_images import LabelImage, boundary_boxes, count_boxes, label_image
from cellmap.analysis.fractal.uncertainty_fits import _halves
from cellmap.analysis.fractal.wada_search import _centres
from studies.known_fractals import CANTOR, cantor_labels

THOROUGH = pytest.mark.thorough


def counted(labels, size, offset, wraps):
    """Boxes with more than one label among the cells in them and on their borders, one by one."""
    shape = [n - (not w) for n, w in zip(labels.shape, wraps, strict=True)]
    total = 0.0
    origins = [
        range(0, n, size) if w else range(-(o % size), n, size) for n, o, w in zip(shape, offset, wraps, strict=True)
    ]
    for corner in np.stack(np.meshgrid(*origins, indexing="ij"), -1).reshape(-1, labels.ndim):
        places, fraction = [], 1.0
        for a, n, o, w in zip(corner, shape, offset, wraps, strict=True):
            inside = np.arange(max(a, 0), min(a + size, n) + 1)
            fraction *= (len(inside) - 1) / size
            places.append((inside + o) % n if w else inside)
        total += fraction * (len(np.unique(labels[np.ix_(*places)])) > 1)
    return total


@pytest.mark.parametrize("shape", [(37,), (23, 30), (9, 12, 10), (5, 6, 7, 6)])
@pytest.mark.parametrize("circle", [False, True])
def test_counts_equal_those_box_by_box(shape, circle):
    rng = np.random.default_rng(len(shape))
    labels = (rng.random(shape) < 0.03).astype(np.int16)
    wraps = (circle,) + (False,) * (len(shape) - 1)
    image = label_image(labels, (), wraps)
    boundary = boundary_boxes(image)
    for offset in (np.zeros(len(shape), int), rng.integers(0, 8, len(shape))):
        sizes = [1, 2, 3, 4, 5, 8]
        expected = [counted(labels, s, offset, wraps) for s in sizes]
        np.testing.assert_allclose(count_boxes(boundary, wraps, sizes, offset), expected, rtol=1e-12)


def test_known_boundaries():
    x = (np.arange(1024) + 0.5) / 1024 - 0.5
    for tilt in (0.0, 0.3):
        found = boundary_dimension((x[:, None] < tilt * x + 0.1).astype(int))
        assert found.dimension == pytest.approx(1.0, abs=0.01)
        assert not found.fractal
    mixed = boundary_dimension(np.random.default_rng(0).integers(0, 3, (500, 700)))
    assert mixed.dimension == pytest.approx(2.0, abs=1e-3)
    assert mixed.fractal
    assert boundary_dimension(cantor_labels(13, 1), n_offsets=16).dimension == pytest.approx(CANTOR, abs=0.01)
    y = (np.arange(80) + 0.5) / 80 - 0.5
    ball = (y[:, None, None] ** 2 + y[:, None] ** 2 + y**2 < 0.15).astype(int)
    sphere = boundary_dimension(ball)
    assert sphere.dimension == pytest.approx(2.0, abs=0.01)
    assert not sphere.fractal
    stripes = np.repeat(cantor_labels(7, 1)[:, None], 2048, axis=1)
    found = boundary_dimension(stripes, n_offsets=16)
    assert found.dimension == pytest.approx(1.0 + CANTOR, abs=0.01)
    assert found.fractal


@pytest.mark.parametrize("flipped", [pytest.param(1e-4, marks=THOROUGH), 1e-3, 1e-2])
def test_wrong_labels_are_no_fractal(flipped):
    """A straight boundary, and Cantor's stripes, with isolated labels that are wrong: what they were without them."""
    rng, x = np.random.default_rng(7), (np.arange(1200) + 0.5) / 1200 - 0.5
    line = (x[:, None] < 0.3 * x + 0.1).astype(int)
    found = boundary_dimension(np.where(rng.random(line.shape) < flipped, 1 - line, line))
    assert found.dimension == pytest.approx(1.0, abs=0.02)
    assert not found.fractal
    # Of the 37.5^2 boxes of 32 cells, 38 hold the line, and the others a wrong label with this probability.
    assert found.isolated[found.sizes == 32] == pytest.approx(
        1.0 - 38 / (1406 * (1.0 - np.exp(-1089 * flipped))), abs=0.02
    )
    assert found.isolated[-1] < found.isolated.max()
    stripes = np.repeat(cantor_labels(6, 1)[:, None], 729, axis=1)
    noisy = boundary_dimension(np.where(rng.random(stripes.shape) < flipped, 1 - stripes, stripes), n_offsets=16)
    assert noisy.dimension == pytest.approx(1.0 + CANTOR, abs=0.05)
    assert noisy.fractal


def rotated(cells, angle=0.3):
    """Coordinates of the cells of a turned square."""
    x = (np.arange(cells) + 0.5) / cells - 0.5
    across, along = np.meshgrid(x, x, indexing="ij")
    return np.cos(angle) * across - np.sin(angle) * along, np.sin(angle) * across + np.cos(angle) * along


def gaps_of_cantor(t, ratio):
    """Labels of the gaps of Cantor's set with parts of a given ratio, by the level at which they were cut out."""
    labels, inside = np.zeros(t.shape, np.int16), (t >= 0.0) & (t <= 1.0)
    for level in range(1, 15):
        gap = inside & (t > ratio) & (t < 1.0 - ratio)
        labels[gap], inside = level % 2, inside & ~gap
        t = np.where(t <= ratio, t / ratio, (t - 1.0 + ratio) / ratio)
    return labels


@pytest.mark.parametrize("ratio", [*(pytest.param(r, marks=THOROUGH) for r in (0.45, 0.4, 0.25, 0.15)), 1 / 3])
@pytest.mark.parametrize(("width", "curved"), [(0.5, 0.0), (0.1, 0.0), (0.4, 0.7)])
def test_layers_of_stripes(ratio, width, curved):
    """1 + ln 2/ln(1/ratio), of layers that cross the axes obliquely, thin ones and curved ones."""
    x, y = rotated(1024)
    found = boundary_dimension(gaps_of_cantor((y + curved * x**2) / width + 0.5, ratio))
    exact = 1.0 + np.log(2.0) / np.log(1.0 / ratio)
    low, high = found.fit.interval()
    assert low <= exact <= high
    assert found.dimension == pytest.approx(exact, abs=max(0.02, 2.0 * found.standard_error))


@pytest.mark.parametrize("waves", [*(pytest.param(w, marks=THOROUGH) for w in (20, 60, 150)), 400])
def test_smooth_boundaries_folded_many_times(waves):
    """At large boxes the folds fill an area: slopes come down from 2 to 1, and the interval holds 1."""
    x, y = rotated(1024)
    angle, radius = np.arctan2(y, x), np.hypot(x, y)
    for labels in (y < 0.3 * np.sin(waves * x), np.floor(angle / pi + waves * radius / 3.0).astype(int) % 2):
        for samples in (None, 1):
            found = boundary_dimension(labels, lattice=samples)
            low, high = found.fit.interval()
            assert low <= 1.0 <= high
            assert not found.fractal


@pytest.fixture(scope="module")
def duffing():
    exact = stroboscopic_map(systems.two_well_duffing())
    icm = interpolated_map(exact, CellGrid((-2.9, -2.9), (2.9, 2.9), (400, 400)))
    return find_basins(icm, CellGrid((-2.2, -2.2), (2.2, 2.2), (500, 500)))


@THOROUGH
def test_two_well_duffing(duffing):
    """1.90 +- 0.03, recomputed independently; both ways to look at boxes agree."""
    by_all_cells, by_corners = boundary_dimension(duffing), boundary_dimension(duffing, lattice=1)
    assert by_all_cells.dimension == pytest.approx(1.90, abs=0.03)
    assert by_corners.dimension == pytest.approx(1.90, abs=0.03)
    assert by_all_cells.fractal
    assert by_corners.fractal
    assert 1 not in by_all_cells.sizes[by_all_cells.usable]  # cells miss strands that are thinner


def test_negative_labels_are_no_basins():
    labels = np.zeros((300, 300), np.int16)
    labels[:, 100:] = 1
    labels[:, 200:] = -2
    for code in (-1, -2, -3):
        labels[:, 200:] = code
        found = boundary_dimension(labels)
        assert found.ignored == pytest.approx(1.0 / 3.0)
        alone = boundary_dimension(np.where(labels < 0, 1, labels))
        assert np.array_equal(found.counts, alone.counts)
        assert boundary_dimension(labels, include=(code,), n_offsets=1).counts[1] == pytest.approx(
            2.0 * found.counts[1], rel=0.05
        )
    only = np.where(labels == 1, 0, labels)
    with pytest.raises(ValueError, match="no two basins meet"):
        boundary_dimension(only)
    assert boundary_dimension(only, include=(-3,)).dimension == pytest.approx(1.0, abs=0.01)


def test_any_labels():
    x = np.arange(300)
    half = x[:, None] + 0.5 * x < 200
    counts = boundary_dimension(half).counts
    for labels in (half.astype(np.uint8), np.where(half, 10**9, 5), half.astype(np.int64) * -7 + 7):
        assert np.array_equal(boundary_dimension(labels).counts, counts)


def test_images_that_every_other_cell_does_not_show():
    """A checkerboard, of which every other cell has one label, and a single cell."""
    board = np.add.outer(np.arange(256), np.arange(256)) % 2
    spot = np.zeros((256, 256), int)
    spot[77, 77] = 1
    for labels in (board, spot):
        with pytest.raises(ValueError, match="saturate at either end"):
            boundary_dimension(labels)
    # A strand of one cell, which every other cell misses in boxes of any size; no larger ones tell so of the largest.
    strand = np.where(np.arange(64)[:, None] == 31, 1, np.zeros((64, 64), int))
    found = boundary_dimension(strand, fit_range=(1, 16))
    assert found.sizes[found.missed > 0.9].tolist() == [8, 4, 2, 1]


def test_boxes_are_as_wide_as_a_quarter_of_the_image_at_most():
    """An edge along 1,000 of 65 x 1,000 cells: four boxes of 16 cells lie side by side, and two of 32."""
    found = boundary_dimension(np.repeat([0, 1], [30, 35])[:, None] + np.zeros((65, 1000), int))
    assert found.sizes[found.usable].tolist() == [16, 8, 4, 2, 1]


def test_boundary_on_the_branch_cut_of_a_circle_is_seen():
    labels = np.zeros((256, 256), int)
    labels[128:] = 1
    closed = boundary_dimension(labels, wraps=(True, False), n_offsets=1)
    opened = boundary_dimension(labels, n_offsets=1)
    assert closed.counts[-1] == 2 * opened.counts[-1] == 510
    halves = find_basins(
        discrete_map(lambda x, p: (x[0] / 2, 1.5 * x[1] - 0.5 * x[1] ** 3), {}, ("x", "y")),
        CellGrid((-1, -1), (1, 1), (64, 64)),
    )
    assert boundary_dimension(halves).dimension == pytest.approx(1.0, abs=0.01)


# --- label images and what is read off them


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
