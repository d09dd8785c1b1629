"""Box counting of boundaries: exact images in any dimension, published boundaries, what must not be concluded."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

import systems
from cellmap import CellGrid, discrete_map, find_basins, interpolated_map, set_threads, stroboscopic_map
from cellmap.analysis import fit_line
from cellmap.analysis.fractal import boundary_dimension
from cellmap.analysis.fractal.boundary_dimensions import sampled
from cellmap.analysis.fractal.label_images import boundary_boxes, count_boxes, label_image
from studies.known_fractals import CANTOR, KOCH, cantor_labels, snowflake_labels


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
    for tilt in (0.0, 0.3, 0.7):
        found = boundary_dimension((x[:, None] < tilt * x + 0.1).astype(int))
        assert found.dimension == pytest.approx(1.0, abs=0.01)
        assert not found.fractal
    mixed = boundary_dimension(np.random.default_rng(0).integers(0, 3, (500, 700)))
    assert mixed.dimension == pytest.approx(2.0, abs=1e-3)
    assert mixed.fractal
    assert boundary_dimension(cantor_labels(13, 1), n_offsets=16).dimension == pytest.approx(CANTOR, abs=0.01)
    y = (np.arange(100) + 0.5) / 100 - 0.5
    ball = (y[:, None, None] ** 2 + y[:, None] ** 2 + y**2 < 0.15).astype(int)
    sphere = boundary_dimension(ball)
    assert sphere.dimension == pytest.approx(2.0, abs=0.01)
    assert not sphere.fractal


def test_cantor_stripes():
    stripes = np.repeat(cantor_labels(7, 1)[:, None], 2048, axis=1)
    found = boundary_dimension(stripes, n_offsets=16)
    assert found.dimension == pytest.approx(1.0 + CANTOR, abs=0.01)
    assert found.fractal


@pytest.mark.parametrize("flipped", [1e-4, 1e-3, 1e-2])
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


@pytest.mark.slow
@pytest.mark.parametrize("angle", [0.0, 0.5])
def test_koch_snowflake(angle):
    found = boundary_dimension(snowflake_labels(4096, 8, angle), lattice=2, n_offsets=16)
    assert found.dimension == pytest.approx(KOCH, abs=0.01)
    assert found.fractal


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


@pytest.mark.parametrize("ratio", [0.45, 0.4, 1 / 3, 0.25, 0.15])
@pytest.mark.parametrize(("width", "curved"), [(0.5, 0.0), (0.1, 0.0), (0.4, 0.7)])
def test_layers_of_stripes(ratio, width, curved):
    """1 + ln 2/ln(1/ratio), of layers that cross the axes obliquely, thin ones and curved ones."""
    x, y = rotated(1024)
    found = boundary_dimension(gaps_of_cantor((y + curved * x**2) / width + 0.5, ratio))
    exact = 1.0 + np.log(2.0) / np.log(1.0 / ratio)
    low, high = found.fit.interval()
    assert low <= exact <= high
    assert found.dimension == pytest.approx(exact, abs=max(0.02, 2.0 * found.standard_error))


@pytest.mark.parametrize("ratio", [0.4, 1 / 3, 0.25])
def test_thin_sets_as_images(ratio):
    """Cantor's stripes themselves, thinner than a cell: what the cells do not show is estimated."""
    y = rotated(1024)[1]
    place, inside = y / 0.5 + 0.5, np.abs(y) <= 0.25
    for _ in range(8):
        inside &= (place <= ratio) | (place >= 1.0 - ratio)
        place = np.where(place <= ratio, place / ratio, (place - 1.0 + ratio) / ratio)
    found = boundary_dimension(inside)
    low, high = found.fit.interval()
    assert low <= 1.0 + np.log(2.0) / np.log(1.0 / ratio) <= high


@pytest.mark.parametrize("waves", [20, 60, 150, 400])
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


