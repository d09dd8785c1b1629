"""Simple cell mapping: cells to cells, groups, windows put together, basins."""

from __future__ import annotations

import itertools
from math import cos, pi, sin, tanh

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import systems
from cellmap import CellGrid, angle, discrete_map, find_basins, interpolated_map, set_threads, stroboscopic_map
from cellmap._compiled.kernels.chains import unravel
from cellmap.orbits import Kind
from cellmap.sets import simple_cell_mapping


def spiral(x, p):
    """Turn by a fixed angle, and bring the radius closer to 1."""
    stretch = 1.0 + p.pull * (1.0 - x[0] * x[0] - x[1] * x[1])
    return stretch * (p.c * x[0] - p.s * x[1]), stretch * (p.s * x[0] + p.c * x[1])


def unravelled(images):
    images = np.array(images, np.int64)
    groups, steps, periods = (np.empty(len(images), np.int32) for _ in range(3))
    count = unravel(images, groups, steps, periods)
    return groups.tolist(), steps.tolist(), periods[:count].tolist()


@pytest.fixture(scope="module")
def five():
    """Duffing's oscillator with five attractors, on a window that holds them all."""
    exact = stroboscopic_map(systems.duffing_oscillator(0.08, 0.0, 1.0, 0.2, 1.0))
    return exact, CellGrid((-1.8, -1.3), (1.8, 1.7), (360, 300))


@pytest.fixture
def doubling():
    """x' = x + 1/2 and so on: a map of which cells of width 1/2 know all."""
    return discrete_map(lambda x, p: (x[0] + 0.5, 0.5 * x[1]), {}, ("x", "y"))


class TestUnravelling:
    def test_of_a_map_by_hand(self):
        #         0 -> 1 -> 2 -> 0   3 -> 2   4 -> 3   5 -> 5   6 -> outside   7 -> 6   8 diverges   9 -> 8
        images = [1, 2, 0, 2, 3, 5, -1, 6, -2, 8]
        groups, steps, periods = unravelled(images)
        assert groups == [0, 0, 0, 0, 0, 1, -1, -1, -2, -2]
        assert steps == [0, 0, 0, 1, 2, 0, 1, 2, 1, 2]
        assert periods == [3, 1]

    def test_of_one_cell(self):
        assert unravelled([0]) == ([0], [0], [1])
        assert unravelled([-1]) == ([-1], [1], [])

    @given(st.integers(1, 60), st.integers(0, 2**32 - 1))
    def test_of_random_maps_is_what_following_each_cell_gives(self, n, seed):
        images = np.random.default_rng(seed).integers(-2, n, n)
        groups, steps, periods = unravelled(images)
        for cell in range(n):
            path = [cell]
            while path[-1] >= 0 and path[-1] not in path[:-1]:
                path.append(int(images[path[-1]]))
            if path[-1] < 0:
                assert (groups[cell], steps[cell]) == (path[-1], len(path) - 1)
            else:
                tail = path.index(path[-1])
                assert steps[cell] == tail
                assert periods[groups[cell]] == len(path) - 1 - tail
                assert all(groups[c] == groups[cell] for c in path)
        assert sorted(set(groups) - {-1, -2}) == list(range(len(periods)))

    def test_of_a_long_chain(self):
        n = 300_000
        groups, steps, periods = unravelled(np.minimum(np.arange(n) + 1, n - 1))
        assert (steps[0], groups[0], periods) == (n - 1, 0, [1])


