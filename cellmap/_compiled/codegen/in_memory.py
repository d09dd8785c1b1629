"""Explicit Runge-Kutta steps of large systems, with states and stages in memory.

A small system is straight-line code, with everything in registers (:mod:`runge_kutta`).  Beyond some twenty states that
code takes seconds to compile and gains nothing: registers do not hold the states.  Here a step is a call of the
right-hand side (:mod:`alike`) for each stage, and loops over the states between them, which wait for memory.  So a
state whose derivative is another state, as an angle of a machine, is moved with it by the derivatives of that one.  The
function is that of :mod:`period`, and so are the steps and the estimate of their errors.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import accumulate, zip_longest

from ..kernels.blocks import LANES
from ..machine_code import vector_width
from .alike import ONCE, SLOPES, TIMES, VALUES, Places, Rows, in_pieces, loop_over_rows, table, written
from .emit import Known, evaluate, inputs
from .expression import in_order
from .instructions import Instructions, Value, module_text, number
from .period import ARGUMENTS, CHECKED, NO_LENGTH, CompiledPeriod, blocks_of_orbits, compiled_advance, lanes_in_use
from .resolution import as_error, excess, layers
from .runge_kutta import Tableau, after_slopes, apart, estimated, scaled
from .trace import CONSTANT, STATEFUL, TIMED, Trace

ALIGNMENT = 64  # bytes of a line of the cache: no vector lies across two

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
    out.write(f"%room = call ptr @malloc(i64 {8 * frame.size + ALIGNMENT})")
    missing = out.whole("and", out.whole("sub", 0, out.result("ptrtoint ptr %room to i64").text), ALIGNMENT - 1)
    out.write(f"%memory = getelementptr i8, ptr %room, i64 {missing}")
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
            weights, sharp = frame.coefficients(h), frame.sharpness_of_times()
            with out.loop("lane", used, width) as lane:
                here = out.address(x, lane)
                frame.write_stages(here, weights)
                frame.write_end(here, out.address(error, lane), weights, h)
                frame.write_sharpness(out.address(error, lane), sharp)
            _leave_if_nothing_is_finite(frame, x, number_of_step, used)
    out.write("call void @free(ptr %room)")
    functions, parts = written(frame.pieces, width, frame.stages)
    tables = "".join([table("moments", "double", frame.moments), *frame.tables])
    return module_text(tables + functions + out.function("advance", ARGUMENTS), out, *parts)


@dataclass(frozen=True, eq=False)
class _Coefficients:
    """Weights of derivatives at each stage and in the step: for components, and for integrals and their errors.

    Integrals are moved by the component times ``leads`` besides.
    """

    plain: Sequence[Sequence[Value | None]]
    integrals: Sequence[Sequence[Value | None]]
    leads: Sequence[Value]
    errors: Sequence[Sequence[Value | float]]

    def used(self, k: int) -> list[bool]:
        """Return of which stages the derivatives enter."""
        return [a is not None or b is not None for a, b in zip_longest(self.plain[k], self.integrals[k])]


def _places(trace: Trace, group: int) -> tuple[Rows, Rows]:
    """Return components that are moved alone, and those that are moved with an integral, as rows of numbers.

    A row is the number of the integral, if there is one, that of the component, and that of its derivatives.  An
    integral is a state whose derivative is another state of the same group.
    """
    number = {state: j for j, state in enumerate(trace.states)}
    slopes = [number.get(e) for e in trace.outputs]
    integral = {j: i for i, j in enumerate(slopes) if j is not None and slopes[j] is None and i // group == j // group}
    both = [(i, j) for j, i in sorted(integral.items())]
    alone = sorted({*range(len(slopes))}.difference(*both))
    return [(j, k) for k, j in enumerate(alone)], [(*row, len(alone) + k) for k, row in enumerate(both)]


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
        self.integrals, self.tables = self.tableau.of_integrals(), list[str]()
        self.places = _places(self.trace, self.group)
        slots = {row[-2]: row[-1] for rows in self.places for row in rows}
        self.pieces = in_pieces(self.trace, slots, {a for a, _ in self.layers})
        for argument, _ in self.layers:
            self.pieces.place_of(argument)
        self.once, self.times = self.pieces.shared[CONSTANT], self.pieces.shared[TIMED]
        self.moments = sorted(set(self.tableau.nodes))
        self.dimension, self.stages = len(self.trace.states), len(self.tableau.nodes)
        self.known: Known = {}
        nodes = in_order(self.trace.outputs)
        self.of_level = {level: [n for n in nodes if self.levels[n] == level] for level in (CONSTANT, TIMED)}
        vectors = [len(self.pieces.place), self.stages * len(slots), len(self.seen) * len(self.layers), 1]
        sizes = [*(n * self.out.width for n in vectors), len(self.once), len(self.moments) * len(self.times)]
        self.begins = dict(zip((VALUES, SLOPES, _SEEN, _SUM, ONCE, TIMES), [0, *accumulate(sizes)], strict=False))
        self.size = sum(sizes)

    def at(self, array: str, place: str | int = 0) -> str:
        """Return the address of a number of one of the arrays."""
        begin = self.begins[array]
        offset = begin + place if isinstance(place, int) else self.out.whole("add", place, begin)
        return self.out.address("%memory", offset)

    def vector(self, array: str, number: int, group: str | int = 0, size: int = 1) -> str:
        """Return the address of a vector of one of the arrays: of a number within a group of some size."""
        width = self.out.width
        return self.at(array, self.out.whole("add", self.out.whole("mul", group, size * width), number * width))

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

    def coefficients(self, h: Value) -> _Coefficients:
        """Write the coefficients of stages, and of the step, times its size."""
        return _Coefficients(
            scaled(self.tableau, h),
            scaled(self.integrals, h * h),
            [h * c for c in self.tableau.nodes] + [h],
            [[h * e if e else 0.0 for e in row] for row in self.integrals.errors],
        )

    def write_stages(self, x: str, weights: _Coefficients) -> None:
        """Write the derivatives at all stages, for the lanes whose states are at an address."""
        out, count = self.out, len(self.layers)
        for k in range(self.stages):
            for row in self.components(f"stage{k}"):
                for j, moved in self.moved(x, k, row, weights, self.slopes(row, weights.used(k))):
                    out.store(moved, self.vector(VALUES, 0, j))
            arrays = (self.at(VALUES), self.vector(SLOPES, k), self.at(ONCE))
            times = self.at(TIMES, self.moment(k))
            out.write(f"call void @slopes({', '.join(f'ptr {array}' for array in (*arrays, times))})")
            for i, (argument, _) in enumerate(self.layers):
                if k in self.seen and self.levels[argument] == STATEFUL:
                    value = out.load(self.vector(VALUES, self.pieces.place[argument]), vector=True)
                    out.store(value, self.vector(_SEEN, self.seen.index(k) * count + i))

    def components(self, name: str, first: int = 0, most: int | None = None) -> Iterator[Places]:
        """Write loops over components from the first on: those that are moved alone, and those with an integral."""
        end = self.dimension if most is None else first + most
        for kind, rows in zip(("alone", "both"), self.places, strict=True):
            of_group = [row for row in rows if first <= row[0] < end]
            if of_group:
                with loop_over_rows(self.out, f"{name}.{kind}", of_group, self.tables) as row:
                    yield row

    def slopes(self, row: Places, used: Sequence[bool]) -> list[Value]:
        """Load the derivatives of a component at those stages that are used."""
        nothing = self.out.number(0.0)
        return [
            self.out.load(self.vector(SLOPES, k, row[-1], self.stages), vector=True) if is_used else nothing
            for k, is_used in enumerate(used)
        ]

    def moved(
        self, x: str, k: int, row: Places, weights: _Coefficients, slopes: list[Value]
    ) -> Iterator[tuple[str | int, Value]]:
        """Write a component at a stage, the last of which is the step, and its integral; yield their numbers too."""
        out, (*integral, j, _) = self.out, row
        state = out.load(out.address(x, out.whole("mul", j, LANES)), vector=True)
        yield j, after_slopes(state, weights.plain[k], slopes)
        for i in integral:
            begin = out.load(out.address(x, out.whole("mul", i, LANES)), vector=True)
            yield i, after_slopes(begin + weights.leads[k] * state if k else begin, weights.integrals[k], slopes)

    def write_end(self, x: str, error: str, weights: _Coefficients, h: Value) -> None:
        """Write the states after a step, and add the estimates of their errors."""
        out, end = self.out, self.stages
        used = weights.used(end)
        seen = [any(column) for column in zip(*self.tableau.errors, *self.integrals.errors, strict=True)]

        def add_errors(row: Places, slopes: list[Value], part: Value | None) -> None:
            *integral, j, _ = row
            found = [(j, estimated(self.tableau.errors, h, slopes))]
            found += [(i, estimated(weights.errors, h, slopes)) for i in integral]
            for place, size in found:
                sums = out.address(error, out.whole("mul", place, LANES))
                term = abs(size) if part is None else part * abs(size)
                out.store(out.load(sums, vector=True) + term, sums)

        for first in range(0, self.dimension, self.group):
            for row in self.components(f"end{first}", first, self.group):
                slopes = self.slopes(row, [a or b for a, b in zip_longest(used, seen)])
                for j, moved in list(self.moved(x, end, row, weights, slopes)):
                    out.store(moved, out.address(x, out.whole("mul", j, LANES)))
                if not first:
                    add_errors(row, slopes, None)
            if first:
                part = self.inverse_length(x, first)
                for row in self.components(f"error{first}", first, self.group):
                    add_errors(row, self.slopes(row, seen), part)

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
