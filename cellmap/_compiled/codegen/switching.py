"""Functions of a discontinuous right-hand side, as LLVM instructions.

They belong to one system, and :mod:`cellmap._compiled.kernels.switching_period` calls them by address:

    free_step(lanes, series, p, end, rate, used)      one step of the lanes in which nothing slides
    general_step(lanes, series, p, end, rate, used)   one step of the others
    begin(lanes, series, p, start)              the mode in which each lane begins
    surfaces(t, x, p, signs, values, rates, gains, jumps, normals, flow)      all that decides about its mode
    impacts(t, x, v, p, signs, landed, turned, stuck, held)     states and deviations after impacts, surface by surface

A step is a Taylor step that also expands the event functions, and sets a flag where a bound from their coefficients
leaves room for an event.  Lanes that have come to the end stay as they are, and vectors without a lane to move are
passed over.
"""

from __future__ import annotations

import functools
import itertools
import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..kernels import switching_period
from ..kernels.blocks import LANES
from ..kernels.collisions import CLOSE
from ..kernels.lane import COUNTS, ENDS, SOLID, STRIKES
from ..machine_code import MachineCode, machine_code, vector_width
from . import simd_math
from .defects import elsewhere, hides, is_affine
from .emit import Known, applied, inputs
from .evaluation import ROUNDING
from .expression import Expression, in_order
from .filippov import SwitchingTrace
from .instructions import Instructions, Value, module_text, number, total, where
from .period import CompiledPeriod, Values, loaded_parameters
from .taylor import Series, Structure
from .trace import CONSTANT, STATEFUL

_OUTPUTS = ("values", "rates", "gains", "jumps", "normals", "flow")
_STRUCK = ("landed", "turned", "stuck", "held")
_STEP = "ptr noalias %lanes, ptr noalias %series, ptr noalias %p, double %end, double %rate, i64 %used"
_ARGUMENTS = {
    "general_step": _STEP,
    "free_step": _STEP,
    "begin": "ptr noalias %lanes, ptr noalias %series, ptr noalias %p, double %start",
    "surfaces": "double %t, ptr noalias %x, ptr noalias %p, ptr noalias %signs, "
    + ", ".join(f"ptr noalias %{output}" for output in _OUTPUTS),
    "impacts": "double %t, ptr noalias %x, ptr %v, ptr noalias %p, ptr noalias %signs, "
    + ", ".join(f"ptr noalias %{output}" for output in _STRUCK),
}
_LARGE = 12_000  # instructions, from which on a function is compiled quickly
_OF_ONE_STEP = 0.02  # error of a step, as a fraction of the tolerance, above which the step is shortened
_DIGITS = 8
_FIRST = 2.0**-20  # first part of a step where a root has no series


def compiled_switching(
    traced: SwitchingTrace, order: int, parameters: int, tolerance: float, one_step: bool = False
) -> CompiledPeriod:
    """Compile ``advance`` of :mod:`cellmap._compiled.codegen.period` for Taylor steps.

    With `one_step` there is no lighter step for lanes in which nothing slides, as where there are no others.
    """
    one_step = one_step or not traced.can_slide
    functions = switching_functions(traced, order, parameters, tolerance, vector_width(), one_step)
    loaded: list[MachineCode] = []
    places: dict[str, int] = {}
    for quick in (False, True):
        chosen = [name for name, out in functions.items() if (len(out.lines) > _LARGE) is quick]
        if chosen:
            text = module_text(
                "\n".join(functions[n].function(n, _ARGUMENTS[n]) for n in chosen), *(functions[n] for n in chosen)
            )
            loaded.append(machine_code(text, quick))
            places |= {name: loaded[-1].address(name) for name in chosen}
    addresses = [places.get(name, 0) for name in ("free_step", "general_step", "begin", "surfaces")]
    impacts = places.get("impacts", 0)
    dimension, count = len(traced.normals[0]), len(traced.surfaces)
    aligned = all(surface.operation == "state" for surface in traced.surfaces)
    project = traced.can_slide and not aligned
    sizes = (len(traced.motion.states), dimension, count, order)
    numbers = (*addresses, *sizes, project, traced.is_coupled, impacts, 0, traced.moving, *traced.kinds, *traced.bound)
    context = np.array(numbers, dtype=np.int64)
    move = switching_period.period(count == 1)
    return CompiledPeriod(move.address, tuple(loaded), context)


