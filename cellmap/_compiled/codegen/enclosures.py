"""Enclosures of maps over boxes in mean-value form, in SIMD lanes, as LLVM instructions.

For a box of points x with abs(x - c) <= w, in each component, F(x) lies in F(c) + D (x - c), where D encloses the
derivative of F at every point of the box.  The functions are

    enclose(state, count, stride, p)                                   for discrete maps
    enclose(state, count, stride, p, steps, times, length, spread)     for flows

with addresses of arrays, of which ``state`` has rows of `stride` numbers, one for each box: see :class:`BoxLayout`.
``p`` holds the midpoint and the radius of each parameter; for flows the unit of each coordinate, a power of two, and
its inverse follow.  A step of a flow begins at one of the ``times``, again midpoints and radii,
and lasts as long as ``length`` and ``spread`` say, its midpoint and radius.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import accumulate, pairwise
from typing import Any

from ..._lib.arrays import Floats
from ..machine_code import MachineCode, machine_code, vector_width
from .derivative import along
from .emit import evaluate, inputs
from .exact_formulas import enclosable
from .expression import Expression, in_order
from .instructions import Instructions, Value, module_text
from .intervals import Enclosing, Interval, products, smaller, widened
from .trace import STATEFUL, Trace

MOST_BENDS = 3  # states, up to which second derivatives of discrete maps are worth their work


@dataclass(frozen=True)
class BoxLayout:
    """Rows of the array ``state`` of boxes in d dimensions; those of matrices row by row.

    Half-widths; midpoints and radii of images, and of the derivatives over the boxes; and the distances from the
    midpoints that F(x) - D (x - c) keeps to, with D the midpoints of the derivatives.  Midpoints of images hold the
    centres before.

    Flows keep errors in a moving frame as well: its axes, and the sizes of errors along them.  Of second order they
    have the second derivatives over the boxes, for each of the `pairs` of coordinates, and errors of these.
    ``remainder`` sums the largest remainder of a series over the steps, relative to the size of the set.
    """

    half_widths: range
    images: range
    image_radii: range
    derivatives: range
    derivative_radii: range
    spreads: range
    frame: range
    image_errors: range
    derivative_errors: range
    curvatures: range
    curvature_errors: range
    remainder: int
    count: int

    @classmethod
    def of(cls, d: int, pairs: int = 0) -> BoxLayout:
        """Return the rows for boxes in d dimensions."""
        sizes = [d, d, d, d * d, d * d, d, d * d, d, d * d, pairs * d, pairs * d]
        ends = [0, *accumulate(sizes)]
        rows: list[Any] = [*(range(*pair) for pair in pairwise(ends)), ends[-1], ends[-1] + 1]
        return cls(*rows)

    @property
    def d(self) -> int:
        """Number of state variables."""
        return len(self.images)


@dataclass(frozen=True, eq=False)
class CompiledEnclosure:
    """A function ``enclose`` in memory, for boxes in d dimensions; of a flow with series of some order, else 0.

    ``code`` returns what holds the function, given how many more steps of boxes it is needed for.
    """

    rows: BoxLayout
    order: int
    code: Callable[[int], MachineCode]

    def __call__(
        self, state: Floats, count: int, p: Floats, times: Floats | None = None, step: tuple[float, float] = (0.0, 0.0)
    ) -> None:
        """Enclose the images of boxes in place; see the module."""
        address, arguments = ctypes.c_void_p, [state.ctypes.data, count, state.shape[1], p.ctypes.data]
        kinds: list[Any] = [address, ctypes.c_int64, ctypes.c_int64, address]
        if times is not None:
            arguments += [len(times), times.ctypes.data, *step]
            kinds += [ctypes.c_int64, address, ctypes.c_double, ctypes.c_double]
        code = self.code(count if times is None else count * len(times))
        ctypes.CFUNCTYPE(None, *kinds)(code.address("enclose"))(*arguments)


def discrete_enclosure(trace: Trace, parameters: int) -> CompiledEnclosure:
    """Compile the enclosure of a traced discrete map."""
    code = machine_code(discrete_text(enclosable(trace), parameters, vector_width()))
    return CompiledEnclosure(BoxLayout.of(len(trace.states)), 0, lambda _: code)


def discrete_text(trace: Trace, parameters: int, width: int) -> str:
    """Return the text of a module with the function ``enclose`` of a discrete map.

    The derivative over a box is bounded by its own formula, and by that at the centre and second derivatives over the
    box; the narrower one counts.
    """
    graph, rows, d = trace.graph, BoxLayout.of(len(trace.states)), len(trace.states)
    one = graph.constant(1.0)
    columns = [along(graph, trace.outputs, {x: one}) for x in trace.states]
    entries = [e for row in zip(*columns, strict=True) for e in row]
    bends = [along(graph, entries, {x: one}) for x in trace.states] if d <= MOST_BENDS else []
    lanes = Lanes(width, parameters)
    with lanes.boxes() as box:
        w = [lanes.number(box, k).m for k in rows.half_widths]
        centre = [lanes.number(box, k) for k in rows.images]
        over = [lanes.interval(box, *pair) for pair in zip(rows.images, rows.half_widths, strict=True)]
        known = lanes.values(replace(trace, outputs=(*trace.outputs, *entries)), centre)
        wide = lanes.values(replace(trace, outputs=(*entries, *(e for bend in bends for e in bend))), over)
        images, near, bent = known[:d], known[d:], [wide[k : k + d * d] for k in range(d * d, len(wide), d * d)]
        for value, m, r in zip(images, rows.images, rows.image_radii, strict=True):
            lanes.store(value, box, m, r)
        radii = [widened(abs(a.m - b.m), a.radius) for a, b in zip(wide, near, strict=False)]
        moved = [widened(products([bend[e].reach for bend in bent], w), near[e].radius) for e in range(d * d) if bent]
        radii = [smaller(a, b) for a, b in zip(moved, radii, strict=True)] if bent else radii
        for value, radius, m, r in zip(near, radii, rows.derivatives, rows.derivative_radii, strict=True):
            lanes.store(Interval(lanes.code, value.m, radius), box, m, r)
        for i, row in enumerate(rows.spreads):
            of_row = range(i * d, (i + 1) * d)
            spread = widened(products([radii[e] for e in of_row], w), images[i].radius)
            if bent:
                halves = [0.5 * products([bend[e].reach for bend in bent], w) + near[e].radius for e in of_row]
                spread = smaller(widened(products(halves, w), images[i].radius), spread)
            lanes.put(spread, box, row)
    return lanes.module("ptr noalias %state, i64 %count, i64 %stride, ptr noalias %p")


class Lanes:
    """The body of a function ``enclose``: parameters, and boxes in vectors of lanes."""

    def __init__(self, width: int, parameters: int, scales: int = 0) -> None:
        self.out = Instructions(width, flags="")
        self.code = Enclosing(self.out)
        self.p = [self.code.loaded("%p", 2 * i) for i in range(parameters)]
        units = [self.out.load(self.out.address("%p", 2 * parameters + i)) for i in range(2 * scales)]
        self.scales = list(zip(units[::2], units[1::2], strict=True))

    def boxes(self) -> Any:
        """Repeat what is written inside for each vector of boxes, given the number of its first one."""
        return self.out.loop_over_lanes("%count", "box")

    def place(self, box: str, row: int) -> str:
        """Return the address of the numbers of boxes in a row."""
        first = self.out.whole("mul", "%stride", row)
        return self.out.address("%state", self.out.whole("add", first, box))

    def number(self, box: str, row: int) -> Interval:
        """Load numbers that are known exactly."""
        return Interval(self.code, self.out.load(self.place(box, row), vector=True))

    def interval(self, box: str, midpoint: int, radius: int) -> Interval:
        """Load intervals from two rows."""
        return Interval(self.code, *(self.out.load(self.place(box, k), vector=True) for k in (midpoint, radius)))

    def put(self, value: Value, box: str, row: int) -> None:
        """Store numbers in a row."""
        self.out.store(self.out.as_vector(value), self.place(box, row))

    def store(self, value: Interval, box: str, midpoint: int, radius: int) -> None:
        """Store intervals in two rows."""
        self.put(value.m, box, midpoint)
        self.put(value.radius, box, radius)

    def values(self, trace: Trace, x: list[Interval]) -> list[Interval]:
        """Write a function of the state alone."""
        code: Any = self.code
        nodes = in_order(trace.outputs)
        known: dict[Expression, Any] = inputs(code, nodes, parameter=self.p, state=x)
        found: Any = evaluate(code, nodes, known, STATEFUL)
        return [found[e] for e in trace.outputs]

    def module(self, arguments: str) -> str:
        """Return the text of a module with the function."""
        return module_text(self.out.function("enclose", arguments), self.out)
