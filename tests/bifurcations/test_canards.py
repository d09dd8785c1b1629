"""Cycles of van der Pol's equation followed through the canard explosion, against the asymptotic canard value."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cellmap import ForcedSystem, continue_orbit, periodic_orbit, section_map
from cellmap.bifurcations import Branch


def shifted(t: float, x: Any, p: Any) -> Any:
    """epsilon x' = y - x^3 / 3 + x, y' = a - x, with u = x - a: the equilibrium is on the section u = 0."""
    u = x[0] + p.a
    return (x[1] - u**3 / 3 + u) / p.epsilon, -x[0]


def canard_value(epsilon: float) -> float:
    """Return a at the maximal canard (Zvonkin, Shubin 1984), without terms of order 4."""
    return 1.0 - epsilon / 8.0 - 3.0 * epsilon**2 / 32.0 - 173.0 * epsilon**3 / 1024.0


def cycles(epsilon: float, begin: float, max_points: int) -> Branch:
    system = ForcedSystem(shifted, {"a": begin + 1e-3, "epsilon": epsilon}, 1.0, ("u", "y"))
    section = section_map(system, ("u", 0.0, 1), rtol=1e-12, atol=1e-12)
    start = periodic_orbit(section, section.iterate([0.5], 20).points)
    return continue_orbit(section, start, "a", begin, 1.0, step=0.05, max_points=max_points)


def test_relaxation_oscillations_up_to_canards() -> None:
    branch = cycles(0.1, 0.98, 22)
    # Relaxation oscillations up to a fold-like turn; the parameter has then come to the canard value.
    assert abs(branch.values[-1] - canard_value(0.1)) < 2e-4
    assert branch.points[-1, 0] < 1.28


@pytest.mark.slow
def test_the_canard_explosion() -> None:
    large, small = cycles(0.1, 0.98, 300), cycles(0.05, 0.99, 200)
    y = large.points[:, 0]
    canards = (y > 0.2) & (y < 1.1)
    assert canards.sum() >= 10
    assert np.ptp(large.values[canards]) < 3e-5  # in which the cycle shrinks by most of its size
    assert y.min() < 0.1
    errors = [abs(large.values[canards].mean() - canard_value(0.1))]
    canards = (small.points[:, 0] > 0.6) & (small.points[:, 0] < 1.0)
    errors.append(abs(small.values[canards].mean() - canard_value(0.05)))
    assert errors[0] < 1e-4
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.8)  # the order of what is left out
