"""Functions of a discontinuous right-hand side, as LLVM instructions.

They belong to one system, and :mod:`cellmap._compiled.kernels.switching_period` calls them by address:

    free_step(lanes, series, p, end, rate, used)      one step of the lanes in which nothing slides
    general_step(lanes, series, p, end, rate, used)   one step of the others
    begin(lanes, series, p, start)              the mode in which each lane begins
    surfaces(t, x, p, signs, values, rates, gains, jumps, normals)      all that decides about its mode
    impacts(t, x, v, p, signs, landed, turned, stuck, held)     states and deviations after impacts, surface by surface

A step is a Taylor step that also expands the event functions, and sets a flag where a bound from their coefficients
leaves room for an event.  Lanes that have come to the end stay as they are, and vectors without a lane to move are
passed over.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from ..kernels import switching_period
from ..kernels.blocks import LANES
from ..kernels.collisions import CLOSE
from ..kernels.lane import COUNTS, SOLID, STRIKES
from ..machine_code import MachineCode, machine_code, vector_width
from .defects import elsewhere, hides, is_affine
from .emit import assignment, input_name
from .evaluation import ROUNDING
from .expression import Expression, in_order
from .filippov import SwitchingTrace
from .instructions import Instructions, Value, module_text
from .period import CompiledPeriod, parameter_scope
from .statements import Scope, translate
from .taylor import Series
from .trace import CONSTANT, STATEFUL

_OUTPUTS = ("values", "rates", "gains", "jumps", "normals")
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
_OF_ONE_STEP = 0.02  # of the tolerance, the error from which on a step is shortened
_DIGITS = 8
_FIRST = 2.0**-20  # of a step, the first part where a root has no series


def compiled_switching(
    traced: SwitchingTrace, order: int, parameters: int, tolerance: float, one_step: bool = False
) -> CompiledPeriod:
    """Compile ``advance`` of :mod:`cellmap._compiled.codegen.lanes` for Taylor steps.

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
    numbers = (*addresses, *sizes, project, traced.is_coupled, impacts, 0, *traced.kinds, *traced.bound)
    context = np.array(numbers, dtype=np.int64)
    move = switching_period.period(count == 1)
    return CompiledPeriod(move.address, tuple(loaded), context)


def switching_functions(
    traced: SwitchingTrace, order: int, parameters: int, tolerance: float, width: int, one_step: bool = False
) -> dict[str, Instructions]:
    """Return the bodies of the functions described above."""
    steps = {"general_step": Series(traced.motion, order, extra=traced.events, one_clock=False)}
    if not one_step:
        steps["free_step"] = Series(traced.free_motion, order, extra=traced.free_events, one_clock=False)
    functions = {name: Instructions(1 if name in {"surfaces", "impacts"} else width) for name in _ARGUMENTS}
    for name, series in steps.items():
        sliding = None if one_step else name == "general_step"
        _write_step(functions[name], series, parameters, traced.counts, sliding, tolerance)
    _write_begin(functions["begin"], traced, order, parameters)
    _write_surfaces(functions["surfaces"], traced, parameters)
    if traced.impacts:
        _write_impacts(functions["impacts"], traced, parameters)
    return {name: out for name, out in functions.items() if out.lines}


