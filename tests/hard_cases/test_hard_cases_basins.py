"""Hard cases of docs/hard-cases.md with known answers: what must not become an attractor, and what must not be lost."""

from math import pi

import numpy as np
import pytest

import systems
from cellmap import (
    CellGrid,
    Label,
    PointMap,
    discrete_map,
    find_attractors,
    find_basins,
    interpolated_map,
    stroboscopic_map,
)
from cellmap.maps import jacobian
from cellmap.maps.coordinates import difference
from cellmap.orbits import Kind
from cellmap.orbits.attractor import Neighbourhood

STABLE_FROM = 2.329021135978e-3  # amplitude (m) at which the inverted state gains stability


def strobe(**parameters: float) -> PointMap:
    return stroboscopic_map(systems.driven_pendulum(**parameters))


def is_inverted(attractor) -> bool:
    return attractor.period == 1 and abs(abs(attractor.points[0, 0]) - pi) < 1e-6 and not any(attractor.rotations)


# --- an unstable equilibrium on a node (case 3)


def test_grid_with_a_node_on_an_unstable_equilibrium():
    width = 2 * pi / 50
    grid = CellGrid((-width / 2, -10.2), (2 * pi - width / 2, 10.2), (50, 51))
    nodes = grid.centres()
    assert np.abs(nodes - [pi, 0.0]).max(axis=-1).min() < 1e-12
    basins = find_basins(strobe(amplitude=0.002), grid)
    assert [a.kind for a in basins.attractors] == [Kind.FIXED_POINT]
    assert np.count_nonzero(basins.labels == 0) >= grid.size - 1


@pytest.mark.parametrize("multiplier", [1.0001, 1.1, 3.0])
def test_unstable_fixed_point_of_a_map_on_a_node(multiplier):
    exact = discrete_map(lambda x, p: (p.m * x[0] - (p.m - 1) * x[0] ** 3, 0.3 * x[1]), {"m": multiplier}, ("x", "y"))
    basins = find_basins(exact, [[0.0, 0.0], [0.0, 0.4]], max_periods=500)
    assert basins.attractors == ()
    assert basins.labels.tolist() == [Label.UNDECIDED, Label.UNDECIDED]


# --- slow convergence (case 4)


def test_inverted_state_is_an_attractor_above_its_threshold():
    """Multiplier 0.999372: 11,000 periods for a factor of a thousand.  Rest at 0.01 rad from upright must end there."""
    exact = strobe(amplitude=STABLE_FROM + 1e-6)
    assert np.abs(np.linalg.eigvals(jacobian(exact, [pi, 0.0]))).max() == pytest.approx(0.999372, abs=1e-6)
    table = interpolated_map(exact, CellGrid((-pi, -120.0), (pi, 120.0), (128, 128)), outside="integrate")
    initial_conditions = np.stack([pi + np.linspace(-0.01, 0.01, 6), np.zeros(6)], axis=-1)
    basins = find_basins(table, initial_conditions, max_periods=30_000)
    assert [is_inverted(a) for a in basins.attractors] == [True]
    assert (basins.labels == 0).all()


WEAK = {
    "period 2": (
        systems.forced_pendulum(0.0917230369533683, 1.2836695581775617, 0.8910870827355746),
        [(2, 0.9909027), (2, 0.9909027), (6, 0.8662710), (6, 0.8662710)],
    ),
    "period 8": (
        systems.two_well_duffing(0.23881097091717296, 0.3330580073387191, 0.5630176836030292),
        [(1, 0.2829669), (3, 0.0183590), (8, 0.9919671), (8, 0.9919671)],
    ),
    "period 22": (
        systems.forced_pendulum(0.20901645144205044, 1.981127760136112, 1.1090073936395817),
        [(1, 0.5531638), (22, 0.9421159), (22, 0.9421159)],
    ),
}


@pytest.mark.thorough
@pytest.mark.parametrize("name", WEAK)
def test_weakly_attracting_cycles_are_found(name):
    """Rounds that shear by up to 200 and contract by 1 to 6 %; the ends of 6000 periods cluster in the same cycles."""
    system, expected = WEAK[name]
    half = pi if system.axes[0].period else 2.5
    exact = stroboscopic_map(system)
    initial_conditions = CellGrid((-half, -2.5), (half, 2.5), (6, 6)).centres().reshape(-1, 2)
    found = find_attractors(exact, initial_conditions, max_periods=600)
    assert [a.period for a in found] == [period for period, _ in expected]
    assert [abs(a.multipliers[0]) for a in found] == pytest.approx([size for _, size in expected], abs=1e-4)
    ends = exact.iterate(initial_conditions, 6000).points
    assert (np.sum([inside(a.neighbourhood, ends, exact) for a in found], axis=0) == 1).all()
    basins = find_basins(exact, initial_conditions, attractors=found)
    assert (basins.labels >= 0).all()
    assert all(inside(found[k].neighbourhood, ends[basins.labels == k], exact).all() for k in range(len(found)))


def inside(region: Neighbourhood, points: np.ndarray, exact: PointMap) -> np.ndarray:
    shift = difference(points[:, None], region.centres, exact.coordinates)
    return (np.einsum("nci,cij,ncj->nc", shift, region.metrics, shift) <= 1.0).any(axis=1)


@pytest.mark.parametrize("r", [3.2, 3.5])
def test_an_orbit_is_examined_once(r, monkeypatch):
    """One that gets no neighbourhood is met at every look, from many ends and as each of its points."""
    examined = []
    monkeypatch.setattr(
        "cellmap.attractors.kinds.cycles.trapping_neighbourhood", lambda point_map, a, *_: examined.append(a)
    )
    logistic = discrete_map(lambda x, p: (p.r * x[0] * (1.0 - x[0]),), {"r": r}, ("x",))
    assert find_attractors(logistic, np.linspace(0.03, 0.97, 30)[:, None]) == ()
    assert len(examined) == 1


def test_unstable_solutions_are_not_examined(monkeypatch):
    examined = []
    monkeypatch.setattr(
        "cellmap.attractors.kinds.cycles.stable_orbit", lambda point_map, point, *_: examined.append(point)
    )
    find_attractors(systems.henon_map(), np.random.default_rng(0).uniform(-0.1, 0.1, (30, 2)), max_periods=300)
    assert examined == []


def test_inverted_state_just_after_it_gains_stability():
    """At 2.35 mm its multiplier is 0.987: a small basin, found from a coarse grid."""
    basins = find_basins(strobe(amplitude=0.00235), CellGrid((-pi, -100.0), (pi, 100.0), (60, 60)))
    assert any(is_inverted(a) for a in basins.attractors)
    assert basins.verify(200).wrong == 0
