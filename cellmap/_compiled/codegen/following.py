"""Conditions that depend on the sides of others: which of these have to be followed to both sides."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from .branches import BranchingGraph
from .continuity import is_continuous
from .expression import Expression, in_order
from .trace import Trace


def with_sides(
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
