"""Systems of textbooks, with the initial conditions of their basins."""

from __future__ import annotations

from math import cos, log, pi, sin

from right_hand_sides import (
    backlash,
    beads,
    belt,
    bilinear,
    boost,
    brusselator,
    bubble,
    buck,
    chua,
    coupled_duffings,
    dry_friction,
    duffing,
    fitzhugh_nagumo,
    free_fall,
    free_rotor,
    hardening,
    helmholtz,
    hodgkin_huxley,
    inverted,
    josephson,
    linear,
    mems,
    morse,
    paul_trap,
    pendulum,
    predator_prey,
    rayleigh,
    rubbing_rotor,
    seir,
    sir,
    soft_impact,
    square_driven,
    swing,
    tanks,
    toda,
    van_der_pol,
)

from cellmap import CellGrid, ForcedSystem, angle
from cellmap.maps import Impact

TAU = 2 * pi


def by_frequency(p):
    return TAU / p.omega


STOP = Impact(lambda t, x, p: p.wall - x[0], lambda t, x, p: (x[0], -p.e * x[1]))


def table_gap(t, x, p):
    return x[0] - p.amplitude * cos(t)


def table_reset(t, x, p):
    speed = -p.amplitude * sin(t)
    return x[0], speed - p.e * (x[1] - speed)


KICK = Impact(lambda t, x, p: -sin(TAU * t), lambda t, x, p: (x[0], x[1] + p.kick * sin(x[0])))


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
    "inverted pendulum": (made(inverted, {"damping": 0.1, "gravity": 0.02, "shake": 0.4}, TAU, PHASE), ANGLE),
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
        made(swing, {"power": 1.0, "damping": 0.1, "coupling": 8.0}, TAU, PHASE),
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
    "square wave": (made(square_driven, {"damping": 0.3, "force": 0.1}, TAU), Q2),
    "buck converter": (
        made(buck, {"supply": 20.0}, 400e-6, ("v", "i")),
        window((11.5, 0.4), (12.5, 0.7)),
    ),
    "Hodgkin-Huxley": (
        made(hodgkin_huxley, {"pulse": 15.0, "width": 2.0, "period": 12.0}, lambda p: p.period, tuple("vmhn")),
        CellGrid((-80, 0.01, 0.1, 0.2), (-20, 0.9, 0.7, 0.7), (4, 3, 3, 2)),
    ),
    "two tanks": (
        made(tanks, {"k": 0.5, "out": 0.4, "inflow": 0.3, "period": 10.0}, lambda p: p.period, ("a", "b")),
        window((0.1, 0.1), (3, 3)),
    ),
    "column of beads": (
        forced(beads, tuple("abcuvw"), shake=0.1, omega=1.5, gravity=0.2, damping=0.3),
        CellGrid((-0.5, -0.6, -0.7, -1, -1, -1), (0.5, 0.6, 0.7, 1, 1, 1), (4, 4, 4, 1, 1, 1)),
    ),
    "rubbing rotor": (
        forced(rubbing_rotor, tuple("abuv"), 0.9, gap=1.0, stiffness=25.0, mu=0.05, damping=0.2, eccentricity=0.6),
        CellGrid((-1,) * 4, (1,) * 4, (4, 4, 3, 3)),
    ),
    "boost converter": (made(boost, {"supply": 1.0, "duty": 0.4}, 1.0, ("v", "i")), window((0, 0), (3, 3))),
}

STIFF = {
    "van der Pol, mu 20": (
        forced(van_der_pol, mu=20.0, force=10.0, omega=0.2),
        window((-2, -2), (2, 2), 4),
    ),
    "bubble": (
        made(
            bubble,
            {
                "ambient": 101325.0,
                "tension": 0.0725,
                "radius": 1e-5,
                "polytropic": 1.4,
                "sound": 4e4,
                "time": 5e-6,
                "density": 998.0,
                "viscosity": 1e-3,
            },
            1.0,
            ("r", "v"),
        ),
        window((0.7, -2), (1.5, 2), 6),
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
        made(free_fall, {"amplitude": 2.0, "e": 0.5}, TAU, ("h", "v"), impacts=[Impact(table_gap, table_reset)]),
        window((2, -2), (6, 2)),
    ),
    "kicked rotor": (
        made(free_rotor, {"damping": 0.3, "kick": 1.0}, 1.0, PHASE, impacts=[KICK]),
        ANGLE,
    ),
}
