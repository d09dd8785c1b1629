"""Orbits with all their points, period by period."""

from __future__ import annotations

from ..loops import loop
from .labelling import FLOW, apply_exact_map
from .periods import notice


@loop
def record(step, points, rotations, status, small, places, turned, states):
    """Move orbits on by the exact map, and write where they are after each period; return the steps that were made.

    ``places`` (periods, n, d), ``turned`` (periods, n, d) and ``states`` (periods, n) receive points, full rotations
    and status.  The map of a step is a flow or a compiled function.  ``small`` is for :func:`.periods.notice`.
    """
    total = 0
    for period in range(places.shape[0]):
        if step.kind == FLOW:
            notice(step.motion, points, status, small)
        total += apply_exact_map(step, points, rotations, status, 1)
        for k in range(points.shape[0]):
            states[period, k] = status[k]
            for j in range(points.shape[1]):
                places[period, k, j] = points[k, j]
                turned[period, k, j] = rotations[k, j]
    return total
