"""Right-hand sides with SciPy's signature, ``fun(t, y, *args)``."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from .._lib.checks import check_mapping, shown

_BY_PLACE = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)


def with_parameters(
    fun: Any, args: Sequence[Any], params: Mapping[str, Any] | None
) -> tuple[Callable[..., Any], dict[str, Any]]:
    """Return ``rhs(t, x, p)`` of a function ``fun(t, y, *args)``, and the parameters: its arguments with numbers.

    Raises
    ------
    TypeError, ValueError
        For arguments that `fun` does not have, or that lack a value.
    """
    if not callable(fun):
        raise TypeError(f"fun={shown(fun)}: give a function fun(t, y) or fun(t, y, *args)")
    if not isinstance(args, list | tuple):
        raise TypeError(f"args={shown(args)}: give the arguments of fun after t and y, in a tuple")
    check_mapping("params", {} if params is None else params, "of arguments of fun to numbers, such as {'delta': 0.15}")
    names, any_number = _further(fun)
    given = dict(params or {})
    if any_number and len(args) + len(given) > len(names):
        names = [*names, *(name for name in given if name not in names)]
    if len(args) > len(names):
        raise ValueError(
            f"args={shown(args)}: fun takes {len(names)} arguments besides t and y; name them by params={{...}}"
        )
    values = dict(zip(names, args, strict=False))
    if twice := values.keys() & given.keys():
        raise ValueError(f"params={shown(given)}: args holds {', '.join(sorted(twice))} already")
    if unknown := [name for name in given if name not in names]:
        raise ValueError(
            f"params={shown(given)}: fun has no argument {unknown[0]!r}; there are {', '.join(names) or 'none'}"
        )
    values |= given
    defaults = {n: p.default for n, p in inspect.signature(fun).parameters.items() if p.default is not p.empty}
    if lacking := [name for name in names if name not in values and name not in defaults]:
        raise ValueError(
            f"fun asks for {', '.join(lacking)}: give args=(...) in that order, or params={{{lacking[0]!r}: ...}}"
        )
    values = {name: values.get(name, defaults.get(name)) for name in names}
    plain = {name: value for name, value in values.items() if not hasattr(value, "_fields")}
    numbers = {name: value for name, value in plain.items() if np.asarray(value).dtype.kind in "iuf"}
    fixed = tuple(None if name in numbers else value for name, value in values.items())
    return _right_hand_side(fun, tuple(name if name in numbers else "" for name in names), fixed), numbers


def _further(fun: Callable[..., Any]) -> tuple[list[str], bool]:
    """Return the names of the arguments after time and state, and whether there may be more."""
    arguments = list(inspect.signature(fun).parameters.values())
    names = [a.name for a in arguments if a.kind in _BY_PLACE]
    return names[2:], any(a.kind is inspect.Parameter.VAR_POSITIONAL for a in arguments)


def _right_hand_side(fun: Callable[..., Any], names: tuple[str, ...], fixed: tuple[Any, ...]) -> Callable[..., Any]:
    pairs = tuple(zip(names, fixed, strict=True))

    @functools.wraps(fun, assigned=("__name__", "__qualname__"), updated=())
    def rhs(t: float, x: Sequence[float], p: Any) -> Sequence[float]:
        found: Sequence[float] = fun(t, np.array(x), *[getattr(p, name) if name else value for name, value in pairs])
        return found

    return rhs


def line_for(rhs: Callable[..., Any], parameters: Any) -> str:
    """Return the remedy for a right-hand side with SciPy's signature; empty for others."""
    try:
        names, any_number = _further(rhs)
    except (TypeError, ValueError):
        return ""
    fields = getattr(parameters, "_fields", ())
    called = getattr(rhs, "__name__", "fun")
    if any_number or len(names) == 1 or not set(names) <= set(fields):
        return ""
    arguments = "".join(f", p.{name}" for name in names)
    line = f"lambda t, x, p: {called}(t, np.array(x){arguments})"
    return f"; for a function of SciPy give `{line}`, or take ForcedSystem.from_scipy"
