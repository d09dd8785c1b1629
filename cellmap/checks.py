"""Checks of arguments, with errors that name the argument, the value and the remedy."""

from __future__ import annotations

import errno
import logging
import os
import shutil
from collections.abc import Mapping
from keyword import iskeyword
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


def finite_number(
    name: str, value: Any, *, above: float | None = None, at_least: float | None = None, at_most: float | None = None
) -> float:
    """Return a finite float, within bounds."""
    try:
        if isinstance(value, str | bytes):
            raise TypeError
        number = float(value)
    except (TypeError, ValueError):
        raise TypeError(f"{name}={value!r}: give one real number") from None
    if not np.isfinite(number):
        raise ValueError(f"{name}={value!r}: give a finite number")
    if above is not None and not number > above:
        raise ValueError(f"{name}={value!r}: give a number above {above:g}")
    if at_least is not None and not number >= at_least:
        raise ValueError(f"{name}={value!r}: give a number of at least {at_least:g}")
    if at_most is not None and not number <= at_most:
        raise ValueError(f"{name}={value!r}: give a number of at most {at_most:g}")
    return number


def whole_number(name: str, value: Any, at_least: int = 0, at_most: int = 2**62) -> int:
    """Return an int, within bounds."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        raise TypeError(f"{name}={value!r}: give a whole number")
    if value < at_least:
        raise ValueError(f"{name}={value!r}: give a whole number of at least {at_least}")
    if value > at_most:
        raise ValueError(f"{name}={value!r}: give a whole number of at most {at_most}")
    return int(value)


def one_of(name: str, value: Any, choices: tuple[Any, ...]) -> Any:
    """Return a value that is among the choices."""
    if value not in choices:
        raise ValueError(f"{name}={value!r}: choose one of {', '.join(map(repr, choices))}")
    return value


def finite_points(name: str, points: ArrayLike, dimension: int) -> NDArray[np.float64]:
    """Return points as a new C-contiguous array of shape (..., dimension), all finite."""
    try:
        array = np.array(points, dtype=np.float64, order="C")
    except (TypeError, ValueError):
        raise TypeError(f"{name}: give real numbers in an array of shape (..., {dimension})") from None
    if array.ndim == 0 or array.shape[-1] != dimension:
        raise ValueError(f"{name} has shape {array.shape}: its last axis must hold the {dimension} state variables")
    if not np.isfinite(array).all():
        bad = np.argwhere(~np.isfinite(array))[0]
        raise ValueError(f"{name}{[int(i) for i in bad]} = {array[tuple(bad)]}: remove starts that are not finite")
    return array


def monotone_values(name: str, given: ArrayLike) -> NDArray[np.float64]:
    """Return values of a parameter as a new array (n,) of floats: finite, strictly increasing or decreasing."""
    try:
        values = np.array(given, dtype=np.float64)
    except (TypeError, ValueError):
        raise TypeError(f"{name}: give real numbers, one for each step") from None
    if values.ndim != 1 or not values.size:
        raise ValueError(f"{name} has the shape {values.shape}: give a list of at least one value")
    if not np.isfinite(values).all():
        raise ValueError(f"{name} has the value {values[~np.isfinite(values)][0]}: give finite numbers")
    steps = np.diff(values)
    if not ((steps > 0.0).all() or (steps < 0.0).all()):
        raise ValueError(f"{name} goes up and down, or repeats a value: sort it, and give each value once")
    return values


def parameter_values(params: Mapping[str, Any]) -> dict[str, float]:
    """Return parameters as floats, in the order given."""
    if not isinstance(params, Mapping):
        raise TypeError(f"params={params!r}: give a mapping of names to numbers, such as {{'delta': 0.15}}")
    for name in params:
        if not isinstance(name, str) or not name.isidentifier() or iskeyword(name) or name.startswith("_"):
            raise ValueError(
                f"params has the name {name!r}: give Python identifiers, no keywords, without a leading underscore"
            )
    return {name: finite_number(f"params[{name!r}]", value) for name, value in params.items()}


def memory_available() -> int | None:
    """Return the bytes of memory that are free now, None where the system does not say."""
    try:
        return os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, OSError, ValueError):
        return None


def claim_memory(what: str, needed: int, remedy: str) -> None:
    """Say on the logger "cellmap" what a job will need; raise MemoryError where that is more memory than is free."""
    logging.getLogger("cellmap").info("%s: %s of memory", what, in_bytes(needed))
    free = memory_available()
    if free is not None and needed > free:
        raise MemoryError(f"{what} needs {in_bytes(needed)} and {in_bytes(free)} are free: {remedy}")


def claim_disk(what: str, needed: int, path: Path, remedy: str) -> None:
    """Say on the logger "cellmap" what a file will need; raise OSError where that is more than is free on its disk."""
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
