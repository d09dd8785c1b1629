"""Intervals of parameters and limits of continuations: what users give, checked, and what is shown to them."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from .._lib.arrays import Floats
from .._lib.checks import finite_number, known_parameter, pair_of, shown, whole_number

_NAMES = "the names of two parameters"


def limits_of(step: float, max_points: int) -> tuple[float, int]:
    """Return the longest step and the largest number of points, checked."""
    return finite_number("step", step, above=0.0, at_most=1.0), whole_number("max_points", max_points, at_least=1)


def interval_of(label: str, given: tuple[float, float], value: float) -> tuple[float, float]:
    """Return the interval of a parameter, which contains its present value."""
    ends = pair_of(label, given)
    low, high = (finite_number(f"{label}[{k}]", end) for k, end in enumerate(ends))
    if not low <= value <= high or low == high:
        raise ValueError(f"{label}={given!r}: give an interval that contains the present value {value:g}")
    return low, high


def interval_between(
    lower: float, upper: float, value: float | None = None, what: str = "the present value "
) -> tuple[float, float]:
    """Return the ends of an interval of parameter values, which contains one of them if that is given."""
    low, high = finite_number("lower", lower), finite_number("upper", upper)
    if not low < high:
        raise ValueError(f"upper={upper!r}: give a number above lower={lower!r}")
    if value is not None and not low <= value <= high:
        raise ValueError(f"lower={lower!r}, upper={upper!r}: the interval must contain {what}{value:g}")
    return low, high


def further_parameter(name: str, params: Collection[str], used: Sequence[str]) -> str:
    """Return the name of a parameter that is free besides those used already, checked."""
    if not isinstance(name, str) or name not in params or name in used:
        others = sorted(set(params) - set(used))
        raise ValueError(f"parameter={shown(name)}: give another parameter of this map, one of {others}")
    return name


def two_parameters(given: tuple[str, str], params: Mapping[str, float]) -> tuple[str, str]:
    """Return the names of two different parameters of a map, checked."""
    one, two = (known_parameter("parameters", name, params) for name in pair_of("parameters", given, _NAMES))
    if one == two:
        raise ValueError(f"parameters={given!r}: give two different parameters")
    return one, two


def axis_of(label: str, given: Any) -> tuple[Any, Any]:
    """Return a parameter's name and its values, not checked, of the argument for an axis."""
    try:
        name, values = given
    except (TypeError, ValueError):
        raise TypeError(f"{label}={shown(given)}: give a pair of a parameter's name and its values") from None
    return name, values


def place_of(parameters: tuple[str, ...], values: Floats) -> str:
    """Return the values (m,) of the parameters, in words."""
    return ", ".join(f"{name}={value:.10g}" for name, value in zip(parameters, values.tolist(), strict=True))


def spans(parameters: tuple[str, ...], values: Floats) -> str:
    """Return the intervals of the parameters in which values (n, m) lie, in words."""
    columns = zip(parameters, values.T, strict=True)
    return ", ".join(f"{name} from {column.min():.6g} to {column.max():.6g}" for name, column in columns)
