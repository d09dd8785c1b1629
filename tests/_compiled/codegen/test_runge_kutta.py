"""Runge-Kutta steps: order of convergence, agreement with SciPy's own step, error estimates."""

import math
from collections.abc import Mapping
from math import cos, pi, sin
from typing import Any

import numpy as np
import pytest
from scipy.integrate import DOP853, RK45

from cellmap import ForcedSystem
from cellmap._compiled.codegen.kernel import flow_kernel
from cellmap._compiled.codegen.runge_kutta import Tableau
from cellmap._compiled.codegen.tableaus import dop853, rk45
from cellmap._compiled.kernels.blocks import LANES
from cellmap._compiled.machine_code import vector_width


def images(kernel, system, initial_conditions, steps, length=None):
    """Images after `steps` equal steps from t = 0, and the summed error estimates; at most one block."""
    block = np.zeros((1, system.dimension, LANES))
    block[0, :, : len(initial_conditions)] = initial_conditions.T
    errors = np.empty_like(block)
    parameters = np.array([float(v) for v in system.params.values()])
    kernel.advance(block, np.array([steps]), 0.0, system.length if length is None else length, parameters, errors)
    return block[0, :, : len(initial_conditions)].T, errors[0, :, : len(initial_conditions)].T


def test_vectors_without_an_orbit_are_left_alone(problems: Mapping[str, ForcedSystem]) -> None:
    """And the vector that holds the last orbit gives the same bits as in a full block."""
    system = problems["Duffing"]
    kernel = flow_kernel(system.rhs, 2, tuple(system.params), "DOP853", 1e-9)
    full = np.random.default_rng(0).normal(size=(2, 2, LANES))
    few, errors = full.copy(), np.empty_like(full)
    parameters, width = np.array([float(v) for v in system.params.values()]), vector_width()
    kernel.advance(full, np.array([8, 8]), 0.0, system.length, parameters, errors)
    kernel.advance(few, np.array([8, 8]), 0.0, system.length, parameters, errors, orbits=LANES + width + 1)
    moved = few == full
    assert moved[0].all() and moved[1, :, : 2 * width].all() and not moved[1, :, 2 * width :].any()


def test_blocks_that_step_together_are_those_alone(problems: Mapping[str, ForcedSystem]) -> None:
    """Six of them, in two groups, the last with a lane that is lost and one block of nothing else."""
    system, errors = problems["Duffing"], np.empty((6, 2, LANES))
    kernel = flow_kernel(system.rhs, 2, tuple(system.params), "auto", 1e-9)
    together = np.random.default_rng(0).normal(size=(6, 2, LANES))
    together[4, 0, 3], together[5] = np.inf, np.nan
    alone, parameters = together.copy(), np.array([float(v) for v in system.params.values()])
    kernel.advance(together, np.full(6, 600), 0.0, system.length, parameters, errors)
    for k in range(6):
        each, sums = alone[k : k + 1], errors[k : k + 1].copy()
        kernel.advance(each, np.array([600]), 0.0, system.length, parameters, sums)
        assert np.array_equal(each[0], together[k], equal_nan=True)
        assert np.array_equal(sums[0], errors[k], equal_nan=True)
    assert np.isfinite(together[4]).sum() == 2 * LANES - 2


def branching(t: float, x: Any, p: Any) -> tuple[float, float]:
    """The same pendulum in a form that cannot be traced; its branch is never taken."""
    theta, v = x
    if v > 1e6:
        v = 1e6
    return v, -p.gamma * v - (p.alpha - p.beta * cos(t)) * sin(theta)


@pytest.fixture(scope="module")
def traced(problems: Mapping[str, ForcedSystem]) -> ForcedSystem:
    return problems["vertically driven"]


@pytest.fixture(scope="module")
def untraced(traced: ForcedSystem) -> ForcedSystem:
    return ForcedSystem(branching, traced.params, 2 * pi, traced.axes)