class TestImages:
    def test_cells_are_half_open(self, doubling):
        """Centres at 1/4, 3/4, ... go to edges, which belong to the cell on their right; the last edge is outside."""
        quarter = discrete_map(lambda x, p: (x[0] + 0.25,), {}, ("x",))
        mapping = simple_cell_mapping(quarter, CellGrid((0,), (2,), (4,)))
        assert mapping.images.tolist() == [1, 2, 3, -1]
        back = discrete_map(lambda x, p: (x[0] - 0.25,), {}, ("x",))
        assert simple_cell_mapping(back, CellGrid((0,), (2,), (4,))).images.tolist() == [0, 1, 2, 3]

    def test_outside_and_diverged_are_kept_apart(self):
        """x' = x^1001: 1.4 and more diverge, beyond 1e100; 1.0 stays, and 1.1 only leaves the window."""
        powers = discrete_map(lambda x, p: (x[0] ** 1001,), {}, ("x",))
        mapping = simple_cell_mapping(powers, CellGrid((0.0,), (2.4,), (6,)))
        assert mapping.images.tolist() == [0, 0, 2, -2, -2, -2]
        assert mapping.groups.tolist() == [0, 0, 1, -2, -2, -2]
        assert simple_cell_mapping(powers, CellGrid((1.05,), (1.25,), (2,))).images.tolist() == [-1, -1]

    def test_one_cell(self):
        halves = discrete_map(lambda x, p: (x[0] / 2,), {}, ("x",))
        mapping = simple_cell_mapping(halves, CellGrid((-1,), (1,), (1,)))
        assert (mapping.images.tolist(), mapping.groups.tolist(), mapping.cell_periods.tolist()) == ([0], [0], [1])

    @pytest.mark.parametrize("lower", [-pi, 0.0, 1.0])
    def test_angles_wrap(self, lower):
        """A rotation by pi/2 on eight cells of a circle, for any branch cut: two groups of four."""
        quarter = discrete_map(lambda x, p: (x[0] + pi / 2,), {}, (angle("theta"),))
        mapping = simple_cell_mapping(quarter, CellGrid((lower,), (lower + 2 * pi,), (8,)))
        assert mapping.images.tolist() == [2, 3, 4, 5, 6, 7, 0, 1]
        assert mapping.group_periods.tolist() == [4, 4]

    def test_a_window_across_the_cut_of_an_angle(self):
        """Half a circle from pi/2 to 3 pi/2, with the cut in its middle."""
        rotated = discrete_map(lambda x, p: (x[0] + pi / 4,), {}, (angle("theta"),))
        mapping = simple_cell_mapping(rotated, CellGrid((pi / 2,), (3 * pi / 2,), (4,)))
        assert mapping.images.tolist() == [1, 2, 3, -1]

    def test_several_periods(self, doubling):
        mapping = simple_cell_mapping(doubling, CellGrid((0, -1), (4, 1), (8, 1)), periods=3)
        assert mapping.images.ravel().tolist() == [3, 4, 5, 6, 7, -1, -1, -1]
        assert mapping.cost.steps == 24

    def test_threads_do_not_matter(self, five):
        exact, grid = five
        results = []
        for threads in (1, 3):
            set_threads(threads)
            results.append(simple_cell_mapping(exact, grid, 2))
        np.testing.assert_array_equal(results[0].images, results[1].images)
        np.testing.assert_array_equal(results[0].groups, results[1].groups)


