"""Basins from a Markov chain on cells."""

from __future__ import annotations

import numpy as np
import pytest

import systems
from cellmap import CellGrid, discrete_map, find_basins, load_basins, save_basins, stroboscopic_map
from cellmap.sets import generalized_cell_mapping, simple_cell_mapping


class TestBasins:
    def test_agree_with_direct_ones_up_to_cells_of_the_boundary(self):
        """Newton's map for x^2 = 1 in the complex plane; the boundary is the imaginary axis."""

        def newton(x, p):
            size = 2 * (x[0] ** 2 + x[1] ** 2)
            return x[0] / 2 + x[0] / size, x[1] / 2 - x[1] / size

        grid = CellGrid((-2, -2), (2, 2), (100, 100))
        point_map = discrete_map(newton, {}, ("re", "im"))
        direct = find_basins(point_map, grid)
        chain = generalized_cell_mapping(point_map, grid)
        basins = chain.basins()
        inside = basins.labels >= 0
        far = np.abs(grid.centres()[..., 0]) > 1.5 * 4 / 100
        assert ((basins.labels == direct.labels) | ~inside | ~far).all()
        assert basins.verify(500).fraction < 0.02
        assert (basins.settling_time[inside] == np.round(chain.expected_times[inside])).all()
        # Mirror images have mirrored chances.
        assert chain.absorption[..., 0] == pytest.approx(chain.absorption[::-1, :, 1], abs=1e-9)

    def test_several_periods_find_small_attractors(self):
        """REFERENCES.md, published, on Duffing's oscillator with five attractors."""
        exact = stroboscopic_map(systems.duffing_oscillator(0.08, 0.0, 1.0, 0.2, 1.0))
        grid = CellGrid((-1.8, -1.3), (1.8, 1.7), (180, 150))
        found = [len(generalized_cell_mapping(exact, grid, periods=k).basins().attractors) for k in (1, 8)]
        assert found[0] < found[1] == 5

    def test_of_two_wells(self):
        exact = stroboscopic_map(systems.two_well_duffing())
        chain = generalized_cell_mapping(exact, CellGrid((-2.2, -2.2), (2.2, 2.2), (150, 150)), periods=2)
        found, chances = chain.probabilities()
        assert [a.points[0].round(4).tolist() for a in found] == [[-0.7791, 0.0274], [1.2101, 0.0553]]
        assert chances.sum(axis=-1) == pytest.approx(1.0)
        assert chances[..., 0].mean() == pytest.approx(0.5, abs=0.01)
        undecided = chain.basins(min_probability=0.9)
        assert ((undecided.labels == -3) == (chances.max(axis=-1) < 0.9)).all()
        assert set(np.unique(chain.domiciles)) == {1, 2}
        assert ((chain.domiciles == 1) == (chances.max(axis=-1) > 1 - 1e-9)).mean() > 0.999
        assert any(len(one.cells) > 100 for one in chain.transient)  # the chaotic saddle
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

    def test_where_areas_are_preserved(self):
        """A rotation by a rational angle has classes everywhere; the chain stays small."""
        chain = generalized_cell_mapping(
            discrete_map(lambda x, p: (-x[1], x[0]), {}, ("x", "y")), CellGrid((-1, -1), (1, 1), (60, 60)), (3, 3)
        )
        assert len(chain.closed) == 900
        assert {one.period for one in chain.closed} == {4}
        assert (chain.domiciles == 1).all()


def test_basins_of_cells_are_stored_like_others(tmp_path):
    exact = stroboscopic_map(systems.two_well_duffing())
    grid = CellGrid((-2, -2), (2, 2), (40, 40))
    chain, mapping = generalized_cell_mapping(exact, grid, (2, 2)), simple_cell_mapping(exact, grid)
    for basins in (chain.basins(), chain.basins(refine=False), mapping.basins(), mapping.basins(refine=False)):
        same = load_basins(save_basins(basins, tmp_path / "basins.h5"))
        np.testing.assert_array_equal(same.labels, basins.labels)
        assert same.settings["method"] == basins.settings["method"]
        for a, b in zip(same.attractors, basins.attractors, strict=True):
            np.testing.assert_array_equal(a.points, b.points)
            np.testing.assert_array_equal(a.multipliers, b.multipliers)
