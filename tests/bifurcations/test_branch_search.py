"""All branches in a window: curves in closed form, isolas among them, and those of the driven pendulum."""

import numpy as np
import pytest

from cellmap import CellGrid, discrete_map
from cellmap.bifurcations import find_branches
from systems import logistic_map

WINDOW = CellGrid((-2.05,), (5.0,), (150,))


def two_circles_and_a_line(x, p):
    """Fixed points on the circles x^2 + q^2 = 1 and (x - 3)^2 + (q - 0.5)^2 = 1/4, and at x = 4.5."""
    return (x[0] + 0.02 * (1 - x[0] ** 2 - p.q**2) * (0.25 - (x[0] - 3) ** 2 - (p.q - 0.5) ** 2) * (x[0] - 4.5),)


def test_an_isola_between_two_values_is_missed():
    exact = discrete_map(lambda x, p: (x[0] + 0.3 * (0.01 - x[0] ** 2 - p.q**2),), {"q": 0.0}, ("x",))
    assert find_branches(exact, "q", -2.0, 2.0, WINDOW, n_values=2).branches == ()
    assert len(find_branches(exact, "q", -2.0, 2.0, WINDOW, n_values=9).isolas) == 1


def test_an_isola_that_the_second_search_alone_finds_is_told():
    """The values of the first search are -1.2361 and 0.7639; the isola is around the one between."""
    exact = discrete_map(lambda x, p: (x[0] + 0.3 * (0.01 - x[0] ** 2 - (p.q + 0.2) ** 2),), {"q": 0.0}, ("x",))
    with pytest.warns(
        UserWarning, match=r"1 of 1 branches, over q=-0\.29\d+ to -0\.10\d+, were found by the second search"
    ):
        found = find_branches(exact, "q", -2.0, 2.0, WINDOW, n_values=2)
    assert found.late.tolist() == [True]
    assert "1 of them closed, 1 found late, 0 orbits at 2 values)" in repr(found)
    assert found.missed.tolist() == found.orbits.tolist() == [0, 0]


def test_orbits_that_coarse_cells_miss_are_told():
    """One to five fixed points at each value, of which eight cells miss one."""
    exact = discrete_map(two_circles_and_a_line, {"q": 0.0}, ("x",))
    with pytest.warns(UserWarning, match=r"orbits on the branches at q=0\.391985 were missed"):
        found = find_branches(exact, "q", -2.0, 2.0, CellGrid((-2.05,), (5.0,), (8,)), step=0.03)
    q = found.values
    expected = 1 + 2 * (np.abs(q) < 1.0) + 2 * (np.abs(q - 0.5) < 0.5)
    np.testing.assert_array_equal(found.orbits + found.missed, expected)
    assert repr(found).endswith(f"at 9 values, {found.missed.sum()} missed)")


def test_branches_of_the_logistic_map_are_found_once():
    """The fixed points 0 and 1 - 1/mu, in parts up to 1 and from 1 on, and the doubled orbits from 3 and 1 + sqrt 6."""
    region = CellGrid((-0.21,), (1.2,), (300,))
    found = find_branches(logistic_map(2.8), "mu", 0.5, 3.5, region, longest_period=4)
    assert sorted(b.period for b in found.branches) == [1, 1, 1, 2, 4]
    assert found.connected.tolist() == [False, True, True, True, True]
    born = [b.values.min() for b in found.branches if b.period > 1]
    np.testing.assert_allclose(born, [3.0, 1.0 + np.sqrt(6.0)], atol=0.02)
    assert found.not_followed == ()
