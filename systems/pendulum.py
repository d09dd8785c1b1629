"""Single pendulum on a driven pivot, in SI units."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import cos, sin
from typing import Any

from cellmap import Coordinate, ForcedSystem, angle
from cellmap.maps import RightHandSide, StateFunction
from cellmap.utils import finite_number

from .drives import VerticalDrive
from .effects import DryFriction, FieldTerm, Gravity, RubbingTerm, StoredTerm, ViscousDamping
from .forces import Forces, total
from .quantities import LENGTH, quantity
from .scenes import Body, TipsTerm, scene

ParameterTerm = Callable[[Any], float]


@dataclass(frozen=True)
class Pendulum(Body):
    """Point mass on a massless rod: theta'' = joint - (vertical / length) sin theta - (horizontal / length) cos theta.

    Its output "energy" is per mass (m^2/s^2).

    Parameters
    ----------
    length : float
        Length of the rod (m), above 0; for a compound pendulum the effective length.

    Examples
    --------
    >>> Pendulum(length=0.069).parameters
    {'length': 0.069}
    """

    length: float = quantity(LENGTH, above=0.0)

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """Angle and angular velocity."""
        return angle("theta"), Coordinate("theta'", "rad/s")

    @staticmethod
    def compose(forces: Forces) -> RightHandSide:
        """Return the right-hand side."""
        return swing(forces, _length)

    @staticmethod
    def tips(joints: int) -> TipsTerm:
        """Return the position of the mass relative to the pivot."""
        return tip_of(_length)

    @staticmethod
    def energy(forces: Forces) -> StateFunction:
        """Return kinetic and potential energy per mass."""
        return swing_energy(forces, inertia=_length_squared, moment=_length)


def _length(p: Any) -> float:
    return p.length


def _length_squared(p: Any) -> float:
    return p.length * p.length


def driven_pendulum(
    length: float = 0.0272,
    amplitude: float = 0.003,
    frequency: float = 50.0,
    damping: float = 10.0,
    gravity: float = 9.8,
    phase: float = 0.0,
    friction: float = 0.0,
) -> ForcedSystem:
    """Return the pendulum whose pivot is at the height y(t) = A cos(w t + phase), in SI units.

    theta'' = -damping theta' - friction sign(theta') - ((g + y'')/l) sin theta, with theta in rad from the downward
    vertical, counter-clockwise (0 hangs, pi stands inverted) and w = 2 pi `frequency`; the state is (theta, theta').

    Parameters
    ----------
    length : float, optional
        Length l of the rod (m), above 0.
    amplitude : float, optional
        Amplitude A of the pivot's height (m), at least 0.  With 0 the right-hand side and the parameters contain no
        drive; the period is still 1/`frequency`.
    frequency : float, optional
        Frequency of the drive (Hz), above 0.
    damping : float, optional
        Viscous damping (1/s), at least 0.
    gravity : float, optional
        Acceleration g of free fall (m/s^2).
    phase : float, optional
        Phase of the drive (rad).
    friction : float, optional
        Dry friction (rad/s^2), at least 0.  Above 0 the angular velocity is a switching function.

    Returns
    -------
    ForcedSystem
        System of period 1/`frequency` (s).  With the defaults, the inverted equilibrium is stable.

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
    effects = (
        Gravity(gravity),
        VerticalDrive(amplitude, frequency, phase),
        ViscousDamping(finite_number("damping", damping)),
        DryFriction(finite_number("friction", friction)),
    )
    return scene(Pendulum(length), *effects, name="driven pendulum")


def swing(forces: Forces, length: ParameterTerm | None = None) -> RightHandSide:
    """Return the right-hand side of one angle: torques of fields along their direction, accelerations about the joint.

    `length` is the effective length; without it fields are angular accelerations.
    """
    accelerations: list[Callable[..., float]] = []
    if forces.vertical is not None:
        accelerations.append(_pull(_per_length(forces.vertical, length)))
    if forces.horizontal is not None:
        accelerations.append(_sway(_per_length(forces.horizontal, length)))
    (joint,) = forces.joint
    if joint is not None:
        accelerations.append(_rubbed(joint) if forces.rubbing else _smooth(joint))
    if forces.torque is not None:
        accelerations.append(_turned(forces.torque))
    if not accelerations:
        return _free
    acceleration = total(accelerations)

    def motion(t: float, x: Sequence[float], p: Any, s: Sequence[float] = ()) -> tuple[float, float]:
        angle, rate = x
        return rate, acceleration(t, angle, rate, p, s)

    return motion


def tip_of(distance: ParameterTerm) -> TipsTerm:
    """Return the position of a point of one rod."""

    def tip(x: Sequence[float], p: Any) -> tuple[float, float]:
        return distance(p) * sin(x[0]), -distance(p) * cos(x[0])

    return tip


def swing_energy(forces: Forces, inertia: ParameterTerm, moment: ParameterTerm) -> StateFunction:
    """Return the energies of one angle with its inertia and its moment of mass times distance, per mass or not."""
    potentials: list[Callable[..., float]] = [_nothing]
    if forces.weight is not None:
        potentials.append(_lifted(forces.weight, moment))
    (stored,) = forces.stored
    if stored is not None:
        potentials.append(_wound(stored, inertia))
    potential = total(potentials)

    def energy(t: float, x: Sequence[float], p: Any) -> tuple[float, float]:
        return 0.5 * inertia(p) * x[1] ** 2, potential(t, x[0], p)

    return energy


def _nothing(t: float, angle: float, p: Any) -> float:
    return 0.0


def _lifted(weight: FieldTerm, moment: ParameterTerm) -> Callable[..., float]:
    def lifted(t: float, angle: float, p: Any) -> float:
        return -weight(t, p) * moment(p) * cos(angle)

    return lifted


def _wound(stored: StoredTerm, inertia: ParameterTerm) -> Callable[..., float]:
    def wound(t: float, angle: float, p: Any) -> float:
        return inertia(p) * stored(angle, p)

    return wound


def _per_length(field: FieldTerm, length: ParameterTerm | None) -> FieldTerm:
    if length is None:
        return field

    def field_per_length(t: float, p: Any, s: Sequence[float]) -> float:
        return field(t, p, s) / length(p)

    return field_per_length


def _pull(field: FieldTerm) -> Callable[..., float]:
    def pull(t: float, angle: float, rate: float, p: Any, s: Sequence[float]) -> float:
        return -field(t, p, s) * sin(angle)

    return pull


def _sway(field: FieldTerm) -> Callable[..., float]:
    def sway(t: float, angle: float, rate: float, p: Any, s: Sequence[float]) -> float:
        return -field(t, p, s) * cos(angle)

    return sway


def _smooth(joint: RubbingTerm) -> Callable[..., float]:
    def smooth(t: float, angle: float, rate: float, p: Any, s: Sequence[float]) -> float:
        return joint(t, angle, rate, 0.0, p)

    return smooth


def _rubbed(joint: RubbingTerm) -> Callable[..., float]:
    def rubbed(t: float, angle: float, rate: float, p: Any, s: Sequence[float]) -> float:
        return joint(t, angle, rate, s[0], p)

    return rubbed


def _turned(torque: FieldTerm) -> Callable[..., float]:
    def turned(t: float, angle: float, rate: float, p: Any, s: Sequence[float]) -> float:
        return torque(t, p, s)

    return turned


def _free(t: float, x: Sequence[float], p: Any, s: Sequence[float] = ()) -> tuple[float, float]:
    return x[1], 0.0
