"""Periodically forced oscillators of the collection."""

from __future__ import annotations

from math import cos, exp, pi, sin
from typing import Any

from cellmap import angle
from cellmap.maps import Impact

from .case import Numbers, flow


@flow(
    "Duffing oscillator",
    "duffing_basins.jl",
    "two wells, a symmetry between them",
    ("x", "v"),
    2.0 * pi / 1.15,
    (-2.2, -2.2),
    (2.2, 2.2),
    attractors=4,
    counts=(263, 223, 211, 303),
    orbits=1000,
)
def duffing(t: float, x: Numbers, p: Any) -> Numbers:
    return x[1], -0.05 * x[1] + x[0] - x[0] ** 3 + 0.098 * sin(1.15 * t)


@flow(
    "Pendulum, slow drive",
    "pendulum_basins.jl",
    "riddled basins",
    (angle("x"), "v"),
    4.0 * pi,
    (-pi, -4.0),
    (pi, 4.0),
)
def slow_pendulum(t: float, x: Numbers, p: Any) -> Numbers:
    return x[1], -0.2 * x[1] - sin(x[0]) + 15.0 / 11.0 * cos(0.5 * t)


@flow(
    "Pendulum",
    "pendulum_basins.jl",
    "three basins with one Wada boundary",
    (angle("x"), "v"),
    2.0 * pi,
    (-pi, -4.0),
    (pi, 4.0),
    attractors=3,
    counts=(371, 216, 413),
    orbits=1000,
)
def pendulum(t: float, x: Numbers, p: Any) -> Numbers:
    return x[1], -0.2 * x[1] - sin(x[0]) + 1.66 * cos(t)


@flow(
    "Parametric pendulum with a spring",
    "10.1142/S0218127411030167",
    "rest and a symmetric pair",
    ("x", "v"),
    2.0 * pi / 1.5,
    (-10.0, -10.0),
    (10.0, 10.0),
)
def parametric_pendulum(t: float, x: Numbers, p: Any) -> Numbers:
    return x[1], -0.2 * x[1] - x[0] - (9.81 - 4.1 * 1.5**2 * cos(1.5 * t)) * sin(x[0])


@flow(
    "Split ring resonator",
    "10.1063/5.0157489",
    "periodic and chaotic",
    ("x", "v"),
    2.0 * pi / 1.0285,
    (-10.0, -15.0),
    (10.0, 15.0),
)
def split_ring(t: float, x: Numbers, p: Any) -> Numbers:
    return x[1], -0.38 * x[1] - x[0] + 0.4 * x[0] ** 2 - 0.08 * x[0] ** 3 + 35.0 * cos(1.0285 * t)


@flow(
    "Gear rattle",
    "10.1142/S021812740902283X",
    "several, non-smooth",
    ("x", "v"),
    1.0,
    (-0.5999, -4.0),
    (0.5999, 4.0),
)
def gear_rattle(t: float, x: Numbers, p: Any) -> Numbers:
    beyond = x[0] - 0.6 if x[0] >= 0.6 else x[0] + 0.6 if x[0] <= -0.6 else 0.0
    wheel = 4.0 * pi * 0.6 - 0.4 * pi**2 * cos(2.0 * pi * t) - 0.2 * pi * 0.6 * sin(2.0 * pi * t)
    return x[1], -0.6 * x[1] - 200.0 * beyond + wheel


TEETH = [
    Impact(lambda t, x, p: -x[0], lambda t, x, p: (x[0], -0.9 * x[1])),
    Impact(lambda t, x, p: x[0] + 1.0, lambda t, x, p: (x[0], -0.9 * x[1])),
]


@flow(
    "Gear rattle with impacts",
    "10.1177/107754630100700605",
    "several",
    ("x", "v"),
    2.0 * pi,
    (-0.99, -1.0),
    (-0.02, 1.0),
    system={"impacts": TEETH},
)
def gear_impacts(t: float, x: Numbers, p: Any) -> Numbers:
    return x[1], -0.1 * x[1] + 0.1 - 0.048 * cos(t) + 0.48 * sin(t)


@flow(
    "Modulated CO2 laser",
    "10.1063/5.0093727",
    "periods 1 and 2",
    ("x", "y"),
    200.0,
    (0.1, 0.1),
    (8.0, 4.0),
)
def co2_laser(t: float, x: Numbers, p: Any) -> Numbers:
    losses = 1.0 + 12.0 * (0.05 + 0.02 * sin(0.01 * pi * t)) ** 2
    return x[1] - losses, 0.0025 * (1.252 - x[1]) - 0.002 * exp(x[0]) * x[1]


@flow(
    "Josephson junction",
    "10.1103/PhysRevA.36.2455",
    "fractal boundary",
    (angle("x"), "v"),
    2.0 * pi,
    (-pi, -2.0),
    (pi, 1.0),
)
def josephson(t: float, x: Numbers, p: Any) -> Numbers:
    return x[1], -0.2 * x[1] - sin(x[0]) + 1.878 + 10.198 * sin(t)


