"""Akaike's criterion for small samples, and the weights of models that follow from it."""

from __future__ import annotations

from collections.abc import Mapping
from math import exp, log


def akaike_criterion(count: int, total: float, free: int) -> float:
    """Return the criterion of a fit by least squares.

    Parameters
    ----------
    count : int
        Number of values.
    total : float
        Sum of their squared residuals.
    free : int
        Number of fitted parameters, the variance of the residuals among them.

    Returns
    -------
    float
        Criterion; the smaller the better.

    References
    ----------
    Burnham, Anderson, *Model Selection and Multimodel Inference* (2002), section 2.4.
    """
    return count * log(max(total, 1e-300) / count) + 2.0 * free * count / max(count - free - 1, 1)


def akaike_weights(criteria: Mapping[str, float]) -> dict[str, float]:
    """Return how likely each model is the best of some, by the data, from their criteria.

    Examples
    --------
    >>> akaike_weights({"line": 10.0, "parabola": 10.0})
    {'line': 0.5, 'parabola': 0.5}
    """
    least = min(criteria.values())
    likely = {name: exp(-0.5 * (value - least)) for name, value in criteria.items()}
    total = sum(likely.values())
    return {name: value / total for name, value in likely.items()}
