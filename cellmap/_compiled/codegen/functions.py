"""Elementary functions: what is known of each, in one table.

Formulas call them by their names in :mod:`math`, or by those of NumPy.  An entry is all that a new one needs: traced
functions, branches, derivatives, power series, machine code and the equations of the explorer read it from here.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from math import inf, log, pi, sqrt
from typing import Any

from . import simd_math

Expression = Any
"""One of :mod:`cellmap._compiled.codegen.expression`, which reads this table."""

Domain = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Elementary:
    """One elementary function.

    Parameters
    ----------
    slope : callable, optional
        Derivative of a function of one argument, as an expression of that argument and of the function's own value.
        From it follow all derivatives, and the power series where no recurrence is written in ``taylor``.
    domain : tuple of float, optional
        Open interval on which it is defined and analytic; None for a function that has a kink or a jump.
    in_parts : callable, optional
        The same in terms of functions that cost less in steps with events, as an expression of the arguments.
    kernel : callable or str, optional
        Branch-free function of :mod:`cellmap._compiled.codegen.simd_math`, or the name of an instruction that
        processors have; by default the C library is called, for one lane after the other.
    shared : bool
        Whether the kernel stands in for the C library outside of lanes as well.
    is_entire : bool
        Whether its series at one point hides nothing of what lies ahead.
    products : int
        Products of series in its recurrence.
    layer : tuple of float, optional
        Rate at which it grows, or approaches a constant, and by how much its logarithm may move between two places of
        a step.  It is less for a function with two constants: between them there is little to see.
    numpy : str
        Its name in NumPy, where that is another one.
    """

    slope: Callable[[Any, Any], Expression] | None = None
    domain: Domain | None = None
    in_parts: Callable[..., Expression] | None = None
    kernel: Callable[..., Any] | str | None = None
    shared: bool = False
    is_entire: bool = False
    products: int = 0
    layer: Domain | None = None
    numpy: str = ""


def of(name: str, a: Any, *others: Any) -> Expression:
    """Apply an operation to an expression, and others."""
    return a.graph.apply(name, a, *others)


def _arc_sine(a: Any) -> Any:
    return 2.0 * of("atan", a / (1.0 + of("sqrt", (1.0 - a) * (1.0 + a))))


def _inverse_tanh(a: Any) -> Any:
    return 0.5 * of("log", (1.0 + a) / (1.0 - a))


def _cube_root(a: Any) -> Expression:
    size = of("pow", of("fabs", a), 1.0 / 3.0)
    return a.graph.choose(a, size, -size)


ANYWHERE, ABOVE_ZERO = (-inf, inf), (0.0, inf)

TABLE: dict[str, Elementary] = {
    "sin": Elementary(lambda a, f: of("cos", a), ANYWHERE, None, simd_math.sin, is_entire=True, products=2),
    "cos": Elementary(lambda a, f: -of("sin", a), ANYWHERE, None, simd_math.cos, is_entire=True, products=2),
    "tan": Elementary(lambda a, f: 1.0 + f * f, (-pi / 2, pi / 2), None, simd_math.tan, products=2),
    "exp": Elementary(lambda a, f: f, ANYWHERE, None, simd_math.exp, products=1, layer=(1.0, 8.0)),
    "log": Elementary(lambda a, f: 1.0 / a, ABOVE_ZERO, products=1),
    "sqrt": Elementary(lambda a, f: 0.5 / f, ABOVE_ZERO, None, "sqrt", products=1),
    "sinh": Elementary(lambda a, f: of("cosh", a), ANYWHERE, None, simd_math.sinh, products=2, layer=(1.0, 8.0)),
    "cosh": Elementary(lambda a, f: of("sinh", a), ANYWHERE, None, simd_math.cosh, products=2, layer=(1.0, 8.0)),
    "tanh": Elementary(lambda a, f: 1.0 - f * f, ANYWHERE, None, simd_math.tanh, products=2, layer=(2.0, 3.0)),
    "atan": Elementary(lambda a, f: 1.0 / (1.0 + a * a), ANYWHERE, None, simd_math.atan, products=2, numpy="arctan"),
    "asin": Elementary(lambda a, f: 1.0 / of("sqrt", 1.0 - a * a), (-1.0, 1.0), _arc_sine, numpy="arcsin"),
    "acos": Elementary(
        lambda a, f: -1.0 / of("sqrt", 1.0 - a * a), (-1.0, 1.0), lambda a: 0.5 * pi - _arc_sine(a), numpy="arccos"
    ),
    "asinh": Elementary(
        lambda a, f: 1.0 / of("sqrt", a * a + 1.0),
        ANYWHERE,
        lambda a: 2.0 * _inverse_tanh(a / (of("sqrt", a * a + 1.0) + 1.0)),
        numpy="arcsinh",
    ),
    "acosh": Elementary(lambda a, f: 1.0 / of("sqrt", a * a - 1.0), (1.0, inf), numpy="arccosh"),
    "atanh": Elementary(lambda a, f: 1.0 / (1.0 - a * a), (-1.0, 1.0), _inverse_tanh, numpy="arctanh"),
    "exp2": Elementary(lambda a, f: log(2.0) * f, ANYWHERE, lambda a: of("exp", log(2.0) * a), layer=(0.7, 8.0)),
    "expm1": Elementary(
        lambda a, f: f + 1.0,
        ANYWHERE,
        lambda a: 2.0 * (of("exp", 0.5 * a) * of("sinh", 0.5 * a)),
        layer=(1.0, 8.0),
    ),
    "log2": Elementary(lambda a, f: 1.0 / log(2.0) / a, ABOVE_ZERO, lambda a: 1.0 / log(2.0) * of("log", a)),
    "log10": Elementary(lambda a, f: 1.0 / log(10.0) / a, ABOVE_ZERO, lambda a: 1.0 / log(10.0) * of("log", a)),
    "log1p": Elementary(lambda a, f: 1.0 / (1.0 + a), (-1.0, inf), lambda a: of("log", 1.0 + a)),
    "erf": Elementary(lambda a, f: 2.0 / sqrt(pi) * of("exp", -(a * a)), ANYWHERE, layer=(2.0, 3.0)),
    "erfc": Elementary(lambda a, f: -2.0 / sqrt(pi) * of("exp", -(a * a)), ANYWHERE, layer=(2.0, 3.0)),
    "cbrt": Elementary(lambda a, f: 1.0 / 3.0 / (f * f), None, _cube_root),
    "hypot": Elementary(in_parts=lambda a, b: of("sqrt", a * a + b * b)),
    "atan2": Elementary(numpy="arctan2"),
    "fabs": Elementary(kernel="fabs", numpy="absolute"),
    "floor": Elementary(kernel="floor"),
    "ceil": Elementary(kernel="ceil"),
    "trunc": Elementary(kernel="trunc"),
    # Those of the C library are others, slower, or not there.
    "copysign": Elementary(kernel=simd_math.with_sign, shared=True),
    "min": Elementary(kernel=simd_math.fmin, shared=True),
    "max": Elementary(kernel=simd_math.fmax, shared=True),
    "mod": Elementary(kernel=simd_math.mod, shared=True, numpy="remainder"),
    "fmod": Elementary(kernel=simd_math.fmod, shared=True),
    "minimum": Elementary(numpy="minimum"),
    "maximum": Elementary(numpy="maximum"),
    "fmin": Elementary(numpy="fmin"),
    "fmax": Elementary(numpy="fmax"),
    "sign": Elementary(numpy="sign"),
    "heaviside": Elementary(numpy="heaviside"),
}
"""All of them."""

OF_MATH = [name for name in (*TABLE, "pow") if hasattr(math, name)]
"""Those that :mod:`math` has, which the explorer lets formulas call."""
