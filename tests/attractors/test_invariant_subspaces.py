"""Chaos in and beside invariant subspaces: Milnor attractors, attractors on two sides of a plane, neutral families."""

from dataclasses import replace
from math import exp, log
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial import KDTree

from cellmap import CellGrid, discrete_map, find_attractors, find_basins, load_basins, save_basins
from cellmap.attractors import Label
from cellmap.attractors.kinds.invariant_subspaces import hold, neutral_family
from cellmap.attractors.kinds.transients import Reason
from cellmap.maps.orbit_batch import Orbits
from cellmap.maps.paths import path_of
from cellmap.orbits import Kind
from cellmap.orbits.attractor import InvariantSubspace, distinct_names

P = 0.7
GROWTH = 1.5, 0.3286  # of y on the branches of a skew tent map, which come like tosses of a coin
ETA = 0.21668  # the solution of p a^eta + (1 - p) b^eta = 1, see the test of the depth


def tent(x: Any) -> Any:
    return x / P if x < P else (1.0 - x) / (1.0 - P)


def riddled(x: Any, p: Any) -> tuple[Any, Any]:
    """The line y = 0 attracts on average; beyond |y| = 1 everything grows to infinity."""
    factor = p.a if x[0] < P else p.b
    return tent(x[0]), factor * x[1] + 0.2 * x[1] ** 3


def oblique(x: Any, p: Any) -> tuple[Any, Any]:
    """The same in coordinates X = x + y, Y = y - x / 2: the line is Y = -X / 2."""
    u, v = riddled(((x[0] - x[1]) / 1.5, (x[0] + 2.0 * x[1]) / 3.0), p)
    return u + v, v - 0.5 * u


def synchronized(x: Any, p: Any) -> tuple[Any, Any]:
    first, second = 3.8 * x[0] * (1.0 - x[0]), 3.8 * x[1] * (1.0 - x[1])
    return first + p.e * (second - first), second + p.e * (first - second)


@pytest.mark.parametrize(
    ("f", "region"), [(riddled, ((0.05, -1.4), (0.95, 1.4))), (oblique, ((0.0, -0.5), (1.0, 0.2)))]
)
def test_chaos_in_a_subspace_that_attracts_on_average(f: Any, region: Any) -> None:
    """Exponents by their closed forms; no orbit that counts as converged goes away in ten times the periods."""
    a, b = GROWTH
    point_map = discrete_map(f, {"a": a, "b": b}, ("x", "y"))
    basins = find_basins(point_map, CellGrid(*region, (20, 20)))
    (attractor,) = basins.attractors
    subspace = attractor.subspace
    assert attractor.kind is Kind.CHAOTIC
    assert not attractor.verified
    assert subspace is not None
    assert_allclose(subspace.normals, [[0.0, 1.0]] if f is riddled else [[0.5, 1.0]], atol=1e-12)
    assert_allclose(subspace.exponent, P * log(a) + (1.0 - P) * log(b), rtol=0.6)  # five standard errors are all of it
    assert_allclose(attractor.exponents[0], -P * log(P) - (1 - P) * log(1 - P), atol=0.02)
    on = basins.grid.centres()[basins.labels == 0]
    assert len(on) > 20
    assert np.isfinite(point_map.orbit(on, 20_000).points[-1]).all()
    assert (basins.labels == Label.UNDECIDED).mean() < 0.05
    assert basins.verify(40).wrong == basins.verify(40, search=True).wrong == 0


def test_the_depth_is_that_of_one_in_a_thousand() -> None:
    a, b = GROWTH
    assert_allclose(P * a**ETA + (1 - P) * b**ETA, 1.0, atol=1e-4)
    (attractor,) = find_attractors(
        discrete_map(riddled, {"a": a, "b": b}, ("x", "y")), [[x, 0.1] for x in np.linspace(0.1, 0.9, 32)]
    )
    assert attractor.subspace is not None
    assert_allclose(log(attractor.subspace.depth), log(1e-3) / ETA, rtol=0.25)


def test_what_comes_to_a_subspace_too_slowly_says_so() -> None:
    """A normal exponent of -0.006 takes thousands of periods to bring orbits so near that none comes out."""
    point_map = discrete_map(riddled, {"a": 1.27, "b": 0.5612}, ("x", "y"))
    with pytest.warns(UserWarning, match="invariant subspace"):
        basins = find_basins(point_map, CellGrid((0.05, -0.2), (0.95, 0.2), (8, 8)), max_periods=600)
    assert basins.undecided[Reason.RIDDLED] > 0
    longer = find_basins(point_map, CellGrid((0.05, -0.2), (0.95, 0.2), (8, 8)), max_periods=20_000)
    assert (longer.labels == Label.UNDECIDED).mean() < (basins.labels == Label.UNDECIDED).mean()


def test_a_subspace_is_kept_in_files(tmp_path: Path) -> None:
    basins = find_basins(
        discrete_map(riddled, dict(zip("ab", GROWTH, strict=True)), ("x", "y")),
        CellGrid((0.1, -0.5), (0.9, 0.5), (8, 8)),
    )
    before, after = (b.attractors[0].subspace for b in (basins, load_basins(save_basins(basins, tmp_path / "b.h5"))))
    assert before is not None
    assert after is not None
    assert_array_equal(after.normals, before.normals)
    assert (after.depth, after.exponent) == (before.depth, before.exponent)


