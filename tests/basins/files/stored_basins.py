"""Basins of every kind that are stored."""

from math import pi

import numpy as np

import systems
from cellmap import (
    CellGrid,
    ForcedSystem,
    discrete_map,
    find_basins,
    interpolated_map,
    section_map,
    stroboscopic_map,
)

GRID = CellGrid((-pi, -100.0), (pi, 100.0), (24, 20))

van_der_pol = ForcedSystem(lambda t, x, p: (x[1], p.mu * (1 - x[0] ** 2) * x[1] - x[0]), {"mu": 1.0}, 6.0, ("x", "v"))


def pendulum(**parameters: float):
    return stroboscopic_map(systems.driven_pendulum(**parameters))


def table(**options):
    return interpolated_map(pendulum(), CellGrid((-pi, -100.0), (pi, 100.0), (48, 32)), **options)


CASES = {
    "grid": lambda: find_basins(pendulum(), GRID),
    "many attractors": lambda: find_basins(
        pendulum(amplitude=0.010), CellGrid((-pi, -500.0), (pi, 500.0), (60, 60)), max_periods=900, longest_period=8
    ),
    "table, escaped": lambda: find_basins(table(outside="escape"), GRID),
    "table, tolerance": lambda: find_basins(table(order=3, outside="integrate", tolerance=0.1), GRID),
    "initial_conditions": lambda: find_basins(pendulum(), np.random.default_rng(0).uniform(-3, 3, (5, 4, 2))),
    "one start": lambda: find_basins(pendulum(), [0.1, 0.2]),
    "chaotic and diverged": lambda: find_basins(systems.henon_map(), CellGrid((-2, -2), (2, 2), (30, 30))),
    "undecided": lambda: find_basins(pendulum(damping=0.0), [[0.1, 1.0], [1.0, 2.0]], max_periods=3),
    "quasi-periodic": lambda: find_basins(
        discrete_map(lambda x, p: (2.1 * x[0] * (1 - x[1]), x[0]), {}, ("x", "y")), CellGrid((0, 0), (1, 1), (20, 20))
    ),
    "limit cycle, unknown grazing distance": lambda: find_basins(
        section_map(van_der_pol, ("v", 0.0, -1)), CellGrid((0.1,), (3.0,), (9,))
    ),
    "no parameters": lambda: find_basins(
        discrete_map(lambda x, p: (x[0] / 2,), {}, ("x",)), CellGrid((-1,), (1,), (9,))
    ),
}
