"""Equivalent controls, which hold functions of switches at zero: for all switches together, or for those that slide.

For all together, equations in as many unknowns as there are switches are solved.  No more switches can slide at a time
than there are coordinates, however: those that slide are put in a first, second, ... place, and the right-hand side is
evaluated once more for each place, on its other side there.
"""

from __future__ import annotations

from collections.abc import Sequence

from .branches import Switch
from .derivative import along
from .expression import Expression, Graph
from .trace import Trace


def held_signs(
    graph: Graph,
    rates: Sequence[Expression],
    gains: Sequence[Sequence[Expression]],
    signs: Sequence[Expression],
    slides: Sequence[Expression],
    counts: Sequence[bool],
) -> list[Expression]:
    """Return the signs of a mode: the given one where a switch is free, the equivalent control where it slides."""
    apply, one = graph.apply, graph.constant(1.0)
    rows = [
        [
            apply("add", one, apply("mul", u, apply("sub", a, one))) if i == j else graph.times(u, a)
            for j, a in enumerate(gains[i])
        ]
        for i, u in enumerate(slides)
    ]
    own = [
        graph.times(graph.minus(one, u), s) if n and not u.vanishes else s
        for s, u, n in zip(signs, slides, counts, strict=True)
    ]
    return _solved(graph, rows, [graph.minus(s, graph.times(u, b)) for s, u, b in zip(own, slides, rates, strict=True)])


def held_in_places(
    base: Trace,
    modes: Sequence[Switch],
    normals: Sequence[Sequence[Expression]],
    slides: Sequence[Expression],
    free_events: Sequence[Expression],
) -> tuple[list[Expression], list[Expression]]:
    """Return the components of a motion and its events, where at most as many switches slide as there are coordinates.

    The outputs of `base` are those of the sides below where switches slide.  Beyond that number all is NaN.
    """
    graph, one, zero = base.graph, base.graph.constant(1.0), base.graph.constant(0.0)
    apply, sliding = graph.apply, [i for i, u in enumerate(slides) if not u.vanishes]
    drifts = along(graph, [modes[i].function for i in sliding], {base.time: one})
    left = {i: slides[i] for i in sliding}
    places: list[dict[int, Expression]] = []  # 1 for the switch that is in it, of those that have not been in another
    for _ in range(min(len(sliding), len(base.states))):
        taken, place = zero, {}
        for i, u in left.items():
            place[i] = graph.times(u, graph.minus(one, taken))
            taken = apply("add", taken, place[i])
        left = {i: graph.minus(u, place[i]) for i, u in left.items()}
        places.append(place)
    too_many = graph.constant(0.0)
    for u in left.values():
        too_many = apply("add", too_many, u)

    jumps = []
    for place in places:
        above = {
            mode.sign: apply("select", there, apply("add", mode.sign, one) if mode.counts else one, mode.sign)
            for mode, there in ((modes[i], there) for i, there in place.items())
        }
        other = graph.substituted(base.outputs, above)
        jumps.append([graph.minus(u, v) for u, v in zip(other, base.outputs, strict=True)])

    def chosen(place: dict[int, Expression], values: Sequence[Expression]) -> Expression:
        result = zero
        for there, value in zip(place.values(), values, strict=True):
            result = apply("select", there, value, result)
        return result

    rows, right = [], []
    for r, place in enumerate(places):
        normal = [chosen(place, [normals[i][k] for i in sliding]) for k in range(len(base.states))]
        rows.append([graph.dot(normal, jump) for jump in jumps])
        rows[r][r] = apply("select", chosen(place, [one] * len(sliding)), rows[r][r], one)
        rate = apply("add", chosen(place, drifts), graph.dot(normal, base.outputs))
        right.append(apply("neg", rate))
    parts = _solved(graph, rows, right)
    parts = [apply("select", too_many, graph.constant(float("nan")), part) for part in parts]
    components = [
        graph.dot([one, *parts], [below, *(jump[k] for jump in jumps)]) for k, below in enumerate(base.outputs)
    ]
    events = list(free_events)
    for place, part in zip(places, parts, strict=True):
        middle = graph.minus(part, graph.constant(0.5))
        inside = apply("mul", apply("mul", graph.constant(4.0), part), graph.minus(one, part))
        for i, there in place.items():
            events[i] = apply("select", there, middle if modes[i].counts else inside, events[i])
    return components, events


def _solved(graph: Graph, rows: list[list[Expression]], right: list[Expression]) -> list[Expression]:
    """Solve linear equations by elimination; what vanishes costs nothing."""
    count, apply = len(rows), graph.apply
    for i in range(count):
        for k in range(i + 1, count):
            if rows[k][i] is graph.constant(0.0):
                continue
            factor = apply("div", rows[k][i], rows[i][i])
            for j in range(i + 1, count):
                rows[k][j] = graph.minus(rows[k][j], graph.times(factor, rows[i][j]))
            right[k] = graph.minus(right[k], apply("mul", factor, right[i]))
    held: list[Expression] = [graph.constant(1.0)] * count
    for i in reversed(range(count)):
        known = right[i]
        for j in range(i + 1, count):
            known = graph.minus(known, graph.times(rows[i][j], held[j]))
        held[i] = apply("div", known, rows[i][i])
    return held
