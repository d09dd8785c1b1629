"""Maps of the collection."""

from __future__ import annotations

from math import cos, exp, pi, sin, sqrt
from typing import Any

import numpy as np

from cellmap import angle

from .case import Numbers, mapping

GOLDEN = (sqrt(5.0) - 1.0) / 2.0
TURN = angle("turn", "turns", period=1.0, lower=0.0)


@mapping(
    "Kicked rotor",
    "10.1103/PhysRevE.54.71",
    "more than a hundred",
    (angle("x"), "y"),
    (-pi, -pi),
    (pi, pi),
)
def kicked_rotor(x: Numbers, p: Any) -> Numbers:
    return x[0] + x[1], 0.98 * x[1] + 4.0 * sin(x[0] + x[1])


@mapping(
    "Lorenz's computational chaos",
    "10.1016/0167-2789(89)90072-9",
    "symmetric pairs, and infinity",
    ("x", "y"),
    (-2.0, -3.0),
    (2.0, 3.0),
)
def computational_chaos(x: Numbers, p: Any) -> Numbers:
    return 1.54 * x[0] - 1.5 * x[0] * x[1], -0.5 * x[1] + 1.5 * x[0] ** 2


@mapping(
    "Coupled cubic maps",
    "10.1088/0951-7715/9/3/006",
    "riddled basin of chaos in y = 0",
    ("x", "y"),
    (-1.5, -0.7),
    (1.5, 0.7),
)
def riddled_cubic(x: Numbers, p: Any) -> Numbers:
    return (
        1.5 * sqrt(3.0) * x[0] * (x[0] ** 2 - 1.0) + 0.5 * x[0] * x[1] ** 2,
        1.28 * exp(-0.7 * x[0] ** 2) * x[1] + x[1] ** 3,
    )


@mapping(
    "Bairstow's method",
    "10.1063/1.166158",
    "riddled basins of roots",
    ("u", "v"),
    (-4.0, -4.0),
    (4.0, 4.0),
)
def bairstow(x: Numbers, p: Any) -> Numbers:
    below = 2.0 * x[0] ** 2 + x[1]
    return (x[0] ** 3 + x[0] * (x[1] + 0.2) + 0.8) / below, (x[1] * (x[0] ** 2 - 0.2) + 1.6 * x[0]) / below


@mapping(
    "Cournot's duopoly",
    "10.1016/S0960-0779(98)00130-1",
    "cycles of period 8 from one of x = 3.55 x (1 - x)",
    ("x", "y"),
    (0.0, 0.0),
    (1.0, 1.0),
    attractors=8,
    counts=(1224, 1224, 1225, 1225, 1269, 1269, 1281, 1283),
    orbits=10_000,
)
def duopoly(x: Numbers, p: Any) -> Numbers:
    return 3.55 * x[1] * (1.0 - x[1]), 3.55 * x[0] * (1.0 - x[0])


@mapping(
    "Bogdanov's map",
    "10.1142/S021812749300074X",
    "islands, and infinity",
    ("x", "y"),
    (-0.6, -0.8),
    (1.0, 0.8),
)
def bogdanov(x: Numbers, p: Any) -> Numbers:
    then = 1.0125 * x[1] + 1.2 * x[0] * (x[0] - 1.0) - 0.1 * x[0] * x[1]
    return x[0] + then, then


@mapping(
    "Cubic map",
    "10.1016/j.physleta.2013.03.027",
    "Wada boundaries",
    ("x", "y"),
    (-2.0, -2.0),
    (2.0, 2.0),
)
def cubic(x: Numbers, p: Any) -> Numbers:
    return x[1], 2.9 * x[1] - x[1] ** 3 - 0.66 * x[0]


@mapping(
    "Coupled logistic maps",
    "10.1103/PhysRevE.57.2713",
    "riddled basins",
    ("x", "y"),
    (-0.05, -0.05),
    (1.2, 1.2),
)
def coupled_logistic(x: Numbers, p: Any) -> Numbers:
    return 3.6 * x[0] * (1.0 - x[0]) - (x[1] - x[0]), 3.6 * x[1] * (1.0 - x[1]) - (x[0] - x[1])


@mapping(
    "Quasi-periodically forced map",
    "10.1103/PhysRevE.58.3060",
    "three curves with Wada boundaries",
    ("x", TURN),
    (0.0, 0.0),
    (1.0, 1.0),
    attractors=3,
)
def forced_logistic(x: Numbers, p: Any) -> Numbers:
    third = x[0]
    for _ in range(3):
        third = 3.833 * third * (1.0 - third)
    return third + 0.0015 * cos(2.0 * pi * x[1]), x[1] + GOLDEN


