"""Systems of textbooks, as a reader would write them: plain right-hand sides, with no word on how to integrate them."""

from __future__ import annotations

from math import cos, exp, log, pi, sin

import numpy as np

from cellmap import CellGrid, ForcedSystem, angle
from cellmap.maps import Impact

TURN = 2 * pi


def by_frequency(p):
    return TURN / p.omega


# --- smooth oscillators


def duffing(t, x, p):
    q, v = x
    return v, q - q**3 - p.damping * v + p.force * cos(p.omega * t)


def hardening(t, x, p):
    q, v = x
    return v, -q - q**3 - p.damping * v + p.force * cos(p.omega * t)


def helmholtz(t, x, p):
    q, v = x
    return v, -q - q**2 - p.damping * v + p.force * cos(p.omega * t)


def pendulum(t, x, p):
    theta, v = x
    return v, -sin(theta) - p.damping * v + p.force * cos(p.omega * t)


def inverted(t, x, p):
    """Pendulum on a pivot that shakes up and down."""
    theta, v = x
    return v, -p.damping * v - (p.gravity + p.shake * cos(t)) * sin(theta)


def van_der_pol(t, x, p):
    q, v = x
    return v, p.mu * (1 - q * q) * v - q + p.force * cos(p.omega * t)


def fitzhugh_nagumo(t, x, p):
    v, w = x
    return v - v**3 / 3 - w + p.current + p.force * cos(p.omega * t), 0.08 * (v + 0.7 - 0.8 * w)


def brusselator(t, x, p):
    u, v = x
    return p.a - (p.b + 1) * u + u * u * v + p.force * cos(p.omega * t), p.b * u - u * u * v


def josephson(t, x, p):
    phase, v = x
    return v, p.bias + p.force * cos(p.omega * t) - p.damping * v - sin(phase)


def swing(t, x, p):
    """Generator on a grid: loses synchrony, or keeps it."""
    delta, v = x
    return v, p.power - p.damping * v - p.coupling * sin(delta)


def paul_trap(t, x, p):
    """Mathieu's equation with damping: inside the zone of stability all orbits end at the centre."""
    q, v = x
    return v, -p.damping * v - (p.a - 2 * p.q * cos(2 * t)) * q


def mems(t, x, p):
    """Plate before an electrode: it oscillates, or is pulled in."""
    q, v = x
    return v, -q - p.damping * v + (p.bias + p.force * cos(p.omega * t)) / (1 - q) ** 2


def morse(t, x, p):
    q, v = x
    return v, -p.damping * v - exp(-q) * (1 - exp(-q)) + p.force * cos(p.omega * t)


def toda(t, x, p):
    q, v = x
    return v, 1 - exp(q) - p.damping * v + p.force * cos(p.omega * t)


def rayleigh(t, x, p):
    q, v = x
    return v, p.mu * (v - v**3 / 3) - q + p.force * cos(p.omega * t)


def coupled_duffings(t, x, p):
    """Chain of two or three wells, the first one driven."""
    half = len(x) // 2
    q, v = x[:half], x[half:]
    rates = []
    for j in range(half):
        neighbours = sum(q[k] - q[j] for k in (j - 1, j + 1) if 0 <= k < half)
        drive = p.force * cos(p.omega * t) if j == 0 else 0.0
        rates.append(q[j] - q[j] ** 3 - p.damping * v[j] + p.coupling * neighbours + drive)
    return (*v, *rates)


# --- populations, with a seasonal rate, in logarithms


def sir(t, x, p):
    s, i = exp(x[0]), exp(x[1])
    beta = p.beta * (1 + p.season * cos(TURN * t))
    return p.mu / s - p.mu - beta * i, beta * s - p.gamma - p.mu


def seir(t, x, p):
    s, e, i = exp(x[0]), exp(x[1]), exp(x[2])
    beta = p.beta * (1 + p.season * cos(TURN * t))
    return p.mu / s - p.mu - beta * i, beta * s * i / e - p.sigma - p.mu, p.sigma * e / i - p.gamma - p.mu


def predator_prey(t, x, p):
    prey, predator = x
    growth = p.r * (1 + p.season * sin(TURN * t))
    eaten = prey * predator / (p.half + prey)
    return growth * prey * (1 - prey) - eaten, 0.6 * eaten - p.death * predator


# --- branches


def soft_impact(t, x, p):
    q, v = x
    push = p.k * (q - 1) if q > 1 else 0.0
    return v, -q - push - p.damping * v + p.force * cos(p.omega * t)


def backlash(t, x, p):
    """Gears with play: no force between the flanks."""
    q, v = x
    force = q - 1 if q > 1 else q + 1 if q < -1 else 0.0
    return v, p.load - force - p.damping * v + p.force * cos(p.omega * t)


