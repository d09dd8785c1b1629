"""Discontinuous right-hand sides in the sense of Filippov (1988), as expressions.

With the signs s_i of the switching functions h_i the right-hand side is f(s) = f_0 + sum of s_i g_i.  Each switch of an
orbit is either free, s_i = +1 or -1, or it slides: then s_i = l_i is Utkin's equivalent control, the value that keeps
h_i at zero, from

    dh_i/dt = b_i + sum of a_ij s_j = 0,    b_i = (d/dt + f_0 . grad) h_i,    a_ij = g_j . grad h_i.

Modes are inputs of the expressions here and differ from lane to lane: the node "sign" is +-1 where the switch is free
and 0 where it slides, "slide" is 1 where it slides and 0 where it is free.  The sign of a switch that counts is a whole
number n; on its surface s_i lies between n, of the side below, and n + 1, and "sign" remains n where it slides.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..kernels.lane import ENDS, RESTS, SOLID, STRIKES
from .branches import BranchingGraph, Switch, initial_functions
from .continuity import is_continuous
from .derivative import along
from .evaluation import evaluated
from .expression import Expression, Graph, UntraceableError, in_order, is_analytic
from .impacts import ImpactExpressions, beside_rest, impact_of
from .sliding import held_in_places, held_signs
from .trace import Trace, empty_trace

_MANY = 400  # expressions of a motion that slides, from which on fewer are looked for


@dataclass(frozen=True, eq=False)
class SwitchingTrace:
    """Expressions of a discontinuous (Filippov) right-hand side.

    ``motion`` has the components of the mode that the inputs "sign" and "slide" describe, ``free_motion`` those where
    nothing slides, at less work.  ``events`` and ``free_events`` are positive as long as the mode lasts, one for each
    switch; those of switches that count are between -1/2 and 1/2.  ``surfaces`` h_i, ``rates`` b_i, ``gains`` a_ij,
    ``jumps`` g_i and ``normals`` grad h_i depend on time, state and the signs.  ``beginnings`` are the surfaces as they
    are before there is a mode.  A switch that `counts` has a whole number for its sign; its surface is the distance
    from the nearest one.  Of a switch at which there is one of the `impacts`, the rate is that of the mode without rest
    and its own gain the acceleration; it "slides" while the state rests on its surface.
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
    beginnings: tuple[Expression, ...]
    counts: tuple[bool, ...]
    impacts: tuple[ImpactExpressions | None, ...] = ()

    @property
    def bound(self) -> tuple[int, ...]:
        """Row by row, the sides to which switches go with a state that leaves the rest on a surface, else 0."""
        count = len(self.surfaces)
        rows = [i.bound if i is not None and i.rests else (0,) * count for i in self.impacts or (None,) * count]
        return tuple(side for row in rows for side in row)

    @property
    def kinds(self) -> tuple[int, ...]:
        """What each switch does: see the kinds in :mod:`cellmap._compiled.kernels.lane`."""
        kinds = [int(counts) for counts in self.counts]
        for e, impact in enumerate(self.impacts):
            if impact is not None:
                kinds[e] = (SOLID if impact.solid else RESTS) if impact.rests else ENDS if impact.ends else STRIKES
        return tuple(kinds)

    @property
    def moving(self) -> int:
        """Number of coordinates without the last ones that neither motion nor impacts change."""
        base = self.free_motion
        for j in range(len(base.states), 0, -1):
            kept = all(i is None or i.landed[j - 1] is base.states[j - 1] for i in self.impacts)
            if not (base.outputs[j - 1].vanishes and kept):
                return j
        return len(base.states)

    @property
    def can_slide(self) -> bool:
        """Whether there is a mode that slides, or rests."""
        return any(kind >= RESTS for kind in self.kinds) or any(
            not row[i].vanishes for i, row in enumerate(self.gains) if self.kinds[i] < STRIKES
        )

    @property
    def is_coupled(self) -> bool:
        """Whether a surface depends on the side of another."""
        return any(e.operation == "sign" for e in in_order(self.surfaces))

    def signs_at(self, t: float, state: Sequence[float], parameters: Sequence[float]) -> tuple[float, ...]:
        """Return the signs, and whole numbers, of the mode in which a state begins."""
        base = self.free_motion
        inputs = dict(zip((base.time, *base.states, *base.parameters), (t, *state, *parameters), strict=True))
        functions = evaluated(self.beginnings, inputs)
        pairs = zip(functions, self.counts, strict=True)
        return tuple(float(np.floor(f)) if counts else (1.0 if f > 0.0 else -1.0) for f, counts in pairs)

    @property
    def is_analytic(self) -> bool:
        """Whether every mode has power series."""
        return is_analytic((*self.motion.outputs, *self.free_motion.outputs, *self.events))