def _write_begin(out: Instructions, traced: SwitchingTrace, order: int, parameters: int) -> None:
    """Write the function that puts each lane on its side of each surface; the flag says where that is open."""
    size, count = len(traced.motion.states), len(traced.surfaces)
    flag = (size + count) * (order + 1) + size + 2
    once = {**parameter_scope(out, parameters), "t": Value("%start")}
    with out.loop_over_lanes(LANES) as lane:
        address = functools.partial(_place, out, lane)
        scope = {**once, **{f"x{j}": out.load(address("%lanes", j), vector=True) for j in range(size)}}
        lines, sides = _evaluated(traced.beginnings)
        for e, (side, kind) in enumerate(zip(sides, traced.kinds, strict=True)):
            lines.append(
                f"side{e} = " + (f"math.floor({side})" if kind == COUNTS else f"1.0 if {side} > 0.0 else -1.0")
            )
            close = f"abs({side}) <= {CLOSE!r}" if kind >= STRIKES else f"{side} == 0.0"
            close = f"{side} <= {CLOSE!r}" if kind == SOLID else close
            lines.append(f"open{e} = " + ("0.0" if kind == COUNTS else f"1.0 if {close} else 0.0"))
        lines += [f"flag = {' + '.join(f'open{e}' for e in range(count))}", "free = 0.0"]
        translate(out, lines, scope)
        out.store(out.as_vector(scope["t"]), address("%lanes", size))
        for e in range(count):
            out.store(out.as_vector(scope[f"side{e}"]), address("%lanes", size + 1 + e))
            out.store(out.as_vector(scope["free"]), address("%lanes", size + 1 + count + e))
        out.store(out.as_vector(scope["flag"]), address("%series", flag))


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
    outputs = (values, traced.rates, flat(traced.gains), flat(traced.jumps), flat(traced.normals))
    lines, names = _evaluated(flat(outputs))
    scope = {**parameter_scope(out, parameters), "t": Value("%t")}
    scope |= {f"x{j}": out.load(out.address("%x", j)) for j in range(len(traced.normals[0]))}
    scope |= {f"g{e}": out.load(out.address("%signs", e)) for e in range(len(traced.surfaces))}
    places = [(array, i) for array, expressions in zip(_OUTPUTS, outputs, strict=True) for i in range(len(expressions))]
    translate(out, [*lines, *(f"{array}_{i} = {name}" for (array, i), name in zip(places, names, strict=True))], scope)
    for array, i in places:
        out.store(scope[f"{array}_{i}"], out.address(f"%{array}", i))


def _write_impacts(out: Instructions, traced: SwitchingTrace, parameters: int) -> None:
    """Write the function of one lane that stores states and deviations after an impact at each surface in arrays."""
    base, d = traced.free_motion, len(traced.normals[0])
    aside = tuple(base.graph.node("state", value=d + j) for j in range(d))
    rest = {"landed": base.states, "turned": aside, "stuck": base.states, "held": aside}
    outputs = {name: [e for i in traced.impacts for e in (getattr(i, name) if i else rest[name])] for name in _STRUCK}
    lines, names = _evaluated([e for name in _STRUCK for e in outputs[name]])
    scope = {**parameter_scope(out, parameters), "t": Value("%t")}
    scope |= {f"x{j}": out.load(out.address("%x", j)) for j in range(d)}
    scope |= {f"x{d + j}": out.load(out.address("%v", j)) for j in range(d)}
    scope |= {f"g{e}": out.load(out.address("%signs", e)) for e in range(len(traced.surfaces))}
    places = [(name, i) for name in _STRUCK for i in range(len(outputs[name]))]
    translate(out, [*lines, *(f"{array}_{i} = {name}" for (array, i), name in zip(places, names, strict=True))], scope)
    for array, i in places:
        out.store(scope[f"{array}_{i}"], out.address(f"%{array}", i))


def _evaluated(expressions: Sequence[Expression]) -> tuple[list[str], list[str]]:
    """Return statements that evaluate expressions of time t, state x0, x1, ..., parameters and signs, and names."""
    nodes = in_order(expressions)
    numbers = {node: i for i, node in enumerate(nodes)}
    inputs: dict[str, Callable[[int], str]] = {
        "state": lambda i: f"x{i}",
        "time": lambda _: "t",
        "parameter": lambda i: f"p{i}",
        "sign": lambda i: f"g{i}",
    }

    def name(node: Expression) -> str:
        return input_name(node, inputs) or f"v{numbers[node]}"

    lines = []
    for node in nodes:
        if node.operation in {"sqrt", "pow"}:
            # On a surface the argument of a root may be negative by rounding.
            inner, base = node.arguments[0], f"b{numbers[node]}"
            lines.append(f"{base} = 0.0 if {name(inner)} <= 0.0 and {name(inner)} > {-ROUNDING!r} else {name(inner)}")
            lines.append(assignment(node, functools.partial(_renamed, name, inner, base), STATEFUL))
        elif node.arguments:
            lines.append(assignment(node, name, STATEFUL))
    return lines, [name(e) for e in expressions]


