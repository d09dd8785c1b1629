"""Box counting of boundaries: exact pictures in any dimension, published boundaries, what must not be said."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

import systems
from cellmap import (
    CellGrid,
    boundary_dimension,
    discrete_map,
    find_basins,
    fit_line,
    interpolated_map,
    set_threads,
    stroboscopic_map,
)
from cellmap.analysis.boundary_dimension import sampled
from cellmap.analysis.label_boxes import LabelImage, count_boxes
from studies.known_fractals import CANTOR, KOCH, cantor_labels, snowflake_labels


def counted(labels, size, offset, wraps):
    """Boxes with more than one label among the cells in them and on their borders, one by one."""
    shape = [n - (not w) for n, w in zip(labels.shape, wraps, strict=True)]
    total = 0.0
    origins = [
        range(0, n, size) if w else range(-(o % size), n, size) for n, o, w in zip(shape, offset, wraps, strict=True)
    ]
    for corner in np.stack(np.meshgrid(*origins, indexing="ij"), -1).reshape(-1, labels.ndim):
        places, share = [], 1.0
        for a, n, o, w in zip(corner, shape, offset, wraps, strict=True):
            inside = np.arange(max(a, 0), min(a + size, n) + 1)
            share *= (len(inside) - 1) / size
            places.append((inside + o) % n if w else inside)
        total += share * (len(np.unique(labels[np.ix_(*places)])) > 1)
    return total


@pytest.mark.parametrize("shape", [(37,), (23, 30), (9, 12, 10), (5, 6, 7, 6)])
@pytest.mark.parametrize("circle", [False, True])
def test_counts_equal_those_box_by_box(shape, circle):
    rng = np.random.default_rng(len(shape))
    labels = (rng.random(shape) < 0.03).astype(np.int16)
    wraps = (circle,) + (False,) * (len(shape) - 1)
    image = LabelImage.of(labels, (), wraps)
    boundary = image.boundary()
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
    assert boundary_dimension(cantor_labels(13, 1), offsets=16).dimension == pytest.approx(CANTOR, abs=0.01)
    y = (np.arange(100) + 0.5) / 100 - 0.5
    ball = (y[:, None, None] ** 2 + y[:, None] ** 2 + y**2 < 0.15).astype(int)
    sphere = boundary_dimension(ball)
    assert sphere.dimension == pytest.approx(2.0, abs=0.01)
    assert not sphere.fractal


def test_cantor_stripes():
    stripes = np.repeat(cantor_labels(7, 1)[:, None], 2048, axis=1)
    found = boundary_dimension(stripes, offsets=16)
    assert found.dimension == pytest.approx(1.0 + CANTOR, abs=0.01)
    assert found.fractal


@pytest.mark.slow
@pytest.mark.parametrize("turn", [0.0, 0.5])
def test_koch_snowflake(turn):
    found = boundary_dimension(snowflake_labels(4096, 8, turn), samples=2, offsets=16)
    assert found.dimension == pytest.approx(KOCH, abs=0.01)
    assert found.fractal


@pytest.fixture(scope="module")
def duffing():
    exact = stroboscopic_map(systems.two_well_duffing())
    icm = interpolated_map(exact, CellGrid((-2.9, -2.9), (2.9, 2.9), (400, 400)))
    return find_basins(icm, CellGrid((-2.2, -2.2), (2.2, 2.2), (1000, 1000)))


def test_two_well_duffing(duffing):
    """1.90 +- 0.03, recomputed independently; both ways to look at boxes agree."""
    by_all_cells, by_corners = boundary_dimension(duffing), boundary_dimension(duffing, samples=1)
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
    starts = corners + np.stack(np.meshgrid(cells, cells, indexing="ij"), axis=-1)
    images = find_basins(icm, starts, max_periods=1500).labels
    sizes = [1, 2, 4, 8]
    total = np.zeros(4)
    for labels in images:
        image = LabelImage.of(labels, (), None)
        total += [sampled(image, 256, size, 1, 1, rng)[0] for size in sizes]
    dimension = -fit_line(np.log(sizes), np.log(total), (0, 3)).slope
    assert dimension == pytest.approx(1.776, abs=0.01)


def test_smooth_boundary_of_the_pendulum():
    """3 mm: no orbit on the boundary is chaotic; near the wells the arms of the spiral are wide."""
    exact = stroboscopic_map(systems.driven_pendulum())
    icm = interpolated_map(exact, CellGrid((-pi, -600.0), (pi, 600.0), (256, 256)))
    near = boundary_dimension(find_basins(icm, CellGrid((-pi, -100.0), (pi, 100.0), (800, 800))))
    low, high = near.fit.interval()
    assert low <= 1.0 <= high
    assert near.dimension == pytest.approx(1.0, abs=0.01)
    assert not near.fractal
    # Farther out the arms are so thin that the picture shows no law yet: the error says so.
    far = find_basins(icm, CellGrid((-pi, -500.0), (pi, 500.0), (800, 800)))
    for samples in (None, 1, 2):
        found = boundary_dimension(far, samples=samples)
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
        assert boundary_dimension(labels, codes=(code,), offsets=1).counts[1] == pytest.approx(
            2.0 * found.counts[1], rel=0.05
        )
    only = np.where(labels == 1, 0, labels)
    with pytest.raises(ValueError, match="no two basins meet"):
        boundary_dimension(only)
    assert boundary_dimension(only, codes=(-3,)).dimension == pytest.approx(1.0, abs=0.01)


def test_any_labels():
    x = np.arange(300)
    half = x[:, None] + 0.5 * x < 200
    counts = boundary_dimension(half).counts
    for labels in (half.astype(np.uint8), np.where(half, 10**9, 5), half.astype(np.int64) * -7 + 7):
        assert np.array_equal(boundary_dimension(labels).counts, counts)


def test_axes_of_one_cell_are_left_out():
    x = np.arange(300)
    half = (x[:, None] + 0.5 * x < 200).astype(int)
    found = boundary_dimension(half[:, None, :])
    assert np.array_equal(found.counts, boundary_dimension(half).counts)
    assert found.topological == 1


def test_boundary_on_the_seam_of_a_circle_is_seen():
    labels = np.zeros((256, 256), int)
    labels[128:] = 1
    closed = boundary_dimension(labels, wraps=(True, False), offsets=1)
    opened = boundary_dimension(labels, offsets=1)
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
        results.append(boundary_dimension(duffing, seed=2).counts)
    assert np.array_equal(*results)


@pytest.mark.parametrize(
    ("labels", "arguments", "error", "message"),
    [
        (np.zeros((50, 50)), {}, TypeError, "whole numbers, or Basins"),
        (np.zeros((50, 50), int), {}, ValueError, "no two basins meet"),
        (np.zeros((0, 50), int), {}, ValueError, "two cells at least"),
        (np.zeros((1, 1), int), {}, ValueError, "two cells at least"),
        (np.eye(6, dtype=int), {}, ValueError, "sizes of boxes lie between"),
        (np.eye(99, dtype=int), {"sizes": [1, 2, 500]}, ValueError, "a box of 500 cells is larger"),
        (np.eye(99, dtype=int), {"sizes": [1, 2, 2.5]}, ValueError, "whole numbers of cells"),
        (np.eye(99, dtype=int), {"sizes": [1, 2, 4], "samples": 2}, ValueError, "multiples of samples=2"),
        (np.eye(99, dtype=int), {"wraps": (True,)}, ValueError, "one entry for each of the 2 axes"),
    ],
)
def test_errors(labels, arguments, error, message):
    with pytest.raises(error, match=message):
        boundary_dimension(labels, **arguments)


def test_basins_of_single_starts_are_refused():
    halves = find_basins(discrete_map(lambda x, p: (x[0] / 2,), {}, ("x",)), [[0.1], [0.2]])
    with pytest.raises(ValueError, match="cells of a grid"):
        boundary_dimension(halves)
