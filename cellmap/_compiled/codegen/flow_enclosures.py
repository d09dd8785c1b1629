"""Enclosures of flows over boxes: steps of Taylor series with remainders (Lohner 1987; Zgliczynski 2002).

A box is carried along as the set of all x + e + D (x0 - c): a point x, known exactly, an error e of it, and the
derivative D at any point of the box.  It is known up to an error, and this and e lie in boxes of a frame Q.  In a step
of length h, with X the box around that set,

1. a set B that no orbit from X leaves during the step follows from Picard's operator: if X + [0, h] f(B) lies in B for
   f over the whole step, then all solutions exist, and stay in X + [0, h] f(B).  Derivatives are among the components.
2. The series at x, to the order K, has as its remainder the coefficient K + 1 over B; so has the series of the
   derivative of the step, W, over X.
3. x moves to the midpoint of its series and D to that of W D.  Errors become W Q times what they are in the frame, and
   what the midpoints do not know.  The frame turns to the axes that Gram and Schmidt make of W Q, for boxes that do not
   turn with the flow would grow at every step.

What depends on time alone is computed once for all boxes, at the beginning of the step and over all of it.
"""

from __future__ import annotations

import operator
from functools import reduce
from math import nan
from typing import Any

from ..machine_code import machine_code, vector_width
from .derivative import frame_traces
from .enclosures import CompiledEnclosure, Lanes, Rows, enclosable
from .expression import in_order
from .instructions import Value, number, total, where
from .intervals import Interval, fused, widened
from .methods import series_work
from .taylor import Series, Structure
from .trace import CONSTANT, STATEFUL, TIMED, Trace

_TRIALS = 12
_MORE = 0.2  # of a set that Picard's operator is tried on, beyond its image
_LEAST = 1e-290
_DIGITS = 2.0**-44  # of a coordinate: remainders below are as good as none


def flow_enclosure(trace: Trace, parameters: int, order: int) -> CompiledEnclosure:
    """Compile the enclosure of a period of a traced right-hand side, with series of an order."""
    rows = Rows(len(trace.states))
    return CompiledEnclosure(rows, order, machine_code(flow_text(enclosable(trace), parameters, order, vector_width())))


def flow_text(trace: Trace, parameters: int, order: int, width: int) -> str:
    """Return the text of a module with the function ``enclose`` of a flow."""
    d = len(trace.states)
    frames = min(frame_traces(trace, d), key=lambda found: (series_work(found), len(in_order(found.outputs))))
    lanes = Lanes(width, parameters)
    out, code, rows = lanes.out, lanes.code, Rows(d)
    memory = out.array(4 * len(frames.states) * width)
    structures: Any = (Structure(trace), order), (Structure(frames), order), (Structure(frames), order + 1)
    at_point, over_box, over_step = (Series(structure, k, code, lanes.p) for structure, k in structures)  # type: ignore[arg-type]
    each = (at_point, order), (over_box, order), (over_step, order + 1)
    for series, _ in each:
        series.write(CONSTANT, 0)
    with out.loop("step", "%steps") as step:
        t = code.loaded("%times", out.whole("mul", step, 2))
        h = Interval(code, out.argument("%length"), out.argument("%spread"))
        half = h * 0.5
        middle = t + half
        meanwhile = Interval(code, middle.m, widened(middle.r, half.reach))
        parts: Any = [h * code.reciprocal(k) for k in range(1, order + 2)]
        for series, last in each:
            clock: Any = meanwhile if series is over_step else t
            series.start_step(clock, h, parts)  # type: ignore[arg-type]
            for k in range(last):
                series.write(TIMED, k)
        with lanes.boxes() as box:
            _write_step(lanes, rows, box, each, h, memory)
    return lanes.module(
        "ptr noalias %state, i64 %count, i64 %stride, ptr noalias %p, "
        "i64 %steps, ptr noalias %times, double %length, double %spread"
    )


