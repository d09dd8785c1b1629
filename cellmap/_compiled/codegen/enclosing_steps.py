"""Steps of enclosures of flows: what is known of boxes after a step, from what is known before it."""

from __future__ import annotations

from itertools import combinations_with_replacement
from typing import Any

from .enclosures import BoxLayout, Lanes
from .instructions import Value, total
from .intervals import Interval, largest, products, widened
from .moving_frames import Errors, Frame, Matrix, stretched
from .picard import a_priori_set
from .trace import STATEFUL

_DIGITS = 2.0**-44  # fraction of a coordinate below which remainders are as good as none
_LEAST = 1e-290


def pairs_of(d: int) -> list[tuple[int, int]]:
    """Return the pairs of coordinates of second derivatives."""
    return list(combinations_with_replacement(range(d), 2))


class FirstOrderStep:
    """A step of the boxes of a vector of lanes, from what is known of them before to what is known after."""

    def __init__(
        self, lanes: Lanes, rows: BoxLayout, box: str, series: list[Any], order: int, h: Interval, memory: str
    ) -> None:
        self.lanes, self.rows, self.box, self.order, self.h, self.memory = lanes, rows, box, order, h, memory
        self.at_point, self.over_box, self.over_step = series
        self.code, self.d = lanes.code, range(rows.d)
        self.errors = Errors(lanes, box, rows.frame)
        self.x = [lanes.number(box, k) for k in rows.images]
        self.off = self.errors.hull(rows.image_errors)
        self.half_widths = [lanes.number(box, k).m for k in rows.half_widths]
        self.middles = self._matrix(rows.derivatives)
        hulls = [self.errors.hull(rows.derivative_errors[j :: rows.d]) for j in self.d]
        self.derivatives = [[Interval(self.code, self.middles[i][j].m, hulls[j][i]) for j in self.d] for i in self.d]
        self.identity = [self.code.number(float(i == k)) for k in self.d for i in self.d]

    def write(self) -> None:
        """Write the step."""
        radii = [
            widened(products([entry.reach for entry in row], self.half_widths), off)
            for row, off in zip(self.derivatives, self.off, strict=True)
        ]
        rest = self._expand(self.x, self._around(radii), radii)
        step = self._jacobian(self.over_box, rest)
        self._move(step, [self._summed(self.at_point, rest, i) for i in self.d])
        sizes = [[rest[self._place(i, k)].reach for k in self.d] for i in self.d]
        self._add_remainder([rest[i].reach + products(sizes[i], radii) for i in self.d], radii)

    def _matrix(self, rows: range) -> list[list[Interval]]:
        found, columns = [self.lanes.number(self.box, k) for k in rows], len(rows) // len(self.d)
        return [found[i * columns : (i + 1) * columns] for i in self.d]

    def _around(self, radii: list[Value]) -> list[Interval]:
        return [Interval(self.code, p.m, r) for p, r in zip(self.x, radii, strict=True)] + self.identity

    def _place(self, i: int, k: int) -> int:
        """Return the number of component i of tangent vector k among the states."""
        return (1 + k) * len(self.d) + i

    def _expand(self, point: list[Interval], start: list[Interval], radii: list[Value]) -> list[Interval]:
        """Write all series; return the remainders of the states."""
        self.kept = a_priori_set(self.lanes, self.over_step, start, self.h, self.memory)
        for series, states in ((self.at_point, point), (self.over_box, start), (self.over_step, self.kept)):
            series.states = [[state] for state in states]
            for k in range(self.order + (series is self.over_step)):
                series.write(STATEFUL, k)
                series.advance_states(k)
        return [terms[-1] for terms in self.over_step.states]

    def _summed(self, series: Any, rest: list[Interval], j: int) -> Interval:
        terms: list[Any] = [rest[j], *reversed(series.states[j])]
        found: Any = total(terms)
        return found

    def _jacobian(self, series: Any, rest: list[Interval]) -> list[list[Interval]]:
        return [[self._summed(series, rest, self._place(i, k)) for k in self.d] for i in self.d]

    def _move(self, step: Matrix, images: list[Interval]) -> None:
        """Write what is known after the step with some derivative."""
        rows, put = self.rows, self.lanes.put
        moved = self.errors.moved(step)
        frame = Frame.along(moved, self.lanes)
        stretch = stretched(frame, moved)
        off, entries, hulls = self._carried(step, images, frame, stretch)
        for i in self.d:
            lost = products(hulls[i], self.half_widths)
            put(widened(lost, off[i]), self.box, rows.spreads[i])
            for j in self.d:
                self.lanes.store(Interval(self.code, entries[i][j].m, hulls[i][j]), self.box, *self._entry(i, j))
        self.errors.turn(frame)

    def _entry(self, i: int, j: int) -> tuple[int, int]:
        place = i * len(self.d) + j
        return self.rows.derivatives[place], self.rows.derivative_radii[place]

    def _carried(
        self, step: Matrix, images: list[Interval], frame: Frame, stretch: list[list[Value]]
    ) -> tuple[list[Value], Matrix, list[list[Value]]]:
        """Write images and bounds of their errors; return these bounds, the derivatives, and bounds of their errors."""
        rows, errors = self.rows, self.errors
        off = errors.carry(rows.image_errors, frame, stretch, images)
        for i in self.d:
            self.lanes.store(Interval(self.code, images[i].m, off[i]), self.box, rows.images[i], rows.image_radii[i])
        entries = [[Interval.dot([(step[i][k], self.middles[k][j]) for k in self.d]) for j in self.d] for i in self.d]
        columns = [
            errors.carry(rows.derivative_errors[j :: rows.d], frame, stretch, [row[j] for row in entries])
            for j in self.d
        ]
        return off, entries, [[column[i] for column in columns] for i in self.d]

    def _add_remainder(self, lost: list[Value], radii: list[Value]) -> None:
        """Add the largest remainder, relative to the size of the set; it bounds nothing and need not be rigorous."""
        parts = [
            value / (r + _DIGITS * kept.reach + _LEAST) for value, r, kept in zip(lost, radii, self.kept, strict=False)
        ]
        place = self.lanes.place(self.box, self.rows.remainder)
        self.lanes.out.store(self.lanes.out.load(place, vector=True) + largest(parts), place)


