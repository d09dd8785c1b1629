"""Markov chains as sparse matrices: sweeps, eliminations; and maps of cells to cells, whose steps are certain.

A chain is (first, targets, probabilities): ``targets[first[i]:first[i + 1]]`` are the states to which state i leads.
"""

from __future__ import annotations

import numpy as np

from ..loops import loop

_FIRST_LOOK = 8  # sweeps before their number is foreseen
_NEW, _UNDER_WAY = -3, -4  # cells whose group is not known yet


@loop
def _relax_state(chain, gain, values, state, sums):
    """Solve the equation of one state for its values; return the largest relative change."""
    first, targets, probabilities = chain
    m = values.shape[1]
    for k in range(m):
        sums[k] = gain[k]
    own = 0.0
    for e in range(first[state], first[state + 1]):
        target, probability = targets[e], probabilities[e]
        if target == state:
            own += probability
        else:
            for k in range(m):
                sums[k] += probability * values[target, k]
    change = 0.0
    for k in range(m):
        value = sums[k] / (1.0 - own)
        if value > 0.0:
            change = max(change, abs(value - values[state, k]) / value)
        values[state, k] = value
    return change


@loop
def relax(chain, components, gain, values, number, last, patience, tolerance):
    """Solve ``values = gain + probabilities @ values`` on components that are not closed, from component `number` on.

    ``components`` are (order, begin, closed): ``order[begin[c]:begin[c + 1]]`` are the states of component c; those
    that it leads to come before it.  Within a component this is Gauss and Seidel's method, up and down in turns.
    Returns the first component, before `last`, for which `patience` sweeps will not do, with its values as far as they
    have come, or `last`.
    """
    order, begin, closed = components
    sums = np.empty(values.shape[1])
    for c in range(number, last):
        if closed[c]:
            continue
        low, high = begin[c], begin[c + 1]
        if high - low == 1:
            _relax_state(chain, gain, values, order[low], sums)
            continue
        before = np.inf
        sweep = 0
        while True:
            change = 0.0
            for i in range(low, high):
                change = max(change, _relax_state(chain, gain, values, order[i], sums))
            for i in range(high - 1, low - 1, -1):
                change = max(change, _relax_state(chain, gain, values, order[i], sums))
            sweep += 1
            rate = change / before if before > 0.0 else 0.0
            before = change
            if change == 0.0 or (sweep > 1 and rate < 1.0 and change * rate <= tolerance * (1.0 - rate)):
                break
            if sweep >= patience:
                return c
            # What is left of the error shrinks by the rate in each sweep.
            if sweep >= _FIRST_LOOK and (
                rate >= 1.0 or sweep + np.log(tolerance * (1.0 - rate) / change) / np.log(rate) > patience
            ):
                return c
    return last


@loop
def sweep(chain, right, out):
    """Write one sweep of Gauss and Seidel's method, up and down, for ``out = right + probabilities @ out`` from 0."""
    first, targets, probabilities = chain
    n = len(right)
    out[:] = 0.0
    for step in range(2 * n):
        i = step if step < n else 2 * n - 1 - step
        total, own = right[i], 0.0
        for e in range(first[i], first[i + 1]):
            if targets[e] == i:
                own += probabilities[e]
            else:
                total += probabilities[e] * out[targets[e]]
        out[i] = total / (1.0 - own)


@loop(vectors=True)
def eliminate(band, right, leak, pivots):
    """Take states out of a chain, the last one first, without a subtraction (Grassmann, Taksar, Heyman 1985).

    ``band[i, j - i + b]`` is the probability of a step from state i to state j no farther than b away, ``leak`` (n,)
    that of a step elsewhere, ``right`` (n, m) what the equations ``x = right + probabilities @ x`` add.  All are
    changed, and ``pivots`` (n,) receive what leaves each state for those before it and for elsewhere.
    """
    n, m = right.shape
    b = band.shape[1] // 2
    for k in range(n - 1, -1, -1):
        low = max(0, k - b)
        total = leak[k]
        for j in range(low, k):
            total += band[k, j - k + b]
        total = max(total, 1e-300)
        pivots[k] = total
        for i in range(low, k):
            factor = band[i, k - i + b] / total
            if factor == 0.0:
                continue
            for j in range(low, k):
                band[i, j - i + b] += factor * band[k, j - k + b]
            for c in range(m):
                right[i, c] += factor * right[k, c]
            leak[i] += factor * leak[k]


@loop(vectors=True)
def substitute(band, right, pivots):
    """Write the solution into ``right``, after the elimination."""
    n, m = right.shape
    b = band.shape[1] // 2
    for k in range(n):
        for j in range(max(0, k - b), k):
            probability = band[k, j - k + b]
            for c in range(m):
                right[k, c] += probability * right[j, c]
        for c in range(m):
            right[k, c] /= pivots[k]


@loop
def balance(band, pivots, measure):
    """Write the invariant measure of a chain without leaks, after the elimination, up to a factor."""
    b = band.shape[1] // 2
    measure[0] = 1.0
    for k in range(1, len(measure)):
        total = 0.0
        for j in range(max(0, k - b), k):
            total += measure[j] * band[j, k - j + b]
        measure[k] = total / pivots[k]


@loop
def unravel(images, groups, steps, periods):
    """Write the group of each cell, the steps that it takes to a periodic cell, and the period of each group.

    ``images`` (n,) are the cells to which cells go, or -1 and -2 for two sinks, which are groups of these numbers.  All
    arrays have the length n; returns the number of groups (Hsu 1980).
    """
    n = len(images)
    path = np.empty(n, np.int64)
    found = 0
    groups[:] = _NEW
    for start in range(n):
        length = 0
        cell = start
        while cell >= 0 and groups[cell] == _NEW:
            groups[cell] = _UNDER_WAY
            steps[cell] = length
            path[length] = cell
            length += 1
            cell = images[cell]
        if length == 0:
            continue
        tail = length
        if cell < 0:
            group, ahead = cell, 0
        elif groups[cell] == _UNDER_WAY:
            group, ahead, tail = found, 0, steps[cell]
            periods[found] = length - tail
            found += 1
            for k in range(tail, length):
                groups[path[k]], steps[path[k]] = group, 0
        else:
            group, ahead = groups[cell], steps[cell]
        for k in range(tail):
            groups[path[k]], steps[path[k]] = group, ahead + tail - k
    return found