def _write_step(lanes: Lanes, rows: Rows, box: str, each: Any, h: Interval, memory: str) -> None:
    """Write a step of the boxes of a vector."""
    d, out, code = rows.d, lanes.out, lanes.code
    (at_point, _), (over_box, _), (over_step, _) = each
    x = [lanes.number(box, k) for k in rows.images]
    errors, half_widths = ([lanes.number(box, k).m for k in some] for some in (rows.image_radii, rows.half_widths))
    before = [lanes.interval(box, *pair) for pair in zip(rows.derivatives, rows.derivative_radii, strict=True)]
    radii = [widened(_stretched([before[i * d + j].reach for j in range(d)], half_widths), errors[i]) for i in range(d)]
    identity = [code.number(float(i == k)) for k in range(d) for i in range(d)]
    start = [Interval(code, p.m, r) for p, r in zip(x, radii, strict=True)] + identity
    kept = _a_priori_set(lanes, over_step, start, h, memory)
    for (series, last), states in zip(each, (x, start, kept), strict=True):
        series.states = [[state] for state in states]
        for k in range(last):
            series.write(STATEFUL, k)
            series.advance_states(k)
    rest: Any = [terms[-1] for terms in over_step.states]

    def summed(series: Any, j: int) -> Interval:
        found: Any = total([rest[j], *reversed(series.states[j])])
        return found

    images = [summed(at_point, j) for j in range(d)]
    step = [[summed(over_box, d + k * d + i) for k in range(d)] for i in range(d)]
    middles = [Interval(code, entry.m) for entry in before]
    entries = [Interval.dot([(step[i][k], middles[k * d + j]) for k in range(d)]) for i in range(d) for j in range(d)]
    frame = [[lanes.number(box, rows.frame[i * d + k]) for k in range(d)] for i in range(d)]
    moved = [[Interval.dot([(step[i][j], frame[j][k]) for j in range(d)]) for k in range(d)] for i in range(d)]
    turned = Frame.of([[entry.m for entry in row] for row in moved], code)
    seen = [turned.coordinates([row[k] for row in moved]) for k in range(d)]  # of the old axes, moved
    stretch = [[seen[k][i].reach for k in range(d)] for i in range(d)]
    for values, m, r, sizes in (
        (images, rows.images, rows.image_radii, rows.image_errors),
        *(
            (entries[j::d], rows.derivatives[j::d], rows.derivative_radii[j::d], rows.derivative_errors[j::d])
            for j in range(d)
        ),
    ):
        old = [lanes.number(box, k).m for k in sizes]
        new = turned.sizes([value.r for value in values])
        along = [widened(_stretched(row, old), size) for row, size in zip(stretch, new, strict=True)]
        for i, value in enumerate(values):
            hull = widened(_stretched([q.size for q in turned.axes[i]], along))
            lanes.store(Interval(code, value.m, hull), box, m[i], r[i])
            out.store(along[i], lanes.place(box, sizes[i]))
    for i in range(d):
        for k in range(d):
            out.store(turned.axes[i][k].m, lanes.place(box, rows.frame[i * d + k]))
    parts = []
    for i in range(d):
        lost = rest[i].reach + _stretched([rest[d + k * d + i].reach for k in range(d)], radii)
        parts.append(lost / (radii[i] + _DIGITS * kept[i].reach + _LEAST))
    place = lanes.place(box, rows.remainder)
    out.store(out.load(place, vector=True) + _largest(parts), place)


class Frame:
    """Axes, the columns of a matrix Q of numbers that is almost orthogonal, and coordinates along them.

    With G the product of the transpose and Q, the inverse is that of G times the transpose.  Where rows of G - 1 have
    sums of absolute values below some e, entries of the inverse of G are off those of 1 by e/(1 - e) at most.
    """

    def __init__(self, axes: list[list[Interval]]) -> None:
        self.axes, d = axes, len(axes)
        gram = [[Interval.dot([(row[i], row[k]) for row in axes]) for k in range(d)] for i in range(d)]
        sums = [total((gram[i][k] - float(i == k)).reach for k in range(d)) for i in range(d)]
        skew = widened(_largest(sums))
        self.skew = where(skew < 0.5, 2.0 * skew, nan)

    @classmethod
    def of(cls, columns: list[list[Value]], code: Any) -> Frame:
        """Return the frame that Gram and Schmidt make of columns of a matrix, given by its rows."""
        found: list[list[Value]] = []
        for column in zip(*columns, strict=True):
            rest = list(column)
            for axis in found:
                along = total(a * b for a, b in zip(axis, rest, strict=True))
                rest = [b - along * a for a, b in zip(axis, rest, strict=True)]
            length = code.out.intrinsic("sqrt", total(b * b for b in rest))
            found.append([b / length for b in rest])
        return cls([[Interval(code, code.out.as_vector(axis[i])) for axis in found] for i in range(len(columns))])

    def coordinates(self, vector: list[Interval]) -> list[Interval]:
        """Return the coordinates of a vector along the axes."""
        found = [Interval.dot(list(zip(axis, vector, strict=True))) for axis in zip(*self.axes, strict=True)]
        lost = self.skew * _largest([value.reach for value in found])
        return [Interval(value.code, value.m, widened(value.r, lost)) for value in found]

    def sizes(self, radii: list[Any]) -> list[Value]:
        """Return bounds of the coordinates of vectors whose components have bounds."""
        found = [_stretched([q.size for q in axis], radii) for axis in zip(*self.axes, strict=True)]
        lost = self.skew * _largest(found)
        return [widened(value, lost) for value in found]


def _largest(values: list[Value]) -> Value:
    """Return the largest of numbers; NaN where one is."""
    return reduce(lambda a, b: where(a > b, a, where(b >= a, b, nan)), values)


def _stretched(sizes: list[Value], lengths: list[Value]) -> Value:
    """Return a sum of products of numbers that are not negative."""
    first, *others = zip(sizes, lengths, strict=True)
    return reduce(lambda s, pair: fused(pair[0], pair[1], s), others, first[0] * first[1])


def _a_priori_set(lanes: Lanes, over_step: Any, start: list[Interval], h: Interval, memory: str) -> list[Interval]:
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
