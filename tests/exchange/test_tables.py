"""Results as tables of pandas."""

from __future__ import annotations

import numpy as np
import pytest

from cellmap import (
    CellGrid,
    bifurcation_diagram,
    continue_orbit,
    discrete_map,
    find_attractors,
    find_basins,
    periodic_orbit,
)
from cellmap.exchange import to_dataframe
from cellmap.maps import angle


def wells():
    return discrete_map(lambda x, p: (p.r * x[0] - x[0] ** 3, 0.5 * x[1]), {"r": 1.5}, ("x", "y"), "two wells")


def test_attractors_have_a_row_each():
    """Fixed points at ±sqrt(r - 1) with the multipliers r - 3 (r - 1) = 0 at r = 1.5 and 1/2."""
    basins = find_basins(wells(), CellGrid((-1.2, -1.0), (1.2, 1.0), (12, 8)))
    table = basins.to_dataframe()
    np.testing.assert_allclose(np.sort(table["x"]), [-(0.5**0.5), 0.5**0.5], atol=1e-9)
    np.testing.assert_allclose(table["largest_multiplier"], 0.5, atol=1e-9)
    assert table["count"].tolist() == [48, 48]
    assert table["name"].tolist() == [basins.label_name(k) for k in range(2)]
    assert "fraction" not in to_dataframe(basins.attractors)


def test_no_attractors_are_an_empty_table():
    doubled = discrete_map(lambda x, p: (2 * x[0] + 1,), {}, ("x",))
    table = find_basins(doubled, CellGrid((1.0,), (2.0,), (4,))).to_dataframe()
    assert len(table) == 0
    assert "fraction" in table


def test_a_superstable_attractor_has_the_multiplier_zero():
    squared = discrete_map(lambda x, p: (x[0] ** 2,), {}, ("x",))
    assert to_dataframe(find_attractors(squared, [[0.1]]))["largest_multiplier"].tolist() == pytest.approx([0.0])


def test_branches_and_their_bifurcations():
    """The orbit at 0 loses stability at r = 1, where its multiplier r crosses 1."""
    branch = continue_orbit(wells(), periodic_orbit(wells(), [0.0, 0.0]), "r", 0.7, 1.6)
    table = branch.to_dataframe()
    assert list(table) == ["r", "x", "y", "largest_multiplier", "unstable"]
    np.testing.assert_allclose(table["largest_multiplier"], np.maximum(table["r"], 0.5), atol=1e-8)
    assert table["unstable"].tolist() == (table["r"] > 1).astype(int).tolist()
    found = to_dataframe(branch.bifurcations)
    assert found["kind"].tolist() == ["pitchfork"]
    assert found["value"].tolist() == pytest.approx([1.0], abs=1e-9)


def test_diagrams_have_a_row_for_each_point():
    diagram = bifurcation_diagram(wells(), "r", [1.2, 1.5], [0.4, 0.1], periods=64)
    table = diagram.to_dataframe()
    assert len(table) == 2 * 2 * 64
    chosen = table[(table["r"] == 1.5) & (table["direction"] == "down")]
    np.testing.assert_array_equal(chosen["x"], diagram.points[1, 1, :, 0])
    np.testing.assert_allclose(chosen["x"], 0.5**0.5, atol=1e-5)


def test_columns_keep_their_names_apart():
    halved = discrete_map(lambda x, p: (x[0] / 2, x[1] / 2), {}, (angle("period"), "kind"))
    table = to_dataframe(find_attractors(halved, [[0.1, 0.1]]))
    assert table[["period", "period_", "kind", "kind_"]].to_numpy().tolist() == [[1, 0.0, "fixed point", 0.0]]


@pytest.mark.parametrize("other", [3, (), [3], "x", None])
def test_other_results_are_refused(other):
    with pytest.raises(TypeError, match=r"^result=.*: give Basins"):
        to_dataframe(other)
