"""Names and operators that formulas may have, in both notations in which the explorer reads equations."""

from __future__ import annotations

import ast
import math
from math import isfinite, pi

from .._compiled.codegen.functions import OF_MATH
from .._compiled.codegen.rebind import NUMPY_NAMES
from .._lib.checks import abridged

LONGEST_TEXT = 10_000
"""Characters of a text of equations."""

MOST_WORK = 5000
"""Operations of a right-hand side, so that it is compiled within half a minute."""

FUNCTION_WORK = 80
"""Operations as which a function such as the sine counts: the machine code of its vectors is as long."""

FUNCTIONS = OF_MATH
"""Functions of :mod:`math` that formulas may call."""

BUILT_IN = ("abs", "min", "max")

IN_NUMPY = {name: known for name, known in NUMPY_NAMES.items() if known in FUNCTIONS} | {
    "minimum": "min",
    "maximum": "max",
    "fmin": "min",
    "fmax": "max",
    "power": "pow",
}
"""Functions of NumPy by their names in :mod:`math`."""
OPERATORS = (ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Pow, ast.Mod, ast.USub, ast.UAdd)
COMPARISONS = (ast.Lt, ast.LtE, ast.Gt, ast.GtE)


class EquationError(ValueError):
    """Text that is no system.

    Parameters
    ----------
    message : str
        What to write in its place.
    line, column : int
        Place in the text, counted from 1.
    """

    def __init__(self, message: str, line: int, column: int = 1) -> None:
        super().__init__(f"line {line}, column {column}: {abridged(message)}")
        self.line, self.column = line, column


def is_number(value: object) -> bool:
    """Whether the value of a constant is a finite real number."""
    try:
        return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)
    except OverflowError:
        return False


def work_of(formula: ast.expr) -> int:
    """Return how many operations a formula has."""
    functions = sum(isinstance(n, ast.Name) and n.id in FUNCTIONS for n in ast.walk(formula))
    return FUNCTION_WORK * functions + sum(isinstance(n, ast.expr) for n in ast.walk(formula)) - functions


def too_long(line: int, column: int = 1) -> EquationError:
    """Return the error for a right-hand side that takes too long to compile."""
    counted = f"a function such as sin counts as {FUNCTION_WORK}"
    return EquationError(f"more than {MOST_WORK} operations, of which {counted}: write a shorter one", line, column)


def value_of(formula: ast.expr) -> float:
    """Return the value of a formula that has been checked, and whose numbers are all of type float.

    Raises
    ------
    ValueError, TypeError, ArithmeticError
        Where it has none.
    """
    tree = ast.fix_missing_locations(ast.Expression(formula))
    scope = {n: getattr(math, n) for n in FUNCTIONS} | {"pi": pi, "abs": abs, "min": min, "max": max}
    return float(eval(compile(tree, "<equations>", "eval"), {"__builtins__": {}}, scope))


class PlainNumbers(ast.NodeTransformer):
    """Turn whole numbers into floats, but for small powers and places in tuples, so that they cannot become long."""

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        """Leave small powers."""
        left, power = self.visit(node.left), node.right
        small = isinstance(power, ast.Constant) and isinstance(power.value, int) and abs(power.value) <= 64
        return ast.BinOp(left, node.op, power if isinstance(node.op, ast.Pow) and small else self.visit(power))

    def visit_Constant(self, node: ast.Constant) -> ast.expr:
        """Turn a number into a float."""
        return ast.Constant(float(node.value))  # type: ignore[arg-type]
