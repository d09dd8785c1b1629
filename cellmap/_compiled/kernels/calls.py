"""Calls of generated functions by their addresses, from loops that are compiled once for all of them."""

from __future__ import annotations

from typing import Any

from ..loops import Deferred, numba, operation

PERIOD = "void(CPointer(i8), CPointer(f8), CPointer(i8), f8, f8, CPointer(f8), CPointer(f8), i8)"
"""Signature of a period: ``advance(context, x, steps, start, period, p, error, blocks)``."""


def _array_at(address: Any, shape: Any) -> Any:
    """Return the array of a shape whose numbers are at an address."""


array_at = Deferred(_array_at, lambda f: numba().carray)


def _called(address: Any, *given: Any) -> Any:
    """Return the signature and the code of a call of what is at an address, with numbers and addresses of arrays."""
    from llvmlite import ir

    types = numba().types

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        handed = []
        for kind, value in zip(signature.args[1:], values[1:], strict=True):
            if isinstance(kind, types.Array):
                value = context.make_array(kind)(context, builder, value).data
            handed.append(value)
        function = ir.FunctionType(ir.VoidType(), [value.type for value in handed]).as_pointer()
        builder.call(builder.inttoptr(values[0], function), handed)
        return context.get_dummy_value()

    return types.void(address, *given), generate


@operation
def call_step(typing_context, address, lanes, series, p, end, rate):
    """Take a step with all lanes of a block: ``step(lanes, series, p, end, rate)``."""
    return _called(address, lanes, series, p, end, rate)


@operation
def call_begin(typing_context, address, lanes, series, p, start):
    """Choose the modes in which all lanes of a block begin: ``begin(lanes, series, p, start)``."""
    return _called(address, lanes, series, p, start)


@operation
def call_surfaces(typing_context, address, t, state, p, signs, values, rates, gains, jumps, normals):
    """Evaluate all that decides about modes: ``surfaces(t, state, p, signs, values, rates, gains, jumps, normals)``."""
    return _called(address, t, state, p, signs, values, rates, gains, jumps, normals)


@operation
def call_rows(typing_context, address, rows, count, p):
    """Move states in rows on by a step, in place: ``step(rows, count, p)``."""
    return _called(address, rows, count, p)


@operation
def call_period(typing_context, address, context, x, steps, start, period, p, error, blocks):
    """Move blocks of lanes on by a period: ``advance(context, x, steps, start, period, p, error, blocks)``."""
    return _called(address, context, x, steps, start, period, p, error, blocks)


@operation
def call_look_up(
    typing_context, address, points, rotations, left, table, strides, origin, inverse, cells, circle, reach, lower,
    turn, number, levels, made
):  # fmt: skip
    """Move rows on by look-ups, as :mod:`cellmap._compiled.codegen.lookup` describes it; its arrays by address."""
    return _called(
        address, points, rotations, left, table, strides, origin, inverse, cells, circle, reach, lower, turn, number,
        levels, made,
    )  # fmt: skip
