"""Velocities that a branch of a right-hand side reverses, as an impact would do."""

from __future__ import annotations

import functools

import numpy as np

from .._compiled.codegen.evaluation import evaluated
from .._compiled.codegen.expression import Expression, in_order
from .._compiled.codegen.filippov import SwitchingTrace
from .._lib.arrays import Floats
from .._lib.checks import warn_caller
from .formulas import Formulas

_SAMPLES = 32


def warn_of_reversals(known: Formulas) -> None:
    """Warn where branches of a right-hand side give a coordinate its velocity on one side, and reversed on the other.

    As long as the state is beyond the surface such a right-hand side runs backwards, which is rarely meant; a velocity
    that is reversed once belongs in a reset.
    """
    if known.in_modes is None or known.system.functions[1:] != (None, None):
        return
    found = _reversal(known.in_modes)
    if found is None:
        return
    place, velocity = (known.system.axes[j].name for j in found)
    warn_caller(
        f"rhs of {known.system.name} reverses a velocity: {place} changes with {velocity} on one side of a surface, "
        "and backwards for as long as the state is on the other. If an impact is meant, take the branch out and "
        "declare impacts=[Impact(guard, reset)]"
    )


@functools.lru_cache(maxsize=256)
def _reversal(traced: SwitchingTrace) -> tuple[int, int] | None:
    """Return numbers j, k where a surface of x_j parts dx_j/dt = x_k and dx_j/dt = c x_k with one c < 0."""
    base, graph = traced.free_motion, traced.free_motion.graph
    one, rng = graph.constant(1.0), np.random.default_rng(0)
    for number, surface in enumerate(traced.surfaces):
        sign = graph.node("sign", value=number)
        sides = [graph.substituted(base.outputs, {sign: s}) for s in (one, graph.constant(-1.0))]
        reached = set(in_order([surface]))
        for j, x in enumerate(base.states):
            if x not in reached or sides[0][j] is sides[1][j]:
                continue
            both = [side[j] for side in sides]
            inputs: dict[Expression, Floats] = {}
            for e in in_order(both):
                if not e.arguments and e.operation != "constant":
                    drawn = rng.uniform(-2.0, 2.0, _SAMPLES)
                    fixed = {"sign": np.sign(drawn), "parameter": np.full(_SAMPLES, abs(drawn[0]))}
                    inputs[e] = fixed.get(e.operation, drawn)
            values = evaluated(both, inputs)
            for straight, turned in (values, values[::-1]):
                for k, v in enumerate(base.states):
                    if k == j or v not in inputs or not np.array_equal(straight, inputs[v]):
                        continue
                    factors = np.broadcast_to(turned, _SAMPLES) / inputs[v]
                    below = factors[factors < 0.0]
                    if len(below) > 1 and np.ptp(below) <= 1e-9:
                        return j, k
    return None
