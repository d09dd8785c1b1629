"""Smooth maps with windows, and interpolation of them."""

from math import cos, exp, fabs, floor, pi, sin, sqrt

import numpy as np

from cellmap import CellGrid, PointMap, angle, discrete_map, interpolated_map

ORDERS = (1, 3, 5)
COARSE = 1e6  # a tolerance that leaves no cell to the exact map


def circle(x, p):
    return (x[0] + 0.4 + 0.9 * sin(x[0]) + 0.2 * cos(2 * x[0]),)


def line(x, p):
    return (0.7 * sin(2 * x[0]) + 0.1 * x[0] ** 2,)


def torus(x, p):
    return x[0] + 0.5 * sin(x[1]), x[1] + 0.3 + 0.8 * sin(x[0]) * cos(x[1])


def cylinder(x, p):
    y = 0.8 * x[1] + 0.5 * sin(x[0])
    return x[0] + y, y


def plane(x, p):
    return 0.6 * x[0] + 0.3 * sin(x[1]), 0.5 * x[1] + 0.4 * cos(x[0] - x[1])


def tube(x, p):
    return x[0] + x[1] + 0.2 * sin(x[0]), 0.6 * x[1] + 0.3 * cos(x[0] + x[2]), 0.5 * sin(x[2] + x[1])


def coupled_standard_maps(x, p):
    """Two standard maps with a coupling (Froeschle 1972)."""
    a, b, u, v = x
    u = u + 0.3 * sin(a) + 0.1 * sin(a + b)
    v = v + 0.2 * sin(b) + 0.1 * sin(a + b)
    return a + u, b + v, u, v


# Function, coordinates, window, and for each order the cells of the coarsest table of a doubling sequence.
SMOOTH = {
    "circle": (circle, (angle("a"),), ((-pi,), (pi,)), {1: (64,), 3: (32,), 5: (24,)}),
    "line": (line, ("x",), ((-1.0,), (1.5,)), {1: (64,), 3: (32,), 5: (16,)}),
    "torus": (torus, (angle("a"), angle("b")), ((-pi, -pi), (pi, pi)), {1: (32, 32), 3: (24, 24), 5: (16, 16)}),
    "cylinder": (cylinder, (angle("a"), "v"), ((-pi, -1.0), (pi, 1.0)), {1: (32, 16), 3: (24, 16), 5: (16, 8)}),
    "plane": (plane, ("x", "y"), ((-1.0, -2.0), (1.0, 1.0)), {1: (24, 32), 3: (16, 24), 5: (8, 12)}),
    "tube": (tube, (angle("a"), "u", "v"), ((-pi, -1, -1), (pi, 1, 1)), {1: (24, 8, 8), 3: (16, 6, 6), 5: (16, 6, 6)}),
    "coupled standard maps": (
        coupled_standard_maps,
        (angle("a"), angle("b"), "u", "v"),
        ((-pi, -pi, -1.0, -1.0), (pi, pi, 1.0, 1.0)),
        {1: (12, 12, 4, 4), 3: (10, 10, 2, 2), 5: (10, 10, 1, 1)},
    ),
}


NONSMOOTH = {
    "kink": lambda x, p: (fabs(x[0] - 0.1234) - 0.5,),
    "jump": lambda x, p: (0.3 * floor(1.7 * x[0]) + 0.2 * x[0],),
    "root": lambda x, p: (0.3 * sqrt(fabs(x[0] - 0.4)),),
    "narrow hill": lambda x, p: (0.5 * x[0] + 0.4 * exp(-(((x[0] - 0.3) / 0.01) ** 2)),),
}


def exact_map(name: str) -> PointMap:
    function, coordinates, *_ = SMOOTH[name]
    return discrete_map(function, {}, coordinates)


def interpolated(name: str, shape: tuple[int, ...], order: int = 5, **options) -> PointMap:
    return interpolated_map(exact_map(name), CellGrid(*SMOOTH[name][2], shape), order, **options)


def errors_at(icm: PointMap, points: np.ndarray) -> np.ndarray:
    return np.abs(icm.iterate(points, 1).unwrapped - icm.exact.iterate(points, 1).unwrapped).max(axis=-1)
