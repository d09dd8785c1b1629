"""Error messages for right-hand sides with the wrong signature."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from .._compiled.codegen.expression import ImpureError
from .._compiled.codegen.period import CompiledPeriod
from .._compiled.codegen.slowdown import slowdown
from .._compiled.codegen.trace import State
from .._compiled.kernels.blocks import LANES
from .._lib.arrays import Floats
from .._lib.checks import warn_caller
from .coordinates import Coordinate
from .scipy_signature import line_for

PLACES = (0.01370521, 0.21093467, 0.47316089, 0.83052713)
"""Times in periods where nobody lets a forcing jump: one and that a period later might see other sides there."""


def trial_state(dimension: int) -> tuple[float, ...]:
    """Return a state at which functions are tried out."""
    return tuple(0.1 + 0.73 * j / max(dimension, 1) for j in range(dimension))


def as_numbers(found: Sequence[Any]) -> tuple[Any, ...]:
    """Return the components of a right-hand side; arrays without dimensions, as splines return them, are numbers."""
    values = tuple(found)
    if np.ndarray not in map(type, values):
        return values
    return tuple(v[()] if isinstance(v, np.ndarray) and not v.ndim else v for v in values)


def called_twice(name: str, function: Callable[..., Any], *arguments: Any) -> Any:
    """Return the value of a function.

    Raises
    ------
    ImpureError
        Where a second call gives another value.
    """
    first, second = function(*arguments), function(*arguments)
    try:
        alike = np.array_equal(np.asarray(first, dtype=float), np.asarray(second, dtype=float), equal_nan=True)
    except (TypeError, ValueError):
        return first  # no numbers; the caller says so
    if not alike:
        raise ImpureError(name, f"is {first} and, called again with the same arguments, {second}")
    return first


def misread(
    rhs: Callable[..., Any],
    switches: Callable[..., Any] | None,
    arguments: tuple[float, tuple[float, ...], Any],
    axes: Sequence[Coordinate],
    error: Exception,
) -> Exception:
    """Return the error message for a right-hand side that raises an error where it is called."""
    functions, names = ("rhs" if switches is None else "rhs or switches"), [c.name for c in axes]
    listed = ", ".join(names)
    text = str(error)
    if isinstance(error, AttributeError) and isinstance(error.obj, State):
        return ValueError(
            f"{functions} reads x.{error.name}: x is a plain tuple; begin with `{listed} = x`, or write x[0], x[1], ..."
        )
    if isinstance(error, AttributeError) and "can't set" in text:
        return TypeError(f"{functions} sets a parameter, which stays as it is: use a name of its own ({text})")
    if isinstance(error, AttributeError):
        return lacking(functions, error)
    if isinstance(error, IndexError) and not text.startswith("tuple"):
        return ValueError(f"{functions} reads beyond the end of a list or an array at every state tried ({text})")
    if isinstance(error, NameError):
        return undefined(functions, error)
    if asks_for_more(error):
        return too_few(
            functions, axes, error, "" if switches is None else ", or give as many switches as there are signs"
        )
    if "indices must be" in text and "not str" in text:
        return TypeError(f"{functions} reads a parameter as p['name']: p is a named tuple; write p.name ({text})")
    form = "rhs(t, x, p)" if switches is None else "rhs(t, x, p, s), and switches as switches(t, x, p),"
    if switches is None:
        t, place, record = arguments
        try:
            exchanged = len(tuple(rhs(place, t, record))) == len(axes)
        except Exception:
            exchanged = False
        if exchanged:
            return TypeError("rhs takes the state before the time: it must be callable as rhs(t, x, p), time first")
    if "not iterable" in text:
        text += "; return one derivative for each coordinate, `return (value,)` for one"
    text += as_vectors(text) or line_for(rhs, arguments[2])
    return TypeError(f"rhs must be callable as {form} and return a tuple: {text}")


def asks_for_more(error: Exception | None) -> bool:
    """Tell whether an error is that of a function that takes another number of state variables than there are."""
    return isinstance(error, IndexError) or (isinstance(error, ValueError) and "to unpack" in str(error))


def too_few(functions: str, axes: Sequence[Coordinate], error: Exception, otherwise: str = "") -> ValueError:
    """Return the message for a function that takes another number of state variables than there are coordinates."""
    names = [c.name for c in axes]
    listed = ", ".join(names)
    if isinstance(error, ValueError):
        such = f", such as {tuple(listed)!r}" if len(names) == 1 and len(listed) > 1 else ""
        return ValueError(
            f"{functions} fails at every state tried ({error}): give one coordinate for each state variable, where "
            f"coordinates={listed!r} has {len(names)}{such}"
        )
    remedy = f"name each{otherwise}"
    if len(names) == 1 and len(listed) > 1:
        remedy = f"coordinates={listed!r} is one name: give one for each, such as {tuple(listed)!r}"
    return ValueError(f"{functions} asks for more state variables than there are coordinates ({listed}): {remedy}")


def as_vectors(text: str) -> str:
    """Return the remedy, for a message, of arithmetic with parameters as a whole."""
    vectors = "multiply sequence" in text or re.search("unsupported operand|bad operand|can only concatenate", text)
    return "; p is a tuple: write p.name" if vectors else ""


def undefined(functions: str, error: NameError) -> ValueError:
    """Return the message for a function that uses a name that is not defined."""
    return ValueError(
        f"{functions} fails ({error}): define it before, or make it a parameter in params and write p.{error.name}"
    )


def lacking(functions: str, error: AttributeError) -> ValueError:
    """Return the message for a function that reads an attribute that its arguments do not have."""
    if names := getattr(error.obj, "_fields", ()):
        return ValueError(
            f"{functions} asks for a parameter that params lacks: p.{error.name}; there are {', '.join(names)}"
        )
    if isinstance(error.obj, tuple):
        return ValueError(
            f"{functions} reads a parameter {error.name} of the state, which is a tuple: the state is the argument "
            "before the parameters, f(x, p) of a map and rhs(t, x, p) of a flow"
        )
    return ValueError(f"{functions} asks for a parameter that params lacks ({error})")


def check_compiled(
    name: str, function: Callable[..., Any], compiled: CompiledPeriod, dimension: int, p: Floats, h: float
) -> None:
    """Compare a function without known formulas with what has been compiled of it, at a few places.

    With `h` it is a right-hand side, and a step of this length is compared, else a map.

    Raises
    ------
    TypeError
        Where both differ: compiled whole numbers have 64 bits.
    """
    rng = np.random.default_rng(0)
    for size in (0.1, 1.0, 10.0):
        x = rng.uniform(-size, size, dimension)
        try:
            expected = np.array([float(v) for v in function(0.0, tuple(x.tolist()))])
        except Exception:
            continue  # outside the domain of the function
        block, errors = np.repeat(x[np.newaxis, :, np.newaxis], LANES, axis=2), np.zeros((1, dimension, LANES))
        compiled(block, np.ones(1, np.int64), 0.0, h or 1.0, p, errors)
        found = (block[0, :, 0] - x) / h if h else block[0, :, 0]
        with np.errstate(all="ignore"):
            near = np.abs(found - expected) <= (1e-2 if h else 1e-9) * (1.0 + np.abs(expected).max())
        if np.isfinite((expected, found)).all() and not near.all():
            raise TypeError(
                f"{name} is {expected.tolist()} at {x.tolist()}, but {found.tolist()} once it is compiled: its whole "
                "numbers are larger than 2**63, or it does what has another meaning there; compute with floats"
            )


def warn_of_cost(
    name: str,
    unknown: str,
    function: Callable[..., Any],
    names: tuple[str, ...],
    place: tuple[float, ...],
    compiled: CompiledPeriod,
    method: str,
) -> None:
    """Warn of a function without formulas, with the reason and by how much a step takes longer than with them."""
    factor = slowdown(function, names, place, compiled, method)
    long = f"{factor:.2g} times as long as with them (measured at one state)"
    if not factor > 0.0:
        long = "some 20 to 80 times as long as with them (estimated: other functions did)"
    step = "one step" if method else "one image"
    warn_caller(f"{name}: its formulas are not known, so that {step} takes {long}. The reason: {unknown}")


def short(values: Sequence[float] | Floats, digits: int = 6) -> str:
    """Return numbers in words, in parentheses."""
    return f"({', '.join(f'{v:.{digits}g}' for v in values)})"


def differ(a: Sequence[float] | Floats, b: Sequence[float] | Floats) -> bool:
    """Tell whether finite values differ by more than rounding and an approximate period explain."""
    scale = max(1e-300, *(abs(v) for v in (*a, *b)))
    return bool(np.isfinite((*a, *b)).all()) and max(abs(p - q) for p, q in zip(a, b, strict=True)) > 1e-7 * scale
