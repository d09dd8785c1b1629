"""Functions whose formulas cannot be traced: numba compiles them as they are, and steps call them by their address.

Numba takes half a second to be imported; it is imported when such a function is compiled.
"""

from __future__ import annotations

import importlib
import math
import operator
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ..forking import COMPILING
from ..machine_code import vector_width
from .expression import SUM_OF_COMPARISONS, ComparisonError
from .instructions import Instructions, Value
from .period import CompiledPeriod, PerStep, Step, Values, compiled_period
from .rebind import rebind, uses_numpy
from .runge_kutta import Call
from .trace import parameter_record

Prepared = Callable[[Instructions], Call]

OF_USERS: dict[str, Any] = {
    "error_model": "python", "fastmath": {"contract"}, "boundscheck": True, "forceinline": True,
}  # fmt: skip
"""Options of the compiler: what Python raises these functions raise, for ``1 // 0`` and beyond the end of an array too.

``fastmath={"contract"}`` allows fused multiply-add and nothing else: full fastmath would delete tests for NaN.
"""

_FUNCTION = "void(f8, CPointer(f8), CPointer(f8), CPointer(f8), i8)"
"""Numba's signature of a function of time, states and parameters, which writes its values to the last address.

The number of lanes is an argument: a loop that is not written out computes once what is the same in all of them."""


def compiled_untraced(
    function: Callable[..., Any], write: Callable[[Prepared], Step], dimension: int, names: tuple[str, ...]
) -> CompiledPeriod:
    """Compile the period of steps that call a function, written by how such calls are prepared.

    Raises
    ------
    TypeError
        Where numba cannot compile it, with the reason.
    """
    with COMPILING:
        try:
            called = _compiled(function, dimension, names)
        except ComparisonError:
            raise
        except Exception as error:
            raise TypeError(_first_sentence(error)) from error
    step = write(lambda out: _prepared(out, dimension))
    advance = compiled_period(step, dimension, len(names))
    return replace(advance, code=(advance.code, called), context=np.array([called.address]))


def single_call(prepared: Prepared) -> Step:
    """Return the step that is one application of a function, whose errors are zero."""

    def step(out: Instructions, p: Values) -> PerStep:
        images = prepared(out)
        return lambda t, h: lambda x: (images(t, x), [out.number(0.0)] * len(x))

    return step


def _prepared(out: Instructions, dimension: int) -> Call:
    """Write what calls of the function whose address is in the context need; return what writes a call."""
    inputs, outputs = out.array(dimension * out.width), out.array(dimension * out.width)
    function = out.result(f"inttoptr i64 {out.load_whole('%context')} to ptr").text

    def call(t: Value, x: Values) -> list[Value]:
        for j, state in enumerate(x):
            out.store(out.as_vector(state), out.address(inputs, j * out.width))
        out.write(f"call void {function}(double {t.text}, ptr {inputs}, ptr %p, ptr {outputs}, i64 {out.width})")
        return [out.load(out.address(outputs, j * out.width), vector=True) for j in range(dimension)]

    return call


def _compiled(function: Callable[..., Any], dimension: int, names: tuple[str, ...]) -> Any:
    """Return a function of C for the states of a vector of lanes; NaN where that of the user raises an exception."""
    numba = importlib.import_module("numba")
    compiler, width = numba.njit(**OF_USERS), vector_width()
    # Whole parts of huge numbers stay numbers: those of math are whole numbers of 64 bits.
    table = {"int": compiler(_whole), "round": compiler(_nearest), "floor": np.floor, "state": tuple}
    values, places = [f"y{j}" for j in range(dimension)], [f"i + {j * width}" for j in range(dimension)]
    state = "".join(f"x[{place}], " for place in places)
    # Read before the loop, lest they seem to change with what is written in it.
    given = f"Parameters({''.join(f'p[{i}], ' for i in range(len(names)))})" if names else "()"
    # A function of its own: of the exceptions in one loop, compiled code of Python 3.13 catches the first alone.
    lines = [
        "def caught(t, x, parameters):",
        "    try:",
        f"        {', '.join(values)}, = rhs(t, x, parameters)",
        "    except Exception:",
        f"        {' = '.join(values)} = nan",
        f"    return {', '.join(values)},",
        "def called(t, x, p, y, lanes):",
        f"    parameters = {given}",
        "    for i in range(lanes):",
        f"        {', '.join(values)}, = caught(t, ({state}), parameters)",
        *(f"        y[{place}] = {value}" for place, value in zip(places, values, strict=True)),
    ]
    made: list[Any] = []

    def kept(copy: Any) -> Any:
        made.append(compiler(copy))
        return made[-1]

    scope = {"rhs": rebind(function, table, kept), "Parameters": parameter_record(names), "nan": math.nan}
    exec("\n".join(lines), scope)  # the text is our own, never a user's
    scope["caught"] = numba.njit(error_model="numpy", forceinline=True)(scope["caught"])
    called = numba.cfunc(_FUNCTION, error_model="numpy")(scope["called"])
    versions = [version.type_annotation for f in made for version in f.overloads.values()]
    if uses_numpy(function) and any(_adds_truth_values(numba, types) for types in versions):
        raise ComparisonError(SUM_OF_COMPARISONS)
    return called


def _adds_truth_values(numba: Any, types: Any) -> bool:
    """Tell whether a compiled function adds two comparisons, which it does as Python's numbers do."""
    return any(
        getattr(call, "op", "") == "binop"
        and call.fn in {operator.add, operator.sub}
        and all(isinstance(types.typemap[side.name], numba.types.Boolean) for side in (call.lhs, call.rhs))
        for call in types.calltypes
    )


def _whole(x: Any) -> int:
    """Stand for ``int`` in compiled functions, whose whole numbers have 64 bits."""
    if not abs(x) < 2.0**63:
        raise OverflowError("a whole number is larger than 2**63")
    return int(x)


def _nearest(x: Any, digits: int | None = None) -> Any:
    """Stand for ``round`` in compiled functions: of NaN there is no nearest whole number."""
    if digits is None:
        if not abs(x) < 2.0**63:
            raise OverflowError("a whole number is larger than 2**63")
        return round(x)
    return round(x, digits)


def _first_sentence(error: Exception) -> str:
    """Return the line of a compiler's message that says what is wrong, without the frames in which it was found."""
    lines = [line.strip() for line in str(error).splitlines()]
    return next((line for line in lines if line and not line.startswith("Failed in")), type(error).__name__)
