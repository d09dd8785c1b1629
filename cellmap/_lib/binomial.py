"""Confidence intervals of a fraction estimated from a number of trials."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .arrays import Floats
from .checks import finite_number, one_of, real_array, shown
from .signatures import checked


@checked
def binomial_interval(
    count: ArrayLike, trials: ArrayLike, confidence: float = 0.95, method: str = "exact"
) -> tuple[Floats, Floats]:
    """Return confidence intervals of fractions.

    Parameters
    ----------
    count, trials : array_like of int
        Successes, and trials in which they happened, of shapes that go together.
    confidence : float, optional
        Between 0 and 1.
    method : {"exact", "Wilson"}, optional
        The interval of Clopper and Pearson, which covers the fraction with at least the stated confidence, or that of
        Wilson, which does so on average and is shorter.

    Returns
    -------
    tuple of ndarray
        Lower and upper ends; 0 and 1 without trials.

    Raises
    ------
    ValueError
        For counts that are negative or above the trials.

    References
    ----------
    Clopper, Pearson, Biometrika 26 (1934) 404; Wilson, Journal of the American Statistical Association 22 (1927) 209.

    Examples
    --------
    >>> low, high = binomial_interval(0, 100)
    >>> print(low, high.round(4))
    0.0 0.0362
    """
    from scipy.special import betaincinv, ndtri

    level = finite_number("confidence", confidence, above=0.0, at_most=1.0 - 1e-12)
    one_of("method", method, ("exact", "Wilson"))
    k, n = real_array("count", count), real_array("trials", trials)
    try:
        k, n = np.broadcast_arrays(k, n)
    except ValueError:
        raise ValueError(f"count has the shape {k.shape} and trials {n.shape}: give shapes that broadcast") from None
    if not ((k >= 0) & (k <= n) & np.isfinite(n)).all():
        raise ValueError(f"count={shown(count)}, trials={shown(trials)}: give counts between 0 and the trials")
    tail = 0.5 * (1.0 - level)
    if method == "exact":
        low = betaincinv(np.maximum(k, 1e-300), n - k + 1.0, tail)
        high = betaincinv(k + 1.0, np.maximum(n - k, 1e-300), 1.0 - tail)
    else:
        z, tried = float(ndtri(1.0 - tail)), np.maximum(n, 1.0)
        fraction = k / tried
        centre = fraction + z * z / (2 * tried)
        half = z * np.sqrt(fraction * (1.0 - fraction) / tried + z * z / (4 * tried * tried))
        low, high = (centre - half) / (1.0 + z * z / tried), (centre + half) / (1.0 + z * z / tried)
    return np.where(k == 0, 0.0, low), np.where(k == n, 1.0, high)
