"""Conversion of bodies and effects to other units of length, time and mass, and back."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields, replace
from math import pi, sqrt
from typing import Any, TypeVar

from .quantities import LENGTH, MASS, TIME, Dimension, Part, quantity, sized_number

_LARGEST = 1e40  # size of what units are made from: quotients of these are sizes as well

P = TypeVar("P", bound=Part)

_WRITTEN = {
    "length": "m",
    "mass": "kg",
    "inertia": "kg m²",
    "distance": "m",
    "gravity": "m/s²",
    "amplitude": "m",
    "frequency": "Hz",
    "phase": "rad",
    "damping": "1/s",
    "drag": "1/rad",
    "friction": "rad/s²",
    "stiffness": "1/s²",
    "rest": "rad",
    "torque": "rad/s²",
    "acceleration": "m/s²",
}
"""Units of parameters of systems in SI units, by the last words of their names."""


def parameter_units(names: Iterable[str]) -> dict[str, str]:
    """Return the units of parameters of a system in SI units."""
    stems = {name: name.rstrip("_0123456789").rpartition("_")[2] for name in names}
    return {name: _WRITTEN[stem] for name, stem in stems.items() if stem in _WRITTEN}


@dataclass(frozen=True)
class Units(Part):
    """Units of length, time and mass.

    Parameters
    ----------
    length : float, optional
        Unit of length (m), above 0.
    time : float, optional
        Unit of time (s), above 0.
    mass : float, optional
        Unit of mass (kg), above 0.

    Raises
    ------
    TypeError, ValueError
        For units that are not finite numbers above 0.

    Examples
    --------
    >>> Units(length=2.0).inverse
    Units(length=0.5, time=1.0, mass=1.0)
    """

    length: float = quantity(LENGTH, default=1.0, above=0.0)
    time: float = quantity(TIME, default=1.0, above=0.0)
    mass: float = quantity(MASS, default=1.0, above=0.0)

    @property
    def inverse(self) -> Units:
        """Units of the inverse conversion."""
        return Units(1.0 / self.length, 1.0 / self.time, 1.0 / self.mass)

    def of(self, dimension: Dimension) -> float:
        """Return the unit of a quantity with these powers of length, time and mass."""
        scale: float = self.length ** dimension[0] * self.time ** dimension[1] * self.mass ** dimension[2]
        return scale


def in_units(part: P, units: Units) -> P:
    """Return a part with its quantities measured in other units.

    Parameters
    ----------
    part : Part
        A body or an effect.
    units : Units
        New units, in terms of the present ones; ``units.inverse`` converts back.

    Returns
    -------
    Part
        The same kind of part with other numbers.

    Raises
    ------
    TypeError
        For a field without a dimension, and for something that is not a part.

    Examples
    --------
    >>> from systems import Gravity
    >>> in_units(Gravity(9.8), Units(length=4.9, time=0.5))
    Gravity(gravity=0.5)
    """
    if not isinstance(units, Units):
        raise TypeError(f"units={units!r}: give Units, such as Units(length=0.0272, time=0.003)")
    if not isinstance(part, Part):
        raise TypeError(f"part={part!r}: give a body or an effect, such as Gravity(9.8)")
    changes: dict[str, Any] = {}
    for f in fields(part):
        if "dimension" not in f.metadata:
            raise TypeError(f"{type(part).__name__}.{f.name} has no dimension: declare it with quantity(...)")
        unit, value = units.of(f.metadata["dimension"]), getattr(part, f.name)
        changes[f.name] = tuple(v / unit for v in value) if isinstance(value, tuple) else value / unit
    return replace(part, **changes)


def drive_units(length: float, frequency: float, mass: float = 1.0) -> Units:
    """Return units of a length l, of the time 1/w with w = 2 pi `frequency`, and of a mass.

    In them gravity is alpha = g/(l w^2), an amplitude beta = A/l, a damping gamma/w and a dry friction delta/w^2.

    Parameters
    ----------
    length : float
        Length l (m), above 0.
    frequency : float
        Frequency (Hz), above 0.
    mass : float, optional
        Mass (kg), above 0.

    Returns
    -------
    Units
        Units for :func:`in_units` and :func:`scene`; their ``inverse`` converts back.

    Raises
    ------
    TypeError, ValueError
        For values that are not finite numbers above 0.

    Examples
    --------
    >>> from systems import VerticalDrive
    >>> in_units(VerticalDrive(0.003, 50.0), drive_units(length=0.0272, frequency=50.0)).amplitude
    0.11029411764705883
    """
    w = 2.0 * pi * sized_number("frequency", frequency, _LARGEST, above=0.0)
    return Units(
        sized_number("length", length, _LARGEST, above=0.0), 1.0 / w, sized_number("mass", mass, _LARGEST, above=0.0)
    )


def swing_units(length: float, gravity: float = 9.8, mass: float = 1.0) -> Units:
    """Return the units of a length l, of the time 1/w0 of small free swings, w0 = sqrt(g/l), and of a mass.

    In them gravity is 1 and an amplitude is epsilon = A/l = A w0^2/g.

    Parameters
    ----------
    length : float
        Length l (m), above 0.
    gravity : float, optional
        Acceleration g of free fall (m/s^2), above 0.
    mass : float, optional
        Mass (kg), above 0.

    Returns
    -------
    Units
        Units for :func:`in_units` and :func:`scene`.

    Raises
    ------
    TypeError, ValueError
        For values that are not finite numbers above 0.

    Examples
    --------
    >>> from systems import Gravity
    >>> in_units(Gravity(9.8), swing_units(length=0.0272))
    Gravity(gravity=1.0)
    """
    free_fall = sized_number("gravity", gravity, _LARGEST, above=0.0)
    rod = sized_number("length", length, _LARGEST, above=0.0)
    return Units(rod, sqrt(rod / free_fall), sized_number("mass", mass, _LARGEST, above=0.0))


def effect_in_units(name: str, effect: Callable[[float], P], size: float, units: Units) -> P:
    """Return an effect of a size, measured in other units; an error names the size."""
    try:
        return in_units(effect(size), units)
    except ValueError as error:
        reason = str(error).replace("=", " ", 1)  # of the effect, whose parameter is none of the caller's
        raise ValueError(f"{name}={size!r}: give a number that is moderate in these units too ({reason})") from None
