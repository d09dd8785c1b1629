"""Type checks of the arguments of public functions, from their signatures."""

from __future__ import annotations

import functools
import importlib
import re
from collections.abc import Callable, Mapping, Sequence
from types import FunctionType, NoneType, UnionType
from typing import Any, NamedTuple, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import numpy as np

from .checks import check_length, is_sequence, real_number, shown
from .deprecation import renamed

_LIBRARY = __name__.split(".")[0]
F = TypeVar("F", bound=Callable[..., Any])


RENAMED = {"max_period": "longest_period"}
"""Arguments that had another name in cellmap 0.1, which is still accepted."""


class _Kind(NamedTuple):
    """What an argument may be: a test of its value, words for it, and the classes of which it may be."""

    holds: Callable[[Any], bool]
    words: str
    classes: tuple[type, ...] = ()


def makers(kind: type) -> str:
    """Return what makes a record, for the remedy of an error: the public functions of its room that return it.

    A record that comes from elsewhere, or from too many functions, says so in its attribute `_made_by`.
    """
    if kind.__module__.startswith("matplotlib."):
        return "matplotlib.pyplot.subplots"
    if "_made_by" in vars(kind):
        return str(vars(kind)["_made_by"])
    room = kind.__module__
    while (place := importlib.import_module(room)) and not hasattr(place, "__all__") and "." in room:
        room = room.rpartition(".")[0]
    offered = {name: getattr(place, name) for name in getattr(place, "__all__", ())}
    names = [name for name, member in offered.items() if isinstance(member, FunctionType) and _returns(member, kind)]
    return " or ".join(part for part in (", ".join(names[:-1]), *names[-1:]) if part)


def _returns(function: Callable[..., Any], kind: type) -> bool:
    return re.search(rf"\b{kind.__name__}\b", str(function.__annotations__.get("return"))) is not None


def checked(function: F) -> F:
    """Hold the arguments of a public function to the records and numbers that its signature asks for.

    Bounds are left to the function, and so is what else a signature may ask for: array_like, strings, functions,
    mappings and pairs, of which it knows the shapes and the choices.  A sequence of numbers may be an array, and a
    float any real number.  Arguments in :data:`RENAMED` are accepted under their old names.

    Raises
    ------
    TypeError
        Of the new function, for an argument of another type: ``argument=value: remedy``.

    Warns
    -----
    DeprecationWarning
        By the new function, for an argument under its old name.

    Examples
    --------
    >>> @checked
    ... def cells(count: int) -> int:
    ...     return count
    >>> cells(1.5)
    Traceback (most recent call last):
        ...
    TypeError: count=1.5: give a whole number
    """
    code = function.__code__
    names = code.co_varnames[: code.co_argcount]
    old = {before: now for before, now in RENAMED.items() if now in names}

    @functools.wraps(function)
    def call(*args: Any, **named: Any) -> Any:
        kinds = _kinds(function)
        for before in old.keys() & named.keys():
            now = old[before]
            renamed(before, now, "0.2", named[before])
            named[now] = named.pop(before)
        for name, value in (*zip(names, args, strict=False), *named.items()):
            kind = kinds.get(name)
            check_length(name, value)
            if kind is not None and not kind.holds(value):
                made = {makers(one) for one in kind.classes} - {""}
                origin = f", made by {made.pop()}" if len(made) == 1 else ""
                raise TypeError(f"{name}={shown(value)}: give {kind.words}{origin}")
        return function(*args, **named)

    return cast(F, call)


@functools.cache
def _kinds(function: Callable[..., Any]) -> Mapping[str, _Kind]:
    """Read a signature; late, when all modules are there."""
    found = {name: _kind(hint) for name, hint in get_type_hints(function).items() if name != "return"}
    return {name: kind for name, kind in found.items() if kind is not None}


def _kind(hint: Any) -> _Kind | None:
    """Return what a value of a type is; None where it is left to the function."""
    origin, inner = get_origin(hint) or hint, get_args(hint)
    if origin in (Union, UnionType):
        return _any_of([_kind(h) for h in inner])
    if origin in _NUMBERS:
        return _NUMBERS[origin]
    if origin is tuple and len(inner) == 2 and inner[0] is inner[1] and inner[0] in (int, float):
        return _pair_of(_NUMBERS[inner[0]].holds, "two whole numbers" if inner[0] is int else "two numbers")
    if origin is Sequence:
        each = _kind(inner[0])
        return None if each is None else _sequence_of(each)
    if not isinstance(origin, type) or origin.__module__.split(".")[0] not in (_LIBRARY, "matplotlib"):
        return None
    name = origin.__name__
    article = "" if name.endswith("s") else "an " if name[0] in "AEIO" else "a "
    return _Kind(lambda value: isinstance(value, origin), article + name, (origin,))


def _any_of(kinds: list[_Kind | None]) -> _Kind | None:
    known = [kind for kind in kinds if kind is not None]
    if len(known) < len(kinds):
        return None
    words = list(dict.fromkeys(kind.words for kind in known))
    classes = tuple(one for kind in known for one in kind.classes) if len(words) <= 2 else ()
    return _Kind(lambda value: any(kind.holds(value) for kind in known), " or ".join(words), classes)


def _sequence_of(each: _Kind) -> _Kind:
    def holds(value: Any) -> bool:
        return is_sequence(value) and all(map(each.holds, value))

    return _Kind(holds, f"a sequence, each of it {each.words}", each.classes)


def _pair_of(holds: Callable[[Any], bool], words: str) -> _Kind:
    return _Kind(lambda value: is_sequence(value) and len(value) == 2 and all(map(holds, value)), words)


def _is_whole(value: Any) -> bool:
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def _is_real(value: Any) -> bool:
    try:
        real_number("", value)
    except (TypeError, ValueError):
        return False
    return True


_NUMBERS: dict[Any, _Kind] = {
    NoneType: _Kind(lambda value: value is None, "None"),
    bool: _Kind(lambda value: isinstance(value, bool | np.bool_), "True or False"),
    int: _Kind(_is_whole, "a whole number"),
    float: _Kind(_is_real, "one real number"),
}
