"""Multipliers of exactly 1 and -1: cycles that attract by a power of time are no continua, whatever their order."""

import re

import numpy as np
import pytest

from cellmap import CellGrid, ForcedSystem, angle, discrete_map, find_basins, stroboscopic_map
from cellmap.attractors.kinds.creeping import orders_of
from cellmap.attractors.kinds.transients import UnsettledWarning
from cellmap.orbits import Kind

WIDE = 0.8


def beside(power, sign=1.0):
    """Beside x = 0, the only periodic point within abs(x) < 1, x - x^k ~ ((k - 1) n)^(-1/(k - 1)) after n steps."""
    powers = {  # written out, for the powers of traced formulas are numbers
        3: lambda x, p: (p.s * (x[0] - x[0] ** 3) + 0.2 * x[1], 0.5 * x[1]),
        5: lambda x, p: (p.s * (x[0] - x[0] ** 5) + 0.2 * x[1], 0.5 * x[1]),
        9: lambda x, p: (p.s * (x[0] - x[0] ** 9) + 0.2 * x[1], 0.5 * x[1]),
    }
    return discrete_map(powers[power], {"s": sign}, ("x", "y"))


HENON = discrete_map(lambda x, p: (1.0 - 0.3675 * x[0] ** 2 + x[1], 0.3 * x[0]), {}, ("x", "y"))  # 3 (1 - 0.3)^2 / 4
QUINTIC = stroboscopic_map(ForcedSystem(lambda t, x, p: (x[1], -0.3 * x[1] - x[0] ** 5), {}, 1.0, ("q", "v")))


@pytest.mark.parametrize(
    ("degenerate", "half", "order"),
    [
        (beside(5), 0.05, None),
        (beside(9), WIDE, "0.1[23]"),
        (beside(5, -1.0), WIDE, "0.25"),
        (QUINTIC, 1.0, "0.25"),
        (HENON, 2.0, "0.51?"),
    ],
)
def test_no_continuum_and_the_order_is_told(degenerate, half, order):
    """As the normal form says: x_n is like n^(-1/(k - 1)), also at a flip."""
    with pytest.warns(UnsettledWarning) as caught:
        found = find_basins(degenerate, CellGrid((-half, -half), (half, half), (4, 4)), max_periods=300)
    assert found.attractors == ()
    assert order is None or re.search(rf"like n\^-{order}[; ]", f"{caught[0].message} ")


@pytest.mark.parametrize(("power", "sign"), [(3, 1.0), (5, 1.0), (5, -1.0), (9, 1.0)])
def test_orders_are_those_of_normal_forms(power, sign):
    begin = beside(power, sign).iterate([[0.6, 0.0], [0.3, 0.1]], 500).points
    assert orders_of(beside(power, sign), begin, np.ones(2)) == pytest.approx(1.0 / (power - 1), abs=0.02)


def edge(x, p):
    """Rest where abs(x) <= 0.3; from outside x comes back, by a part of the distance or by its square."""
    out = abs(x[0]) - 0.3 if abs(x[0]) > 0.3 else 0.0
    return x[0] - (p.a * out + p.b * out * out) * (1.0 if x[0] > 0 else -1.0) + 0.2 * x[1], 0.5 * x[1]


@pytest.mark.parametrize(("turns", "steps"), [(34, 89), pytest.param(211, 513, marks=pytest.mark.thorough)])
def test_a_rigid_rotation_by_a_rational_number_is_a_continuum_of_cycles(turns, steps):
    """Each orbit closes after as many steps as the denominator says."""
    rotation = discrete_map(
        lambda x, p: (x[0] + 2.0 * np.pi * p.w, 0.5 * x[1] + 0.5), {"w": turns / steps}, (angle("a"), "r")
    )
    found = find_basins(rotation, CellGrid((0, 0), (2 * np.pi, 2), (4, 4)))
    assert [(a.kind, a.period) for a in found.attractors] == [(Kind.CONTINUUM, steps)] and (found.labels == 0).all()


def ring(x, p):
    factor = 1.5 - 0.5 * (x[0] * x[0] + x[1] * x[1])
    return x[0] * factor, x[1] * factor


@pytest.mark.parametrize(
    ("function", "params", "kind"),
    [
        (edge, {"a": 0.5, "b": 0.0}, Kind.EQUILIBRIA),
        (edge, {"a": 0.0, "b": 0.5}, Kind.EQUILIBRIA),
        (lambda x, p: (-x[0] + 0.2 * x[1], 0.5 * x[1]), {}, Kind.CONTINUUM),
        (ring, {}, Kind.CONTINUUM),
    ],
)
def test_continua_are_continua(function, params, kind):
    """Each of their points is periodic by the formula."""
    found = find_basins(discrete_map(function, params, ("x", "y")), CellGrid((-1, -1), (1, 1), (12, 12)))
    assert [a.kind for a in found.attractors] == [kind] and (found.labels == 0).all()
