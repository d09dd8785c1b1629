"""Two-well Duffing oscillator."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, pi
from typing import Any

from cellmap import ForcedSystem
from cellmap.checks import finite_number


def two_well_duffing(damping: float = 0.15, forcing: float = 0.2, frequency: float = 1.0) -> ForcedSystem:
    """Return the forced oscillator in a double well: x'' + damping x' - x + x^3 = forcing cos(frequency t).

    Parameters
    ----------
    damping : float, optional
        Viscous damping, at least 0.
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
    Guckenheimer, Holmes, *Nonlinear Oscillations, Dynamical Systems, and Bifurcations of Vector Fields* (1983), 2.2;
    Holmes, Philosophical Transactions A 292 (1979) 419.

    Examples
    --------
    >>> two_well_duffing().derivative(0.0, (1.0, 0.0))
    (0.0, 0.2)
    """
    params = {
        "damping": finite_number("damping", damping, at_least=0.0),
        "forcing": finite_number("forcing", forcing),
        "frequency": finite_number("frequency", frequency, above=0.0),
    }
    return ForcedSystem(_duffing, params, period=_period, coordinates=("x", "v"), name="two-well Duffing")


def _duffing(t: float, x: Sequence[float], p: Any) -> tuple[float, float]:
    q, v = x
    return v, q - q**3 - p.damping * v + p.forcing * cos(p.frequency * t)


def _period(p: Any) -> float:
    return 2.0 * pi / p.frequency
