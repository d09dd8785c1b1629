"""Checks of arguments, with errors that name the argument, the value and the remedy."""

from __future__ import annotations

import dataclasses
import errno
import functools
import importlib
import logging
import os
import re
import shutil
import sys
import warnings
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from itertools import islice
from keyword import iskeyword
from math import isfinite, nan
from pathlib import Path
from reprlib import Repr
from types import SimpleNamespace
from typing import Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .arrays import Floats, Ints
from .memory import memory_available

_PACKAGE = str(Path(__file__).parents[1]) + os.sep
_NOT_A_CALLER = _PACKAGE, functools.__file__
_ALWAYS_FREE = 2**24  # bytes
_ROOT = __name__.split(".")[0]
_SURROGATE = re.compile("[\ud800-\udfff]")
_LONGEST = 10**7  # entries of what holds none of them in memory, such as a range: going through so many takes seconds
_NESTED = 8  # levels of lists that are looked through
_SINGLE = {float, int, bool, str, bytes, complex, type(None), np.float64, np.int64, np.bool_}
_KEPT = 40  # characters of a long word at each of its ends
_LONG_WORD = re.compile(rf"\S{{{2 * _KEPT + 3},}}")


class _Shown(Repr):
    """Representations of values in messages: short, whatever they are."""

    def __init__(self) -> None:
        super().__init__()
        self.maxstring = self.maxother = self.maxlong = 2 * _KEPT
        self.maxtuple = self.maxlist = self.maxdict = 8


_shown = _Shown()


def shown(value: Any) -> str:
    """Write a value for a message: on one line, and a long one in part."""
    try:
        return " ".join(_shown.repr(value).split())
    except Exception:  # of a foreign class, or an int of more digits than Python writes
        return f"<{type(value).__name__}>"


def abridged(message: str) -> str:
    """Return a message with long words, and a long message, written in part: its beginning and its end."""
    words = _LONG_WORD.sub(lambda word: f"{word[0][:_KEPT]}...{word[0][-_KEPT:]}", message)
    half = 8 * _KEPT
    return words if len(words) <= 2 * half else f"{words[:half]} ... {words[-half:]}"


def real_number(name: str, value: Any) -> float:
    """Return a float, which need not be finite."""
    if isinstance(value, float):
        return value
    unlike = isinstance(value, str | bytes | complex | np.complexfloating)
    try:
        if unlike or (isinstance(value, np.ndarray) and (value.ndim or value.dtype.kind not in "fiub")):
            raise TypeError
        return float(value)
    except (TypeError, ValueError):
        raise TypeError(f"{name}={shown(value)}: give one real number") from None
    except OverflowError:
        raise ValueError(f"{name}={shown(value)}: give a number that floating point can hold") from None


def finite_number(
    name: str, value: Any, *, above: float | None = None, at_least: float | None = None, at_most: float | None = None
) -> float:
    """Return a finite float, within bounds."""
    number = real_number(name, value)
    if not isfinite(number):
        raise ValueError(f"{name}={shown(value)}: give a finite number")
    if above is not None and not number > above:
        raise ValueError(f"{name}={shown(value)}: give a number above {above:g}")
    if at_least is not None and not number >= at_least:
        raise ValueError(f"{name}={shown(value)}: give a number of at least {at_least:g}")
    if at_most is not None and not number <= at_most:
        raise ValueError(f"{name}={shown(value)}: give a number of at most {at_most:g}")
    return number + 0.0  # generators of random numbers take -0.0 for a negative number


