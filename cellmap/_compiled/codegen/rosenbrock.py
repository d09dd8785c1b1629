"""Steps of an L-stable Rosenbrock method, as straight-line code, each lane with a step of its own.

A stage solves a linear system with the matrix W = 1/(gamma h) - J, where J is the Jacobian of the right-hand side: its
formulas are those of the trace, and so are the eliminations of W, without what vanishes.  No pivots are sought: a poor
one spoils the estimate of the error too, and the step is refused.

Errors that an orbit brings along pass a step by a rational function of h J that is close to exp(h J), with powers of
the matrix that is at hand: what a stiff flow forgets does not count.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from .derivative import along
from .emit import assignment, dot
from .expression import Expression, in_order
from .resolution import as_error, excess, largest, layers
from .runge_kutta import apart, stage_namer
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


@dataclass(frozen=True)
class OwnStepCode:
    """Source lines of one step of each lane's own size.

    ``once`` runs before everything.  ``per_lane`` turns the state x0, x1, ... at the time t, with the step h, into y0,
    y1, ..., leaves in e0, e1, ... estimates of the local error of the method of one order less, and turns the errors
    a0, a1, ... that an orbit brings along into b0, b1, ....
    """

    once: tuple[str, ...]
    per_lane: tuple[str, ...]


def rosenbrock_steps(trace: Trace) -> OwnStepCode:
    """Write one step of the method for a traced right-hand side.

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
    once = [assignment(n, stage_namer(levels, 0, ""), CONSTANT) for n in levels if not levels[n] and n.arguments]
    lines = ["t0 = t", *(f"s0_{j} = x{j}" for j in range(size)), "rh = 1.0 / h", f"g = rh * {1.0 / GAMMA!r}"]
    name = stage_namer(levels, 0, "0")
    lines += [assignment(n, name, STATEFUL) for n in levels if levels[n] and n.arguments]
    lines += [f"f0_{j} = {name(e)}" for j, e in enumerate(trace.outputs)]
    lines += [f"ft{j} = h * {name(e)}" for j, e in enumerate(of_time) if not e.vanishes]
    matrix = _Elimination(size)
    lines += matrix.factors(
        [["" if e.vanishes else name(e) for e in slopes[j * size : (j + 1) * size]] for j in range(size)]
    )
    last = len(_COUPLINGS) - 1
    for stage in range(last + 1):
        if stage:
            lines += _arguments(stage, size)
            name = stage_namer(levels, stage, str(stage))
            lines.append(f"t{stage} = t + {_NODES[stage]!r} * h")
            lines += [assignment(n, name, STATEFUL) for n in in_order(trace.outputs) if levels[n] and n.arguments]
            lines += [f"f{stage}_{j} = {name(e)}" for j, e in enumerate(trace.outputs)]
        for j in range(size):
            known = dot((repr(c), f"k{i}_{j}") for i, c in enumerate(_COUPLINGS[stage]))
            moves = stage < len(_TIME) and not of_time[j].vanishes
            terms = [f"f{stage}_{j}", f"rh * ({known})" if known else "", f"{_TIME[stage]!r} * ft{j}" if moves else ""]
            lines.append(f"r{j} = {' + '.join(filter(None, terms))}")
        lines += matrix.solution("r", f"k{stage}_")
    lines += [f"y{j} = s{last}_{j} + k{last}_{j}" for j in range(size)]
    lines += [f"e{j} = k{last}_{j}" for j in range(size)]
    sharp = []
    for number, (argument, scale) in enumerate(layers(trace.outputs, levels)):
        places = [stage_namer(levels, k, str(k))(argument) for k in apart(_NODES)]
        lines += excess(str(number), places, scale)
        sharp.append(f"sharp{number}")
    lines += as_error(largest(sharp), "e0") if sharp else ()
    for power in range(len(_PASSAGE)):
        source = f"q{power - 1}_" if power else "a"
        lines += [f"r{j} = g * {source}{j}" for j in range(size)]
        lines += matrix.solution("r", f"q{power}_")
    lines += [f"b{j} = {dot((repr(c), f'q{i}_{j}') for i, c in enumerate(_PASSAGE))}" for j in range(size)]
    return OwnStepCode(tuple(once), tuple(lines))


def _levels(trace: Trace, further: tuple[Expression, ...]) -> dict[Expression, int]:
    """Return what each expression of a trace, and of some more, depends on."""
    return Trace(trace.graph, trace.states, trace.time, trace.parameters, (*trace.outputs, *further)).levels()


def _arguments(stage: int, size: int) -> Iterator[str]:
    """Write the state at which a stage evaluates the right-hand side."""
    for j in range(size):
        if stage < len(_STAGES):
            yield f"s{stage}_{j} = x{j} + ({dot((repr(a), f'k{i}_{j}') for i, a in enumerate(_STAGES[stage]))})"
        else:
            yield f"s{stage}_{j} = s{stage - 1}_{j} + k{stage - 1}_{j}"


class _Elimination:
    """Gaussian elimination of the matrix g - J, written out without what vanishes."""

    def __init__(self, size: int) -> None:
        self.size = size
        self.filled: set[tuple[int, int]] = set()

    def factors(self, slopes: list[list[str]]) -> Iterator[str]:
        """Write the factors, in the names w<row>_<column>, with reciprocals of pivots in v<row>."""
        for j, row in enumerate(slopes):
            for k, slope in enumerate(row):
                if j == k or slope:
                    self.filled.add((j, k))
                    yield f"w{j}_{k} = {'g' if j == k else ''}{f' - {slope}' if slope else ''}"
        for i in range(self.size):
            yield f"v{i} = 1.0 / w{i}_{i}"
            for j in range(i + 1, self.size):
                if (j, i) in self.filled:
                    yield f"w{j}_{i} = w{j}_{i} * v{i}"
                    for k in range(i + 1, self.size):
                        if (i, k) in self.filled:
                            before = f"w{j}_{k} - " if (j, k) in self.filled else "-"
                            self.filled.add((j, k))
                            yield f"w{j}_{k} = {before}w{j}_{i} * w{i}_{k}"

    def solution(self, right: str, unknown: str) -> Iterator[str]:
        """Write the solution for a right side that is overwritten."""
        for j in range(self.size):
            known = dot((f"w{j}_{k}", f"{right}{k}") for k in range(j) if (j, k) in self.filled)
            if known:
                yield f"{right}{j} = {right}{j} - ({known})"
        for j in reversed(range(self.size)):
            known = dot((f"w{j}_{k}", f"{unknown}{k}") for k in range(j + 1, self.size) if (j, k) in self.filled)
            yield f"{unknown}{j} = ({right}{j}{f' - ({known})' if known else ''}) * v{j}"