@pytest.mark.parametrize("seed", range(3))
def test_discs_of_many_sizes_are_not_fractal(seed):
    """Radii by a power law from 1 cell to 150: slopes fall through all values from 2 to 1."""
    rng = np.random.default_rng(seed)
    radii = (1e-3**-2.0 * (1.0 - (u := rng.random(400))) + 0.15**-2.0 * u) ** -0.5
    x = (np.arange(1024) + 0.5) / 1024
    labels = np.zeros((1024, 1024), bool)
    for radius, (a, b) in zip(radii, rng.random((400, 2)), strict=True):
        rows, columns = (slice(*np.searchsorted(x, [c - radius, c + radius])) for c in (a, b))
        labels[rows, columns] ^= (x[rows, None] - a) ** 2 + (x[columns] - b) ** 2 < radius**2
    for samples in (None, 1, 2):
        assert not boundary_dimension(labels, lattice=samples).fractal


def test_smooth_boundary_near_its_onset_is_not_called_fractal():
    """Moon and Li's oscillator at f = 0.088: Melnikov's criterion 0.0881, manifolds touch at 0.0884 (studies.melnikov).

    In an image slopes wander between 1.2 and 1.4; by pairs at smaller distances the exponent is 1.
    """
    exact = stroboscopic_map(systems.moon_li_duffing(0.15, 0.088, 0.8333))
    icm = interpolated_map(exact, CellGrid((-2.5, -2.5), (2.5, 2.5), (300, 300)))
    basins = find_basins(icm, CellGrid((-2.0, -2.0), (2.0, 2.0), (512, 512)))
    for samples in (None, 1, 2):
        found = boundary_dimension(basins, lattice=samples)
        assert not found.fractal
        assert found.standard_error > 0.02


@pytest.fixture(scope="module")
def duffing():
    exact = stroboscopic_map(systems.two_well_duffing())
    icm = interpolated_map(exact, CellGrid((-2.9, -2.9), (2.9, 2.9), (400, 400)))
    return find_basins(icm, CellGrid((-2.2, -2.2), (2.2, 2.2), (500, 500)))


def test_two_well_duffing(duffing):
    """1.90 +- 0.03, recomputed independently; both ways to look at boxes agree."""
    by_all_cells, by_corners = boundary_dimension(duffing), boundary_dimension(duffing, lattice=1)
    assert by_all_cells.dimension == pytest.approx(1.90, abs=0.03)
    assert by_corners.dimension == pytest.approx(1.90, abs=0.03)
    assert by_all_cells.fractal
    assert by_corners.fractal
    assert 1 not in by_all_cells.sizes[by_all_cells.usable]  # cells miss strands that are thinner


@pytest.mark.slow
def test_moon_and_li():
    """1.776 +- 0.01 at small sizes, on many small windows at random places: boxes of 5e-5 to 4e-4.

    Their counts add up to those of the whole region; from one window to the next the density of the boundary differs,
    and resampling of windows puts a standard error of 0.005 on the slope.
    """
    exact = stroboscopic_map(systems.moon_li_duffing())
    icm = interpolated_map(exact, CellGrid((-2.6, -2.6), (2.6, 2.6), (512, 512)))
    rng = np.random.default_rng(0)
    cells = np.arange(17) * 5e-5
    corners = rng.uniform(-2.0, 2.0, (6000, 1, 1, 2))
    initial_conditions = corners + np.stack(np.meshgrid(cells, cells, indexing="ij"), axis=-1)
    images = find_basins(icm, initial_conditions, max_periods=1500).labels
    sizes = [1, 2, 4, 8]
    total = np.zeros(4)
    for labels in images:
        image = label_image(labels, (), None)
        total += [sampled(image, 256, size, 1, 1, rng)[0] for size in sizes]
    dimension = -fit_line(np.log(sizes), np.log(total), (0, 3)).slope
    assert dimension == pytest.approx(1.776, abs=0.01)


def test_smooth_boundary_of_the_pendulum():
    """3 mm: no orbit on the boundary is chaotic; near the wells the arms of the spiral are wide."""
    exact = stroboscopic_map(systems.driven_pendulum())
    icm = interpolated_map(exact, CellGrid((-pi, -600.0), (pi, 600.0), (256, 256)))
    near = boundary_dimension(find_basins(icm, CellGrid((-pi, -100.0), (pi, 100.0), (600, 600))))
    low, high = near.fit.interval()
    assert low <= 1.0 <= high
    assert near.dimension == pytest.approx(1.0, abs=0.01)
    assert not near.fractal
    # Farther out the arms are so thin that the image shows no power law yet: the error says so.
    far = find_basins(icm, CellGrid((-pi, -500.0), (pi, 500.0), (600, 600)))
    for samples in (None, 1, 2):
        found = boundary_dimension(far, lattice=samples)
        low, high = found.fit.interval()
        assert low <= 1.0 <= high
        assert not found.fractal


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


