"""Source text of expressions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from ..kernels import simd_math
from .expression import Expression
from .trace import STATEFUL

_OWN = {"fmin", "fmax", "mod", "fmod", "floordiv"}  # those of the C library are others, slower, or not there
_INFIX = {"add": "+", "sub": "-", "mul": "*", "div": "/"}


def assignment(node: Expression, name: Callable[[Expression], str], level: int) -> str:
    """Return the statement that computes a node; in the lane loop its functions are the vectorisable ones."""
    arguments = [name(a) for a in node.arguments]
    operation = node.operation
    if operation in _INFIX:
        right = f"{arguments[0]} {_INFIX[operation]} {arguments[1]}"
    elif operation == "neg":
        right = f"-{arguments[0]}"
    elif operation == "select":
        right = f"{arguments[1]} if {arguments[0]} > 0.0 else {arguments[2]}"
    elif operation == "side":
        right = f"1.0 if {arguments[0]} > 0.0 else -1.0"
    elif operation == "pow":
        right = f"{arguments[0]} ** {arguments[1]}"
    else:
        right = f"{library(operation, level)}({', '.join(arguments)})"
    return f"{name(node)} = {right}"


def in_chains(terms: Iterable[str]) -> str:
    """Write a long sum as two sums side by side: a chain of multiply-adds waits for each of its links in turn."""
    listed = list(terms)
    if len(listed) < 4:
        return " + ".join(listed)
    return f"({' + '.join(listed[::2])}) + ({' + '.join(listed[1::2])})"


def dot(pairs: Iterable[tuple[str, str]]) -> str:
    """Write a sum of products; empty where there are none."""
    listed = list(pairs)
    if len(listed) < 4:
        return " + ".join(f"{x} * {y}" for x, y in listed)
    return f"dot({', '.join(f'{x}, {y}' for x, y in listed)})"


def library(function: str, level: int) -> str:
    """Return where a function comes from: vectorisable where there is one and the state is involved, else libm."""
    if function in _OWN:
        return f"simd_math.{function}"
    return f"simd_math.{function}" if level == STATEFUL and hasattr(simd_math, function) else f"math.{function}"


def literal(value: float) -> str:
    """Return a number as source text, signed numbers in parentheses."""
    if value != value or value in (float("inf"), float("-inf")):
        return f"float('{value}')"
    return repr(value) if value >= 0 else f"({value!r})"


def input_name(node: Expression, inputs: Mapping[str, Callable[[int], str]]) -> str | None:
    """Return the name of an input or the text of a constant; None for an operation."""
    if node.operation == "constant":
        return literal(node.value)
    if node.operation in inputs:
        return inputs[node.operation](node.value)
    return None
