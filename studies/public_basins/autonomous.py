"""Flows of the collection without a drive, looked at in equal intervals of time."""

from __future__ import annotations

from math import cos, pi, sin
from typing import Any

import numpy as np

from cellmap import angle

from .case import Numbers, flow


@flow(
    "Carpet oscillator",
    "10.1007/s12043-018-1581-6",
    "without number",
    ("x", "y"),
    10.0,
    (-100.0, -100.0),
    (100.0, 100.0),
)
def carpet(t: float, x: Numbers, p: Any) -> Numbers:
    return sin(0.1 * x[1]), -sin(0.1 * x[0]) + sin(0.1 * x[1]) * cos(x[0])


@flow(
    "Genetic switch",
    "10.1186/s12918-016-0375-z",
    "three fixed points",
    ("x", "y"),
    1.0,
    (0.0, 0.0),
    (350.0, 350.0),
    attractors=3,
    counts=(291, 200, 509),
    orbits=1000,
)
def genetic_switch(t: float, x: Numbers, p: Any) -> Numbers:
    own = [10.0 - 9.0 / (1.0 + (z / 250.0) ** 4) for z in x]
    to_x, to_y = 0.5 + 0.5 / (1.0 + (x[1] / 500.0) ** 2), 0.1 + 0.9 / (1.0 + (x[0] / 500.0) ** 2)
    return 40.0 * to_x * own[0] - 0.55 * x[0], 40.0 * to_y * own[1] - 0.55 * x[1]


WEAKER = {
    0: (4, 6, 7, 8),
    1: (0, 2, 8),
    2: (4, 5),
    3: (0, 2, 7),
    4: (1, 3),
    5: (1, 4),
    6: (7,),
    7: (0, 3, 6, 8),
    8: (0, 7),
}
"""Neurons that a neuron of the network inhibits less than the others, by that neuron."""


@flow(
    "Threshold-linear network",
    "10.1371/journal.pone.0264456",
    "equilibria, a cycle, chaos",
    [f"x{i}" for i in range(9)],
    1.0,
    (0.0,) * 9,
    (0.0,) * 5 + (4.0, 4.0, 0.0, 0.0),
)
def threshold_network(t: float, x: Numbers, p: Any) -> Numbers:
    # Many orbits of this window keep two neurons equal, and only rounding takes them away from saddles where these are.
    total = sum(x[1:], x[0])
    inputs = (1.0 - 1.5 * (total - x[i]) + 0.75 * sum(x[j] for j in WEAKER.get(i, ())) for i in range(9))
    return tuple(max(given, 0.0) - x[i] for i, given in enumerate(inputs))


@flow(
    "Two groups of oscillators",
    "10.1088/1367-2630/18/2/022002",
    "synchrony, and chimeras in a symmetric pair",
    ("s", "d", angle("q")),
    1.0,
    (0.56625, -0.5, -pi),
    (0.56625, 0.5, pi),
    attractors=3,
)
def chimera(t: float, x: Numbers, p: Any) -> Numbers:
    one, other, inside, across, lag = x[0] + x[1], x[0] - x[1], 0.55, 0.45, 0.025
    d_one = (1.0 - one**2) / 2.0 * (inside * one * sin(lag) + across * other * sin(lag - x[2]))
    d_other = (1.0 - other**2) / 2.0 * (inside * other * sin(lag) + across * one * sin(lag + x[2]))
    turn_one = (1.0 + one**2) / (2.0 * one) * (inside * one * cos(lag) + across * other * cos(lag - x[2]))
    turn_other = (1.0 + other**2) / (2.0 * other) * (inside * other * cos(lag) + across * one * cos(lag + x[2]))
    return (d_one + d_other) / 2.0, (d_one - d_other) / 2.0, turn_other - turn_one


