"""Maps with known attractors."""

from __future__ import annotations

from math import pi, sin

import numpy as np

from cellmap import CellGrid, PointMap, angle, discrete_map


def logistic(r: float) -> PointMap:
    return discrete_map(_logistic, {"r": r}, ("x",), name="logistic")


def _logistic(x, p):
    return (p.r * x[0] * (1.0 - x[0]),)


def circle(rate: float, k: float = 0.9, period: float = 2 * pi) -> PointMap:
    """theta' = theta + period (rate - k sin(2 pi theta/period) / (2 pi))."""
    return discrete_map(_circle, {"rate": rate, "k": k, "period": period}, (angle("a", period=period),), name="circle")


def _circle(x, p):
    return (x[0] + p.period * (p.rate - p.k * sin(2 * pi * x[0] / p.period) / (2 * pi)),)


def grid_of(lower, upper, n=20) -> np.ndarray:
    return CellGrid(lower, upper, (n,) * len(lower)).centres()


CIRCLE = np.linspace(-pi, pi, 30, endpoint=False)[:, None] + 0.01
LINE = np.linspace(0.03, 0.97, 30)[:, None]
