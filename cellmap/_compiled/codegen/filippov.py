"""Right-hand sides that jump, in the sense of Filippov (1988), as expressions.

With the signs s_i of the switching functions h_i the right-hand side is f(s) = f_0 + sum of s_i g_i.  Each switch of an
orbit is either free, s_i = +1 or -1, or it slides: then s_i = l_i is Utkin's equivalent control, the value that keeps
h_i at zero, from

    dh_i/dt = b_i + sum of a_ij s_j = 0,    b_i = (d/dt + f_0 . grad) h_i,    a_ij = g_j . grad h_i.

Modes are inputs of the expressions here and differ from lane to lane: the node "sign" is +-1 where the switch is free
and 0 where it slides, "slide" is 1 where it slides and 0 where it is free.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from .derivative import along
from .expression import Expression, Graph, in_order, is_analytic
from .trace import Trace, on_symbols, parameter_record, trace


@dataclass(frozen=True, eq=False)
class SwitchingTrace:
    """Expressions of a right-hand side that jumps.

    ``motion`` has the components of the mode that the inputs "sign" and "slide" describe, ``free_motion`` those where
    nothing slides, at less work.  ``events`` and ``free_events`` are positive as long as the mode lasts, one for each
    switch.  ``surfaces`` h_i, ``rates`` b_i, ``gains`` a_ij, ``jumps`` g_i and ``normals`` grad h_i depend on time and
    state alone.
    """

    motion: Trace
    events: tuple[Expression, ...]
    free_motion: Trace
    free_events: tuple[Expression, ...]
    surfaces: tuple[Expression, ...]
    rates: tuple[Expression, ...]
    gains: tuple[tuple[Expression, ...], ...]
    jumps: tuple[tuple[Expression, ...], ...]
    normals: tuple[tuple[Expression, ...], ...]

    @property
    def is_analytic(self) -> bool:
        """Whether every mode has power series."""
        return is_analytic((*self.motion.outputs, *self.free_motion.outputs, *self.events))


def switching_trace(
    rhs: Callable[..., Sequence[Any]], switches: Callable[..., Sequence[Any]], dimension: int, names: Sequence[str]
) -> SwitchingTrace:
    """Trace ``rhs(t, x, p, s)`` with its switching functions.

    Raises
    ------
    UntraceableError
        Where one of them cannot be traced, with the reason.
    ValueError
        Where several switches act on each other, so that the value on a surface is not defined.
    """
    base = trace(switches, dimension, names)
    graph, count = base.graph, len(base.outputs)
    signs = tuple(graph.node("sign", value=i) for i in range(count))
    record = parameter_record(tuple(names))
    outputs = on_symbols(graph, rhs, base.time, base.states, record(*base.parameters), signs)
    return _in_modes(replace(base, outputs=outputs), base.outputs, signs)


def _in_modes(base: Trace, surfaces: tuple[Expression, ...], signs: tuple[Expression, ...]) -> SwitchingTrace:
    graph, count = base.graph, len(signs)
    smooth, jumps = _affine(graph, base.outputs, signs)
    one, zero = graph.constant(1.0), graph.constant(0.0)

    def derivative(components: Sequence[Expression], time: Expression) -> tuple[Expression, ...]:
        seeds = dict(zip((base.time, *base.states), (time, *components), strict=True))
        return along(graph, surfaces, {node: seed for node, seed in seeds.items() if seed is not zero})

    rates = derivative(smooth, one)
    columns = [derivative(jump, zero) for jump in jumps]
    gains = tuple(tuple(columns[j][i] for j in range(count)) for i in range(count))
    unit = [[one if j == k else zero for j in range(len(base.states))] for k in range(len(base.states))]
    slopes = [derivative(direction, zero) for direction in unit]
    normals = tuple(tuple(slope[i] for slope in slopes) for i in range(count))
    slides = tuple(graph.node("slide", value=i) for i in range(count))
    held = _held_signs(graph, rates, gains, signs, slides)
    components = [
        _sum(graph, [f, *(graph.times(s, jump[j]) for s, jump in zip(held, jumps, strict=True))])
        for j, f in enumerate(smooth)
    ]
    # A coordinate that is held at zero stays there to the last bit.
    for slide, surface in zip(slides, surfaces, strict=True):
        if surface.operation == "state":
            components[surface.value] = graph.apply("mul", graph.apply("sub", one, slide), components[surface.value])
    free_events = tuple(graph.apply("mul", sign, surface) for sign, surface in zip(signs, surfaces, strict=True))
    events = tuple(
        graph.apply("add", event, graph.apply("mul", slide, graph.apply("sub", one, graph.apply("mul", value, value))))
        for event, slide, value in zip(free_events, slides, held, strict=True)
    )
    motion = replace(base, outputs=tuple(components))
    return SwitchingTrace(motion, events, base, free_events, surfaces, rates, gains, jumps, normals)


def _affine(
    graph: Graph, outputs: tuple[Expression, ...], signs: tuple[Expression, ...]
) -> tuple[tuple[Expression, ...], tuple[tuple[Expression, ...], ...]]:
    """Split f(s) into f_0 and g_i with f = f_0 + sum of s_i g_i at s_i = +-1."""
    zero, one, half = graph.constant(0.0), graph.constant(1.0), graph.constant(0.5)
    slopes = [along(graph, outputs, {sign: one}) for sign in signs]
    smooth = list(graph.substituted(outputs, dict.fromkeys(signs, zero)))
    if not any(_depends(slope, signs) for slope in slopes):
        return tuple(smooth), tuple(slopes)
    jumps = []
    for sign, slope in zip(signs, slopes, strict=True):
        others = [s for s in signs if s is not sign]
        if _depends(slope, others):
            raise ValueError("rhs multiplies signs by one another: what they are on a surface is not defined")
        rest = dict.fromkeys(others, zero)
        above = graph.substituted(outputs, {**rest, sign: one})
        below = graph.substituted(outputs, {**rest, sign: graph.constant(-1.0)})
        middle = graph.substituted(outputs, {**rest, sign: zero})
        jumps.append(tuple(graph.apply("mul", half, graph.minus(u, v)) for u, v in zip(above, below, strict=True)))
        for j, (u, v, w) in enumerate(zip(above, below, middle, strict=True)):
            mean = u if u is v else graph.apply("mul", half, graph.apply("add", u, v))
            smooth[j] = graph.apply("add", smooth[j], graph.minus(mean, w))
    return tuple(smooth), tuple(jumps)


def _held_signs(
    graph: Graph,
    rates: Sequence[Expression],
    gains: Sequence[Sequence[Expression]],
    signs: Sequence[Expression],
    slides: Sequence[Expression],
) -> list[Expression]:
    """Solve for the signs of a mode: the given one where a switch is free, the equivalent control where it slides."""
    count, apply, one = len(signs), graph.apply, graph.constant(1.0)
    rows = [
        [
            apply("add", one, apply("mul", u, apply("sub", a, one))) if i == j else graph.times(u, a)
            for j, a in enumerate(gains[i])
        ]
        for i, u in enumerate(slides)
    ]
    right = [graph.minus(s, graph.times(u, b)) for s, u, b in zip(signs, slides, rates, strict=True)]
    for i in range(count):
        for k in range(i + 1, count):
            if rows[k][i] is graph.constant(0.0):
                continue
            factor = apply("div", rows[k][i], rows[i][i])
            for j in range(i + 1, count):
                rows[k][j] = graph.minus(rows[k][j], graph.times(factor, rows[i][j]))
            right[k] = graph.minus(right[k], apply("mul", factor, right[i]))
    held: list[Expression] = [one] * count
    for i in reversed(range(count)):
        known = right[i]
        for j in range(i + 1, count):
            known = graph.minus(known, graph.times(rows[i][j], held[j]))
        held[i] = apply("div", known, rows[i][i])
    return held


def _depends(expressions: Sequence[Expression], inputs: Sequence[Expression]) -> bool:
    return not set(in_order(expressions)).isdisjoint(inputs)


def _sum(graph: Graph, terms: Sequence[Expression]) -> Expression:
    return functools.reduce(lambda a, b: graph.apply("add", a, b), terms)
