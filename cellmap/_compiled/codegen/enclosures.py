"""Enclosures of maps over boxes in mean-value form, in SIMD lanes, as LLVM instructions.

For a box of points x with abs(x - c) <= w, in each component, F(x) lies in F(c) + D (x - c), where D encloses the
derivative of F at every point of the box.  The functions are

    enclose(state, count, stride, p)                                   for discrete maps
    enclose(state, count, stride, p, steps, times, length, spread)     for flows

with addresses of arrays, of which ``state`` has rows of `stride` numbers, one for each box: see :class:`Rows`.  ``p``
holds the midpoint and the radius of each parameter.  A step of a flow begins at one of the ``times``, again midpoints
and radii, and lasts as long as ``length`` and ``spread`` say, its midpoint and radius.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, replace
from typing import Any

from ..._lib.arrays import Floats
from ..machine_code import MachineCode, machine_code, vector_width
from .derivative import along
from .emit import evaluate, inputs
from .expression import Expression, UntraceableError, in_order
from .functions import TABLE
from .instructions import Instructions, module_text
from .interval_functions import ENCLOSED
from .intervals import Enclosing, Interval
from .trace import STATEFUL, Trace

ARITHMETIC = frozenset({"add", "sub", "mul", "div", "neg"})
LARGEST_POWER = 1024


@dataclass(frozen=True)
class Rows:
    """Rows of the array ``state`` of boxes in d dimensions.

    Half-widths, then midpoints and radii of images, then of the derivatives, row by row.  Midpoints of images hold the
    centres before.  Flows keep errors in a moving frame as well: its axes, and the sizes of the errors of derivatives
    and images along them.
    """

    d: int

    @property
    def half_widths(self) -> range:
        """Half-widths of the boxes."""
        return range(self.d)

    @property
    def images(self) -> range:
        """Centres, then midpoints of their images."""
        return range(self.d, 2 * self.d)

    @property
    def image_radii(self) -> range:
        """Radii of images."""
        return range(2 * self.d, 3 * self.d)

    @property
    def derivatives(self) -> range:
        """Midpoints of derivatives."""
        return range(3 * self.d, (3 + self.d) * self.d)

    @property
    def derivative_radii(self) -> range:
        """Radii of derivatives."""
        return range((3 + self.d) * self.d, (3 + 2 * self.d) * self.d)

    @property
    def frame(self) -> range:
        """Components of the axes of the frame, row by row."""
        return range((3 + 2 * self.d) * self.d, (3 + 3 * self.d) * self.d)

    @property
    def derivative_errors(self) -> range:
        """Errors of the derivatives along the axes, row by row."""
        return range((3 + 3 * self.d) * self.d, (3 + 4 * self.d) * self.d)

    @property
    def image_errors(self) -> range:
        """Errors of the images along the axes."""
        return range((3 + 4 * self.d) * self.d, (4 + 4 * self.d) * self.d)

    @property
    def remainder(self) -> int:
        """Sum over the steps of the largest remainder of a series, relative to the size of the set."""
        return (4 + 4 * self.d) * self.d

    @property
    def count(self) -> int:
        """Number of rows."""
        return self.remainder + 1


def enclosable(trace: Trace) -> Trace:
    """Return a trace in terms of the functions that are enclosed, in exact identities.

    Raises
    ------
    UntraceableError
        For functions that are not enclosed, among them all that are not analytic.
    """
    graph = trace.graph

    def unfolded(name: str, value: float) -> Expression:  # a number that no float is
        return graph.node(name, (graph.constant(value),))

    def apply(operation: str, *arguments: Expression) -> Expression:
        if operation in ARITHMETIC or operation in ENCLOSED:
            return graph.apply(operation, *arguments)
        a = arguments[0]
        match operation:
            case "exp2":
                return graph.apply("exp", unfolded("log", 2.0) * a)
            case "log2" | "log10":
                return graph.apply("log", a) / unfolded("log", 2.0 if operation == "log2" else 10.0)
            case "acos":
                return 2.0 * unfolded("atan", 1.0) - apply("asin", a)
            case "acosh":
                return graph.apply("log", a + graph.apply("sqrt", (a - 1.0) * (a + 1.0)))
            case "pow":
                return _power(graph, a, arguments[1])
            case "asin" | "asinh" | "atanh" | "expm1" | "log1p" | "hypot":
                parts = TABLE[operation].in_parts
                assert parts is not None, "the table has them"
                found: Expression = parts(*arguments)
                return found
        what = "a branch" if operation in {"select", "side"} else operation
        raise UntraceableError(f"{what} is not enclosed, for it is not analytic or its error is not bounded here")

    return replace(trace, outputs=graph.substituted(trace.outputs, {}, apply))


def _power(graph: Any, base: Expression, exponent: Expression) -> Expression:
    value = exponent.value if exponent.operation == "constant" else 0.5
    if value == int(value) and abs(value) <= LARGEST_POWER:
        whole: Expression = graph._whole_power(base, abs(int(value)))
        return whole if value >= 0 else 1.0 / whole
    power: Expression = graph.apply("exp", exponent * graph.apply("log", base))
    return power


@dataclass(frozen=True, eq=False)
class CompiledEnclosure:
    """A function ``enclose`` in memory, for boxes in d dimensions; of a flow with series of some order, else 0."""

    rows: Rows
    order: int
    code: MachineCode

    def __call__(
        self, state: Floats, count: int, p: Floats, times: Floats | None = None, step: tuple[float, float] = (0.0, 0.0)
    ) -> None:
        """Enclose the images of boxes in place; see the module."""
        address, arguments = ctypes.c_void_p, [state.ctypes.data, count, state.shape[1], p.ctypes.data]
        kinds: list[Any] = [address, ctypes.c_int64, ctypes.c_int64, address]
        if times is not None:
            arguments += [len(times), times.ctypes.data, *step]
            kinds += [ctypes.c_int64, address, ctypes.c_double, ctypes.c_double]
        ctypes.CFUNCTYPE(None, *kinds)(self.code.address("enclose"))(*arguments)


def discrete_enclosure(trace: Trace, parameters: int) -> CompiledEnclosure:
    """Compile the enclosure of a traced discrete map."""
    rows = Rows(len(trace.states))
    return CompiledEnclosure(rows, 0, machine_code(discrete_text(enclosable(trace), parameters, vector_width())))


def discrete_text(trace: Trace, parameters: int, width: int) -> str:
    """Return the text of a module with the function ``enclose`` of a discrete map."""
    graph, rows = trace.graph, Rows(len(trace.states))
    one = graph.constant(1.0)
    columns = [along(graph, trace.outputs, {x: one}) for x in trace.states]
    entries = [e for row in zip(*columns, strict=True) for e in row]
    lanes = Lanes(width, parameters)
    with lanes.boxes() as box:
        centre = [lanes.number(box, k) for k in rows.images]
        over = [lanes.interval(box, *pair) for pair in zip(rows.images, rows.half_widths, strict=True)]
        for outputs, x, midpoints, radii in (
            (trace.outputs, centre, rows.images, rows.image_radii),
            (entries, over, rows.derivatives, rows.derivative_radii),
        ):
            found = lanes.values(replace(trace, outputs=tuple(outputs)), x)
            for value, m, r in zip(found, midpoints, radii, strict=True):
                lanes.store(value, box, m, r)
        lanes.out.store(lanes.out.as_vector(lanes.out.number(0.0)), lanes.place(box, rows.remainder))
    return lanes.module("ptr noalias %state, i64 %count, i64 %stride, ptr noalias %p")


class Lanes:
    """The body of a function ``enclose``: parameters, and boxes in vectors of lanes."""

    def __init__(self, width: int, parameters: int) -> None:
        self.out = Instructions(width, flags="")
        self.code = Enclosing(self.out)
        self.p = [self.code.loaded("%p", 2 * i) for i in range(parameters)]

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

    def store(self, value: Interval, box: str, midpoint: int, radius: int) -> None:
        """Store intervals in two rows."""
        for number, row in ((value.m, midpoint), (value.r or self.out.number(0.0), radius)):
            self.out.store(self.out.as_vector(number), self.place(box, row))

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
