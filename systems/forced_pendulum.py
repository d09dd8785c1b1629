"""Pendulum forced by a periodic torque."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, pi, sin
from typing import Any

from cellmap import ForcedSystem, angle
from cellmap.checks import finite_number


def forced_pendulum(damping: float = 0.2, forcing: float = 2.0, frequency: float = 1.0) -> ForcedSystem:
    """Return the pendulum under a torque: theta'' + damping theta' + sin theta = forcing cos(frequency t).

    Parameters
    ----------
    damping : float, optional
        Viscous damping, at least 0.
    forcing : float, optional
        Amplitude of the torque.
    frequency : float, optional
        Angular frequency of the torque, above 0.

    Returns
    -------
    ForcedSystem
        System of the state (theta, v), theta from the downward vertical, and of period 2 pi / `frequency`.  All
        quantities are dimensionless: the unit of time is that of small swings of the free pendulum.

    Raises
    ------
    TypeError, ValueError
        For parameters that are not finite numbers within their bounds.

    References
    ----------
    Grebogi, Ott, Yorke, Physica D 24 (1987) 243.

    Examples
    --------
    >>> forced_pendulum().derivative(0.0, (0.0, 1.0))
    (1.0, 1.8)
    """
    params = {
        "damping": finite_number("damping", damping, at_least=0.0),
        "forcing": finite_number("forcing", forcing),
        "frequency": finite_number("frequency", frequency, above=0.0),
    }
    return ForcedSystem(_pendulum, params, period=_period, coordinates=(angle("theta"), "v"), name="forced pendulum")


def _pendulum(t: float, x: Sequence[float], p: Any) -> tuple[float, float]:
    theta, v = x
    return v, -p.damping * v - sin(theta) + p.forcing * cos(p.frequency * t)


def _period(p: Any) -> float:
    return 2.0 * pi / p.frequency
