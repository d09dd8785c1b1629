"""Frame of the integrator of right-hand sides that jump: one period of many starts, in SIMD lanes.

The generated function has the signature of :mod:`cellmap.codegen.lanes`.  Each lane has its own time and its own mode
(see :mod:`cellmap.codegen.filippov`), and all lanes of a block take a Taylor step together.  The step also expands the
event functions, and a bound from their coefficients tells in the same vector code in which lanes an event may lie.
Only these are looked at one by one: the first root of the event's polynomial is found, the lane is taken back to it,
its mode changes, and it goes on from there with the next step of its block.  So every step lies in one mode, events are
located to the accuracy of the series, and the order of the method holds across them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from ..kernels.options import LANES
from .emit import assignment, input_name
from .expression import Expression, in_order
from .filippov import SwitchingTrace
from .lanes import HEADER, SIGNATURE, indent
from .taylor import Series
from .trace import CONSTANT, STATEFUL

_IMPORTS = """\
import numpy as np
from cellmap.kernels import switching
"""


def switching_module(traced: SwitchingTrace, order: int, parameters: int) -> str:
    """Return the text of a module with the function ``advance`` for a right-hand side that jumps."""
    size, count = len(traced.motion.states), len(traced.surfaces)
    length = order + 1
    local = (size + count) * length  # first row of the local errors; step, time and flag follow
    rows = size + 1 + 2 * count
    series = Series(traced.motion, order, extra=traced.events, one_clock=False)
    lines = [
        f"@njit({SIGNATURE!r}, **KERNEL)",
        "def advance(x, steps, start, period, p, error):",
        *indent(1, (f"p{i} = p[{i}]" for i in range(parameters))),
        *indent(1, series.at_order(CONSTANT, 0, of_lanes=False)),
        f"    lanes = np.zeros({rows * LANES})",
        f"    series = np.empty({(local + size + 3) * LANES})",
        f"    fresh = np.zeros(({count}, {LANES}), np.int64)",
        f"    stalls = np.zeros({LANES}, np.int64)",
        *indent(1, _scratch(traced)),
        "    end = start + period",
        "    for b in range(x.shape[0]):",
        "        errors = error[b]",
        "        errors[:] = 0.0",
        "        stalls[:] = 0",
        "        rate = steps[b] / period",
        f"        for i in range({LANES}):",
        *indent(3, (f"lanes[{j * LANES} + i] = state[{j}] = x[b, {j}, i]" for j in range(size))),
        f"            lanes[{size * LANES} + i] = start",
        "            surfaces(start, state, p, values, rates, gains, jumps, normals)",
        "            switching.begin(values, rates, gains, signs, slides, fresh[:, i])",
        *indent(3, _store_modes(size, count)),
        "        rounds = 8 * steps[b] + 1024",
        "        moving = 1",
        "        while moving and rounds:",
        "            rounds -= 1",
        f"            for i in range({LANES}):",
        *indent(4, _lane(series, size, count, order, local)),
        "            moving = 0",
        f"            for i in range({LANES}):",
        f"                if series[{(local + size + 2) * LANES} + i] > 0.0:",
        "                    if switching.land("
        f"lanes, series, errors, fresh, stalls, hits, i, {size}, {count}, {order}, end):",
        *indent(6, _load(size, count)),
        "                        for _ in range(2):",
        "                            surfaces(t, state, p, values, rates, gains, jumps, normals)",
        "                            switching.project(state, values, normals, hits | (slides > 0.0))",
        "                        surfaces(t, state, p, values, rates, gains, jumps, normals)",
        "                        local[:] = errors[:, i]",
        "                        switching.switch("
        "rates, gains, jumps, normals, hits, signs, slides, fresh[:, i], state, local)",
        "                        errors[:, i] = local",
        *indent(6, (f"lanes[{j * LANES} + i] = state[{j}]" for j in range(size))),
        *indent(6, _store_modes(size, count)),
        f"                moving += lanes[{size * LANES} + i] < end",
        f"        for i in range({LANES}):",
        *indent(3, _load(size, count)),
        "            if t < end:",
        "                errors[:, i] = 1e300",
        "            if slides.any():",
        "                surfaces(t, state, p, values, rates, gains, jumps, normals)",
        "                switching.project(state, values, normals, slides > 0.0)",
        "            x[b, :, i] = state",
    ]
    return HEADER + _IMPORTS + "\n" + "\n".join([*_surfaces(traced, parameters), "", "", *lines]) + "\n"


def _lane(series: Series, size: int, count: int, order: int, local: int) -> Iterable[str]:
    """One step of one lane."""
    length = order + 1

    def row(number: int) -> str:
        return f"series[{number * LANES} + i]"

    yield from (f"s{j}_0 = lanes[{j * LANES} + i]" for j in range(size))
    yield f"t0 = lanes[{size * LANES} + i]"
    yield from (f"g{e} = lanes[{(size + 1 + e) * LANES} + i]" for e in range(count))
    yield from (f"u{e} = lanes[{(size + 1 + count + e) * LANES} + i]" for e in range(count))
    # What is left is cut into equal steps, so that none of them is a sliver.
    yield "left = math.ceil((end - t0) * rate - 1e-6)"
    yield "h = (end - t0) / max(left, 1.0)"
    yield from (f"h{k} = h * {1.0 / k!r}" for k in range(1, order + 1))
    yield from series.at_order(CONSTANT, 0, of_lanes=True)
    for k in range(order):
        yield from series.at_order(STATEFUL, k)
        for j, component in enumerate(series.trace.outputs):
            term = series.name(component, k)
            yield f"s{j}_{k + 1} = h{k + 1} * {term}" if term else f"s{j}_{k + 1} = 0.0"
    yield from series.at_order(STATEFUL, order, only=series.extra)
    for j in range(size):
        yield f"lanes[{j * LANES} + i] = s{j}_0 + ({' + '.join(f's{j}_{k}' for k in range(order, 0, -1))})"
        yield from (f"{row(j * length + k)} = s{j}_{k}" for k in range(length))
        yield f"e{j} = abs(s{j}_{order}) + 0.5 * abs(s{j}_{order - 1})"
        yield f"errors[{j}, i] += e{j}"
        yield f"{row(local + j)} = e{j}"
    yield f"{row(local + size)} = h"
    yield f"{row(local + size + 1)} = t0"
    yield f"lanes[{size * LANES} + i] = t0 + h if left > 1.0 else end"
    yield "quiet = math.inf"
    for e, event in enumerate(series.extra):
        terms = [series.name(event, k) or "0.0" for k in range(length)]
        yield from (f"{row((size + e) * length + k)} = {term}" for k, term in enumerate(terms))
        # Smallest value of the first three terms in the step, less all the others.
        yield f"q0 = {terms[0]}; q1 = {terms[1]}; q2 = {terms[2]}"
        yield f"rest = {' + '.join(f'abs({term})' for term in terms[3:])}"
        yield "lowest = min(q0, q0 + q1 + q2)"
        yield "lowest = q0 - 0.25 * q1 * q1 / q2 if q1 < 0.0 and 2.0 * q2 > -q1 else lowest"
        yield "quiet = min(quiet, lowest - rest)"
    yield f"{row(local + size + 2)} = 0.0 if quiet > 0.0 else 1.0"


def _scratch(traced: SwitchingTrace) -> Iterable[str]:
    """Small arrays for one lane at a time."""
    size, count, dimension = len(traced.motion.states), len(traced.surfaces), len(traced.normals[0])
    yield f"state = np.empty({size}); local = np.empty({size})"
    yield f"values = np.empty({count}); rates = np.empty({count}); gains = np.empty(({count}, {count}))"
    yield f"jumps = np.empty(({count}, {dimension})); normals = np.empty(({count}, {dimension}))"
    yield f"signs = np.empty({count}); slides = np.empty({count}); hits = np.zeros({count}, np.bool_)"


def _load(size: int, count: int) -> Iterable[str]:
    yield from (f"state[{j}] = lanes[{j * LANES} + i]" for j in range(size))
    yield f"t = lanes[{size * LANES} + i]"
    yield from (f"signs[{e}] = lanes[{(size + 1 + e) * LANES} + i]" for e in range(count))
    yield from (f"slides[{e}] = lanes[{(size + 1 + count + e) * LANES} + i]" for e in range(count))


def _store_modes(size: int, count: int) -> Iterable[str]:
    yield from (f"lanes[{(size + 1 + e) * LANES} + i] = signs[{e}]" for e in range(count))
    yield from (f"lanes[{(size + 1 + count + e) * LANES} + i] = slides[{e}]" for e in range(count))


def _surfaces(traced: SwitchingTrace, parameters: int) -> list[str]:
    """Write the scalar function that evaluates what decides about modes."""
    targets: list[tuple[str, Expression]] = []
    for i, (h, b) in enumerate(zip(traced.surfaces, traced.rates, strict=True)):
        targets += [(f"values[{i}]", h), (f"rates[{i}]", b)]
        targets += [(f"gains[{i}, {j}]", e) for j, e in enumerate(traced.gains[i])]
        targets += [(f"jumps[{i}, {j}]", e) for j, e in enumerate(traced.jumps[i])]
        targets += [(f"normals[{i}, {j}]", e) for j, e in enumerate(traced.normals[i])]
    nodes = in_order([e for _, e in targets])
    name = _scalar_namer(nodes)
    return [
        "@njit(**KERNEL)",
        "def surfaces(t, x, p, values, rates, gains, jumps, normals):",
        *indent(1, (f"p{i} = p[{i}]" for i in range(parameters))),
        *indent(1, (assignment(n, name, CONSTANT) for n in nodes if n.arguments)),
        *indent(1, (f"{target} = {name(e)}" for target, e in targets)),
    ]


def _scalar_namer(nodes: list[Expression]) -> Callable[[Expression], str]:
    numbers = {node: i for i, node in enumerate(nodes)}
    inputs = {"state": lambda i: f"x[{i}]", "time": lambda _: "t", "parameter": lambda i: f"p{i}"}
    return lambda node: input_name(node, inputs) or f"v{numbers[node]}"