@pytest.mark.parametrize(("method", "order", "steps"), [("RK45", 5, 256), ("DOP853", 8, 32)])
@pytest.mark.parametrize("form", ["traced", "untraced"])
def test_order_of_convergence_on_the_driven_pendulum(method, order, steps, form, request, precise_images):
    system = request.getfixturevalue(form)
    rows = [r for r in precise_images if r["problem"] == "vertically driven"]
    initial_conditions, exact = (np.array([r[key] for r in rows]) for key in ("start", "image"))
    kernel = flow_kernel(system.rhs, 2, tuple(system.params), method, 1e-9)
    assert kernel.method == method
    errors = [np.abs(images(kernel, system, initial_conditions, n)[0] - exact).max() for n in (steps, 2 * steps)]
    # The leading error of DOP853 is so small that higher orders show beside it.
    assert order - 0.2 < math.log2(errors[0] / errors[1]) < order + 1.2


@pytest.mark.parametrize(("method", "solver"), [("RK45", RK45), ("DOP853", DOP853)])
def test_one_step_is_that_of_scipy(method: str, solver: Any, traced: ForcedSystem) -> None:
    initial_condition, h = np.array([1.0, 0.5]), 0.3
    kernel = flow_kernel(traced.rhs, 2, tuple(traced.params), method, 1e-9)
    image, _ = images(kernel, traced, initial_condition[None], 1, length=h)
    reference = solver(traced.fun, 0.0, initial_condition, 10.0, first_step=h, max_step=h, rtol=1e10, atol=1e10)
    reference.step()
    assert reference.t == h
    assert image[0] == pytest.approx(reference.y, rel=1e-14)


def test_tableaus_are_those_of_scipy() -> None:
    """To the last bit, so that images are what they were when the coefficients were read from SciPy."""
    high, low, n = dop853(), rk45(), DOP853.n_stages
    assert np.array_equal(high.nodes, DOP853.C[:n]) and np.array_equal(high.stages, DOP853.A[:n, :n])
    assert np.array_equal(high.weights, DOP853.B) and np.array_equal(high.errors, [DOP853.E5[:n], DOP853.E3[:n]])
    assert np.array_equal(low.nodes[:-1], RK45.C) and np.array_equal(low.stages[:-1], RK45.A)
    assert low.stages[-1] == low.weights and np.array_equal(low.weights, RK45.B)
    assert np.array_equal(low.errors, [RK45.E])
    assert (high.order, low.order) == (8, 5)


@pytest.mark.parametrize("method", ["RK45", "DOP853"])
def test_the_estimate_shrinks_at_the_order_it_is_said_to(method: str, traced: ForcedSystem) -> None:
    kernel = flow_kernel(traced.rhs, 2, tuple(traced.params), method, 1e-9)
    initial_conditions = np.array([[1.0, 0.5], [-2.0, 3.0]])
    steps = 128 if method == "RK45" else 32
    first, second = (images(kernel, traced, initial_conditions, n)[1].max() for n in (steps, 2 * steps))
    assert math.log2(first / second) == pytest.approx(kernel.estimate_order, abs=0.6)


@pytest.mark.parametrize("tableau", [rk45(), dop853()], ids=lambda tableau: tableau.name)
def test_weights_of_integrals_are_those_of_methods_of_nystrom(tableau: Tableau) -> None:
    """Sums of rows are c^2 / 2, and weights b (1 - c), as for all methods of Runge and Kutta of these orders."""
    integrals, nodes = tableau.of_integrals(), np.array(tableau.nodes)
    np.testing.assert_allclose([sum(row) for row in integrals.stages][2:], nodes[2:] ** 2 / 2, rtol=1e-12)
    n = len(tableau.weights)
    np.testing.assert_allclose(integrals.weights[:n], np.array(tableau.weights) * (1.0 - nodes[:n]), atol=1e-15)
