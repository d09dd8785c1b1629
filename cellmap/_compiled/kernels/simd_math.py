"""Branch-free elementary functions that LLVM vectorises over lanes.

Each function has the name and the meaning of its namesake in :mod:`math`, costs some twenty multiplications, and is
right to about two units in the last place.  Arguments are reduced after Cody and Waite (1980): the divisor is split
into parts whose leading ones have so few bits that the product with the quotient is exact.  The polynomials are
Chebyshev fits, with relative error below 3e-19 before rounding.

Where ``math.f(x) if condition else y`` stands, the C library is called for the lanes that meet the condition, and not
at all where none does.
"""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np

from ..for_numba import ForNumba

# pi = PI_1 + PI_2 + PI_3; the first two have 33 significant bits each, so n * PI_1 is exact for abs(n) < 2**20.
PI_1 = 3.1415926534682512
PI_2 = 1.2154201012607932e-10
PI_3 = 4.044532497591901e-21
INVERSE_PI = 0.3183098861837907
LARGEST_ANGLE = 3.0e6

LN2_1 = 0.6931471804855391
LN2_2 = 7.440617110012397e-11
INVERSE_LN2 = 1.4426950408889634


@ForNumba
def _sine_of_remainder(r, half_periods):
    # In pairs and pairs of pairs (Estrin 1960): fewer multiply-adds wait for one another than in Horner's rule.
    z = r * r
    z2 = z * z
    z4 = z2 * z2
    low = (0.008333333333333186 * z - 0.16666666666666666) + z2 * (2.7557319211166023e-06 * z - 0.0001984126984120831)
    high = (1.6058940571674158e-10 * z - 2.5052106884617687e-08) + z2 * (
        2.721486441670626e-15 * z - 7.643018364326954e-13
    )
    s = low + z4 * high
    sine = r + r * z * s
    return sine - 2.0 * sine * (half_periods - 2.0 * np.floor(0.5 * half_periods))


@ForNumba
def sin(x):
    """Sine."""
    n = np.floor(x * INVERSE_PI + 0.5)
    r = ((x - n * PI_1) - n * PI_2) - n * PI_3
    s = _sine_of_remainder(r, n)
    return math.sin(x) if abs(x) >= LARGEST_ANGLE else s


@ForNumba
def cos(x):
    """Cosine."""
    n = np.floor(x * INVERSE_PI)
    m = n + 0.5
    r = ((x - m * PI_1) - m * PI_2) - m * PI_3
    s = -_sine_of_remainder(r, n)
    return math.cos(x) if abs(x) >= LARGEST_ANGLE else s


# Where a call would keep numba from making vectors: pi in four parts, of which three have 26 significant bits each.
PI_IN_FOUR = (3.1415926218032837, 3.1786509424591713e-08, 1.2246467864107189e-16, 1.27366343270219e-24)
FARTHEST_ANGLE = 4.0e8


@ForNumba
def _remainder_in_four(x, m):
    return (((x - m * PI_IN_FOUR[0]) - m * PI_IN_FOUR[1]) - m * PI_IN_FOUR[2]) - m * PI_IN_FOUR[3]


@ForNumba
def _sin_without_calls(x):
    n = np.floor(x * INVERSE_PI + 0.5)
    s = _sine_of_remainder(_remainder_in_four(x, n), n)
    return s if abs(x) < FARTHEST_ANGLE else np.nan


@ForNumba
def _cos_without_calls(x):
    n = np.floor(x * INVERSE_PI)
    s = -_sine_of_remainder(_remainder_in_four(x, n + 0.5), n)
    return s if abs(x) < FARTHEST_ANGLE else np.nan


@ForNumba
def _tan_without_calls(x):
    return _sin_without_calls(x) / _cos_without_calls(x)


WITHOUT_CALLS = {"sin": _sin_without_calls, "cos": _cos_without_calls, "tan": _tan_without_calls}
"""Functions for numba's lanes, NaN where angles are too large for them."""


@ForNumba
def tan(x):
    """Tangent."""
    return sin(x) / cos(x)


@ForNumba
def _power_of_two(n):
    return np.int64((np.int64(n) + 1023) << 52).view(np.float64)


