"""Instructions of expressions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from . import simd_math
from .expression import Expression
from .functions import TABLE
from .instructions import Instructions, Value, where
from .trace import STATEFUL

Known = dict[Expression, Value]
"""Values of expressions."""


def inputs(code: Instructions, nodes: Iterable[Expression], **given: Any) -> Known:
    """Return the values of constants, and of the inputs of the kinds that are given, each with values by numbers."""
    known = {n: given[n.operation][n.value] for n in nodes if n.operation in given}
    return known | {n: code.number(n.value) for n in nodes if n.operation == "constant"}


def evaluate(code: Instructions, nodes: Iterable[Expression], known: Mapping[Expression, Value], level: int) -> Known:
    """Write the instructions of expressions, in order; return what is known with their values."""
    found = dict(known)
    for node in nodes:
        if node.arguments:
            found[node] = applied(code, node.operation, [found[a] for a in node.arguments], level)
    return found


def applied(code: Instructions, operation: str, arguments: Sequence[Value], level: int) -> Value:
    """Write an operation; in the lane loop its functions are those for vectors, where there are any."""
    match operation, arguments:
        case "add", (a, b):
            return code.binary("fadd", a, b)
        case "sub", (a, b):
            return code.binary("fsub", a, b)
        case "mul", (a, b):
            return code.binary("fmul", a, b)
        case "div", (a, b):
            return code.binary("fdiv", a, b)
        case "neg", (a,):
            return -a
        case "select", (sign, a, b):
            return where(sign > 0.0, a, b)
        case "side", (a,):
            return where(a > 0.0, 1.0, -1.0)
        case "floordiv", (a, b):
            return simd_math.floordiv(a, b)
    return called(code, operation, arguments, level)


def called(code: Instructions, name: str, arguments: Sequence[Value], level: int) -> Value:
    """Write the call of an elementary function, or a power."""
    known = TABLE.get(name)
    if known is not None and isinstance(known.kernel, str):
        return code.intrinsic(known.kernel, *arguments)
    if known is not None and callable(known.kernel) and (known.shared or level == STATEFUL):
        written: Value = known.kernel(*arguments)
        return written
    return code.libm(name, *arguments)
