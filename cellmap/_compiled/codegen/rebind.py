"""Copies of plain Python functions that see other elementary functions than those of :mod:`math`."""

from __future__ import annotations

import builtins
import cmath
import dis
import functools
import math
import sys
import types
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from .functions import TABLE

NUMPY_NAMES = {known.numpy: name for name, known in TABLE.items() if known.numpy} | {
    "float_power": "pow",
    "logaddexp": "logaddexp",
    "signbit": "signbit",
    "rad2deg": "degrees",
    "deg2rad": "radians",
}
"""Functions of NumPy by other names than those of :mod:`math`."""


def _canonical_names() -> dict[Any, str]:
    """Name under which a table lists each function of :mod:`math`, of NumPy and of the built-ins."""
    names: dict[Any, str] = {f: n for n, f in vars(math).items() if callable(f) and not n.startswith("_")}
    for name in (*vars(math), *NUMPY_NAMES):
        ufunc = getattr(np, name, None)
        if isinstance(ufunc, np.ufunc):
            names[ufunc] = NUMPY_NAMES.get(name, name)
    names[np.abs] = names[abs] = "fabs"
    names[min], names[max] = "min", "max"
    names |= {function: name for name, function in vars(cmath).items() if name in {*TABLE, "phase", "polar", "rect"}}
    names[complex] = "complex"
    names[np.power] = names[pow] = "pow"
    names[float], names[np.float64], names[int], names[print] = "float", "float", "int", "print"
    names[round] = names[np.round] = names[np.rint] = "round"
    return names


CANONICAL_NAMES = _canonical_names()

ARRAY_FUNCTIONS: dict[str, Any] = {name: f for f, name in CANONICAL_NAMES.items() if isinstance(f, np.ufunc)}
ARRAY_FUNCTIONS["min"] = lambda *several: functools.reduce(lambda a, b: np.where(b < a, b, a), several)
ARRAY_FUNCTIONS["max"] = lambda *several: functools.reduce(lambda a, b: np.where(b > a, b, a), several)
ARRAY_FUNCTIONS["hypot"] = lambda *several: functools.reduce(np.hypot, several)


class _Namespace(types.ModuleType):
    """Stand-in for a module such as ``math``: listed functions are replaced, the rest is the module's own."""

    def __init__(self, module: types.ModuleType, substitute: Callable[[Any], Any]) -> None:
        super().__init__(f"{module.__name__}_rebound")
        self._module, self._substitute = module, substitute

    def __getattr__(self, name: str) -> Any:
        return self._substitute(getattr(self._module, name))


def rebind(
    function: Callable[..., Any],
    table: Mapping[str, Any],
    finish: Callable[[Callable[..., Any]], Callable[..., Any]] = lambda f: f,
    inside: Callable[[Any], Any] | None = None,
) -> Callable[..., Any]:
    """Copy a function, and the plain functions it calls, so that elementary functions come from `table`.

    `table` maps names of :mod:`math` (NumPy's and the built-ins' synonyms included) to replacements.  `finish` is
    applied to each copied function, innermost first; a compiler goes here.  The original is left as it is.  With
    `inside` modules, methods and objects are copied as well, and what it returns of a value, if that is another one,
    stands for it.
    """
    done: dict[int, Any] = {}
    alive: list[Any] = []

    def substitute(value: Any) -> Any:
        if isinstance(value, types.ModuleType):
            known = inside is not None or value.__name__ in {"math", "numpy", "numpy.linalg"}
            return _Namespace(value, substitute) if known else value
        if inside is not None and (found := inside(value)) is not value:
            return found
        try:
            name = CANONICAL_NAMES.get(value)
        except TypeError:
            name = None
        if name is not None:
            return table.get(name, value)
        plain = getattr(value, "py_func", value)
        if isinstance(plain, types.FunctionType):
            return copy(plain)
        return value if inside is None else copied_object(value)

    def copied_object(value: Any) -> Any:
        if id(value) in done:
            return done[id(value)]
        if isinstance(value, types.MethodType):
            return functools.partial(substitute(value.__func__), substitute(value.__self__))
        if isinstance(value, functools.partial):
            given = {name: substitute(v) for name, v in value.keywords.items()}
            return functools.partial(substitute(value.func), *map(substitute, value.args), **given)
        if type(value) in {list, tuple}:
            return type(value)(map(substitute, value))
        if type(value) is dict:
            return {key: substitute(v) for key, v in value.items()}
        if isinstance(value, functools._lru_cache_wrapper):
            return substitute(value.__wrapped__)
        twin = value if type(value).__module__.partition(".")[0] in _LIBRARIES else _twin(value, substitute, done)
        done[id(value)] = done[id(twin)] = twin
        alive.append(value)  # lest another object gets its number
        return twin

    def copy(f: types.FunctionType) -> Any:
        if id(f) in done:
            return done[id(f)]
        scope: dict[str, Any] = {"__builtins__": f.__globals__.get("__builtins__", builtins)}
        scope["__warningregistry__"] = f.__globals__.setdefault("__warningregistry__", {})  # a line of f warns once
        cells = tuple(types.CellType() for _ in f.__closure__ or ())
        twin = types.FunctionType(f.__code__, scope, f.__name__, None, cells)
        done[id(f)] = twin  # before anything is looked up in f: it may call itself
        names = global_names(f.__code__)
        scope.update({n: substitute(f.__globals__[n]) for n in names if n in f.__globals__})
        for name in names - f.__globals__.keys():
            if (value := getattr(builtins, name, None)) is not None and callable(value):
                scope[name] = substitute(value)
        for cell, original in zip(cells, f.__closure__ or (), strict=True):
            cell.cell_contents = substitute(original.cell_contents)
        twin.__defaults__ = tuple(substitute(v) for v in f.__defaults__) if f.__defaults__ else None
        twin.__kwdefaults__ = {k: substitute(v) for k, v in f.__kwdefaults__.items()} if f.__kwdefaults__ else None
        done[id(f)] = finished = finish(twin)
        scope.update({n: finished for n, value in scope.items() if value is twin})
        for cell in cells:
            if cell.cell_contents is twin:
                cell.cell_contents = finished
        return finished

    return substitute(function) if inside else _rebind_callable(getattr(function, "py_func", function), copy)


