"""The map of Grebogi, Ott and Yorke, whose two fixed points share a fractal boundary."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, sin
from typing import Any

from cellmap import PointMap, angle, discrete_map
from cellmap.utils import finite_number


def grebogi_ott_yorke_map(a: float = 1.32, b: float = 0.90, c: float = 0.3) -> PointMap:
    """Return the map theta' = theta + a sin 2 theta - b sin 4 theta - x sin theta, x' = -c cos theta.

    Parameters
    ----------
    a, b : float, optional
        Amplitudes of the harmonics.
    c : float, optional
        Range of x; the map multiplies areas by c sin^2 theta.

    Returns
    -------
    PointMap
        Map of the state (theta, x), theta in [0, 2 pi).  Shifting theta by pi and reversing x is a symmetry.  The
        defaults have two attractors, (0, -0.3) and (pi, 0.3).

    Raises
    ------
    TypeError, ValueError
        For parameters that are not finite numbers.

    References
    ----------
    Grebogi, McDonald, Ott, Yorke, Physics Letters A 99 (1983) 415; McDonald, Grebogi, Ott, Yorke, Physica D 17 (1985)
    125.

    Examples
    --------
    >>> grebogi_ott_yorke_map()([0.0, 0.5])
    array([ 0. , -0.3])
    """
    return discrete_map(
        _map,
        {"a": finite_number("a", a), "b": finite_number("b", b), "c": finite_number("c", c)},
        (angle("theta", lower=0.0), "x"),
        name="Grebogi-Ott-Yorke",
    )


def _map(x: Sequence[float], p: Any) -> tuple[float, float]:
    theta, y = x
    return theta + p.a * sin(2.0 * theta) - p.b * sin(4.0 * theta) - y * sin(theta), -p.c * cos(theta)
