"""Impacts: events at which the state jumps, as expressions.

An impact happens where its guard g falls to zero; then the reset R takes the place of the state.  Deviations v pass by
the saltation matrix,

    v  ->  DR v + (f(R) - DR f - dR/dt) (grad g . v) / (dg/dt).

After ever smaller impacts an orbit rests on the surface: along the normal n of the impact a force keeps the
acceleration of the guard at zero, as long as it does not pull.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..._lib.arrays import Floats
from .branches import Switch
from .derivative import along
from .evaluation import evaluated
from .expression import Expression, in_order
from .trace import Trace

_SAMPLES = 16


@dataclass(frozen=True, eq=False)
class ImpactExpressions:
    """Expressions of an impact.

    ``rate`` and ``acceleration`` of the guard where nothing holds it; ``landed``, ``turned``: state and deviation
    after the impact, of a deviation that further states stand for; ``stuck``, ``held``: those that begin a rest;
    ``push``: the force that holds the guard, empty where a state cannot rest; ``solid``: whether no state may begin
    behind it; ``ends``: whether the orbit ends; ``bound``: for each switch 0, or the side to which it goes with a state
    that leaves the rest, if its surface holds wherever a state rests.
    """

    rate: Expression
    acceleration: Expression
    landed: tuple[Expression, ...]
    turned: tuple[Expression, ...]
    stuck: tuple[Expression, ...]
    held: tuple[Expression, ...]
    push: tuple[Expression, ...]
    solid: bool = False
    ends: bool = False
    bound: tuple[int, ...] = ()

    @property
    def rests(self) -> bool:
        """Whether a state can rest on the surface."""
        return bool(self.push)

    def with_bound(self, count: int, sides: Mapping[int, int | None]) -> ImpactExpressions:
        """Add the sides of switches that slide; where one of them is None, a state cannot rest."""
        if any(side is None for side in sides.values()):
            return replace(self, push=())
        return replace(self, bound=tuple(sides.get(k) or 0 for k in range(count)))


def impact_of(
    base: Trace, guard: Expression, reset: Sequence[Expression], modes: Sequence[Switch] = ()
) -> ImpactExpressions:
    """Return the expressions of an impact in a motion, whose outputs are those of a mode in which nothing is held.

    After the impact switches are on the sides to which the reset takes the state.
    """
    graph, d, one = base.graph, len(base.states), base.graph.constant(1.0)
    motion = dict(zip((base.time, *base.states), (one, *base.outputs), strict=True))
    deviation = tuple(graph.node("state", value=d + j) for j in range(d))
    ahead = dict(zip(base.states, deviation, strict=True))
    (rate,) = along(graph, [guard], motion)
    (acceleration,) = along(graph, [rate], motion)
    (toward,) = along(graph, [guard], ahead)
    carried, moving = along(graph, reset, ahead), along(graph, reset, motion)
    landed = dict(zip(base.states, reset, strict=True))
    for mode in modes:
        (there,) = graph.substituted([mode.function], landed)
        if mode.function is not guard and there is not mode.function:
            landed[mode.sign] = graph.plain("floor" if mode.counts else "side", there)
    after = graph.substituted(base.outputs, landed)
    delay = graph.apply("div", toward, rate)
    turned = tuple(
        graph.apply("add", c, graph.times(delay, graph.minus(f, m)))
        for c, f, m in zip(carried, after, moving, strict=True)
    )
    impact = ImpactExpressions(rate, acceleration, tuple(reset), turned, base.states, deviation, ())
    return _with_rest(base, impact, guard, ahead)


def beside_rest(
    base: Trace,
    impact: ImpactExpressions,
    surface: Expression,
    normal: Sequence[Expression],
    jump: Sequence[Expression],
) -> int | None:
    """Return what a switch that slides does while a state rests: 0 if neither acts on the other.

    Where its function is a multiple of the guard's rate, whose factor may depend on parameters, it is zero at rest, and
    what is returned is the sign of the factor.  Else None: the forces on both surfaces are not known one by one.
    """
    (pull,) = along(base.graph, [impact.rate], dict(zip(base.states, jump, strict=True)))
    if not impact.rests or (base.graph.dot(normal, impact.push).vanishes and pull.vanishes):
        return 0
    constants = [x for x, rate in zip(base.states, base.outputs, strict=True) if rate.vanishes]
    ratio = _sampled(base, base.graph.apply("div", surface, impact.rate), (*base.parameters, *constants))
    alike = np.ptp(ratio) <= 1e-9 * np.abs(ratio).max()
    return int(np.sign(ratio[0])) if alike else None


def _with_rest(
    base: Trace, impact: ImpactExpressions, guard: Expression, ahead: dict[Expression, Expression]
) -> ImpactExpressions:
    """Add what belongs to a rest, where the impact acts along one direction on which the guard's rate depends.

    Coordinates that nothing changes, as parameters among the state, are no part of a direction.
    """
    graph, zero = base.graph, base.graph.constant(0.0)
    changes = [graph.minus(r, x) for r, x in zip(impact.landed, base.states, strict=True)]
    moves = [not (rate.vanishes and change.vanishes) for rate, change in zip(base.outputs, changes, strict=True)]
    slope = [s if m else zero for s, m in zip(_gradient(base, impact.rate), moves, strict=True)]
    # The reset turns the rate of the guard round, and changes the state along one direction: that of its own change.
    seeds = {x: s for x, s in zip(base.states, slope, strict=True) if s is not zero}
    normal = along(graph, changes, seeds)
    across = graph.dot(slope, normal)
    if not _is_solid(base, across):
        return impact
    push = tuple(graph.apply("neg", graph.times(graph.apply("div", impact.acceleration, across), n)) for n in normal)
    stuck = tuple(
        graph.minus(x, graph.times(graph.apply("div", impact.rate, across), n))
        for x, n in zip(base.states, normal, strict=True)
    )
    (drift,) = along(graph, [impact.rate], ahead)
    held = [
        graph.minus(ahead[x], graph.times(graph.apply("div", drift, across), n))
        for x, n in zip(base.states, normal, strict=True)
    ]
    slopes = _gradient(base, guard)
    up = [s if m else zero for s, m in zip(slopes, moves, strict=True)]
    apart = graph.apply("div", graph.dot(slopes, held), graph.dot(up, up))
    held = [graph.minus(h, graph.times(apart, u)) for h, u in zip(held, up, strict=True)]
    return replace(impact, push=push, stuck=stuck, held=tuple(held))


def _is_solid(base: Trace, across: Expression) -> bool:
    """Whether a divisor is not zero at places drawn at random."""
    return not across.vanishes and bool((np.abs(_sampled(base, across)) > 1e-12).all())


def _sampled(base: Trace, expression: Expression, held: Sequence[Expression] = ()) -> Floats:
    """Return the values of an expression at places drawn at random, which have some inputs in common."""
    rng = np.random.default_rng(0)
    inputs = {e: rng.uniform(0.1, 1.0, _SAMPLES) for e in in_order([expression]) if not e.arguments and e.value is None}
    inputs |= {e: rng.uniform(0.1, 1.0, _SAMPLES) for e in (*base.states, *base.parameters, base.time)}
    inputs |= {e: np.ones(_SAMPLES) for e in in_order([expression]) if e.operation == "sign"}
    inputs |= {e: np.full(_SAMPLES, inputs[e][0]) for e in held}
    (found,) = evaluated([expression], inputs)
    return np.broadcast_to(found, _SAMPLES)


def _gradient(base: Trace, function: Expression) -> tuple[Expression, ...]:
    one = base.graph.constant(1.0)
    return tuple(along(base.graph, [function], {x: one})[0] for x in base.states)
