"""How near an orbit comes to touching a surface without passing through it."""

from __future__ import annotations

import numpy as np

from ..loops import inlined
from .blocks import LANES
from .events import load_event
from .lane import COUNTS, STRIKES

DEPTH, EXTENT, IMPACTS = range(3)
"""What is kept for a surface: the least depth of a turning point, below 0 behind the surface; the largest distance from
the surface; and the number of impacts, minus infinity where a state rests."""

RECORDS = 3

_PARTS = 16  # parts of a step, in each of which a turning point is looked for
_HALVINGS = 60


@inlined
def _with_slopes(a, degree, x):
    value, slope, bend = a[degree], 0.0, 0.0
    for k in range(degree - 1, -1, -1):
        bend = bend * x + slope
        slope = slope * x + value
        value = value * x + a[k]
    return value, slope, 2.0 * bend


@inlined
def watch(system, series, lane, event, until, records):
    """Keep how near a lane came to each surface on which it turned round, in a step up to a fraction of it.

    Where it passes through, the turning point lies behind the surface: as far as the motion there, without the surface,
    would have led.  ``records`` has RECORDS numbers for each surface.
    """
    a, size, order = event.series, lane.state.size, system.order
    for e in range(lane.slides.size):
        if system.kinds[e] >= STRIKES:
            records[RECORDS * e + IMPACTS] += -np.inf if lane.slides[e] > 0.0 else event.hits[e]
        if lane.slides[e] > 0.0 or system.kinds[e] == COUNTS:
            continue
        if not load_event(series[(size + e) * (order + 1) * LANES :], 0.0, 1.0, 0, a, order + 1) < np.inf:
            continue
        kept = records[RECORDS * e :]
        value, slope, bend = _with_slopes(a, order, 0.0)
        kept[EXTENT] = max(kept[EXTENT], abs(value))
        low = 0.0
        for part in range(_PARTS):
            high = until * (part + 1.0 + 1e-6) / _PARTS
            before = slope
            value, slope, bend = _with_slopes(a, order, high)
            kept[EXTENT] = max(kept[EXTENT], abs(value))
            if before < 0.0 and slope >= 0.0:
                left, right = low, high
                for _ in range(_HALVINGS):
                    middle = 0.5 * (left + right)
                    value, slope, bend = _with_slopes(a, order, middle)
                    if slope < 0.0:
                        left = middle
                    else:
                        right = middle
                if abs(value) < abs(kept[DEPTH]):
                    kept[DEPTH] = abs(value)
                value, slope, bend = _with_slopes(a, order, high)
            low = high
        value, slope, bend = _with_slopes(a, order, until)
        if event.hits[e] > 0.0 and slope <= 0.0 and bend > 0.0 and 0.5 * slope * slope < bend * abs(kept[DEPTH]):
            kept[DEPTH] = -0.5 * slope * slope / bend
