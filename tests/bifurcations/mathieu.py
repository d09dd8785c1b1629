"""Mathieu's equation with damping."""

from __future__ import annotations

from math import cos, pi, sin
from typing import Any

from cellmap import ForcedSystem, angle

HANGING, INVERTED = (0.0, 0.0), (pi, 0.0)


def mathieu_rhs(t: float, x: Any, p: Any) -> tuple[float, float]:
    return x[1], -p.gamma * x[1] - (p.alpha - p.beta * cos(t)) * sin(x[0])


def mathieu(alpha: float = 0.25, beta: float = 0.1, gamma: float = 0.0) -> ForcedSystem:
    """Pendulum whose linearisation at 0 is Mathieu's equation with a = 4 alpha and q = 2 beta in the time t/2."""
    return ForcedSystem(mathieu_rhs, {"alpha": alpha, "beta": beta, "gamma": gamma}, 2 * pi, (angle("theta"), "v"))
