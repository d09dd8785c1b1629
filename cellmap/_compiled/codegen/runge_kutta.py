"""Explicit Runge-Kutta steps as straight-line code."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import fsum

from . import simd_math
from .emit import Known, evaluate, inputs
from .expression import in_order
from .instructions import Instructions, Value, dot
from .period import PerLane, PerStep, Step, Values
from .resolution import as_error, excess, layers
from .trace import CONSTANT, STATEFUL, TIMED, Trace

Call = Callable[[Value, Values], Values]
"""Writer of the derivatives at a time and a state."""


@dataclass(frozen=True)
class Tableau:
    """Coefficients of an explicit Runge-Kutta method with an embedded error estimate.

    ``errors`` holds one or two rows of weights.  One row estimates the local error itself.  With two rows the estimate
    is e^2 / sqrt(e^2 + 0.01 f^2) of their values e and f, the combination of Hairer, Norsett and Wanner (1993, II.10)
    for their method of order 8.  ``order`` is the order at which the estimate of a whole period shrinks.
    """

    name: str
    order: int
    estimate_order: int
    nodes: tuple[float, ...]
    stages: tuple[tuple[float, ...], ...]
    weights: tuple[float, ...]
    errors: tuple[tuple[float, ...], ...]

    def of_integrals(self) -> Tableau:
        """Return the weights of a state whose derivative is another state, for the derivatives of that one.

        With x' = v and v' = f, stages of x are x + c h v + h^2 sum w f, as in methods of Nystrom (1925).  Terms that
        cancel but for rounding vanish.
        """
        matrix = [(*row, *(len(self.nodes) - len(row)) * (0.0,)) for row in self.stages]

        def integrated(row: Sequence[float]) -> tuple[float, ...]:
            columns = [[a * b for a, b in zip(row, column, strict=False)] for column in zip(*matrix, strict=True)]
            sums = [(fsum(terms), fsum(map(abs, terms))) for terms in columns]
            return tuple(w if abs(w) > 1e-12 * size else 0.0 for w, size in sums)

        stages, errors = (tuple(map(integrated, rows)) for rows in (self.stages, self.errors))
        return replace(self, stages=stages, weights=integrated(self.weights), errors=errors)


def traced_steps(trace: Trace, tableau: Tableau) -> Step:
    """Return one step of the method for a traced right-hand side."""
    levels = trace.levels()
    nodes = in_order(trace.outputs)
    of_level = [[n for n in nodes if levels[n] == level] for level in (CONSTANT, TIMED, STATEFUL)]
    arguments = layers(trace.outputs, levels)
    seen = apart(tableau.nodes)

    def step(out: Instructions, p: Values) -> PerStep:
        once = evaluate(out, of_level[CONSTANT], inputs(out, nodes, parameter=p), CONSTANT)

        def per_step(t: Value, h: Value) -> PerLane:
            coefficients = scaled(tableau, h)
            moments: dict[float, Known] = {}
            for c in tableau.nodes:
                if c not in moments:
                    known = once | inputs(out, [trace.time], time={None: t + c * h if c else t})
                    moments[c] = evaluate(out, of_level[TIMED], known, TIMED)
            sharp = {
                argument: excess([moments[tableau.nodes[k]][argument] for k in seen], scale)
                for argument, scale in arguments
                if levels[argument] == TIMED
            }

            def per_lane(x: Values) -> tuple[Values, Values]:
                stages: list[Known] = []

                def slopes(c: float, state: Values) -> Values:
                    known = moments[c] | dict(zip(trace.states, state, strict=True))
                    stages.append(evaluate(out, of_level[STATEFUL], known, STATEFUL))
                    return [stages[-1][e] for e in trace.outputs]

                after, errors = _step(tableau, coefficients, h, x, slopes)
                factors = [
                    sharp[argument] if argument in sharp else excess([stages[k][argument] for k in seen], scale)
                    for argument, scale in arguments
                ]
                return after, [as_error(factors, errors[0]), *errors[1:]]

            return per_lane

        return per_step

    return step


def apart(nodes: Sequence[float]) -> list[int]:
    """Return the numbers of stages in the order of their times, of those that are close together only one."""
    chosen = [0]
    for k in sorted(range(len(nodes)), key=lambda k: nodes[k]):
        if nodes[k] > nodes[chosen[-1]] + 0.1:
            chosen.append(k)
    return chosen


def called_steps(prepared: Callable[[Instructions], Call], tableau: Tableau) -> Step:
    """Return one step of a right-hand side that is called, by what prepares such calls in a function."""

    def step(out: Instructions, p: Values) -> PerStep:
        slopes = prepared(out)

        def per_step(t: Value, h: Value) -> PerLane:
            coefficients = scaled(tableau, h)
            return lambda x: _step(tableau, coefficients, h, x, lambda c, state: slopes(t + c * h, state))

        return per_step

    return step


def scaled(tableau: Tableau, h: Value) -> list[list[Value | None]]:
    """Write the coefficients of the stages, and of the step, times its size."""
    return [[h * a if a else None for a in row] for row in (*tableau.stages, tableau.weights)]


def _step(
    tableau: Tableau,
    coefficients: Sequence[Sequence[Value | None]],
    h: Value,
    x: Values,
    slopes: Callable[[float, Values], Values],
) -> tuple[list[Value], list[Value]]:
    """Write the stages of a step; return the states after it and the estimates of their errors."""
    found: list[Values] = []  # derivatives of the stages

    def moved(j: int, row: Sequence[Value | None]) -> Value:
        return after_slopes(x[j], row, [k[j] for k in found])

    for c, row in zip(tableau.nodes, coefficients, strict=False):
        found.append(slopes(c, [moved(j, row) for j in range(len(x))]))
    after = [moved(j, coefficients[-1]) for j in range(len(x))]
    return after, [estimated(tableau.errors, h, [k[j] for k in found]) for j in range(len(x))]


def after_slopes(x: Value, row: Sequence[Value | None], slopes: Values) -> Value:
    """Write a state after some stages: moved by their derivatives times the coefficients of a row."""
    change = dot((a, k) for a, k in zip(row, slopes, strict=False) if a is not None)
    return x if change is None else x + change


def estimated(errors: Sequence[Sequence[Value | float]], h: Value, slopes: Values) -> Value:
    """Write the estimate of the error of a state, by rows of weights of its derivatives at all stages."""
    sums = [dot((e, k) for e, k in zip(row, slopes, strict=False) if e) for row in errors]
    f, g = sums[0], sums[-1]
    assert f is not None and g is not None, "an estimate has terms"
    if len(sums) == 1:
        return h * f
    q = f * f
    return h * q / simd_math.sqrt(q + 0.01 * (g * g) + 1e-290)
