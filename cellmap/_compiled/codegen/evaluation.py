"""Values of expressions over arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from ..._lib.arrays import Floats
from .expression import ARITHMETIC, Expression, operation_on_numbers, ordered
from .rebind import ARRAY_FUNCTIONS

ROUNDING = 1e-13
"""By how much the argument of a root may be negative at the border of its domain, where it has landed."""

_OF_ARRAYS: dict[str, Callable[..., Any]] = {
    **ARRAY_FUNCTIONS,
    **ARITHMETIC,
    "select": lambda sign, a, b: np.where(sign > 0.0, a, b),
    "side": lambda a: np.where(a > 0.0, 1.0, -1.0),
    "reached": lambda a: np.where(a >= 0.0, 1.0, -1.0),
    "defined": lambda a: np.where(np.isnan(a), -1.0, 1.0),
    "floordiv": np.floor_divide,
    "sqrt": lambda a: np.sqrt(_at_border(a)),
    "pow": lambda a, b: np.power(_at_border(a), b),
}


def _at_border(a: Any) -> Any:
    """Return the argument of a root, zero where rounding has made it negative."""
    return np.where((a < 0.0) & (a > -ROUNDING), 0.0, a)


def evaluated(expressions: Sequence[Expression], inputs: Mapping[Expression, Any]) -> list[Floats]:
    """Return the values of expressions over arrays that broadcast; not finite where an operation is not defined."""
    known: dict[Expression, Any] = {}
    with np.errstate(all="ignore"):
        for node in ordered(tuple(expressions)):
            if not node.arguments:
                known[node] = np.asarray(node.value if node.operation == "constant" else inputs[node], dtype=float)
            else:
                function = _OF_ARRAYS.get(node.operation) or np.vectorize(operation_on_numbers(node.operation))
                known[node] = function(*(known[a] for a in node.arguments))
    return [known[e] for e in expressions]
