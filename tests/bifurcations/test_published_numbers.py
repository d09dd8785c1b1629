"""Numbers printed in manuals, tests and tables of other programs, to all their digits."""

from math import cos, pi

import numpy as np
import pytest
from branch_kinds import NEIMARK_SACKER
from cases import branch_of

from cellmap import ForcedSystem
from cellmap.bifurcations import critical_values
from cellmap.maps import flow_map

# Doedel and Oldeman, AUTO-07P (manual, 2012): demo lrz, chapter on the Python interface, "print data".  The flow is
# seen once in a time of 0.5.


@pytest.mark.thorough
def test_the_lorenz_system_of_auto():
    def lorenz(t, x, p):
        return 10.0 * (x[1] - x[0]), p.rho * x[0] - x[1] - x[0] * x[2], x[0] * x[1] - 8.0 / 3.0 * x[2]

    exact = flow_map(ForcedSystem(lorenz, {"rho": 20.0}, 0.5, ("x", "y", "z")), 0.5, rtol=1e-12, atol=1e-12)
    branch = branch_of(exact, [7.1, 7.1, 19.0], "rho", 2.0, 26.0, step=0.05)
    (hopf,) = branch.of_kind(NEIMARK_SACKER)
    printed = [f"{number:.5E}" for number in (hopf.value, *hopf.point)]
    assert printed == ["2.47368E+01", "7.95602E+00", "7.95602E+00", "2.37368E+01"]


# Mathieu's equation y'' + (a - 2 q cos 2t) y = 0 changes its stability at a_r(q) and b_r(q).  Abramowitz and Stegun,
# *Handbook of Mathematical Functions* (1964), with more digits from Wolfram in Burkardt, TEST_VALUES (2006), in
# mathieu_even_values and mathieu_odd_values; NAG Library Manual, Mark 29.2, results of the example program s22cac.

TABLES = [
    (5.0, [(-5.800046020851508, 14), (2.099460445486665, 14), (25.54997174998161, 13)]),
    (10.0, [(-2.382158235956956, 14), (27.70376873393928, 13)]),
    (2.0, [(-1.5140, 4), (-1.3907, 4), (2.3792, 4), (3.6722, 4), (5.1727, 4), (9.1406, 4), (9.3703, 4), (16.1277, 4)]),
]


@pytest.mark.parametrize(("q", "printed"), TABLES)
def test_characteristic_values_of_mathieus_equation(q, printed):
    system = ForcedSystem(
        lambda t, x, p: (x[1], -(p.a - 2.0 * p.q * cos(2.0 * t)) * x[0]), {"a": 1.0, "q": q}, pi, ("y", "v")
    )
    found = np.array([c.value for c in critical_values(system, [0.0, 0.0], "a", -6.0, 28.0)])
    for value, digits in printed:
        assert np.abs(found - value).min() <= max(0.6 * 10.0**-digits, 1e-11), value
