"""Vertically driven pendulum in dimensionless form, and conversion from and to physical parameters."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi
from typing import Any

from cellmap import Coordinate, ForcedSystem, angle
from cellmap.maps import RightHandSide, StateFunction
from cellmap.utils import finite_number

from .drives import VerticalDrive
from .effects import DryFriction, Effect, Gravity, Terms, ViscousDamping
from .forces import Forces
from .pendulum import swing, swing_energy, tip_of
from .quantities import NUMBER, quantity, sized_number
from .scenes import Body, TipsTerm, scene
from .units import drive_units, effect_in_units, in_units, swing_units


@dataclass(frozen=True)
class ScaledPendulum(Body):
    """Pendulum in units in which its length and the drive's angular frequency are 1."""

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """Angle and angular velocity."""
        return angle("theta"), Coordinate("v")

    @staticmethod
    def compose(forces: Forces) -> RightHandSide:
        """Return the right-hand side."""
        return swing(forces)

    @staticmethod
    def tips(joints: int) -> TipsTerm:
        """Return the position of the mass relative to the pivot."""
        return tip_of(_one)

    @staticmethod
    def energy(forces: Forces) -> StateFunction:
        """Return kinetic and potential energy per mass."""
        return swing_energy(forces, inertia=_one, moment=_one)


def _one(p: Any) -> float:
    return 1.0


@dataclass(frozen=True)
class ScaledGravity(Effect):
    """Gravity alpha = g/(l w^2); negative where theta is counted from the upward vertical."""

    alpha: float = quantity(NUMBER)

    @property
    def terms(self) -> Terms:
        """Weight."""
        return Terms(vertical=_scaled_weight)

    @property
    def vanishes(self) -> bool:
        """Whether gravity is absent."""
        return self.alpha == 0.0


def _scaled_weight(t: float, p: Any) -> float:
    return p.alpha


@dataclass(frozen=True)
class ScaledVerticalDrive(Effect):
    """Pivot at the height beta cos t in units of the length, beta = A/l."""

    beta: float = quantity(NUMBER)

    @property
    def terms(self) -> Terms:
        """Acceleration of the pivot."""
        return Terms(vertical=_scaled_acceleration, place=_scaled_height, period=_whole_circle)

    @property
    def vanishes(self) -> bool:
        """Whether the pivot is fixed."""
        return self.beta == 0.0


def _scaled_acceleration(t: float, p: Any) -> float:
    return -p.beta * cos(t)


def _scaled_height(t: float, p: Any) -> tuple[float, float]:
    return 0.0, p.beta * cos(t)


def _whole_circle(p: Any) -> float:
    return 2.0 * pi


@dataclass(frozen=True)
class ScaledDamping(Effect):
    """Viscous damping gamma, in units of the drive's angular frequency."""

    gamma: float = quantity(NUMBER, at_least=0.0)

    @property
    def terms(self) -> Terms:
        """Friction at the joint."""
        return Terms(joint=_scaled_friction)

    @property
    def vanishes(self) -> bool:
        """Whether the joint is frictionless."""
        return self.gamma == 0.0


def _scaled_friction(t: float, angle: float, rate: float, p: Any) -> float:
    return -p.gamma * rate


@dataclass(frozen=True)
class ScaledFriction(Effect):
    """Dry friction delta, in units of the square of the drive's angular frequency."""

    delta: float = quantity(NUMBER, at_least=0.0)

    @property
    def terms(self) -> Terms:
        """Friction at the joint."""
        return Terms(rubbing=_scaled_dry)

    @property
    def vanishes(self) -> bool:
        """Whether the joint is frictionless."""
        return self.delta == 0.0


def _scaled_dry(t: float, angle: float, rate: float, sign: float, p: Any) -> float:
    return -p.delta * sign


def dimensionless_pendulum(
    alpha: float = 0.5, beta: float = 0.1, gamma: float = 0.03, delta: float = 0.0
) -> ForcedSystem:
    """Return theta'' + gamma theta' + delta sign(theta') + (alpha - beta cos tau) sin theta = 0, driven vertically.

    Time is tau = w t with the angular frequency w of the drive.  The state is (theta, v) with v = d theta / d tau and
    theta from the downward vertical; the pivot is at its highest at tau = 0.  A parameter of zero removes its term from
    the right-hand side.

    Parameters
    ----------
    alpha : float, optional
        Gravity g/(l w^2); a negative value counts theta from the upward vertical.
    beta : float, optional
        Amplitude of the drive A/l.
    gamma : float, optional
        Viscous damping in units of w, at least 0.
    delta : float, optional
        Dry friction in units of w^2, at least 0.

    Returns
    -------
    ForcedSystem
        System of period 2 pi.

    Raises
    ------
    TypeError, ValueError
        For parameters that are not finite numbers within their bounds.

    References
    ----------
    Blackburn, Smith, Gronbech-Jensen, American Journal of Physics 60 (1992) 903.

    Examples
    --------
    >>> dimensionless_pendulum(alpha=-0.1, beta=0.545, gamma=0.2).derivative(0.0, (pi / 2, 1.0))
    (1.0, 0.445)
    """
    effects = (ScaledGravity(alpha), ScaledVerticalDrive(beta), ScaledDamping(gamma), ScaledFriction(delta))
    return scene(ScaledPendulum(), *effects, name="dimensionless pendulum")