def switching_functions(
    traced: SwitchingTrace, order: int, parameters: int, tolerance: float, width: int, one_step: bool = False
) -> dict[str, Instructions]:
    """Return the bodies of the functions described above."""
    steps = {"general_step": Structure(traced.motion, traced.events, one_clock=False)}
    if not one_step:
        steps["free_step"] = Structure(traced.free_motion, traced.free_events, one_clock=False)
    functions = {name: Instructions(1 if name in {"surfaces", "impacts"} else width) for name in _ARGUMENTS}
    for name, structure in steps.items():
        out = functions[name]
        series = Series(structure, order, out, loaded_parameters(out, parameters))
        sliding = None if one_step else name == "general_step"
        _write_step(out, series, traced.counts, sliding, tolerance)
    _write_begin(functions["begin"], traced, order, parameters)
    _write_surfaces(functions["surfaces"], traced, parameters)
    if traced.impacts:
        _write_impacts(functions["impacts"], traced, parameters)
    return {name: out for name, out in functions.items() if out.lines}


def _write_begin(out: Instructions, traced: SwitchingTrace, order: int, parameters: int) -> None:
    """Write the function that puts each lane on its side of each surface; the flag says where that is open."""
    size, count = len(traced.motion.states), len(traced.surfaces)
    flag = (size + count) * (order + 1) + size + 2
    p, start = loaded_parameters(out, parameters), out.argument("%start")
    with out.loop_over_lanes(LANES) as lane:
        address = functools.partial(_place, out, lane)
        x = [out.load(address("%lanes", j), vector=True) for j in range(size)]
        values = _evaluated(out, traced.beginnings, parameter=p, time={None: start}, state=x)
        sides, unsure = [], []
        for value, kind in zip(values, traced.kinds, strict=True):
            sides.append(simd_math.floor(value) if kind == COUNTS else where(value > 0.0, 1.0, -1.0))
            if kind == COUNTS:
                unsure.append(out.number(0.0))
            elif kind in {ENDS, SOLID}:
                unsure.append(where(value <= CLOSE, 1.0, 0.0))
            else:
                unsure.append(where(abs(value) <= CLOSE if kind >= STRIKES else value.equals(0.0), 1.0, 0.0))
        open_somewhere = total(unsure)
        out.store(out.as_vector(start), address("%lanes", size))
        for e in range(count):
            out.store(out.as_vector(sides[e]), address("%lanes", size + 1 + e))
            out.store(out.as_vector(number(0.0)), address("%lanes", size + 1 + count + e))
        out.store(out.as_vector(open_somewhere), address("%series", flag))


def _place(out: Instructions, lane: str, base: str, row: int) -> str:
    """Return the address of lanes in a row of an array."""
    return out.address(base, out.whole("add", lane, row * LANES))


def _write_surfaces(out: Instructions, traced: SwitchingTrace, parameters: int) -> None:
    """Write the function of one lane that stores all that decides about its mode in arrays.

    The value of a switch that counts is its distance from the middle of the interval that it is in.
    """

    def flat(rows: Sequence[Sequence[Expression]]) -> list[Expression]:
        return [e for row in rows for e in row]

    values = [
        e if counts else h for h, e, counts in zip(traced.surfaces, traced.free_events, traced.counts, strict=True)
    ]
    flow = traced.free_motion.outputs if len(values) > 1 else ()  # of one switch, its jump is all that changes
    outputs = (values, traced.rates, flat(traced.gains), flat(traced.jumps), flat(traced.normals), flow)
    _write_of_one_lane(out, traced, parameters, dict(zip(_OUTPUTS, outputs, strict=True)), ["%x"])


def _write_impacts(out: Instructions, traced: SwitchingTrace, parameters: int) -> None:
    """Write the function of one lane that stores states and deviations after an impact at each surface in arrays."""
    base, d = traced.free_motion, len(traced.normals[0])
    aside = tuple(base.graph.node("state", value=d + j) for j in range(d))
    rest = {"landed": base.states, "turned": aside, "stuck": base.states, "held": aside}
    outputs = {name: [e for i in traced.impacts for e in (getattr(i, name) if i else rest[name])] for name in _STRUCK}
    _write_of_one_lane(out, traced, parameters, outputs, ["%x", "%v"])


