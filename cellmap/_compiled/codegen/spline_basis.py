"""B-splines of a cell as polynomials, and how their coefficients lie in memory."""

from __future__ import annotations

import functools
from fractions import Fraction
from math import comb

WIDTH = 4
"""Doubles in a vector of coefficients.  Rows are padded to a multiple of it by weights of zero, so tables need WIDTH
spare doubles."""


@functools.cache
def basis_polynomials(order: int) -> tuple[tuple[float, ...], ...]:
    """Coefficients, lowest power first, of the order + 1 B-splines that live in a cell, as polynomials on [0, 1).

    The k-th is the cardinal B-spline of the given order on its (order - k)-th unit interval (Schoenberg 1946).
    """
    rows = []
    for k in range(order + 1):
        row = [Fraction(0)] * (order + 1)
        # B(u) = sum_j (-1)^j C(order+1, j) (u - j)_+^order / order!  at  u = f + order - k.
        for j in range(order - k + 1):
            shift = order - k - j
            for power in range(order + 1):
                row[power] += Fraction((-1) ** j * comb(order + 1, j) * comb(order, power) * shift ** (order - power))
        factorial = Fraction(1)
        for m in range(2, order + 1):
            factorial *= m
        rows.append(tuple(float(c / factorial) for c in row))
    return tuple(rows)
