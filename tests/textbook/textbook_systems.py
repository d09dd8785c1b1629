"""Systems of textbooks, with the initial conditions of their basins."""

from math import cos, log, pi, sin

import right_hand_sides as rhs

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


def made(function, params, period, coordinates=QV, **options):
    return ForcedSystem(function, params, period, coordinates, **options)


def forced(function, coordinates=QV, omega=1.0, **params):
    """Driven at a frequency that is one of its parameters."""
    return ForcedSystem(function, {**params, "omega": omega}, by_frequency, coordinates)


SMOOTH = {
    "two-well Duffing": (forced(rhs.duffing, damping=0.25, force=0.2, omega=1.0), Q2),
    "hardening Duffing": (forced(rhs.hardening, damping=0.1, force=1.0, omega=1.6), Q2),
    "Helmholtz": (forced(rhs.helmholtz, damping=0.1, force=0.06, omega=0.85), window((-1, -1), (1, 1))),
    "driven pendulum": (forced(rhs.pendulum, PHASE, damping=0.2, force=1.66, omega=1.0), ANGLE),
    "inverted pendulum": (made(rhs.inverted, {"damping": 0.1, "gravity": 0.02, "shake": 0.4}, TAU, PHASE), ANGLE),
    "van der Pol, mu 1": (forced(rhs.van_der_pol, mu=1.0, force=1.0, omega=1.0), Q2),
    "van der Pol, mu 5": (forced(rhs.van_der_pol, mu=5.0, force=5.0, omega=0.7), Q2),
    "FitzHugh-Nagumo": (forced(rhs.fitzhugh_nagumo, current=0.5, force=0.4, omega=0.17), Q2),
    "Brusselator": (
        forced(rhs.brusselator, ("u", "v"), a=1.0, b=2.5, force=0.4, omega=1.0),
        window((0.1, 0.1), (3, 4)),
    ),
    "Josephson": (forced(rhs.josephson, PHASE, bias=0.5, force=0.4, damping=0.4, omega=0.8), ANGLE),
    "swing equation": (
        made(rhs.swing, {"power": 1.0, "damping": 0.1, "coupling": 8.0}, TAU, PHASE),
        window((-pi, -9), (pi, 9)),
    ),
    "Paul trap": (made(rhs.paul_trap, {"damping": 0.05, "a": 0.1, "q": 0.4}, pi), Q2),
    "MEMS": (forced(rhs.mems, damping=0.1, bias=0.05, force=0.03, omega=0.9), window((-0.5, -0.5), (0.5, 0.5))),
    "Morse": (forced(rhs.morse, damping=0.2, force=0.1, omega=0.8), window((-0.5, -0.4), (1, 0.4))),
    "Toda": (forced(rhs.toda, damping=0.1, force=0.5, omega=1.0), Q2),
    "Rayleigh": (forced(rhs.rayleigh, mu=1.0, force=1.0, omega=1.1), Q2),
    "two wells": (
        forced(rhs.coupled_duffings, tuple("abuv"), damping=0.3, force=0.15, coupling=0.1),
        CellGrid((-1.5, -1.5, -1, -1), (1.5, 1.5, 1, 1), (5, 5, 2, 2)),
    ),
    "three wells": (
        forced(rhs.coupled_duffings, tuple("abcuvw"), damping=0.3, force=0.15, coupling=0.1),
        CellGrid((-1.5,) * 3 + (-1,) * 3, (1.5,) * 3 + (1,) * 3, (4, 4, 4, 1, 1, 1)),
    ),
    "SIR": (
        made(rhs.sir, {"mu": 0.02, "beta": 1575.0, "gamma": 100.0, "season": 0.05}, 1.0, ("logS", "logI")),
        window((log(0.03), log(1e-5)), (log(0.3), log(1e-2)), 6),
    ),
    "SEIR": (
        made(
            rhs.seir,
            {"mu": 0.02, "beta": 1800.0, "sigma": 35.84, "gamma": 100.0, "season": 0.05},
            1.0,
            ("logS", "logE", "logI"),
        ),
        CellGrid((log(0.03), log(1e-5), log(1e-5)), (log(0.3), log(1e-2), log(1e-2)), (4, 3, 3)),
    ),
    "predator and prey": (
        made(rhs.predator_prey, {"r": 3.0, "season": 0.3, "half": 0.5, "death": 0.25}, 1.0, ("prey", "predator")),
        window((0.05, 0.05), (1.2, 1.5)),
    ),
}