@flow(
    "Coupled Lorenz oscillators",
    "10.1103/PhysRevE.96.062203",
    "multistable near a Hopf bifurcation",
    ("x", "y", "z", "u", "v", "w"),
    1.0,
    (1.0, 1.0, 10.0, 1.0, 1.0, 10.0),
    (1.0, 1.0, 24.0, 1.0, 1.0, 24.0),
)
def coupled_lorenz(t: float, x: Numbers, p: Any) -> Numbers:
    coupling = 1.1 * (x[5] - x[2])
    one = 10.0 * (x[1] - x[0]), 24.76 * x[0] - x[1] - x[0] * x[2], -8.0 / 3.0 * x[2] + x[0] * x[1] + coupling
    other = 10.0 * (x[4] - x[3]), 24.76 * x[3] - x[4] - x[3] * x[5], -8.0 / 3.0 * x[5] + x[3] * x[4] - coupling
    return *one, *other


@flow(
    "Gyrostat",
    "10.3390/math10111914",
    "chaotic, several",
    ("x", "y", "z"),
    1.0,
    (-50.0, -50.0, 0.0),
    (50.0, 50.0, 0.0),
)
def gyrostat(t: float, x: Numbers, p: Any) -> Numbers:
    return (
        -2.0 * x[0] - 0.7933 * x[1] + 0.1914 * x[2] + x[1] * x[2] / 3.0,
        1.19 * x[0] + 3.48 * x[1] - x[0] * x[2],
        -0.5742 * x[0] - 5.8 * x[2] + x[0] * x[1] + 22.8,
    )


@flow(
    "Chua's circuit",
    "10.1016/j.physleta.2011.04.037",
    "rest, and hidden chaos in a symmetric pair",
    ("x", "y", "z"),
    2.0,
    (-7.0, -5.0, 0.0),
    (7.0, 5.0, 0.0),
    attractors=3,
)
def hidden_chua(t: float, x: Numbers, p: Any) -> Numbers:
    inner, outer = -0.1767573476, -1.1467573476
    diode = outer * x[0] + 0.5 * (inner - outer) * (abs(x[0] + 1.0) - abs(x[0] - 1.0))
    return (
        8.4562218418 * (x[1] - x[0] - diode),
        x[0] - x[1] + x[2],
        -12.0732335925 * x[1] - 0.0051631393 * x[2],
    )


@flow(
    "Li and Sprott's flow",
    "10.1142/S0218127416502333",
    "several, a symmetric pair",
    ("x", "y", "z"),
    1.0,
    (-1.0, -5.0, -1.0),
    (1.0, 5.0, -1.0),
)
def li_sprott(t: float, x: Numbers, p: Any) -> Numbers:
    return x[1] + x[1] * x[2], x[1] * x[2] - 13.0 * x[0] * x[2], 0.55 * x[2] ** 2 - x[1] ** 2


@flow(
    "Lorenz's atmosphere of 1984",
    "10.1063/1.2953589",
    "several",
    ("x", "y", "z"),
    5.0,
    (0.5, -1.5, 0.0),
    (1.5, -0.5, 0.0),
)
def lorenz84(t: float, x: Numbers, p: Any) -> Numbers:
    return (
        -(x[1] ** 2) - x[2] ** 2 - 0.25 * x[0] + 0.25 * 6.846,
        x[0] * x[1] - x[1] - 4.0 * x[0] * x[2] + 1.287,
        4.0 * x[0] * x[1] + x[0] * x[2] - x[2],
    )


MAGNETS = [(cos(2.0 * pi * i / 3.0), sin(2.0 * pi * i / 3.0)) for i in range(3)]


@flow(
    "Magnetic pendulum",
    "10.1103/PhysRevLett.111.194101",
    "three magnets",
    ("x", "y", "u", "v"),
    2.0,
    (-5.0, -5.0, 0.0, 0.0),
    (5.0, 5.0, 0.0, 0.0),
    attractors=3,
)
def magnets(t: float, x: Numbers, p: Any) -> Numbers:
    along, across = -0.25 * x[0] - 0.2 * x[2], -0.25 * x[1] - 0.2 * x[3]
    for right, up in MAGNETS:
        cube = ((x[0] - right) ** 2 + (x[1] - up) ** 2 + 0.09) ** 1.5
        along, across = along - (x[0] - right) / cube, across - (x[1] - up) / cube
    return x[2], x[3], along, across


