"""The rhythm of a free swing: how many half swings lie between two of its extremes, and how long it keeps step."""

from __future__ import annotations

import numpy as np

from ..arrays import Bools, Floats, Ints

_MOST_HIDDEN = 4  # pairs of half swings in an interval from which the time of one is guessed
_TRIED = 400  # times that are tried, at most
SURE = 0.35  # of a half swing, by which an interval may miss its count; the next one of its kind is two away
_TAIL = 0.25  # of the extremes, at most, that are no more than noise after the swing has died
_SILENT = 3  # times as many half swings without an extreme as ever before are too many,
_WATCHED = 0.25  # if no gap among them is longer than this fraction of one


def counted(lasted: Floats, odd: Bools) -> Ints:
    """Return the nearest odd number of half swings where sides change, else the nearest even one."""
    pairs = np.rint((lasted - odd) / 2.0).astype(np.int64)
    return np.where(odd, 2 * np.maximum(pairs, 0) + 1, 2 * np.maximum(pairs, 1))


def half_period(times: Floats, odd: Bools) -> float:
    """Return the longest of all times of which no shorter one fits clearly more intervals.

    Where many extremes are hidden, the typical interval is none of one half swing; short times fit some by chance.

    Parameters
    ----------
    times : ndarray, shape (n,)
        Intervals, as they would be at small amplitude (s).
    odd : ndarray of bool, shape (n,)
        Whether the side changes in them.

    Returns
    -------
    float
        Time of a half swing (s).

    Examples
    --------
    >>> half_period(np.array([3.0, 1.1, 2.0, 3.0, 0.9, 4.0]), np.array([True, True, False, True, True, False]))
    1.0
    """
    counts = np.arange(1, 2 * _MOST_HIDDEN, 2)[:, None] + ~odd
    halves = np.sort((times / counts).ravel())[::-1]
    halves = halves[:: -(-len(halves) // _TRIED)]
    lasted = times / halves[:, None]
    fit = (np.abs(lasted - counted(lasted, odd)) < SURE).sum(axis=1)
    best = float(halves[np.argmax(fit >= fit.max() - max(1, len(times) // 10))])
    near = counted(times / best, odd)
    good = np.abs(times / best - near) < SURE
    return float(np.median(times[good] / near[good]))


def in_step(times: Floats, steps: Ints, misfits: Floats, seen: Floats) -> int:
    """Return how many extremes belong to the swing; the last ones may be noise, or the bend of a rod that has stopped.

    Those, up to a quarter of all, are out of step, or come after many half swings without an extreme, of which there
    were samples.

    Parameters
    ----------
    times : ndarray, shape (n,)
        Times of the extremes (s).
    steps, misfits : ndarray, shape (n - 1,)
        Half swings from each to the next, and by how much the intervals miss them.
    seen : ndarray, shape (m,)
        Times of the samples (s).

    Returns
    -------
    int
        Number of extremes, `n` at most.
    """
    usual = np.maximum.accumulate(np.concatenate([[1], steps[:-1]]))
    breaks = misfits > SURE
    for k in np.flatnonzero(steps > _SILENT * usual):
        between = seen[(seen >= times[k]) & (seen <= times[k + 1])]
        breaks[k] |= np.diff(between).max(initial=0.0) < _WATCHED * (times[k + 1] - times[k]) / steps[k]
    ends = np.flatnonzero(breaks) + 1
    ends = ends[ends >= (1.0 - _TAIL) * len(times)]
    return int(ends[0]) if ends.size else len(times)
