"""Pendulum above three magnets."""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from typing import Any

from cellmap import ForcedSystem
from cellmap.utils import finite_number

_CORNERS = ((1.0, 0.0), (-0.5, sqrt(0.75)), (-0.5, -sqrt(0.75)))


def magnetic_pendulum(
    damping: float = 0.2,
    stiffness: float = 0.25,
    strength: float = 1.0,
    height: float = 0.3,
    radius: float = 1.0,
    period: float = 1.0,
) -> ForcedSystem:
    """Return the pendulum above three magnets, r'' + damping r' + stiffness r = sum of their forces.

    The bob moves in the plane, r = (x, y), at some height above equal magnets at the corners r_k of an equilateral
    triangle.  Each exerts the force strength (r_k - r) / (abs(r_k - r)^2 + height^2)^(3/2).

    Parameters
    ----------
    damping : float, optional
        Viscous damping, at least 0.
    stiffness : float, optional
        Restoring force of the pendulum per distance from the centre: the square of its angular frequency, at least 0.
    strength : float, optional
        Strength of each magnet; a negative one repels.
    height : float, optional
        Height of the bob above the plane of the magnets, above 0.
    radius : float, optional
        Distance of the magnets from the centre, above 0; the first one is on the positive x axis.
    period : float, optional
        Sampling period, above 0: the system is autonomous.

    Returns
    -------
    ForcedSystem
        System of the state (x, y, u, v) with the velocity (u, v).  All quantities are dimensionless.

    Raises
    ------
    TypeError, ValueError
        For parameters that are not finite numbers within their bounds.

    References
    ----------
    Peitgen, Jürgens, Saupe, *Chaos and Fractals* (1992), chapter 12; Motter, Gruiz, Károlyi, Tél, Physical Review
    Letters 111 (2013) 194101.

    Examples
    --------
    >>> magnetic_pendulum(strength=0.0).derivative(0.0, (1.0, 0.0, 0.5, 0.0))
    (0.5, 0.0, -0.35, 0.0)
    """
    params = {
        "damping": finite_number("damping", damping, at_least=0.0),
        "stiffness": finite_number("stiffness", stiffness, at_least=0.0),
        "strength": finite_number("strength", strength),
        "height": finite_number("height", height, above=0.0),
        "radius": finite_number("radius", radius, above=0.0),
    }
    length = finite_number("period", period, above=0.0)
    return ForcedSystem(_pull, params, period=length, coordinates=("x", "y", "u", "v"), name="magnetic pendulum")


def _pull(t: float, x: Sequence[float], p: Any) -> tuple[float, float, float, float]:
    x1, x2, v1, v2 = x
    a1 = -p.stiffness * x1 - p.damping * v1
    a2 = -p.stiffness * x2 - p.damping * v2
    for c1, c2 in _CORNERS:
        d1, d2 = p.radius * c1 - x1, p.radius * c2 - x2
        square = d1 * d1 + d2 * d2 + p.height * p.height
        pull = p.strength / (square * sqrt(square))
        a1, a2 = a1 + pull * d1, a2 + pull * d2
    return v1, v2, a1, a2
