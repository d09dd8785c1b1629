"""Van der Pol's oscillator under a harmonic force."""

from __future__ import annotations

from typing import Any

from cellmap import ForcedSystem
from cellmap.utils import finite_number

from .oscillator import forced_oscillator


def van_der_pol_oscillator(mu: float = 1.0, forcing: float = 1.0, frequency: float = 1.0) -> ForcedSystem:
    """Return van der Pol's oscillator: x'' - mu (1 - x^2) x' + x = forcing cos(frequency t).

    A weak off-resonant force gives a quasiperiodic motion, whose Poincaré section is a closed curve.  With the
    defaults, the oscillation is phase-locked to the force.

    Parameters
    ----------
    mu : float, optional
        Strength of the damping, at least 0; the damping is negative for small oscillations and positive for large ones.
    forcing : float, optional
        Amplitude of the force.
    frequency : float, optional
        Angular frequency of the force, above 0.

    Returns
    -------
    ForcedSystem
        System of the state (x, v) and of period 2 pi / `frequency`.  All quantities are dimensionless.

    Raises
    ------
    TypeError, ValueError
        For parameters that are not finite numbers within their bounds.

    References
    ----------
    Van der Pol, Philosophical Magazine 2 (1926) 978, without the force, and 3 (1927) 65, with it.

    Examples
    --------
    >>> van_der_pol_oscillator().derivative(0.0, (2.0, 1.0))
    (1.0, -4.0)
    """
    mu = finite_number("mu", mu, at_least=0.0)
    return forced_oscillator("van der Pol", _van_der_pol, mu=mu, forcing=forcing, frequency=frequency)


def _van_der_pol(x: float, v: float, p: Any) -> float:
    return p.mu * (1.0 - x * x) * v - x
