"""Kernels of discontinuous right-hand sides: roots of events, and loops over lanes that are vector code."""

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cellmap._compiled.codegen.kernel import traced_switching
from cellmap._compiled.codegen.switching import compiled_switching
from cellmap._compiled.kernels.events import NEVER, first_root
from cellmap._compiled.loops import loop
from systems import driven_pendulum
from tests._compiled.codegen.test_structure import innermost_loops


@loop
def changed_root_of(coefficients: NDArray[np.float64]) -> float:
    return first_root(coefficients, coefficients.size - 1)


def root_of(coefficients: NDArray[np.float64]) -> float:
    return changed_root_of(coefficients.copy())


def root_by_companion(coefficients: NDArray[np.float64]) -> float:
    """First sign change in (0, 1] of a polynomial that begins positive, from the eigenvalues of NumPy."""
    roots = np.roots(coefficients[::-1])
    real = np.sort(roots.real[np.abs(roots.imag) < 1e-9])
    return next((r for r in real if 0.0 < r <= 1.0), NEVER)


def test_the_first_root_is_that_of_the_companion_matrix() -> None:
    rng, found = np.random.default_rng(0), 0
    for _ in range(3000):
        degree = int(rng.integers(1, 19))
        a = rng.standard_normal(degree + 1) * rng.choice([0.2, 0.7, 1.0]) ** np.arange(degree + 1)
        a[0] = abs(a[0]) * rng.choice([1.0, 1e-3, 1e-8])
        exact = root_by_companion(a)
        assert root_of(a) == pytest.approx(exact, rel=1e-9, abs=1e-12)
        found += exact < NEVER
    assert 500 < found < 2500


def test_of_two_roots_close_together_the_first_is_found() -> None:
    for gap in (1e-1, 1e-3, 1e-5, 1e-6):
        a = np.polynomial.polynomial.polyfromroots([0.37, 0.37 + gap, 1.7]) * -1.0
        assert root_of(a) == pytest.approx(0.37, abs=1e-15 / gap)


@pytest.mark.parametrize(
    ("coefficients", "root"),
    [
        ([0.0, 1.0, -2.0], 0.5),  # a zero at the beginning is no root
        ([0.0, 0.0, 1.0, -4.0], 0.25),
        ([0.0, -1.0, 2.0], 0.0),  # nor does it excuse a fall from there
        ([-1e-9, 1.0], 0.0),
        ([1.0, -1.0], 1.0),
        ([1.0, -0.999999], NEVER),
        ([0.0, 0.0, 0.0], NEVER),
        ([1e-310, -2e-310], NEVER),
        ([1.0, 0.0, 0.0], NEVER),
        ([0.25, -1.0, 1.0], NEVER),  # touches zero
        ([math.nan, 1.0], NEVER),
        ([1.0, -math.inf], NEVER),
    ],
)
def test_roots_at_the_edges(coefficients: list[float], root: float) -> None:
    found = root_of(np.array(coefficients))
    assert found == pytest.approx(root, abs=1e-15) or (root == 1.0 and found == NEVER)


@pytest.mark.usefixtures("usual_arguments")
def test_steps_are_vector_code_without_a_call() -> None:
    """Both where lanes slide and where they do not; events alone are looked at lane by lane."""
    system = driven_pendulum(friction=10.0)
    traced = traced_switching((system.rhs, system.switches), 2, tuple(system.params))
    compiled: Any = compiled_switching(traced, 8, len(system.params), 1e-9)
    loops = [loop for loop in innermost_loops(compiled.code[0].assembly) if loop.packed > 100]
    assert len(loops) == 2
    assert all(loop.calls == 0 and loop.scalar == 0 for loop in loops)
