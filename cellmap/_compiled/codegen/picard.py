"""Sets that no solution leaves during a step, by Picard's operator on intervals (Moore 1966)."""

from __future__ import annotations

import operator
from functools import reduce
from math import nan
from typing import Any

from .enclosures import Lanes
from .instructions import Value, number, where
from .intervals import Interval, fused, widened
from .trace import STATEFUL

_TRIALS = 12
_MORE = 0.2  # fraction by which a set that the operator is tried on exceeds its image
_LEAST = 1e-290


def a_priori_set(lanes: Lanes, over_step: Any, start: list[Interval], h: Interval, memory: str) -> list[Interval]:
    """Write Picard's operator, tried on larger and larger sets; return one that no solution leaves, or NaN as radii."""
    out, code, count = lanes.out, lanes.code, len(start)
    outputs, longest = over_step.trace.outputs, widened(h.reach)
    half = 0.5 * longest

    def place(which: int, j: int) -> str:
        return out.address(memory, (which * count + j) * out.width)

    def moved(states: list[Interval]) -> list[tuple[Interval, Value]]:
        """Return start + [0, h] f(states), and the radius of the second term."""
        over_step.states = [[state] for state in states]
        over_step.write(STATEFUL, 0)
        found = []
        for j, state in enumerate(start):
            f = over_step.at(outputs[j], 0)
            reach = fused(f.size, half, longest * (f.r or number(0.0)))
            m = half * f.m
            lost = fused(abs(m), 2.0**-52, number(1e-300))
            found.append((state + Interval(code, m, widened(reach, lost)), reach))
        return found

    def keep(which: int, j: int, m: Value, r: Value) -> None:
        out.store(out.as_vector(m), place(which, j))
        out.store(out.as_vector(r), place(which + 1, j))

    def loaded(which: int) -> list[Interval]:
        return [Interval(code, *(out.load(place(which + i, j), vector=True) for i in (0, 1))) for j in range(count)]

    def try_larger(sets: list[tuple[Interval, Value]]) -> None:
        for j, (image, reach) in enumerate(sets):
            assert image.r is not None
            keep(0, j, image.m, fused(image.reach, 2.0**-40, fused(reach, _MORE, image.r)) + _LEAST)

    try_larger(moved(start))
    for j in range(count):
        keep(2, j, out.number(0.0), out.number(nan))
    with out.loop("picard", _TRIALS):
        tried, found = loaded(0), loaded(2)
        images = moved(tried)
        inside = reduce(operator.and_, (_is_inside(a, b) for (a, _), b in zip(images, tried, strict=True)))
        for j, ((image, _), known) in enumerate(zip(images, found, strict=True)):
            assert image.r is not None
            assert known.r is not None
            keep(2, j, where(inside, image.m, known.m), where(inside, image.r, known.r))
        failed = reduce(operator.or_, (image.r.differs(image.r) for image, _ in images if image.r is not None))
        settled = inside | failed
        out.write(f"br i1 {out.over_lanes('and', settled)}, label %picard.done, label %picard.larger")
        out.label("picard.larger")
        try_larger(images)
    return loaded(2)


def _is_inside(a: Interval, b: Interval) -> Value:
    """Return the condition that an interval lies in another one; false for NaN."""
    assert a.r is not None
    assert b.r is not None
    return (abs(a.m - b.m) + a.r) * (1.0 + 2.0**-40) <= b.r
