"""Stick-slip oscillator: mass on a moving belt, held by a spring."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, pi
from typing import Any

from cellmap import ForcedSystem
from cellmap.utils import finite_number

from .quantities import sized_number


def stick_slip_oscillator(
    belt_speed: float = 0.1,
    static_friction: float = 0.4,
    least_friction: float = 0.25,
    least_speed: float = 0.5,
    damping: float = 0.05,
    forcing: float = 0.1,
    frequency: float = 0.8,
) -> ForcedSystem:
    """Return the mass on a belt: x'' + 2 damping x' + x + mu(x' - belt_speed) = forcing cos(frequency t).

    The friction is that of a Stribeck curve of third degree: with r = x' - belt_speed

    mu(r) = mu_s sign(r) - (3/2) (mu_s - mu_m) (r/v_m - (r/v_m)^3 / 3)

    decreases from mu_s at zero sliding velocity to mu_m at the sliding speed v_m and then grows.  While the mass sticks
    to the belt and moves with it, the friction takes any value between -mu_s and mu_s.  Without the force, the mass has
    the equilibrium x = mu(belt_speed) of steady sliding; it is stable if belt_speed^2 is above v_m^2 - 4 damping v_m^3
    / (3 (mu_s - mu_m)).

    Parameters
    ----------
    belt_speed : float, optional
        Velocity of the belt.
    static_friction : float, optional
        Static friction mu_s, at least 0, as the extension of the spring that it balances.
    least_friction : float, optional
        Friction mu_m at the sliding speed v_m, at least 0 and at most `static_friction`; equal to it, the friction is
        Coulomb's.
    least_speed : float, optional
        Sliding speed v_m at which the friction is least, above 0.
    damping : float, optional
        Viscous damping as a fraction of critical damping, at least 0.
    forcing : float, optional
        Amplitude of the force.
    frequency : float, optional
        Angular frequency of the force, above 0.

    Returns
    -------
    ForcedSystem
        System of the state (x, v) and of period 2 pi / `frequency`.  All quantities are dimensionless: the unit of time
        is that of the undamped mass on its spring.  The sliding velocity r is a switching function.

    Raises
    ------
    TypeError, ValueError
        For parameters that are not finite numbers within their bounds.

    References
    ----------
    Thomsen, Fidlin, International Journal of Non-Linear Mechanics 38 (2003) 389, without the force; Popp, Stelter,
    Philosophical Transactions of the Royal Society A 332 (1990) 89, with a force and another Stribeck curve.

    Examples
    --------
    >>> oscillator = stick_slip_oscillator(belt_speed=0.5, damping=0.0, forcing=0.0)
    >>> oscillator.derivative(0.0, (0.25, 0.0))
    (0.0, 0.0)
    >>> oscillator.signs(0.0, (0.25, 0.5))
    (0.0,)
    """
    static = finite_number("static_friction", static_friction, at_least=0.0)
    parameters = {
        "belt_speed": finite_number("belt_speed", belt_speed),
        "static_friction": static,
        "least_friction": finite_number("least_friction", least_friction, at_least=0.0, at_most=static),
        "least_speed": finite_number("least_speed", least_speed, above=0.0),
        "damping": finite_number("damping", damping, at_least=0.0),
        "forcing": finite_number("forcing", forcing),
        "frequency": sized_number("frequency", frequency, above=0.0),
    }
    return ForcedSystem(_motion, parameters, _period, ("x", "v"), name="stick-slip", switches=_sliding)


def _motion(t: float, x: Sequence[float], p: Any, s: Sequence[float]) -> tuple[float, float]:
    q, v = x
    r = (v - p.belt_speed) / p.least_speed
    friction = p.static_friction * s[0] - 1.5 * (p.static_friction - p.least_friction) * (r - r * r * r / 3.0)
    return v, p.forcing * cos(p.frequency * t) - 2.0 * p.damping * v - q - friction


def _sliding(t: float, x: Sequence[float], p: Any) -> tuple[float]:
    return (x[1] - p.belt_speed,)


def _period(p: Any) -> float:
    return 2.0 * pi / p.frequency