@mapping(
    "Grebogi's map",
    "10.1016/0375-9601(83)90945-3",
    "two fixed points, one half each",
    (angle("turn"), "x"),
    (-pi, -0.5),
    (pi, 0.5),
    attractors=2,
    counts=(50_000, 50_000),
    orbits=100_000,
)
def grebogi(x: Numbers, p: Any) -> Numbers:
    return x[0] + 1.32 * sin(2.0 * x[0]) - 0.9 * sin(4.0 * x[0]) - x[1] * sin(x[0]), -0.3 * cos(x[0])


@mapping(
    "Weakly dissipative Hénon map",
    "10.1016/j.physrep.2014.02.007",
    "cycles of periods 1, 3 and 9; infinity",
    ("x", "y"),
    (-2.0, -2.0),
    (2.0, 2.0),
    attractors=3,
    counts=(4213, 3897, 3106),
    orbits=100_000,
)
def weak_henon(x: Numbers, p: Any) -> Numbers:
    return 1.0 - 1.08 * x[0] ** 2 + x[1], -0.9 * x[0]


@mapping(
    "Plants that compete",
    "Franke, Yakubu",
    "exclusion",
    ("x", "y"),
    (0.0, 0.0),
    (30.0, 2.0),
)
def exclusion(x: Numbers, p: Any) -> Numbers:
    return x[0] * exp(2.825 - 20.25 * (x[0] + x[1])), 1.2 * x[1] / (0.1 + x[0] + x[1])


@mapping(
    "Dispersal between two patches",
    "Holt, McPeek 1996",
    "chaotic",
    ("x", "y", "u", "v"),
    (0.01, 0.01, 0.5, 0.5),
    (2.0, 2.0, 0.5, 0.5),
)
def dispersal(x: Numbers, p: Any) -> Numbers:
    one, other = exp(3.0 * (1.0 - (x[0] + x[1]) / 100.0)), exp(3.5 * (1.0 - (x[2] + x[3]) / 75.0))
    return (
        0.825 * x[0] * one + 0.175 * x[2] * other,
        0.998 * x[1] * one + 0.002 * x[3] * other,
        0.825 * x[2] * other + 0.175 * x[0] * one,
        0.998 * x[3] * other + 0.002 * x[1] * one,
    )


def triangle(x: Numbers) -> Numbers:
    """Return z^2 - (1 + i a) times the conjugate of z."""
    return x[0] ** 2 - x[1] ** 2 - x[0] - 1.0287137 * x[1], 2.0 * x[0] * x[1] - 1.0287137 * x[0] + x[1]


@mapping(
    "Triangular map",
    "10.1017/S0143385700009020",
    "chaos in three lines, two pieces each, intermingled",
    ("x", "y"),
    (-2.0, -2.0),
    (2.0, 2.0),
    attractors=6,
)
def intermingled(x: Numbers, p: Any) -> Numbers:
    return triangle(triangle(x))


def bent(x: float) -> float:
    """Return Kapitaniak's line of three pieces."""
    return -sqrt(2.0) * x + sqrt(2.0) * (abs(x + sqrt(0.5)) - abs(x - sqrt(0.5)))


@mapping(
    "Coupled lines of three pieces",
    "10.1103/PhysRevE.57.R6253",
    "riddled basins",
    ("x", "y"),
    (-2.0, -2.0),
    (2.0, 2.0),
)
def kapitaniak(x: Numbers, p: Any) -> Numbers:
    return bent(x[0]) - 0.935 * (x[1] - x[0]), bent(x[1]) - 0.935 * (x[0] - x[1])


@mapping(
    "Piecewise smooth map",
    "10.1063/1.2985853",
    "several",
    ("x", "y"),
    (-1.5, -1.5),
    (2.5, 2.5),
)
def piecewise_smooth(x: Numbers, p: Any) -> Numbers:
    slope = -2.0 if x[0] <= 0.0 else -0.475
    return slope * x[0] + x[1] - 1.0, -0.95 * x[0]


@mapping(
    "Quadratic map",
    "10.1142/S0218127494000241",
    "basins of many pieces, and infinity",
    ("x", "y"),
    (-2.05, -3.0),
    (2.05, 3.0),
)
def quadratic(x: Numbers, p: Any) -> Numbers:
    return -0.42 * x[0] + x[1], x[0] ** 2 - 1.32


@mapping(
    "Cournot's triopoly",
    "Agiza, Bischi, Kopel 1999",
    "equilibrium and a symmetric triple; infinity",
    ("x", "y", "z"),
    (-0.5, -0.5, 1.0 - 1.0 / 3.9),
    (1.8, 1.8, 1.0 - 1.0 / 3.9),
    attractors=4,
    counts=(7905, 9072, 28929, 9019),
    orbits=100_000,
)
def triopoly(x: Numbers, p: Any) -> Numbers:
    best = [1.95 * q * (1.0 - q) for q in x]
    return (
        0.5 * (x[0] + best[1] + best[2]),
        0.5 * (x[1] + best[2] + best[0]),
        0.5 * (x[2] + best[0] + best[1]),
    )


