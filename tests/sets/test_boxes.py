"""Sets of boxes and the images of boxes."""

from math import nextafter, pi

import numpy as np
import pytest
from maps_of_cells import DOUBLE, HENON, TURNING, line

from cellmap import CellGrid, Coordinate, discrete_map, set_threads
from cellmap._compiled.kernels.box_images import points_of_cells
from cellmap.maps.grid import Locator
from cellmap.sets import BoxSet, box_image, box_transitions

GRID = CellGrid((-1, 0), (1, 1), (8, 4))


def boxes(*keys, grid=GRID):
    return BoxSet(grid, np.array(keys, np.int64))


def test_boxes_own_their_lower_edges_only():
    line = CellGrid((0,), (1,), (4,))
    second = BoxSet(line, [1])
    inside = second.contains([[0.25], [nextafter(0.5, 0)], [0.5], [nextafter(0.25, 0)], [1.5], [np.nan]])
    assert inside.tolist() == [True, True, False, False, False, False]


def test_last_box_of_a_circle_touches_the_first():
    circle = CellGrid((-pi,), (pi,), (8,), (True,))
    assert BoxSet(circle, [0]).neighbours().keys.tolist() == [1, 7]
    assert BoxSet(circle, [7]).contains([[-pi - 0.1], [pi - 0.1], [3 * pi - 0.1]]).all()
    line = CellGrid((-pi,), (pi,), (8,))
    assert BoxSet(line, [0]).neighbours().keys.tolist() == [1]


@pytest.mark.parametrize("d", [1, 2, 3, 4])
def test_neighbours_of_a_box_in_the_middle(d):
    grid = CellGrid((0,) * d, (1,) * d, (5,) * d)
    middle = BoxSet.of_points(grid, [0.5] * d)
    assert len(middle.neighbours()) == 3**d - 1
    pairs = {*zip(*(part.tolist() for part in (middle | middle.neighbours()).touching()), strict=True)}
    assert pairs == {(b, a) for a, b in pairs}
    one = BoxSet.full(CellGrid((0,) * d, (2,) * d, (1,) * d))
    assert len(one) == 1 and one.volume == 2.0**d and not len(one.neighbours())
    assert one.contains([0.0] * d) and not one.contains([2.0] * d)


def test_sets_are_those_of_their_numbers():
    a, b = boxes(1, 2, 3), boxes(3, 4)
    assert (a | b).keys.tolist() == [1, 2, 3, 4]
    assert (a & b).keys.tolist() == [3]
    assert (a - b).keys.tolist() == [1, 2]
    assert (a & b) <= a and not a <= b
    assert boxes(5, 3, 5).keys.tolist() == [3, 5]


@pytest.mark.parametrize("axes", [0, 1, None, (0, 1)])
def test_bisected_boxes_fill_the_same_region(axes):
    coarse = boxes(0, 5, 31)
    fine = coarse.subdivided(axes)
    assert fine.volume == pytest.approx(coarse.volume, rel=1e-15)
    assert len(fine) == len(coarse) * (4 if axes in (None, (0, 1)) else 2)
    assert coarse.contains(fine.centres()).all()
    points = np.random.default_rng(0).uniform((-1.1, -0.1), (1.1, 1.1), (2000, 2))
    np.testing.assert_array_equal(coarse.contains(points), fine.contains(points))

    corners, some = boxes(0, 9).corners(), boxes(0, 9)
    assert corners.shape == (2, 4, 2)
    np.testing.assert_allclose(corners.min(axis=1), some.lower_corners())
    np.testing.assert_allclose(corners.mean(axis=1), some.centres())


def test_compiled_points_are_those_of_the_grid():
    """To the last bit, in windows that are no binary fractions."""
    grid = CellGrid((-0.1, 0.3), (1.7, 0.7), (11, 6))
    at, points = Locator.of(grid, [Coordinate("x"), Coordinate("y")]), np.empty((grid.size, 2))
    points_of_cells(np.arange(grid.size), at.shape, at.lower, at.upper, at.widths, np.zeros((1, 2)), points)
    np.testing.assert_array_equal(points, grid.centres().reshape(-1, 2))
    np.testing.assert_array_equal(points, BoxSet.full(grid).centres())


