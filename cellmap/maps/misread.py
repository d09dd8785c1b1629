"""What is said of a right-hand side that reads its arguments in another way than it is called."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from .._compiled.codegen.trace import State
from .coordinates import Coordinate


def misread(
    rhs: Callable[..., Any],
    switches: Callable[..., Any] | None,
    arguments: tuple[float, tuple[float, ...], Any],
    axes: Sequence[Coordinate],
    error: Exception,
) -> Exception:
    """Return what is said of a right-hand side that raises an error where it is called with some arguments."""
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
    if isinstance(error, IndexError):
        if len(names) == 1 and len(listed) > 1:
            remedy = f"coordinates={listed!r} is one name: give one for each, such as {tuple(listed)!r}"
        else:
            remedy = "name each" if switches is None else "name each, or give as many switches as there are signs"
        return ValueError(f"{functions} asks for more state variables than there are coordinates ({listed}): {remedy}")
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
    return TypeError(f"rhs must be callable as {form} and return a tuple: {error}")


def lacking(functions: str, error: AttributeError) -> ValueError:
    """Return what is said of a function that reads an attribute that its arguments do not have."""
    if names := getattr(error.obj, "_fields", ()):
        return ValueError(
            f"{functions} asks for a parameter that params lacks: p.{error.name}; there are {', '.join(names)}"
        )
    return ValueError(f"{functions} asks for a parameter that params lacks ({error})")
