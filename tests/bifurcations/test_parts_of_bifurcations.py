"""Parts of the analysis of bifurcations: test functions, metrics, rotation numbers, neighbours on grids, names."""

from functools import partial
from math import pi, sin
from types import SimpleNamespace

import numpy as np
import pytest

from cellmap import ForcedSystem, angle, continue_orbit, discrete_map, periodic_orbit
from cellmap.bifurcations import AtlasKind, AttractorAtlas, AttractorFamily, Crossing, floquet_multipliers
from cellmap.bifurcations.atlas_families import Attractors, Directory, families_of
from cellmap.bifurcations.atlas_neighbours import _neighbours
from cellmap.bifurcations.circle_branches import _locked_rotation
from cellmap.bifurcations.crossings import CrossingFunctions, Matrices
from cellmap.bifurcations.orbit_grid import _links
from cellmap.orbits.ellipsoids import directions

LOGISTIC = discrete_map(lambda x, p: (p.r * x[0] * (1 - x[0]),), {"r": 2.0}, ("x",))


@pytest.mark.parametrize(
    ("multipliers", "crossing"),
    [
        ([0.2, -1.001, 0.4], Crossing.MINUS_ONE),
        ([-0.1, 0.3, 1.02], Crossing.PLUS_ONE),
        ([0.99, -1.5, 0.01], Crossing.PLUS_ONE),
        ([3.0, -0.9, 0.5], Crossing.MINUS_ONE),
        ([0.1, 0.98 * np.exp(1j), 0.98 * np.exp(-1j)], Crossing.NEIMARK_SACKER),
        ([-1.001, 0.9 * np.exp(1j), 0.9 * np.exp(-1j)], Crossing.MINUS_ONE),
    ],
)
def test_the_multiplier_nearest_to_the_circle_says_how_it_would_be_crossed(multipliers, crossing):
    """Of matrices with known multipliers in a random basis."""
    parts = [np.array([[m.real]]) for m in map(complex, multipliers) if m.imag == 0.0]
    parts += [np.array([[m.real, -m.imag], [m.imag, m.real]]) for m in map(complex, multipliers) if m.imag > 0.0]
    matrix, at = np.zeros((3, 3)), 0
    for part in parts:
        matrix[at : at + len(part), at : at + len(part)] = part
        at += len(part)
    basis = np.random.default_rng(3).normal(size=(3, 3))
    matrix = basis @ matrix @ np.linalg.inv(basis)
    determinant = np.linalg.det(matrix)[None]
    known = Matrices(matrix[None], determinant, determinant - 1.0, np.zeros(1, np.uint8))
    seen = CrossingFunctions(SimpleNamespace(matrices=lambda points, progress: known))(np.zeros((1, 2)))
    assert seen.crossing.tolist() == [crossing]
    largest = np.abs(multipliers).max()
    assert seen.largest == pytest.approx(largest) and seen.unstable.tolist() == [sum(np.abs(multipliers) > 1)]
    product = {sign: np.prod(np.array(multipliers) - sign).real for sign in (1.0, -1.0)}
    assert seen.tests[0, Crossing.PLUS_ONE] == pytest.approx(product[1.0])
    assert seen.tests[0, Crossing.MINUS_ONE] == pytest.approx(product[-1.0])


def test_an_equilibrium_is_one_at_all_times():
    """sin(2 t) vanishes at the beginning and in the middle of a period, and nowhere between."""
    shaken = ForcedSystem(
        lambda t, x, p: (x[1], -x[0] - p.g * x[1] + p.f * sin(2 * t)), {"f": 0.1, "g": 0.0}, 2 * pi, ("q", "v")
    )
    with pytest.raises(ValueError, match="v is not constant there but changes by"):
        floquet_multipliers(shaken, [0.0, 0.0])
    # More parameter points than are looked at together.
    found = floquet_multipliers(shaken.with_params(f=0.0), [0.0, 0.0], {"g": np.linspace(0.0, 0.1, 5000)})
    np.testing.assert_allclose(found.determinant, np.exp(-2 * pi * np.linspace(0.0, 0.1, 5000)), rtol=1e-9)


# --- atlases


def test_names_of_families():
    assert AttractorFamily(AtlasKind.PERIODIC, 3, (0, 0), 5).name == "period 3"
    assert AttractorFamily(AtlasKind.ROTATING, 2, (-1, 0), 5).name == "rotating, period 2, winding number -1"
    assert AttractorFamily(AtlasKind.QUASIPERIODIC, 0, (0,), 5).name == "quasi-periodic"
    assert AttractorFamily(AtlasKind.CHAOTIC, 0, (0,), 5).name == "chaotic"


def test_what_coexists_in_an_atlas():
    """Two rows and three columns: 1; 1 + 1 rotating; nothing; 1; 1 + 1 rotating; 1 + 1 rotating."""
    periodic, rotating = AtlasKind.PERIODIC, AtlasKind.ROTATING
    kinds = [periodic, rotating, periodic, periodic, rotating, periodic, periodic, rotating]
    places = [0, 1, 1, 3, 4, 4, 5, 5]
    atlas = SimpleNamespace(
        kind=np.array(kinds), period=np.ones(8, np.int64), rows=np.array(places) // 3, columns=np.array(places) % 3,
        escaped=np.zeros((2, 3)), x=np.arange(3.0), counts=np.arange(8), family=np.array([0, 1, 0, 0, 1, 0, 0, 1]),
        families=(None, None), settings={"initial_conditions": 10},
    )  # fmt: skip
    atlas._symbol = partial(AttractorAtlas._symbol, atlas)
    numbers, names = AttractorAtlas.classes.func(atlas)
    assert names == ("1 + 1 rotating", "1", "none")
    assert numbers.tolist() == [[1, 0, 2], [1, 0, 0]]
    assert AttractorAtlas.number.fget(atlas).tolist() == [[1, 2, 0], [1, 2, 2]]
    fraction = AttractorAtlas.fraction.__wrapped__
    assert fraction(atlas, 1).tolist() == [[0.0, 0.1, 0.0], [0.0, 0.4, 0.7]]


