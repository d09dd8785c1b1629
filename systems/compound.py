"""Compound pendulum: a rigid body on a driven pivot, and the rods of the report."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from cellmap import Coordinate, ForcedSystem, angle
from cellmap.maps import RightHandSide, StateFunction
from cellmap.utils import finite_number

from .drives import VerticalDrive
from .effects import DryFriction, Gravity, ViscousDamping
from .forces import Forces
from .pendulum import swing, swing_energy, tip_of
from .quantities import INERTIA, LENGTH, MASS, quantity
from .scenes import Body, TipsTerm, scene

LONG_ROD = 0.069
"""Effective length (m) of the report's long rod."""

SHORT_ROD = 0.031
"""Effective length (m) of the report's short rod."""

BASIN_ROD = 0.0272
"""Effective length (m) of the pendulum in the report's figure 19."""


@dataclass(frozen=True)
class CompoundPendulum(Body):
    """Rigid body: theta'' = joint - (vertical / L) sin theta - (horizontal / L) cos theta, L = inertia/(mass distance).

    It moves like a point mass at the effective length L.  Its output "positions" is that of the centre of mass.

    Parameters
    ----------
    mass : float
        Mass (kg), above 0.
    inertia : float
        Moment of inertia about the pivot (kg m^2), above 0 and at least mass x distance^2.
    distance : float
        Distance of the centre of mass from the pivot (m), above 0.

    Raises
    ------
    TypeError, ValueError
        For values that are not finite numbers within their bounds.

    References
    ----------
    Huygens, *Horologium oscillatorium* (1673), part 4.

    Examples
    --------
    >>> CompoundPendulum(mass=2.0, inertia=0.5, distance=0.25).effective_length
    1.0
    """

    mass: float = quantity(MASS, above=0.0)
    inertia: float = quantity(INERTIA, above=0.0)
    distance: float = quantity(LENGTH, above=0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        least = self.mass * self.distance * self.distance
        if self.inertia < least * (1.0 - 1e-12):
            raise ValueError(
                f"inertia={self.inertia!r}: about the pivot it is at least mass x distance^2 = {least:g}; give that "
                "about the centre of mass plus mass x distance^2"
            )

    @property
    def effective_length(self) -> float:
        """Length of the simple pendulum with the same motion (m)."""
        return self.inertia / (self.mass * self.distance)

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """Angle and angular velocity."""
        return angle("theta"), Coordinate("theta'", "rad/s")

    @staticmethod
    def compose(forces: Forces) -> RightHandSide:
        """Return the right-hand side."""
        return swing(forces, _effective_length)

    @staticmethod
    def tips(joints: int) -> TipsTerm:
        """Return the position of the centre of mass relative to the pivot."""
        return tip_of(_distance)

    @staticmethod
    def energy(forces: Forces) -> StateFunction:
        """Return kinetic and potential energy."""
        return swing_energy(forces, inertia=_inertia, moment=_moment)


def _effective_length(p: Any) -> float:
    return p.inertia / (p.mass * p.distance)


def _distance(p: Any) -> float:
    return p.distance


def _inertia(p: Any) -> float:
    return p.inertia


def _moment(p: Any) -> float:
    return p.mass * p.distance


def uniform_rod(effective_length: float, mass: float = 1.0) -> CompoundPendulum:
    """Return the uniform thin rod, pivoted at its end, of an effective length L: it is 3 L / 2 long.

    Parameters
    ----------
    effective_length : float
        Effective length (m), from 1e-16 to 1e16, such as `LONG_ROD`, `SHORT_ROD` and `BASIN_ROD` of the report.
    mass : float, optional
        Mass (kg), from 1e-16 to 1e16.

    Returns
    -------
    CompoundPendulum
        Body with the centre of mass at 3 L / 4 and a moment of inertia of 3 mass L^2 / 4.

    Raises
    ------
    TypeError, ValueError
        For values that are not numbers within these bounds.

    Examples
    --------
    >>> uniform_rod(LONG_ROD).effective_length
    0.069
    """
    # The moment of inertia has to be within the bounds of physical quantities as well.
    length = finite_number("effective_length", effective_length, above=0.0, at_least=1e-16, at_most=1e16)
    weight = finite_number("mass", mass, above=0.0, at_least=1e-16, at_most=1e16)
    return CompoundPendulum(weight, 0.75 * weight * length * length, 0.75 * length)


def compound_pendulum(
    mass: float = 0.004,
    inertia: float = 1.4283e-5,
    distance: float = 0.05175,
    amplitude: float = 0.003,
    frequency: float = 50.0,
    damping: float = 10.0,
    gravity: float = 9.8,
    phase: float = 0.0,
    friction: float = 0.0,
) -> ForcedSystem:
    """Return the compound pendulum whose pivot is at the height y(t) = A cos(w t + phase), in SI units.

    theta'' = -damping theta' - friction sign(theta') - (mass distance/inertia) (g + y'') sin theta, with theta in rad
    from the downward vertical and w = 2 pi `frequency`; the state is (theta, theta').

    Parameters
    ----------
    mass : float, optional
        Mass (kg), above 0.
    inertia : float, optional
        Moment of inertia about the pivot (kg m^2), above 0.
    distance : float, optional
        Distance of the centre of mass from the pivot (m), above 0.
    amplitude : float, optional
        Amplitude A of the pivot's height (m), at least 0.
    frequency : float, optional
        Frequency of the drive (Hz), above 0.
    damping : float, optional
        Viscous damping, torque per inertia (1/s), at least 0.
    gravity : float, optional
        Acceleration g of free fall (m/s^2).
    phase : float, optional
        Phase of the drive (rad).
    friction : float, optional
        Dry friction, torque per inertia (rad/s^2), at least 0.

    Returns
    -------
    ForcedSystem
        System of period 1/`frequency` (s).  The defaults are a uniform rod of the report's longest effective length.

    Raises
    ------
    TypeError, ValueError
        For parameters that are not finite numbers within their bounds.

    References
    ----------
    Huygens, *Horologium oscillatorium* (1673), part 4; Stephenson, Philosophical Magazine 15 (1908) 233; Blackburn,
    Smith, Gronbech-Jensen, American Journal of Physics 60 (1992) 903.

    Examples
    --------
    >>> from math import pi
    >>> round(compound_pendulum(damping=0.0, amplitude=0.0).derivative(0.0, (pi / 2, 0.0))[1] * LONG_ROD, 12)
    -9.8
    """
    effects = (
        Gravity(gravity),
        VerticalDrive(amplitude, frequency, phase),
        ViscousDamping(finite_number("damping", damping)),
        DryFriction(finite_number("friction", friction)),
    )
    return scene(CompoundPendulum(mass, inertia, distance), *effects, name="compound pendulum")
