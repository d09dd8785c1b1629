"""The largest Lyapunov exponents in many dimensions, from orbits that begin beside others."""

from __future__ import annotations

import numpy as np

from ..._lib.arrays import Floats
from ..._lib.stopping import check_stop
from ...maps.coordinates import difference, wrap
from ...maps.orbit_batch import Orbits
from ...maps.point_map import PointMap
from ...maps.side_by_side import advance_on_threads
from ...orbits.lyapunov_qr import BLOCKS

FRAME, GROWING = 4, 256
"""Directions in which growth is seen where nobody asks for more, and the periods in which it is."""

_APART = 1e-5  # distance of orbits beside one another, in units of the region
_AT_ONCE = 64  # periods between looks whether the end was asked for


def leading_exponents(
    exact: PointMap, states: Floats, extent: Floats, periods: int = GROWING, directions: int = FRAME
) -> tuple[Floats, Floats]:
    """Return the largest Lyapunov exponents (n, k) per step of states (n, d), from orbits that begin beside theirs.

    And standard errors (n,) of the largest, from the means over ten stretches; NaN where an orbit ends.
    """
    n, d = states.shape
    number = min(directions, d)
    if not n:
        return np.empty((0, number)), np.empty(0)
    frames = np.tile(np.linalg.qr(np.random.default_rng(0).standard_normal((d, number)))[0], (n, 1, 1))
    here, growth, lost = states.copy(), np.zeros((periods, n, number)), np.zeros(n, bool)
    for step in range(periods):
        if step % _AT_ONCE == 0:
            check_stop()
        beside = here[:, None] + _APART * frames.transpose(0, 2, 1) * extent
        places = np.concatenate([here[:, None], beside], axis=1).reshape(-1, d)
        orbits = Orbits.starting(wrap(places, exact.coordinates))
        advance_on_threads(exact.advance, orbits, 1)
        lost |= ~orbits.alive.reshape(n, -1).all(axis=1)
        images = np.where(lost[:, None, None], states[:, None], orbits.points.reshape(n, 1 + number, d))
        here = images[:, 0].copy()
        moved = difference(images[:, 1:], here[:, None], exact.coordinates) / extent / _APART
        moved[lost] = np.eye(number, d)
        frames, upper = np.linalg.qr(moved.transpose(0, 2, 1))
        with np.errstate(divide="ignore"):
            growth[step] = np.log(np.abs(np.diagonal(upper, axis1=1, axis2=2)))
    growth[:, lost] = np.nan
    used = growth[periods // 8 :]
    length = max(len(used) // BLOCKS, 1)
    means = used[: BLOCKS * length].reshape(-1, length, n, number).mean(axis=1)
    exponents = used.mean(axis=0)
    largest = np.argmax(np.nan_to_num(exponents), axis=1)
    return exponents, means.std(axis=0, ddof=1)[np.arange(n), largest] / np.sqrt(BLOCKS)