def test_images_of_mirrored_boxes_are_mirror_images():
    """An odd map sends a set that is symmetric about 0 to one that is, edges of boxes included."""
    odd = discrete_map(lambda x, p: (x[1], -0.2 * x[0] + 2.2 * x[1] - x[1] ** 3), {}, ("x", "y"))
    grid = CellGrid((-1.3, -1.3), (1.3, 1.3), (21, 20))
    for samples in (3, 6, "adaptive"):
        links = box_transitions(BoxSet.full(grid), odd, samples).toarray()
        np.testing.assert_array_equal(links, links[::-1, ::-1])


def test_window_across_the_branch_cut_of_an_angle():
    """Images have angles from -pi to pi; a window from 2 to 4 holds them all the same."""
    grid = CellGrid((2.0,), (4.0,), (8,))
    shift = TURNING.with_params(by=1.0)
    image = box_image(BoxSet.of_points(grid, [[2.2]]), shift, samples=3)
    assert image.contains([[3.2]]) and len(image) in (1, 2)
    beyond = box_image(BoxSet.of_points(grid, [[3.05]]), shift, samples=1)
    assert not len(beyond) or beyond.contains([[4.0 - 1e-9]])


@pytest.mark.parametrize("samples", [1, 3, "adaptive"])
def test_image_of_a_shift_on_a_circle(samples):
    """A rotation by exactly two boxes: each meets the one two places on, and its edges at the most."""
    grid = CellGrid((-pi,), (pi,), (16,)).on(TURNING.coordinates)
    links = box_transitions(BoxSet.full(grid), TURNING.with_params(by=pi / 4), samples).toarray() > 0
    assert links[np.arange(16), (np.arange(16) + 2) % 16].all()
    assert links.sum() <= (48 if samples == "adaptive" else 16)


@pytest.mark.parametrize("d", [1, 2, 3, 4])
def test_adaptive_images_miss_nothing_of_a_linear_map(d):
    """Random points of the boxes land in the boxes of the image."""
    rng = np.random.default_rng(d)
    matrix = rng.normal(size=(d, d)) * 1.5

    def linear(x, p):
        return tuple(sum(float(matrix[i, j]) * x[j] for j in range(d)) for i in range(d))

    point_map = discrete_map(linear, {}, [f"x{j}" for j in range(d)])
    grid = CellGrid((-1,) * d, (1,) * d, (7,) * d)
    some = BoxSet(grid, np.arange(grid.size // 2, grid.size // 2 + 3))
    image = box_image(some, point_map)
    points = (some.lower_corners()[:, None] + rng.uniform(size=(3, 3000, d)) * grid.widths).reshape(-1, d)
    landed = point_map(points)
    within = (np.abs(landed) < 1).all(axis=1)
    assert within.any() and image.contains(landed[within]).all()


def test_lattices_never_have_fewer_points_than_they_begin_with(monkeypatch):
    """However few are allowed: images of a strong stretching ask for many more."""
    some, stretched = boxes(9, 10), discrete_map(lambda x, p: (6 * (x[0] + 0.4), x[1] / 2), {}, ("x", "y"))
    whole = box_image(some, stretched)
    monkeypatch.setattr("cellmap.sets.box_images._MOST", 1)
    assert 0 < len(box_image(some, stretched)) <= len(whole)


def test_transitions_of_middles_are_fractions():
    """x -> 2 x mod 1 sends each half of a box to a box of its own."""
    links = box_transitions(line(8), DOUBLE, samples=6).toarray()
    expected = np.zeros((8, 8))
    for i in range(8):
        expected[i, (2 * i) % 8] = expected[i, (2 * i + 1) % 8] = 3
    np.testing.assert_array_equal(links, expected)


def test_images_do_not_depend_on_the_number_of_threads():
    some = BoxSet.full(CellGrid((-2, -1), (2, 1), (70, 70)))
    results = []
    for count in (1, 2, 3):
        set_threads(count)
        links = box_transitions(some, HENON)
        results.append((links.indptr, links.indices, links.data, box_image(some, HENON, 3).keys))
    set_threads(None)
    for arrays in results[1:]:
        for one, first in zip(arrays, results[0], strict=True):
            np.testing.assert_array_equal(one, first)


def test_orbits_that_end_hit_nothing():
    escaping = discrete_map(lambda x, p: (1e200 * x[0] * x[0] + 1e150,), {}, ("x",))
    assert not len(box_image(BoxSet.full(CellGrid((-1,), (1,), (4,))), escaping, 2))


def test_several_steps_at_a_time():
    assert box_image(BoxSet(line(8).grid, [1]), DOUBLE, 8, periods=3).keys.tolist() == list(range(8))