_LIBRARIES = sys.stdlib_module_names | {"numpy", "scipy", "numba", "cellmap"}
"""Packages whose objects are not copied."""


def _twin(value: Any, substitute: Callable[[Any], Any], done: dict[int, Any]) -> Any:
    """Return a copy of an object whose methods are copies, and whose attributes are substituted when they are read.

    An object that cannot be copied is returned as it is.
    """
    kind: Any = type(value)
    kinds = [base for base in reversed(kind.__mro__) if base.__module__.partition(".")[0] not in _LIBRARIES]

    def read(self: Any, name: str) -> Any:
        found = kind.__getattribute__(self, name)
        return found if getattr(found, "__self__", None) is self else substitute(found)

    try:
        copied = type(kind)(kind.__name__, (kind,), {"__slots__": (), "__getattribute__": read})
        twin = object.__new__(copied)
        state = object.__getstate__(value)  # of attributes, or of these and of slots
        for part in state if isinstance(state, tuple) else (state,):
            for name, attribute in (part or {}).items():
                object.__setattr__(twin, name, attribute)
        done[id(value)] = done[id(twin)] = twin
        for base in kinds:
            for name, attribute in vars(base).items():
                if isinstance(attribute, types.FunctionType) and name not in {"__new__", "__getattribute__"}:
                    setattr(copied, name, substitute(attribute))
                elif read_by := getattr(attribute, "fget", None) or getattr(attribute, "func", None):  # a property
                    setattr(copied, name, property(substitute(read_by)))
    except TypeError:
        return value
    return twin


def uses_numpy(item: Any, seen: set[int] | None = None) -> bool:
    """Tell whether a function, or one that it calls, may compute with NumPy's numbers: it reads NumPy, or an object.

    Examples
    --------
    >>> uses_numpy(lambda x: math.sin(x)), uses_numpy(lambda x: np.sin(x))
    (False, True)
    """
    seen = set() if seen is None else seen
    if (
        id(item) in seen
        or item is None
        or (isinstance(item, int | float | str | type) and not isinstance(item, np.generic))
    ):
        return False
    seen.add(id(item))
    item = getattr(item, "py_func", item)
    inner: list[Any]
    if isinstance(item, types.FunctionType):
        names = global_names(item.__code__)
        inner = [item.__globals__[n] for n in names if n in item.__globals__]
        inner += [c.cell_contents for c in item.__closure__ or ()]
        inner += [*(item.__defaults__ or ()), *(item.__kwdefaults__ or {}).values()]
        if "numpy" in names_in(item.__code__):
            return True
    elif isinstance(item, functools.partial):
        inner = [item.func, *item.args, *item.keywords.values()]
    elif isinstance(item, list | tuple):
        inner = list(item)
    else:
        return not (
            item is math or (isinstance(item, types.BuiltinFunctionType) and item.__module__ in {"math", "builtins"})
        )
    return any(uses_numpy(part, seen) for part in inner)


def over_arrays(function: Callable[..., Any]) -> Callable[..., Any]:
    """Copy a plain function of numbers into one of arrays.

    Examples
    --------
    >>> from math import sin
    >>> over_arrays(lambda angle: 2 * sin(angle))(np.zeros(3))
    array([0., 0., 0.])
    """
    return rebind(function, ARRAY_FUNCTIONS)


def _rebind_callable(function: Any, copy: Callable[[types.FunctionType], Any]) -> Callable[..., Any]:
    if isinstance(function, functools.partial):
        return functools.partial(_rebind_callable(function.func, copy), *function.args, **function.keywords)
    if isinstance(function, types.MethodType):
        return functools.partial(copy(function.__func__), function.__self__)  # type: ignore[arg-type]
    if isinstance(function, types.FunctionType):
        return copy(function)
    call = type(function).__call__
    return functools.partial(copy(call), function) if isinstance(call, types.FunctionType) else function


@functools.lru_cache(maxsize=1024)
def global_names(code: types.CodeType) -> frozenset[str]:
    """Return the names that code, and the code inside it, looks up among globals."""
    looked_up = {"LOAD_GLOBAL", "LOAD_NAME"}
    return frozenset(
        i.argval for part in _with_inner(code) for i in dis.get_instructions(part) if i.opname in looked_up
    )


@functools.lru_cache(maxsize=1024)
def names_in(code: types.CodeType) -> frozenset[str]:
    """Return all names outside of it that code, and the code inside it, mentions, those of attributes among them."""
    return frozenset(name for part in _with_inner(code) for name in part.co_names)


def _with_inner(code: types.CodeType) -> Iterator[types.CodeType]:
    yield code
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _with_inner(constant)
