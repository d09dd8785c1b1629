"""Box counting of points: exact dimensions however the set lies, published counts, saturation at both ends."""

from math import log, pi

import numpy as np
import pytest

import systems
from cellmap import angle, set_threads
from cellmap._lib.fit import scaling_windows, window_spread, with_drift
from cellmap.analysis import fit_line
from cellmap.analysis.fractal import box_dimension
from cellmap.analysis.fractal.box_counting import straightened
from studies.known_fractals import (
    CANTOR,
    KOCH,
    TRIANGLE,
    cantor,
    cantor_square,
    koch,
    line,
    rotation_by,
    sierpinski,
    square,
)

# Exact dimensions: Falconer, Fractal Geometry (2003).

FURTHER = [pytest.param(angle, marks=pytest.mark.thorough) for angle in (0.0, 1.1)]


@pytest.mark.parametrize("angle", [*FURTHER, 0.5])
@pytest.mark.parametrize(
    ("made", "size", "exact"),
    [
        pytest.param(line, 100_001, 1.0, id="line"),
        pytest.param(cantor, 14, CANTOR, id="Cantor"),
        pytest.param(koch, 10, KOCH, id="Koch", marks=pytest.mark.thorough),
        pytest.param(cantor_square, 10, 2.0 * CANTOR, id="Cantor squared", marks=pytest.mark.thorough),
    ],
)
def test_known_sets(made, size, exact, angle):
    found = box_dimension(made(size) @ rotation_by(angle).T + [0.1234, 0.777], n_offsets=4)
    assert found.dimension == pytest.approx(exact, abs=0.01)
    assert abs(found.dimension - exact) < 4.0 * found.standard_error
    assert found.fractal == (exact != 1.0)
    assert found.fit.slope == found.dimension
    assert log(found.counts[-1]) == pytest.approx(found.fit.y[-1])


@pytest.mark.parametrize("level", [10, pytest.param(11, marks=pytest.mark.thorough)])
@pytest.mark.parametrize("angle", [*FURTHER, 0.5])
def test_sierpinski_triangle_rotated(level, angle):
    """Corners that triangles share come twice, which does not make their boxes well known."""
    points = sierpinski(level) @ rotation_by(angle).T * 2.7 + [100.3, -55.0]
    found = box_dimension(points, n_offsets=8)
    assert abs(found.dimension - TRIANGLE) < 2.0 * found.standard_error
    if level > 10:
        assert found.dimension == pytest.approx(TRIANGLE, abs=0.01)


def test_edges_of_a_square_do_not_bend_the_line():
    """(1/s + 1)**2 boxes on average meet a square of side 1 (Steiner): slopes of large boxes are far below 2."""
    found = box_dimension(square(500) @ rotation_by(0.3).T, n_offsets=4)
    assert found.dimension == pytest.approx(2.0, abs=0.01)
    assert abs(found.dimension - 2.0) < 2.0 * found.standard_error
    assert not found.fractal


def test_points_that_coincide_count_once():
    points = koch(7)
    found, once = box_dimension(np.repeat(points, 5, axis=0)), box_dimension(points)
    assert np.array_equal(found.missed, once.missed)
    assert found.dimension == once.dimension


def test_orbit_of_henon_covers_what_is_known():
    """D_0 is 1.258, the proven D_1 (Young 1982), or more; 1.26 to 1.28 in the literature."""
    initial_conditions = np.random.default_rng(0).uniform(-0.1, 0.1, (100, 2))
    points = systems.henon_map().orbit(initial_conditions, 1_600).points[101:].reshape(-1, 2)
    low, high = box_dimension(points).fit.interval()
    assert low < 1.258 < high


