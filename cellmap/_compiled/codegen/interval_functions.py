"""Enclosures of elementary functions over intervals.

The value at the midpoint is computed by a Taylor polynomial after a reduction of the argument, all of it by additions,
multiplications, divisions and square roots, so that its error has a proven bound; no function of the C library is
called.  The variation over the interval follows from the derivative.  The bounds of the errors at midpoints are entries
of :data:`cellmap._compiled.codegen.intervals.ROUNDING`; they are two to four times what is derived beside each
function, with u = 2^-53 and Horner's rule for n terms right to 2n u times the sum of their absolute values (Higham
2002, section 5.1).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import reduce
from math import factorial, inf, nan

from .expression import UntraceableError
from .instructions import Value, number, where
from .intervals import ROUNDING, Interval, fused, widened
from .simd_math import INVERSE_LN2, INVERSE_PI, LN2_1, LN2_2, PI_1, PI_2, PI_3, copysign, floor

_LARGEST_ANGLE = 1e6
_LARGEST_EXPONENT = 700.0
_DOUBLINGS = 4

_SINE = [(-1.0) ** n / factorial(2 * n + 1) for n in range(8, 0, -1)]
_COSINE = [(-1.0) ** n / factorial(2 * n) for n in range(8, 0, -1)]
_EXPONENTIAL = [1.0 / factorial(n) for n in range(13, 1, -1)]
_ARTANH = [1.0 / (2 * n + 1) for n in range(11, 0, -1)]
_ARCTAN = [(-1.0) ** n / (2 * n + 1) for n in range(13, 0, -1)]


def _polynomial(x: Value, coefficients: Sequence[float]) -> Value:
    first, second, *others = coefficients
    return reduce(lambda s, c: fused(x, s, number(c)), others, fused(x, first, number(second)))


def _at_most(value: Value, bound: float) -> Value:
    """Return the smaller one; NaN stays."""
    return where(value > bound, bound, value)


def _result(x: Interval, m: Value, relative: float, variation: Value | None, *further: Value) -> Interval:
    """Return the interval with a midpoint of some relative error, and a variation over the argument's interval."""
    return Interval(x.code, m, widened(fused(abs(m), relative, number(ROUNDING["underflow"])), variation, *further))


def _sine_and_cosine(m: Value) -> tuple[Value, Value]:
    """Return sine and cosine of numbers up to a million, right to 2^-49 of themselves and 1e-30; else NaN.

    k pi/2 is subtracted in three parts.  The first two have 33 bits and k has 20, so that products with them are exact.
    Three differences round by u abs(y) each; the third part is right to 1e-36 k.  Then abs(y) < 0.7855, the terms left
    out are below 1e-18, sin = y + y (z P) is off by 4 u abs(y), cos = 1 + z Q by 7.4 u, and both by 3 u abs(y) for y.
    """
    m = where(abs(m) <= _LARGEST_ANGLE, m, nan)
    k = floor(m * (2.0 * INVERSE_PI) + 0.5)
    y = ((m - k * (0.5 * PI_1)) - k * (0.5 * PI_2)) - k * (0.5 * PI_3)
    z = y * y
    s = fused(y, z * _polynomial(z, _SINE), y)
    c = fused(z, _polynomial(z, _COSINE), number(1.0))
    half, above = floor(0.5 * k), floor(0.5 * (k + 1.0))
    odd = k - 2.0 * half > 0.5
    of_sine, of_cosine = (1.0 - 2.0 * (q - 2.0 * floor(0.5 * q)) for q in (half, above))
    return of_sine * where(odd, c, s), of_cosine * where(odd, s, c)


_TINY = 1e-30


def _circular(x: Interval, value: Value, slope: Value) -> Interval:
    """Return sine or cosine, from the value and the derivative at the midpoint."""
    relative = ROUNDING["sine"]
    if x.r is None:
        return _result(x, value, relative, None, number(_TINY))
    # abs(f(x) - f(m)) is at most abs(f'(m)) r + r^2/2, r, and 2.
    r = _at_most(x.r, 2.0)
    steepness = fused(r, 0.5, abs(slope) * (1.0 + relative) + _TINY)
    return _result(x, value, relative, r * _at_most(steepness, 1.0), number(_TINY))


