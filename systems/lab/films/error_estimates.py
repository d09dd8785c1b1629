"""Errors of places as their own scatter about a smooth motion tells them."""

from __future__ import annotations

import numpy as np

from ..arrays import Floats
from ..time_series import noise_level

_NEIGHBOURS = (11, 13)
_FEWEST = 40  # places; the scatter of as many is known to 15 % or so
_LEVEL = 0.85  # of the scatter among fewer neighbours: what falls farther with more of them is motion, not noise


def widen_errors(times: Floats, positions: Floats, errors: Floats) -> None:
    """Widen the errors of each marker, across and down, where its places scatter by more, by as much in every frame.

    Parameters
    ----------
    times : ndarray, shape (n,)
        Times (s).
    positions, errors : ndarray, shape (n, markers, 2)
        Places and their standard errors (pixels), which are changed in place; NaN in gaps.
    """
    for marker in range(positions.shape[1]):
        for axis in range(2):
            spread = errors[:, marker, axis]
            expected = float(np.sqrt(np.nanmean(spread**2))) if np.isfinite(spread).any() else 0.0
            if expected > 0.0:
                more = max(0.0, _scatter(times, positions[:, marker, axis]) ** 2 - expected**2)
                spread[:] = np.sqrt(spread**2 + more)


def _scatter(times: Floats, places: Floats) -> float:
    """Return the standard deviation of noise on a smooth motion; 0 where too few frames show the motion itself.

    The more neighbours a difference has, the less of the motion it holds: by the square of the sine of half the angle
    that the fastest part of it turns between two frames, for every two neighbours.  Noise stays the same.
    """
    if np.count_nonzero(np.isfinite(places)) < _FEWEST:
        return 0.0
    with_few, with_more = (noise_level(times, places, count) for count in _NEIGHBOURS)
    return with_more if with_more >= _LEVEL * with_few else 0.0