BRANCHING = {
    "soft impact": (forced(rhs.soft_impact, k=20.0, damping=0.1, force=0.6, omega=0.8), Q2),
    "gear backlash": (forced(rhs.backlash, load=0.1, damping=0.1, force=0.5, omega=0.7), window((-3, -2), (3, 2))),
    "bilinear spring": (forced(rhs.bilinear, k=4.0, damping=0.1, force=0.5, omega=1.2), Q2),
    "forced Chua": (forced(rhs.chua, ("v", "i"), 0.72, a=-1.02, b=-0.55, beta=1.0, nu=0.015, force=0.05), Q2),
    "dry friction": (forced(rhs.dry_friction, friction=0.3, force=1.0, omega=0.6), Q2),
    "stick and slip on a belt": (
        ForcedSystem(rhs.belt, {"friction": 1.0, "belt": 0.5}, 5.0, QV),
        window((-3, -2), (3, 2), 4),
    ),
    "square wave": (made(rhs.square_driven, {"damping": 0.3, "force": 0.1}, TAU), Q2),
    "buck converter": (made(rhs.buck, {"supply": 20.0}, 400e-6, ("v", "i")), window((11.5, 0.4), (12.5, 0.7))),
    "Hodgkin-Huxley": (
        made(rhs.hodgkin_huxley, {"pulse": 15.0, "width": 2.0, "period": 12.0}, lambda p: p.period, tuple("vmhn")),
        CellGrid((-80, 0.01, 0.1, 0.2), (-20, 0.9, 0.7, 0.7), (4, 3, 3, 2)),
    ),
    "two tanks": (
        made(rhs.tanks, {"k": 0.5, "out": 0.4, "inflow": 0.3, "period": 10.0}, lambda p: p.period, ("a", "b")),
        window((0.1, 0.1), (3, 3)),
    ),
    "column of beads": (
        forced(rhs.beads, tuple("abcuvw"), shake=0.1, omega=1.5, gravity=0.2, damping=0.3),
        CellGrid((-0.5, -0.6, -0.7, -1, -1, -1), (0.5, 0.6, 0.7, 1, 1, 1), (4, 4, 4, 1, 1, 1)),
    ),
    "rubbing rotor": (
        forced(rhs.rubbing_rotor, tuple("abuv"), 0.9, gap=1.0, stiffness=25.0, mu=0.05, damping=0.2, eccentricity=0.6),
        CellGrid((-1,) * 4, (1,) * 4, (4, 4, 3, 3)),
    ),
    "boost converter": (made(rhs.boost, {"supply": 1.0, "duty": 0.4}, 1.0, ("v", "i")), window((0, 0), (3, 3))),
}

GAS = {"radius": 1e-5, "polytropic": 1.4}
LIQUID = {"ambient": 101325.0, "tension": 0.0725, "density": 998.0, "viscosity": 1e-3}

STIFF = {
    "van der Pol, mu 20": (forced(rhs.van_der_pol, mu=20.0, force=10.0, omega=0.2), window((-2, -2), (2, 2), 4)),
    "bubble": (
        made(rhs.bubble, {**GAS, **LIQUID, "sound": 4e4, "time": 5e-6}, 1.0, ("r", "v")),
        window((0.7, -2), (1.5, 2), 6),
    ),
    "van der Pol, mu 100": (forced(rhs.van_der_pol, mu=100.0, force=50.0, omega=0.05), window((-2, -2), (2, 2), 4)),
}

WALL = {"wall": 0.5, "e": 0.7}

IMPACTS = {
    "hard impact": (
        made(rhs.linear, {"damping": 0.1, "force": 1.0, "omega": 0.8, **WALL}, by_frequency, impacts=[STOP]),
        window((-2, -2), (0.5, 2)),
    ),
    "ball on a table": (
        made(rhs.free_fall, {"amplitude": 2.0, "e": 0.5}, TAU, ("h", "v"), impacts=[Impact(table_gap, table_reset)]),
        window((2, -2), (6, 2)),
    ),
    "kicked rotor": (made(rhs.free_rotor, {"damping": 0.3, "kick": 1.0}, 1.0, PHASE, impacts=[KICK]), ANGLE),
}
