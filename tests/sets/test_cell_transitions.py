"""Transitions between cells, invariant measures, and basins from a Markov chain on cells."""

from math import pi

import numpy as np
import pytest
from maps_of_cells import HALVES, NEWTON, POWERS, TURNING, TWO_WELLS

import systems
from cellmap import CellGrid, discrete_map, find_basins, load_basins, save_basins, set_threads
from cellmap.sets import generalized_cell_mapping, simple_cell_mapping


class TestTransitions:
    def test_of_a_line_stretched_threefold(self):
        """x' = 3 x on cells of width 1 around 0: a cell goes to three, by a third each."""
        tripled = discrete_map(lambda x, p: (3 * x[0],), {}, ("x",))
        chain = generalized_cell_mapping(tripled, CellGrid((0,), (4,), (4,)), samples=(9,))
        expected = np.zeros((6, 6))
        expected[0, 0:3] = 1 / 3
        expected[1, 3], expected[1, -1] = 1 / 3, 2 / 3
        expected[2:4, -1] = 1.0
        expected[4, 4] = expected[5, 5] = 1.0
        assert chain.matrix.toarray() == pytest.approx(expected)
        assert chain.closed == ()
        assert chain.expected_times == pytest.approx(np.linalg.solve(np.eye(4) - expected[:4, :4], np.ones(4)))
        assert chain.absorption[:, -1] == pytest.approx(1.0)

    def test_angles_wrap(self):
        chain = generalized_cell_mapping(TURNING.with_params(by=pi / 8), CellGrid((-pi,), (pi,), (8,)), samples=(4,))
        expected = 0.5 * (np.eye(8) + np.roll(np.eye(8), 1, axis=1))
        assert chain.matrix.toarray()[:8, :8] == pytest.approx(expected)
        assert (len(chain.closed), chain.closed[0].period) == (1, 1)
        assert chain.measures[0] == pytest.approx(1 / 8)

    def test_one_sample_is_a_simple_cell_mapping(self):
        grid = CellGrid((-2, -2), (2, 2), (60, 60))
        simple = simple_cell_mapping(TWO_WELLS, grid, 2)
        chain = generalized_cell_mapping(TWO_WELLS, grid, samples=(1, 1), periods=2)
        targets = chain.matrix.indices[:-2]
        np.testing.assert_array_equal(
            np.where(targets < grid.size, targets, targets - grid.size - 2), simple.images.ravel()
        )
        np.testing.assert_array_equal(chain.expected_times, 2 * simple.steps)
        assert sorted(one.period for one in chain.closed) == sorted(simple.group_periods)
        np.testing.assert_array_equal(chain.basins().labels, simple.basins().labels)

    def test_of_one_cell_and_of_orbits_that_end(self):
        one = generalized_cell_mapping(HALVES, CellGrid((-1,), (1,), (1,)))
        assert (one.closed[0].cells.tolist(), one.domiciles.tolist(), one.expected_times.tolist()) == ([0], [1], [0.0])
        ends = generalized_cell_mapping(POWERS, CellGrid((1.05,), (2.05,), (10,)))
        assert ends.absorption[0, -1] > 0.9 and ends.absorption[-1, -2] == 1.0
        assert set(ends.basins().labels) == {-1, -2}

    def test_random_samples_and_threads(self):
        grid = CellGrid((-2, -2), (2, 2), (40, 40))
        chains = []
        for threads, seed in ((1, 0), (3, 0), (1, 1)):
            set_threads(threads)
            chains.append(generalized_cell_mapping(TWO_WELLS, grid, samples=12, noise=0.01, rng=seed))
        for name in ("data", "indices", "indptr"):
            np.testing.assert_array_equal(getattr(chains[0].matrix, name), getattr(chains[1].matrix, name))
        assert chains[0].matrix.nnz != chains[2].matrix.nnz
        assert chains[0].matrix.sum(axis=1) == pytest.approx(1.0)


