"""Basins from a Markov chain on cells."""

from __future__ import annotations

import numpy as np
import pytest
from maps_of_cells import NEWTON, TWO_WELLS

import systems
from cellmap import CellGrid, find_basins, load_basins, save_basins
from cellmap.sets import generalized_cell_mapping, simple_cell_mapping


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
