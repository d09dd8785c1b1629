"""Values that a plain function reads besides its arguments.

What is traced or compiled holds these values as constants, so it may be used again only while they are the same.
"""

from __future__ import annotations

import functools
import types
from collections.abc import Callable, Iterator
from typing import Any, TypeVar

import numpy as np

from ..machine_code import named
from .rebind import global_names, names_in

R = TypeVar("R")


def kept(build: Callable[..., R]) -> Callable[..., R]:
    """Keep what is built from a function and hashable arguments, until a value that the function captures changes."""

    @functools.lru_cache(maxsize=256)
    def for_values(function: Any, values: tuple[Any, ...], *arguments: Any) -> R:
        with named(function[0] if isinstance(function, tuple) else function):
            return build(function, *arguments)

    @functools.wraps(build)
    def for_function(function: Any, *arguments: Any) -> R:
        try:
            hash(function)
        except TypeError:
            raise TypeError(
                f"{function!r} cannot be told from others: give a function, or an object with a hash "
                "(such as one of a frozen dataclass)"
            ) from None
        return for_values(function, captured(function), *arguments)

    return for_function


def captured(function: Any) -> tuple[Any, ...]:
    """Return the code of a function and of the plain functions it calls, and the values that they find around them.

    Examples
    --------
    >>> stiffness = 2.0
    >>> def force(x):
    ...     return -stiffness * x
    >>> captured(force)[1:]
    (2.0,)
    """
    return tuple(_values(function, set(), frozenset()))


def _values(item: Any, seen: set[int], names: frozenset[str]) -> Iterator[Any]:
    """Yield the constants below an item; `names` are those that the code around it mentions."""
    if item is None:
        return
    if isinstance(item, int | float | complex | str | bytes | np.generic):
        yield item
        return
    if id(item) in seen or isinstance(item, types.BuiltinFunctionType | np.ufunc):
        return
    seen.add(id(item))
    if isinstance(item, types.FunctionType):
        yield item.__code__
        names = names_in(item.__code__)
        inner: list[Any] = [item.__globals__[n] for n in sorted(global_names(item.__code__)) if n in item.__globals__]
        inner += [c.cell_contents for c in item.__closure__ or ()]
        inner += [item.__defaults__, item.__kwdefaults__]
    elif isinstance(item, type):
        found = [vars(c) for c in reversed(item.__mro__) if c.__module__.split(".")[0] not in {"builtins", "numpy"}]
        inner = [attributes[n] for attributes in found for n in sorted(names) if n in attributes]
    elif isinstance(item, types.ModuleType):
        if item.__name__ in {"math", "numpy"}:
            return
        inner = [vars(item)[n] for n in sorted(names) if n in vars(item)]
    elif isinstance(item, np.ndarray):
        yield item.dtype.str, item.shape, item.tobytes()
        return
    elif isinstance(item, list | tuple | set | frozenset):
        inner = list(item)
    elif isinstance(item, dict):
        inner = [part for pair in item.items() for part in pair]
    elif isinstance(item, functools.partial):
        inner = [item.func, item.args, item.keywords]
    elif isinstance(item, types.MethodType):
        inner = [item.__func__, item.__self__]
    else:
        plain = getattr(item, "py_func", None)
        call = type(item).__call__ if callable(item) else None
        inner = [plain] if plain is not None else [type(item), call, getattr(item, "__dict__", None)]
    for part in inner:
        yield from _values(part, seen, names)


class Watched:
    """Functions that something has been made of, which is not to be made of other ones later.

    ``sample`` calls them at some places: they may read values that do not matter, as those of a dictionary beside the
    one that they ask for.
    """

    def __init__(self, name: str, functions: Any, sample: Callable[[], Any]) -> None:
        self._name, self._functions, self._sample = name, functions, sample
        self._read, self._found = captured(functions), self._samples()

    def check(self) -> None:
        """Refuse functions that have become other ones, by a value that they read besides their arguments."""
        if captured(self._functions) != self._read and not np.array_equal(self._samples(), self._found, equal_nan=True):
            raise ValueError(
                f"{self._name} reads a value that has changed since the map was made: make another map, or make the "
                "value a parameter in params and change that by with_params"
            )

    def _samples(self) -> Any:
        with np.errstate(all="ignore"):
            return np.array(self._sample(), dtype=float)