@flow(
    "Photonic coupler",
    "10.1103/PhysRevA.100.043834",
    "several",
    ("a", "b", angle("q")),
    1.0,
    (0.1, 0.1, pi),
    (10.0, 10.0, pi),
)
def photonic_coupler(t: float, x: Numbers, p: Any) -> Numbers:
    lossy, active, phase = x
    return (
        -lossy - 2.5 * active * sin(phase),
        2.0 * active / (1.0 + 0.5 * active**2) + 2.5 * lossy * sin(phase),
        0.5 + active**2 - lossy**2 + 2.5 * (lossy / active - active / lossy) * cos(phase),
    )


@flow(
    "Rikitake's dynamo",
    "unpublished",
    "cycles; very long transients",
    ("x", "y", "z"),
    2.0,
    (-2.5, -2.5, 0.0),
    (2.5, 2.5, 0.0),
)
def rikitake(t: float, x: Numbers, p: Any) -> Numbers:
    return -0.5 * x[0] + x[1] * x[2], -0.5 * x[1] + x[0] * (x[2] - 1.0), 1.0 - x[0] * x[1]


def thrown(places: np.ndarray) -> np.ndarray:
    """Return states (..., 4) on the circle of radius 2 thrown along it, of angles and fractions of the top speed."""
    turn, fraction = places[..., 0], places[..., 1]
    fastest = np.sqrt(np.maximum(24.0 * (2.0 - np.cos(3.0 * turn)), 0.0))
    speed = fraction * fastest
    return np.stack([2.0 * np.cos(turn), 2.0 * np.sin(turn), -speed * np.sin(turn), speed * np.cos(turn)], axis=-1)


@flow(
    "Slim fractals",
    "10.1103/PhysRevX.7.021040",
    "three wells",
    ("x", "y", "u", "v"),
    1.0,
    (0.0, 0.0),
    (2.0 * pi / 3.0, 1.0),
    attractors=3,
    states=thrown,
    plane=("u", "v"),
    counts=(317, 343, 340),
    orbits=1000,
)
def slim_fractal(t: float, x: Numbers, p: Any) -> Numbers:
    along = 3.0 * (x[0] ** 3 - x[0] ** 2 + x[0] * x[1] ** 2 + x[1] ** 2)
    across = 3.0 * x[1] * (x[0] ** 2 + 2.0 * x[0] + x[1] ** 2)
    return x[2], x[3], -0.2 * x[2] - along, -0.2 * x[3] - across


@flow(
    "Memristive Sprott B oscillator",
    "10.1016/j.chaos.2022.111834",
    "hidden, several",
    ("x", "y", "z", "v"),
    2.0,
    (-2.0, -2.0, 0.0, 0.0),
    (2.0, 2.0, 0.0, 0.0),
)
def memristive(t: float, x: Numbers, p: Any) -> Numbers:
    memory = 11.0 * (1.0 + 0.5 * abs(x[3]) + 0.05 * x[3] ** 2)
    return 5.8 * x[1] * x[2] + 0.03, x[0] - x[1], 1.0 - memory * x[0] * x[1], x[0] * x[1] - x[3]


@flow(
    "Thomas's oscillator",
    "unpublished",
    "three cycles, by symmetry",
    ("x", "y", "z"),
    10.0,
    (-5.0, -5.0, 0.0),
    (5.0, 5.0, 0.0),
    attractors=3,
)
def thomas(t: float, x: Numbers, p: Any) -> Numbers:
    return sin(x[1]) - 0.1665 * x[0], sin(x[2]) - 0.1665 * x[1], sin(x[0]) - 0.1665 * x[2]
