"""Right-hand sides of every kind: branches, helpers, loops, functions without vector form."""

from __future__ import annotations

from collections.abc import Callable
from math import atan2, cos, erf, pi, sin
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cellmap import ForcedSystem, stroboscopic_map

ImagesOf = Callable[..., NDArray[np.float64]]


def test_a_right_hand_side_that_branches(scipy_images: ImagesOf) -> None:
    """A stop on one side: a spring that is stiffer for x > 0.  Its kink is no obstacle to a met tolerance."""

    def rhs(t: float, x: Any, p: Any) -> tuple[float, float]:
        stiffness = p.k if x[0] > 0.0 else 1.0
        return x[1], -0.1 * x[1] - stiffness * x[0] + sin(t)

    system = ForcedSystem(rhs, {"k": 4.0}, 2 * pi, ("x", "v"))
    initial_conditions = np.random.default_rng(2).uniform(-1.0, 1.0, (10, 2))
    images = stroboscopic_map(system, rtol=1e-7, atol=1e-7)(initial_conditions)
    assert images == pytest.approx(scipy_images(system, initial_conditions, rtol=1e-12, one_by_one=True), abs=2e-6)
    many = stroboscopic_map(system, rtol=1e-7, atol=1e-7)(np.repeat(initial_conditions, 10, axis=0))
    assert np.array_equal(many[::10], images)


def test_modules_and_functions_of_math_in_a_right_hand_side_that_branches(scipy_images: ImagesOf) -> None:
    import math

    def torque(v: float) -> float:
        return 0.1 * v if v > 0.0 else 0.2 * v

    def rhs(t: float, x: Any, p: Any) -> tuple[float, float]:
        return x[1], -torque(x[1]) - math.sin(x[0]) + p.f * np.cos(t) + math.pi * 0.0 + 0.01 * min(x[0], 1.0)

    system = ForcedSystem(rhs, {"f": 0.3}, 2 * pi, ("x", "v"))
    initial_conditions = [[0.5, 0.1], [-1.0, -0.5]]
    images = stroboscopic_map(system, rtol=1e-7, atol=1e-7)(initial_conditions)
    assert images == pytest.approx(scipy_images(system, initial_conditions, rtol=1e-12, one_by_one=True), abs=2e-6)


def test_functions_without_vector_form_come_from_libm(scipy_images: ImagesOf) -> None:
    def rhs(t: float, x: Any, p: Any) -> tuple[float, float]:
        return x[1], -atan2(x[0], 1.0 + x[1] ** 2) - 0.1 * erf(x[1]) + 0.2 * cos(t)

    system = ForcedSystem(rhs, {}, 2 * pi, ("x", "v"))
    initial_conditions = np.random.default_rng(4).uniform(-2.0, 2.0, (6, 2))
    assert stroboscopic_map(system)(initial_conditions) == pytest.approx(
        scipy_images(system, initial_conditions, one_by_one=True), abs=1e-8
    )


def test_no_parameters_one_variable_and_an_unforced_flow() -> None:
    decay = ForcedSystem(lambda t, x, p: (-x[0],), {}, 1.0, ("x",))
    for method in ("DOP853", "RK45", "Taylor"):
        assert stroboscopic_map(decay, method=method)([2.0]) == pytest.approx(2.0 * np.exp(-1.0), rel=1e-8)


def test_helpers_loops_and_numpy_in_a_right_hand_side(scipy_images: ImagesOf) -> None:
    def spring(a: float, b: float) -> float:
        return np.sin(a - b) + 0.1 * (a - b) ** 3

    def rhs(t: float, x: Any, p: Any) -> tuple[float, ...]:
        n = len(x) // 2
        force = [sum(spring(x[j], x[i]) for j in (i - 1, i + 1) if 0 <= j < n) for i in range(n)]
        return *x[n:], *(f - p.c * v + 0.1 * np.cos(t) for f, v in zip(force, x[n:], strict=True))

    names = ("a", "b", "c", "u", "v", "w")
    system = ForcedSystem(rhs, {"c": 0.1}, 2 * pi, names)
    initial_conditions = np.random.default_rng(5).uniform(-1.0, 1.0, (3, 6))
    strobe = stroboscopic_map(system, rtol=1e-7, atol=1e-7, method="RK45")
    assert strobe(initial_conditions) == pytest.approx(scipy_images(system, initial_conditions), abs=1e-6)
