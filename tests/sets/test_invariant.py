"""Invariant sets, Morse graphs and manifolds, against sets that are known."""

from math import log

import numpy as np
import pytest
from maps_of_cells import AWAY, HENON, SADDLE

from cellmap import CellGrid, discrete_map, find_attractors, find_basins, periodic_orbit
from cellmap.sets import (
    BoxSet,
    box_ftle,
    chain_recurrent_set,
    find_attractors_by_subdivision,
    maximal_invariant_set,
    morse_graph,
    relative_attractor,
    stable_set,
    unstable_set,
)

WINDOW = CellGrid((-1.03, -1.01), (1.0, 1.02), (1, 1))
OCCUPIED = {4: 17, 5: 36, 6: 89, 7: 212, 8: 504, 9: 1184, 10: 2775}
"""Boxes of Henon's attractor on [-3, 3]^2 at 2^k a side, of ten million points by another program."""


@pytest.fixture(scope="module")
def orbit():
    """Two hundred thousand points of it, from initial conditions close to each other, which the orbits forget."""
    initial_conditions = 0.1 + 0.01 * np.random.default_rng(0).random((400, 2))
    return HENON.orbit(initial_conditions, 600).points[100:].reshape(-1, 2)


@pytest.mark.parametrize("depth", [4, 6, 8, pytest.param(10, marks=pytest.mark.thorough)])
def test_henon_attractor_is_covered(depth, orbit):
    """And the covers are not much larger: within a box on each side; the unstable manifold lies on the attractor."""
    cover = relative_attractor(HENON, CellGrid((-3, -3), (3, 3), (1, 1)), depth)
    occupied = BoxSet.of_points(cover.grid, orbit)
    assert 0.98 * OCCUPIED[depth] <= len(occupied) <= OCCUPIED[depth]
    for found in (cover, unstable_set(HENON, periodic_orbit(HENON, [0.6, 0.2]).points, cover.grid)):
        assert occupied <= found
        assert len(found) < 3.0 * OCCUPIED[depth]


def test_linear_saddle_in_closed_form():
    """What stays for ever is the origin; the manifolds are the axes."""
    stays = maximal_invariant_set(SADDLE, WINDOW, 7)
    assert stays.contains([0.0, 0.0]) and len(stays) <= 9
    for compute in (maximal_invariant_set, relative_attractor, chain_recurrent_set):
        by_one, by_two = (compute(SADDLE, WINDOW, 7, periods=n).keys.tolist() for n in (1, 2))
        assert compute(SADDLE, WINDOW, 7).keys.tolist() == by_one != by_two
    assert relative_attractor(SADDLE, WINDOW, (3, 6)).grid.shape == (8, 64)
    attracts = relative_attractor(SADDLE, WINDOW, 7)
    x = np.linspace(-1.0, 0.99, 300)
    assert attracts.contains(np.stack([x, 0 * x], axis=1)).all()
    assert np.abs(attracts.centres()[:, 1]).max() < 2.5 * attracts.grid.widths[1]
    grid = attracts.grid
    unstable = unstable_set(SADDLE, [0.0, 0.0], grid)
    assert unstable.contains(np.stack([x, 0 * x], axis=1)).all()
    assert np.abs(unstable.centres()[:, 1]).max() < 2.5 * grid.widths[1]
    stable = stable_set(SADDLE, [0.0, 0.0], WINDOW, 7)
    assert stable.contains(np.stack([0 * x, x], axis=1)).all()
    assert np.abs(stable.centres()[:, 0]).max() < 2.5 * grid.widths[0]


def three_basins(x, p):
    """Fixed points at 0, 1, 2, 3, 4, of which 0, 2 and 4 attract."""
    u = x[0]
    return (u - 0.06 * u * (u - 1) * (u - 2) * (u - 3) * (u - 4),)


def test_morse_graph_of_a_hand_made_map():
    graph = morse_graph(discrete_map(three_basins, {}, ("x",)), CellGrid((-0.3,), (4.4,), (8,)), 7, periods=3)
    places = [float(np.round(boxes.centres().mean(), 1)) + 0.0 for boxes in graph.sets]
    assert sorted(places) == [0.0, 1.0, 2.0, 3.0, 4.0]
    named = {(places[i], places[j]) for i, j in graph.edges}
    assert named == {(1.0, 0.0), (1.0, 2.0), (3.0, 2.0), (3.0, 4.0)}
    assert sorted(places[k] for k in graph.sinks) == [0.0, 2.0, 4.0]


