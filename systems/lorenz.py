"""Lorenz's model of 1996 with a periodic forcing."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, pi
from typing import Any

from cellmap import ForcedSystem
from cellmap.utils import finite_number, whole_number

from .networks import forcing_period
from .quantities import sized_number


def lorenz_96(n_places: int = 4, mean: float = 4.0, forcing: float = 1.0, frequency: float = 2.0 * pi) -> ForcedSystem:
    """Return Lorenz's model of 1996: an atmospheric quantity at places along a circle of latitude.

    x_k' = (x_{k+1} - x_{k-2}) x_{k-1} - x_k + mean + forcing cos(frequency t)

    Indices are modulo `n_places`.  The equations do not change when the circle is turned.

    Parameters
    ----------
    n_places : int, optional
        Number of places, at least 4.
    mean : float, optional
        Mean of the forcing; 8 was chosen by Lorenz, for chaos.
    forcing : float, optional
        Amplitude of its oscillation.
    frequency : float, optional
        Angular frequency of the oscillation, above 0; the unit of time is the decay time, five days of the atmosphere.

    Returns
    -------
    ForcedSystem
        System of the state (x_1, x_2, ...) and of period 2 pi / `frequency`.  All quantities are dimensionless.

    Raises
    ------
    TypeError, ValueError
        For parameters that are not finite numbers within their bounds.

    References
    ----------
    Lorenz, Proceedings of the ECMWF Seminar on Predictability 1 (1996) 1, with constant forcing.

    Examples
    --------
    >>> lorenz_96(forcing=0.0).derivative(0.0, (1.0, 2.0, 3.0, 4.0))
    (-1.0, 1.0, 7.0, -3.0)
    """
    n_places = whole_number("n_places", n_places, at_least=4)
    params = {
        "mean": finite_number("mean", mean),
        "forcing": finite_number("forcing", forcing),
        "frequency": sized_number("frequency", frequency, above=0.0),
    }
    axes = tuple(f"x_{k + 1}" for k in range(n_places))
    return ForcedSystem(
        _lorenz, params, period=forcing_period, coordinates=axes, name=f"Lorenz 96 of {n_places} places"
    )


def _lorenz(t: float, x: Sequence[float], p: Any) -> tuple[float, ...]:
    n, force = len(x), p.mean + p.forcing * cos(p.frequency * t)
    return tuple((x[(k + 1) % n] - x[k - 2]) * x[k - 1] - x[k] + force for k in range(n))
