"""Chirikov's standard map: a kicked rotor."""

from __future__ import annotations

from collections.abc import Sequence
from math import sin
from typing import Any

from cellmap import PointMap, angle, discrete_map
from cellmap.utils import finite_number


def standard_map(k: float = 0.971635) -> PointMap:
    """Return the standard map: p' = p + k sin theta, theta' = theta + p'.

    The map is area-preserving and has no attractors.

    Parameters
    ----------
    k : float, optional
        Strength of the kicks.  The default is the value at which the last rotational invariant circle breaks up (Greene
        1979).

    Returns
    -------
    PointMap
        Map of the state (theta, p).  Both are angles, as the map is periodic in p too; :attr:`Iterate.unwrapped` has
        the unwrapped momentum.

    Raises
    ------
    TypeError, ValueError
        For a parameter that is not a finite number.

    References
    ----------
    Chirikov, Physics Reports 52 (1979) 263; Greene, Journal of Mathematical Physics 20 (1979) 1183.

    Examples
    --------
    >>> standard_map(k=1.0)([0.0, 1.0])
    array([1., 1.])
    """
    return discrete_map(_kick, {"k": finite_number("k", k)}, (angle("theta"), angle("p")), name="standard")


def _kick(x: Sequence[float], p: Any) -> tuple[float, float]:
    momentum = x[1] + p.k * sin(x[0])
    return x[0] + momentum, momentum