def switching_trace(
    rhs: Callable[..., Sequence[Any]],
    switches: Callable[..., Sequence[Any]] | None,
    dimension: int,
    names: Sequence[str],
    impacts: Callable[..., Sequence[Any]] | None = None,
) -> SwitchingTrace:
    """Trace ``rhs(t, x, p, s)`` with its switching functions, or ``rhs(t, x, p)`` alone, with the branches of both.

    ``impacts(t, x, p)`` returns for each impact the guard, which falls to zero there, 1 if no state may begin
    behind it, 2 if the orbit ends there and else 0, and the state after it.

    Raises
    ------
    UntraceableError
        Where one of them cannot be traced, or nothing switches, with the reason.
    ValueError
        Where several switches that are given act on each other, so that the value on a surface is not defined.
    """
    base = empty_trace(dimension, len(names), BranchingGraph(modes=True))
    graph = base.graph
    given, outputs = _with_sides(base, rhs, switches, names)
    struck = () if impacts is None else graph.trace_paths(base.run(impacts, names))
    strikes = [struck[k : k + 2 + dimension] for k in range(0, len(struck), 2 + dimension)]
    guards = [graph.add_switch(guard) for guard, *_ in strikes]
    modes = [switch for switch in graph.switches if switch.is_mode]
    if not modes:
        raise UntraceableError("nothing switches")
    traced = _in_modes(replace(base, outputs=outputs), modes, given)
    if not strikes:
        return traced
    places = [next(i for i, mode in enumerate(modes) if mode.sign is guard) for guard in guards]
    return _with_impacts(traced, modes, dict(zip(places, strikes, strict=True)))


def _with_sides(
    base: Trace, rhs: Callable[..., Sequence[Any]], switches: Callable[..., Sequence[Any]] | None, names: Sequence[str]
) -> tuple[tuple[Expression, ...], tuple[Expression, ...]]:
    """Trace the switching functions that are given, and the right-hand side, on as many paths as conditions ask for."""
    graph = base.graph
    while True:
        given: tuple[Expression, ...] = ()
        if switches is not None:
            given = tuple(map(graph.add_switch, graph.trace_paths(base.run(switches, names))))
        outputs = graph.trace_paths(base.run(rhs, names, *([given] if switches is not None else [])))
        differing = _to_follow(graph)
        if not differing:
            return given, outputs
        graph.followed |= differing
        graph.restart()


def _to_follow(graph: BranchingGraph) -> set[Expression]:
    """Return functions of switches, not followed so far, on whose sides the function of another switch differs.

    It jumps there, so that a state that slides between them has another condition on either side; or it keeps to
    steps on one of them, where it may be zero for a time.
    """
    found = set()
    for own, function in zip(graph.switches, graph.conditions, strict=True):
        signs = {e for e in in_order([function]) if e.operation == "sign" and e is not own.sign}
        for switch, condition in zip(graph.switches, graph.conditions, strict=True):
            if switch.sign in signs and not switch.counts and condition not in graph.followed:
                low, high = (
                    graph.substituted([function], {switch.sign: graph.constant(side)}, graph.plain)[0]
                    for side in (-1.0, 1.0)
                )
                still = "constant" in (low.operation, high.operation)
                if still or not is_continuous(replace(switch, function=condition), (graph.minus(high, low),)):
                    found.add(condition)
    return found