def dimensionless_parameters(
    length: float, amplitude: float, frequency: float, damping: float, gravity: float = 9.8, friction: float = 0.0
) -> dict[str, float]:
    """Return the parameters of :func:`dimensionless_pendulum` for a pendulum in SI units.

    Parameters
    ----------
    length, amplitude : float
        Length of the rod and amplitude of the pivot (m).
    frequency : float
        Frequency of the drive (Hz).
    damping : float
        Viscous damping (1/s).
    gravity : float, optional
        Acceleration of free fall (m/s^2).
    friction : float, optional
        Dry friction (rad/s^2).

    Returns
    -------
    dict
        alpha = g/(l w^2), beta = A/l, gamma = damping/w, with w = 2 pi `frequency`, and with dry friction delta =
        friction/w^2.  Angular velocities in rad/s are v w.

    Raises
    ------
    TypeError, ValueError
        For a length or a frequency that is not above 0, and for values that are not finite numbers.

    Examples
    --------
    >>> dimensionless_parameters(length=0.0272, amplitude=0.003, frequency=50.0, damping=10.0)["beta"]
    0.11029411764705883
    """
    units = drive_units(length, frequency)
    scaled = {
        "alpha": in_units(Gravity(gravity), units).gravity,
        "beta": in_units(VerticalDrive(amplitude, frequency), units).amplitude,
        "gamma": in_units(ViscousDamping(finite_number("damping", damping)), units).parameters["damping"],
    }
    dry = in_units(DryFriction(finite_number("friction", friction)), units)
    return scaled if dry.vanishes else {**scaled, "delta": dry.parameters["friction"]}


def physical_parameters(
    alpha: float, beta: float, gamma: float, length: float, frequency: float, delta: float = 0.0
) -> dict[str, float]:
    """Return the parameters of :func:`driven_pendulum` for a dimensionless one, given length and frequency.

    Parameters
    ----------
    alpha, beta, gamma : float
        Parameters of :func:`dimensionless_pendulum`.
    length : float
        Length of the rod (m), above 0.
    frequency : float
        Frequency of the drive (Hz), above 0.
    delta : float, optional
        Dry friction of :func:`dimensionless_pendulum`.

    Returns
    -------
    dict
        length, amplitude, frequency, damping and gravity, and with dry friction also friction.

    Raises
    ------
    TypeError, ValueError
        For values that are not finite numbers within their bounds.

    Examples
    --------
    >>> physical_parameters(alpha=0.5, beta=0.1, gamma=0.03, length=2.0, frequency=1.0)["amplitude"]
    0.2
    """
    units = drive_units(length, frequency)
    back = units.inverse
    viscous = effect_in_units("gamma", ViscousDamping, finite_number("gamma", gamma, at_least=0.0), back)
    physical = {
        "length": units.length,
        "amplitude": finite_number("beta", beta) * units.length,
        "frequency": float(frequency),
        "damping": viscous.parameters["damping"],
        "gravity": effect_in_units("alpha", Gravity, finite_number("alpha", alpha), back).gravity,
    }
    dry = effect_in_units("delta", DryFriction, finite_number("delta", delta, at_least=0.0), back)
    return physical if dry.vanishes else {**physical, **dry.parameters}


def stability_coordinates(length: float, amplitude: float, frequency: float, gravity: float = 9.8) -> dict[str, float]:
    """Return the axes of the stability map: Omega = f/f0 and epsilon = A w0^2/g = A/l, with w0 = 2 pi f0 = sqrt(g/l).

    Parameters
    ----------
    length, amplitude : float
        Length l of the rod and amplitude A of the pivot (m).
    frequency : float
        Frequency f of the drive (Hz), above 0.
    gravity : float, optional
        Acceleration g of free fall (m/s^2), above 0.

    Returns
    -------
    dict
        `frequency_ratio` Omega and `amplitude_ratio` epsilon.

    Raises
    ------
    TypeError, ValueError
        For values that are not finite numbers within their bounds.

    References
    ----------
    Blackburn, Smith, Gronbech-Jensen, American Journal of Physics 60 (1992) 903.

    Examples
    --------
    >>> stability_coordinates(length=0.0272, amplitude=0.003, frequency=50.0)["frequency_ratio"]
    16.550887
    """
    drive = in_units(VerticalDrive(amplitude, frequency), swing_units(length, gravity))
    return {"frequency_ratio": 2.0 * pi * drive.frequency, "amplitude_ratio": drive.amplitude}


def from_stability_coordinates(
    frequency_ratio: float, amplitude_ratio: float, length: float, gravity: float = 9.8
) -> dict[str, float]:
    """Return the parameters of :func:`driven_pendulum` at a point of the stability map.

    Parameters
    ----------
    frequency_ratio : float
        Omega = f/f0 with 2 pi f0 = sqrt(g/l), above 0.
    amplitude_ratio : float
        epsilon = A/l, at least 0.
    length : float
        Length l of the rod (m), above 0.
    gravity : float, optional
        Acceleration g of free fall (m/s^2), above 0.

    Returns
    -------
    dict
        length, amplitude, frequency and gravity.

    Raises
    ------
    TypeError, ValueError
        For values that are not finite numbers within their bounds.

    Examples
    --------
    >>> from_stability_coordinates(frequency_ratio=20.0, amplitude_ratio=0.1, length=0.05)["amplitude"]
    0.005
    """
    epsilon = sized_number("amplitude_ratio", amplitude_ratio, at_least=0.0)
    rotations = sized_number("frequency_ratio", frequency_ratio, above=0.0) / (2.0 * pi)
    units = swing_units(length, gravity)
    drive = in_units(VerticalDrive(epsilon, rotations), units.inverse)
    return {
        "length": units.length,
        "amplitude": drive.amplitude,
        "frequency": drive.frequency,
        "gravity": float(gravity),
    }
