"""Frames that turn with a flow, in which the errors of enclosures lie in boxes (Lohner 1987)."""

from __future__ import annotations

from collections.abc import Sequence
from math import nan

from .enclosures import Lanes
from .instructions import Value, total, where
from .intervals import Interval, largest, products, widened

Matrix = Sequence[Sequence[Interval]]
Scales = Sequence[tuple[Value, Value]]


class Frame:
    """Axes, the columns of S Q, and coordinates along them.

    S is diagonal and makes the units of all coordinates alike, by powers of two that round nothing; Q is a matrix of
    numbers that is almost orthogonal.  With G the product of its transpose and Q, the inverse of Q is that of G times
    the transpose.  Where rows of G - 1 have sums of absolute values below some e, entries of the inverse of G are off
    those of 1 by e/(1 - e) at most.
    """

    def __init__(self, turned: Matrix, scales: Scales) -> None:
        self.turned, self.scales, d = turned, scales, len(turned)
        self.axes = [
            [Interval(entry.code, scale * entry.m) for entry in row]
            for row, (scale, _) in zip(turned, scales, strict=True)
        ]
        gram = [[Interval.dot([(row[i], row[k]) for row in turned]) for k in range(d)] for i in range(d)]
        sums = [total((gram[i][k] - float(i == k)).reach for k in range(d)) for i in range(d)]
        skew = widened(largest(sums))
        self.skew = where(skew < 0.5, 2.0 * skew, nan)

    @classmethod
    def along(cls, vectors: Matrix, lanes: Lanes) -> Frame:
        """Return the frame that Gram and Schmidt make of the midpoints of the columns of a matrix."""
        found: list[list[Value]] = []
        for column in zip(*vectors, strict=True):
            rest = [inverse * entry.m for entry, (_, inverse) in zip(column, lanes.scales, strict=True)]
            for axis in found:
                along = total(a * b for a, b in zip(axis, rest, strict=True))
                rest = [b - along * a for a, b in zip(axis, rest, strict=True)]
            length = lanes.out.intrinsic("sqrt", total(b * b for b in rest))
            found.append([b / length for b in rest])
        rows = zip(*found, strict=True)
        return cls([[Interval(lanes.code, lanes.out.as_vector(q)) for q in row] for row in rows], lanes.scales)

    def coordinates(self, vector: Sequence[Interval]) -> list[Interval]:
        """Return the coordinates of a vector along the axes."""
        alike = [
            Interval(value.code, inverse * value.m, inverse * value.radius)
            for value, (_, inverse) in zip(vector, self.scales, strict=True)
        ]
        found = [Interval.dot(list(zip(axis, alike, strict=True))) for axis in zip(*self.turned, strict=True)]
        lost = self.skew * largest([value.reach for value in found])
        return [Interval(value.code, value.m, widened(value.r, lost)) for value in found]

    def sizes(self, radii: Sequence[Value]) -> list[Value]:
        """Return bounds of the coordinates of vectors whose components have bounds."""
        alike = [inverse * radius for radius, (_, inverse) in zip(radii, self.scales, strict=True)]
        found = [products([q.size for q in axis], alike) for axis in zip(*self.turned, strict=True)]
        lost = self.skew * largest(found)
        return [widened(value, lost) for value in found]


class Errors:
    """Errors of several vectors in the frame of the boxes of a vector of lanes."""

    def __init__(self, lanes: Lanes, box: str, frame: range) -> None:
        self.lanes, self.box, self.frame = lanes, box, frame
        d = round(len(frame) ** 0.5)
        self.axes = [[lanes.number(box, frame[i * d + k]) for k in range(d)] for i in range(d)]

    def sizes(self, rows: range) -> list[Value]:
        """Return sizes along the axes."""
        return [self.lanes.number(self.box, k).m for k in rows]

    def hull(self, rows: range) -> list[Value]:
        """Return bounds of the components of an error that is kept in some rows."""
        return hull_of(self.axes, self.sizes(rows))

    def moved(self, by: Matrix) -> Matrix:
        """Return the axes, moved by a matrix."""
        d = range(len(self.axes))
        return [[Interval.dot([(by[i][j], self.axes[j][k]) for j in d]) for k in d] for i in d]

    def turn(self, frame: Frame) -> None:
        """Keep other axes."""
        entries = [entry for row in frame.axes for entry in row]
        for entry, row in zip(entries, self.frame, strict=True):
            self.lanes.put(entry.m, self.box, row)

    def carry(
        self, rows: range, frame: Frame, stretch: Sequence[Sequence[Value]], values: Sequence[Interval]
    ) -> list[Value]:
        """Move an error into another frame, add the radii of values, and return the bounds of its components.

        ``stretch`` bounds the coordinates of each axis after the step, by rows.
        """
        old, new = self.sizes(rows), frame.sizes([value.radius for value in values])
        sizes = [widened(products(row, old), size) for row, size in zip(stretch, new, strict=True)]
        for size, row in zip(sizes, rows, strict=True):
            self.lanes.put(size, self.box, row)
        return hull_of(frame.axes, sizes)


def stretched(frame: Frame, moved: Matrix) -> list[list[Value]]:
    """Return bounds of the coordinates in a frame of the columns of a matrix, by rows."""
    columns = [frame.coordinates(column) for column in zip(*moved, strict=True)]
    return [[column[i].reach for column in columns] for i in range(len(moved))]


def hull_of(axes: Matrix, sizes: Sequence[Value]) -> list[Value]:
    """Return bounds of the components of vectors with bounded coordinates along axes."""
    return [widened(products([q.size for q in row], sizes)) for row in axes]
