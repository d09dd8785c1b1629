"""From plain functions to compiled lanes.

Every kernel made here has the signature that :mod:`cellmap._compiled.codegen.period` describes.  Kernels depend on the
text of what they compute and not on parameter values: sweeping a parameter compiles nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import log10
from typing import TYPE_CHECKING, Any

import numpy as np

from ..._lib.arrays import Floats
from ..kernels import periods
from ..machine_code import MachineCode
from .captured import kept
from .derivative import frame_traces, jet_trace
from .emit import evaluate, inputs
from .evaluation import evaluated
from .expression import UntraceableError, in_order
from .filippov import SwitchingTrace, switching_trace
from .growing_loops import check_lengths
from .in_memory import compiled_in_memory
from .instructions import Instructions, Value
from .methods import LARGE, MOST_WORK, Method, choose_method, series_work, taylor_method, taylor_order
from .own_steps import compiled_own_steps
from .period import CompiledPeriod, PerLane, PerStep, Step, Values, compiled_period, compiled_rows, relative_errors
from .runge_kutta import called_steps
from .switching import compiled_switching
from .trace import CONSTANT, STATEFUL, TIMED, Trace, as_state, is_faithful, parameter_record, trace
from .untraced import Prepared, compiled_untraced, single_call

if TYPE_CHECKING:
    from .enclosures import CompiledEnclosure

Names = tuple[str, ...]
Functions = tuple[Callable[..., Any] | None, ...]
"""A right-hand side, its switching functions, and the guards and resets of its impacts, where it has any."""

_OTHER_VALUES = (
    "they give other values than the function: it catches exceptions, or asks for types. Take `try` and `isinstance` "
    "out of it"
)
_OF_MANY_STEPS = 0.05  # of the tolerance of a step, for derivatives: at a low order steps are many, and errors add up


@dataclass(frozen=True, eq=False)
class PeriodKernel:
    """A compiled period.

    ``advance`` is the compiled function, ``estimate_order`` the order at which its error estimate shrinks, ``stages``
    the right-hand sides (or series) a step, ``margin(tolerance)`` how far the estimate has to stay below a tolerance,
    ``trial`` the number of steps that asks for one step whose error alone is wanted.  With ``own_steps`` it is called
    as :mod:`cellmap._compiled.codegen.own_steps` says.
    """

    advance: CompiledPeriod
    method: str
    estimate_order: int
    stages: int
    margin: Callable[[float], float]
    trial: int = 1
    own_steps: bool = False


def traced_function(function: Callable[..., Any], dimension: int, names: Names) -> Trace | None:
    """Trace a function once; None where it cannot be traced."""
    found = _traced(function, dimension, names)
    return found if isinstance(found, Trace) else None


def why_untraced(function: Callable[..., Any], dimension: int, params: Mapping[str, float]) -> str:
    """Return the reason why the formulas of a function are not known; empty if they are."""
    return _why_untraced(function, dimension, tuple(params), tuple(params.values()))


@kept
def _traced(function: Callable[..., Any], dimension: int, names: Names) -> Trace | str:
    try:
        return trace(function, dimension, names)
    except UntraceableError as error:
        return str(error)


@kept
def _why_untraced(function: Callable[..., Any], dimension: int, names: Names, values: tuple[float, ...]) -> str:
    traced, name = _traced(function, dimension, names), getattr(function, "__qualname__", type(function).__name__)
    if isinstance(traced, str):
        reason = traced
    elif is_faithful(traced, function, values, parameter_record(names)(*values)):
        return ""
    else:
        reason = _OTHER_VALUES
    check_lengths(name, function, dimension, parameter_record(names)(*values))
    return reason


def over_states(function: Callable[..., Any], times: Any, states: Floats, params: Mapping[str, Any]) -> Floats:
    """Return the values (..., components) of ``f(t, x, p)`` at states (..., dimension) and times that broadcast.

    Parameters may be arrays as well.  Formulas are evaluated over arrays; of what has none there is a call for each.
    """
    names, columns = tuple(params), np.moveaxis(states, -1, 0)
    inputs = np.broadcast_arrays(times, *columns, *params.values())
    first = [float(v.flat[0]) if v.size else 0.0 for v in inputs[1 + len(columns) :]]
    traced = traced_function(function, len(columns), names)
    if traced is not None and is_faithful(traced, function, tuple(first), parameter_record(names)(*first)):
        places = dict(zip((traced.time, *traced.states, *traced.parameters), inputs, strict=True))
        found: Sequence[Any] = np.broadcast_arrays(inputs[0], *evaluated(traced.outputs, places))[1:]
    else:
        rows = [(t, x[: len(columns)], x[len(columns) :]) for t, *x in zip(*(v.flat for v in inputs), strict=True)]
        values = [np.atleast_1d(function(t, as_state(function, x), parameter_record(names)(*p))) for t, x, p in rows]
        found = [np.reshape(column, inputs[0].shape) for column in zip(*values, strict=True)]
    return np.stack(found, axis=-1)


@kept
def flow_kernel(
    rhs: Callable[..., Any], dimension: int, names: Names, method: str, rtol: float, symbolic: bool = True
) -> PeriodKernel:
    """Compile the period of a flow with a method of that name, from its trace or, if not `symbolic`, as it is."""
    traced = traced_function(rhs, dimension, names) if symbolic else None
    large = dimension > LARGE
    chosen = choose_method(method, traced, rtol, large, MOST_WORK)
    if traced is None:
        tableau = chosen.tableau
        assert tableau is not None, "only traced right-hand sides have series"
        return finished(_called(rhs, lambda prepared: called_steps(prepared, tableau), dimension, names), chosen)
    return finished(compiled_steps(chosen, traced, len(names), large), chosen)


@kept
def jet_flow_kernel(
    rhs: Callable[..., Any], dimension: int, names: Names, rtol: float, order: int, method: str = "auto"
) -> PeriodKernel | None:
    """Compile the period of a flow along curves, (order + 1) d components; None where derivatives are not known."""
    traced = traced_function(rhs, dimension, names)
    if traced is None or traced.has_branches:
        return None
    try:
        jet = jet_trace(traced, order)
        large = dimension > LARGE
        chosen = choose_method(method, jet, rtol, large)
        # Higher derivatives are needed at few points only: to compile well takes longer than all of their steps.
        return finished(compiled_steps(chosen, jet, len(names), large, quick=order > 1), chosen)
    except UntraceableError:
        return None


@kept
def frame_kernel(rhs: Callable[..., Any], dimension: int, names: Names, rtol: float) -> tuple[PeriodKernel, int] | None:
    """Compile the period of a flow with tangent vectors beside each state; return it with their number.

    There are as many as a lane has room for, at most one for each coordinate.  Their errors are relative to their
    lengths, see :func:`relative_errors`.  The method is that of the states alone.  None where derivatives are not
    known.
    """
    traced = traced_function(rhs, dimension, names)
    if traced is None or traced.has_branches:
        return None
    method = choose_method("auto", traced, rtol, dimension > LARGE)
    vectors = vectors_in_a_lane(dimension, method)
    try:
        frames = frame_traces(traced, vectors) if vectors > 1 else [jet_trace(traced, 1)]
    except UntraceableError:
        return None
    least = min(frames, key=lambda found: (series_work(found), len(in_order(found.outputs))))
    if dimension > LARGE and method.tableau is not None:
        return finished(compiled_in_memory(least, method.tableau, dimension), method), vectors
    write: Any = method.write
    method = replace(method, write=lambda trace: relative_errors(write(trace), dimension))
    return finished(compiled_steps(method, least, len(names)), method), vectors


@kept
def stiff_frame_kernel(
    rhs: Callable[..., Any], dimension: int, names: Names, rtol: float, vectors: int
) -> PeriodKernel:
    """Compile the period of a flow with as many vectors beside each state by the method for stiff systems.

    Errors are those of components: a vector that a stiff flow forgets has no relative error.
    """
    traced = traced_function(rhs, dimension, names)
    assert traced is not None, "its derivatives are known"
    method = choose_method("Rosenbrock", traced, rtol)
    return finished(compiled_steps(method, frame_traces(traced, vectors)[0], len(names)), method)


_MOST_COMPONENTS = {"Taylor": 24}
_MOST_OF_STAGES = 48


def vectors_in_a_lane(dimension: int, method: Method) -> int:
    """Return how many tangent vectors share a lane with their state, so that lanes are as full as they may be.

    Further vectors share the work on the state, until what a step has at hand leaves the first cache: series of some
    24 components, stages of some 48.  Beyond, code would take long to compile besides.  So all vectors of systems of up
    to 4 (Taylor) or 6 (Runge-Kutta) states are in one lane, and from 9 or 17 states on each has a lane of its own.

    Examples
    --------
    >>> from cellmap._compiled.codegen.methods import taylor_method
    >>> [vectors_in_a_lane(d, taylor_method(15)) for d in (1, 2, 4, 5, 6, 8, 9, 200)]
    [1, 2, 4, 3, 3, 2, 1, 1]
    """
    most = _MOST_COMPONENTS.get(method.name, _MOST_OF_STAGES) // dimension - 1
    lanes = -(-dimension // max(1, min(most, dimension)))
    return -(-dimension // lanes)


@kept
def switching_kernel(
    functions: Functions, dimension: int, names: Names, rtol: float, tangent: bool
) -> PeriodKernel | None:
    """Compile the period of a right-hand side with its switching functions and branches; None if untraceable.

    With `tangent` it carries one tangent vector, 2 d components.
    """
    traced = traced_switching(functions, dimension, names)
    if isinstance(traced, str) or not traced.is_analytic:
        return None
    if tangent:
        try:
            traced = replace(traced, motion=jet_trace(traced.motion, 1))
        except UntraceableError:
            return None
    # Derivatives are needed at few points only: a lower order saves more time in compiling than it costs in steps.
    order = taylor_order(max(rtol, 1e-9) if tangent else rtol, traced.motion, (*traced.motion.outputs, *traced.events))
    tolerance = 10.0 ** round(log10(rtol)) * (_OF_MANY_STEPS if tangent else 1.0)
    advance = compiled_switching(traced, order, len(names), tolerance, one_step=tangent)
    return finished(advance, taylor_method(order), trial=0)


@kept
def traced_switching(functions: Functions, dimension: int, names: Names) -> SwitchingTrace | str:
    """Trace a right-hand side with its switching functions and branches once; where that fails, return the reason."""
    try:
        rhs, switches, *impacts = functions
        assert rhs is not None
        return switching_trace(rhs, switches, dimension, names, *impacts)
    except UntraceableError as error:
        return str(error)


@kept
def discrete_kernel(
    function: Callable[..., Any],
    dimension: int,
    names: Names,
    order: int,
    symbolic: bool = True,
    only_smooth: bool = False,
) -> CompiledPeriod | None:
    """Compile one application of a discrete map ``f(t, x, p)`` to states, or to curves up to derivatives of an order.

    None where derivatives are not known, or, if `only_smooth`, where the map has branches.
    """
    traced = traced_function(function, dimension, names) if symbolic else None
    if traced is None:
        return None if order else _called(function, single_call, dimension, names)
    if only_smooth and traced.has_branches:
        return None
    try:
        traced = jet_trace(traced, order)
    except UntraceableError:
        return None
    return compiled_period(application(traced), len(traced.outputs), len(names), quick=order > 1)


@kept
def tangent_step(function: Callable[..., Any], dimension: int, names: Names) -> MachineCode | None:
    """Compile one application of a discrete map to states with a tangent vector in rows; None without derivatives.

    The function is ``step``, as :func:`cellmap._compiled.codegen.period.compiled_rows` describes it.
    """
    traced = traced_function(function, dimension, names)
    if traced is None:
        return None
    try:
        step = application(jet_trace(traced, 1))
    except UntraceableError:
        return None
    return compiled_rows(step, 2 * dimension, len(names))


@kept
def map_enclosure(function: Callable[..., Any], dimension: int, names: Names) -> CompiledEnclosure:
    """Compile the enclosure of a discrete map whose formulas are known.

    Raises
    ------
    UntraceableError
        For functions without enclosures.
    """
    from .enclosures import discrete_enclosure

    traced = traced_function(function, dimension, names)
    assert traced is not None, "the formulas are known"
    return discrete_enclosure(traced, len(names))


@kept
def period_enclosure(
    rhs: Callable[..., Any], dimension: int, names: Names, order: int, second: bool
) -> CompiledEnclosure:
    """Compile the enclosure of a flow whose formulas are known, with series of an order and second derivatives or not.

    Raises
    ------
    UntraceableError
        For functions without enclosures.
    """
    from .flow_enclosures import flow_enclosure

    traced = traced_function(rhs, dimension, names)
    assert traced is not None, "the formulas are known"
    return flow_enclosure(traced, len(names), order, second)


def application(traced: Trace) -> Step:
    """Return the step that is one application of a traced map, whose errors are zero."""
    levels = traced.levels()
    of_level = [[n for n in levels if levels[n] == level] for level in (CONSTANT, TIMED, STATEFUL)]

    def step(out: Instructions, p: Values) -> PerStep:
        once = evaluate(out, of_level[CONSTANT], inputs(out, levels, parameter=p), CONSTANT)

        def per_step(t: Value, h: Value) -> PerLane:
            timed = evaluate(out, of_level[TIMED], {**once, traced.time: t}, TIMED)

            def per_lane(x: Values) -> tuple[Values, Values]:
                known = timed | dict(zip(traced.states, x, strict=True))
                known = evaluate(out, of_level[STATEFUL], known, STATEFUL)
                return [known[e] for e in traced.outputs], [out.number(0.0)] * len(x)

            return per_lane

        return per_step

    return step


def compiled_steps(
    method: Method, traced: Trace, parameters: int, large: bool = False, quick: bool = False
) -> CompiledPeriod:
    """Compile the period of a traced right-hand side by a method, for a `large` system with its states in memory.

    With `quick` values of other systems stay in memory as well, see :func:`machine_code`.
    """
    if large and method.tableau is not None:
        return compiled_in_memory(traced, method.tableau)
    step: Any = method.write(traced)
    frame = compiled_own_steps if method.own_steps else compiled_period
    return frame(step, len(traced.states), parameters, quick)


def finished(advance: CompiledPeriod, method: Method, trial: int = 1) -> PeriodKernel:
    """Return a compiled period with the properties of its method."""
    stages = len(method.tableau.nodes) if method.tableau else 1
    if method.own_steps:
        trial = periods.PROBE
    return PeriodKernel(advance, method.name, method.estimate_order, stages, method.margin, trial, method.own_steps)


def _called(
    function: Callable[..., Any], write: Callable[[Prepared], Step], dimension: int, names: Names
) -> CompiledPeriod:
    """Compile steps that call an untraceable function."""
    try:
        return compiled_untraced(function, write, dimension, names)
    except TypeError as error:
        found = _traced(function, dimension, names)
        unknown = f"Its formulas are not known: {found if isinstance(found, str) else _OTHER_VALUES}. "
        raise TypeError(
            f"{getattr(function, '__qualname__', function)} cannot be compiled: write it with plain arithmetic, "
            f"functions of math, tuples, and branches on numbers. {unknown}The compiler says: {error}"
        ) from error