@mapping(
    "Competition after Ricker and Gatto",
    "10.1016/S0960-0779(00)00047-3",
    "intermingled basins",
    ("x", "y"),
    (3.0, 0.0),
    (6.0, 0.1),
)
def ricker_gatto(x: Numbers, p: Any) -> Numbers:
    crowd = exp(-x[0] - x[1])
    return x[0] * (22.0 * crowd + 0.007815), x[1] * (2.95 * crowd + 0.5)


@mapping(
    "Coupled maps, quasi-periodically forced",
    "10.1103/PhysRevE.72.036215",
    "several",
    ("x", "y", TURN),
    (0.0, 0.0, 0.0),
    (1.0, 1.0, 0.0),
)
def forced_pair(x: Numbers, p: Any) -> Numbers:
    height = 3.2511 + 0.5 * (4.0 - 3.2511) * cos(2.0 * pi * x[2])
    return (
        height * x[0] * (1.0 - x[0]) + 0.01 * (x[1] - x[0]),
        height * x[1] * (1.0 - x[1]) + 0.01 * (x[0] - x[1]),
        x[2] + GOLDEN,
    )


@mapping(
    "Chen's flow by a symmetric method",
    "10.1016/j.chaos.2022.112794",
    "chaos and cycles",
    ("x", "y", "z"),
    (-16.0, -16.0, 20.0),
    (16.0, 16.0, 20.0),
)
def chen(x: Numbers, p: Any) -> Numbers:
    early, late = 0.0077, 0.0023
    u = (x[0] + 40.0 * early * x[1]) / (1.0 + 40.0 * early)
    v = (x[1] - early * u * (12.0 + x[2])) / (1.0 - 28.0 * early)
    w = (x[2] + early * u * v) / (1.0 + 3.0 * early)
    z = w + late * (u * v - 3.0 * w)
    y = v + late * (28.0 * v - u * (12.0 + z))
    return u + 40.0 * late * (y - u), y, z


@mapping(
    "Predators and prey",
    "10.1016/j.chaos.2022.112833",
    "several",
    ("x", "y"),
    (0.1, 0.01),
    (2.0, 0.2),
)
def predators(x: Numbers, p: Any) -> Numbers:
    open_prey = 0.896 * x[0]
    growth = 3.2 * 0.104 + 3.2 * 0.896 / (1.0 + 7.935 * x[1]) - 0.3 - 0.1 * x[0]
    return (
        x[0] * exp(growth - 2.0 * 0.896 * x[1] / (5.0 + open_prey)),
        x[1] * exp(1.8 * open_prey / (5.0 + open_prey) - 0.1),
    )


def sporadic(x: float) -> float:
    """Return the map of an interval that stays long near 0."""
    if x <= 0.0:
        return 9.0 * x / (4.0 - 5.0 * x)
    if x <= 4.0 / 9.0:
        return 2.25 * x
    if x <= 5.0 / 9.0:
        return 20.25 * (x - x**2) - 4.0
    return 2.25 * (1.0 - x)


@mapping(
    "Sporadical fractals",
    "10.1103/PhysRevLett.82.3597",
    "far above and far below",
    ("x", "y"),
    (0.0, -2.0),
    (1.0, 6.0),
    attractors=2,
    ends={"far above": lambda x, p: x[1] - 1e4, "far below": lambda x, p: -1e4 - x[1]},
    counts=(25030, 74970),
    orbits=100_000,
)
def sporadical(x: Numbers, p: Any) -> Numbers:
    return sporadic(x[0]), 1.1 * x[1] + sin(2.0 * pi * x[0])


def double_rotor(damping: float) -> tuple[list[list[float]], list[list[float]]]:
    """Return matrices that carry angular velocities on to the next kick: to angular velocities, and to angles.

    They are those of the collection; in the paper the second has 1 - exp(-rate) where this one has exp(-rate).
    """
    rates, modes = np.linalg.eigh(damping * np.array([[2.0, -1.0], [-1.0, 1.0]]))
    kept = (modes * np.exp(-rates)) @ modes.T
    moved = (modes * np.exp(-rates) / rates) @ modes.T
    return kept.tolist(), moved.tolist()


KEPT, MOVED = double_rotor(0.1)


@mapping(
    "Kicked double rotor",
    "10.1016/0167-2789(87)90108-4",
    "intertwined boundaries",
    (angle("x"), angle("y"), "u", "v"),
    (-pi, -pi, 0.0, 0.0),
    (pi, pi, 0.0, 0.0),
)
def kicked_double_rotor(x: Numbers, p: Any) -> Numbers:
    one = x[0] + MOVED[0][0] * x[2] + MOVED[0][1] * x[3]
    other = x[1] + MOVED[1][0] * x[2] + MOVED[1][1] * x[3]
    return (
        one,
        other,
        KEPT[0][0] * x[2] + KEPT[0][1] * x[3] + sqrt(0.5) * 0.1 * sin(one),
        KEPT[1][0] * x[2] + KEPT[1][1] * x[3] + 0.1 * sin(other),
    )