def _write_of_one_lane(
    out: Instructions,
    traced: SwitchingTrace,
    parameters: int,
    outputs: Mapping[str, Sequence[Expression]],
    states: Sequence[str],
) -> None:
    """Write a function that stores expressions of one lane in arrays; those of its states are at some addresses."""
    p = loaded_parameters(out, parameters)
    x = [out.load(out.address(base, j)) for base in states for j in range(len(traced.normals[0]))]
    signs = [out.load(out.address("%signs", e)) for e in range(len(traced.surfaces))]
    expressions = [e for listed in outputs.values() for e in listed]
    found = _evaluated(out, expressions, parameter=p, time={None: out.argument("%t")}, state=x, sign=signs)
    places = [(array, i) for array, listed in outputs.items() for i in range(len(listed))]
    for (array, i), value in zip(places, found, strict=True):
        out.store(value, out.address(f"%{array}", i))


def _evaluated(out: Instructions, expressions: Sequence[Expression], **given: object) -> list[Value]:
    """Write expressions of inputs that are given by their kinds; return their values."""
    nodes = in_order(expressions)
    known: Known = inputs(out, nodes, **given)
    for node in nodes:
        if node.arguments:
            arguments = [known[a] for a in node.arguments]
            if node.operation in {"sqrt", "pow"}:
                # On a surface the argument of a root may be negative by rounding.
                inner = arguments[0]
                arguments[0] = where((inner <= 0.0) & (inner > -ROUNDING), 0.0, inner)
            known[node] = applied(out, node.operation, arguments, STATEFUL)
    return [known[e] for e in expressions]


def _write_step(
    out: Instructions, series: Series, counts: Sequence[bool], sliding: bool | None, tolerance: float
) -> None:
    """Write the function that takes one step with the lanes that slide, with those that do not, or (None) with all."""
    size, count = len(series.trace.states), len(counts)
    length, errors = series.order + 1, size + 1 + 2 * count
    local = (size + count) * length
    end, rate = out.argument("%end"), out.argument("%rate")
    series.write(CONSTANT, 0, of_lanes=False)
    with out.loop_over_lanes("%used") as lane:
        address = functools.partial(_place, out, lane)
        rows = iter([out.load(address("%lanes", row), vector=True) for row in range(errors + size + count)])
        states, (begin,), signs, slides, sums, begun = (
            [next(rows) for _ in range(number_of_rows)] for number_of_rows in (size, 1, count, count, size, count)
        )
        mine = begin < end
        if sliding is not None:
            held = total(slides)
            mine = mine & (held > 0.0 if sliding else held.equals(0.0))
        out.write(f"br i1 {out.over_lanes('or', mine)}, label %moving, label %lane.end")
        out.label("moving")
        series.states, series.modes = [[x] for x in states], {"sign": signs, "slide": slides}
        step = _lane_step(series, counts, tolerance, _Lane(begin, end, rate, sums, begun))

        def store(base: str, row: int, value: Value) -> None:
            place = address(base, row)
            kept = out.load(place, vector=True)
            out.store(out.select(mine, out.as_vector(value), kept), place)

        for j in range(size):
            store("%lanes", j, step.after[j])
            store("%lanes", errors + j, step.sums[j])
            store("%series", local + j, step.errors[j])
            for k in range(length):
                store("%series", j * length + k, series.states[j][k])
        store("%lanes", size, step.time)
        for e in range(count):
            for k in range(length):
                store("%series", (size + e) * length + k, step.events[e][k])
        for row, value in enumerate((series.clock[1], begin, step.flag, *step.gaps), local + size):
            store("%series", row, value)


@dataclass
class _Lane:
    """Input of a step of a lane, besides its state and mode."""

    begin: Value
    end: Value
    rate: Value
    sums: Values
    begun: Values


@dataclass
class _Stepped:
    """Results of a step of a lane."""

    after: Values
    errors: Values
    sums: Values
    time: Value
    events: Sequence[Values]
    gaps: Values
    flag: Value