def test_one_initial_condition_in_each_set_may_do():
    search = find_attractors_by_subdivision(
        discrete_map(three_basins, {}, ("x",)), CellGrid((-0.3,), (4.4,), (8,)), 7, max_initial_conditions=1
    )
    assert sorted(round(float(a.points[0, 0])) for a in search.attractors) == [0, 2, 4] and len(search.saddles) == 2


def test_edges_leave_out_what_follows_from_others():
    """A chain of three fixed points on the product of two lines: top to bottom passes through the middle ones."""
    cubic = discrete_map(
        lambda x, p: (1.5 * x[0] - x[0] ** 3 / 2, 1.5 * x[1] - x[1] ** 3 / 2), {}, ("x", "y"), name="two cubics"
    )
    graph = morse_graph(cubic, CellGrid((-1.7, -1.7), (1.6, 1.6), (2, 2)), 5, periods=3)
    assert len(graph.sets) == 9 and len(graph.sinks) == 4
    assert len(graph.edges) == 12
    assert graph.reaches[0].sum() == 8 and graph.sets[0].contains([0.0, 0.0])


def test_chain_recurrent_set_of_henon_has_attractor_and_outer_saddle():
    window = CellGrid((-2.01, -2.0), (2.0, 2.03), (2, 2))
    recurrent = chain_recurrent_set(HENON, window, 9)
    assert recurrent.contains([[-1.131354, -0.339406], [0.631354, 0.189406]]).all()
    graph = morse_graph(HENON, window, 9)
    assert len(graph.sets) == 2 and graph.edges.tolist() == [[0, 1]]
    assert graph.sets[0].contains([-1.131354, -0.339406])


def test_nothing_recurs_where_all_orbits_leave():
    window = CellGrid((0,), (1,), (4,))
    assert not len(maximal_invariant_set(AWAY, window, 4))
    assert not len(chain_recurrent_set(AWAY, window, 4))
    graph = morse_graph(AWAY, window, 4)
    assert graph.sets == () and graph.edges.shape == (0, 2)


def test_exponents_of_linear_maps():
    some = BoxSet.full(CellGrid((-1, -1), (1, 1), (3, 3)))
    shear = discrete_map(lambda x, p: (x[0] + x[1], x[1]), {}, ("x", "y"))
    largest = np.linalg.norm([[1.0, 5.0], [0.0, 1.0]], 2)
    np.testing.assert_allclose(box_ftle(some, shear, 5), log(largest) / 5, rtol=1e-12)
    np.testing.assert_allclose(box_ftle(some, SADDLE, 7), log(2.5), rtol=1e-12)


# --- attractors that a uniform grid of initial conditions misses

CENTRE, SIZE = 0.36, 4e-3


def with_a_small_one(x, p):
    """Attracting at 0 and 1, and at the centre of a notch in the crest between them."""
    u = x[0]
    s = (u - CENTRE) / SIZE
    return (u + 0.01 * u * (1.0 - u) * s * (s * s - 1.0) / (1.0 + s**4) ** 0.75,)


def test_attractor_with_a_tiny_basin_is_found():
    """Its basin is the notch, 0.008 wide, between two nodes of a grid that is 0.028 wide."""
    point_map = discrete_map(with_a_small_one, {}, ("x",))
    initial_conditions = CellGrid((-0.2,), (1.2,), (50,))
    by_grid = find_attractors(point_map, initial_conditions.centres())
    assert sorted(round(float(a.points[0, 0]), 6) + 0.0 for a in by_grid) == [0.0, 1.0]
    found = find_attractors_by_subdivision(point_map, CellGrid((-0.2,), (1.2,), (50,)), 8)
    assert sorted(round(float(a.points[0, 0]), 6) + 0.0 for a in found.attractors) == [0.0, CENTRE, 1.0]
    assert any(boxes.contains([CENTRE - SIZE]) for boxes in found.saddles)
    assert any(boxes.contains([CENTRE + SIZE]) for boxes in found.saddles)
    basins = find_basins(point_map, CellGrid((0.3,), (0.42,), (600,)), attractors=found.attractors)
    label = [round(float(a.points[0, 0]), 6) for a in basins.attractors].index(CENTRE)
    assert abs(basins.fractions[label].fraction - 2 * SIZE / 0.12) < 0.01