def _renamed(name: Callable[[Expression], str], one: Expression, its_name: str, node: Expression) -> str:
    """Return the name of a node, where one has another name."""
    return its_name if node is one else name(node)


def _write_step(
    out: Instructions, series: Series, parameters: int, counts: Sequence[bool], sliding: bool | None, tolerance: float
) -> None:
    """Write the function that takes one step with the lanes that slide, with those that do not, or (None) with all."""
    size, count = len(series.trace.states), len(counts)
    length, errors = series.order + 1, size + 1 + 2 * count
    local = (size + count) * length
    once = {**parameter_scope(out, parameters), "end": Value("%end"), "rate": Value("%rate")}
    translate(out, series.at_order(CONSTANT, 0, of_lanes=False), once)
    rows = [*(f"s{j}_0" for j in range(size)), "t0", *(f"g{e}" for e in range(count)), *(f"u{e}" for e in range(count))]
    rows += [*(f"sum{j}" for j in range(size)), *(f"begun{e}" for e in range(count))]
    with out.loop_over_lanes("%used") as lane:
        address = functools.partial(_place, out, lane)
        scope: Scope = {**once}
        scope |= {name: out.load(address("%lanes", row), vector=True) for row, name in enumerate(rows)}
        mine = "t0 < end"
        if sliding is not None:
            mine += f" and {' + '.join(f'u{e}' for e in range(count))} {'>' if sliding else '=='} 0.0"
        translate(out, [f"mine = {mine}"], scope)
        out.write(f"br i1 {out.over_lanes('or', scope['mine'])}, label %moving, label %lane.end")
        out.label("moving")
        translate(out, _lane_step(series, size, counts, tolerance), scope)

        def store(base: str, row: int, name: str) -> None:
            place = address(base, row)
            kept = out.load(place, vector=True)
            out.store(out.select(scope["mine"], out.as_vector(scope[name]), kept), place)

        for j in range(size):
            store("%lanes", j, f"y{j}")
            store("%lanes", errors + j, f"sum{j}")
            store("%series", local + j, f"e{j}")
            for k in range(length):
                store("%series", j * length + k, f"s{j}_{k}")
        store("%lanes", size, "t1")
        for e in range(count):
            for k in range(length):
                store("%series", (size + e) * length + k, f"event{e}_{k}")
        for row, name in enumerate(("h", "t0", "flag", *(f"gap{e}" for e in range(count))), local + size):
            store("%series", row, name)


def _shortened(series: Series, size: int, tolerance: float) -> Iterable[str]:
    """Write by which part a step is shortened whose own error is large, and the coefficients of that part.

    A trial step, at a negative rate, is not.
    """
    order = series.order
    ends = [(f"s{j}_0", series.local_error(j)) for j in range(size)]
    bent = [e for e, event in enumerate(series.extra) if not is_affine(series, event)]
    ends += [(f"event{e}_0", f"abs(event{e}_{order}) + 0.5 * abs(event{e}_{order - 1})") for e in bent]
    yield "allowed = 1e300"
    for first, last in ends:
        yield f"own = {_OF_ONE_STEP * tolerance!r} * (1.0 + abs({first})) / ({last} + 1e-300)"
        yield "allowed = own if own < allowed else allowed"
    # The root that the estimate asks for, to a part in a hundred: its exponent in binary digits, by square roots.
    yield "root0 = simd_math.fmin(allowed, 1.0)"
    yield from (f"root{k} = math.sqrt(root{k - 1})" for k in range(1, _DIGITS + 1))
    digits = round(2**_DIGITS / (order - 1))
    yield f"part = {' * '.join(f'root{k}' for k in range(1, _DIGITS + 1) if digits >> (_DIGITS - k) & 1)}"
    yield "part = 1.0 if rate < 0.0 else part"
    if singular := series.begins_at_a_root():
        yield f"part = {_FIRST!r} if {singular} else part"
    yield "part0 = 1.0"
    yield from (f"part{k} = part{k - 1} * part" for k in range(1, order + 1))
    yield from (f"s{j}_{k} = s{j}_{k} * part{k}" for j in range(size) for k in range(1, order + 1))
    yield from (f"event{e}_{k} = event{e}_{k} * part{k}" for e in range(len(series.extra)) for k in range(1, order + 1))
    yield "h = h * part"