class SecondOrderStep(FirstOrderStep):
    """A step with second derivatives.

    For a point x of the box, F(x) = F(c) + D (x - c) + H(x - c, x - c)/2 and DF(x) = D + H'(x - c), with D the
    derivative at the centre and H, H' among the bends.  A step with the first derivative W at F(c) and second
    derivatives V over the set has the bends W H + V(E, E), where E bounds D + H(x - c) over the box: F(x) is off F(c)
    by E (x - c) for one such E, so W changes on the way there by no more than V E (x - c), which V(E, E) holds.
    """

    def write(self) -> None:
        """Write the step."""
        d, pairs, rows, code = self.d, pairs_of(len(self.d)), self.rows, self.code
        w, count = self.half_widths, len(pairs_of(len(self.d)))
        number = {(j, k): p for p, pair in enumerate(pairs) for j, k in (pair, pair[::-1])}
        bends = self._matrix(rows.curvatures)
        hulls = [self.errors.hull(rows.curvature_errors[p::count]) for p in range(count)]
        curved = [[Interval(code, bends[i][p].m, hulls[p][i]) for p in range(count)] for i in d]
        halves = [(0.5 if j == k else 1.0) * (w[j] * w[k]) for j, k in pairs]
        radii = [
            widened(
                products([entry.reach for entry in self.derivatives[i]], w),
                products([entry.reach for entry in curved[i]], halves),
                self.off[i],
            )
            for i in d
        ]
        start = self._around(radii) + [code.number(0.0)] * (count * len(d))
        rest = self._expand(self.x + self.identity, start, radii)
        middle = self._jacobian(self.at_point, rest)
        second = [[self._summed(self.over_box, rest, (1 + len(d) + p) * len(d) + i) for p in range(count)] for i in d]

        near = [
            [
                Interval(
                    code,
                    middle[i][k].m,
                    widened(middle[i][k].r, products([second[i][number[k, j]].reach for j in d], self.off)),
                )
                for k in d
            ]
            for i in d
        ]
        over = [
            [
                Interval(code, entry.m, widened(entry.r, products([curved[i][number[j, k]].reach for k in d], w)))
                for j, entry in enumerate(row)
            ]
            for i, row in enumerate(self.derivatives)
        ]
        squares = [
            [over[a][j] * over[b][k] if a == b else over[a][j] * over[b][k] + over[b][j] * over[a][k] for a, b in pairs]
            for j, k in pairs
        ]
        bent = [
            [
                Interval.dot([*zip(second[i], squares[p], strict=True), *((near[i][k], bends[k][p]) for k in d)])
                for p in range(count)
            ]
            for i in d
        ]
        moved = self.errors.moved(near)
        frame = Frame.along(moved, self.lanes)
        stretch = stretched(frame, moved)
        off, entries, lost = self._carried(near, [self._summed(self.at_point, rest, i) for i in d], frame, stretch)
        bounds = [
            self.errors.carry(rows.curvature_errors[p::count], frame, stretch, [row[p] for row in bent])
            for p in range(count)
        ]
        self.errors.turn(frame)
        for i in d:
            reach = [Interval(code, bent[i][p].m, bounds[p][i]).reach for p in range(count)]
            for p in range(count):
                self.lanes.put(bent[i][p].m, self.box, rows.curvatures[i * count + p])
            spread = widened(products(lost[i], w), products(reach, halves), off[i])
            self.lanes.put(spread, self.box, rows.spreads[i])
            for j in d:
                radius = widened(lost[i][j], products([reach[number[j, k]] for k in d], w))
                self.lanes.store(Interval(code, entries[i][j].m, radius), self.box, *self._entry(i, j))
        squared = [(0.5 if j == k else 1.0) * (radii[j] * radii[k]) for j, k in pairs]
        self._add_remainder(
            [
                rest[i].reach
                + products([rest[self._place(i, k)].reach for k in d], radii)
                + products([rest[(1 + len(d) + p) * len(d) + i].reach for p in range(count)], squared)
                for i in d
            ],
            radii,
        )
