"""Hard cases with numbers beyond all bounds, attractors that are very small or close together, and other units."""

import numpy as np
import pytest

from cellmap import CellGrid, ForcedSystem, Label, discrete_map, find_attractors, find_basins, stroboscopic_map


def test_blow_up_in_finite_time():
    """x' = x^2 reaches infinity at t = 1/x: beyond x = 1 within the first period, later from smaller ones."""
    exact = stroboscopic_map(ForcedSystem(lambda t, x, p: (x[0] ** 2 - 0.01,), {}, 1.0, ("x",)))
    basins = find_basins(exact, [[2.0], [0.2], [0.05], [-3.0]], max_periods=2000)
    assert basins.labels.tolist() == [Label.DIVERGED, Label.DIVERGED, 0, 0]
    assert basins.attractors[0].points == pytest.approx(np.array([[-0.1]]), abs=1e-9)


# --- small things


def test_attractor_much_smaller_than_the_window():
    """Two wells 2e-6 apart in a window of length 2 are two attractors."""
    tiny = discrete_map(
        lambda x, p: (x[0] - 0.5 * x[0] * (x[0] ** 2 / 1e-12 - 1) / (1 + x[0] ** 2 / 1e-12),), {}, ("x",)
    )
    basins = find_basins(tiny, CellGrid((-1.0,), (1.0,), (50,)))
    assert sorted(a.points[0, 0] for a in basins.attractors) == pytest.approx([-1e-6, 1e-6], rel=1e-6)
    assert (np.diff(basins.labels) != 0).sum() == 1


@pytest.mark.parametrize("scale", [1e-9, 1e-3, 1.0, 1e6])
def test_units_do_not_matter(scale):
    """The same two wells in other units."""
    wells = discrete_map(lambda x, p: (x[0] + 0.5 * x[0] * (1 - (x[0] / p.s) ** 2),), {"s": scale}, ("x",))
    basins = find_basins(wells, CellGrid((-1.5 * scale,), (1.5 * scale,), (40,)))
    assert sorted(a.points[0, 0] / scale for a in basins.attractors) == pytest.approx([-1.0, 1.0], abs=1e-9)
    assert [f.count for f in basins.fractions.values()] == [20, 20]


@pytest.mark.parametrize("distance", [1e-3, 1e-5])
def test_attractors_close_to_each_other_are_two(distance):
    def wells(x, p):
        u = (x[0] - 0.4) / p.d
        return (0.4 + p.d * (u + 0.5 * u * (1 - u * u)),)

    exact = discrete_map(wells, {"d": distance}, ("x",))
    initial_conditions = 0.4 + distance * np.linspace(-1.4, 1.4, 20)[:, None]
    found = find_attractors(exact, initial_conditions)
    assert sorted(a.points[0, 0] for a in found) == pytest.approx([0.4 - distance, 0.4 + distance], abs=1e-4 * distance)
