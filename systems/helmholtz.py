"""Helmholtz oscillator: escape from a potential well with one barrier."""

from __future__ import annotations

from typing import Any

from cellmap import ForcedSystem
from cellmap.utils import finite_number

from .oscillator import forced_oscillator


def helmholtz_oscillator(damping: float = 0.1, forcing: float = 0.07, frequency: float = 0.85) -> ForcedSystem:
    """Return the oscillator in a cubic potential: x'' + damping x' + x - x^2 = forcing cos(frequency t).

    Orbits that cross the barrier at x = 1 reach infinity in finite time; their initial conditions diverge.  By
    Melnikov's criterion the boundary of the safe basin becomes fractal where the forcing exceeds damping sinh(pi
    frequency) / (5 pi frequency^2), which is 0.0633 for the other defaults.

    Parameters
    ----------
    damping : float, optional
        Viscous damping, at least 0.
    forcing : float, optional
        Amplitude of the force.  Thompson's force is a sine, so that his stroboscopic section is shifted by a quarter of
        a period.
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
    Thompson, Proceedings of the Royal Society A 421 (1989) 195.

    Examples
    --------
    >>> helmholtz_oscillator(forcing=0.1).derivative(0.0, (1.0, 0.0))
    (0.0, 0.1)
    """
    damping = finite_number("damping", damping, at_least=0.0)
    return forced_oscillator("Helmholtz", _one_lip, damping=damping, forcing=forcing, frequency=frequency)


def _one_lip(x: float, v: float, p: Any) -> float:
    return x * x - x - p.damping * v
