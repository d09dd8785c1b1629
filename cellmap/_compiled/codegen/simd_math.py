"""Branch-free elementary functions as instructions, for vectors of lanes.

Each function has the name and the meaning of its namesake in :mod:`math`, of an operator or of a NumPy function, costs
some twenty multiplications, and is right to about two units in the last place.  Arguments are reduced after Cody and
Waite (1980): the divisor is split into parts whose leading ones have so few bits that the product with the quotient is
exact.  The polynomials are Chebyshev fits, with relative error below 3e-19 before rounding.

What is called ``seldom`` is the C library, for the lanes that meet a condition, and not at all where none does.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from math import inf, nan

from .instructions import Value, number, value_of, where

# pi = PI_1 + PI_2 + PI_3; the first two have 33 significant bits each, so n * PI_1 is exact for abs(n) < 2**20.
PI_1 = 3.1415926534682512
PI_2 = 1.2154201012607932e-10
PI_3 = 4.044532497591901e-21
INVERSE_PI = 0.3183098861837907
LARGEST_ANGLE = 3.0e6
ROUNDING = 1.5 * 2.0**52  # the last bits of sums with it are units

LN2_1 = 0.6931471804855391
LN2_2 = 7.440617110012397e-11
INVERSE_LN2 = 1.4426950408889634

# fmt: off
_EXPONENTIAL = (
    2.0921669745705126e-09, 2.5114995257692174e-08, 2.7557251634312097e-07, 2.7557224580477215e-06,
    2.480158735040281e-05, 0.00019841269909626037, 0.0013888888888871753, 0.008333333333309335, 0.04166666666666669,
    0.16666666666666702, 0.5,
)
_ARC_TANGENT = (
    0.016285756855221028, -0.034570561981427744, 0.04551593220626549, -0.05230454270650244, 0.05878928997834775,
    -0.06666424885738255, 0.07692296375032143, -0.09090908753500877, 0.11111111105155447, -0.14285714285659828,
    0.19999999999999804, -0.3333333333333333,
)
# fmt: on
"""Coefficients of polynomials, highest power first."""


def sqrt(x: Value) -> Value:
    """Square root; NaN below zero."""
    return x.function.intrinsic("sqrt", x)


def floor(x: Value) -> Value:
    """Largest whole number not above x."""
    return x.function.intrinsic("floor", x)


def copysign(x: Value | float, y: Value) -> Value:
    """Value of x with the sign of y."""
    return y.function.intrinsic("copysign", value_of(x), y)


def with_sign(x: Value, y: Value) -> Value:
    """Value of x with the sign of y; NaN where y is NaN, whose sign bit is a matter of the processor."""
    return where(y.equals(y), copysign(x, y), y)


def _rounded(x: Value) -> tuple[Value, Value]:
    """Return the nearest whole number of a small one, and the sum whose last bit says whether it is odd."""
    shifted = x + ROUNDING
    return shifted - ROUNDING, shifted


def _sine_of_remainder(r: Value, half_periods: Value) -> Value:
    # In pairs and pairs of pairs (Estrin 1960): fewer multiply-adds wait for one another than in Horner's rule.
    z = r * r
    z2 = z * z
    z4 = z2 * z2
    low = (0.008333333333333186 * z - 0.16666666666666666) + z2 * (2.7557319211166023e-06 * z - 0.0001984126984120831)
    high = (1.6058940571674158e-10 * z - 2.5052106884617687e-08) + z2 * (
        2.721486441670626e-15 * z - 7.643018364326954e-13
    )
    s = low + z4 * high
    return r.function.negative_if_odd(r + r * z * s, half_periods)


def sin(x: Value) -> Value:
    """Sine."""
    n, shifted = _rounded(x * INVERSE_PI)
    r = ((x - n * PI_1) - n * PI_2) - n * PI_3
    s = _sine_of_remainder(r, shifted)
    return _seldom(abs(x) >= LARGEST_ANGLE, "sin", s, x)


def cos(x: Value) -> Value:
    """Cosine."""
    n, shifted = _rounded(x * INVERSE_PI - 0.5)
    m = n + 0.5
    r = ((x - m * PI_1) - m * PI_2) - m * PI_3
    s = -_sine_of_remainder(r, shifted)
    return _seldom(abs(x) >= LARGEST_ANGLE, "cos", s, x)


def tan(x: Value) -> Value:
    """Tangent."""
    return sin(x) / cos(x)


def _scaled_exponential(x: Value, doublings: float) -> Value:
    """Return 2**doublings times the exponential of x, for one or two doublings or halvings."""
    above = where(number(-746.0) > x, -746.0, x)
    bounded = where(number(711.0) < above, 711.0, above)
    n = floor(bounded * INVERSE_LN2 + 0.5)
    r = (bounded - n * LN2_1) - n * LN2_2
    s = _polynomial(r, _EXPONENTIAL)
    # 2**n in two factors: neither 2**1024 nor 2**-1074 is the product of a mantissa and a power that a double can hold.
    half, power = floor(0.5 * n), x.function.power_of_two
    y = (1.0 + (r + r * r * s)) * power(half) * power(n - half + doublings)
    return where(x.equals(x), y, nan)


def exp(x: Value) -> Value:
    """Exponential."""
    return _scaled_exponential(x, 0.0)


def sinh(x: Value) -> Value:
    """Hyperbolic sine."""
    a = abs(x)
    e = _scaled_exponential(a, -1.0)
    z = x * x
    small = x * (1.0 + z * (1.0 / 6.0 + z * (1.0 / 120.0 + z * (1.0 / 5040.0 + z * (1.0 / 362880.0 + z / 39916800.0)))))
    large = copysign(e - 0.25 / e, x)
    return where(a < 0.3, small, large)


def cosh(x: Value) -> Value:
    """Hyperbolic cosine."""
    e = _scaled_exponential(abs(x), -1.0)
    return e + 0.25 / e


def tanh(x: Value) -> Value:
    """Hyperbolic tangent."""
    a = abs(x)
    a = where(number(25.0) < a, 25.0, a)
    e = exp(-2.0 * a)
    ratio = sinh(x) / cosh(x)
    large = copysign((1.0 - e) / (1.0 + e), x)
    return where(abs(x) < 0.3, ratio, large)


def atan(x: Value) -> Value:
    """Arc tangent."""
    a = abs(x)
    r = where(a > 1.0, 1.0 / a, a)
    h = r / (1.0 + sqrt(1.0 + r * r))  # tangent of half the angle
    z = h * h
    s = _polynomial(z, _ARC_TANGENT)
    angle = 2.0 * (h + h * z * s)
    return copysign(where(a > 1.0, 1.5707963267948966 - angle, angle), x)


def fmin(x: Value | float, y: Value) -> Value:
    """Smaller of two numbers."""
    return where(value_of(x) < y, x, y)


def fmax(x: Value | float, y: Value) -> Value:
    """Larger of two numbers."""
    return where(value_of(x) > y, x, y)


LARGEST_QUOTIENT = 2.0**53  # quotient up to which rounding is off by one at most


def mod(x: Value, y: Value) -> Value:
    """Remainder x % y with the sign of y, as Python has it.

    It is exact, or rounded once, since the rounded quotient is the whole one or too large by one.
    """
    q = floor(x / y)
    large = (abs(q) >= LARGEST_QUOTIENT) | abs(y).equals(inf)
    r = _seldom(large, "fmod", _fused(-q, y, x), x, y)
    s = copysign(r, y)
    return where(s.differs(r), r + y, s)


def fmod(x: Value, y: Value) -> Value:
    """Remainder with the sign of x."""
    a = abs(x)
    b = abs(y)
    q = floor(a / b)
    large = (q >= LARGEST_QUOTIENT) | b.equals(inf)
    r = _seldom(large, "fmod", _fused(-q, b, a), a, b)
    r = where(r < 0.0, r + b, r)
    return copysign(r, x)


def floordiv(x: Value, y: Value) -> Value:
    """Quotient x // y, as Python has it, which rounds large ones."""
    q = floor(x / y)
    large = (abs(q) >= 0.125 * LARGEST_QUOTIENT) | abs(y).equals(inf)
    r = _seldom(large, "fmod", _fused(-q, y, x), x, y)
    d = where(large, (x - r) / y, q)
    d = where(copysign(r, y).differs(r), d - 1.0, d)
    f = floor(d)
    f = where(d - f > 0.5, f + 1.0, f)
    return where(f.equals(0.0), copysign(f, x / y), f)


def _polynomial(x: Value, coefficients: Sequence[float]) -> Value:
    """Evaluate a polynomial by Horner's rule."""
    first, second, *others = coefficients
    return functools.reduce(lambda s, c: s * x + c, others, first * x + second)


def _seldom(condition: Value, name: str, otherwise: Value, *arguments: Value) -> Value:
    """Call a function of the C library where a condition holds."""
    return condition.function.seldom(condition, name, list(arguments), otherwise)


def _fused(x: Value, y: Value, z: Value) -> Value:
    """Multiply and add with one rounding."""
    return x.function.intrinsic("fma", x, y, z)
