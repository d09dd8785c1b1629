"""Drives: periodic effects.  They move the pivot, or exert a torque on the first joint, as a cosine.

All have a frequency f, with w = 2 pi f, and begin with the cosine: at phase 0 a vertically driven pivot is at its
highest at t = 0.  A scene has at most one drive, which determines its period.  Other wave forms are in
:mod:`systems.harmonics` and :mod:`systems.waves`.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, sin
from typing import Any

from .effects import Effect, Terms
from .quantities import ANGULAR_ACCELERATION, LENGTH, MOST_RADIANS, NUMBER, RATE, quantity


def period_of(p: Any) -> float:
    """Return the period of a drive (s)."""
    return 1.0 / p.frequency


def turned_by(t: float, p: Any) -> float:
    """Return the angle w t + phase of a drive (rad)."""
    return 2.0 * pi * p.frequency * t + p.phase


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

    amplitude: float = quantity(LENGTH, at_least=0.0)
    frequency: float = quantity(RATE, above=0.0)
    phase: float = quantity(NUMBER, default=0.0, at_least=-MOST_RADIANS, at_most=MOST_RADIANS)

    @property
    def terms(self) -> Terms:
        """Acceleration of the pivot."""
        return Terms(vertical=_swing, place=_height, period=period_of)

    @property
    def vanishes(self) -> bool:
        """Whether the pivot is fixed."""
        return self.amplitude == 0.0


def _swing(t: float, p: Any) -> float:
    w = 2.0 * pi * p.frequency
    return -(p.amplitude * w * w) * cos(w * t + p.phase)


def _height(t: float, p: Any) -> tuple[float, float]:
    return 0.0, p.amplitude * cos(turned_by(t, p))


@dataclass(frozen=True)
class HorizontalDrive(VerticalDrive):
    """Pivot at A cos(w t + phase) to the right of its mean position, with w = 2 pi `frequency`.

    Parameters
    ----------
    amplitude : float
        Amplitude A (m), at least 0.
    frequency : float
        Frequency (Hz), above 0.
    phase : float, optional
        Phase (rad).

    Examples
    --------
    >>> HorizontalDrive(amplitude=0.003, frequency=50.0).terms.vertical is None
    True
    """

    @property
    def terms(self) -> Terms:
        """Acceleration of the pivot."""
        return Terms(horizontal=_swing, place=_shift, period=period_of)


def _shift(t: float, p: Any) -> tuple[float, float]:
    return p.amplitude * cos(turned_by(t, p)), 0.0


@dataclass(frozen=True)
class TiltedDrive(Effect):
    """Pivot on a straight line tilted from the vertical: (x, y) = A cos(w t + phase) (sin tilt, cos tilt).

    Parameters
    ----------
    amplitude : float
        Amplitude A along the line (m), at least 0.
    frequency : float
        Frequency (Hz), above 0.
    tilt : float
        Angle of the line from the vertical (rad), its upper end to the right where positive.
    phase : float, optional
        Phase (rad).

    Examples
    --------
    >>> TiltedDrive(amplitude=0.003, frequency=50.0, tilt=0.1).parameters["tilt"]
    0.1
    """

    amplitude: float = quantity(LENGTH, at_least=0.0)
    frequency: float = quantity(RATE, above=0.0)
    tilt: float = quantity(NUMBER)
    phase: float = quantity(NUMBER, default=0.0, at_least=-MOST_RADIANS, at_most=MOST_RADIANS)

    @property
    def terms(self) -> Terms:
        """Acceleration of the pivot."""
        return Terms(vertical=_upward, horizontal=_sideways, place=_along, period=period_of)

    @property
    def vanishes(self) -> bool:
        """Whether the pivot is fixed."""
        return self.amplitude == 0.0


def _upward(t: float, p: Any) -> float:
    return cos(p.tilt) * _swing(t, p)


def _sideways(t: float, p: Any) -> float:
    return sin(p.tilt) * _swing(t, p)


def _along(t: float, p: Any) -> tuple[float, float]:
    distance = p.amplitude * cos(turned_by(t, p))
    return distance * sin(p.tilt), distance * cos(p.tilt)


@dataclass(frozen=True)
class RotatingDrive(Effect):
    """Pivot on a circle or an ellipse: (x, y) = (-B sin(w t + phase), A cos(w t + phase)), counter-clockwise.

    Parameters
    ----------
    vertical_amplitude : float
        Vertical semi-axis A (m).
    horizontal_amplitude : float
        Horizontal semi-axis B (m); A for a circle, of the opposite sign for a clockwise one.
    frequency : float
        Frequency (Hz), above 0.
    phase : float, optional
        Phase (rad).

    Examples
    --------
    >>> RotatingDrive(0.003, -0.003, frequency=50.0).vanishes
    False
    """

    vertical_amplitude: float = quantity(LENGTH)
    horizontal_amplitude: float = quantity(LENGTH)
    frequency: float = quantity(RATE, above=0.0)
    phase: float = quantity(NUMBER, default=0.0, at_least=-MOST_RADIANS, at_most=MOST_RADIANS)

    @property
    def terms(self) -> Terms:
        """Acceleration of the pivot."""
        return Terms(vertical=_round_up, horizontal=_round_aside, place=_round, period=period_of)

    @property
    def vanishes(self) -> bool:
        """Whether the pivot is fixed."""
        return self.vertical_amplitude == self.horizontal_amplitude == 0.0


def _round_up(t: float, p: Any) -> float:
    w = 2.0 * pi * p.frequency
    return -(p.vertical_amplitude * w * w) * cos(w * t + p.phase)


def _round_aside(t: float, p: Any) -> float:
    w = 2.0 * pi * p.frequency
    return (p.horizontal_amplitude * w * w) * sin(w * t + p.phase)


def _round(t: float, p: Any) -> tuple[float, float]:
    return -p.horizontal_amplitude * sin(turned_by(t, p)), p.vertical_amplitude * cos(turned_by(t, p))


@dataclass(frozen=True)
class TorqueDrive(Effect):
    """Torque at the first joint, counter-clockwise: angular acceleration `torque` cos(w t + phase).

    Parameters
    ----------
    torque : float
        Peak angular acceleration (rad/s^2), at least 0.
    frequency : float
        Frequency (Hz), above 0.
    phase : float, optional
        Phase (rad).

    Examples
    --------
    >>> TorqueDrive(torque=2.0, frequency=1.0).terms.place is None
    True
    """

    torque: float = quantity(ANGULAR_ACCELERATION, at_least=0.0)
    frequency: float = quantity(RATE, above=0.0)
    phase: float = quantity(NUMBER, default=0.0, at_least=-MOST_RADIANS, at_most=MOST_RADIANS)

    @property
    def terms(self) -> Terms:
        """Torque at the first joint."""
        return Terms(torque=_alternating, period=period_of)

    @property
    def vanishes(self) -> bool:
        """Whether there is no torque."""
        return self.torque == 0.0


def _alternating(t: float, p: Any) -> float:
    return p.torque * cos(turned_by(t, p))
