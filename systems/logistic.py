"""The logistic map."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from cellmap import PointMap, discrete_map
from cellmap.utils import finite_number


def logistic_map(mu: float = 4.0) -> PointMap:
    """Return the logistic map: x' = mu x (1 - x).

    Parameters
    ----------
    mu : float, optional
        Growth of small x.  For values from 0 to 4 the interval [0, 1] is mapped into itself; other initial conditions
        diverge.

    Returns
    -------
    PointMap
        Map of the state (x,).

    Raises
    ------
    TypeError, ValueError
        For a parameter that is not a finite number.

    References
    ----------
    May, Nature 261 (1976) 459.

    Examples
    --------
    >>> logistic_map(mu=3.0)([0.5])
    array([0.75])
    """
    return discrete_map(_logistic, {"mu": finite_number("mu", mu)}, ("x",), name="logistic")


def _logistic(x: Sequence[float], p: Any) -> tuple[float]:
    return (p.mu * x[0] * (1.0 - x[0]),)
