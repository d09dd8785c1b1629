"""McDonald's map, whose basin boundary is known in closed form."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, pi
from typing import Any

from cellmap import PointMap, angle, discrete_map
from cellmap.utils import finite_number, whole_number


def mcdonald_map(degree: int = 3, growth: float = 1.5) -> PointMap:
    """Return McDonald's map: x' = degree x mod 1, y' = growth y + cos 2 pi x.

    Orbits escape to y = +inf or y = -inf.  Between the two lies the graph of Weierstrass's function
    y = -sum over k from 0 of cos(2 pi degree^k x) / growth^(k+1).  Where growth < degree its dimension is
    2 - ln(growth)/ln(degree) (McDonald et al.), and with it the uncertainty exponent is ln(growth)/ln(degree).

    Parameters
    ----------
    degree : int, optional
        Number of times that the circle is wound onto itself, at least 2.
    growth : float, optional
        Factor by which y grows, above 1.

    Returns
    -------
    PointMap
        Map of the state (x, y), x on the circle [0, 1).  An orbit beyond abs(y) = 1/(growth - 1) escapes to its side.

    Raises
    ------
    TypeError, ValueError
        For parameters that are not numbers within their bounds.

    References
    ----------
    McDonald, Grebogi, Ott, Yorke, Physica D 17 (1985) 125.

    Examples
    --------
    >>> mcdonald_map()([0.0, 1.0])
    array([0. , 2.5])
    """
    params = {
        "degree": float(whole_number("degree", degree, at_least=2)),
        "growth": finite_number("growth", growth, above=1.0),
    }
    return discrete_map(_map, params, (angle("x", unit="", period=1.0, lower=0.0), "y"), name="McDonald")


def _map(x: Sequence[float], p: Any) -> tuple[float, float]:
    return p.degree * x[0], p.growth * x[1] + cos(2.0 * pi * x[0])
