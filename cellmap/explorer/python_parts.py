"""Parts of programs that the explorer reads: functions, kinds of values, places in the text."""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

from .formulas import EquationError


class Kind(Enum):
    """Kinds of values; those of several numbers are their count."""

    NUMBER = "a number"
    STATE = "the state"
    PARAMS = "the parameters"


Value = Kind | int
Names = Mapping[str, Value]


class Places:
    """Where the nodes of a tree are in its text."""

    def __init__(self, text: str) -> None:
        self._lines = text.split("\n")

    def error(self, message: str, node: ast.AST) -> EquationError:
        """Return the error with a message at a node."""
        line, column = getattr(node, "lineno", 1), getattr(node, "col_offset", 0)
        before = self._lines[line - 1].encode()[:column] if line <= len(self._lines) else b""
        return EquationError(message, line, len(before.decode(errors="replace")) + 1)


@dataclass(frozen=True, eq=False)
class Function:
    """A function of a program, with the names of its arguments."""

    name: str
    node: ast.FunctionDef | ast.Lambda
    arguments: tuple[str, ...]

    @property
    def line(self) -> int:
        """Its line in the text."""
        return self.node.lineno

    @property
    def body(self) -> Sequence[ast.stmt]:
        """Its statements; of a lambda what it returns."""
        if isinstance(self.node, ast.FunctionDef):
            return self.node.body
        return [ast.copy_location(ast.Return(self.node.body), self.node.body)]

    @property
    def states(self) -> tuple[str, ...]:
        """Names to which it unpacks an argument first; none if it does not."""
        for statement in self.body:
            if isinstance(statement, ast.Assign) and isinstance(statement.value, ast.Name):
                target = statement.targets[0]
                if statement.value.id in self.arguments and isinstance(target, ast.Tuple | ast.List):
                    return tuple(e.id for e in target.elts if isinstance(e, ast.Name))
        return ()


def is_docstring(statement: ast.stmt) -> bool:
    """Whether a statement is a text alone."""
    return (
        isinstance(statement, ast.Expr)
        and isinstance(statement.value, ast.Constant)
        and isinstance(statement.value.value, str)
    )
