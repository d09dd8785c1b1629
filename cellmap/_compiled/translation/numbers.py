"""Arithmetic of the language: conversions, operators, comparisons, functions of mathematics."""

from __future__ import annotations

import ast
import math
import struct
from collections.abc import Callable
from typing import Any

import numpy as np

from .values import FLOAT, REGISTERS, TRUTH, UNSIGNED, WHOLE, Known, TypedValue, joined
from .writer import Writer

_OF_FLOATS = {ast.Add: "fadd", ast.Sub: "fsub", ast.Mult: "fmul", ast.Div: "fdiv"}
_OF_WHOLES = {
    ast.Add: "add", ast.Sub: "sub", ast.Mult: "mul", ast.BitAnd: "and", ast.BitOr: "or", ast.BitXor: "xor",
    ast.LShift: "shl", ast.RShift: "ashr",
}  # fmt: skip
_COMPARED: dict[type[ast.cmpop], tuple[str, str]] = {
    ast.Lt: ("olt", "lt"), ast.LtE: ("ole", "le"), ast.Gt: ("ogt", "gt"), ast.GtE: ("oge", "ge"),
    ast.Eq: ("oeq", "eq"), ast.NotEq: ("une", "ne"),
}  # fmt: skip

INTRINSICS: dict[Callable[..., Any], str] = {
    math.sqrt: "sqrt", np.sqrt: "sqrt", math.floor: "floor", np.floor: "floor", math.log: "log", np.log: "log",
    math.fabs: "fabs", math.copysign: "copysign", np.copysign: "copysign",
}  # fmt: skip
"""Functions of floats, with LLVM's names of them."""

NUMBERS: dict[Any, str] = {np.int64: WHOLE, int: WHOLE, np.uint64: UNSIGNED, np.float64: FLOAT, float: FLOAT}
"""Types that are called to convert a number."""

CONVERTED = {
    (WHOLE, FLOAT): "sitofp", (UNSIGNED, FLOAT): "uitofp", (TRUTH, FLOAT): "uitofp", (TRUTH, WHOLE): "zext",
    (TRUTH, UNSIGNED): "zext", (FLOAT, WHOLE): "fptosi",
}  # fmt: skip


def literal(value: Any) -> TypedValue:
    """Return a constant number as a value."""
    if isinstance(value, bool | np.bool_):
        return TypedValue(TRUTH, ("true" if value else "false",))
    if isinstance(value, np.uint64):
        return TypedValue(UNSIGNED, (str(int(value)),))
    if isinstance(value, int | np.integer):
        if not -(2**63) <= value < 2**63:
            raise TypeError(f"{value} has more than 64 bits")
        return TypedValue(WHOLE, (str(int(value)),))
    if not isinstance(value, float):
        raise TypeError(f"{value!r} is no number")
    return TypedValue(FLOAT, (f"0x{struct.pack('>d', value).hex()}",))


