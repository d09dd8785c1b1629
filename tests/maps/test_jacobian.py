"""Derivatives of point maps, from the variational equation."""

from collections.abc import Mapping
from math import cos, exp, pi, sin
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from two_tiers import at_once

from cellmap import CellGrid, ForcedSystem, discrete_map, interpolated_map, stroboscopic_map
from cellmap.maps import jacobian
from cellmap.maps.tangent import tangent


def damping_of(system: ForcedSystem) -> float:
    p = system.params
    return p["damping"] if "damping" in p else p["gamma"]


@pytest.mark.parametrize(
    "name", at_once(["pendulum, 3 mm", "Duffing"], later=["pendulum, 10 mm", "vertically driven", "forced pendulum"])
)
def test_liouville(problems: Mapping[str, ForcedSystem], name: str) -> None:
    """Areas shrink by exp(-damping x period) everywhere."""
    system = problems[name]
    span = (pi, 100.0) if "mm" in name else (pi, 2.0)
    initial_conditions = np.random.default_rng(0).uniform(-1.0, 1.0, (64, 2)) * span
    # In units in which both components are of order 1, so that the determinant loses no digits.
    scale = np.array(span)
    fine = stroboscopic_map(system, rtol=1e-12, atol=1e-12)
    matrices = jacobian(fine, initial_conditions) * (scale[None, :] / scale[:, None])
    assert np.linalg.det(matrices) == pytest.approx(exp(-damping_of(system) * system.length), abs=1e-10)


@pytest.mark.parametrize("dimension", at_once([3, 9], later=[1, 5]))
def test_vectors_in_one_lane_or_in_several(dimension: int) -> None:
    """Systems of any number of states, whose vectors fill their lanes or leave places empty: exp(T A)."""
    matrix = -0.3 * np.eye(dimension) + 0.5 * np.eye(dimension, k=1) - 0.4 * np.eye(dimension, k=-1)

    def rhs(t: float, x: Any, p: Any) -> tuple[float, ...]:
        ends = (0.0, *x, 0.0)
        return tuple(0.5 * c - 0.3 * b - 0.4 * a + cos(t) for a, b, c in zip(ends[:-2], x, ends[2:], strict=True))

    strobe = stroboscopic_map(ForcedSystem(rhs, {}, 2 * pi, tuple(f"x{k}" for k in range(dimension))))
    expected, points = expm(2 * pi * matrix), np.random.default_rng(0).normal(size=(3, dimension))
    lengths = np.abs(expected).sum(axis=0)
    for found, error in ((tangent(strobe, points)[1], 1e-12), (jacobian(strobe, points), 1e-8)):
        assert np.abs(found - expected).sum(axis=1) / lengths == pytest.approx(0.0, abs=error)


def cubic_with_tangents(t: float, y: Any) -> list[float]:
    """Ueda's oscillator with the derivatives of its solution, written by hand for another program."""
    q, v, *w = y
    return [v, -0.05 * v - q**3 + 7.5 * cos(t)] + [
        e for k in (0, 2) for e in (w[k + 1], -3.0 * q * q * w[k] - 0.05 * w[k + 1])
    ]


def test_columns_have_the_tolerance_of_the_map() -> None:
    """Errors of columns are at most ten tolerances of their length, down to 1e-12, as those of Newton's method are."""
    system = ForcedSystem(lambda t, x, p: (x[1], -0.05 * x[1] - x[0] ** 3 + 7.5 * cos(t)), {}, 2 * pi, ("q", "v"))
    points = np.random.default_rng(0).uniform(-2.0, 2.0, (4, 2))
    solved = [
        solve_ivp(cubic_with_tangents, (0.0, 2 * pi), [*x, 1.0, 0.0, 0.0, 1.0], "DOP853", rtol=3e-14, atol=1e-14)
        for x in points
    ]
    ends = np.array([s.y[:, -1] for s in solved])
    expected = ends[:, 2:].reshape(-1, 2, 2).swapaxes(1, 2)
    lengths, errors = np.abs(expected).sum(axis=1), []
    for tolerance in (1e-4, 1e-6, 1e-9, 1e-11):
        strobe = stroboscopic_map(system, rtol=tolerance, atol=tolerance)
        errors.append((np.abs(jacobian(strobe, points) - expected).sum(axis=1) / lengths).max())
        assert errors[-1] < 10.0 * min(tolerance, 1e-8)
        images, matrices = tangent(strobe, points)
        assert images == pytest.approx(ends[:, :2], abs=1e-11)
        assert np.abs(matrices - expected).sum(axis=1) / lengths == pytest.approx(0.0, abs=2e-12)
    assert errors[3] < 0.1 * errors[2] < 0.1 * errors[1]


