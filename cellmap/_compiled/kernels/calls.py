"""Calls of generated functions by their addresses, from loops that are compiled once for all of them."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

_NUMBERS, _WHOLE_NUMBERS = types.CPointer(types.float64), types.CPointer(types.int64)
PERIOD = types.void(
    _WHOLE_NUMBERS, _NUMBERS, _WHOLE_NUMBERS, types.float64, types.float64, _NUMBERS, _NUMBERS, types.int64
)
"""Signature of a period: ``advance(context, x, steps, start, period, p, error, blocks)``."""


def _caller() -> Any:
    """Return a function that calls what is at an address with some numbers and the addresses of some arrays."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        kinds, given = [], []
        for kind, value in zip(signature.args[1:], values[1:], strict=True):
            if isinstance(kind, types.Array):
                value = context.make_array(kind)(context, builder, value).data
            kinds.append(value.type)
            given.append(value)
        function = ir.FunctionType(ir.VoidType(), kinds).as_pointer()
        builder.call(builder.inttoptr(values[0], function), given)
        return context.get_dummy_value()

    return generate


@intrinsic
def call_step(typing_context, address, lanes, series, p, end, rate):
    """Take a step with all lanes of a block: ``step(lanes, series, p, end, rate)``."""
    return types.void(address, lanes, series, p, end, rate), _caller()


@intrinsic
def call_begin(typing_context, address, lanes, series, p, start):
    """Choose the modes in which all lanes of a block begin: ``begin(lanes, series, p, start)``."""
    return types.void(address, lanes, series, p, start), _caller()


@intrinsic
def call_surfaces(typing_context, address, t, state, p, signs, values, rates, gains, jumps, normals):
    """Evaluate all that decides about modes: ``surfaces(t, state, p, signs, values, rates, gains, jumps, normals)``."""
    return types.void(address, t, state, p, signs, values, rates, gains, jumps, normals), _caller()


@intrinsic
def call_rows(typing_context, address, rows, count, p):
    """Move states in rows on by a step, in place: ``step(rows, count, p)``."""
    return types.void(address, rows, count, p), _caller()


@intrinsic
def call_period(typing_context, address, context, x, steps, start, period, p, error, blocks):
    """Move blocks of lanes on by a period: ``advance(context, x, steps, start, period, p, error, blocks)``."""
    return types.void(address, context, x, steps, start, period, p, error, blocks), _caller()
