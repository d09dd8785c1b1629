"""Right-hand sides of textbooks, as a reader would write them, with no word on how to integrate them."""

from __future__ import annotations

from math import cos, exp, pi, sin

import numpy as np

TAU = 2 * pi


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
    beta = p.beta * (1 + p.season * cos(TAU * t))
    return p.mu / s - p.mu - beta * i, beta * s - p.gamma - p.mu


def seir(t, x, p):
    s, e, i = exp(x[0]), exp(x[1]), exp(x[2])
    beta = p.beta * (1 + p.season * cos(TAU * t))
    return p.mu / s - p.mu - beta * i, beta * s * i / e - p.sigma - p.mu, p.sigma * e / i - p.gamma - p.mu


def predator_prey(t, x, p):
    prey, predator = x
    growth = p.r * (1 + p.season * sin(TAU * t))
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
