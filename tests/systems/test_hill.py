"""Mathieu's and Hill's equations, against tables, an infinite determinant and the lunar perigee."""

from __future__ import annotations

from math import acos, cos, pi, sin, sqrt

import numpy as np
import pytest
from scipy.special import mathieu_a, mathieu_b

from cellmap import ForcedSystem, stroboscopic_map
from cellmap.maps import jacobian
from systems import hill_equation, mathieu_equation


def trace(system: ForcedSystem) -> float:
    return float(np.trace(jacobian(stroboscopic_map(system), [0.0, 0.0])))


def test_the_equations() -> None:
    x, v, t = 0.7, -0.4, 1.3
    mathieu = mathieu_equation(damping=0.2, delta=0.5, epsilon=0.3)
    assert mathieu.derivative(t, (x, v)) == pytest.approx((v, -(0.5 + 0.3 * cos(2.0 * t)) * x - 0.2 * v), rel=1e-15)
    stiffness = 0.5 + 0.3 * cos(2.0 * t) + 0.2 * cos(4.0 * t) - 0.1 * cos(6.0 * t)
    hill = hill_equation(damping=0.2, delta=0.5, epsilon1=0.3, epsilon2=0.2, epsilon3=-0.1)
    assert hill.derivative(t, (x, v)) == pytest.approx((v, -stiffness * x - 0.2 * v), rel=1e-14)


@pytest.mark.parametrize("q", [0.5, 2.0, -1.0])
def test_the_edges_of_mathieus_tongues(q: float) -> None:
    """On the characteristic curves a_m, b_m of SciPy's tables there is a solution of period pi or 2 pi."""
    for order in range(4):
        curves = [mathieu_a(order, abs(q))] + ([mathieu_b(order, abs(q))] if order else [])
        for characteristic in curves:
            system = mathieu_equation(damping=0.0, delta=float(characteristic), epsilon=-2.0 * q)
            assert trace(system) == pytest.approx(2.0 * (-1.0) ** order, abs=1e-8)


@pytest.mark.parametrize("epsilons", [(0.3, 0.2, 0.1), (0.8, -0.5, 0.4)])
def test_hills_determinant(epsilons: tuple[float, float, float]) -> None:
    """sin^2(pi nu/2) = D sin^2(pi sqrt(delta)/2), where the trace is 2 cos(pi nu) and D Hill's determinant (1886).

    Truncated at n rows on either side, D has an error of the order of 1/n^3: two sizes are extrapolated.
    """
    delta = 0.7

    def determinant(n: int) -> float:
        k = np.arange(-n, n + 1)
        rows = 4.0 * k * k - delta
        matrix = np.eye(2 * n + 1)
        for harmonic, epsilon in enumerate(epsilons, start=1):
            matrix += (np.eye(2 * n + 1, k=harmonic) + np.eye(2 * n + 1, k=-harmonic)) * -0.5 * epsilon / rows[:, None]
        return float(np.linalg.det(matrix))

    coarse, fine = determinant(100), determinant(200)
    limit = fine + (fine - coarse) / 7.0
    expected = 2.0 - 4.0 * limit * sin(0.5 * pi * sqrt(delta)) ** 2
    e1, e2, e3 = epsilons
    system = hill_equation(damping=0.0, delta=delta, epsilon1=e1, epsilon2=e2, epsilon3=e3)
    assert trace(system) == pytest.approx(expected, abs=1e-7)


def test_the_lunar_perigee() -> None:
    """Hill (1886) found c = 1.071583277416; cos(pi c) is half the trace."""
    c = 2.0 - acos(0.5 * trace(hill_equation())) / pi
    assert c == pytest.approx(1.071583277416, abs=1e-9)
