"""Pendulum forced by a periodic torque."""

from __future__ import annotations

from math import sin
from typing import Any

from cellmap import ForcedSystem, angle
from cellmap.utils import finite_number

from .oscillator import forced_oscillator


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
    return forced_oscillator(
        "forced pendulum",
        _pendulum,
        damping=finite_number("damping", damping, at_least=0.0),
        forcing=forcing,
        frequency=frequency,
        position=angle("theta"),
    )


def _pendulum(theta: float, v: float, p: Any) -> float:
    return -p.damping * v - sin(theta)