def test_directions_that_shrink_keep_their_digits() -> None:
    """The error of a column is relative to its length, 1e-33 in the second one, and not to the length 1 before."""

    def rhs(t: float, x: Any, p: Any) -> tuple[float, float]:
        return -0.1 * x[0] + cos(t), -12.0 * x[1] + cos(t)

    strobe = stroboscopic_map(ForcedSystem(rhs, {}, 2 * pi, ("q", "v")), method="Taylor")
    assert np.diagonal(jacobian(strobe, [0.3, 0.2])) == pytest.approx(np.exp([-0.2 * pi, -24.0 * pi]), rel=1e-8, abs=0)


def test_a_right_hand_side_that_cannot_be_traced(problems: Mapping[str, ForcedSystem]) -> None:
    """Derivatives then come from central differences; the branch is never taken."""
    plain = problems["vertically driven"]

    def rhs(t: float, x: Any, p: Any) -> tuple[float, float]:
        v = x[1] if x[1] < 1e6 else 1e6
        return v, -p.gamma * v - (p.alpha - p.beta * cos(t)) * sin(x[0])

    branching = ForcedSystem(rhs, plain.params, plain.length, plain.axes)
    initial_conditions = [[1.0, 0.5], [3.0, -1.0], [-3.1, 2.0]]
    exact, approximate = (jacobian(stroboscopic_map(s), initial_conditions, periods=2) for s in (plain, branching))
    assert approximate == pytest.approx(exact, rel=1e-5, abs=1e-5)


def test_images_come_with_their_derivatives(problems: Mapping[str, ForcedSystem]) -> None:
    strobe = stroboscopic_map(problems["forced pendulum"])
    initial_conditions = np.random.default_rng(2).uniform(-3.0, 3.0, (20, 2))
    fine = stroboscopic_map(problems["forced pendulum"], rtol=1e-12, atol=1e-12)
    for periods in (1, 3):
        images, matrices = tangent(strobe, initial_conditions, periods)
        assert images == pytest.approx(strobe.iterate(initial_conditions, periods).unwrapped, abs=1e-6)
        assert matrices == pytest.approx(jacobian(fine, initial_conditions, periods), rel=1e-12)
    rounds = np.arange(20) % 4
    images, matrices = tangent(strobe, initial_conditions, rounds)
    for k in range(4):
        alone = tangent(strobe, initial_conditions[rounds == k], k)
        assert np.array_equal(images[rounds == k], alone[0])
        assert np.array_equal(matrices[rounds == k], alone[1])


def test_of_an_interpolated_map_the_exact_map_is_differentiated() -> None:
    exact = discrete_map(lambda x, p: (1.0 - 1.4 * x[0] ** 2 + x[1], 0.3 * x[0]), {}, ("x", "y"))
    table = interpolated_map(exact, CellGrid((-2.0, -2.0), (2.0, 2.0), (16, 16)), order=3)
    assert np.array_equal(jacobian(table, [0.5, 0.1]), [[-1.4, 1.0], [0.3, 0.0]])


def test_no_period_gives_the_identity(problems: Mapping[str, ForcedSystem]) -> None:
    assert np.array_equal(jacobian(stroboscopic_map(problems["Duffing"]), [0.5, 0.1], periods=0), np.eye(2))