def test_aligned_grid_counts_exactly():
    """Cantor's set of level 12 meets 2**k boxes of 3**-k; the middle-point square of 2**9 cells 4**k boxes of 2**-k."""
    found = box_dimension(cantor(12), 3.0 ** -np.arange(0, 12), origin=(0.0, 0.0))
    np.testing.assert_array_equal(found.counts, 2.0 ** np.arange(0, 12))
    x = (np.arange(512) + 0.5) / 512
    square = np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2)
    found = box_dimension(square, 2.0 ** -np.arange(0, 9), origin=(0.0, 0.0))
    np.testing.assert_array_equal(found.counts, 4.0 ** np.arange(0, 9))
    assert found.dimension == pytest.approx(2.0, abs=1e-12)


def test_all_dyadic_sizes_from_one_sort_equal_counts_size_by_size():
    """Witness: numpy.unique of the numbers of boxes at the same places."""
    from cellmap.analysis.fractal.partitions import Space, dyadic_partition, dyadic_sizes

    rng = np.random.default_rng(3)
    for d in (1, 2, 3, 4):
        space = Space.of(rng.random((3000, d)) ** 2, None, None)
        offset = rng.random(d)
        counts = dyadic_partition(space, offset).occupancy()
        for k, size in enumerate(dyadic_sizes(space)[:12]):
            places = np.floor(space.points / size + offset * space.extent / size).astype(int)
            multiplicity = np.unique(places, axis=0, return_counts=True)[1]
            expected = [len(multiplicity), (multiplicity == 1).sum(), (multiplicity == 2).sum()]
            assert counts[k].tolist() == expected


def test_general_sizes_agree_with_dyadic_ones():
    points = koch(7)
    general = box_dimension(points, np.geomspace(0.1, 0.004, 9))
    assert general.dimension == pytest.approx(box_dimension(points).dimension, abs=0.02)
    assert len(general.sizes) == 9


def test_circles():
    """A closed curve round a cylinder has no ends: as many boxes at any place of the grid."""
    t = np.linspace(-pi, pi, 40_000, endpoint=False)
    points = np.stack([t, 0.0 * t], axis=1)
    closed = box_dimension(points, scale=(2.0 * pi, 1.0), coordinates=(angle("theta"), "v"))
    np.testing.assert_allclose(closed.counts[:10], 2.0 ** np.arange(10))
    assert closed.dimension == pytest.approx(1.0, abs=1e-9)
    rotated = box_dimension(points + np.array([40.0, 0.0]), scale=(2.0 * pi, 1.0), coordinates=(angle("theta"), "v"))
    np.testing.assert_allclose(rotated.counts[:10], closed.counts[:10])


def test_saturation_is_found_at_both_ends():
    """10,000 random points in a square: no size below 1/50 holds 4 points in a box, which Chao's estimate needs."""
    found = box_dimension(np.random.default_rng(0).random((10_000, 2)))
    smallest, largest = found.sizes[found.usable].min(), found.sizes[found.usable].max()
    assert smallest > 0.02
    assert found.counts[found.usable].min() >= 10
    assert largest < 0.6
    assert found.missed[-1] > 0.9


def test_same_bits_for_any_number_of_threads():
    points = koch(7)
    results = []
    for threads in (1, 3):
        set_threads(threads)
        results.append(box_dimension(points, rng=5))
    assert np.array_equal(results[0].counts, results[1].counts)
    assert results[0].dimension == results[1].dimension
    assert not np.array_equal(results[0].counts, box_dimension(points, rng=6).counts)


def test_a_spiral_whose_arms_fill_the_disc_at_all_sizes_but_the_smallest_is_not_called_fractal():
    t = np.linspace(0.0, 1.0, 200_001)
    assert not box_dimension(t[:, None] ** 0.5 * np.stack([np.cos(300 * t), np.sin(300 * t)], axis=1)).fractal


def test_manual_window():
    found = box_dimension(koch(7), fit_range=(0.002, 0.1))
    inside = found.sizes[found.fit.inside]
    assert inside.min() >= 0.002
    assert inside.max() <= 0.1
    assert "BoxCount(dimension 1.2" in repr(found)