@flow(
    "Alfvén waves",
    "10.1142/S0218127402005303",
    "several",
    ("y", "z"),
    2.0 * pi,
    (-2.2, -2.2),
    (2.2, 2.2),
)
def alfven(t: float, x: Numbers, p: Any) -> Numbers:
    y, z = x
    beyond = z * z + y * y - 1.0
    along, across = beyond * z - 0.25 * z + 0.1 * cos(t), 0.25 * (y - 1.0) - beyond * y - 0.1 * sin(t)
    return (along + 0.01747 * across) / (1.0 + 0.01747**2), (across - 0.01747 * along) / (1.0 + 0.01747**2)


@flow(
    "Buck converter",
    "Di Bernardo et al. 1997",
    "periods 2 and 12",
    ("v", "i"),
    400e-6,
    (11.0, 0.5),
    (14.0, 0.9),
)
def buck_converter(t: float, x: Numbers, p: Any) -> Numbers:
    ramp = 11.75 + 1309.52 * (t % 400e-6)
    source = 0.0 if x[0] > ramp else 30.1
    return -x[0] / (22.0 * 47e-6) + x[1] / 47e-6, (source - x[0]) / 20e-3


@flow(
    "Megastable oscillator",
    "10.1140/epjst/e2017-70037-1",
    "nested, without number",
    ("x", "y"),
    2.0 * pi / 0.73,
    (-20.0, -20.0),
    (20.0, 20.0),
)
def megastable(t: float, x: Numbers, p: Any) -> Numbers:
    return x[1], -(0.33**2) * x[0] + x[1] * cos(x[0]) + sin(0.73 * t)


@flow(
    "Neuron with a synapse",
    "10.1063/5.0125611",
    "several, riddled",
    ("x", "y"),
    1.0,
    (-10.0, -10.0),
    (10.0, 10.0),
)
def neuron_synapse(t: float, x: Numbers, p: Any) -> Numbers:
    synapse = 2.0 * sin(1.7 * x[0])
    return -x[0] + synapse * 2.0 * sin(1.7 * x[1]) + sin(2.0 * pi * t), 1.8 * (synapse**2 - x[1])


@flow(
    "Particle in two dimensions",
    "10.1016/0167-2789(94)90047-7",
    "chaos in y = 0, and infinity: riddled basin",
    ("x", "y", "u", "v"),
    2.0 * pi / 3.5,
    (0.0, 0.0, 0.0, 0.0),
    (1.2, 1.2, 0.0, 0.0),
)
def riddled_particle(t: float, x: Numbers, p: Any) -> Numbers:
    force = 4.0 * x[0] * (1.0 - x[0] ** 2) - x[1] ** 2 + 2.3 * sin(3.5 * t)
    return x[2], x[3], -0.05 * x[2] + force, -0.05 * x[3] - 2.0 * x[1] * (x[0] + 1.9)


@flow(
    "Particle with symmetry",
    "Sommerer, Ott 1996",
    "intermingled basins",
    ("x", "y", "u", "v"),
    2.0 * pi / 2.2136,
    (-1.0, -1.0, 0.0, 0.0),
    (1.0, 1.0, 0.0, 0.0),
)
def intermingled_particle(t: float, x: Numbers, p: Any) -> Numbers:
    force = 4.0 * x[0] * (1.0 - x[0] ** 2) - 40.0 * x[0] * x[1] ** 2 + 1.0688 * sin(2.2136 * t)
    return x[2], x[3], -0.632 * x[2] + force, -0.632 * x[3] - 40.0 * x[1] * (x[0] ** 2 - 0.098 + x[1] ** 2)


@flow(
    "Grazing oscillator",
    "10.1016/j.chaos.2007.01.022",
    "grazing chaos",
    ("x", "v"),
    2.0 * pi / 0.417893,
    (-1.0, -1.0),
    (1.0, 1.0),
)
def grazing(t: float, x: Numbers, p: Any) -> Numbers:
    stop = 20.0 * (x[0] - 0.63) if x[0] >= 0.63 else 0.0
    return x[1], -0.04 * x[1] - x[0] - stop + 0.5 * cos(0.417893 * t)


@flow(
    "Pumped fibre laser",
    "10.1016/j.physleta.2009.10.061",
    "several",
    ("x", "y"),
    1.0 / 70.2e3,
    (0.0, 0.09),
    (15.0, 0.13),
)
def pumped_laser(t: float, x: Numbers, p: Any) -> Numbers:
    above = x[1] + 0.3075
    pump = 506.0 * (1.0 + 0.8 * sin(2.0 * pi * 70.2e3 * t))
    light = 6.6207e7 * x[0] * x[1] - 7.4151e6 * x[0] + 0.0163 * above
    return light, -4.0763e3 * x[0] * x[1] - above + pump * (1.0 - exp(-18.0 * (1.0 - above / 0.615)))
