"""The vertically driven pendulum in dimensionless form, and the way there and back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, pi
from typing import Any

from cellmap import Coordinate, ForcedSystem, angle
from cellmap.checks import finite_number
from cellmap.system import RightHandSide

from .effects import Effect, Gravity, Terms, VerticalDrive, ViscousDamping, bounded
from .pendulum import Pendulum, swing
from .scene import Body, scene


@dataclass(frozen=True)
class ScaledPendulum(Body):
    """Pendulum in units in which its length and the drive's angular frequency are 1."""

    coordinates = (angle("theta"), Coordinate("v"))

    @staticmethod
    def compose(terms: Sequence[Terms]) -> RightHandSide:
        """Return the right-hand side."""
        return swing(terms)


@dataclass(frozen=True)
class ScaledGravity(Effect):
    """Gravity alpha = g/(l w^2); negative where theta is counted from the upward vertical."""

    alpha: float

    @property
    def terms(self) -> Terms:
        """Weight."""
        return Terms(vertical=_scaled_weight)

    @property
    def vanishes(self) -> bool:
        """Whether nothing falls."""
        return self.alpha == 0.0


def _scaled_weight(t: float, p: Any) -> float:
    return p.alpha


@dataclass(frozen=True)
class ScaledVerticalDrive(Effect):
    """Pivot at the height beta cos t in units of the length, beta = A/l."""

    beta: float

    @property
    def terms(self) -> Terms:
        """Acceleration of the pivot."""
        return Terms(vertical=_scaled_acceleration, period=_one_turn)

    @property
    def vanishes(self) -> bool:
        """Whether the pivot rests."""
        return self.beta == 0.0


def _scaled_acceleration(t: float, p: Any) -> float:
    return -p.beta * cos(t)


def _one_turn(p: Any) -> float:
    return 2.0 * pi


@dataclass(frozen=True)
class ScaledDamping(Effect):
    """Viscous damping gamma, in units of the drive's angular frequency."""

    gamma: float = bounded(at_least=0.0)

    @property
    def terms(self) -> Terms:
        """Friction at the joint."""
        return Terms(joint=_scaled_friction)

    @property
    def vanishes(self) -> bool:
        """Whether the joint runs freely."""
        return self.gamma == 0.0


def _scaled_friction(t: float, angle: float, rate: float, p: Any) -> float:
    return -p.gamma * rate


def dimensionless_pendulum(alpha: float = 0.5, beta: float = 0.1, gamma: float = 0.03) -> ForcedSystem:
    """Return the vertically driven pendulum theta'' + gamma theta' + (alpha - beta cos tau) sin theta = 0.

    Time is tau = w t with the angular frequency w of the drive.  The state is (theta, v) with v = d theta / d tau and
    theta from the downward vertical; the pivot is at its highest at tau = 0.  A parameter of zero takes its term out of
    the right-hand side.

    Parameters
    ----------
    alpha : float, optional
        Gravity g/(l w^2); a negative value counts theta from the upward vertical.
    beta : float, optional
        Amplitude of the drive A/l.
    gamma : float, optional
        Viscous damping in units of w, at least 0.

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
    effects = (ScaledGravity(alpha), ScaledVerticalDrive(beta), ScaledDamping(gamma))
    return scene(ScaledPendulum(), *effects, name="dimensionless pendulum")


def dimensionless_parameters(
    length: float, amplitude: float, frequency: float, damping: float, gravity: float = 9.8
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

    Returns
    -------
    dict
        alpha = g/(l w^2), beta = A/l, gamma = damping/w, with w = 2 pi `frequency`.  Rates in rad/s are v w.

    Raises
    ------
    TypeError, ValueError
        For a length or a frequency that is not above 0, and for values that are not finite numbers.

    Examples
    --------
    >>> dimensionless_parameters(length=0.0272, amplitude=0.003, frequency=50.0, damping=10.0)["beta"]
    0.11029411764705883
    """
    rod, drive, friction = Pendulum(length), VerticalDrive(amplitude, frequency), ViscousDamping(damping)
    w = 2.0 * pi * drive.frequency
    return {
        "alpha": Gravity(gravity).gravity / (rod.length * w * w),
        "beta": drive.amplitude / rod.length,
        "gamma": friction.damping / w,
    }


def physical_parameters(alpha: float, beta: float, gamma: float, length: float, frequency: float) -> dict[str, float]:
    """Return the parameters of :func:`driven_pendulum` for a dimensionless one, given length and frequency.

    Parameters
    ----------
    alpha, beta, gamma : float
        Parameters of :func:`dimensionless_pendulum`.
    length : float
        Length of the rod (m), above 0.
    frequency : float
        Frequency of the drive (Hz), above 0.

    Returns
    -------
    dict
        length, amplitude, frequency, damping and gravity.

    Raises
    ------
    TypeError, ValueError
        For values that are not finite numbers within their bounds.

    Examples
    --------
    >>> physical_parameters(alpha=0.5, beta=0.1, gamma=0.03, length=2.0, frequency=1.0)["amplitude"]
    0.2
    """
    rod, time = Pendulum(length), VerticalDrive(0.0, frequency)
    w = 2.0 * pi * time.frequency
    return {
        "length": rod.length,
        "amplitude": finite_number("beta", beta) * rod.length,
        "frequency": time.frequency,
        "damping": finite_number("gamma", gamma, at_least=0.0) * w,
        "gravity": finite_number("alpha", alpha) * rod.length * w * w,
    }
