"""Functions of programs that the explorer reads: what they take and return, and how they are rebuilt.

A function is looked at with the kinds of its arguments, as it is called: numbers, the state, the parameters.  So each
name in it stands for one kind of value, each call leads to a function that is known and does not call itself, and the
work of a call is bounded before anything is computed.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

from .._lib.checks import shown
from .formulas import (
    BUILT_IN,
    COMPARISONS,
    FUNCTION_WORK,
    FUNCTIONS,
    IN_NUMPY,
    MOST_WORK,
    OPERATORS,
    EquationError,
    PlainNumbers,
    is_number,
    too_long,
)

_RESERVED = {"ForcedSystem", "discrete_map", "angle", "Coordinate", "system", *FUNCTIONS, *BUILT_IN, "pi"}


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


class Functions:
    """All functions of a program, and the names that they see."""

    def __init__(self, places: Places) -> None:
        self.places = places
        self.known: dict[str, Function] = {}
        self.numbers: dict[str, float] = {}
        self.lines: dict[str, int] = {}
        self.modules: set[str] = set()
        self.elementary = {name: name for name in BUILT_IN}
        self.params: Mapping[str, float] = {}
        self.dimension = 0
        self._found: dict[tuple[str, tuple[Value, ...]], tuple[Value, int]] = {}
        self._open: list[str] = []
        self._work = 0

    def new_name(self, name: str, node: ast.AST) -> str:
        """Return a name that is free."""
        taken = {*_RESERVED, *self.elementary, *self.modules, *self.known, *self.numbers}
        if name in taken or name.startswith("__"):
            raise self.places.error(f"{name} means something already: take another name", node)
        return name

    def add(self, name: str, node: ast.FunctionDef | ast.Lambda) -> Function:
        """Take a function into the program."""
        a = node.args
        if a.vararg or a.kwarg or a.kwonlyargs or a.defaults or getattr(node, "decorator_list", None):
            raise self.places.error("a function has plain arguments here, without defaults, and no decorators", node)
        arguments = tuple(argument.arg for argument in (*a.posonlyargs, *a.args))
        self.new_name(name, node)
        self.known[name] = Function(name, node, arguments)
        self.lines[name] = node.lineno
        return self.known[name]

    def check_system(self, function: Function, kinds: tuple[Kind, ...], dimension: int) -> None:
        """Check the right-hand side of a flow, or the function of a map."""
        found = self.check(function, kinds, function.node, None)
        if found != dimension:
            returned = "the state or the parameters" if isinstance(found, Kind) else f"{found} numbers"
            message = f"{function.name} returns {'one number' if found == Kind.NUMBER else returned}"
            raise self.places.error(f"{message}: return one for each coordinate, with commas", function.node)

    def check(self, function: Function, kinds: tuple[Kind, ...], node: ast.AST, expected: Value | None) -> Value:
        """Return what a function returns for arguments of some kinds; check all that it does."""
        self._work = 0
        found = self._called(function, kinds, node)
        if expected is not None and found != expected:
            raise self.places.error(f"{function.name} must return a number", function.node)
        return found

    def _called(self, function: Function, kinds: tuple[Value, ...], node: ast.AST) -> Value:
        key = function.name, kinds
        if key not in self._found:
            if function.name in self._open:
                raise self.places.error(f"{function.name} calls itself, which is not read here", node)
            if len(kinds) != len(function.arguments):
                wanted = f"{len(function.arguments)} arguments and is called with {len(kinds)}"
                raise self.places.error(f"{function.name} has {wanted}", node)
            for argument in function.arguments:
                self.new_name(argument, function.node)
            before, self._work = self._work, 0
            self._open.append(function.name)
            returned: list[Value] = []
            if self._body(function.body, dict(zip(function.arguments, kinds, strict=True)), returned) is not None:
                raise self.places.error(f"{function.name} does not return on every path", function.node)
            if len(set(returned)) > 1:
                raise self.places.error(f"{function.name} returns different numbers of values", function.node)
            self._open.pop()
            self._found[key] = returned[0], self._work
            self._work = before
        found, work = self._found[key]
        self._count(work, node)
        return found

    def _count(self, work: int, node: ast.AST) -> None:
        self._work += work
        if self._work > MOST_WORK:
            place = self.places.error("", node)
            raise too_long(place.line, place.column)

    # --- statements

    def _body(
        self, statements: Sequence[ast.stmt], names: dict[str, Value], returned: list[Value]
    ) -> dict[str, Value] | None:
        """Return the names after some statements; None if they have returned."""
        for statement in statements:
            if isinstance(statement, ast.Return) and statement.value is not None:
                returned.append(self.expression(statement.value, names))
                return None
            if isinstance(statement, ast.If):
                self._condition(statement.test, names)
                sides = [self._body(s, dict(names), returned) for s in (statement.body, statement.orelse)]
                left = [side for side in sides if side is not None]
                if not left:
                    return None
                names = {n: k for n, k in left[0].items() if left[-1].get(n) == k}
            elif isinstance(statement, ast.Assign) and len(statement.targets) == 1:
                self._assign(statement.targets[0], self.expression(statement.value, names), names)
            elif isinstance(statement, ast.AnnAssign) and statement.value is not None:
                self._assign(statement.target, self.expression(statement.value, names), names)
            elif isinstance(statement, ast.AugAssign) and isinstance(statement.op, OPERATORS):
                if not isinstance(statement.target, ast.Name) or names.get(statement.target.id) != Kind.NUMBER:
                    raise self.places.error("this is no number that has a value here", statement.target)
                self._numbers((statement.value,), names)
            elif not (isinstance(statement, ast.Pass) or is_docstring(statement)):
                raise self.places.error("this is not read here: use assignments, if and return", statement)
        return names

    def _assign(self, target: ast.expr, value: Value, names: dict[str, Value]) -> None:
        if isinstance(target, ast.Name):
            names[self.new_name(target.id, target)] = value
            return
        if not isinstance(target, ast.Tuple | ast.List) or not all(isinstance(e, ast.Name) for e in target.elts):
            raise self.places.error("assign to names", target)
        count = self.dimension if value == Kind.STATE else value
        if count != len(target.elts):
            message = (
                f"{len(target.elts)} names for {count} values"
                if isinstance(count, int)
                else f"{count.value} has no parts"
            )
            raise self.places.error(message, target)
        for name in target.elts:
            self._assign(name, Kind.NUMBER, names)

    # --- expressions

    def expression(self, node: ast.expr, names: Names) -> Value:
        """Return the kind of a value."""
        self._count(1, node)
        if isinstance(node, ast.Constant) and is_number(node.value):
            return Kind.NUMBER
        if isinstance(node, ast.Name):
            return self._name(node, names)
        if isinstance(node, ast.BinOp | ast.UnaryOp) and isinstance(node.op, OPERATORS):
            return self._numbers((node.left, node.right) if isinstance(node, ast.BinOp) else (node.operand,), names)
        if isinstance(node, ast.IfExp):
            self._condition(node.test, names)
            return self._numbers((node.body, node.orelse), names)
        if isinstance(node, ast.Tuple | ast.List) and node.elts:
            self._numbers(node.elts, names)
            return len(node.elts)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            return self._attribute(node, node.value.id, names)
        if isinstance(node, ast.Subscript):
            return self._part(node, names)
        if isinstance(node, ast.Call):
            return self._call(node, names)
        if isinstance(node, ast.Constant):
            raise self.places.error(f"{shown(node.value)} is no number", node)
        if isinstance(node, ast.BinOp | ast.UnaryOp):
            raise self.places.error("this is no operation on numbers: use + - * / ** %", node)
        raise self.places.error("this does not belong in a formula", node)

    def _numbers(self, nodes: Sequence[ast.expr], names: Names) -> Kind:
        for node in nodes:
            if (kind := self.expression(node, names)) != Kind.NUMBER:
                what = kind.value if isinstance(kind, Kind) else f"{kind} numbers"
                raise self.places.error(f"this is {what}, where a number belongs", node)
        return Kind.NUMBER

    def _name(self, node: ast.Name, names: Names) -> Value:
        if node.id in names:
            return names[node.id]
        if node.id in self.numbers or self.elementary.get(node.id) == "pi":
            return Kind.NUMBER
        if node.id in self.known or node.id in self.elementary:
            raise self.places.error(f"{node.id} is a function: write {node.id}(...)", node)
        if node.id in (*FUNCTIONS, "pi"):
            raise self.places.error(f"{node.id} is not known here: add  from math import {node.id}", node)
        raise self.places.error(f"{node.id} is not defined here", node)

    def _attribute(self, node: ast.Attribute, owner: str, names: Names) -> Value:
        if names.get(owner) == Kind.PARAMS:
            if node.attr not in self.params:
                known = ", ".join(self.params) or "none"
                raise self.places.error(f"params has no {node.attr}; there are {known}", node)
            return Kind.NUMBER
        if owner in self.modules and owner not in names and node.attr == "pi":
            return Kind.NUMBER
        raise self.places.error(f"{owner}.{node.attr} does not belong in a formula", node)

    def _part(self, node: ast.Subscript, names: Names) -> Value:
        whole, place = self.expression(node.value, names), node.slice
        count = self.dimension if whole == Kind.STATE else whole
        if not isinstance(count, int):
            raise self.places.error(f"{count.value} has no numbered parts: write p.name", node)
        if (
            isinstance(place, ast.UnaryOp)
            and isinstance(place.op, ast.USub)
            and isinstance(place.operand, ast.Constant)
        ):
            number = -place.operand.value if type(place.operand.value) is int else None
        else:
            number = place.value if isinstance(place, ast.Constant) and type(place.value) is int else None
        if number is None or not -count <= number < count:
            raise self.places.error(f"the place is a whole number from 0 to {count - 1}", place)
        return Kind.NUMBER

    def _call(self, node: ast.Call, names: Names) -> Value:
        name = self.called_name(node.func, names)
        if not name and isinstance(node.func, ast.Name) and node.func.id in FUNCTIONS:
            raise self.places.error(f"{node.func.id} is not known here: add  from math import {node.func.id}", node)
        if not name:
            known = ", ".join((*FUNCTIONS, *BUILT_IN))
            raise self.places.error(f"unknown function: define it above, or import one of {known}", node)
        if node.keywords or any(isinstance(a, ast.Starred) for a in node.args):
            raise self.places.error("a call has plain arguments here", node)
        if name == "array":
            if len(node.args) == 1 and isinstance(node.args[0], ast.Tuple | ast.List):
                return self.expression(node.args[0], names)
            raise self.places.error("give array a list of numbers", node)
        if name in self.known:
            return self._called(self.known[name], tuple(self.expression(a, names) for a in node.args), node)
        self._count(FUNCTION_WORK if name in FUNCTIONS else 0, node)
        return self._numbers(node.args, names)

    def called_name(self, function: ast.expr, names: Names) -> str:
        """Return which function is called: one of the program, an elementary one, or array; nothing if another."""
        if isinstance(function, ast.Name) and function.id not in names:
            return function.id if function.id in self.known else self.elementary.get(function.id, "")
        if isinstance(function, ast.Attribute) and isinstance(function.value, ast.Name):
            name = IN_NUMPY.get(function.attr, function.attr)
            if function.value.id in self.modules and name in (*FUNCTIONS, "array", *BUILT_IN):
                return name
        return ""

    def _condition(self, node: ast.expr, names: Names) -> None:
        self._count(1, node)
        if isinstance(node, ast.BoolOp):
            for value in node.values:
                self._condition(value, names)
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            self._condition(node.operand, names)
        elif isinstance(node, ast.Compare) and all(isinstance(op, COMPARISONS) for op in node.ops):
            self._numbers((node.left, *node.comparators), names)
        else:
            raise self.places.error("compare two numbers, with < <= > >=", node)

    def source(self) -> str:
        """Return all functions that have been checked, rebuilt."""
        used = {name for name, _ in self._found}
        parts = []
        for name, function in self.known.items():
            if name in used:
                arguments = ", ".join(function.arguments)
                written = (Written(self).visit(s) for s in function.body if not is_docstring(s))
                body = "\n".join(ast.unparse(ast.fix_missing_locations(s)) for s in written)
                parts.append(f"def {name}({arguments}):\n" + "".join(f"    {line}\n" for line in body.splitlines()))
        return "\n\n".join(parts) + "\n"


class Written(PlainNumbers):
    """Statements and formulas that have been checked, with numbers in the place of names, and names of :mod:`math`."""

    def __init__(self, functions: Functions) -> None:
        self._functions = functions

    def visit_Name(self, node: ast.Name) -> ast.expr:
        """Write a number for its name, and the name of :mod:`math`."""
        if not isinstance(node.ctx, ast.Load):
            return node
        if node.id in self._functions.numbers:
            value = self._functions.numbers[node.id]
            number = ast.Constant(abs(value))
            return ast.UnaryOp(ast.USub(), number) if value < 0 else number
        return ast.Name(self._functions.elementary.get(node.id, node.id), ast.Load())

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        """Leave parameters, and name pi."""
        if isinstance(node.value, ast.Name) and node.value.id in self._functions.modules:
            return ast.Name(node.attr, ast.Load())
        return node

    def visit_Subscript(self, node: ast.Subscript) -> ast.expr:
        """Leave the place."""
        return ast.Subscript(self.visit(node.value), node.slice, ast.Load())

    def visit_Call(self, node: ast.Call) -> ast.expr:
        """Write the name of what is called."""
        name = self._functions.called_name(node.func, {})
        arguments = [self.visit(a) for a in node.args]
        return arguments[0] if name == "array" else ast.Call(ast.Name(name, ast.Load()), arguments, [])

    def visit_Expr(self, node: ast.Expr) -> ast.stmt:
        """Leave out a text."""
        return ast.Pass()

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.stmt:
        """Leave out the type."""
        assert node.value is not None
        return ast.Assign([node.target], self.visit(node.value), lineno=node.lineno)