def _part(series: Series, events: Sequence[Values], rate: Value, tolerance: float) -> Value:
    """Write the factor by which a step with a large error is shortened.

    A trial step, at a negative rate, is not.
    """
    order, allowed = series.order, number(1e300)
    bent = [e for e, event in enumerate(series.extra) if not is_affine(series.structure, event)]
    for coefficients in (*series.states, *(events[e] for e in bent)):
        first = _OF_ONE_STEP * tolerance * (1.0 + abs(coefficients[0]))
        own = first / (abs(coefficients[order]) + 0.5 * abs(coefficients[order - 1]) + 1e-300)
        allowed = where(own < allowed, own, allowed)
    # The root that the estimate asks for, to a part in a hundred: its exponent in binary digits, by square roots.
    roots = [simd_math.fmin(allowed, number(1.0))]
    for _ in range(_DIGITS):
        roots.append(simd_math.sqrt(roots[-1]))
    digits = round(2**_DIGITS / (order - 1))
    factors = [roots[k] for k in range(1, _DIGITS + 1) if digits >> (_DIGITS - k) & 1]
    part = functools.reduce(operator.mul, factors)
    part = where(rate < 0.0, 1.0, part)
    singular = series.leaves_a_root()
    return part if singular is None else where(singular, _FIRST, part)


def _lane_step(series: Series, counts: Sequence[bool], tolerance: float, lane: _Lane) -> _Stepped:
    """Write one step of one lane."""
    out, order = series.out, series.order
    begin, end, structure = lane.begin, lane.end, series.structure
    # What is left is cut into equal steps, so that none of them is a sliver.
    left = simd_math.fmax(out.intrinsic("ceil", (end - begin) * lane.rate - 1e-6), number(1.0))
    h = (end - begin) / left
    series.start_step(begin, h, [h * (1.0 / k) for k in range(1, order + 1)])
    series.write(CONSTANT, 0, of_lanes=True)
    for k in range(order):
        series.write(STATEFUL, k)
        series.advance_states(k)
    series.write(STATEFUL, order, only=series.extra)
    events = [[series.at(event, k) or out.number(0.0) for k in range(order + 1)] for event in series.extra]
    part = _part(series, events, lane.rate, tolerance)
    powers = list(itertools.accumulate([part] * order, operator.mul, initial=number(1.0)))
    for coefficients in (*series.states, *events):
        coefficients[1:] = [c * power for c, power in zip(coefficients[1:], powers[1:], strict=True)]
    h = h * part
    series.clock = (begin, h)
    defects, gaps = elsewhere(series, events)
    after, errors = [], []
    for j, state in enumerate(series.states):
        after.append(state[0] + series.change(j))
        error = series.local_error(j)
        if j in defects:
            error = where((defects[j] > error) & (defects[j] < 1e300), defects[j], error)
        errors.append(error)
    time = where((left > 1.0) | (part < 1.0), begin + h, end)
    quiet, sizes = [], []
    for e, counted in enumerate(counts):
        # Smallest value of the first three terms in the step (or largest size of it), less all the others.
        a, b, c = events[e][:3]
        rest = total(abs(term) for term in events[e][3:])
        if counted:
            ends = simd_math.fmax(abs(a), abs(a + b + c))
            top = where((b * c < 0.0) & (abs(b) < 2.0 * abs(c)), abs(a - 0.25 * b * b / c), 0.0)
            quiet.append(0.5 - simd_math.fmax(ends, top) - rest - gaps[e])
        else:
            ends = simd_math.fmin(a, a + b + c)
            bottom = where(-b < 2.0 * c, a - 0.25 * b * b / c, ends)
            quiet.append(where(b < 0.0, bottom, ends) - rest - gaps[e])
        sizes.append((a, b, c, rest))
    # Where an event may lie that its series does not show, what is not seen of it counts as an error of the states.
    for e, (a, b, c, rest) in enumerate(sizes):
        if hides(structure, series.extra[e]):
            whole = abs(a) + abs(b) + abs(c) + rest
            unseen = where((quiet[e] <= 0.0) & (gaps[e] > 0.0), gaps[e] / whole, 0.0)
            for j, state in enumerate(series.states):
                errors[j] = errors[j] + unseen * (abs(state[1]) + abs(state[2]))
    sums = [s + error for s, error in zip(lane.sums, errors, strict=True)]
    least = functools.reduce(simd_math.fmin, quiet)
    # A lane whose mode has just begun is looked at in any case, which ends its beginning; so is one at a blow-up.
    fine = (least > 0.0) & total(lane.begun).equals(0.0) & (time > begin)
    return _Stepped(after, errors, sums, time, events, gaps, where(fine, 0.0, 1.0))