def sin(x: Interval) -> Interval:
    """Enclose the sine."""
    s, c = _sine_and_cosine(x.m)
    return _circular(x, s, c)


def cos(x: Interval) -> Interval:
    """Enclose the cosine."""
    s, c = _sine_and_cosine(x.m)
    return _circular(x, c, s)


def tan(x: Interval) -> Interval:
    """Enclose the tangent."""
    return sin(x) / cos(x)


def _exponential(m: Value) -> tuple[Value, Value]:
    """Return 2^n and q with exp(m) = 2^n (1 + q), for m from -700 to 700; NaN above, those of -700 below.

    y = m - n log 2, in two parts, is off by 2 u abs(y) and 1e-23.  With abs(y) < 0.3466 the terms left out are below
    2e-17 abs(y), and q = y + y^2 P is off by 9 u abs(q), 2^n (1 + q) by 5 u of itself.
    """
    m = where(m <= _LARGEST_EXPONENT, m, nan)
    m = where(m < -_LARGEST_EXPONENT, -_LARGEST_EXPONENT, m)
    n = floor(m * INVERSE_LN2 + 0.5)
    y = (m - n * LN2_1) - n * LN2_2
    return m.function.power_of_two(where(n.equals(n), n, 0.0)), fused(y * y, _polynomial(y, _EXPONENTIAL), y)


def _expm1(m: Value) -> Value:
    """Return exp(m) - 1 from 0 to 700, right to 2^-48 of itself; NaN above.

    For n = 0 it is q.  Else 2^n - 1 + 2^n q is above 0.41, and off by u for itself and 2^n 9 u abs(q), which is less
    than 20 u of it.
    """
    power, q = _exponential(m)
    return fused(power, q, power - 1.0)


def _growth(r: Value) -> Value:
    """Return a bound of exp(r) - 1 for r up to 16, else NaN: of r/16 it is r/16 + (r/16)^2, then doubled."""
    part = where(r <= 2.0**_DOUBLINGS, r, nan) * 2.0**-_DOUBLINGS
    grown = fused(part, part, part)
    for _ in range(_DOUBLINGS):
        grown = fused(grown, grown, 2.0 * grown)
    return grown


def exp(x: Interval) -> Interval:
    """Enclose the exponential."""
    power, q = _exponential(x.m)
    value, relative = fused(power, q, power), ROUNDING["exponential"]
    return _result(x, value, relative, None if x.r is None else (1.0 + relative) * value * _growth(x.r))


def sinh(x: Interval) -> Interval:
    """Enclose the hyperbolic sine: (a + a/(1 + a))/2 with a = exp(abs(x)) - 1, off by 1.5 times as much, and 3 u."""
    a = _expm1(x.size)
    return _hyperbolic(x, copysign(0.5 * (a + a / (1.0 + a)), x.m), 1.0 + a)


def cosh(x: Interval) -> Interval:
    """Enclose the hyperbolic cosine."""
    e = 1.0 + _expm1(x.size)
    return _hyperbolic(x, 0.5 * (e + 1.0 / e), e)


def _hyperbolic(x: Interval, value: Value, above: Value) -> Interval:
    """Return a function whose variation is at most cosh(m) (exp(r) - 1), given a value above that cosine."""
    relative = ROUNDING["hyperbolic"]
    return _result(x, value, relative, None if x.r is None else (1.0 + relative) * above * _growth(x.r))


def tanh(x: Interval) -> Interval:
    """Enclose the hyperbolic tangent: a/(a + 2) with a = exp(2 abs(x)) - 1, no less accurate than a, and 2 u."""
    a = _expm1(_at_most(2.0 * where(x.size < inf, x.size, nan), 80.0))
    value, relative = copysign(a / (a + 2.0), x.m), ROUNDING["hyperbolic"]
    if x.r is None:
        return _result(x, value, relative, None)
    # abs(f(x) - f(m)) is at most (1 - f(m)^2) r + 0.385 r^2, r, and 2.
    r = _at_most(x.r, 2.0)
    steepness = fused(r, 0.385, (1.0 - value * value) + 4.0 * relative)
    return _result(x, value, relative, r * _at_most(steepness, 1.0))