def whole_number(name: str, value: Any, at_least: int = 0, at_most: int = 2**62) -> int:
    """Return an int, within bounds."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        whole = isinstance(value, float) and value.is_integer() and abs(value) < 2**53
        such = f", the int {int(value)}" if whole else ""
        raise TypeError(f"{name}={shown(value)}: give a whole number{such}")
    if value < at_least:
        raise ValueError(f"{name}={shown(value)}: give a whole number of at least {at_least}")
    if value > at_most:
        raise ValueError(f"{name}={shown(value)}: give a whole number of at most {at_most}")
    return int(value)


def text(name: str, value: Any) -> str:
    """Return a string, of characters that files and pages can hold."""
    if not isinstance(value, str):
        raise TypeError(f"{name}={shown(value)}: give a string")
    if not value.isascii() and _SURROGATE.search(value):
        raise ValueError(f"{name}={shown(value)}: give whole characters, no halves of a pair (surrogates)")
    return value


def label(name: str, value: Any) -> str:
    """Return a string that figures can show too: mathematics between dollar signs in it is such as can be set."""
    given = text(name, value)
    # What sets it is slow to import, and lives above.
    if "$" in given and (fault := importlib.import_module(f"{_ROOT}.plot._mathtext").fault_in(given)):
        raise ValueError(
            f"{name}={shown(given)}: its mathematics cannot be set in figures ({shown(fault)}); correct it, or "
            r"write \$ for the sign itself"
        )
    return given


def named(value: Any, function: Any) -> str:
    """Return the argument `name`, or the name of a function in its place."""
    return label("name", text("name", value) or getattr(function, "__name__", type(function).__name__))


def one_of(name: str, value: Any, choices: tuple[Any, ...]) -> Any:
    """Return a value that is among the choices."""
    if not np.isscalar(value) or value not in choices:
        named = (repr(str(c) if isinstance(c, str) else c) for c in choices)
        raise ValueError(f"{name}={shown(value)}: choose one of {', '.join(named)}")
    return value


def check_length(name: str, value: Any, levels: int = _NESTED) -> None:
    """Refuse ranges, and other sequences that claim too many entries to go through, alone or in what holds them.

    Arrays, and what turns into one by itself, hold their entries in memory already.
    """
    kind = type(value)
    if kind in _SINGLE or kind is np.ndarray:
        return
    if isinstance(value, list | tuple | dict):
        entries = value.values() if isinstance(value, dict) else value
        if levels and not _SINGLE.issuperset(map(type, entries)):
            for entry in entries:
                check_length(name, entry, levels - 1)
    elif hasattr(kind, "__len__") and hasattr(kind, "__getitem__") and not hasattr(kind, "__array__"):
        try:
            much = len(value) > _LONGEST
        except OverflowError:
            much = True
        except Exception:  # of a foreign class, whose entries then say what it is
            much = False
        if much and not isinstance(value, str | bytes | bytearray | memoryview | Mapping):
            raise ValueError(f"{name}={shown(value)}: give at most {_LONGEST:,} numbers")


def real_array(name: str, given: ArrayLike, what: str = "real numbers") -> Floats:
    """Return a new C-contiguous array of floats, which need not be finite; what is masked is NaN."""
    check_length(name, given)
    try:
        array = np.asarray(given)
        if array.dtype.kind == "O":
            return np.array([real_number(name, v) for v in array.flat]).reshape(array.shape)
        if array.dtype.kind not in "biuf":
            raise TypeError
        array = np.array(array, dtype=np.float64, order="C")
        if "numpy.ma" in sys.modules and np.ma.isMaskedArray(given):  # which takes time to load
            array[np.ma.getmaskarray(given)] = nan
        return array
    except (TypeError, ValueError, OverflowError):
        raise TypeError(f"{name}={shown(given)}: give {what}") from None


def is_sequence(value: Any) -> bool:
    """Whether a value has entries in an order, and is not text."""
    if isinstance(value, np.ndarray):
        return value.ndim > 0
    return isinstance(value, Sequence) and not isinstance(value, str | bytes | bytearray | memoryview)


def listed(name: str, value: Any) -> tuple[Any, ...]:
    """Return the entries of an iterable."""
    check_length(name, value)
    try:
        found = tuple(islice(value, _LONGEST + 1))
    except TypeError:
        raise TypeError(f"{name}={shown(value)}: give a sequence") from None
    if len(found) > _LONGEST:
        raise ValueError(f"{name}={shown(value)}: give at most {_LONGEST:,} entries")
    return found


def pair_of(name: str, value: Any, what: str = "two numbers, the ends of an interval") -> tuple[Any, Any]:
    """Return the two entries of an argument."""
    if not is_sequence(value) or len(value) != 2:
        raise TypeError(f"{name}={shown(value)}: give {what}")
    return value[0], value[1]


def of_the_user(name: str, function: Callable[..., Any], *arguments: Any) -> Any:
    """Return the result of a user's function; where the call fails, name the function in the error."""
    try:
        return function(*arguments)
    except Exception as error:
        raise ValueError(f"{name}={shown(function)} fails, {type(error).__name__}: {error}") from error


def array_of_any(name: str, given: Any, what: str) -> NDArray[Any]:
    """Return a value as an array, of whatever it holds; rows of different lengths are none."""
    check_length(name, given)
    try:
        return np.asarray(given)
    except (TypeError, ValueError):
        raise TypeError(f"{name}={shown(given)}: give {what}") from None


def whole_array(name: str, given: ArrayLike, what: str = "whole numbers") -> Ints:
    """Return an array of whole numbers; a new one, unless they are int64 already."""
    array = array_of_any(name, given, what)
    if array.dtype.kind not in "biu" and array.size:
        raise TypeError(f"{name}={shown(given)}: give {what}")
    if array.dtype.kind == "u" and array.size and array.max() > 2**62:
        raise ValueError(f"{name}={shown(given)}: give whole numbers of at most 2**62")
    return array.astype(np.int64, copy=False)


