"""Right-hand sides of textbooks, as a reader would write them, with no word on how to integrate them."""

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


def opening(v, width):
    """Rate at which gates of Hodgkin and Huxley (1952) open: v/(exp(v/width) - 1), with its limit at zero."""
    if abs(v / width) < 1e-6:
        return width * (1 - v / width / 2)
    return v / (exp(v / width) - 1)


def hodgkin_huxley(t, x, p):
    """Squid axon with a pulse of current in each period."""
    v, m, h, n = x
    current = p.pulse if t % p.period < p.width else 0.0
    a_m, b_m = 0.1 * opening(-(v + 40), 10), 4 * exp(-(v + 65) / 18)
    a_h, b_h = 0.07 * exp(-(v + 65) / 20), 1 / (1 + exp(-(v + 35) / 10))
    a_n, b_n = 0.01 * opening(-(v + 55), 10), 0.125 * exp(-(v + 65) / 80)
    ions = 120 * m**3 * h * (v - 50) + 36 * n**4 * (v + 77) + 0.3 * (v + 54.4)
    return current - ions, a_m * (1 - m) - b_m * m, a_h * (1 - h) - b_h * h, a_n * (1 - n) - b_n * n


def tanks(t, x, p):
    """Two tanks with orifices (Torricelli 1643): flows go with square roots of differences of level."""
    a, b = x
    between = p.k * np.sign(a - b) * np.sqrt(abs(a - b))
    return p.inflow * (1 + sin(TAU * t / p.period)) - between, between - p.out * np.sqrt(max(b, 0.0))


def beads(t, x, p):
    """Column of beads on a shaken plate, with contacts of Hertz (1882): force to the power 3/2 of the overlap."""
    half = len(x) // 2
    q, v = x[:half], x[half:]
    levels = (p.shake * sin(p.omega * t), *q)
    forces = [max(levels[k] - levels[k + 1], 0.0) ** 1.5 for k in range(half)] + [0.0]
    return (*v, *(forces[k] - forces[k + 1] - p.gravity - p.damping * v[k] for k in range(half)))


def rubbing_rotor(t, x, p):
    """Jeffcott rotor that touches its stator, with friction along the contact."""
    a, b, va, vb = x
    r, fa, fb = np.hypot(a, b), 0.0, 0.0
    if r > p.gap:
        push = p.stiffness * (r - p.gap) / r
        fa, fb = -push * (a - p.mu * b), -push * (p.mu * a + b)
    drive = p.eccentricity * p.omega**2
    return (
        va,
        vb,
        fa - a - p.damping * va + drive * cos(p.omega * t),
        fb - b - p.damping * vb + drive * sin(p.omega * t),
    )


def bubble(t, x, p):
    """Rayleigh's bubble in a sound field (Plesset 1949): radius in its own at rest, time in periods of the sound."""
    r, v = x
    inside = (p.ambient + 2 * p.tension / p.radius) * r ** (-3 * p.polytropic)
    outside = p.ambient + p.sound * sin(TAU * t) + 2 * p.tension / (p.radius * r) + 4 * p.viscosity * v / (r * p.time)
    return v, ((p.time / p.radius) ** 2 / p.density * (inside - outside) - 1.5 * v * v) / r


# --- impacts


def free_fall(t, x, p):
    return x[1], -1.0 + 0.0 * x[0]


def linear(t, x, p):
    q, v = x
    return v, -q - p.damping * v + p.force * cos(p.omega * t)


def free_rotor(t, x, p):
    return x[1], -p.damping * x[1]