@ForNumba
def _scaled_exponential(x, doublings):
    """Return 2**doublings times the exponential of x, for one or two doublings or halvings."""
    bounded = min(max(x, -746.0), 711.0)
    n = np.floor(bounded * INVERSE_LN2 + 0.5)
    r = (bounded - n * LN2_1) - n * LN2_2
    s = 2.0921669745705126e-09
    s = s * r + 2.5114995257692174e-08
    s = s * r + 2.7557251634312097e-07
    s = s * r + 2.7557224580477215e-06
    s = s * r + 2.480158735040281e-05
    s = s * r + 0.00019841269909626037
    s = s * r + 0.0013888888888871753
    s = s * r + 0.008333333333309335
    s = s * r + 0.04166666666666669
    s = s * r + 0.16666666666666702
    s = s * r + 0.5
    # 2**n in two factors: neither 2**1024 nor 2**-1074 is the product of a mantissa and a power that a double can hold.
    half = np.floor(0.5 * n)
    y = (1.0 + (r + r * r * s)) * _power_of_two(half) * _power_of_two(n - half + doublings)
    return y if x == x else np.nan


@ForNumba
def exp(x):
    """Exponential."""
    return _scaled_exponential(x, 0.0)


@ForNumba
def sinh(x):
    """Hyperbolic sine."""
    a = abs(x)
    e = _scaled_exponential(a, -1.0)
    z = x * x
    small = x * (1.0 + z * (1.0 / 6.0 + z * (1.0 / 120.0 + z * (1.0 / 5040.0 + z * (1.0 / 362880.0 + z / 39916800.0)))))
    large = np.copysign(e - 0.25 / e, x)
    return small if a < 0.3 else large


@ForNumba
def cosh(x):
    """Hyperbolic cosine."""
    e = _scaled_exponential(abs(x), -1.0)
    return e + 0.25 / e


@ForNumba
def tanh(x):
    """Hyperbolic tangent."""
    a = min(abs(x), 25.0)
    e = exp(-2.0 * a)
    ratio = sinh(x) / cosh(x)
    large = np.copysign((1.0 - e) / (1.0 + e), x)
    return ratio if abs(x) < 0.3 else large


@ForNumba
def atan(x):
    """Arc tangent."""
    a = abs(x)
    r = 1.0 / a if a > 1.0 else a
    h = r / (1.0 + np.sqrt(1.0 + r * r))  # tangent of half the angle
    z = h * h
    s = 0.016285756855221028
    s = s * z - 0.034570561981427744
    s = s * z + 0.04551593220626549
    s = s * z - 0.05230454270650244
    s = s * z + 0.05878928997834775
    s = s * z - 0.06666424885738255
    s = s * z + 0.07692296375032143
    s = s * z - 0.09090908753500877
    s = s * z + 0.11111111105155447
    s = s * z - 0.14285714285659828
    s = s * z + 0.19999999999999804
    s = s * z - 0.3333333333333333
    angle = 2.0 * (h + h * z * s)
    return np.copysign(1.5707963267948966 - angle if a > 1.0 else angle, x)


@ForNumba
def sqrt(x):
    """Square root; NaN below zero."""
    return np.sqrt(x)


@ForNumba
def fabs(x):
    """Absolute value."""
    return abs(x)


@ForNumba
def floor(x):
    """Largest whole number not above x, as a float."""
    return np.floor(x)


@ForNumba
def copysign(x, y):
    """Value of x with the sign of y."""
    return np.copysign(x, y)


@ForNumba
def fmin(x, y):
    """Smaller of two numbers."""
    return x if x < y else y


@ForNumba
def fmax(x, y):
    """Larger of two numbers."""
    return x if x > y else y


def fma(x, y, z):
    """Fused multiply-add, which code for lanes has as an instruction."""
    return float(Fraction(x) * Fraction(y) + Fraction(z))


LARGEST_QUOTIENT = 2.0**53  # up to which a rounded quotient is off by one at most


def mod(x, y):
    """Remainder x % y with the sign of y, as Python has it.

    It is exact, or rounded once, since the rounded quotient is the whole one or too large by one.
    """
    q = np.floor(x / y)
    large = abs(q) >= LARGEST_QUOTIENT or abs(y) == np.inf
    r = math.fmod(x, y) if large else fma(-q, y, x)
    s = np.copysign(r, y)
    return r + y if s != r else s


def fmod(x, y):
    """Remainder with the sign of x."""
    a = abs(x)
    b = abs(y)
    q = np.floor(a / b)
    large = q >= LARGEST_QUOTIENT or b == np.inf
    r = math.fmod(a, b) if large else fma(-q, b, a)
    r = r + b if r < 0.0 else r
    return np.copysign(r, x)


def floordiv(x, y):
    """Quotient x // y, as Python has it, which rounds large ones."""
    q = np.floor(x / y)
    large = abs(q) >= 0.125 * LARGEST_QUOTIENT or abs(y) == np.inf
    r = math.fmod(x, y) if large else fma(-q, y, x)
    d = (x - r) / y if large else q
    d = d - 1.0 if np.copysign(r, y) != r else d
    f = np.floor(d)
    f = f + 1.0 if d - f > 0.5 else f
    return np.copysign(f, x / y) if f == 0.0 else f
