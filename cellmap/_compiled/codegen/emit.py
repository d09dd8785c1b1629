"""Instructions of expressions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from . import simd_math
from .expression import ARITHMETIC, Expression
from .functions import TABLE
from .instructions import Instructions, Value, where
from .interval_functions import applied_to_intervals
from .intervals import Enclosing
from .trace import STATEFUL

Known = dict[Expression, Value]
"""Values of expressions."""

_WRITTEN: dict[str, Callable[..., Value]] = {
    **ARITHMETIC,
    "select": lambda sign, a, b: where(sign > 0.0, a, b),
    "side": lambda a: where(a > 0.0, 1.0, -1.0),
    "reached": lambda a: where(a >= 0.0, 1.0, -1.0),
    "defined": lambda a: where(a.equals(a), 1.0, -1.0),
    "floordiv": simd_math.floordiv,
}
"""Operations that are no elementary functions; powers are those of the C library."""


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


def applied(code: Any, operation: str, arguments: Sequence[Any], level: int) -> Value:
    """Write an operation; in the lane loop its functions are those for vectors, where there are any."""
    if isinstance(code, Enclosing):
        enclosed: Any = applied_to_intervals(operation, arguments)
        return enclosed
    known = TABLE.get(operation)
    kernel = known.kernel if known is not None else _WRITTEN.get(operation)
    if isinstance(kernel, str):
        return code.intrinsic(kernel, *arguments)
    if kernel is not None and (known is None or known.shared or level == STATEFUL):
        written: Value = kernel(*arguments)
        return written
    return code.libm(operation, *arguments)
