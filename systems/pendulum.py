"""Single pendulum on a vertically driven pivot, in SI units."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import sin
from typing import Any

from cellmap import Coordinate, ForcedSystem, angle
from cellmap.system import RightHandSide

from .effects import FieldTerm, Gravity, JointTerm, Terms, VerticalDrive, ViscousDamping, bounded
from .scene import Body, scene, total


@dataclass(frozen=True)
class Pendulum(Body):
    """Point mass on a massless rod: theta'' = joint - (vertical / length) sin theta.

    Parameters
    ----------
    length : float
        Length of the rod (m), above 0; for a compound pendulum the effective length.
    """

    coordinates = (angle("theta"), Coordinate("theta'", "rad/s"))
    length: float = bounded(above=0.0)

    @staticmethod
    def compose(terms: Sequence[Terms]) -> RightHandSide:
        """Return the right-hand side."""
        return swing(terms, _per_length)


def _per_length(field: FieldTerm) -> FieldTerm:
    def field_per_length(t: float, p: Any) -> float:
        return field(t, p) / p.length

    return field_per_length


def driven_pendulum(
    length: float = 0.0272,
    amplitude: float = 0.003,
    frequency: float = 50.0,
    damping: float = 10.0,
    gravity: float = 9.8,
    phase: float = 0.0,
) -> ForcedSystem:
    """Return the pendulum whose pivot is at the height y(t) = A cos(w t + phase), in SI units.

    theta'' = -damping theta' - ((g + y'')/l) sin theta, with theta in rad from the downward vertical, counter-clockwise
    (0 hangs, pi stands inverted) and w = 2 pi `frequency`; the state is (theta, theta').

    Parameters
    ----------
    length : float, optional
        Length l of the rod (m), above 0.
    amplitude : float, optional
        Amplitude A of the pivot's height (m), at least 0.  With 0 there is no drive in the right-hand side, nor are
        there parameters of a drive; the period is still 1/`frequency`.
    frequency : float, optional
        Frequency of the drive (Hz), above 0.
    damping : float, optional
        Viscous damping (1/s), at least 0.
    gravity : float, optional
        Acceleration g of free fall (m/s^2).
    phase : float, optional
        Phase of the drive (rad).

    Returns
    -------
    ForcedSystem
        System of period 1/`frequency` (s).  The defaults are the rod, drive and damping whose inverted state is stable.

    Raises
    ------
    TypeError, ValueError
        For parameters that are not finite numbers within their bounds.

    References
    ----------
    Stephenson, Philosophical Magazine 15 (1908) 233; Kapitza, Soviet Physics JETP 21 (1951) 588; Blackburn, Smith,
    Gronbech-Jensen, American Journal of Physics 60 (1992) 903.

    Examples
    --------
    >>> driven_pendulum(amplitude=0.002).length
    0.02
    """
    effects = (Gravity(gravity), VerticalDrive(amplitude, frequency, phase), ViscousDamping(damping))
    return scene(Pendulum(length), *effects, name="driven pendulum")


def swing(terms: Sequence[Terms], scaled: Callable[[FieldTerm], FieldTerm] = lambda field: field) -> RightHandSide:
    """Return the right-hand side of one angle: a field that pulls it to zero, and accelerations about the joint.

    `scaled` turns the field into an angular acceleration per sine.
    """
    fields = [term.vertical for term in terms if term.vertical is not None]
    accelerations = [term.joint for term in terms if term.joint is not None]
    if fields:
        accelerations.insert(0, _pull(scaled(total(fields))))
    if not accelerations:
        return _free
    acceleration = total(accelerations)

    def motion(t: float, x: Sequence[float], p: Any) -> tuple[float, float]:
        angle, rate = x
        return rate, acceleration(t, angle, rate, p)

    return motion


def _pull(field: FieldTerm) -> JointTerm:
    def pull(t: float, angle: float, rate: float, p: Any) -> float:
        return -field(t, p) * sin(angle)

    return pull


def _free(t: float, x: Sequence[float], p: Any) -> tuple[float, float]:
    return x[1], 0.0