class TestWindows:
    @pytest.mark.parametrize("periods", [1, 3])
    def test_extended_is_as_if_mapped_at_once(self, five, periods):
        exact, grid = five
        small = CellGrid((-0.8, -0.3), (1.2, 0.7), (200, 100))
        extended = simple_cell_mapping(exact, small, periods).extend(grid)
        whole = simple_cell_mapping(exact, grid, periods)
        np.testing.assert_array_equal(extended.images, whole.images)
        np.testing.assert_array_equal(extended.groups, whole.groups)
        np.testing.assert_array_equal(extended.stray_cells, whole.stray_cells)
        assert extended.cost.steps == whole.cost.steps

    def test_joined_is_as_if_mapped_at_once(self, five):
        exact, _ = five
        left, right = CellGrid((-1, -1), (0.1, 1), (110, 200)), CellGrid((0, -1), (1.5, 1), (150, 200))
        joined = simple_cell_mapping(exact, left).join(simple_cell_mapping(exact, right))
        whole = simple_cell_mapping(exact, CellGrid((-1, -1), (1.5, 1), (250, 200)))
        np.testing.assert_array_equal(joined.images, whole.images)
        np.testing.assert_array_equal(joined.stray_cells, whole.stray_cells)

    def test_a_group_that_needs_both_windows(self):
        """x' = -x changes sides: each half alone loses all, and together they have a group of two for each pair."""
        mirrored = discrete_map(lambda x, p: (-x[0],), {}, ("x",))
        halves = [simple_cell_mapping(mirrored, CellGrid((a,), (a + 2,), (4,))) for a in (-2, 0)]
        assert all((m.groups == -1).all() for m in halves)
        for joined in (halves[0].join(halves[1]), halves[1].join(halves[0])):
            assert joined.groups.tolist() == [0, 1, 2, 3, 3, 2, 1, 0]
            assert len(joined.stray_cells) == 0

    def test_two_halves_of_a_circle(self):
        quarter = discrete_map(lambda x, p: (x[0] + pi / 2,), {}, (angle("theta"),))
        a, b = (simple_cell_mapping(quarter, CellGrid((s,), (s + pi,), (4,))) for s in (-pi, 0.0))
        assert a.join(b).images.tolist() == [2, 3, 4, 5, 6, 7, 0, 1]

    def test_what_does_not_fit(self, five):
        exact, _ = five
        mapping = simple_cell_mapping(exact, CellGrid((0, 0), (1, 1), (10, 10)))

        def other(lower, upper, shape, **k):
            return simple_cell_mapping(exact, CellGrid(lower, upper, shape), **k)

        with pytest.raises(ValueError, match="whole cells more"):
            mapping.extend(CellGrid((0, 0), (2, 1), (30, 10)))
        with pytest.raises(ValueError, match="whole cells away"):
            mapping.extend(CellGrid((-0.05, 0), (1.05, 1), (11, 10)))
        with pytest.raises(ValueError, match="widen it"):
            mapping.extend(CellGrid((0.1, 0), (1.1, 1), (10, 10)))
        with pytest.raises(TypeError, match="CellGrid"):
            mapping.extend("larger")
        with pytest.raises(ValueError, match="use extend"):
            mapping.join(other((1.5, 0), (2.5, 1), (10, 10)))
        with pytest.raises(ValueError, match="use extend"):
            mapping.join(other((0.5, 0.5), (1.5, 1.5), (10, 10)))
        with pytest.raises(ValueError, match="take as many"):
            mapping.join(other((1, 0), (2, 1), (10, 10), periods=2))
        with pytest.raises(ValueError, match="by one map"):
            mapping.join(simple_cell_mapping(exact.with_params(damping=0.1), CellGrid((1, 0), (2, 1), (10, 10))))
        with pytest.raises(TypeError, match="CellMapping"):
            mapping.join(CellGrid((1, 0), (2, 1), (10, 10)))


