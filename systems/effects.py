"""Effects that act on a body: each a record of its parameters, with its terms in the equation of motion.

A new effect is one frozen dataclass here.  Its fields are parameters of the right-hand side, by the same names.  Its
terms are plain functions; they read parameters as ``p.name`` and hold no values themselves, so that scenes of the same
effects share one compiled kernel.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from math import cos, pi
from typing import Any

from cellmap.checks import finite_number

FieldTerm = Callable[[float, Any], float]
JointTerm = Callable[[float, float, float, Any], float]
PeriodTerm = Callable[[Any], float]


@dataclass(frozen=True)
class Terms:
    """What effects contribute to an equation of motion, channel by channel; None where an effect has no part in one.

    Parameters
    ----------
    vertical : callable or None
        ``vertical(t, p)``: weight per mass in the frame of the pivot (m/s^2), positive down.  Gravity, or the upward
        acceleration of the pivot.
    joint : callable or None
        ``joint(t, angle, rate, p)``: angular acceleration of a link about its joint (rad/s^2), from the joint's angle
        (rad) and rate (rad/s).
    period : callable or None
        ``period(p)``: time after which the effect repeats itself (s); None for a steady effect.
    """

    vertical: FieldTerm | None = None
    joint: JointTerm | None = None
    period: PeriodTerm | None = None


def bounded(**bounds: float) -> Any:
    """Return a dataclass field whose value is checked: ``above=`` or ``at_least=`` a number."""
    return field(metadata=bounds)


@dataclass(frozen=True)
class Part:
    """A part of a scene: its fields are finite numbers, within bounds, and parameters of the equation of motion."""

    def __post_init__(self) -> None:
        for f in fields(self):
            object.__setattr__(self, f.name, finite_number(f.name, getattr(self, f.name), **f.metadata))

    @property
    def parameters(self) -> dict[str, float]:
        """Parameters by name."""
        return {f.name: getattr(self, f.name) for f in fields(self)}


@dataclass(frozen=True)
class Effect(Part):
    """An effect.  Equal kinds of effects return equal terms: the same functions, whatever the parameters."""

    @property
    def terms(self) -> Terms:
        """Terms in the equation of motion."""
        raise NotImplementedError

    @property
    def vanishes(self) -> bool:
        """Whether the effect does nothing, so that a scene leaves it out."""
        raise NotImplementedError


@dataclass(frozen=True)
class Gravity(Effect):
    """Uniform gravity.

    Parameters
    ----------
    gravity : float
        Acceleration of free fall (m/s^2), positive downward.

    Examples
    --------
    >>> Gravity(9.8).parameters
    {'gravity': 9.8}
    """

    gravity: float

    @property
    def terms(self) -> Terms:
        """Weight."""
        return Terms(vertical=_weight)

    @property
    def vanishes(self) -> bool:
        """Whether nothing falls."""
        return self.gravity == 0.0


def _weight(t: float, p: Any) -> float:
    return p.gravity


@dataclass(frozen=True)
class VerticalDrive(Effect):
    """Pivot at the height A cos(w t + phase), positive up, with w = 2 pi `frequency`.

    Parameters
    ----------
    amplitude : float
        Amplitude A of the pivot's height (m), at least 0; for the opposite sign shift the phase by pi.
    frequency : float
        Frequency (Hz), above 0.
    phase : float, optional
        Phase (rad).

    Examples
    --------
    >>> VerticalDrive(amplitude=0.003, frequency=50.0).parameters
    {'amplitude': 0.003, 'frequency': 50.0, 'phase': 0.0}
    """

    amplitude: float = bounded(at_least=0.0)
    frequency: float = bounded(above=0.0)
    phase: float = 0.0

    @property
    def terms(self) -> Terms:
        """Acceleration of the pivot."""
        return Terms(vertical=_acceleration_of_pivot, period=_period)

    @property
    def vanishes(self) -> bool:
        """Whether the pivot rests."""
        return self.amplitude == 0.0


def _acceleration_of_pivot(t: float, p: Any) -> float:
    w = 2.0 * pi * p.frequency
    return -(p.amplitude * w * w) * cos(w * t + p.phase)


def _period(p: Any) -> float:
    return 1.0 / p.frequency


@dataclass(frozen=True)
class ViscousDamping(Effect):
    """Damping in proportion to the rate of the joint.

    Parameters
    ----------
    damping : float
        Angular deceleration per rate (1/s), at least 0.

    Examples
    --------
    >>> ViscousDamping(-1.0)
    Traceback (most recent call last):
    ...
    ValueError: damping=-1.0: give a number of at least 0
    """

    damping: float = bounded(at_least=0.0)

    @property
    def terms(self) -> Terms:
        """Friction at the joint."""
        return Terms(joint=_friction)

    @property
    def vanishes(self) -> bool:
        """Whether the joint runs freely."""
        return self.damping == 0.0


def _friction(t: float, angle: float, rate: float, p: Any) -> float:
    return -p.damping * rate
