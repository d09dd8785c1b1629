"""Intervals as values: a midpoint and a radius, written by the operators that write numbers.

An interval stands for a real number that is known to lie within its radius of its midpoint.  The recurrences of
:mod:`cellmap._compiled.codegen.taylor` and the formulas of :mod:`cellmap._compiled.codegen.emit` work with intervals as
they do with numbers, and then enclose what they compute.

Arithmetic is IEEE 754 in double precision with rounding to the nearest number, the one mode that LLVM's instructions
are defined for (Rump 1999; Hladik 2020 on midpoint and radius).  With u = 2^-53 a result m is off by u abs(m) at most,
or by half the smallest number where it underflows, and so a radius takes up

- the radii of the operands, carried on exactly in the sense of upper bounds;
- the rounding of the midpoint: ``sum``, ``product``, ``quotient``, ``root``, ``dot``, ``reciprocal``;
- ``inflation`` for the rounding of the radius itself, whose terms are all positive: a relative error of 128 u at most;
- ``underflow``, once for each operation, which is far more than all smallest numbers that may be lost.  It is the
  beginning of every sum, so that no radius is so small that processors take long over it.

Each of these is an entry of :data:`ROUNDING`, and in no other place, so that tests can leave out each in turn.  No
instruction carries a flag that lets the compiler change values.  A product may be fused with the sum that it is added
to, by the intrinsic ``fmuladd``: the bounds hold for one rounding as well as for two.

A failure, such as a division by an interval that holds zero, is a radius of NaN, which every later radius inherits.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from math import nan
from typing import Any

from .instructions import Instructions, Value, number, total, where

UNIT = 2.0**-53

ROUNDING: dict[str, float] = {
    "sum": UNIT,
    "product": UNIT,
    "quotient": UNIT,
    "root": UNIT,
    "reciprocal": UNIT,
    "dot": UNIT,
    "inflation": 2.0**-46,
    "underflow": 1e-300,
    "sine": 2.0**-49,
    "exponential": 2.0**-48,
    "logarithm": 2.0**-48,
    "arc tangent": 2.0**-48,
    "hyperbolic": 2.0**-47,
}
"""Bounds of rounding errors, relative except for ``underflow``."""

LONGEST = 40
"""Products in a sum whose rounding errors are bounded together."""


class Enclosing:
    """Maker of intervals in a function, in the place of the function that makes numbers."""

    __slots__ = ("out",)

    def __init__(self, out: Instructions) -> None:
        assert out.flags == "", "flags let the compiler change values"
        self.out = out

    def number(self, value: float) -> Interval:
        """Return a number, exactly."""
        return Interval(self, self.out.number(value))

    def reciprocal(self, whole: int) -> Interval:
        """Return one divided by a whole number."""
        nearest = 1.0 / whole
        return Interval(self, self.out.number(nearest), self.out.number(ROUNDING["reciprocal"] * nearest))

    def loaded(self, base: str, index: int | str, step: int = 1) -> Interval:
        """Load a midpoint, and its radius a step behind it."""
        radius = self.out.whole("add", index, step) if isinstance(index, str) else index + step
        return Interval(self, *(self.out.load(self.out.address(base, k)) for k in (index, radius)))


class Interval:
    """A midpoint, and a radius, None where the number is known exactly."""

    __slots__ = ("_loose", "_reach", "_size", "code", "m", "r")

    def __init__(self, code: Enclosing, m: Value, r: Value | None = None) -> None:
        self.code, self.m, self.r = code, m, r
        self._size: Value | None = None
        self._reach: Value | None = None
        self._loose: Value | None = None

    @property
    def size(self) -> Value:
        """Absolute value of the midpoint."""
        if self._size is None:
            self._size = abs(self.m)
        return self._size

    @property
    def radius(self) -> Value:
        """The radius as a number."""
        return self.code.out.number(0.0) if self.r is None else self.r

    @property
    def reach(self) -> Value:
        """The largest absolute value, but for the rounding of the sum."""
        if self.r is None:
            return self.size
        if self._reach is None:
            self._reach = self.size + self.r
        return self._reach

    @property
    def loose(self) -> Value:
        """The radius, with what each product of a sum adds to it by rounding."""
        if self._loose is None:
            part = fused(self.size, ROUNDING["dot"] * (LONGEST + 2), number(ROUNDING["underflow"]))
            self._loose = part if self.r is None else part + self.r
        return self._loose

    def _lifted(self, other: Interval | float) -> Interval:
        return other if isinstance(other, Interval) else self.code.number(float(other))

    def __neg__(self) -> Interval:
        return Interval(self.code, -self.m, self.r)

    def __add__(self, given: Interval | float) -> Interval:
        other = self._lifted(given)
        m = self.m + other.m
        return Interval(self.code, m, widened(lost(m, "sum"), self.r, other.r))

    __radd__ = __add__

    def __sub__(self, other: Interval | float) -> Interval:
        return self + -self._lifted(other)

    def __rsub__(self, other: float) -> Interval:
        return self._lifted(other) + -self

    def __mul__(self, given: Interval | float) -> Interval:
        other = self._lifted(given)
        m = self.m * other.m
        r = lost(m, "product")
        if other.r is not None:
            r = fused(self.size, other.r, r)
        if self.r is not None:
            r = fused(self.r, other.reach, r)
        return Interval(self.code, m, widened(r))

    __rmul__ = __mul__

    def __truediv__(self, given: Interval | float) -> Interval:
        # With q = m/n, for x and y near m and n: x/y - q = ((x - m) + (m - q n) + q (n - y))/y.  What underflow loses
        # may be multiplied by a large q, or divided by a small y, and is added before that.
        other = self._lifted(given)
        q = self.m / other.m
        least = other.size if other.r is None else other.size - other.r
        off, none = (
            fused(other.size, ROUNDING["quotient"], number(ROUNDING["underflow"])),
            number(ROUNDING["underflow"]),
        )
        gap = fused(abs(q), off if other.r is None else off + other.r, none)
        gap = gap if self.r is None else gap + self.r
        away = least > other.size * 2.0**-50  # so far from zero that rounding cannot matter
        return Interval(self.code, q, widened(where(away, gap / least, nan), number(ROUNDING["underflow"])))

    def __rtruediv__(self, other: float) -> Interval:
        return self._lifted(other) / self

    @staticmethod
    def dot(pairs: Sequence[tuple[Interval | float, Interval]]) -> Interval:
        """Return a sum of products; rounding errors of midpoints are bounded together (Higham 2002, section 3.1)."""
        code = pairs[0][1].code
        assert len(pairs) <= LONGEST, "the bound is for sums of fewer products"
        chains: list[tuple[Value | None, Value | None]] = [(None, None), (None, None)]
        for k, (given, y) in enumerate(pairs):
            x = y._lifted(given)
            m, r = chains[k % 2 if len(pairs) > 3 else 0]
            m = x.m * y.m if m is None else fused(x.m, y.m, m)
            r = fused(x.size, y.loose, number(ROUNDING["underflow"]) if r is None else r)
            if x.r is not None:
                r = fused(x.r, y.reach, r)
            chains[k % 2 if len(pairs) > 3 else 0] = m, r
        midpoints, radii = zip(*(chain for chain in chains if chain[0] is not None), strict=True)
        return Interval(code, total(midpoints), widened(*radii))


def fused(a: Value, b: Value | float, c: Value) -> Value:
    """Return a b + c, rounded once or twice."""
    code = a.code or c.code
    assert code is not None, "one of the values comes from a function"
    return code.intrinsic("fmuladd", a, b if isinstance(b, Value) else number(b), c)


def products(sizes: Sequence[Value], lengths: Sequence[Value]) -> Value:
    """Return a sum of products of numbers that are not negative, but for its rounding."""
    none = number(ROUNDING["underflow"])
    return reduce(lambda s, pair: fused(pair[0], pair[1], s), zip(sizes, lengths, strict=True), none)


def largest(values: Sequence[Value]) -> Value:
    """Return the largest of some numbers; NaN where one is."""
    return reduce(lambda a, b: where(a > b, a, where(b >= a, b, nan)), values)


def smaller(a: Value, b: Value) -> Value:
    """Return the smaller of two bounds, b where a is NaN; NaN where b is."""
    return where(a < b, a, b)


def lost(m: Value, name: str) -> Value:
    """Return a bound of the rounding error of a midpoint."""
    return fused(abs(m), ROUNDING[name], number(ROUNDING["underflow"]))


def widened(*terms: Value | None) -> Value:
    """Return the radius that is a sum of terms above or at zero, with what its own rounding may have lost."""
    found: Any = total(term for term in terms if term is not None)
    return found * (1.0 + ROUNDING["inflation"])
