"""Maps with known attractors, and points in the neighbourhoods of attractors."""

from math import pi, sin

import numpy as np

from cellmap import Attractor, CellGrid, PointMap, angle, discrete_map
from cellmap.attractors.kinds.ends import Ends
from cellmap.attractors.kinds.examined import Examined
from cellmap.maps.coordinates import difference


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


def ends_of(point_map: PointMap, points: np.ndarray, age: int = 0) -> Ends:
    """Ends of orbits where nothing is known yet, in a region of size 1."""
    return Ends(point_map, points, age, (), Examined.nothing_yet(point_map, np.ones(point_map.dimension)), 1)


def points_inside(a: Attractor, number: int, seed: int = 0) -> np.ndarray:
    """Random points of every ellipsoid, shape (period, number, dimension), half of them close to its surface."""
    n = a.neighbourhood
    rng = np.random.default_rng(seed)
    d = n.centres.shape[1]
    directions = rng.standard_normal((len(n.centres), number, d))
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    radius = np.where(np.arange(number) % 2, 1.0 - 1e-9, rng.uniform(0, 1, number) ** (1 / d))
    roots = np.linalg.cholesky(np.linalg.inv(n.metrics))
    return n.centres[:, None] + np.einsum("qij,qnj->qni", roots, radius[:, None] * directions)


def distance(a: Attractor, points: np.ndarray) -> np.ndarray:
    """Distance to the centre of each point's own ellipsoid, in its metric; points (period, number, dimension)."""
    shift = difference(points, a.neighbourhood.centres[:, None], a.coordinates)
    return np.sqrt(np.einsum("qni,qij,qnj->qn", shift, a.neighbourhood.metrics, shift))
