"""Simple cell mapping: cells to cells, groups, windows put together, basins."""

import itertools
from math import cos, pi, sin, tanh

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from maps_of_cells import AWAY, FIVE, FIVE_CELLS, NEWTON, POWERS, TURNING

import systems
from cellmap import CellGrid, discrete_map, find_basins, interpolated_map
from cellmap._compiled.kernels.chains import unravel
from cellmap.orbits import Kind
from cellmap.sets import generalized_cell_mapping, simple_cell_mapping

WINDOW = CellGrid((-1.8, -1.3), (1.8, 1.7), (180, 150))
SHIFT = discrete_map(lambda x, p: (x[0] + p.by,), {"by": 0.25}, ("x",))


def spiral(x, p):
    """Turn by a fixed angle, and bring the radius closer to 1."""
    stretch = 1.0 + p.pull * (1.0 - x[0] * x[0] - x[1] * x[1])
    return stretch * (p.c * x[0] - p.s * x[1]), stretch * (p.s * x[0] + p.c * x[1])


def unravelled(images):
    images = np.array(images, np.int64)
    groups, steps, periods = (np.empty(len(images), np.int32) for _ in range(3))
    count = unravel(images, groups, steps, periods)
    return groups.tolist(), steps.tolist(), periods[:count].tolist()


class TestUnravelling:
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
    @pytest.mark.parametrize(("by", "images"), [(0.25, [1, 2, 3, -1]), (-0.25, [0, 1, 2, 3])])
    def test_cells_are_half_open(self, by, images):
        """Centres at 1/4, 3/4, ... go to edges, which belong to the cell on their right; the last edge is outside."""
        assert simple_cell_mapping(SHIFT.with_params(by=by), CellGrid((0,), (2,), (4,))).images.tolist() == images

    def test_outside_and_diverged_are_kept_apart(self):
        mapping = simple_cell_mapping(POWERS, CellGrid((0.0,), (2.4,), (6,)))
        assert mapping.images.tolist() == [0, 0, 2, -2, -2, -2]
        assert mapping.groups.tolist() == [0, 0, 1, -2, -2, -2]
        assert simple_cell_mapping(POWERS, CellGrid((1.05,), (1.25,), (2,))).images.tolist() == [-1, -1]

    @pytest.mark.parametrize("lower", [-pi, 0.0, 1.0])
    def test_angles_wrap(self, lower):
        """A rotation by pi/2 on eight cells of a circle, for any branch cut: two groups of four; by halves as well."""
        halves = [simple_cell_mapping(TURNING, CellGrid((s,), (s + pi,), (4,))) for s in (lower, lower + pi)]
        for mapping in (
            simple_cell_mapping(TURNING, CellGrid((lower,), (lower + 2 * pi,), (8,))),
            halves[0].join(halves[1]),
        ):
            assert mapping.images.tolist() == [2, 3, 4, 5, 6, 7, 0, 1]
            assert mapping.group_periods.tolist() == [4, 4] and (mapping.cell_periods == 4).all()

    def test_several_periods(self):
        by_halves = discrete_map(lambda x, p: (x[0] + 0.5, 0.5 * x[1]), {}, ("x", "y"))
        mapping = simple_cell_mapping(by_halves, CellGrid((0, -1), (4, 1), (8, 1)), periods=3)
        assert mapping.images.ravel().tolist() == [3, 4, 5, 6, 7, -1, -1, -1]
        assert mapping.cost.steps == 24


class TestWindows:
    @pytest.mark.parametrize("periods", [1, 3])
    def test_extended_is_as_if_mapped_at_once(self, periods):
        small = CellGrid((-0.8, -0.3), (1.2, 0.7), (100, 50))
        extended = simple_cell_mapping(FIVE, small, periods).extend(WINDOW)
        whole = simple_cell_mapping(FIVE, WINDOW, periods)
        np.testing.assert_array_equal(extended.images, whole.images)
        np.testing.assert_array_equal(extended.groups, whole.groups)
        np.testing.assert_array_equal(extended.stray_cells, whole.stray_cells)
        assert extended.cost.steps == whole.cost.steps

    def test_joined_is_as_if_mapped_at_once(self):
        left, right = CellGrid((-1, -1), (0.1, 1), (55, 100)), CellGrid((0, -1), (1.5, 1), (75, 100))
        joined = simple_cell_mapping(FIVE, left).join(simple_cell_mapping(FIVE, right))
        whole = simple_cell_mapping(FIVE, CellGrid((-1, -1), (1.5, 1), (125, 100)))
        np.testing.assert_array_equal(joined.images, whole.images)
        np.testing.assert_array_equal(joined.stray_cells, whole.stray_cells)

    def test_a_group_that_needs_both_windows(self):
        """x' = -x changes sides: each half alone loses all, and together they have a group of two for each pair."""
        mirrored = discrete_map(lambda x, p: (-x[0],), {}, ("x",))
        halves = [simple_cell_mapping(mirrored, CellGrid((a,), (a + 2,), (4,))) for a in (-2, 0)]
        assert all((m.groups == -1).all() for m in halves)
        # In either order.
        for joined in (halves[0].join(halves[1]), halves[1].join(halves[0])):
            assert joined.groups.tolist() == [0, 1, 2, 3, 3, 2, 1, 0]
            assert len(joined.stray_cells) == 0