class TestMeasures:
    def test_of_a_noisy_line_is_normal(self):
        """x' = a x + s w: variance s^2 / (1 - a^2)."""
        a, s = 0.7, 0.1
        line = discrete_map(lambda x, p: (p.a * x[0],), {"a": a}, ("x",))
        chain = generalized_cell_mapping(line, CellGrid((-1,), (1,), (200,)), samples=4000, noise=s)
        assert len(chain.closed) <= 1
        cells = np.arange(40, 160)
        inner = chain.matrix[cells][:, cells].toarray()
        measure = np.linalg.matrix_power(inner / inner.sum(axis=1, keepdims=True), 200)[60]
        x = chain.grid.axis(0)[cells]
        assert measure @ x == pytest.approx(0.0, abs=0.005)
        assert measure @ x**2 == pytest.approx(s**2 / (1 - a**2), rel=0.02)

    def test_of_bounded_noise_is_a_class(self):
        """x' = x/2 + u, u uniform in [-1/4, 1/4]: the class is [-1/2, 1/2], the variance 1/36."""
        chain = generalized_cell_mapping(
            HALVES, CellGrid((-1,), (1,), (100,)), 1000, noise=lambda rng, n: rng.uniform(-0.25, 0.25, (n, 1))
        )
        (only,) = chain.closed
        x = chain.grid.axis(0)[only.cells]
        assert (x.min(), x.max()) == pytest.approx((-0.49, 0.49), abs=0.021)
        assert chain.measures[0] @ x**2 == pytest.approx(0.25**2 / 3 / (1 - 0.25), rel=0.02)
        assert (chain.basins().labels == 0).all()
        assert chain.density().sum() / 50 == pytest.approx(1.0)
        with pytest.raises(ValueError, match="refine=True"):
            chain.basins(refine=True)


class TestBasins:
    def test_agree_with_direct_ones_up_to_cells_of_the_boundary(self):
        grid = CellGrid((-2, -2), (2, 2), (100, 100))
        direct = find_basins(NEWTON, grid)
        chain = generalized_cell_mapping(NEWTON, grid)
        basins = chain.basins()
        inside = basins.labels >= 0
        far = np.abs(grid.centres()[..., 0]) > 1.5 * 4 / 100
        assert ((basins.labels == direct.labels) | ~inside | ~far).all()
        assert basins.verify(500).fraction < 0.02
        assert (basins.settling_time[inside] == np.round(chain.expected_times[inside])).all()
        # Mirror images have mirrored chances.
        assert chain.absorption[..., 0] == pytest.approx(chain.absorption[::-1, :, 1], abs=1e-9)

    def test_of_two_wells(self):
        chain = generalized_cell_mapping(TWO_WELLS, CellGrid((-2.2, -2.2), (2.2, 2.2), (100, 100)), periods=2)
        found, chances = chain.probabilities()
        assert [a.points[0].round(4).tolist() for a in found] == [[-0.7791, 0.0274], [1.2101, 0.0553]]
        assert chances.sum(axis=-1) == pytest.approx(1.0)
        assert chances[..., 0].mean() == pytest.approx(0.5, abs=0.01)
        undecided = chain.basins(min_probability=0.9)
        assert ((undecided.labels == -3) == (chances.max(axis=-1) < 0.9)).all()
        assert set(np.unique(chain.domiciles)) == {1, 2}
        assert ((chain.domiciles == 1) == (chances.max(axis=-1) > 1 - 1e-9)).mean() > 0.999
        assert any(len(one.cells) > 50 for one in chain.transient)  # the chaotic saddle
        assert chain.classes == chain.closed + chain.transient

    def test_without_refinement(self):
        """A cycle of two: one class of period 2."""
        chain = generalized_cell_mapping(systems.logistic_map(3.2), CellGrid((0.01,), (0.99,), (500,)))
        basins = chain.basins(refine=False)
        assert [a.period for a in basins.attractors] == [2]
        refined = chain.basins()
        assert np.sort(basins.attractors[0].points[:, 0]) == pytest.approx(
            np.sort(refined.attractors[0].points[:, 0]), abs=0.01
        )


def test_basins_of_cells_are_stored_like_others(tmp_path):
    grid = CellGrid((-2, -2), (2, 2), (40, 40))
    chain, mapping = generalized_cell_mapping(TWO_WELLS, grid, (2, 2)), simple_cell_mapping(TWO_WELLS, grid)
    for basins in (chain.basins(), chain.basins(refine=False), mapping.basins(), mapping.basins(refine=False)):
        same = load_basins(save_basins(basins, tmp_path / "basins.h5"))
        np.testing.assert_array_equal(same.labels, basins.labels)
        assert same.settings["method"] == basins.settings["method"]
        for a, b in zip(same.attractors, basins.attractors, strict=True):
            np.testing.assert_array_equal(a.points, b.points)
            np.testing.assert_array_equal(a.multipliers, b.multipliers)