def bilinear(t, x, p):
    q, v = x
    return v, -max(q, 0.0) - p.k * min(q, 0.0) - p.damping * v + p.force * cos(p.omega * t)


def chua(t, x, p):
    """Forced circuit of Murali, Lakshmanan and Chua (1994): a diode of three straight pieces."""
    v, i = x
    diode = p.b * v + 0.5 * (p.a - p.b) * (abs(v + 1) - abs(v - 1))
    return i - diode, -p.beta * (1 + p.nu) * i - p.beta * v + p.force * sin(p.omega * t)


def square_driven(t, x, p):
    q, v = x
    return v, q - q**3 - p.damping * v + p.force * np.sign(np.sin(t))


def dry_friction(t, x, p):
    q, v = x
    return v, -q - p.friction * np.sign(v) + p.force * cos(p.omega * t)


def belt(t, x, p):
    """Stick and slip on a belt that moves on, with friction that falls with the speed."""
    q, v = x
    slip = v - p.belt
    return v, -q - p.friction * np.sign(slip) / (1 + abs(slip))


def buck(t, x, p):
    """Buck converter of Fossas and Olivar (1996): on while the control voltage is below a ramp."""
    v, i = x
    ramp = 3.8 + 4.4 * (t / 400e-6 % 1.0)
    on = 1.0 if 8.4 * (v - 11.3) < ramp else 0.0
    return (i - v / 22) / 47e-6, (p.supply * on - v) / 20e-3


def boost(t, x, p):
    """Boost converter that opens its switch after a fixed part of the cycle."""
    v, i = x
    off = 1.0 if t % 1.0 > p.duty else 0.0
    return off * i * 2 - v / 2, p.supply - off * v


# --- impacts


def free_fall(t, x, p):
    return x[1], -1.0 + 0.0 * x[0]


def linear(t, x, p):
    q, v = x
    return v, -q - p.damping * v + p.force * cos(p.omega * t)


def free_rotor(t, x, p):
    return x[1], -p.damping * x[1]


STOP = Impact(lambda t, x, p: p.wall - x[0], lambda t, x, p: (x[0], -p.e * x[1]))


def table_gap(t, x, p):
    return x[0] - p.amplitude * cos(t)


def table_reset(t, x, p):
    speed = -p.amplitude * sin(t)
    return x[0], speed - p.e * (x[1] - speed)


KICK = Impact(lambda t, x, p: -sin(TURN * t), lambda t, x, p: (x[0], x[1] + p.kick * sin(x[0])))


def window(a, b, n=10):
    return CellGrid(a, b, (n,) * len(a))


Q2 = window((-2, -2), (2, 2))
ANGLE = window((-pi, -3), (pi, 3))
QV, PHASE = ("q", "v"), (angle("theta"), "v")


def made(rhs, params, period, coordinates=QV, **options):
    return ForcedSystem(rhs, params, period, coordinates, **options)


def forced(rhs, coordinates=QV, omega=1.0, **params):
    """Driven at a frequency that is one of its parameters."""
    return ForcedSystem(rhs, {**params, "omega": omega}, by_frequency, coordinates)


