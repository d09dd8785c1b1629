"""Steps of an L-stable Rosenbrock method, as straight-line code, each lane with a step of its own.

A stage solves a linear system with the matrix W = 1/(gamma h) - J, where J is the Jacobian of the right-hand side: its
formulas are those of the trace, and so are the eliminations of W, without what vanishes.  No pivots are sought: a poor
one spoils the estimate of the error too, and the step is refused.

Errors that an orbit brings along pass a step by a rational function of h J that is close to exp(h J), with powers of
the matrix that is at hand: what a stiff flow forgets does not count.
"""

from __future__ import annotations

from collections.abc import Callable

from .derivative import along
from .emit import Known, evaluate, inputs
from .expression import Expression, in_order
from .instructions import Instructions, Value, dot
from .period import Values
from .resolution import as_error, excess, layers
from .runge_kutta import apart
from .trace import CONSTANT, STATEFUL, Trace

GAMMA = 0.21193756319429014
_NODES = (0.0, 0.6358126895828704, 0.4095798393397535, 0.9769306725060716, 0.4288403609558664, 1.0, 1.0, 1.0)
_TIME = (0.21193756319429014, -0.42387512638858027, -0.3384627126235924, 1.8046452872882734, 2.325825639765069)
_STAGES: tuple[tuple[float, ...], ...] = (
    (),
    (3.0,),
    (2.849394379747939, 0.45842242204463923),
    (-6.954028509809101, 2.489845061869568, -10.358996098473584),
    (2.8029986275628964, 0.5072464736228206, -0.3988312541770524, -0.04721187230404641),
    (-7.502846399306121, 2.561846144803919, -11.627539656261098, -0.18268767659942256, 0.030198172008377946),
)
_COUPLINGS: tuple[tuple[float, ...], ...] = (
    (),
    (-14.155112264123755,),
    (-17.97296035885952, -2.859693295451294),
    (147.12150275711716, -1.41221402718213, 71.68940251302358),
    (165.43517024871676, -0.4592823456491126, 42.90938336958603, -5.961986721573306),
    (24.854864614690072, -3.0009227002832186, 47.4931110020768, 5.5814197821558125, -0.6610691825249471),
    (
        30.91273214028599, -3.1208243349937974, 77.79954646070892, 34.28646028294783, -19.097331116725623,
        -28.087943162872662,
    ),
    (
        37.80277123390563, -3.2571969029072276, 112.26918849496327, 66.9347231244047, -40.06618937091002,
        -54.66780262877968, -9.48861652309627,
    ),
)  # fmt: skip
"""Coefficients of Rodas5P (Steinebach, BIT Numerical Mathematics 63 (2023) 27), in the form that needs no products with
the Jacobian.  The last two stages, and the step, add the stage before to the arguments of the one before."""

_PASSAGE = (-0.0236009746822688, -1.6711688053433813, 2.69476978002565)
"""Weights c_i of the sum of c_i / (1 - gamma z)^i that is exp(z) to order 2, bounded by 1 in the left half plane."""


OwnStepOfLane = Callable[[Value, Value, Values, Values], tuple[Values, Values, Values]]
OwnStep = Callable[[Instructions, Values], OwnStepOfLane]
"""Writer of one step of each lane's own size: two functions, the first of which returns the second.

The first is given the parameters and writes what runs before everything.  The second is given a time, the size of a
step, the state and the errors that an orbit brings along.  It returns the state after the step, estimates of the local
error of the method of one order less, and what becomes of the errors that were brought along.
"""


