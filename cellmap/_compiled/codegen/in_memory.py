"""Explicit Runge-Kutta steps of large systems, with states and stages in memory.

A small system is straight-line code, with everything in registers (:mod:`runge_kutta`).  Beyond some twenty states that
code takes seconds to compile and gains nothing: registers do not hold the states.  Here a step is a call of the
right-hand side (:mod:`alike`) for each stage, and loops over the states between them.  The function is that of
:mod:`period`, and so are the steps and the estimate of their errors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import Any

from ..kernels.blocks import LANES
from ..machine_code import vector_width
from .alike import ONCE, SLOPES, TIMES, VALUES, in_pieces, table, written
from .emit import Known, evaluate, inputs
from .expression import in_order
from .instructions import Instructions, Value, module_text, number
from .period import ARGUMENTS, CHECKED, NO_LENGTH, CompiledPeriod, blocks_of_orbits, compiled_advance, lanes_in_use
from .resolution import as_error, excess, layers
from .runge_kutta import Tableau, after_slopes, apart, estimated, scaled
from .trace import CONSTANT, STATEFUL, TIMED, Trace

_SEEN, _SUM = "seen", "sum"


def compiled_in_memory(trace: Trace, tableau: Tableau, vectors: int | None = None) -> CompiledPeriod:
    """Compile the period of a traced right-hand side.

    With `vectors` tangent vectors of that length stand behind the states, and their errors are made relative to their
    lengths, as :func:`cellmap._compiled.codegen.period.relative_errors` does.
    """
    return compiled_advance(text_in_memory(trace, tableau, vector_width(), vectors))


def text_in_memory(trace: Trace, tableau: Tableau, width: int, vectors: int | None = None) -> str:
    """Return the text of a module with the function ``advance`` of :mod:`period`, for vectors of some width."""
    frame = _Frame(trace, tableau, Instructions(width), vectors or len(trace.states))
    out = frame.out
    out.declared |= {"declare ptr @malloc(i64)", "declare void @free(ptr)"}
    out.write(f"%memory = call ptr @malloc(i64 {8 * frame.size})")
    frame.write_once()
    with out.loop("block", blocks_of_orbits(out)) as block:
        used = lanes_in_use(out, block)
        steps = out.load_whole(out.address("%steps", block))
        first = out.whole("mul", block, frame.dimension * LANES)
        x, error = out.address("%x", first), out.address("%error", first)
        with out.loop("cleared", frame.dimension * LANES, width) as place:
            out.store(out.as_vector(number(0.0)), out.address(error, place))
        h = out.result(f"fdiv double %period, {out.result(f'sitofp i64 {steps} to double').text}")
        with out.loop("step", steps) as number_of_step:
            elapsed = out.result(f"sitofp i64 {number_of_step} to double") * h
            frame.write_times(out.argument("%start") + elapsed, h)
            coefficients, sharp = scaled(tableau, h), frame.sharpness_of_times()
            with out.loop("lane", used, width) as lane:
                here = out.address(x, lane)
                frame.write_stages(here, coefficients)
                frame.write_end(here, out.address(error, lane), coefficients[-1], h)
                frame.write_sharpness(out.address(error, lane), sharp)
            _leave_if_nothing_is_finite(frame, x, number_of_step, used)
    out.write("call void @free(ptr %memory)")
    functions, parts = written(frame.pieces, width)
    moments = table("moments", "double", frame.moments)
    return module_text(moments + functions + out.function("advance", ARGUMENTS), out, *parts)


@dataclass(eq=False)
class _Frame:
    """The parts of a step, and where its arrays are in one piece of memory.

    ``seen`` are the stages at which arguments of functions with layers are compared, the ``layers``.
    """

    trace: Trace
    tableau: Tableau
    out: Instructions
    group: int
    """States, or components of a tangent vector, whose errors have one scale."""

    def __post_init__(self) -> None:
        self.levels, self.seen = self.trace.levels(), apart(self.tableau.nodes)
        self.layers = layers(self.trace.outputs, self.levels)
        self.pieces = in_pieces(self.trace, {a for a, _ in self.layers})
        for argument, _ in self.layers:
            self.pieces.place_of(argument)
        self.once, self.times = self.pieces.shared[CONSTANT], self.pieces.shared[TIMED]
        self.moments = sorted(set(self.tableau.nodes))
        self.dimension, self.stages = len(self.trace.states), len(self.tableau.nodes)
        self.known: Known = {}
        nodes = in_order(self.trace.outputs)
        self.of_level = {level: [n for n in nodes if self.levels[n] == level] for level in (CONSTANT, TIMED)}
        vectors = [len(self.pieces.place), self.stages * self.dimension, len(self.seen) * len(self.layers), 1]
        sizes = [*(n * self.out.width for n in vectors), len(self.once), len(self.moments) * len(self.times)]
        self.begins = dict(zip((VALUES, SLOPES, _SEEN, _SUM, ONCE, TIMES), [0, *accumulate(sizes)], strict=False))
        self.size = sum(sizes)

    def at(self, array: str, place: str | int = 0) -> str:
        """Return the address of a number of one of the arrays."""
        begin = self.begins[array]
        offset = begin + place if isinstance(place, int) else self.out.whole("add", place, begin)
        return self.out.address("%memory", offset)

    def vector(self, array: str, number: int, inner: str | None = None) -> str:
        """Return the address of a vector of one of the arrays, by its number and, within a loop, that of the loop."""
        width = self.out.width
        if inner is None:
            return self.at(array, number * width)
        return self.at(array, self.out.whole("add", self.out.whole("mul", inner, width), number * width))

    def write_once(self) -> None:
        """Write what depends on parameters alone."""
        out, nodes = self.out, self.of_level[CONSTANT]
        parameters = {n.value: out.load(out.address("%p", n.value)) for n in nodes if n.operation == "parameter"}
        self.known = evaluate(out, nodes, inputs(out, nodes, parameter=parameters), CONSTANT)
        for node, place in self.once.items():
            out.store(self.known[node], self.at(ONCE, place))

    def write_times(self, t: Value, h: Value) -> None:
        """Write what depends on time, at the times of all stages."""
        if not self.times:
            return
        out = self.out
        with out.loop("moment", len(self.moments)) as moment:
            c = out.load(out.address("@moments", moment))
            known = evaluate(out, self.of_level[TIMED], {**self.known, self.trace.time: t + c * h}, TIMED)
            first = out.whole("mul", moment, len(self.times))
            for node, place in self.times.items():
                out.store(known[node], self.at(TIMES, out.whole("add", first, place)))

    def moment(self, stage: int) -> int:
        """Return where the numbers of the time of a stage begin."""
        return self.moments.index(self.tableau.nodes[stage]) * len(self.times)

    def sharpness_of_times(self) -> list[Value]:
        """Write by what factors a step is too long for functions of time alone."""
        found = []
        for argument, scale in self.layers:
            if self.levels[argument] == TIMED:
                places = [self.at(TIMES, self.moment(k) + self.times[argument]) for k in self.seen]
                found.append(excess([self.out.load(place) for place in places], scale))
        return found

    def write_stages(self, x: str, coefficients: Sequence[Sequence[Value | None]]) -> None:
        """Write the derivatives at all stages, for the lanes whose states are at an address."""
        out, count = self.out, len(self.layers)
        for k in range(self.stages):
            with out.loop(f"state{k}", self.dimension) as j:
                state = out.load(out.address(x, out.whole("mul", j, LANES)), vector=True)
                moved = after_slopes(state, coefficients[k], self.slopes(coefficients[k], k, j))
                out.store(moved, self.vector(VALUES, 0, j))
            arrays = (self.at(VALUES), self.vector(SLOPES, k * self.dimension), self.at(ONCE))
            times = self.at(TIMES, self.moment(k))
            out.write(f"call void @slopes({', '.join(f'ptr {array}' for array in (*arrays, times))})")
            for i, (argument, _) in enumerate(self.layers):
                if k in self.seen and self.levels[argument] == STATEFUL:
                    value = out.load(self.vector(VALUES, self.pieces.place[argument]), vector=True)
                    out.store(value, self.vector(_SEEN, self.seen.index(k) * count + i))

    def slopes(self, row: Sequence[Any], before: int, j: str) -> list[Value]:
        """Load the derivatives of a state at the stages before one, of those that a row of coefficients wants."""
        wanted = [k < len(row) and row[k] is not None for k in range(before)]
        nothing = self.out.number(0.0)
        return [
            self.out.load(self.vector(SLOPES, k * self.dimension, j), vector=True) if wanted[k] else nothing
            for k in range(before)
        ]

    def write_end(self, x: str, error: str, weights: Sequence[Value | None], h: Value) -> None:
        """Write the states after a step, and add the estimates of their errors."""
        out = self.out
        with out.loop("state", self.dimension) as j:
            state = out.address(x, out.whole("mul", j, LANES))
            out.store(after_slopes(out.load(state, vector=True), weights, self.slopes(weights, self.stages, j)), state)
        for first in range(0, self.dimension, self.group):
            part = self.inverse_length(x, first) if first else None
            with out.loop(f"error{first}", self.group) as member:
                j = out.whole("add", member, first)
                size = abs(estimated(self.tableau, h, self.slopes([h] * self.stages, self.stages, j)))
                sums = out.address(error, out.whole("mul", j, LANES))
                out.store(out.load(sums, vector=True) + (size if part is None else part * size), sums)

    def inverse_length(self, x: str, first: int) -> Value:
        """Write one over the length of a tangent vector, whose components begin with number `first`."""
        out, sums = self.out, self.at(_SUM)
        out.store(out.as_vector(out.number(0.0)), sums)
        with out.loop(f"length{first}", self.group) as member:
            place = out.address(x, out.whole("mul", out.whole("add", member, first), LANES))
            out.store(out.load(sums, vector=True) + abs(out.load(place, vector=True)), sums)
        return 1.0 / (out.load(sums, vector=True) + NO_LENGTH)

    def write_sharpness(self, error: str, shared: list[Value]) -> None:
        """Add to the error of the first state what says that the step is too long."""
        if not self.layers:
            return
        out, count = self.out, len(self.layers)
        found = list(shared)
        for i, (argument, scale) in enumerate(self.layers):
            if self.levels[argument] == STATEFUL:
                places = [self.vector(_SEEN, k * count + i) for k in range(len(self.seen))]
                found.append(excess([out.load(place, vector=True) for place in places], scale))
        out.store(out.load(error, vector=True) + as_error(found, out.number(0.0)), error)


def _leave_if_nothing_is_finite(frame: _Frame, x: str, step: str, used: str) -> None:
    """Look now and then whether a lane is finite, as in :mod:`period`: 0 times a sum of sizes is zero then."""
    out, sums = frame.out, frame.at(_SUM)
    place = out.whole("and", step, CHECKED - 1)
    out.write(f"%checked = icmp eq i64 {place}, {CHECKED - 1}")
    out.write("br i1 %checked, label %look, label %step.end")
    out.label("look")
    with out.loop("looked", used, out.width) as lane:
        here = out.address(x, lane)
        out.store(out.as_vector(out.number(0.0)), sums)
        with out.loop("component", frame.dimension) as j:
            size = 0.0 * out.load(out.address(here, out.whole("mul", j, LANES)), vector=True)
            out.store(out.load(sums, vector=True) + size, sums)
        finite = out.over_lanes("or", out.load(sums, vector=True).equals(0.0))
        out.write(f"br i1 {finite}, label %step.end, label %looked.end")
        out.label("looked.unreached")
    out.jump("block.end")
    out.label("unreached")