def finite_points(name: str, points: ArrayLike, dimension: int) -> Floats:
    """Return points as a new C-contiguous array of shape (..., dimension), all finite."""
    array = real_array(name, points, f"real numbers in an array of shape (..., {dimension})")
    if array.ndim == 0 or array.shape[-1] != dimension:
        first = array.ndim > 1 and array.shape[0] == dimension
        remedy = f"; the first one does, so give np.moveaxis({name}, 0, -1)" if first else ""
        raise ValueError(
            f"{name} has shape {array.shape}: its last axis must hold the {dimension} state variables{remedy}"
        )
    if not np.isfinite(array).all():
        bad = np.argwhere(~np.isfinite(array))[0]
        raise ValueError(f"{name}{[int(i) for i in bad]} = {array[tuple(bad)]}: remove points that are not finite")
    return array


def one_point(name: str, point: ArrayLike, dimension: int) -> Floats:
    """Return one point as a new array (dimension,), all finite; one number for one dimension may stand by itself."""
    array = real_array(name, point, f"{dimension} real numbers")
    if array.shape != (dimension,) and not array.ndim == 0 < dimension < 2:
        raise ValueError(f"{name} has shape {array.shape}: give one point, {dimension} numbers in a list")
    return finite_points(name, array.reshape(dimension), dimension)


def known_parameter(argument: str, name: Any, params: Mapping[str, float], what: str = "map") -> str:
    """Return the name of a parameter that is there."""
    if not isinstance(name, str) or name not in params:
        raise ValueError(f"{argument}={shown(name)}: this {what} has the parameters {sorted(params)}")
    return name