SMOOTH = {
    "two-well Duffing": (forced(duffing, damping=0.25, force=0.2, omega=1.0), Q2),
    "hardening Duffing": (forced(hardening, damping=0.1, force=1.0, omega=1.6), Q2),
    "Helmholtz": (
        forced(helmholtz, damping=0.1, force=0.06, omega=0.85),
        window((-1, -1), (1, 1)),
    ),
    "driven pendulum": (forced(pendulum, PHASE, damping=0.2, force=1.66, omega=1.0), ANGLE),
    "inverted pendulum": (made(inverted, {"damping": 0.1, "gravity": 0.02, "shake": 0.4}, TURN, PHASE), ANGLE),
    "van der Pol, mu 1": (forced(van_der_pol, mu=1.0, force=1.0, omega=1.0), Q2),
    "van der Pol, mu 5": (forced(van_der_pol, mu=5.0, force=5.0, omega=0.7), Q2),
    "FitzHugh-Nagumo": (forced(fitzhugh_nagumo, current=0.5, force=0.4, omega=0.17), Q2),
    "Brusselator": (
        forced(brusselator, ("u", "v"), a=1.0, b=2.5, force=0.4, omega=1.0),
        window((0.1, 0.1), (3, 4)),
    ),
    "Josephson": (
        forced(josephson, PHASE, bias=0.5, force=0.4, damping=0.4, omega=0.8),
        ANGLE,
    ),
    "swing equation": (
        made(swing, {"power": 1.0, "damping": 0.1, "coupling": 8.0}, TURN, PHASE),
        window((-pi, -9), (pi, 9)),
    ),
    "Paul trap": (made(paul_trap, {"damping": 0.05, "a": 0.1, "q": 0.4}, pi), Q2),
    "MEMS": (
        forced(mems, damping=0.1, bias=0.05, force=0.03, omega=0.9),
        window((-0.5, -0.5), (0.5, 0.5)),
    ),
    "Morse": (forced(morse, damping=0.2, force=0.1, omega=0.8), window((-0.5, -0.4), (1, 0.4))),
    "Toda": (forced(toda, damping=0.1, force=0.5, omega=1.0), Q2),
    "Rayleigh": (forced(rayleigh, mu=1.0, force=1.0, omega=1.1), Q2),
    "two wells": (
        made(
            coupled_duffings,
            {"damping": 0.3, "force": 0.15, "omega": 1.0, "coupling": 0.1},
            by_frequency,
            tuple("abuv"),
        ),
        CellGrid((-1.5, -1.5, -1, -1), (1.5, 1.5, 1, 1), (5, 5, 2, 2)),
    ),
    "three wells": (
        made(
            coupled_duffings,
            {"damping": 0.3, "force": 0.15, "omega": 1.0, "coupling": 0.1},
            by_frequency,
            tuple("abcuvw"),
        ),
        CellGrid((-1.5,) * 3 + (-1,) * 3, (1.5,) * 3 + (1,) * 3, (4, 4, 4, 1, 1, 1)),
    ),
    "SIR": (
        made(sir, {"mu": 0.02, "beta": 1575.0, "gamma": 100.0, "season": 0.05}, 1.0, ("logS", "logI")),
        window((log(0.03), log(1e-5)), (log(0.3), log(1e-2)), 6),
    ),
    "SEIR": (
        made(
            seir,
            {"mu": 0.02, "beta": 1800.0, "sigma": 35.84, "gamma": 100.0, "season": 0.05},
            1.0,
            ("logS", "logE", "logI"),
        ),
        CellGrid((log(0.03), log(1e-5), log(1e-5)), (log(0.3), log(1e-2), log(1e-2)), (4, 3, 3)),
    ),
    "predator and prey": (
        made(predator_prey, {"r": 3.0, "season": 0.3, "half": 0.5, "death": 0.25}, 1.0, ("prey", "predator")),
        window((0.05, 0.05), (1.2, 1.5)),
    ),
}

BRANCHING = {
    "soft impact": (forced(soft_impact, k=20.0, damping=0.1, force=0.6, omega=0.8), Q2),
    "gear backlash": (
        forced(backlash, load=0.1, damping=0.1, force=0.5, omega=0.7),
        window((-3, -2), (3, 2)),
    ),
    "bilinear spring": (forced(bilinear, k=4.0, damping=0.1, force=0.5, omega=1.2), Q2),
    "forced Chua": (
        made(
            chua,
            {"a": -1.02, "b": -0.55, "beta": 1.0, "nu": 0.015, "force": 0.05, "omega": 0.72},
            by_frequency,
            ("v", "i"),
        ),
        Q2,
    ),
    "dry friction": (forced(dry_friction, friction=0.3, force=1.0, omega=0.6), Q2),
    "stick and slip on a belt": (
        ForcedSystem(belt, {"friction": 1.0, "belt": 0.5}, 5.0, QV),
        window((-3, -2), (3, 2), 4),
    ),
    "square wave": (made(square_driven, {"damping": 0.3, "force": 0.1}, TURN), Q2),
    "buck converter": (
        made(buck, {"supply": 20.0}, 400e-6, ("v", "i")),
        window((11.5, 0.4), (12.5, 0.7)),
    ),
    "boost converter": (made(boost, {"supply": 1.0, "duty": 0.4}, 1.0, ("v", "i")), window((0, 0), (3, 3))),
}

STIFF = {
    "van der Pol, mu 20": (
        forced(van_der_pol, mu=20.0, force=10.0, omega=0.2),
        window((-2, -2), (2, 2), 4),
    ),
    "van der Pol, mu 100": (
        forced(van_der_pol, mu=100.0, force=50.0, omega=0.05),
        window((-2, -2), (2, 2), 4),
    ),
}

IMPACTS = {
    "hard impact": (
        made(linear, {"damping": 0.1, "force": 1.0, "omega": 0.8, "wall": 0.5, "e": 0.7}, by_frequency, impacts=[STOP]),
        window((-2, -2), (0.5, 2)),
    ),
    "ball on a table": (
        made(free_fall, {"amplitude": 2.0, "e": 0.5}, TURN, ("h", "v"), impacts=[Impact(table_gap, table_reset)]),
        window((2, -2), (6, 2)),
    ),
    "kicked rotor": (
        made(free_rotor, {"damping": 0.3, "kick": 1.0}, 1.0, PHASE, impacts=[KICK]),
        ANGLE,
    ),
}
