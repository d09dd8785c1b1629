"""Maps and windows that several tests of sets look at."""

from math import pi

import systems
from cellmap import CellGrid, angle, discrete_map, stroboscopic_map
from cellmap.sets import BoxSet

HALVES = discrete_map(lambda x, p: (x[0] / 2,), {}, ("x",), name="halves")
AWAY = discrete_map(lambda x, p: (x[0] + 10,), {}, ("x",))
CUBIC = discrete_map(lambda x, p: (1.5 * x[0] - x[0] ** 3 / 2,), {}, ("x",))
DOUBLE = discrete_map(lambda x, p: (2 * x[0] % 1,), {}, ("x",))
SADDLE = discrete_map(lambda x, p: (2.5 * x[0], 0.3 * x[1]), {}, ("x", "y"), name="saddle")
TURNING = discrete_map(lambda x, p: (x[0] + p.by,), {"by": pi / 2}, (angle("theta"),), name="turning")
POWERS = discrete_map(lambda x, p: (x[0] ** 1001,), {}, ("x",))
"""1.4 and more diverge, beyond 1e100; 1.0 stays, and 1.1 only leaves the window."""
TWO_WELLS = stroboscopic_map(systems.two_well_duffing())
FIVE = stroboscopic_map(systems.duffing_oscillator(0.08, 0.0, 1.0, 0.2, 1.0))
"""Duffing's oscillator with five attractors, all in [-1.8, 1.8] x [-1.3, 1.7]."""
HENON = systems.henon_map()
FIVE_CELLS = CellGrid((-1,), (1,), (5,))


def newton(x, p):
    """Newton's method for x^2 = 1 in the complex plane; the boundary is the imaginary axis."""
    size = 2 * (x[0] ** 2 + x[1] ** 2)
    return x[0] / 2 + x[0] / size, x[1] / 2 - x[1] / size


NEWTON = discrete_map(newton, {}, ("re", "im"))


def line(n: int, lower: float = 0.0, upper: float = 1.0) -> BoxSet:
    return BoxSet.full(CellGrid((lower,), (upper,), (n,)))
