"""What analyses refuse, by the words of the message; and that they give the same bits again, by any threads."""

from dataclasses import replace
from functools import cache
from math import inf

import numpy as np
import pytest

from cellmap import CellGrid as Grid
from cellmap import angle, discrete_map, find_basins, periodic_orbit, set_threads
from cellmap.analysis import boundary, fractal, resilience
from systems import henon_map, mcdonald_map

UNIT, SQUARE, STRIP = Grid((0.0,), (1.0,), (1,)), Grid((-1, -1), (1, 1), (1, 1)), Grid((0, -2), (1, 2), (10, 10))
TENT = discrete_map(lambda x, p: (1.5 - 3.0 * abs(x[0] - 0.5),), {}, ("x",))
CUBIC = discrete_map(lambda x, p: (1.5 * x[0] - 0.5 * x[0] ** 3,), {}, ("x",))
NODE = discrete_map(lambda x, p: (x[0] / 2, x[1] / 3), {}, ("x", "y"))
OTHER = discrete_map(lambda x, p: (x[0], x[1]), {}, (angle("x"), "y"))
DISC = discrete_map(lambda x, p: tuple(0.5 * (1.0 + x[0] ** 2 + x[1] ** 2) * v for v in x), {}, ("x", "y"))
POINTS = np.random.default_rng(0).random((2000, 2))
EYE, MIXED = np.eye(99, dtype=int), np.random.default_rng(0).integers(0, 2, (300, 300))
STRIPES = np.arange(120)[:, None] % 3 + np.zeros((120, 90), int)


@cache
def line():
    return find_basins(CUBIC, Grid((-1.5,), (1.5,), (60,)))


@cache
def disc(size=1.5):
    return find_basins(DISC, Grid((-size,) * 2, (size,) * 2, (51, 39)))


@cache
def henon():
    return find_basins(henon_map(), Grid((-2.0, -2.0), (2.0, 2.0), (40, 30)))


def side(points):
    return np.where(points[:, 1] > 2.0, 1, np.where(points[:, 1] < -2.0, 0, -1))


def single():
    return find_basins(CUBIC, [[0.1], [0.2]])


def manifold(**change):
    saddle = periodic_orbit(henon_map(), [0.6, 0.2])
    given = {"point_map": henon_map(), "orbit": saddle, "kind": "stable", "region": SQUARE} | change
    return boundary.saddle_manifold(**given)


def near():
    return boundary.boundary_distance(manifold(kind="unstable", length=1.0), henon())


def uncertain(**change):
    return fractal.uncertainty_exponent(**{"source": mcdonald_map(), "region": STRIP, "outcome": side} | change)


def attractor():
    return disc().attractors[0]


def survived(allowed):
    return resilience.survivability(DISC, allowed, SQUARE, 10, periods=1)


