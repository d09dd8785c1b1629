"""Numbers printed in manuals, tests and tables of other programs, to all their digits."""

from math import cos, pi

import numpy as np
import pytest

from cellmap import ForcedSystem
from cellmap.bifurcations import critical_values

# Doedel and Oldeman, AUTO-07P (manual, 2012): demo lrz, chapter on the Python interface, "print data".  The flow is
# seen once in a time of 0.5.


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
