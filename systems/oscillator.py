"""Oscillators of one degree of freedom with a harmonic force."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from math import cos, pi
from typing import Any

from cellmap import Coordinate, ForcedSystem
from cellmap.maps import RightHandSide
from cellmap.utils import finite_number

from .quantities import sized_number

Acceleration = Callable[[float, float, Any], float]


def forced_oscillator(
    name: str,
    acceleration: Acceleration,
    *,
    forcing: float,
    frequency: float,
    position: str | Coordinate = "x",
    **params: float,
) -> ForcedSystem:
    """Return x'' = acceleration(x, x', p) + forcing cos(frequency t).

    Parameters
    ----------
    name : str
        Name for files and plots.
    acceleration : callable
        Plain function ``acceleration(x, v, p)`` of position, velocity and parameters, without the force.  Systems with
        the same function share their compiled kernel.
    forcing : float
        Amplitude of the force.
    frequency : float
        Angular frequency of the force, above 0.
    position : str or Coordinate, optional
        The coordinate x.
    **params : float
        Parameters of the acceleration.

    Returns
    -------
    ForcedSystem
        System of the state (x, v) and of period 2 pi / `frequency`.

    Raises
    ------
    TypeError, ValueError
        For parameters that are not finite numbers, or a frequency that is not above 0.

    Examples
    --------
    >>> forced_oscillator("spring", lambda x, v, p: -p.k * x, forcing=1.0, frequency=2.0, k=4.0).derivative(0.0, (1, 0))
    (0, -3.0)
    """
    params["forcing"] = finite_number("forcing", forcing)
    params["frequency"] = sized_number("frequency", frequency, above=0.0)
    return ForcedSystem(_motion(acceleration), params, period=_period, coordinates=(position, "v"), name=name)


@functools.cache
def _motion(acceleration: Acceleration) -> RightHandSide:
    """Compose once for each acceleration: kernels are kept by the identity of their right-hand side."""

    def motion(t: float, x: Sequence[float], p: Any) -> tuple[float, float]:
        q, v = x
        return v, acceleration(q, v, p) + p.forcing * cos(p.frequency * t)

    return motion


def _period(p: Any) -> float:
    return 2.0 * pi / p.frequency