REFUSED = [
    # --- escape, saddles and edges
    (lambda: boundary.escape_rate(TENT, SQUARE), "2 axes"),
    (lambda: boundary.chaotic_saddle(TENT, Grid((0.4,), (0.6,), (1,)), n_points=200, lifetime=5), "stays longest"),
    (lambda: boundary.chaotic_saddle(TENT, UNIT, n_points=200, max_stagger=2e-14, lifetime=15), "no stagger"),
    (lambda: boundary.edge_orbit(line(), 0, 4), "no initial condition has the label 4"),
    (lambda: boundary.edge_orbit(line(), 0, [1.0]), "two labels, or two states"),
    (lambda: boundary.edge_orbit(line(), min_separation=1e-3, max_separation=1e-4), "max_separation"),
    (lambda: boundary.edge_orbit(line(), max_periods=3), "max_periods"),
    (lambda: boundary.edge_orbit(replace(line(), point_map=None)), "have no map"),
    # --- manifolds
    (lambda: manifold(point_map=CUBIC), "1 coordinates"),
    (lambda: manifold(point_map=NODE, orbit=periodic_orbit(NODE, [0.1, 0.1])), "give a saddle"),
    (lambda: manifold(inverse=OTHER), "other coordinates"),
    (near, "no neighbouring cells"),  # one basin, whose only neighbours diverge
    (lambda: boundary.boundary_distance([], find_basins(CUBIC, [[0.1]])), "two axes"),
    # --- dimensions and entropy
    (lambda: fractal.boundary_dimension(np.full((50, 50), 0.5)), "basins holds 0.5: labels are whole numbers"),
    (lambda: fractal.boundary_dimension(np.zeros((50, 50), int)), "no two basins meet"),
    (lambda: fractal.boundary_dimension(np.eye(6, dtype=int)), "sizes of boxes lie between.*cells, or lattice"),
    (lambda: fractal.boundary_dimension(EYE, sizes=[1, 2, 4], lattice=2), "multiples of lattice=2"),
    (lambda: fractal.boundary_dimension(single()), "give basins on a grid"),
    (lambda: fractal.basin_entropy(MIXED, box_size=400), "fit into"),
    (lambda: fractal.fractal_boundary_test(MIXED[:, :9], radius=5), "wider than the image"),
    (lambda: fractal.smooth_boundary_entropy(2, [[0, 0]]), "two different places"),
    (lambda: fractal.generalized_dimensions(POINTS, weights=np.ones(3)), "weights: give 2000"),
    (lambda: fractal.generalized_dimensions(POINTS, sizes=[0.1, 0.05, 1e-20]), "cannot be numbered"),
    (lambda: fractal.generalized_dimensions(np.random.default_rng(0).random((20_000, 1)))[7], "q=7"),
    (lambda: fractal.kaplan_yorke_dimension([inf]), "exponents="),
    (lambda: fractal.kaplan_yorke_dimension([[1.0, -2.0], [1.0, -2.0]]), "those of one orbit"),
    (lambda: fractal.kaplan_yorke_dimension([1.0, -2.0], [0.1]), "one error"),
    # --- uncertainty and Wada
    (lambda: uncertain(outcome=lambda x: x), "return one whole number for each"),
    (lambda: uncertain(include=(3,)), "include=3: give a whole number|include=3: give negative labels"),
    (lambda: fractal.image_uncertainty_exponent([[-1, -2]]), "no cell belongs to a basin"),
    (lambda: fractal.boundary_dimension(EYE, wraps=(True,)), "one entry for each of the 2 axes"),
    (lambda: fractal.image_uncertainty_exponent([[0, 1], [0]]), "different lengths|inhomogeneous"),
    (lambda: fractal.image_uncertainty_exponent(single()), "no neighbours"),
    # --- resilience
    (lambda: resilience.basin_stability(line(), lambda rng, n: np.zeros((n - 1, 1))), "return 10000 states"),
    (lambda: resilience.basin_stability(line(), SQUARE), "2 axes"),
    (lambda: resilience.basin_stability(CUBIC, UNIT), "attractors is empty"),
    (lambda: resilience.largest_ball(np.zeros((0, 3), int), 0), "shape"),
    (lambda: resilience.largest_ball(np.zeros(4, int), 0, wraps=[True]), "has no boundary"),
    (lambda: resilience.largest_ball(np.zeros(4, int), 0, refine=True), "has no map"),
    (lambda: resilience.minimal_fatal_shock(disc(), -1), "are not basins"),
    (lambda: resilience.minimal_fatal_shock(disc(), 0, point=(2.0, 0.0)), "label -2, not 0"),
    (lambda: resilience.minimal_fatal_shock(disc(), 0, point=(2.0,)), "point has shape"),
    (lambda: resilience.minimal_fatal_shock(disc(0.5), 0), "larger window"),
    (lambda: resilience.local_integrity(disc(0.5), 0), "larger window"),
    (lambda: resilience.minimal_fatal_shock(single(), 0), "scale is missing"),
    (lambda: resilience.random_ball(attractor(), 1.0, along=["w"]), "along='w'"),
    (lambda: survived(lambda states: states), "bools"),
    (lambda: resilience.tipping_probabilities(line(), find_basins(CUBIC, Grid((-1.4,), (1.5,), (60,)))), "one window"),
    (lambda: resilience.tipping_probabilities([0], [0]).probability(9, 0), "before=9"),
]


@pytest.mark.parametrize(("call", "message"), REFUSED, ids=[message for _, message in REFUSED])
def test_what_is_refused(call, message):
    with pytest.raises((TypeError, ValueError, KeyError), match=message):
        call()


def uncertain_pairs(rng=4):
    found = uncertain(max_pairs=60_000, rng=rng)
    return found.pairs, found.uncertain, found.exponent


REPEATED = {
    "escape": lambda: boundary.escape_rate(TENT, UNIT, n_samples=50_000).survivors,
    "boundary dimension": lambda: fractal.boundary_dimension(henon(), include=(-2,), rng=2).counts,
    "correlation": lambda: fractal.correlation_dimension(POINTS, norm=inf).fractions,
    "uncertain pairs": lambda: np.hstack(uncertain_pairs()),
    "Wada boxes": lambda: fractal.wada_grid(henon(), include=(-2,), refinements=6).boxes,
    "stability": lambda: resilience.basin_stability(disc(), n_samples=20_000).labels,
    "survival": lambda: resilience.survivability(DISC, {"x": (-0.9, 0.9)}, SQUARE, 500, periods=3).survival_times,
}


@pytest.mark.parametrize("name", REPEATED)
def test_same_bits_for_any_number_of_threads(name):
    results = []
    for threads in (1, 3):
        set_threads(threads)
        results.append(REPEATED[name]())
    assert np.array_equal(*results)


def test_seeds_decide_what_is_drawn():
    for drawn in (
        lambda seed: boundary.chaotic_saddle(TENT, UNIT, n_points=60, rng=seed).points,
        lambda seed: fractal.fractal_boundary_test(MIXED, n_discs=300, rng=seed).entropies,
        lambda seed: uncertain_pairs(seed)[1],
        lambda seed: resilience.basin_stability(line(), n_samples=100, rng=seed).states,
    ):
        one, same, other = map(drawn, (1, 1, 2))
        assert np.array_equal(one, same) and not np.array_equal(one, other)