class TestBasins:
    def test_agree_with_exact_ones_up_to_a_cell_of_the_boundary(self):
        """Newton's map for x^2 = 1 in the plane of complex numbers: the boundary is the imaginary axis."""

        def newton(x, p):
            size = 2 * (x[0] ** 2 + x[1] ** 2)
            return x[0] / 2 + x[0] / size, x[1] / 2 - x[1] / size

        grid = CellGrid((-2, -2), (2, 2), (200, 200))
        point_map = discrete_map(newton, {}, ("re", "im"))
        direct = find_basins(point_map, grid)
        for periods in (1, 2, 4):
            basins = simple_cell_mapping(point_map, grid, periods).basins()
            wrong = basins.labels != direct.labels
            assert not (wrong & (np.abs(grid.centres()[..., 0]) > 2 * 4 / 200) & (basins.labels >= 0)).any()
            assert wrong[basins.labels >= 0].mean() < 0.02
            assert basins.attractors[0].points == pytest.approx(direct.attractors[0].points)

    def test_of_five_attractors(self, five):
        """All five, their groups merged; the same numbers as those of direct integration."""
        exact, grid = five
        direct = find_basins(exact, grid)
        mapping = simple_cell_mapping(exact, grid, periods=8)
        basins = mapping.basins()
        assert [(a.kind, a.period) for a in basins.attractors] == [(a.kind, a.period) for a in direct.attractors]
        assert len(mapping.group_periods) > len(basins.attractors) == 5
        within = basins.labels >= 0
        assert (basins.labels != direct.labels)[within].mean() < 0.04
        check = basins.verify(1000)
        assert check.low < (basins.labels != direct.labels)[within].mean() < check.high
        assert (basins.settling_time[within] == 8 * mapping.steps[within]).all()

    def test_several_periods_mislabel_less(self, five):
        """REFERENCES.md, published: 14 % at one period, 3 % with several."""
        exact, grid = five
        direct = find_basins(exact, grid)
        fractions = []
        for periods in (1, 4, 8):
            labels = simple_cell_mapping(exact, grid, periods).basins(attractors=direct.attractors).labels
            fractions.append((labels != direct.labels)[labels >= 0].mean())
        assert fractions[0] > 2 * fractions[1] > 2 * fractions[2]

    def test_without_refinement_groups_side_by_side_are_one(self):
        """A spiral sink: cells around it form groups of their own, which touch."""
        rotated = discrete_map(
            lambda x, p: (0.9 * (0.8 * x[0] - 0.6 * x[1]), 0.9 * (0.6 * x[0] + 0.8 * x[1])), {}, ("x", "y")
        )
        mapping = simple_cell_mapping(rotated, CellGrid((-1, -1), (1.04, 1.03), (100, 100)))
        assert len(mapping.group_periods) > 1
        basins = mapping.basins(refine=False)
        assert len(basins.attractors) == 1
        assert basins.attractors[0].period == 1
        assert np.abs(basins.attractors[0].points).max() < 0.2
        assert (basins.labels[mapping.groups >= 0] == 0).all()
        with pytest.raises(ValueError, match="no map"):
            basins.verify()

    def test_without_refinement_clusters_are_periods(self):
        """The logistic map at 3.5 has a period of four, at 3.2 one of two; and at 2.5 a point."""
        for mu, period in ((2.5, 1), (3.2, 2), (3.5, 4)):
            mapping = simple_cell_mapping(systems.logistic_map(mu), CellGrid((0.01,), (0.99,), (500,)), periods=5)
            basins = mapping.basins(refine=False)
            attractor = basins.attractors[basins.labels[100]]
            assert attractor.period == period
            refined = mapping.basins().attractors[0]
            assert refined.period == period
            assert np.sort(attractor.points[:, 0]) == pytest.approx(np.sort(refined.points[:, 0]), abs=0.01)

    @pytest.mark.parametrize(("rotation", "cells"), [(1.0, 400), (2.0**0.5, 400), (2.0, 60), (2.0, 400)])
    def test_without_refinement_an_invariant_circle_is_one(self, rotation, cells):
        """Groups of 22 to 44 cells on the unit circle that do not touch; a cell beside one belongs to another."""
        rotating = discrete_map(spiral, {"c": cos(rotation), "s": sin(rotation), "pull": 0.3}, ("x", "y"))
        mapping = simple_cell_mapping(rotating, CellGrid((-2, -2), (2, 2), (cells, cells)))
        assert len(mapping.group_periods) >= 3
        (circle,) = mapping.basins(refine=False).attractors
        assert np.hypot(*circle.points.T) == pytest.approx(1.0, abs=20.0 / cells)
        assert len(np.unique(circle.points, axis=0)) == circle.period

    @pytest.mark.parametrize("cells", [400, 800])
    def test_without_refinement_a_weak_invariant_circle_is_one(self, cells):
        """The delayed logistic map at 2.02: groups of six cells between a focus and the circle attract none."""
        step = lambda x, p=None: (2.02 * x[0] * (1.0 - x[1]), x[0])  # noqa: E731
        delayed = discrete_map(step, {}, ("x", "y"))
        mapping = simple_cell_mapping(delayed, CellGrid((0.0, 0.0), (1.0, 1.0), (cells, cells)))
        assert len(mapping.group_periods) > 10
        basins = mapping.basins(refine=False)
        (circle,) = basins.attractors
        assert (basins.labels[mapping.groups >= 0] == 0).all()
        exact = np.array(list(itertools.accumulate(range(5000), lambda x, _: step(x), initial=(0.4, 0.4)))[3000:])
        gaps = np.linalg.norm(circle.points[:, None] - exact, axis=-1)
        assert gaps.min(axis=1).max() < 10.0 / cells

    @pytest.mark.parametrize("cells", [10, 11, 50, 51])
    def test_without_refinement_wells_stay_apart(self, cells):
        """tanh(2 x) has sinks at +-0.9575, and a fixed point at 0 that no cell beside it goes back to."""
        wells = discrete_map(lambda x, p: (tanh(2 * x[0]),), {}, ("x",))
        basins = simple_cell_mapping(wells, CellGrid((-2.0,), (2.0,), (cells,))).basins(refine=False)
        labels = basins.labels
        assert len(basins.attractors) == 3
        assert labels[0] != labels[-1]
        assert (labels[: cells // 2 - 1] == labels[0]).all() and (labels[-(cells // 2) + 1 :] == labels[-1]).all()

    def test_a_chaotic_attractor_is_one(self):
        mapping = simple_cell_mapping(systems.logistic_map(4.0), CellGrid((0.0,), (1.0,), (1000,)))
        basins = mapping.basins()
        assert [a.kind for a in basins.attractors] == [Kind.CHAOTIC]

    def test_of_a_table(self, five):
        exact, grid = five
        table = interpolated_map(exact, grid, outside="integrate")
        a, b = (simple_cell_mapping(m, grid, 4).basins() for m in (exact, table))
        assert (a.labels != b.labels).mean() < 0.005
        assert all(x.points == pytest.approx(y.points) for x, y in zip(a.attractors, b.attractors, strict=True))

    def test_where_everything_leaves(self):
        away = discrete_map(lambda x, p: (x[0] + 10,), {}, ("x",))
        mapping = simple_cell_mapping(away, CellGrid((0,), (1,), (5,)))
        for refine in (True, False):
            basins = mapping.basins(refine=refine)
            assert basins.attractors == ()
            assert (basins.labels == -1).all()


def test_bad_input():
    halves = discrete_map(lambda x, p: (x[0] / 2,), {}, ("x",))
    grid = CellGrid((-1,), (1,), (5,))
    with pytest.raises(TypeError, match="give a PointMap"):
        simple_cell_mapping("halves", grid)
    with pytest.raises(TypeError, match="give a CellGrid"):
        simple_cell_mapping(halves, (5,))
    with pytest.raises(ValueError, match=r"periods=0: give a whole number of at least 1"):
        simple_cell_mapping(halves, grid, periods=0)
    with pytest.raises(ValueError, match="2 axes"):
        simple_cell_mapping(halves, CellGrid((-1, -1), (1, 1), (5, 5)))
    with pytest.raises(MemoryError, match="take fewer cells"):
        simple_cell_mapping(halves, CellGrid((-1,), (1,), (10**12,)))


def test_repr():
    """The centre 0.4 goes to 0.2, the lower edge of its own cell, which is periodic as the one around 0 is."""
    halves = discrete_map(lambda x, p: (x[0] / 2,), {}, ("x",), name="halves")
    text = repr(simple_cell_mapping(halves, CellGrid((-1,), (1,), (5,))))
    assert text == "CellMapping(halves, 5 cells, 2 periodic groups, 0 % escape)"
