"""Steps of large systems: those of small ones, in code that does not grow with the number of nodes."""

from collections.abc import Sequence
from math import cos, pi, sin, tanh
from typing import Any

import numpy as np
import pytest

from cellmap._compiled.codegen.derivative import jet_trace
from cellmap._compiled.codegen.in_memory import compiled_in_memory, text_in_memory
from cellmap._compiled.codegen.kernel import traced_function
from cellmap._compiled.codegen.period import CompiledPeriod, compiled_period, relative_errors
from cellmap._compiled.codegen.runge_kutta import Tableau, traced_steps
from cellmap._compiled.codegen.tableaus import dop853, rk45
from cellmap._compiled.codegen.trace import Trace
from cellmap._compiled.kernels.blocks import LANES


def swing(machines: int) -> Any:
    """Machines on a ring with a chord at every third one, one of them forced (Menck et al. 2014)."""
    links = [*((i, i + 1) for i in range(machines)), *((i, i + machines // 2) for i in range(0, machines, 3))]
    near = [[(b if a == i else a) % machines for a, b in links if i in (a, b % machines)] for i in range(machines)]

    def rhs(t: float, x: Sequence[Any], p: Any) -> tuple[Any, ...]:
        angles, speeds = x[:machines], x[machines:]
        pulls = [sum(sin(angles[i] - angles[j]) for j in near[i]) for i in range(machines)]
        power = [p.power * (-1) ** i + (p.force * cos(t) if i == 0 else 0.0) for i in range(machines)]
        return (*speeds, *(power[i] - p.damping * speeds[i] - p.coupling * pulls[i] for i in range(machines)))

    return rhs


def neurons(t: float, x: Sequence[Any], p: Any) -> tuple[Any, ...]:
    """A ring of neurons with steep responses, whose layers steps must not pass over, and a forcing with one."""
    forcing = tanh(20.0 * cos(t))
    return tuple(tanh(p.coupling * x[i - 2]) - x[i] + tanh(p.power * (x[i - 1] - x[i])) + forcing for i in range(3))


def constant(t: float, x: Sequence[Any], p: Any) -> tuple[Any, ...]:
    """Derivatives that are states, constants, functions of time, one another, and long sums."""
    total = sum(x[i] * (1.0 + 0.01 * k) for k, i in enumerate(90 * [0, 1, 2]))
    return x[1], 0.0, cos(t), p.force, x[1], -total, -total


NAMES = ("power", "force", "damping", "coupling")
VALUES = np.array([1.0, 0.3, 0.1, 4.0])


def moved(advance: CompiledPeriod, dimension: int) -> tuple[Any, Any]:
    """Two blocks of initial conditions after a period in 40 and in 300 steps, and the estimates of their errors."""
    x = np.random.default_rng(0).normal(size=(2, dimension, LANES))
    errors = np.empty_like(x)
    for k, steps in enumerate((40, 300)):
        advance(x[k : k + 1], np.array([steps]), 0.1, 2 * pi, VALUES, errors[k : k + 1])
    return x, errors


def traced(rhs: Any, dimension: int) -> Trace:
    return traced_function(rhs, dimension, NAMES)


@pytest.mark.parametrize(
    ("rhs", "dimension", "tableau"), [(swing(2), 4, dop853()), (neurons, 3, rk45()), (constant, 7, dop853())]
)
def test_steps_in_memory_are_those_in_registers(rhs: Any, dimension: int, tableau: Tableau) -> None:
    """To the last digits: sums are in the same order, and products may be rounded once less."""
    known = traced(rhs, dimension)
    states, errors = moved(compiled_in_memory(known, tableau), dimension)
    expected, local = moved(compiled_period(traced_steps(known, tableau), dimension, len(NAMES)), dimension)
    np.testing.assert_allclose(states, expected, rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(errors, local, rtol=1e-3, atol=1e-12)


def test_errors_of_tangent_vectors_are_relative_to_their_lengths() -> None:
    """As those of vectors in registers."""
    known = jet_trace(traced(swing(2), 4), 1)
    _, errors = moved(compiled_in_memory(known, dop853(), 4), 8)
    step = relative_errors(traced_steps(known, dop853()), 4)
    np.testing.assert_allclose(errors, moved(compiled_period(step, 8, len(NAMES)), 8)[1], rtol=1e-3, atol=1e-12)


def test_machine_code_does_not_grow_with_a_network() -> None:
    """But for tables, and a loop for each number of links that a machine may have."""

    def lines(machines: int) -> int:
        text = text_in_memory(traced(swing(machines), 2 * machines), dop853(), 4)
        return sum(not line.startswith("@") for line in text.splitlines())

    assert lines(240) < lines(60)  # which has fewer formulas that are worth a loop


def test_what_does_not_repeat_is_in_functions_of_bounded_size() -> None:
    text = text_in_memory(traced(constant, 7), dop853(), 4)
    longest = max(part.count("\n") for part in text.split("define ") if part.startswith("void @part"))
    assert longest < 1000


def test_states_that_are_not_finite_do_not_hold_up_the_others() -> None:
    """A lane at infinity, then a block of nothing else: the first block is as without."""
    advance, x = compiled_in_memory(traced(swing(3), 6), dop853()), np.ones((2, 6, LANES))
    x[0, :, 5], x[1] = np.nan, np.inf
    errors = np.empty_like(x)
    advance(x, np.array([600, 600]), 0.0, 2 * pi, VALUES, errors)
    advance(x[1:], np.array([10**7]), 0.0, 2 * pi, VALUES, errors)
    assert np.isnan(x[0, :, 5]).all() and not np.isfinite(x[1]).any()
    assert (x[0, :, 6] == x[0, :, 0]).all() and np.isfinite(x[0, :, 6]).all()