def test_the_error_has_the_slope_of_what_is_missed_at_most():
    """Counts 1/s on a line: with as many boxes of two points as of one, as many as these may be missed, s**0.5 / 10."""
    sizes = 0.5 ** np.arange(4, 10)
    missed = sizes**0.5 / 10
    ones = missed / (1 - missed) / sizes
    sure, unsure = (
        straightened(sizes, np.stack([1 / sizes, f, f], axis=1), np.zeros(6), np.zeros((1, 6)), 1, None)[0].fit
        for f in (np.zeros(6), ones)
    )
    slope = np.polyfit(np.log(sizes), np.log(1 - missed), 1)[0]
    assert unsure.standard_error == pytest.approx(np.hypot(sure.standard_error, slope), rel=1e-9)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"points": np.zeros((0, 2))}, "points: 0 points have no dimension"),
        ({"points": np.zeros((5, 2))}, "all of them are the same"),
        ({"points": np.zeros(5)}, "one point a row"),
        ({"points": [[0.0], [np.nan]]}, "remove"),
        (
            {"points": [[0.0], [1.0], [2.0]]},
            "0 sizes of boxes lie between.*more points, or choose sizes= and fit_range=",
        ),
        ({"points": line(999), "sizes": [0.1, 0.2]}, "at least three different positive sizes"),
        ({"points": line(999), "fit_range": (0.3, 0.31)}, "fit_range=.* contains 0 sizes"),
        ({"points": line(999), "scale": -1.0}, "positive length"),
        ({"points": line(999), "coordinates": ("x",)}, "one for each column"),
        ({"points": line(999), "n_offsets": 0}, "n_offsets=0"),
        ({"points": line(999), "origin": np.inf}, "origin"),
    ],
)
def test_errors(arguments, message):
    with pytest.raises(ValueError, match=message):
        box_dimension(**arguments)


# --- the window


def test_steady_window_is_the_largest_linear_region():
    x = np.arange(12.0)
    y = np.concatenate([[0.0, 0.5, 1.3], 1.3 + 2.0 * np.arange(1, 7), 13.3 + 0.3 * np.arange(1, 4)])
    assert scaling_windows(x, y)[0][:2] == (2, 8)
    assert fit_line(x, y, scaling_windows(x, y)[0][:2]).slope == pytest.approx(2.0)


def test_steady_window_bears_oscillations_and_sees_slow_bends():
    """Log-periodic oscillations as of Cantor's counts; a slope that grows from 1.5 to 2 bit by bit."""
    x = np.arange(20.0)
    swinging = 0.63 * x + 0.02 * np.sin(3.9 * x)
    first, last = scaling_windows(x, swinging)[0][:2]
    assert last - first >= 12
    bent = 2.0 * x + 0.5 * 4.0 * np.exp(-x / 4.0)
    first, last = scaling_windows(x, bent)[0][:2]
    assert first > 5
    assert last == 19
    fit = with_drift(fit_line(x, bent, (0, 8)))
    assert fit.standard_error > fit_line(x, bent, (0, 8)).standard_error
    assert window_spread(scaling_windows(x, bent), 2.0) > 0.0


def test_window_to_the_end():
    x = np.arange(10.0)
    y = np.concatenate([2.0 * np.arange(7), 12.0 + np.array([1.0, 2.1, 3.0])])
    assert scaling_windows(x, y)[0][:2] == (0, 6)
    assert scaling_windows(x, y, to_the_end=True)[0][1] == 9


def test_window_needs_points():
    with pytest.raises(ValueError, match="2 points are finite"):
        scaling_windows(np.arange(3.0), np.array([0.0, 1.0, np.nan]))
    with pytest.raises(ValueError, match="no three neighbouring points"):
        scaling_windows(np.arange(5.0), np.array([0.0, 1.0, np.nan, 1.0, 2.0]))
