"""Orbits that come to rest ever more slowly: told from others, and held at the edges of sticking sets."""

import numpy as np
import pytest

from cellmap import CellGrid, Label, angle, discrete_map, find_basins
from cellmap.attractors.kinds.continua import closed_orbits, continua
from cellmap.attractors.kinds.creeping import creeping, drawn_to
from cellmap.basins import UnsettledWarning
from cellmap.maps import PointMap
from cellmap.orbits import Attractor, Kind

ONE = np.ones(1)
NEUTRAL = discrete_map(lambda x, p: (x[0] - x[0] ** 3,), {}, ("x",))


def held(x, p):
    """Rest where the load is at most 1; beyond, both parts slip by a part of the square of what is too much."""
    load = 4.0 * x[0] + x[1]
    slip = p.c * (max(load - 1.0, 0.0) ** 2 - max(-load - 1.0, 0.0) ** 2)
    return x[0] - slip, x[1] - slip, 0.5 * x[2]


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
    with pytest.warns(
        UnsettledWarning, match=r"creep .* by about 6e-05 in a period, like n\^-0.5; raise max_periods=300"
    ):
        find_basins(NEUTRAL, CellGrid((-0.5,), (0.5,), (64,)), 300)


def beside_a_segment(x, p):
    """Fixed points on y = 0.6 x for |x| <= 1; beyond, x slips by what the square of the excess says."""
    beyond = max(x[0] - 1.0, 0.0) + min(x[0] + 1.0, 0.0)
    return x[0] - p.c * beyond * abs(beyond) * (abs(beyond) - p.node), 0.5 * x[1] + 0.3 * x[0]


def segment_and_beside(node: float, c: float, *excess: float) -> tuple[PointMap, list[Attractor], np.ndarray]:
    """Return the map, its segment, and states beside its ends."""
    point_map, size = discrete_map(beside_a_segment, {"c": c, "node": node}, ("x", "y")), np.full(2, 2.0)
    on = np.linspace(-0.9, 0.9, 7)
    segment = continua(point_map, closed_orbits(point_map, np.column_stack([on, 0.6 * on]), size, 1), size)
    x = np.array([1.0, -1.0]) * (1.0 + np.array(excess)[:, None])
    return point_map, segment, point_map.iterate(np.column_stack([x.ravel(), 0.6 * x.ravel()]), 40).points


def test_orbits_are_not_drawn_beyond_a_node() -> None:
    """Between the segment and orbits beyond 1.02 there is a node, of multiplier 1 - c/2500, to which all come."""
    point_map, segment, states = segment_and_beside(0.02, 10.0, 0.006, 0.018, 0.022, 0.026, 0.032)
    assert [a.kind for a in segment] == [Kind.CONTINUUM]
    assert creeping(point_map, states, np.full(2, 2.0)).found.any()
    assert np.abs(point_map.iterate(states, 20_000).points[:, 0]) == pytest.approx(1.02, abs=1e-6)
    assert (drawn_to(point_map, states, segment) == -1).all()


def test_basins_of_a_segment_hold_what_creeps_to_its_ends() -> None:
    """Of 64 values of x beyond the ends all creep; after 100 periods none of them is on the segment."""
    x = np.concatenate([np.linspace(-0.9, 0.9, 16), *(s * np.linspace(1.01, 1.3, 32) for s in (1.0, -1.0))])
    point_map = discrete_map(beside_a_segment, {"c": 0.5, "node": -1.0}, ("x", "y"))
    found = find_basins(point_map, np.column_stack([x, 0.6 * x]), 100)
    assert [a.kind for a in found.attractors] == [Kind.CONTINUUM]
    assert (found.labels == 0).all()
    assert (np.abs(point_map.iterate(found.initial_conditions[16:], 100).points[:, 0]) > 1.0).all()
    assert found.verify(32).wrong == 0
    beyond = find_basins(point_map, found.initial_conditions[16:], 100)
    assert [a.kind for a in beyond.attractors] == [Kind.CONTINUUM] and (beyond.labels == 0).all()
