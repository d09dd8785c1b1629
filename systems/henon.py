"""Hénon map."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from cellmap import PointMap, discrete_map
from cellmap.utils import finite_number


def henon_map(a: float = 1.4, b: float = 0.3) -> PointMap:
    """Return the Hénon map: x' = 1 - a x^2 + y, y' = b x.

    Parameters
    ----------
    a, b : float, optional
        Parameters; the map contracts areas by ``abs(b)``.

    Returns
    -------
    PointMap
        Map of the state (x, y).

    Raises
    ------
    TypeError, ValueError
        For parameters that are not finite numbers.

    References
    ----------
    Henon, Communications in Mathematical Physics 50 (1976) 69.

    Examples
    --------
    >>> henon_map()([0.0, 0.0])
    array([1., 0.])
    """
    return discrete_map(_henon, {"a": finite_number("a", a), "b": finite_number("b", b)}, ("x", "y"), name="Henon")


def _henon(x: Sequence[float], p: Any) -> tuple[float, float]:
    return 1.0 - p.a * x[0] ** 2 + x[1], p.b * x[0]
