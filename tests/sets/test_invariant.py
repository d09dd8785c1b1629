"""Invariant sets, Morse graphs and manifolds, against sets that are known."""

from __future__ import annotations

from math import log, sqrt

import numpy as np
import pytest

from cellmap import CellGrid, angle, discrete_map, periodic_orbit
from cellmap.analysis.boundary import saddle_manifold
from cellmap.sets import (
    BoxSet,
    box_ftle,
    chain_recurrent_set,
    maximal_invariant_set,
    morse_graph,
    relative_attractor,
    stable_set,
    unstable_set,
)
from systems import henon_map

WINDOW = CellGrid((-1.03, -1.01), (1.0, 1.02), (1, 1))
SADDLE = discrete_map(lambda x, p: (2.5 * x[0], 0.3 * x[1]), {}, ("x", "y"), name="saddle")
OCCUPIED = {4: 17, 5: 36, 6: 89, 7: 212, 8: 504, 9: 1184, 10: 2775}
"""Boxes of Henon's attractor on [-3, 3]^2 at 2^k a side, of ten million points by another program."""


@pytest.fixture(scope="module")
def orbit():
    """Two hundred thousand points of it, from initial conditions close to each other, which the orbits forget."""
    initial_conditions = 0.1 + 0.01 * np.random.default_rng(0).random((400, 2))
    return henon_map().orbit(initial_conditions, 600).points[100:].reshape(-1, 2)


@pytest.mark.parametrize("depth", [4, 6, 8, 10])
def test_henon_attractor_is_covered(depth, orbit):
    """And the cover is not much larger: within a box on each side."""
    window = CellGrid((-3, -3), (3, 3), (1, 1))
    cover = relative_attractor(henon_map(), window, depth)
    occupied = BoxSet.of_points(cover.grid, orbit)
    assert 0.98 * OCCUPIED[depth] <= len(occupied) <= OCCUPIED[depth]
    assert occupied <= cover
    assert len(cover) < 3.0 * OCCUPIED[depth]


def test_henon_unstable_set_covers_the_attractor(orbit):
    saddle = periodic_orbit(henon_map(), [0.6, 0.2]).points
    for depth in (6, 8, 9):
        grid = CellGrid((-3, -3), (3, 3), (2**depth,) * 2)
        cover = unstable_set(henon_map(), saddle, grid)
        assert BoxSet.of_points(grid, orbit) <= cover
        assert len(cover) < 2.5 * OCCUPIED[depth]


def test_henon_sets_hold_the_curves_of_the_manifolds():
    """Curves grown point by point lie in the boxes."""
    henon = henon_map()
    saddle = periodic_orbit(henon, [0.6, 0.2])
    grid = CellGrid((-2, -2), (2, 2), (256, 256))
    cover = unstable_set(henon, saddle.points, grid)
    manifold = saddle_manifold(henon, saddle, "unstable", CellGrid((-2, -2), (2, 2), (1, 1)), length=20.0)
    points = np.concatenate([branch.points for branch in manifold.branches])
    assert len(points) > 100 and cover.contains(points).all()


def test_linear_saddle_in_closed_form():
    """What stays for ever is the origin; the manifolds are the axes."""
    stays = maximal_invariant_set(SADDLE, WINDOW, 7)
    assert stays.contains([0.0, 0.0]) and len(stays) <= 9
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


def test_cat_map_manifolds_fill_the_torus():
    """The unstable manifold of the origin is dense; a few images of it lie along (golden ratio, 1)."""
    cat = discrete_map(
        lambda x, p: (2 * x[0] + x[1], x[0] + x[1]),
        {},
        (angle("x", period=1.0, lower=0.0), angle("y", period=1.0, lower=0.0)),
    )
    grid = CellGrid((0, 0), (1, 1), (64, 64))
    golden = (1 + sqrt(5)) / 2
    along = np.linspace(0.0, 2.0, 4000)[:, None] * np.array([golden, 1.0]) / sqrt(golden**2 + 1)
    cover = unstable_set(cat, [0.0, 0.0], grid, max_iterations=5)
    assert cover.contains(along % 1.0).all() and len(cover) < grid.size
    assert len(unstable_set(cat, [0.0, 0.0], grid)) == grid.size
    assert len(chain_recurrent_set(cat, CellGrid((0, 0), (1, 1), (2, 2)), 3)) == 256