def sqrt(x: Interval) -> Interval:
    """Enclose the square root of intervals above zero; sqrt(x) - s = (x - s^2)/(sqrt(x) + s)."""
    value, relative = x.m.function.intrinsic("sqrt", x.m), ROUNDING["root"]
    least = x.m if x.r is None else x.m - x.r
    away = least > x.m * 2.0**-50
    root = where(away, value, nan)
    if x.r is None:
        return _result(x, root, relative, None)
    return _result(x, root, relative, x.r / (root + x.m.function.intrinsic("sqrt", least) * (1.0 - 2.0**-40)))


def log(x: Interval) -> Interval:
    """Enclose the logarithm of intervals above zero: n log 2 + 2 artanh(s) with s = (f - 1)/(f + 1).

    abs(s) < 0.1716 is off by 2 u of itself, terms left out are below 1e-18 of it, and the sum is off by 5 u.  n times
    the leading part of log 2 is exact, the rest is below 1e-7, and the result no smaller than half its parts.
    """
    n, f = x.m.function.exponent_and_mantissa(where(x.m > 1e-300, x.m, 1.0))
    high = f > 1.4142135623730951
    f, n = where(high, 0.5 * f, f), where(high, n + 1.0, n)
    s = (f - 1.0) / (f + 1.0)
    z = s * s
    part = 2.0 * fused(s, z * _polynomial(z, _ARTANH), s)
    value = n * LN2_1 + (n * LN2_2 + part)
    least = x.m if x.r is None else x.m - x.r
    away = (least > x.m * 2.0**-50) & (x.m > 1e-300) & (x.m < inf)
    return _result(
        x, where(away, value, nan), ROUNDING["logarithm"], None if x.r is None else where(away, x.r / least, nan)
    )


def atan(x: Interval) -> Interval:
    """Enclose the arc tangent, of the reciprocal beyond one, and of a quarter of the angle: abs(h) < 0.199.

    Each halving h/(1 + sqrt(1 + h^2)) adds 4 u, terms left out are below 1e-18 of the sum, which adds 2 u.
    """
    a = x.size
    h = where(a > 1.0, 1.0 / a, a)
    for _ in range(2):
        h = h / (1.0 + x.m.function.intrinsic("sqrt", fused(h, h, number(1.0))))
    z = h * h
    angle = 4.0 * fused(h, z * _polynomial(z, _ARCTAN), h)
    value = copysign(where(a > 1.0, 1.5707963267948966 - (angle - 6.123233995736766e-17), angle), x.m)
    relative = ROUNDING["arc tangent"]
    if x.r is None:
        return _result(x, value, relative, None)
    nearest = x.size - x.r
    nearest = where(nearest > 0.0, nearest, 0.0) * (1.0 - 2.0**-40)
    return _result(x, value, relative, x.r / fused(nearest, nearest, number(1.0)))


ENCLOSED: dict[str, Callable[..., Interval]] = {
    f.__name__: f for f in (sin, cos, tan, exp, sinh, cosh, tanh, sqrt, log, atan)
}
"""Elementary functions that are enclosed as they are; others are written in terms of these."""


def applied_to_intervals(operation: str, arguments: Sequence[Interval]) -> Interval:
    """Enclose an operation."""
    match operation:
        case "add":
            return arguments[0] + arguments[1]
        case "sub":
            return arguments[0] - arguments[1]
        case "mul":
            return arguments[0] * arguments[1]
        case "div":
            return arguments[0] / arguments[1]
        case "neg":
            return -arguments[0]
    if operation not in ENCLOSED:
        raise UntraceableError(f"{operation} has no enclosure")
    return ENCLOSED[operation](*arguments)