def rosenbrock_steps(trace: Trace) -> OwnStep:
    """Return one step of the method for a traced right-hand side.

    Raises
    ------
    UntraceableError
        Where a derivative is not known.
    """
    graph, size = trace.graph, len(trace.states)
    one = graph.constant(1.0)
    columns = [along(graph, trace.outputs, {state: one}) for state in trace.states]
    of_time = along(graph, trace.outputs, {trace.time: one})
    slopes = [columns[k][j] for j in range(size) for k in range(size)]
    levels = {n: STATEFUL if level else CONSTANT for n, level in _levels(trace, (*slopes, *of_time)).items()}
    constant, stateful = ([n for n in levels if levels[n] == level] for level in (CONSTANT, STATEFUL))
    in_stages = [n for n in in_order(trace.outputs) if levels[n]]
    arguments = layers(trace.outputs, levels)
    last = len(_COUPLINGS) - 1

    def step(out: Instructions, p: Values) -> OwnStepOfLane:
        once = evaluate(out, constant, inputs(out, levels, parameter=p), CONSTANT)

        def per_lane(t: Value, h: Value, x: Values, before: Values) -> tuple[Values, Values, Values]:
            per_time = 1.0 / h
            g = per_time * (1.0 / GAMMA)
            stages: list[Known] = []
            k: list[Values] = []

            def at(time: Value, state: Values, nodes: list[Expression]) -> Values:
                known = once | inputs(out, [trace.time], time={None: time})
                stages.append(evaluate(out, nodes, known | dict(zip(trace.states, state, strict=True)), STATEFUL))
                return [stages[-1][e] for e in trace.outputs]

            state, rates = x, at(t, x, stateful)
            drift = [None if e.vanishes else h * stages[0][e] for e in of_time]
            rows = [slopes[j * size : (j + 1) * size] for j in range(size)]
            matrix = _Elimination(g, [[None if e.vanishes else stages[0][e] for e in row] for row in rows])
            for stage in range(last + 1):
                if stage:
                    state = _arguments(stage, x, state, k)
                    rates = at(t + _NODES[stage] * h, state, in_stages)
                right = list(rates)
                for j in range(size):
                    known = dot((c, row[j]) for c, row in zip(_COUPLINGS[stage], k, strict=True))
                    push = drift[j]
                    if known is not None:
                        right[j] = right[j] + per_time * known
                    if stage < len(_TIME) and push is not None:
                        right[j] = right[j] + _TIME[stage] * push
                k.append(matrix.solution(right))
            after = [a + b for a, b in zip(state, k[last], strict=True)]
            seen = apart(_NODES)
            sharp = [excess([stages[n][argument] for n in seen], scale) for argument, scale in arguments]
            errors = [as_error(sharp, k[last][0]), *k[last][1:]]
            powers = [before]
            for _ in _PASSAGE:
                powers.append(matrix.solution([g * q for q in powers[-1]]))
            passed = [dot((c, q[j]) for c, q in zip(_PASSAGE, powers[1:], strict=True)) for j in range(size)]
            return after, errors, [b for b in passed if b is not None]

        return per_lane

    return step


def _levels(trace: Trace, further: tuple[Expression, ...]) -> dict[Expression, int]:
    """Return what each expression of a trace, and of some more, depends on."""
    return Trace(trace.graph, trace.states, trace.time, trace.parameters, (*trace.outputs, *further)).levels()


def _arguments(stage: int, x: Values, before: Values, k: list[Values]) -> Values:
    """Write the state at which a stage evaluates the right-hand side."""
    if stage >= len(_STAGES):
        return [state + move for state, move in zip(before, k[-1], strict=True)]
    rows = [[(a, row[j]) for a, row in zip(_STAGES[stage], k, strict=True)] for j in range(len(x))]
    return [state + change for state, row in zip(x, rows, strict=True) if (change := dot(row)) is not None]


class _Elimination:
    """Gaussian elimination of the matrix g - J, written out without what vanishes (None)."""

    def __init__(self, g: Value, slopes: list[list[Value | None]]) -> None:
        size = len(slopes)
        self.factors: dict[tuple[int, int], Value] = {}
        w = self.factors
        for j, row in enumerate(slopes):
            for k, slope in enumerate(row):
                if slope is not None:
                    w[j, k] = g - slope if j == k else -slope
                elif j == k:
                    w[j, k] = g
        self.pivots: list[Value] = []
        for i in range(size):
            self.pivots.append(1.0 / w[i, i])
            for j in range(i + 1, size):
                if (j, i) in w:
                    w[j, i] = w[j, i] * self.pivots[i]
                    for k in range(i + 1, size):
                        if (i, k) in w:
                            w[j, k] = w[j, k] - w[j, i] * w[i, k] if (j, k) in w else -w[j, i] * w[i, k]

    def solution(self, right: Values) -> list[Value]:
        """Write the solution for a right side."""
        size, w, below = len(right), self.factors, list(right)
        for j in range(size):
            known = dot((w[j, k], below[k]) for k in range(j) if (j, k) in w)
            if known is not None:
                below[j] = below[j] - known
        found = dict[int, Value]()
        for j in reversed(range(size)):
            known = dot((w[j, k], found[k]) for k in range(j + 1, size) if (j, k) in w)
            found[j] = (below[j] if known is None else below[j] - known) * self.pivots[j]
        return [found[j] for j in range(size)]