@pytest.mark.parametrize(("place", "unknown"), [((1, 1), None), ((0, 0), None), ((1, 1), (0, 1)), ((2, 3), None)])
def test_places_next_to_a_front(place, unknown):
    """All four neighbours inside the grid, but for those that are known."""
    known = np.zeros((3, 4), bool)
    known[place] = True
    if unknown:
        known[unknown] = True
    found = {tuple(map(int, there)) for _, there in _links(np.array([place]), known)}
    expected = {(i, j) for i in range(3) for j in range(4) if abs(i - place[0]) + abs(j - place[1]) == 1}
    assert found == expected - ({unknown} if unknown else set())


def test_neighbours_to_which_known_attractors_lead():
    """All places next to one inside the grid, but for those where the attractor is known."""
    places = np.array([5, 6])
    states = np.full(2, AtlasKind.PERIODIC, np.int8), np.ones(2, int), np.zeros((2, 1), int), np.zeros((2, 1))
    found = Attractors(places, *states, np.zeros((2, 2)), np.full(2, 0.5), np.ones(2, int))
    source, there = _neighbours(found, Directory.of(found), np.array([0, 1]), (3, 4))
    pairs = sorted(zip(source.tolist(), there.tolist(), strict=True))
    assert pairs == [(0, 1), (0, 4), (0, 9), (1, 2), (1, 7), (1, 10)]
    source, there = _neighbours(found, Directory.of(found), np.array([0]), (2, 3))
    assert sorted(there.tolist()) == [2, 4]


@pytest.mark.parametrize("d", [1, 2, 3, 4])
def test_directions_are_spread_over_the_sphere(d):
    """Unit vectors on all sides: their mean vanishes, and any other direction is near one of them."""
    vectors = directions(d, 16, 32 * (d - 1))
    assert np.allclose(np.linalg.norm(vectors, axis=1), 1.0)
    assert np.linalg.norm(vectors.mean(axis=0)) < (1e-12 if d < 3 else 0.4)
    others = np.random.default_rng(0).normal(size=(200, d))
    others /= np.linalg.norm(others, axis=1, keepdims=True)
    assert (others @ vectors.T).max(axis=1).min() > (0.9, 0.9, 0.5, 0.4)[d - 1]


# --- rotation numbers of locked orbits


@pytest.mark.parametrize(("p", "q"), [(0, 1), (1, 3), (2, 5), (5, 7)])
def test_rotation_numbers_of_periodic_orbits(p, q):
    """Around a point in the plane, and along an angle whose full rotations are counted."""
    phases = 2 * pi * p * np.arange(q + 1) / q + 0.3
    plane = discrete_map(lambda x, p: (x[0], x[1]), {}, ("x", "y")).coordinates
    turned = np.stack([3 + np.cos(phases), 0.1 * np.sin(phases)], axis=-1)
    assert _locked_rotation(turned, np.zeros((q + 1, 2), np.int64), plane) == pytest.approx(p / q)
    around = discrete_map(lambda x, p: (x[0], x[1]), {}, ("r", angle("a"))).coordinates
    wrapped = (phases + pi) % (2 * pi) - pi
    rotations = np.stack([0 * phases, np.round((phases - wrapped) / (2 * pi))], axis=-1).astype(np.int64)
    assert _locked_rotation(np.stack([0 * phases, wrapped], axis=-1), rotations, around) == pytest.approx(p / q)
    line = discrete_map(lambda x, p: (x[0],), {}, ("x",)).coordinates
    assert _locked_rotation(np.zeros((2, 1)), np.zeros((2, 1), np.int64), line) == 0.0


# --- branches


@pytest.fixture(scope="module")
def fixed():
    return continue_orbit(LOGISTIC, periodic_orbit(LOGISTIC, [0.5]), "r", 1.5, 3.5)


def test_unknowns_of_a_branch_are_its_points(fixed):
    """In the units of the states and of the parameter: x = 1 - 1/r, and r, from the first point to the last."""
    unknowns = np.concatenate([part.unknowns[:-1] for part in fixed._parts] + [fixed._parts[-1].unknowns[-1:]])
    np.testing.assert_allclose(unknowns[:, 0], 1 - 1 / unknowns[:, -1], rtol=1e-10)
    np.testing.assert_allclose(unknowns[:, -1], fixed.values, rtol=1e-12)
    assert fixed.values.min() == 1.5 and fixed.values.max() == 3.5


def test_attractors_that_continue_each_other_are_one_family():
    """The largest family comes first, of equal ones that of the first attractor; links go along both axes."""
    links = np.array([[1, 3], [3, 4]]), np.array([[4], [5]])
    assert families_of(7, links).tolist() == [1, 0, 2, 0, 0, 0, 3]
