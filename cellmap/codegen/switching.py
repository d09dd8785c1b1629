"""Frame of the integrator of right-hand sides that jump: one period of many starts, in SIMD lanes.

The generated function has the signature of :mod:`cellmap.codegen.lanes`; no steps at all stand for a trial step, in
which events do not count.  Each lane has its own time and its own mode (see :mod:`cellmap.codegen.filippov`), and all
lanes of a block take a Taylor step together.  The step also expands the event functions, and a bound from their
coefficients tells in the same vector code in which lanes an event may lie.  Only these are looked at one by one: the
first root of the event's polynomial is found, the lane is taken back to it, its mode changes, and it goes on from there
with the next step of its block.  So every step lies in one mode, events are located to the accuracy of the series, and
the order of the method holds across them.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable

from ..kernels.options import LANES
from .emit import assignment, input_name
from .expression import Expression, in_order
from .filippov import SwitchingTrace
from .lanes import HEADER, SIGNATURE, indent
from .taylor import Series
from .trace import CONSTANT, STATEFUL

_STEP_SIGNATURE = "void(float64[::1], float64[::1], float64[::1], float64, float64)"
_IMPORTS = """\
import numpy as np
from cellmap.kernels import switching
from cellmap.kernels.borrow import borrowed
from cellmap.kernels.options import INLINE
"""


def switching_module(traced: SwitchingTrace, order: int, parameters: int, one_step: bool = False) -> str:
    """Return the text of a module with the function ``advance`` for a right-hand side that jumps.

    With `one_step` there is no lighter step for lanes in which nothing slides.
    """
    size, count = len(traced.motion.states), len(traced.surfaces)
    length = order + 1
    local = (size + count) * length  # first row of the local errors; step, time and flag follow
    errors = size + 1 + 2 * count  # first row of the sums of local errors
    general = Series(traced.motion, order, extra=traced.events, one_clock=False)
    kinds = {"general": general}
    if not one_step:
        kinds["free"] = Series(traced.free_motion, order, extra=traced.free_events, one_clock=False)
    lines = [
        f"@njit({SIGNATURE!r}, **KERNEL)",
        "def advance(x, steps, start, period, p, error):",
        *indent(1, (f"p{i} = p[{i}]" for i in range(parameters))),
        *indent(1, _memory(size, count, len(traced.normals[0]), length)),
        "    end = start + period",
        "    for b in range(x.shape[0]):",
        f"        lanes[{errors * LANES} :] = 0.0",
        "        rate = max(steps[b], 1) / period",
        f"        for i in range({LANES}):",
        *indent(3, _begin(traced, size, count, local)),
        f"        for i in range({LANES}):",
        f"            if series[{(local + size + 2) * LANES} + i] > 0.0:",
        *indent(4, _load(size, count)),
        "                surfaces(t, state, p, values, rates, gains, jumps, normals)",
        "                switching.begin_on_surface("
        "values, rates, gains, jumps, normals, signs, slides, fresh, state, hits, on_surface, held, after)",
        *indent(4, _store(size, count)),
        "        rounds = 8 * steps[b] + 1024",
        "        moving = 1",
        "        while moving and rounds:",
        "            rounds -= 1",
        *indent(3, _choose_steps(one_step, size, count)),
        # No steps at all: one is tried, for its error alone, and no event is looked for.
        "            if steps[b] == 0:",
        "                break",
        "            moving = 0",
        f"            for i in range({LANES}):",
        f"                if series[{(local + size + 2) * LANES} + i] > 0.0:",
        *indent(5, _load(size, count)),
        "                    landed = switching.land("
        f"series[i:], state, signs, slides, errors, fresh, hits, a, held, t, {order}, end)",
        "                    if landed > switching.NO_EVENT:",
        "                        t = landed",
        "                        surfaces(t, state, p, values, rates, gains, jumps, normals)",
        "                        switching.project(state, values, normals, hits, slides, on_surface, held)",
        "                        switching.switch("
        "rates, gains, jumps, normals, hits, signs, slides, fresh, state, errors, on_surface, held, after)",
        *indent(5, _store(size, count)),
        f"                moving += lanes[{size * LANES} + i] < end",
        *indent(2, _finish(traced, size, count, errors)),
        # The views do not keep their memory alive.
        "    memory[0] = 0.0",
    ]
    steps = [_step(name, s, parameters, count, alone=one_step) for name, s in kinds.items()]
    parts = [_surfaces(traced, parameters), *steps, lines]
    return HEADER + _IMPORTS + "".join("\n" + "\n".join(part) + "\n" for part in parts)


def _choose_steps(one_step: bool, size: int, count: int) -> Iterable[str]:
    if one_step:
        yield "general_step(lanes, series, p, end, rate)"
        return
    # Which step a lane takes is its own affair: an image must not depend on its neighbours.
    yield "sliding = 0"
    yield f"for i in range({LANES}):"
    yield f"    sliding += {_slides(size, count)} > 0.0"
    yield f"if sliding < {LANES}:"
    yield "    free_step(lanes, series, p, end, rate)"
    yield "if sliding > 0:"
    yield "    general_step(lanes, series, p, end, rate)"


def _step(name: str, series: Series, parameters: int, count: int, alone: bool) -> list[str]:
    """Write the function that takes one step with the lanes of a block where nothing slides, or with the others."""
    size = len(series.trace.states)
    condition = "True" if alone else f"{_slides(size, count)} {'==' if name == 'free' else '>'} 0.0"
    return [
        f"@njit({_STEP_SIGNATURE!r}, **KERNEL)",
        f"def {name}_step(lanes, series, p, end, rate):",
        *indent(1, (f"p{i} = p[{i}]" for i in range(parameters))),
        *indent(1, series.at_order(CONSTANT, 0, of_lanes=False)),
        f"    for i in range({LANES}):",
        f"        mine = {condition}",
        *indent(2, _lane(series, size, count)),
    ]


def _slides(size: int, count: int) -> str:
    """Sum that is above zero in lanes that slide."""
    return " + ".join(f"lanes[{(size + 1 + count + e) * LANES} + i]" for e in range(count))


def _lane(series: Series, size: int, count: int) -> Iterable[str]:
    """One step of one lane, kept where the lane is mine."""
    order, length, errors = series.order, series.order + 1, size + 1 + 2 * count
    local = (size + count) * length

    def kept(place: str, value: str) -> str:
        return f"{place} = {value} if mine else {place}"

    def row(number: int, value: str) -> str:
        return kept(f"series[{number * LANES} + i]", value)

    def lane(number: int, value: str) -> str:
        return kept(f"lanes[{number * LANES} + i]", value)

    yield from (f"s{j}_0 = lanes[{j * LANES} + i]" for j in range(size))
    yield f"t0 = lanes[{size * LANES} + i]"
    yield from (f"g{e} = lanes[{(size + 1 + e) * LANES} + i]" for e in range(count))
    yield from (f"u{e} = lanes[{(size + 1 + count + e) * LANES} + i]" for e in range(count))
    # What is left is cut into equal steps, so that none of them is a sliver.
    yield "left = simd_math.fmax(np.ceil((end - t0) * rate - 1e-6), 1.0)"
    yield "h = (end - t0) / left"
    yield from (f"h{k} = h * {1.0 / k!r}" for k in range(1, order + 1))
    yield from series.at_order(CONSTANT, 0, of_lanes=True)
    for k in range(order):
        yield from series.at_order(STATEFUL, k)
        yield from series.next_of_states(k)
    yield from series.at_order(STATEFUL, order, only=series.extra)
    for j in range(size):
        yield lane(j, f"s{j}_0 + {series.change(j)}")
        yield from (row(j * length + k, f"s{j}_{k}") for k in range(length))
        yield f"e{j} = {series.local_error(j)}"
        yield lane(errors + j, f"lanes[{(errors + j) * LANES} + i] + e{j}")
        yield row(local + j, f"e{j}")
    yield row(local + size, "h")
    yield row(local + size + 1, "t0")
    yield "t1 = t0 + h if left > 1.0 else end"
    yield lane(size, "t1")
    for e, event in enumerate(series.extra):
        terms = [series.name(event, k) or "0.0" for k in range(length)]
        yield from (row((size + e) * length + k, term) for k, term in enumerate(terms))
        # Smallest value of the first three terms in the step, less all the others.
        yield f"a{e} = {terms[0]}; b{e} = {terms[1]}; c{e} = {terms[2]}"
        yield f"rest{e} = {' + '.join(f'abs({term})' for term in terms[3:])}"
        yield f"ends{e} = simd_math.fmin(a{e}, a{e} + b{e} + c{e})"
        yield f"bottom{e} = a{e} - 0.25 * b{e} * b{e} / c{e} if -b{e} < 2.0 * c{e} else ends{e}"
        yield f"quiet{e} = (bottom{e} if b{e} < 0.0 else ends{e}) - rest{e}"
    yield "quiet = " + functools.reduce(lambda a, b: f"simd_math.fmin({a}, {b})", (f"quiet{e}" for e in range(count)))
    # A lane whose mode has just begun is looked at in any case, which ends its beginning.
    begun = " + ".join(f"lanes[{(errors + size + e) * LANES} + i]" for e in range(count))
    yield f"flag = 0.0 if quiet > 0.0 and {begun} == 0.0 else 1.0"
    yield row(local + size + 2, "flag")


def _begin(traced: SwitchingTrace, size: int, count: int, local: int) -> Iterable[str]:
    """Load a lane; on which side of each surface it lies decides its mode, and the flag says where that is open."""
    nodes = in_order(traced.surfaces)
    name = _namer(nodes, "x")
    yield from (f"x{j} = lanes[{j * LANES} + i] = x[b, {j}, i]" for j in range(size))
    yield f"t = lanes[{size * LANES} + i] = start"
    yield from (assignment(n, name, STATEFUL) for n in nodes if n.arguments)
    for e, surface in enumerate(traced.surfaces):
        yield f"lanes[{(size + 1 + e) * LANES} + i] = 1.0 if {name(surface)} > 0.0 else -1.0"
        yield f"lanes[{(size + 1 + count + e) * LANES} + i] = 0.0"
        yield f"f{e} = 1.0 if {name(surface)} == 0.0 else 0.0"
    yield f"series[{(local + size + 2) * LANES} + i] = " + " + ".join(f"f{e}" for e in range(count))


def _finish(traced: SwitchingTrace, size: int, count: int, errors: int) -> Iterable[str]:
    """Bring lanes that slide back onto their surfaces, where rounding has led away, and copy all of them back."""
    if not all(surface.operation == "state" for surface in traced.surfaces):
        yield f"for i in range({LANES}):"
        yield from indent(1, _load(size, count))
        yield "    if slides.max() > 0.0:"
        yield "        hits[:] = 0.0"
        yield "        surfaces(t, state, p, values, rates, gains, jumps, normals)"
        yield "        switching.project(state, values, normals, hits, slides, on_surface, held)"
        yield from indent(2, (f"lanes[{j * LANES} + i] = state[{j}]" for j in range(size)))
    yield f"for i in range({LANES}):"
    for j in range(size):
        yield f"    x[b, {j}, i] = lanes[{j * LANES} + i]"
        yield f"    error[b, {j}, i] = lanes[{(errors + j) * LANES} + i] if lanes[{size * LANES} + i] >= end else 1e300"


def _memory(size: int, count: int, dimension: int, length: int) -> Iterable[str]:
    """Lay out one piece of memory: rows of lanes, rows of series, and small arrays for one lane at a time.

    Views of it are borrowed, for counting references would cost more than all else that is done at an event.
    """
    shapes = {
        "lanes": ((2 * size + 3 * count + 2) * LANES,),
        "series": (((size + count) * length + size + 3) * LANES,),
        **dict.fromkeys(("state", "errors"), (size,)),
        **dict.fromkeys(("values", "rates", "signs", "slides", "hits", "on_surface", "held", "after"), (count,)),
        "fresh": (count + 1,),
        "a": (length,),
        "gains": (count, count),
        "jumps": (count, dimension),
        "normals": (count, dimension),
    }
    total = sum(map(math.prod, shapes.values()))
    yield f"memory = np.zeros({total})"
    yield "whole = borrowed(memory)"
    begin = 0
    for name, shape in shapes.items():
        end = begin + math.prod(shape)
        yield f"{name} = whole[{begin}:{end}]" + (f".reshape({shape})" if len(shape) > 1 else "")
        begin = end


def _rows(size: int, count: int) -> Iterable[tuple[str, int]]:
    """Rows of lanes, each with the name of what it holds."""
    names = [f"state[{j}]" for j in range(size)]
    names += ["t", *(f"signs[{e}]" for e in range(count)), *(f"slides[{e}]" for e in range(count))]
    names += [f"errors[{j}]" for j in range(size)]
    names += [f"fresh[{e}]" for e in range(count + 1)]
    return zip(names, range(len(names)), strict=True)


def _load(size: int, count: int) -> Iterable[str]:
    yield from (f"{name} = lanes[{row * LANES} + i]" for name, row in _rows(size, count))


def _store(size: int, count: int) -> Iterable[str]:
    yield from (f"lanes[{row * LANES} + i] = {name}" for name, row in _rows(size, count))


def _surfaces(traced: SwitchingTrace, parameters: int) -> list[str]:
    """Write the scalar function that evaluates what decides about modes."""
    targets: list[tuple[str, Expression]] = []
    for i, (h, b) in enumerate(zip(traced.surfaces, traced.rates, strict=True)):
        targets += [(f"values[{i}]", h), (f"rates[{i}]", b)]
        targets += [(f"gains[{i}, {j}]", e) for j, e in enumerate(traced.gains[i])]
        targets += [(f"jumps[{i}, {j}]", e) for j, e in enumerate(traced.jumps[i])]
        targets += [(f"normals[{i}, {j}]", e) for j, e in enumerate(traced.normals[i])]
    nodes = in_order([e for _, e in targets])
    name = _namer(nodes, "x")
    return [
        "@njit(**INLINE)",
        "def surfaces(t, x, p, values, rates, gains, jumps, normals):",
        *indent(1, (f"p{i} = p[{i}]" for i in range(parameters))),
        *indent(1, (f"x{j} = x[{j}]" for j in range(len(traced.normals[0])))),
        *indent(1, (assignment(n, name, STATEFUL) for n in nodes if n.arguments)),
        *indent(1, (f"{target} = {name(e)}" for target, e in targets)),
    ]


def _namer(nodes: list[Expression], state: str) -> Callable[[Expression], str]:
    numbers = {node: i for i, node in enumerate(nodes)}
    inputs = {"state": lambda i: f"{state}{i}", "time": lambda _: "t", "parameter": lambda i: f"p{i}"}
    return lambda node: input_name(node, inputs) or f"v{numbers[node]}"
