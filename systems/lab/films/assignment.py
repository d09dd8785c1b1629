"""Which blob is which marker: one blob for one marker at most, at the least cost, with the rods between them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import linear_sum_assignment

from ..arrays import Floats

_NEVER = 1e6

Choice = list[int]  # number of the blob for each marker, -1 for none
Conflict = Callable[[Choice], tuple[int, int] | None]


def match(costs: Floats, conflict: Conflict) -> Choice:
    """Return the matching of least cost in which no two markers are in conflict.

    Parameters
    ----------
    costs : ndarray, shape (markers, blobs)
        Cost of each pair, below 1; infinite where it is out of the question.  A marker without a blob costs 1.
    conflict : callable
        Two markers of a matching whose blobs do not go together, or None.

    Returns
    -------
    list of int
        Blob of each marker, -1 for none.

    Examples
    --------
    >>> match(np.array([[0.1, 0.3], [0.2, np.inf]]), lambda choice: None)
    [1, 0]
    """
    best, least = [-1] * len(costs), float(len(costs))
    waiting = [np.where(np.isfinite(costs), costs, _NEVER)]
    while waiting:
        table = waiting.pop()
        choice, cost = _assigned(table)
        if cost >= least:
            continue
        pair = conflict(choice)
        if pair is None:
            best, least = choice, cost
            continue
        for marker in pair:
            without = table.copy()
            without[marker, choice[marker]] = _NEVER
            waiting.append(without)
    return best


def _assigned(table: Floats) -> tuple[Choice, float]:
    markers, blobs = table.shape
    alone = np.full((markers, markers), _NEVER)
    np.fill_diagonal(alone, 1.0)
    whole = np.hstack([table, alone])
    rows, columns = linear_sum_assignment(whole)
    return [int(c) if c < blobs else -1 for c in columns], float(whole[rows, columns].sum())