def _with_impacts(
    traced: SwitchingTrace, modes: Sequence[Switch], strikes: Mapping[int, Sequence[Expression]]
) -> SwitchingTrace:
    """Add impacts at some of the switches.

    A state rests beside switches that slide only if neither acts on the other, or their surface is the rest itself.
    """
    base, graph = traced.free_motion, traced.free_motion.graph
    sliding = [k for k, row in enumerate(traced.gains) if not row[k].vanishes]
    impacts: list[ImpactExpressions | None] = [None] * len(traced.surfaces)
    rates, gains, events = list(traced.rates), [list(row) for row in traced.gains], list(traced.events)
    components = list(traced.motion.outputs)
    for e, (guard, solid, *reset) in strikes.items():
        struck = impact_of(base, guard, reset, modes)
        ends = solid.value > 1.0
        impact = impacts[e] = replace(struck, solid=solid.value == 1.0, ends=ends, push=() if ends else struck.push)
        beside = [beside_rest(base, impact, traced.surfaces[k], traced.normals[k], traced.jumps[k]) for k in sliding]
        impact = impacts[e] = impact.with_bound(len(impacts), dict(zip(sliding, beside, strict=True)))
        rates[e], gains[e][e] = impact.rate, impact.acceleration
        if impact.rests:
            slide = graph.node("slide", value=e)
            components = [
                graph.apply("add", c, graph.times(slide, f)) for c, f in zip(components, impact.push, strict=True)
            ]
            events[e] = graph.apply("sub", events[e], graph.apply("mul", slide, impact.acceleration))
            for k in np.flatnonzero(impact.bound):
                free = graph.apply("sub", graph.constant(1.0), slide)
                events[k] = graph.apply("add", graph.apply("mul", free, events[k]), slide)
    return replace(
        traced,
        motion=replace(traced.motion, outputs=tuple(components)),
        events=tuple(events),
        rates=tuple(rates),
        gains=tuple(map(tuple, gains)),
        impacts=tuple(impacts),
    )


def _in_modes(base: Trace, modes: Sequence[Switch], given: Sequence[Expression]) -> SwitchingTrace:
    graph, count = base.graph, len(modes)
    signs = tuple(switch.sign for switch in modes)
    surfaces = tuple(_from_nearest_whole(graph, s.function) if s.counts else s.function for s in modes)
    smooth, jumps, below = _affine(base, modes, given)
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
    free_events = tuple(
        graph.difference(s.function, graph.apply("add", s.sign, 0.5))
        if s.counts
        else graph.apply("mul", s.sign, s.function)
        for s in modes
    )
    slides = tuple(zero if gains[i][i].vanishes else graph.node("slide", value=i) for i in range(count))
    motion, events = base, list(free_events)
    if any(not gains[i][i].vanishes for i in range(count)):
        counts = [s.counts for s in modes]
        held = held_signs(graph, rates, gains, signs, slides, counts)
        parts, begin = held, smooth
        if below is not None:
            # What is added where a switch slides; a sum of all jumps would cancel where one side has a pole.
            parts, begin = (
                [
                    graph.times(u, graph.minus(value, s.sign) if s.counts else graph.apply("add", value, one))
                    for u, value, s in zip(slides, held, modes, strict=True)
                ],
                below,
            )
        components = [
            _sum(graph, [f, *(graph.times(s, jump[j]) for s, jump in zip(parts, jumps, strict=True))])
            for j, f in enumerate(begin)
        ]
        events = [
            event if slide is zero else _event_of_both(graph, switch, event, slide, value)
            for switch, event, slide, value in zip(modes, free_events, slides, held, strict=True)
        ]
        if _size((components, events)) > _MANY:
            outputs = graph.substituted(base.outputs, _with_side_below(graph, given)) if below is None else below
            others = held_in_places(replace(base, outputs=outputs), modes, normals, slides, free_events)
            components, events = min((components, events), others, key=_size)
        # A coordinate that is held at zero stays there to the last bit.
        for slide, surface in zip(slides, surfaces, strict=True):
            if surface.operation == "state":
                components[surface.value] = graph.apply(
                    "mul", graph.apply("sub", one, slide), components[surface.value]
                )
        motion = replace(base, outputs=tuple(components))
    beginnings = tuple(initial_functions(graph, modes))
    return SwitchingTrace(
        motion, tuple(events), base, free_events, surfaces, rates, gains, jumps, normals, beginnings,
        tuple(switch.counts for switch in modes),
    )  # fmt: skip


def _event_of_both(
    graph: BranchingGraph, switch: Switch, free: Expression, slide: Expression, held: Expression
) -> Expression:
    """Return the event of a switch that is free or slides, where it ends with the value that holds it."""
    one = graph.constant(1.0)
    if switch.counts:
        from_middle = graph.minus(held, graph.apply("add", switch.sign, 0.5))
        return _sum(graph, [graph.times(graph.minus(one, slide), free), graph.times(slide, from_middle)])
    return graph.apply("add", free, graph.times(slide, graph.minus(one, graph.apply("mul", held, held))))