class Arithmetic:
    """Instructions for operators.  ``flags`` allow what the processor may do with floats."""

    def __init__(self, writer: Writer, flags: str) -> None:
        self.writer, self.flags = writer, flags

    def converted(self, value: TypedValue | Known, kind: str) -> TypedValue:
        """Return a number as one of another kind."""
        if isinstance(value, Known):
            if kind == UNSIGNED:
                if not isinstance(value.value, int | np.integer) or not 0 <= value.value < 2**64:
                    raise TypeError(f"{value.value!r} in the place of a uint64")
                return literal(np.uint64(value.value))
            found = literal(value.value)
            value = literal(float(value.value)) if kind == FLOAT else found
        if value.kind == kind:
            return value
        if {value.kind, kind} == {WHOLE, UNSIGNED}:
            return TypedValue(kind, value.registers)
        if kind == TRUTH:
            return self.truth(value)
        source, target, instruction = str(value.kind), REGISTERS[kind], CONVERTED.get((str(value.kind), kind))
        if instruction is None:
            raise TypeError(f"a value of the kind {source} in the place of a number of the kind {kind}")
        return TypedValue(kind, (self.writer.value(f"{instruction} {REGISTERS[source]} {value.register} to {target}"),))

    def truth(self, value: TypedValue | Known) -> TypedValue:
        """Tell whether a number is not zero."""
        value = self.number(value)
        if value.kind == TRUTH:
            return value
        if value.kind == FLOAT:
            return TypedValue(TRUTH, (self.writer.value(f"fcmp une double {value.register}, 0.0"),))
        return TypedValue(TRUTH, (self.writer.value(f"icmp ne i64 {value.register}, 0"),))

    def number(self, value: TypedValue | Known) -> TypedValue:
        """Return a constant as the number that it is."""
        found = literal(value.value) if isinstance(value, Known) else value
        if not isinstance(found.kind, str):
            raise TypeError(f"a value of the kind {found.kind} is no number")
        return found

    def whole(self, value: TypedValue | Known) -> TypedValue:
        """Return a whole number, which none of another kind is taken for."""
        found = self.number(value)
        if found.kind != WHOLE:
            raise TypeError(f"a number of the kind {found.kind} in the place of a whole one")
        return found

    def common(self, values: list[TypedValue | Known]) -> list[TypedValue]:
        """Return numbers of one kind."""
        kinds = [str(self.number(value).kind) for value in values]
        if UNSIGNED in kinds:
            signed = [
                v for v, kind in zip(values, kinds, strict=True) if kind != UNSIGNED and isinstance(v, TypedValue)
            ]
            if signed:
                raise TypeError("a uint64 and another number: say which of them is to be converted")
            kind: Any = UNSIGNED
        else:
            kind = kinds[0]
            for other in kinds:
                kind = joined(FLOAT if FLOAT in (kind, other) else kind, FLOAT if FLOAT in (kind, other) else other)
        return [self.converted(value, kind) for value in values]

    def binary(self, operator: ast.operator, left: TypedValue | Known, right: TypedValue | Known) -> TypedValue:
        """Apply an operator to two numbers."""
        if isinstance(operator, ast.Div):
            left, right = self.converted(left, FLOAT), self.converted(right, FLOAT)
        if isinstance(operator, ast.Pow):
            return self._power(left, right)
        shifts = isinstance(operator, ast.LShift | ast.RShift)
        if shifts and self.number(left).kind == UNSIGNED:
            right = self.converted(right, UNSIGNED)
        constant: Any = right.value if isinstance(right, Known) else None
        a, b = self.common([left, right])
        if a.kind == FLOAT:
            if isinstance(operator, ast.Mod):
                return self._remainder_of_floats(a, b)
            if type(operator) not in _OF_FLOATS:
                raise TypeError(f"{ast.dump(operator)} of floats")
            return self._float(f"{_OF_FLOATS[type(operator)]} {self.flags} double {a.register}, {b.register}")
        if a.kind == TRUTH:
            if isinstance(operator, ast.BitAnd | ast.BitOr | ast.BitXor):
                return TypedValue(
                    TRUTH, (self.writer.value(f"{_OF_WHOLES[type(operator)]} i1 {a.register}, {b.register}"),)
                )
            a, b = self.converted(a, WHOLE), self.converted(b, WHOLE)
        if isinstance(operator, ast.FloorDiv | ast.Mod):
            if a.kind == UNSIGNED:
                raise TypeError("a division of a uint64: say how it is to be converted")
            return self._divided(isinstance(operator, ast.Mod), a, b, constant)
        instruction = _OF_WHOLES[type(operator)]
        if a.kind == UNSIGNED and instruction == "ashr":
            instruction = "lshr"
        if shifts and constant is None:
            return self._shifted(instruction, a, b)
        if shifts and not 0 <= constant < 64:
            raise TypeError(f"a shift by {constant}")
        return TypedValue(a.kind, (self.writer.value(f"{instruction} i64 {a.register}, {b.register}"),))

    def negative(self, value: TypedValue | Known) -> TypedValue | Known:
        """Return a number with the other sign."""
        if isinstance(value, Known):
            return Known(-value.value)
        if value.kind == FLOAT:
            return self._float(f"fneg double {value.register}")
        value = self.whole(self.converted(value, WHOLE) if value.kind == TRUTH else value)
        return TypedValue(WHOLE, (self.writer.value(f"sub i64 0, {value.register}"),))

    def compared(self, operator: ast.cmpop, left: TypedValue | Known, right: TypedValue | Known) -> TypedValue:
        """Compare two numbers."""
        a, b = self.common([left, right])
        of_floats, of_wholes = _COMPARED[type(operator)]
        if a.kind == FLOAT:
            return TypedValue(TRUTH, (self.writer.value(f"fcmp {of_floats} double {a.register}, {b.register}"),))
        sign = "" if of_wholes in ("eq", "ne") else "u" if a.kind in (UNSIGNED, TRUTH) else "s"
        register = REGISTERS[str(a.kind)]
        return TypedValue(TRUTH, (self.writer.value(f"icmp {sign}{of_wholes} {register} {a.register}, {b.register}"),))

    def extreme(self, operator: ast.cmpop, values: list[TypedValue | Known]) -> TypedValue:
        """Return the smallest or largest number, as Python's ``min`` and ``max`` find it where there are NaN."""
        found, *others = self.common(values)
        for other in others:
            found = self.selected(self.compared(operator, other, found), other, found)
        return found

    def selected(self, condition: TypedValue, one: TypedValue, other: TypedValue) -> TypedValue:
        """Return one of two numbers of the same kind."""
        kind = REGISTERS[str(one.kind)]
        text = f"select i1 {condition.register}, {kind} {one.register}, {kind} {other.register}"
        return TypedValue(one.kind, (self.writer.value(text),))

    def absolute(self, value: TypedValue | Known) -> TypedValue:
        """Return a number without its sign."""
        value = self.number(value)
        if value.kind == FLOAT:
            return self.intrinsic("fabs", [value])
        value = self.whole(self.converted(value, WHOLE) if value.kind == TRUTH else value)
        return TypedValue(WHOLE, (self.writer.value(f"call i64 @llvm.abs.i64(i64 {value.register}, i1 false)"),))

    def intrinsic(self, name: str, values: list[TypedValue | Known] | list[TypedValue]) -> TypedValue:
        """Call a function of floats."""
        given = ", ".join(f"double {self.converted(value, FLOAT).register}" for value in values)
        return self._float(f"call double @llvm.{name}.f64({given})")

    def _float(self, instruction: str) -> TypedValue:
        return TypedValue(FLOAT, (self.writer.value(instruction),))

    def _power(self, base: TypedValue | Known, exponent: TypedValue | Known) -> TypedValue:
        if self.number(exponent).kind == FLOAT or self.number(base).kind == FLOAT:
            return self.intrinsic("pow", [base, exponent])
        if not (isinstance(base, Known) and base.value == 2):
            raise TypeError("powers of whole numbers other than 2")
        return self.binary(ast.LShift(), Known(1), exponent if isinstance(exponent, Known) else self.whole(exponent))

    def _shifted(self, instruction: str, a: TypedValue, b: TypedValue) -> TypedValue:
        """Shift by any number of bits: by 64 and more, or fewer than none, all are lost."""
        value = self.writer.value
        if instruction == "ashr":
            bits = value(f"call i64 @llvm.umin.i64(i64 {b.register}, i64 63)")
            return TypedValue(a.kind, (value(f"ashr i64 {a.register}, {bits}"),))
        few, shifted = value(f"icmp ult i64 {b.register}, 64"), value(f"{instruction} i64 {a.register}, {b.register}")
        return TypedValue(a.kind, (value(f"select i1 {few}, i64 {shifted}, i64 0"),))

    def _divided(self, wants_rest: bool, a: TypedValue, b: TypedValue, constant: int | None) -> TypedValue:
        """Divide whole numbers: the quotient is rounded down, and the rest has the sign of the divisor.

        The processor is not asked for quotients by 0 and -1, at some of which it ends the process.
        """
        one, other = a.register, b.register
        if constant is not None and constant > 0 and constant & (constant - 1) == 0:
            bits = int(constant).bit_length() - 1
            text = f"and i64 {one}, {constant - 1}" if wants_rest else f"ashr i64 {one}, {bits}"
            return TypedValue(WHOLE, (self.writer.value(text),))
        value = self.writer.value
        known = value(f"icmp ult i64 {value(f'add i64 {other}, 1')}, 2")
        safe = value(f"select i1 {known}, i64 1, i64 {other}")
        quotient, rest = value(f"sdiv i64 {one}, {safe}"), value(f"srem i64 {one}, {safe}")
        signs, uneven = value(f"xor i64 {rest}, {safe}"), value(f"icmp ne i64 {rest}, 0")
        differ = value(f"icmp slt i64 {signs}, 0")
        wrong = value(f"and i1 {differ}, {uneven}")
        if wants_rest:
            moved = value(f"add i64 {rest}, {safe}")
            result = value(f"select i1 {wrong}, i64 {moved}, i64 {rest}")
        else:
            moved = value(f"sub i64 {quotient}, 1")
            result = value(f"select i1 {wrong}, i64 {moved}, i64 {quotient}")
        alone = "0" if wants_rest else value(f"mul i64 {one}, {other}")
        return TypedValue(WHOLE, (value(f"select i1 {known}, i64 {alone}, i64 {result}"),))

    def _remainder_of_floats(self, a: TypedValue, b: TypedValue) -> TypedValue:
        """Return the remainder that has the sign of the divisor."""
        zero = literal(0.0)
        rest = self._float(f"frem double {a.register}, {b.register}")
        negative, below = self.compared(ast.Lt(), rest, zero), self.compared(ast.Lt(), b, zero)
        differ = TypedValue(TRUTH, (self.writer.value(f"xor i1 {negative.register}, {below.register}"),))
        moved = self._float(f"fadd double {rest.register}, {b.register}")
        some = self.selected(differ, moved, rest)
        return self.selected(self.compared(ast.Eq(), rest, zero), self.intrinsic("copysign", [zero, b]), some)