@pytest.mark.parametrize(
    ("f", "values"),
    [
        (lambda x, p: (3.9 * x[0] * (1 - x[0]), p.c * x[0] * x[1] / (1 + x[1] ** 2)), (2.06, 2.2)),
        (lambda x, p: (tent(x[0]), p.c * x[0] * x[1] * exp(-(x[1] ** 2))), (2.9, 5.0)),
    ],
    ids=["logistic", "tent"],
)
def test_chaos_on_the_two_sides_of_a_plane_is_two_attractors(f: Any, values: tuple[float, ...]) -> None:
    """y = 0 is invariant and y keeps its sign, by the formula: half of the initial conditions on each side."""
    for c in values:
        point_map = discrete_map(f, {"c": c}, ("x", "y"))
        basins = find_basins(point_map, CellGrid((0.1, -1.0), (0.97, 1.0), (8, 8)))
        assert [f.fraction for f in basins.fractions.values()] == [0.5, 0.5]
        signs = np.sign(basins.grid.centres()[..., 1])
        assert len(np.unique(basins.labels[signs > 0])) == len(np.unique(basins.labels[signs < 0])) == 1
        assert len(set(distinct_names(basins.attractors))) == 2
    assert basins.verify(40, search=True).searched == 2


def test_a_plane_that_orbits_cross_divides_nothing() -> None:
    """y -> -c x y: the sign changes in each step."""
    f = lambda x, p: (3.9 * x[0] * (1 - x[0]), -2.2 * x[0] * x[1] / (1 + x[1] ** 2))  # noqa: E731
    basins = find_basins(discrete_map(f, {}, ("x", "y")), CellGrid((0.1, -1.0), (0.97, 1.0), (8, 8)))
    assert_array_equal(basins.labels, 0)


@pytest.mark.parametrize("neutral", [1, 2])
def test_chaos_beside_a_coordinate_that_keeps_its_value(neutral: int) -> None:
    """One label for all of the chaotic sets, of which each value of the coordinates has one."""
    f = lambda x, p: (3.9 * x[0] * (1 - x[0]), *x[1:])  # noqa: E731
    shape = (4, 16) if neutral == 1 else (2, 5, 5)
    region = (0.1, *[-1.0] * neutral), (0.97, *[1.0] * neutral)
    basins = find_basins(discrete_map(f, {}, tuple("xcd"[: 1 + neutral])), CellGrid(*region, shape))
    assert [a.name for a in basins.attractors] == ["continuum of chaotic sets"]
    assert_array_equal(basins.labels, 0)
    assert_array_equal(basins.attractors[0].exponents[1:], 0.0)


def test_a_set_beside_a_subspace_that_repels_is_no_attractor_where_it_stays_near() -> None:
    """Chaos that comes near to it and goes away again may be one."""
    far, near, deep = (np.array([[0.3, y], [0.6, y / 10.0]]) for y in (1e-1, 1e-3, 1e-5))
    plane = discrete_map(lambda x, p: (x[0], x[1]), {}, ("x", "y"))
    repelling = InvariantSubspace(np.array([[0.0, 1.0]]), np.zeros(1), np.ones(1), exponent=0.01)
    attracting = replace(repelling, exponent=0.0)
    assert [hold([repelling], points, plane) for points in (far, near, deep)] == [False, True, True]
    assert [hold([attracting], points, plane) for points in (far, near, deep)] == [False, True, True]
    assert hold([attracting], np.concatenate([far, deep]), plane)
    assert not hold([repelling], np.concatenate([far, deep]), plane)


def test_who_passes_by_for_long_is_not_on_a_chaotic_attractor() -> None:
    """Orbits stay beside one of two chaotic sets for hundreds of steps, and go to the other.

    The sets lie on lines that the second iterate keeps, x = a or y = a, which almost attract; 3.4 % of the labels by 64
    steps were wrong.  The witness are the orbits themselves: near to which set they are after 20,000 steps.
    """

    def f(u: Any, p: Any) -> tuple[Any, Any]:
        return 3.6 * u[0] * (1 - u[0]) - (u[1] - u[0]), 3.6 * u[1] * (1 - u[1]) - (u[0] - u[1])

    coupled, grid = discrete_map(f, {}, ("x", "y")), CellGrid((-0.05, -0.05), (1.2, 1.2), (60, 60))
    basins = find_basins(coupled, grid)
    states = np.stack(np.meshgrid(grid.axis(0), grid.axis(1), indexing="ij"), axis=-1)[basins.labels >= 0]
    late = path_of(coupled, Orbits.starting(coupled.iterate(states, 20_000).points), 50)
    apart = [np.median(KDTree(a.points).query(late)[0], axis=0) for a in basins.attractors]
    wrong = np.argmin(apart, axis=0) != basins.labels[basins.labels >= 0]
    assert len(basins.attractors) == 2 and wrong.size > 1000 and not wrong.any()


def test_a_subspace_beside_which_no_orbit_stays_is_no_family() -> None:
    """Beside y = 0, thin for chaos that is ten times as wide as the region, orbits are twice too far away."""
    beside = discrete_map(lambda x, p: (3.9 * x[0] * (1.0 - x[0] / 10.0), -x[1]), {}, ("x", "y"))
    path = path_of(beside, Orbits.starting(np.array([[1.2, 2e-4], [3.3, 2e-4]])), 300)
    family, one = neutral_family(beside, path, np.ones(2))
    assert one is None and not family.any()


def test_synchronized_chaos_that_attracts_everywhere_is_one_attractor() -> None:
    """Normal multiplier |1 - 2 e| times that of the driver: log 0.4 + 0.43 < 0 on the line x = y."""
    basins = find_basins(
        discrete_map(synchronized, {"e": 0.3}, ("x", "y")), CellGrid((0.01, 0.01), (0.99, 0.99), (8, 8))
    )
    (attractor,) = basins.attractors
    assert_array_equal(basins.labels, 0)
    assert attractor.exponents[1] == pytest.approx(attractor.exponents[0] + log(0.4), abs=0.02)