def _from_nearest_whole(graph: BranchingGraph, function: Expression) -> Expression:
    return graph.difference(function, graph.plain("floor", graph.apply("add", function, 0.5)))


def _affine(
    base: Trace, modes: Sequence[Switch], given: Sequence[Expression]
) -> tuple[tuple[Expression, ...], tuple[tuple[Expression, ...], ...], tuple[Expression, ...] | None]:
    """Split f(s) into f_0 and g_i with f = f_0 + sum of s_i g_i, where one s_i at a time is another than its sign.

    The third is f(s) with the side below for each switch that slides, None where f is affine in all signs at once.
    The signs of switches that are given must not act on each other; then that holds for all of them together.
    """
    graph, outputs = base.graph, base.outputs
    zero, one, half = graph.constant(0.0), graph.constant(1.0), graph.constant(0.5)
    below = graph.constant(-1.0)
    signs = [switch.sign for switch in modes]
    slopes = [along(graph, outputs, {sign: one}) for sign in signs]
    if len(given) == len(modes) and not any(_depends(slope, signs) for slope in slopes) and not _selects(outputs):
        return graph.substituted(outputs, dict.fromkeys(signs, zero)), tuple(slopes), None
    mine = set(given)
    for sign, slope in zip(signs, slopes, strict=True):
        if sign in mine and _depends(slope, mine - {sign}):
            raise ValueError("rhs multiplies signs by one another: what they are on a surface is not defined")
    outputs = graph.substituted(outputs, _with_side_below(graph, given))
    jumps = []
    for switch in modes:
        if switch.counts:
            next_one = graph.substituted(outputs, {switch.sign: graph.apply("add", switch.sign, one)})
            jump = tuple(graph.minus(u, v) for u, v in zip(next_one, outputs, strict=True))
        else:
            sides = [graph.substituted(outputs, {switch.sign: side}) for side in (one, below)]
            jump = tuple(graph.times(half, graph.minus(u, v)) for u, v in zip(*sides, strict=True))
        jumps.append((zero,) * len(outputs) if is_continuous(switch, jump) else jump)
    if any(_depends(jump, signs) for jump in jumps):
        factors = [s.sign if s.counts else graph.plain("select", s.sign, one, below) for s in modes]
        terms = [[graph.times(f, e) for e in jump] for f, jump in zip(factors, jumps, strict=True)]
        smooth = tuple(functools.reduce(graph.minus, rest, f) for f, *rest in zip(outputs, *terms, strict=True))
        return smooth, tuple(jumps), outputs
    # No jump depends on another: what is left at the sides below, and half of each jump, is the same on all sides.
    least = {
        s.sign: zero if s.counts else below
        for s, jump in zip(modes, jumps, strict=True)
        if not all(e.vanishes for e in jump)
    }
    halves = [jump for s, jump in zip(modes, jumps, strict=True) if not s.counts]
    lowest = graph.substituted(outputs, least)
    return tuple(_sum(graph, terms) for terms in zip(lowest, *halves, strict=True)), tuple(jumps), outputs


def _with_side_below(graph: BranchingGraph, given: Sequence[Expression]) -> dict[Expression, Expression]:
    """Return what takes the places of signs that are given: where a switch slides its input is zero.

    What is written with it then takes the side below, as selections do.
    """
    sides = graph.constant(1.0), graph.constant(-1.0)
    return {sign: graph.plain("select", sign, *sides) for sign in given if sign.operation == "sign"}


def _selects(outputs: Sequence[Expression]) -> bool:
    return any(e.operation == "select" for e in in_order(outputs))


def _size(parts: Sequence[Sequence[Expression]]) -> int:
    """Return how many expressions there are in lists of them, with all that they need."""
    return len(in_order([e for part in parts for e in part]))


def _depends(expressions: Sequence[Expression], inputs: Collection[Expression]) -> bool:
    return not set(in_order(expressions)).isdisjoint(inputs)


def _sum(graph: Graph, terms: Sequence[Expression]) -> Expression:
    return functools.reduce(lambda a, b: graph.apply("add", a, b), terms)
