"""Explicit Runge-Kutta steps as straight-line code."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from .emit import assignment, dot, input_name
from .expression import Expression, in_order
from .lanes import StepCode
from .resolution import as_error, excess, largest, layers
from .trace import CONSTANT, STATEFUL, TIMED, Trace


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


def traced_steps(trace: Trace, tableau: Tableau) -> StepCode:
    """Write one step of the method for a traced right-hand side."""
    levels = trace.levels()
    nodes = in_order(trace.outputs)
    once = [assignment(n, stage_namer(levels, 0, ""), CONSTANT) for n in nodes if levels[n] == CONSTANT and n.arguments]
    per_step = _scaled_coefficients(tableau)
    moments: dict[float, str] = {}
    per_lane: list[str] = []
    for stage, c in enumerate(tableau.nodes):
        if c not in moments:
            moments[c] = str(len(moments))
            per_step.append(f"t{moments[c]} = t + {c!r} * h" if c else f"t{moments[c]} = t")
            per_step += [
                assignment(n, stage_namer(levels, stage, moments[c]), TIMED)
                for n in nodes
                if levels[n] == TIMED and n.arguments
            ]
        name = stage_namer(levels, stage, moments[c])
        per_lane += _stage_states(tableau, stage, len(trace.states))
        per_lane += [assignment(n, name, STATEFUL) for n in nodes if levels[n] == STATEFUL and n.arguments]
        per_lane += [f"k{stage}_{j} = {name(e)}" for j, e in enumerate(trace.outputs)]
    per_lane += _finish(tableau, len(trace.states))
    sharp = []
    for number, (argument, scale) in enumerate(layers(trace.outputs, levels)):
        places = [stage_namer(levels, k, moments[tableau.nodes[k]])(argument) for k in apart(tableau.nodes)]
        (per_step if levels[argument] == TIMED else per_lane).extend(excess(str(number), places, scale))
        sharp.append(f"sharp{number}")
    per_lane += as_error(largest(sharp), "e0") if sharp else ()
    return StepCode(tuple(once), tuple(per_step), tuple(per_lane))


def apart(nodes: Sequence[float]) -> list[int]:
    """Return the numbers of stages in the order of their times, of those that are close together only one."""
    chosen = [0]
    for k in sorted(range(len(nodes)), key=lambda k: nodes[k]):
        if nodes[k] > nodes[chosen[-1]] + 0.1:
            chosen.append(k)
    return chosen


def called_steps(dimension: int, parameters: int, tableau: Tableau) -> StepCode:
    """Write one step that calls a compiled right-hand side ``rhs(t, x, p)`` instead of containing it."""
    record = "(" + "".join(f"p{i}, " for i in range(parameters)) + ")"
    per_step = _scaled_coefficients(tableau)
    per_lane: list[str] = []
    for stage, c in enumerate(tableau.nodes):
        state = "(" + "".join(f"s{stage}_{j}, " for j in range(dimension)) + ")"
        targets = "".join(f"k{stage}_{j}, " for j in range(dimension))
        per_lane += _stage_states(tableau, stage, dimension)
        per_lane.append(f"{targets}= defined(t + {c!r} * h, {state}, record)")
    per_lane += _finish(tableau, dimension)
    return StepCode(
        (f"record = Parameters{record}" if parameters else "record = ()",), tuple(per_step), tuple(per_lane)
    )


def stage_namer(
    levels: dict[Expression, int], stage: int | str, moment: str, state: str | None = None
) -> Callable[[Expression], str]:
    """Name nodes: per lane and stage, per stage time, or once; states are s<stage>_0, ... or <state>0, ...."""
    stem = f"s{stage}_" if state is None else state
    numbers = {node: i for i, node in enumerate(levels)}
    prefix = {CONSTANT: "c", TIMED: f"m{moment}_", STATEFUL: f"v{stage}_"}
    inputs = {
        "state": lambda i: f"{stem}{i}",
        "time": lambda _: f"t{moment}",
        "parameter": lambda i: f"p{i}",
    }
    return lambda node: input_name(node, inputs) or f"{prefix[levels[node]]}{numbers[node]}"


def _scaled_coefficients(tableau: Tableau) -> list[str]:
    return [
        f"a{stage}_{k} = h * {a!r}"
        for stage, row in enumerate((*tableau.stages, tableau.weights))
        for k, a in enumerate(row)
        if a
    ]


def _combination(prefix: str, row: tuple[float, ...], j: int) -> str:
    return dot((f"{prefix}_{k}", f"k{k}_{j}") for k, a in enumerate(row) if a)


def _stage_states(tableau: Tableau, stage: int, dimension: int) -> list[str]:
    row = tableau.stages[stage]
    if not any(row):
        return [f"s{stage}_{j} = x{j}" for j in range(dimension)]
    return [f"s{stage}_{j} = x{j} + ({_combination(f'a{stage}', row, j)})" for j in range(dimension)]


def _finish(tableau: Tableau, dimension: int) -> list[str]:
    last = f"a{len(tableau.stages)}"
    lines = [f"y{j} = x{j} + ({_combination(last, tableau.weights, j)})" for j in range(dimension)]
    for j in range(dimension):
        sums = [dot((repr(e), f"k{k}_{j}") for k, e in enumerate(row) if e) for row in tableau.errors]
        if len(sums) == 1:
            lines.append(f"e{j} = h * ({sums[0]})")
        else:
            lines += [f"f{j} = {sums[0]}", f"g{j} = {sums[1]}", f"q{j} = f{j} * f{j}"]
            lines.append(f"e{j} = h * q{j} / simd_math.sqrt(q{j} + 0.01 * (g{j} * g{j}) + 1e-290)")
    return lines
