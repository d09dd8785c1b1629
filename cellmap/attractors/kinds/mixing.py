"""Orbits that share a label and never come to the same part of the state space, by their long-time averages."""

from __future__ import annotations

import numpy as np

from ..._lib.arrays import Bools, Floats
from ..._lib.stopping import check_stop
from ...maps.orbit_batch import Orbits
from ...maps.point_map import PointMap

LONG = 4
"""Times as long as they are given to settle, orbits are followed for their averages."""

_BATCHES = 16
_APART = 8.0  # standard errors between averages of orbits that are not on one attractor
_STEADY = 0.5  # of squared differences of successive batch means, in units of their variance: 2 if they are independent
_BOUNDARY = 4.0  # standard deviations by which the two ends of an orbit may change a sum over it
_ROUNDING = 1e-12  # of an observable in units of its standard deviation at the start


def unmixed(point_map: PointMap, points: Floats, typical: Bools, periods: int) -> Bools:
    """Tell which of some orbits, all said to be on one attractor, go elsewhere than the others do, shape (n,).

    After `periods` the orbits are followed for four times as long.  Time averages of coordinates and of their squares
    (of cosine and sine of angles) are the same for almost all orbits of one attractor; their standard errors are those
    of batch means (Fishman 1978), which the orbits have in common.  Orbits that a chain of others joins, each average
    within 8 standard errors of the next, are together; the attractor is where most of the `typical` ones (n,) are.
    Orbits that end are elsewhere.  Those whose batch means drift are not: their averages have not converged.
    """
    from scipy.sparse.csgraph import connected_components

    orbits = Orbits.starting(points.copy())
    point_map.advance(orbits, periods)
    rows = np.flatnonzero(orbits.alive)
    found = np.ones(len(points), bool)
    if not len(rows):
        return found
    orbits, length = orbits[rows], max(LONG * periods // _BATCHES, 1)
    sums = np.zeros((_BATCHES, len(rows), 2 * point_map.dimension))
    squares = np.zeros(sums.shape[1:])
    turn = np.array([c.period or 0.0 for c in point_map.coordinates])
    centre, width = (np.asarray(f(orbits.points, axis=0)) for f in (np.median, np.std))
    for batch in sums:
        check_stop()
        for _ in range(length):
            point_map.advance(orbits, 1)
            value = _observed(orbits.points, centre, np.where(width > 0.0, width, 1.0), turn)
            batch += value
            squares += value * value
    ended, rows = ~orbits.alive, rows[orbits.alive]
    if not len(rows):
        return found
    means, total = sums[:, ~ended] / length, _BATCHES * length
    average = means.mean(axis=0)
    scatter = means.var(axis=0, ddof=1)
    deviation = np.sqrt(np.maximum(squares[~ended] / total - average**2, 0.0).mean(axis=0))
    error = np.sqrt(scatter.mean(axis=0) / _BATCHES) + _BOUNDARY * deviation / total + _ROUNDING
    apart = np.zeros((len(rows), len(rows)))
    which = np.zeros(apart.shape, np.int64)  # the observable by which two orbits differ most
    for k, e in enumerate(error):
        distance = np.abs(np.subtract.outer(average[:, k], average[:, k])) / (np.sqrt(2.0) * e)
        which[distance > apart] = k
        apart = np.maximum(apart, distance)
    group = connected_components(apart <= _APART, directed=False)[1]
    voters = group[typical[rows]] if typical[rows].any() else group
    main = np.flatnonzero(group == np.bincount(voters).argmax())
    nearest = main[np.argmin(apart[:, main], axis=1)]
    differences = (np.diff(means, axis=0) ** 2).mean(axis=0)
    steady = (differences >= _STEADY * scatter) | (scatter <= _ROUNDING**2)
    found[rows] = (group != group[main[0]]) & steady[np.arange(len(rows)), which[np.arange(len(rows)), nearest]]
    return found


def _observed(points: Floats, centre: Floats, width: Floats, turn: Floats) -> Floats:
    """Return what is averaged along orbits, shape (n, 2 dimension)."""
    phase = 2.0 * np.pi * points / np.where(turn > 0.0, turn, 1.0)
    scaled = (points - centre) / width
    return np.concatenate(
        [np.where(turn > 0.0, np.cos(phase), scaled), np.where(turn > 0.0, np.sin(phase), scaled**2)], axis=1
    )