class TestBasins:
    def test_agree_with_exact_ones_up_to_a_cell_of_the_boundary(self):
        grid = CellGrid((-2, -2), (2, 2), (200, 200))
        direct = find_basins(NEWTON, grid)
        for periods in (1, 4):
            mapping = simple_cell_mapping(NEWTON, grid, periods)
            basins = mapping.basins()
            wrong, within = basins.labels != direct.labels, basins.labels >= 0
            assert not (wrong & (np.abs(grid.centres()[..., 0]) > 2 * 4 / 200) & within).any()
            assert wrong[within].mean() < 0.02
            assert basins.attractors[0].points == pytest.approx(direct.attractors[0].points)
            assert (basins.settling_time[within] == periods * mapping.steps[within]).all()
            assert 0 < mapping.cost.seconds < basins.cost.seconds < 600
        check = basins.verify(1000)
        assert check.low <= wrong[within].mean() <= check.high

    @pytest.mark.thorough
    def test_of_five_attractors(self):
        """REFERENCES.md, published: 14 % are wrong at one period, 3 % with several; chains find all five with eight."""
        grid = CellGrid((-1.8, -1.3), (1.8, 1.7), (360, 300))
        direct, fractions = find_basins(FIVE, grid), []
        for periods in (1, 4, 8):
            mapping = simple_cell_mapping(FIVE, grid, periods)
            basins = mapping.basins(attractors=direct.attractors)
            fractions.append((basins.labels != direct.labels)[basins.labels >= 0].mean())
        assert fractions[0] > 2 * fractions[1] > 2 * fractions[2]
        assert fractions[2] < 0.04
        basins = mapping.basins()
        assert [(a.kind, a.period) for a in basins.attractors] == [(a.kind, a.period) for a in direct.attractors]
        assert len(mapping.group_periods) > len(basins.attractors) == 5
        by_table = simple_cell_mapping(interpolated_map(FIVE, grid, outside="integrate"), grid, 8).basins()
        assert (by_table.labels != basins.labels).mean() < 0.005
        assert all(
            a.points == pytest.approx(b.points) for a, b in zip(by_table.attractors, basins.attractors, strict=True)
        )
        found = [len(generalized_cell_mapping(FIVE, WINDOW, periods=k).basins().attractors) for k in (1, 8)]
        assert found[0] < found[1] == 5

    @pytest.mark.parametrize(("rotation", "cells"), [(1.0, 400), (2.0**0.5, 400), (2.0, 60), (2.0, 400)])
    def test_without_refinement_an_invariant_circle_is_one(self, rotation, cells):
        """Groups of 22 to 44 cells on the unit circle that do not touch; a cell beside one belongs to another."""
        rotating = discrete_map(spiral, {"c": cos(rotation), "s": sin(rotation), "pull": 0.3}, ("x", "y"))
        mapping = simple_cell_mapping(rotating, CellGrid((-2, -2), (2, 2), (cells, cells)))
        assert len(mapping.group_periods) >= 3
        (circle,) = mapping.basins(refine=False).attractors
        assert np.hypot(*circle.points.T) == pytest.approx(1.0, abs=20.0 / cells)
        assert len(np.unique(circle.points, axis=0)) == circle.period

    @pytest.mark.parametrize("cells", [400, pytest.param(800, marks=pytest.mark.thorough)])
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
        basins = simple_cell_mapping(systems.logistic_map(4.0), CellGrid((0.0,), (1.0,), (1000,))).basins()
        assert [a.kind for a in basins.attractors] == [Kind.CHAOTIC]

    def test_where_everything_leaves(self):
        mapping = simple_cell_mapping(AWAY, FIVE_CELLS)
        for refine in (True, False):
            basins = mapping.basins(refine=refine)
            assert basins.attractors == ()
            assert (basins.labels == -1).all()
