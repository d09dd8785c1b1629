"""Parts of a scene: records of numbers with bounds and physical dimensions."""

from __future__ import annotations

from dataclasses import MISSING, dataclass, field, fields
from typing import Any

from cellmap.utils import check_length, finite_number, shown

Dimension = tuple[int, int, int]
"""Powers of length, time and mass."""

NUMBER: Dimension = (0, 0, 0)
LENGTH: Dimension = (1, 0, 0)
TIME: Dimension = (0, 1, 0)
MASS: Dimension = (0, 0, 1)
INERTIA: Dimension = (2, 0, 1)
RATE: Dimension = (0, -1, 0)
ACCELERATION: Dimension = (1, -2, 0)
ANGULAR_ACCELERATION: Dimension = (0, -2, 0)

MOST_RADIANS = 1e6
"""Largest phase; beyond it, significant digits are lost."""


def quantity(
    dimension: Dimension, *, default: Any = MISSING, each: str = "", per_joint: bool = False, **bounds: float
) -> Any:
    """Return a dataclass field of a quantity.

    Parameters
    ----------
    dimension : tuple of int
        Powers of length, time and mass, such as `LENGTH`.
    default : float, optional
        Value where none is given.
    each : str, optional
        For a sequence of numbers, the name of one: the parameters are ``each_1``, ``each_2``, ...
    per_joint : bool, optional
        Whether a sequence with a number for each joint may be given in place of one number for all joints: the
        parameters are then ``name_1``, ``name_2``, ..., by the name of the field.
    **bounds : float
        ``above=``, ``at_least=`` or ``at_most=`` a number.
    """
    return field(
        default=default, metadata={"dimension": dimension, "each": each, "per_joint": per_joint, "bounds": bounds}
    )


@dataclass(frozen=True)
class Part:
    """A part of a scene: its fields are finite numbers, within bounds, and parameters of the equation of motion.

    A field may also be a sequence of numbers; see :func:`quantity`.

    Raises
    ------
    TypeError, ValueError
        For values that are not finite numbers within their bounds.
    """

    def __post_init__(self) -> None:
        for f in fields(self):
            value = getattr(self, f.name)
            if each := _name_of_one(f, value):
                if not is_iterable(value):
                    raise TypeError(f"{f.name}={value!r}: give a sequence of numbers")
                check_length(f.name, value, levels=0)
                value = tuple(_number(f, f"{each}_{i}", v) for i, v in enumerate(value, start=1))
                if not value:
                    raise ValueError(f"{f.name}={value!r}: give at least one number")
            else:
                value = _number(f, f.name, value)
            object.__setattr__(self, f.name, value)

    @property
    def parameters(self) -> dict[str, float]:
        """Parameters by name."""
        found: dict[str, float] = {}
        for f in fields(self):
            value = getattr(self, f.name)
            each = _name_of_one(f, value)
            found |= {f"{each}_{i}": v for i, v in enumerate(value, start=1)} if each else {f.name: value}
        return found


def _name_of_one(f: Any, value: Any) -> str:
    """Return the name of one of the numbers of a sequence; an empty one where there is a single number."""
    if f.metadata.get("per_joint") and is_iterable(value):
        return str(f.name)
    return f.metadata.get("each", "")


def is_iterable(value: Any) -> bool:
    """Tell whether a value is no text and can be iterated over: an array without axes has an iterator that fails."""
    return hasattr(value, "__iter__") and not isinstance(value, str) and getattr(value, "ndim", 1) > 0


def _number(f: Any, name: str, value: Any) -> float:
    return sized_number(name, value, **f.metadata.get("bounds", {}))


def sized_number(name: str, value: Any, largest: float = 1e50, **bounds: float) -> float:
    """Return a finite float within bounds that is 0 or of a size whose powers and quotients do not overflow."""
    number = finite_number(name, value, **bounds)
    if number and not 1.0 / largest <= abs(number) <= largest:
        raise ValueError(f"{name}={shown(value)}: give a number between {1.0 / largest:g} and {largest:g} in size")
    return number
