"""Random states around attractors, single-node basin stability and survivability."""

from math import pi, sqrt
from typing import Any

import numpy as np
import pytest

from cellmap import Basins, CellGrid, ForcedSystem, PointMap, angle, discrete_map, find_basins, plot, stroboscopic_map
from cellmap.analysis.resilience import basin_stability, node_stability, random_ball, random_box, survivability
from systems import power_grid


def _product(x: Any, p: Any) -> tuple[float, ...]:
    return 1.5 * x[0] - 0.5 * x[0] ** 3, 0.5 * x[1], 0.25 * (1.0 + x[2] * x[2]) * x[2]


@pytest.fixture(scope="module")
def product() -> Basins:
    """Three maps that do not know each other: basins of x are bounded by 0, those of z by sqrt(3)."""
    grid = CellGrid((-1.5, -1.0, -1.0), (1.5, 1.0, 1.0), (8, 4, 4))
    return find_basins(discrete_map(_product, {}, ("x", "y", "z")), grid)


# --- random states


def test_a_box_changes_its_coordinates_alone(product: Basins) -> None:
    states = random_box(product.attractors[0], {"z": (-1.0, 3.0), "y": (0.0, 2.0)})(rng=1, n_samples=4000)
    assert np.ptp(states[:, 0]) == 0.0
    for column, low, high in ((1, 0.0, 2.0), (2, -1.0, 3.0)):
        assert ((states[:, column] >= low) & (states[:, column] < high)).all()
        mean, error = 0.5 * (low + high), (high - low) / sqrt(12 * 4000)
        assert states[:, column].mean() == pytest.approx(mean, abs=4 * error)


@pytest.mark.parametrize(("along", "dimension"), [(None, 3), (["x", "z"], 2), (["y"], 1)])
def test_a_ball_is_uniform(product: Basins, along: Any, dimension: int) -> None:
    """The concentric ball of half its radius holds 2^-k of it, in k dimensions, and each half-space half of it."""
    attractor, scale = product.attractors[0], np.array([1.0, 2.0, 0.5])
    away = (random_ball(attractor, 3.0, along, scale)(0, 8000) - attractor.points[0]) / scale / 3.0
    assert np.count_nonzero(np.ptp(away, axis=0)) == dimension
    distance = np.linalg.norm(away, axis=1)
    held = 2.0**-dimension
    assert distance.max() <= 1.0
    assert (distance < 0.5).mean() == pytest.approx(held, abs=4 * sqrt(held * (1 - held) / 8000))
    assert (away @ [1.0, 1.0, 1.0] > 0.0).mean() == pytest.approx(0.5, abs=4 * 0.5 / sqrt(8000))


def test_states_begin_at_every_point_of_a_cycle() -> None:
    flip = discrete_map(lambda x, p: (-1.5 * x[0] + 0.5 * x[0] ** 3, 0.5 * x[1]), {}, ("x", "y"))
    basins = find_basins(flip, CellGrid((-1.5, -1.0), (1.5, 1.0), (10, 10)))
    (cycle,) = basins.attractors
    assert sorted(set(random_box(cycle, {"y": (-1.0, 1.0)})(0, 50)[:, 0].round(9))) == [-1.0, 1.0]


# --- nodes


def test_nodes_with_known_basins(product: Basins) -> None:
    """Of x in (-0.5, 1.5) three quarters return; y always does; of z in (-3, 3) those below sqrt(3) in size do."""
    nodes = {"x": {"x": (-0.5, 1.5)}, "y": {"y": (-1.0, 1.0)}, "z": random_ball(product.attractors[0], 3.0, ["z"])}
    found = node_stability(product, 0, nodes, n_samples=2000, confidence=0.999)
    assert found.nodes == ("x", "y", "z")
    for low, high, error, known in zip(
        found.low, found.high, found.standard_errors, (0.75, 1.0, 1.0 / sqrt(3.0)), strict=True
    ):
        assert low <= known <= high
        assert error == pytest.approx(sqrt(known * (1.0 - known) / 2000), rel=0.05)
    assert found.exponent == pytest.approx(np.log(0.5))
    assert found.undecided.tolist() == [0, 0, 0]
    assert found.to_dataframe()["fractions"].tolist() == found.fractions.tolist()
    assert len(plot.node_stability(found).patches) == 3


@pytest.mark.thorough
def test_one_machine_at_an_infinite_bus() -> None:
    """Fraction 0.152 in angular velocities up to 10: Stender, Hoffmann, Nonlinear Dynamics 107 (2022) 1451.

    Small oscillations decay as exp(-damping t / 2).
    """
    strobe = stroboscopic_map(power_grid((0.5,), ((0, 1),), coupling=1.0, damping=0.1, frequency=2.0 * pi))
    basins = find_basins(strobe, np.random.default_rng(0).uniform((-pi, -10.0), (pi, 10.0), (200, 2)))
    box = random_box(basins.attractors[0], {"theta_1": (-pi, pi), "omega_1": (-10.0, 10.0)})
    found = basin_stability(basins, box, n_samples=4000)
    assert found.fractions[0].fraction == pytest.approx(0.152, abs=3 * found.fractions[0].standard_error)
    assert found.exponents[0] == pytest.approx(-0.05, rel=1e-6)


# --- survivability


@pytest.fixture(scope="module")
def rotation() -> PointMap:
    """Circles about the origin, once round in a period."""
    system = ForcedSystem(lambda t, x, p: (x[1], -x[0]), {}, period=2.0 * pi, coordinates=("x", "v"))
    return stroboscopic_map(system)


def test_circles_survive_inside_a_square(rotation: PointMap) -> None:
    """Of a square those states survive whose circle fits into it, pi/4; in a quarter of a period all others leave."""
    square = CellGrid((-1.0, -1.0), (1.0, 1.0), (1, 1))
    found = survivability(rotation, {"x": (-1.0, 1.0)}, square, 2000, periods=2, samples_per_period=64)
    assert found.times[64] == pytest.approx(2.0 * pi)
    assert found.fractions[0] == 1.0
    assert found.low[-1] < pi / 4.0 < found.high[-1]
    assert found.fractions[33] == found.fractions[-1]
    radius = np.linalg.norm(found.states, axis=1)
    clear = (radius < 1.0) | (radius > 1.01)
    assert ((found.survival_times == np.inf) == (radius < 1.0))[clear].all()
    assert found.standard_errors[-1] == pytest.approx(sqrt(pi / 4 * (1 - pi / 4) / 2000), rel=0.05)
    plot.survivability(found)


def test_an_interval_of_angles_crosses_the_branch_cut() -> None:
    """Of an angle that grows by a quarter of a circle, the interval of half a circle holds two steps at most."""
    turn = discrete_map(lambda x, p: (x[0] + 0.5 * pi,), {}, (angle("a"),))
    found = survivability(turn, {"a": (0.5 * pi, 1.5 * pi)}, CellGrid((-pi,), (pi,), (1,)), 4000, periods=3)
    assert found.low[0] < 0.5 < found.high[0]
    assert found.low[1] < 0.25 < found.high[1]
    assert found.fractions[2:].tolist() == [0.0, 0.0]


def test_an_orbit_that_diverges_has_left() -> None:
    square = discrete_map(lambda x, p: (x[0] * x[0],), {}, ("x",))
    found = survivability(square, lambda states: states[:, 0] > -5.0, lambda rng, n: np.full((n, 1), 2.0), 3, 20)
    assert found.fractions[0] == 1.0
    assert found.fractions[-1] == 0.0
    assert (found.survival_times < 20.0).all()