def parameter_intervals(given: Mapping[str, Any] | None, params: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """Return intervals of parameters by name, for the functions that prove something for all of their values."""
    if given is not None and not isinstance(given, Mapping):
        raise TypeError(f"parameters={shown(given)}: give intervals by names, such as {{'delta': (0.1, 0.2)}}")
    found = {}
    for name, value in ({} if given is None else given).items():
        known_parameter("parameters", name, params)
        low, high = pair_of("parameters", value)
        ends = finite_number(f"parameters[{name!r}]", low), finite_number(f"parameters[{name!r}]", high)
        if not ends[0] <= ends[1]:
            raise ValueError(f"parameters: {name}={value!r} is empty: give its lowest value first")
        found[name] = ends
    return found


def monotone_values(name: str, given: ArrayLike) -> Floats:
    """Return values of a parameter as a new array (n,) of floats: finite, strictly increasing or decreasing."""
    values = real_array(name, given, "real numbers, one for each step")
    if values.ndim != 1 or not values.size:
        raise ValueError(f"{name}={shown(given)}: give a list of at least one value")
    if not np.isfinite(values).all():
        raise ValueError(f"{name} has the value {values[~np.isfinite(values)][0]}: give finite numbers")
    steps = np.diff(values)
    if not ((steps > 0.0).all() or (steps < 0.0).all()):
        raise ValueError(f"{name} goes up and down, or repeats a value: sort it, and give each value once")
    return values


_MOST_NAMED = 12


def no_such_key(name: str, entries: Mapping[Any, Any], key: Any, meanings: Mapping[Any, str] | None = None) -> KeyError:
    """Return the error for a key that a dictionary of a name lacks: which there are, and what they mean."""
    names = meanings or {}
    keys = [f"{k!r} ({names[k]})" if k in names else repr(k) for k in [*entries][:_MOST_NAMED]]
    choice = f"choose one of {', '.join(keys)}" if keys else "it is empty"
    rest = f" and {len(entries) - len(keys):,} more" if len(entries) > len(keys) else ""
    return KeyError(f"{name}[{shown(key)}]: {choice}{rest}; {name}.get(key) is None for others")


class Parameters(dict[str, float]):
    """Values of parameters by name, which do not change: what is built from them would not follow."""

    def _refused(self, *_: Any, **__: Any) -> Any:
        raise TypeError(
            "params cannot be changed, for what is built from them would not follow: with_params(name=value) returns a "
            "system or map with other values"
        )

    def __missing__(self, name: Any) -> NoReturn:
        raise no_such_key("params", self, name)

    __setitem__ = __delitem__ = __ior__ = update = pop = popitem = clear = setdefault = _refused

    def __reduce__(self) -> tuple[Any, ...]:
        return Parameters, (dict(self),)


def check_mapping(name: str, value: Any, of: str) -> None:
    """Hold a value to a mapping, of what the remedy says."""
    if not isinstance(value, Mapping):
        raise TypeError(f"{name}={shown(value)}: give a mapping {of}")


def parameter_values(params: Any) -> dict[str, float]:
    """Return parameters as floats, in the order given: an array K as its entries, by names such as "K[0, 1]"."""
    if dataclasses.is_dataclass(params) and not isinstance(params, type):
        params = {f.name: getattr(params, f.name) for f in dataclasses.fields(params)}
    elif isinstance(params, SimpleNamespace) or hasattr(params, "_asdict"):
        params = params._asdict() if hasattr(params, "_asdict") else vars(params)
    check_mapping("params", params, "of names to numbers, such as {'delta': 0.15}")
    for name in params:
        base = name.partition("[")[0] if isinstance(name, str) and _ENTRY.fullmatch(name) else name
        if not isinstance(base, str) or not base.isidentifier() or iskeyword(base) or base.startswith("_"):
            raise ValueError(
                f"params has the name {name!r}: give Python identifiers, no keywords, without a leading underscore"
            )
    flat = parameter_entries(params)
    for name, value in flat.items():
        if isinstance(value, list | tuple):
            raise TypeError(
                f"params[{name!r}]={shown(value)}: give one real number, or an array of them, np.array(...)"
            )
    return Parameters({name: finite_number(f"params[{name!r}]", value) for name, value in flat.items()})


_ENTRY = re.compile(r"[^\W\d]\w*\[\d+(, \d+)*\]")


def parameter_entries(params: Mapping[str, Any]) -> dict[str, Any]:
    """Return parameters with each NumPy array as its entries."""
    flat: dict[str, Any] = {}
    for name, value in params.items():
        if isinstance(value, np.ndarray) and value.ndim:
            flat |= {f"{name}[{', '.join(map(str, place))}]": value[place] for place in np.ndindex(value.shape)}
        else:
            flat[name] = value
    return flat


def changed_parameters(params: Mapping[str, float], values: Any, named: Mapping[str, Any], what: str) -> dict[str, Any]:
    """Return the entries of changes, a mapping and those by name, all of which must be those of a system or map."""
    if values is not None and not isinstance(values, Mapping):
        raise TypeError(f"values={shown(values)}: give a dictionary of parameters, or parameters by their names")
    changes = {**(values or {}), **named}
    flat = parameter_entries(changes)
    if unknown := flat.keys() - params.keys():
        raise ValueError(f"params has no {sorted(unknown)}: this {what} has {sorted(params)}")
    for name, value in changes.items():
        own = sum(known.startswith(f"{name}[") for known in params)
        if isinstance(value, np.ndarray) and value.ndim and value.size != own:
            raise ValueError(f"{name} has the shape {value.shape}: this {what} has {own} entries of it, give them all")
    return flat


def parameters_in_words(params: Mapping[str, float]) -> str:
    """Return names and values on a line; of arrays the number of entries."""
    entries = Counter(name.partition("[")[0] for name in params if "[" in name)
    numbers = [f"{name}={value:g}" for name, value in params.items() if "[" not in name]
    return ", ".join([*numbers, *(f"{name}: {count} entries" for name, count in entries.items())])


def warn_caller(message: str, category: type[Warning] = UserWarning) -> None:
    """Warn at the line outside of this package that called into it."""
    frame, level = sys._getframe(1), 2
    while frame.f_back is not None and frame.f_code.co_filename.startswith(_NOT_A_CALLER):
        frame, level = frame.f_back, level + 1
    warnings.warn(message, category, stacklevel=level)


def affordable_number(name: str, value: Any, each: int, at_least: int = 0) -> int:
    """Return an int of which there is memory for: `each` bytes times it."""
    number = whole_number(name, value, at_least)
    claim_memory(f"{name}={value!r}", each * number, "give a smaller number")
    return number


def claim_memory(what: str, needed: int, remedy: str) -> None:
    """Log the memory that a job will need on "cellmap"; raise MemoryError where it is not free.

    What is free is asked of the system, which takes a millisecond: not for less than any process has.
    """
    logging.getLogger("cellmap").info("%s: %s of memory", what, in_bytes(needed))
    if needed <= _ALWAYS_FREE:
        return
    free = memory_available()
    if needed > free:
        raise MemoryError(f"{what} needs {in_bytes(needed)} and {in_bytes(free)} are free: {remedy}")


def claim_disk(what: str, needed: int, path: Path, remedy: str) -> None:
    """Log the disk space that a file will need on "cellmap"; raise OSError where it is not free."""
    logging.getLogger("cellmap").info("%s: %s on the disk", what, in_bytes(needed))
    free = shutil.disk_usage(path.parent).free
    if needed > free:
        raise OSError(errno.ENOSPC, f"{what} needs {in_bytes(needed)} and {in_bytes(free)} are free: {remedy}")


def in_bytes(count: float) -> str:
    """Write a number of bytes with a unit."""
    for unit in ("B", "kB", "MB", "GB"):
        if count < 1000:
            return f"{count:.3g} {unit}"
        count /= 1000
    return f"{count:.3g} TB"