def test_three_and_four_dimensions_store_what_is_visited():
    """A saddle of 4-D with one unstable direction: its relative attractor is a line of boxes."""
    for d in (3, 4):
        rates = (1.9, 0.3, 0.25, 0.2)[:d]
        saddle = discrete_map(
            lambda x, p, r=rates: tuple(c * v for c, v in zip(r, x, strict=True)), {}, tuple("xyzu"[:d])
        )
        window = CellGrid((-1.01,) * d, (1.0,) * d, (1,) * d)
        line = relative_attractor(saddle, window, 6, samples=3)
        x = np.linspace(-1.0, 0.99, 100)
        assert line.contains(np.stack([x, *[0 * x] * (d - 1)], axis=1)).all()
        assert len(line) <= 64 * 3 ** (d - 1)
        assert line.grid.size == 64**d


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
    recurrent = chain_recurrent_set(henon_map(), window, 9)
    assert recurrent.contains([[-1.131354, -0.339406], [0.631354, 0.189406]]).all()
    graph = morse_graph(henon_map(), window, 9)
    assert len(graph.sets) == 2 and graph.edges.tolist() == [[0, 1]]
    assert graph.sets[0].contains([-1.131354, -0.339406])


def test_nothing_recurs_where_all_orbits_leave():
    away = discrete_map(lambda x, p: (x[0] + 1.0,), {}, ("x",))
    window = CellGrid((0,), (1,), (4,))
    assert not len(maximal_invariant_set(away, window, 4))
    assert not len(chain_recurrent_set(away, window, 4))
    graph = morse_graph(away, window, 4)
    assert graph.sets == () and graph.edges.shape == (0, 2)


def test_exponents_of_linear_maps():
    some = BoxSet.full(CellGrid((-1, -1), (1, 1), (3, 3)))
    shear = discrete_map(lambda x, p: (x[0] + x[1], x[1]), {}, ("x", "y"))
    largest = np.linalg.norm([[1.0, 5.0], [0.0, 1.0]], 2)
    np.testing.assert_allclose(box_ftle(some, shear, 5), log(largest) / 5, rtol=1e-12)
    np.testing.assert_allclose(box_ftle(some, SADDLE, 7), log(2.5), rtol=1e-12)


def test_depth_may_differ_from_axis_to_axis():
    cover = relative_attractor(SADDLE, WINDOW, (3, 6))
    assert cover.grid.shape == (8, 64)


def test_what_is_wrong_is_named():
    with pytest.raises(TypeError, match=r"point_map=None"):
        relative_attractor(None, WINDOW, 3)
    with pytest.raises(TypeError, match=r"region=3: give a CellGrid"):
        relative_attractor(SADDLE, 3, 3)
    with pytest.raises(ValueError, match=r"depth=\(1, 2, 3\).*2 coordinates"):
        relative_attractor(SADDLE, WINDOW, (1, 2, 3))
    with pytest.raises(ValueError, match="depth=-1"):
        chain_recurrent_set(SADDLE, WINDOW, -1)
    with pytest.raises(ValueError, match="1 axis and the system 2"):
        maximal_invariant_set(SADDLE, CellGrid((0,), (1,), (1,)), 2)
    with pytest.raises(ValueError, match=r"points=\[5.0, 0.0\].*in the region"):
        unstable_set(SADDLE, [5.0, 0.0], WINDOW)
    with pytest.raises(ValueError, match="periods=0"):
        box_ftle(BoxSet.full(WINDOW), SADDLE, 0)
    with pytest.raises(ValueError, match="2\\*\\*62"):
        relative_attractor(SADDLE, WINDOW, 40)