def test_masked_cells_are_no_basins():
    labels = np.zeros((300, 300), int)
    labels[:, 100:] = 1
    labels[:, 200:] = 2
    masked = boundary_dimension(np.ma.masked_equal(labels, 2))
    assert np.array_equal(masked.counts, boundary_dimension(np.where(labels == 2, -3, labels)).counts)
    assert masked.ignored == pytest.approx(1.0 / 3.0)
    coded = boundary_dimension(np.ma.masked_equal(np.where(labels == 1, -2, labels), 2), include=(-2,))
    assert np.array_equal(masked.counts, coded.counts)


def test_images_that_every_other_cell_does_not_show():
    """A checkerboard, of which every other cell has one label, and a single cell."""
    board = np.add.outer(np.arange(256), np.arange(256)) % 2
    spot = np.zeros((256, 256), int)
    spot[77, 77] = 1
    for labels in (board, spot):
        with pytest.raises(ValueError, match="saturate at either end"):
            boundary_dimension(labels)


def test_axes_of_one_cell_are_left_out():
    x = np.arange(300)
    half = (x[:, None] + 0.5 * x < 200).astype(int)
    found = boundary_dimension(half[:, None, :])
    assert np.array_equal(found.counts, boundary_dimension(half).counts)
    assert found.topological == 1


def test_boundary_on_the_branch_cut_of_a_circle_is_seen():
    labels = np.zeros((256, 256), int)
    labels[128:] = 1
    closed = boundary_dimension(labels, wraps=(True, False), n_offsets=1)
    opened = boundary_dimension(labels, n_offsets=1)
    assert closed.counts[-1] == 2 * opened.counts[-1] == 510
    halves = find_basins(
        discrete_map(lambda x, p: (x[0] / 2, 1.5 * x[1] - 0.5 * x[1] ** 3), {}, ("x", "y")),
        CellGrid((-1, -1), (1, 1), (128, 128)),
    )
    assert boundary_dimension(halves).dimension == pytest.approx(1.0, abs=0.01)


def test_same_bits_for_any_number_of_threads(duffing):
    results = []
    for threads in (1, 3):
        set_threads(threads)
        results.append(boundary_dimension(duffing, rng=2).counts)
    assert np.array_equal(*results)


@pytest.mark.parametrize(
    ("labels", "arguments", "error", "message"),
    [
        (np.full((50, 50), 0.5), {}, ValueError, "basins holds 0.5: labels are whole numbers"),
        (np.zeros((50, 50), int), {}, ValueError, "no two basins meet"),
        (np.zeros((0, 50), int), {}, ValueError, "at least two cells"),
        (np.zeros((1, 1), int), {}, ValueError, "at least two cells"),
        (np.eye(6, dtype=int), {}, ValueError, "sizes of boxes lie between"),
        (np.eye(99, dtype=int), {"sizes": [1, 2, 500]}, ValueError, "a box of 500 cells is larger"),
        (np.eye(99, dtype=int), {"sizes": [1, 2, 2.5]}, ValueError, "whole numbers of cells"),
        (np.eye(99, dtype=int), {"sizes": [1, 2, 4], "lattice": 2}, ValueError, "multiples of lattice=2"),
        (np.eye(99, dtype=int), {"wraps": (True,)}, ValueError, "one entry for each of the 2 axes"),
    ],
)
def test_errors(labels, arguments, error, message):
    with pytest.raises(error, match=message):
        boundary_dimension(labels, **arguments)


def test_basins_of_single_initial_conditions_are_refused():
    halves = find_basins(discrete_map(lambda x, p: (x[0] / 2,), {}, ("x",)), [[0.1], [0.2]])
    with pytest.raises(ValueError, match="give basins on a grid"):
        boundary_dimension(halves)


@pytest.mark.parametrize(
    "labels", [np.array([[1.0, 2.0]]), np.array([[1], [2]]), np.eye(2, dtype=int), np.array([[[1, 2], [2, 1]]])]
)
def test_images_with_few_cells_along_an_axis_are_refused(labels):
    with pytest.raises(ValueError, match="basins"):
        boundary_dimension(labels)
