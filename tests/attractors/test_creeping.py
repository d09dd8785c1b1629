"""Orbits that come to rest ever more slowly: told from others, and held at the edges of sticking sets."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cellmap import CellGrid, Label, angle, discrete_map, find_basins
from cellmap.attractors.creeping import creeping
from cellmap.basins import UnsettledWarning
from cellmap.basins.doubts import _creep
from cellmap.maps import PointMap
from cellmap.orbits import Kind

ONE = np.ones(1)
NEUTRAL = discrete_map(lambda x, p: (x[0] - x[0] ** 3,), {}, ("x",))


def held(x, p):
    """Rest where the load is at most 1; beyond, both parts slip by a part of the square of what is too much."""
    load = 4.0 * x[0] + x[1]
    slip = p.c * (max(load - 1.0, 0.0) ** 2 - max(-load - 1.0, 0.0) ** 2)
    return x[0] - slip, x[1] - slip, 0.5 * x[2]


@pytest.mark.parametrize(
    ("name", "image", "rate"),
    [
        ("neutral point", NEUTRAL, lambda x: x**3),
        ("node", discrete_map(lambda x, p: (0.9995 * x[0],), {}, ("x",)), None),
    ],
)
def test_orbits_creep_to_the_point_at_rest(name: str, image: PointMap, rate) -> None:
    """Both come to 0, from which they move by exactly x^3 or x/2000 in a step."""
    x = np.array([[0.004], [-0.012], [0.015]])
    found = creeping(image, x, ONE)
    assert found.found.all()
    assert found.moves == pytest.approx(np.abs(x[:, 0]) ** 3 if rate else 0.0005 * np.abs(x[:, 0]), rel=1e-12)
    assert (np.abs(found.ends[:, 0]) < 0.35 * np.abs(x[:, 0])).all()


@pytest.mark.parametrize(
    ("image", "state"),
    [
        (discrete_map(lambda x, p: (x[0] + 1e-5,), {}, ("x",)), 0.1),  # as fast all the time
        (discrete_map(lambda x, p: (x[0] + x[0] ** 3,), {}, ("x",)), 0.01),  # away, ever faster
        (discrete_map(lambda x, p: (4.0 * x[0] * (1.0 - x[0]),), {}, ("x",)), 0.3),  # chaotic
        (discrete_map(lambda x, p: (x[0] + 2.0,), {}, (angle("x"),)), 0.3),  # quasi-periodic
        (discrete_map(lambda x, p: (x[0] + 1e-5 + x[0] ** 2,), {}, ("x",)), -0.004),  # through a bottleneck
        (discrete_map(lambda x, p: (0.5 * x[0],), {}, ("x",)), 0.0),  # at rest
    ],
)
def test_others_do_not(image: PointMap, state: float) -> None:
    assert not creeping(image, np.array([[state]]), ONE).found.any()


def test_edges_of_sticking_sets_hold_what_creeps_to_them() -> None:
    """All orbits end on the band of rest, from which they are 1/(5 c n) after n periods: never at rest."""
    found = find_basins(
        discrete_map(held, {"c": 0.02}, ("a", "b", "v")), CellGrid((-1, -1, -1e-9), (1, 1, 1e-9), (31, 31, 1)), 400
    )
    assert [a.kind for a in found.attractors] == [Kind.EQUILIBRIA]
    assert np.mean(found.labels == Label.UNDECIDED) < 0.02
    slow = np.abs(4.0 * found.grid.centres().reshape(-1, 3)[:, 0] + found.grid.centres().reshape(-1, 3)[:, 1]) > 1.0
    assert slow.mean() > 0.4 and found.fractions[0].fraction > 0.98


def test_edges_that_repel_hold_nothing() -> None:
    """The same set, from whose edges orbits slip away: only those that begin on it are held."""
    grid = CellGrid((-1, -1, -1e-9), (1, 1, 1e-9), (31, 31, 1))
    found = find_basins(discrete_map(held, {"c": -0.02}, ("a", "b", "v")), grid, 400)
    a, b, _ = grid.centres().reshape(-1, 3).T
    assert ((found.labels.ravel() == 0) == (np.abs(4.0 * a + b) <= 1.0)).all()


def test_the_warning_says_how_far_orbits_move() -> None:
    """After 300 steps x is 1/sqrt(600 + x0^-2), and moves by x^3: 6 to 7 millionths."""
    with pytest.warns(UnsettledWarning, match=r"ever more slowly, by about 6e-05 in a period; raise max_periods=300"):
        find_basins(NEUTRAL, CellGrid((-0.5,), (0.5,), (64,)), 300)


def test_the_warning_names_where_orbits_creep_to() -> None:
    """After 300 steps towards 0, the first eight that count as undecided are at 0.86 of where they began."""
    near = np.linspace(0.01, 0.03, 8)
    found = find_basins(
        discrete_map(lambda x, p: (0.9995 * x[0],), {}, ("x",)), np.array([[-1.0], *near[:, None], [1.0]]), 300
    )
    labels = np.array([0, *8 * [Label.UNDECIDED], 0], np.int16)
    what = _creep(replace(found, labels=labels, settings={**found.settings, "max_periods": 300}))
    move = f"{0.0005 * 0.9995**300 * near.mean():.1g}"
    assert what == f", by about {move} in a period, many of them towards fixed point (0)"