def _lane_step(series: Series, size: int, counts: Sequence[bool], tolerance: float) -> Iterable[str]:
    """Write one step of one lane."""
    order, length, count = series.order, series.order + 1, len(counts)
    # What is left is cut into equal steps, so that none of them is a sliver.
    yield "left = simd_math.fmax(math.ceil((end - t0) * rate - 1e-6), 1.0)"
    yield "h = (end - t0) / left"
    yield from (f"h{k} = h * {1.0 / k!r}" for k in range(1, order + 1))
    yield from series.at_order(CONSTANT, 0, of_lanes=True)
    for k in range(order):
        yield from series.at_order(STATEFUL, k)
        yield from series.next_of_states(k)
    yield from series.at_order(STATEFUL, order, only=series.extra)
    for e, event in enumerate(series.extra):
        yield from (f"event{e}_{k} = {series.name(event, k) or '0.0'}" for k in range(length))
    yield from _shortened(series, size, tolerance)
    hidden = [e for e, event in enumerate(series.extra) if hides(series, event)]
    yield from elsewhere(series)
    for j in range(size):
        yield f"y{j} = s{j}_0 + {series.change(j)}"
        yield f"e{j} = {series.local_error(j)}"
        if hides(series, series.trace.outputs[j]):
            yield f"e{j} = defect{j} if defect{j} > e{j} and defect{j} < 1e300 else e{j}"
    yield "t1 = t0 + h if left > 1.0 or part < 1.0 else end"
    for e in range(count):
        # Smallest value of the first three terms in the step (or largest size of it), less all the others.
        yield f"a{e} = event{e}_0; b{e} = event{e}_1; c{e} = event{e}_2"
        yield f"rest{e} = {' + '.join(f'abs(event{e}_{k})' for k in range(3, length))}"
        if counts[e]:
            yield f"ends{e} = simd_math.fmax(abs(a{e}), abs(a{e} + b{e} + c{e}))"
            turning = f"b{e} * c{e} < 0.0 and abs(b{e}) < 2.0 * abs(c{e})"
            yield f"top{e} = abs(a{e} - 0.25 * b{e} * b{e} / c{e}) if {turning} else 0.0"
            yield f"quiet{e} = 0.5 - simd_math.fmax(ends{e}, top{e}) - rest{e} - gap{e}"
            continue
        yield f"ends{e} = simd_math.fmin(a{e}, a{e} + b{e} + c{e})"
        yield f"bottom{e} = a{e} - 0.25 * b{e} * b{e} / c{e} if -b{e} < 2.0 * c{e} else ends{e}"
        yield f"quiet{e} = (bottom{e} if b{e} < 0.0 else ends{e}) - rest{e} - gap{e}"
    # Where an event may lie that its series does not show, what is not seen of it counts as an error of the states.
    for e in hidden:
        size_of = f"abs(a{e}) + abs(b{e}) + abs(c{e}) + rest{e}"
        yield f"unseen{e} = gap{e} / ({size_of}) if quiet{e} <= 0.0 and gap{e} > 0.0 else 0.0"
        yield from (f"e{j} = e{j} + unseen{e} * (abs(s{j}_1) + abs(s{j}_2))" for j in range(size))
    yield from (f"sum{j} = sum{j} + e{j}" for j in range(size))
    yield "quiet = " + functools.reduce(lambda a, b: f"simd_math.fmin({a}, {b})", (f"quiet{e}" for e in range(count)))
    # A lane whose mode has just begun is looked at in any case, which ends its beginning; so is one at a blow-up.
    begun = " + ".join(f"begun{e}" for e in range(count))
    yield f"flag = 0.0 if quiet > 0.0 and {begun} == 0.0 and t1 > t0 else 1.0"
