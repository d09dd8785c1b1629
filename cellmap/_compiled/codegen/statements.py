"""From statements to instructions.

Methods of integration write their steps as assignments in a small part of Python: arithmetic, comparisons, conditional
expressions, and calls of elementary functions.  Such lines are easy to read and to test.  Here each becomes LLVM
instructions.  Functions of :mod:`cellmap._compiled.kernels.simd_math` are inlined from their own source, so that they
are defined once; functions of :mod:`math` are those of the C library.
"""

from __future__ import annotations

import ast
import functools
import inspect
import math
from collections.abc import Iterable, Mapping
from typing import Any

from ..kernels import simd_math
from .instructions import Instructions, Value, number

Scope = dict[str, Value]

_ARITHMETIC: dict[type[ast.operator], str] = {ast.Add: "fadd", ast.Sub: "fsub", ast.Mult: "fmul", ast.Div: "fdiv"}
_LOGICAL: dict[type, str] = {ast.And: "and", ast.Or: "or", ast.BitAnd: "and", ast.BitOr: "or"}
_RELATIONS: dict[type[ast.cmpop], str] = {
    ast.Lt: "olt",
    ast.LtE: "ole",
    ast.Gt: "ogt",
    ast.GtE: "oge",
    ast.Eq: "oeq",
    ast.NotEq: "une",
}
_INTRINSICS = {
    "sqrt": "sqrt",
    "floor": "floor",
    "ceil": "ceil",
    "fabs": "fabs",
    "abs": "fabs",
    "copysign": "copysign",
    "trunc": "trunc",
    "fma": "fma",
}
"""Functions that a processor has."""


def translate(code: Instructions, lines: Iterable[str], scope: Scope) -> None:
    """Write the instructions of assignments; names are looked up in a scope, and their values added to it.

    Raises
    ------
    TypeError
        For a statement that is not of the language described above.
    """
    translator = _Translator(code, {})
    for statement in ast.parse("\n".join(lines)).body:
        translator.assign(statement, scope)


@functools.cache
def _definitions() -> Mapping[str, ast.FunctionDef]:
    """Elementary functions by name, as parsed."""
    module = ast.parse(inspect.getsource(simd_math))
    return {node.name: node for node in module.body if isinstance(node, ast.FunctionDef)}


class _Translator:
    """Statements to instructions; ``constants`` are numbers by name that the statements see around them."""

    def __init__(self, code: Instructions, constants: Mapping[str, Any]) -> None:
        self.code, self.constants = code, constants

    def assign(self, statement: ast.stmt, scope: Scope) -> None:
        """Write an assignment to one name."""
        if not isinstance(statement, ast.Assign) or not isinstance(statement.targets[0], ast.Name):
            raise TypeError(f"only assignments to names can be compiled, not: {ast.unparse(statement)}")
        scope[statement.targets[0].id] = self.value(statement.value, scope)

    def value(self, node: ast.expr, scope: Scope) -> Value:
        """Write an expression and return its value."""
        code = self.code
        match node:
            case ast.Name(id=name):
                return scope[name] if name in scope else number(self.constants[name])
            case ast.Constant(value=literal):
                return number(float(literal))  # type: ignore[arg-type]
            case ast.BinOp(left=left, op=ast.Pow(), right=right):
                return code.libm("pow", self.value(left, scope), self.value(right, scope))
            case ast.BinOp(left=left, op=operation, right=right) if type(operation) in _ARITHMETIC:
                return code.binary(_ARITHMETIC[type(operation)], self.value(left, scope), self.value(right, scope))
            case ast.BinOp(left=left, op=operation, right=right) if type(operation) in _LOGICAL:
                return code.logical(_LOGICAL[type(operation)], self.value(left, scope), self.value(right, scope))
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return code.negative(self.value(operand, scope))
            case ast.BoolOp(op=operation, values=parts):
                values = [self.value(part, scope) for part in parts]
                return functools.reduce(functools.partial(code.logical, _LOGICAL[type(operation)]), values)
            case ast.Compare(left=left, ops=[relation], comparators=[right]):
                return code.compare(_RELATIONS[type(relation)], self.value(left, scope), self.value(right, scope))
            case ast.IfExp(test=test, body=ast.Call(func=ast.Attribute(value=ast.Name(id="math"), attr=name)) as body):
                condition, otherwise = self.value(test, scope), self.value(node.orelse, scope)
                return code.seldom(condition, name, [self.value(a, scope) for a in body.args], otherwise)
            case ast.IfExp(test=test, body=body, orelse=otherwise):
                return code.select(*(self.value(part, scope) for part in (test, body, otherwise)))
            case ast.Attribute(value=ast.Name(id="np" | "math"), attr=name):
                return number(getattr(math, name))
            case ast.Call(func=function, args=arguments):
                return self.call(function, arguments, scope)
        raise TypeError(f"this expression cannot be compiled: {ast.unparse(node)}")

    def call(self, function: ast.expr, arguments: list[ast.expr], scope: Scope) -> Value:
        """Write the call of an elementary function."""
        code = self.code
        match function:
            case ast.Name(id="float"):
                return number(float(ast.literal_eval(arguments[0])))
            case ast.Name(id=name):
                module = ""
            case ast.Attribute(value=ast.Name(id=module), attr=name):
                pass
            case _:
                raise TypeError(f"this call cannot be compiled: {ast.unparse(function)}")
        given = [self.value(a, scope) for a in arguments]
        if name in _INTRINSICS:
            return code.intrinsic(_INTRINSICS[name], *given)
        if module == "math":
            return code.libm(name, *given)
        if name == "dot":
            return code.dot(given)
        if name == "_power_of_two":
            return code.power_of_two(given[0])
        if name in {"min", "max"}:
            # As Python has it: the first of two that compare equal, and the first where one is NaN.
            return code.select(code.compare("olt" if name == "min" else "ogt", given[1], given[0]), given[1], given[0])
        return self.inlined(name, given)

    def inlined(self, name: str, arguments: list[Value]) -> Value:
        """Write the body of an elementary function with these arguments."""
        definition = _definitions()[name]
        inner = _Translator(self.code, vars(simd_math))
        scope = dict(zip((a.arg for a in definition.args.args), arguments, strict=True))
        for statement in definition.body:
            match statement:
                case ast.Return(value=ast.expr() as result):
                    return inner.value(result, scope)
                case ast.Expr(value=ast.Constant()):
                    continue  # the docstring
                case _:
                    inner.assign(statement, scope)
        raise TypeError(f"{name} returns nothing")
