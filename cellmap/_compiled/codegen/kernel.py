"""From plain functions to compiled lanes.

Every kernel made here has the signature that :mod:`cellmap._compiled.codegen.lanes` describes.  Kernels depend on the
text of what they compute and not on parameter values: sweeping a parameter compiles nothing.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import log10
from typing import Any

from ..for_numba import OF_USERS, ForNumba, numba, whole
from ..forking import COMPILING
from ..kernels import periods, simd_math
from ..machine_code import MachineCode
from .captured import kept
from .derivative import tangent_trace
from .emit import assignment
from .expression import UntraceableError, in_order
from .filippov import SwitchingTrace, switching_trace
from .jets import jet_trace
from .lanes import StepCode, lane_module
from .methods import Method, choose_method, taylor_method, taylor_order
from .module import module_in_memory
from .own_steps import compiled_own_steps
from .period import CompiledPeriod, compiled_period, compiled_rows
from .rebind import rebind
from .rosenbrock import OwnStepCode
from .runge_kutta import called_steps, stage_namer
from .switching import compiled_switching
from .trace import Trace, is_faithful, parameter_record, trace

Names = tuple[str, ...]
Functions = tuple[Callable[..., Any] | None, ...]
"""A right-hand side, its switching functions, and the guards and resets of its impacts, where it has any."""

_LOG = logging.getLogger("cellmap")


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
        reason = "they give other values than the function: it catches exceptions, or asks for types"
    _LOG.info("%s is compiled as it is, because its formulas are not known: %s", name, reason)
    return reason


@kept
def flow_kernel(
    rhs: Callable[..., Any], dimension: int, names: Names, method: str, rtol: float, symbolic: bool = True
) -> PeriodKernel:
    """Compile the period of a flow with a method of that name, from its trace or, if not `symbolic`, as it is."""
    traced = traced_function(rhs, dimension, names) if symbolic else None
    chosen = choose_method(method, traced, rtol)
    if traced is None:
        return finished(_called(rhs, called_steps(dimension, len(names), _tableau(chosen)), dimension, names), chosen)
    return finished(_compiled(chosen.write(traced), dimension, names), chosen)


@kept
def tangent_flow_kernel(
    rhs: Callable[..., Any], dimension: int, names: Names, rtol: float, method: str = "auto"
) -> PeriodKernel | None:
    """Compile the period of a flow with one tangent vector, 2 d components; None where derivatives are not known."""
    traced = traced_function(rhs, dimension, names)
    if traced is None or traced.has_branches:
        return None
    try:
        tangent = tangent_trace(traced)
        chosen = choose_method(method, tangent, rtol)
        return finished(_compiled(chosen.write(tangent), 2 * dimension, names), chosen)
    except UntraceableError:
        return None


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
        chosen = choose_method(method, jet, rtol)
        return finished(_compiled(chosen.write(jet), len(jet.states), names), chosen)
    except UntraceableError:
        return None


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
            traced = replace(traced, motion=tangent_trace(traced.motion))
        except UntraceableError:
            return None
    # Derivatives are needed at few points only: a lower order saves more time in compiling than it costs in steps.
    order = taylor_order(max(rtol, 1e-9) if tangent else rtol, traced.motion, (*traced.motion.outputs, *traced.events))
    advance = compiled_switching(traced, order, len(names), 10.0 ** round(log10(rtol)), one_step=tangent)
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
    function: Callable[..., Any], dimension: int, names: Names, tangent: bool, symbolic: bool = True
) -> CompiledPeriod | None:
    """Compile one application of a discrete map ``f(t, x, p)``, or of its tangent map; None without derivatives."""
    traced = traced_function(function, dimension, names) if symbolic else None
    if traced is None:
        if tangent:
            return None
        record = f"Parameters({''.join(f'p{i}, ' for i in range(len(names)))})" if names else "()"
        state = "(" + "".join(f"x{j}, " for j in range(dimension)) + ")"
        targets = "".join(f"y{j}, " for j in range(dimension))
        zeros = tuple(f"e{j} = 0.0" for j in range(dimension))
        code = StepCode((f"record = {record}",), (), (f"{targets}= defined(t, {state}, record)", *zeros))
        return _called(function, code, dimension, names)
    try:
        traced = tangent_trace(traced) if tangent else traced
    except UntraceableError:
        return None
    return _compiled(_application(traced), len(traced.outputs), names)


@kept
def discrete_jet_kernel(
    function: Callable[..., Any], dimension: int, names: Names, order: int
) -> CompiledPeriod | None:
    """Compile one application of a discrete map ``f(t, x, p)`` to curves; None where derivatives are not known."""
    traced = traced_function(function, dimension, names)
    if traced is None or traced.has_branches:
        return None
    try:
        jet = jet_trace(traced, order)
    except UntraceableError:
        return None
    return _compiled(_application(jet), len(jet.outputs), names)


@kept
def tangent_step(function: Callable[..., Any], dimension: int, names: Names) -> MachineCode | None:
    """Compile one application of a discrete map to states with a tangent vector in rows; None without derivatives.

    The function is ``step``, as :func:`cellmap._compiled.codegen.period.compiled_rows` describes it.
    """
    traced = traced_function(function, dimension, names)
    if traced is None:
        return None
    try:
        code = _application(tangent_trace(traced))
    except UntraceableError:
        return None
    return compiled_rows(code, 2 * dimension, len(names))


def _application(traced: Trace) -> StepCode:
    """Write one application of a traced map."""
    levels = traced.levels()
    name = stage_namer(levels, "", "", state="x")
    lines: tuple[list[str], ...] = ([], [], [])
    for node in in_order(traced.outputs):
        if node.arguments:
            lines[levels[node]].append(assignment(node, name, levels[node]))
    results = [f"y{j} = {name(e)}" for j, e in enumerate(traced.outputs)]
    zeros = [f"e{j} = 0.0" for j in range(len(traced.outputs))]
    return StepCode(tuple(lines[0]), tuple(lines[1]), (*lines[2], *results, *zeros))


def _compiled(code: StepCode | OwnStepCode, dimension: int, names: Names) -> CompiledPeriod:
    if isinstance(code, OwnStepCode):
        return compiled_own_steps(code, dimension, len(names))
    return compiled_period(code, dimension, len(names))


def finished(advance: CompiledPeriod, method: Method, trial: int = 1) -> PeriodKernel:
    """Return a compiled period with what its method knows about it."""
    stages = len(method.tableau.nodes) if method.tableau else 1
    if method.own_steps:
        trial = periods.PROBE
    return PeriodKernel(advance, method.name, method.estimate_order, stages, method.margin, trial, method.own_steps)


def _tableau(method: Method) -> Any:
    assert method.tableau is not None, "only traced right-hand sides have series"
    return method.tableau


def _called(function: Callable[..., Any], code: StepCode, dimension: int, names: Names) -> CompiledPeriod:
    """Compile lanes that call an untraceable function, with vectorisable functions in the place of those of math."""
    text = lane_module(code, dimension, len(names))
    table = {name: f for name, f in vars(simd_math).items() if isinstance(f, ForNumba)}
    table |= simd_math.WITHOUT_CALLS | {"int": ForNumba(whole)}
    try:
        with COMPILING:
            scope = {"rhs": rebind(function, table, numba().njit(**OF_USERS)), "Parameters": parameter_record(names)}
            advance = module_in_memory(text, f"cellmap_{function!r}", **scope).advance
    except Exception as error:
        found = _traced(function, dimension, names)
        raise TypeError(
            f"{function!r} cannot be compiled: write it with plain arithmetic, functions of math, tuples, and branches "
            f"on numbers. {f'Its formulas are not known: {found}. ' if isinstance(found, str) else ''}"
            f"The compiler says: {_first_sentence(error)}"
        ) from error
    return CompiledPeriod(advance.address, advance)


def _first_sentence(error: Exception) -> str:
    """Return the line of a compiler's message that says what is wrong, without the frames in which it was found."""
    lines = [line.strip() for line in str(error).splitlines()]
    return next((line for line in lines if line and not line.startswith("Failed in")), type(error).__name__)
