"""Instructions of LLVM, written as text: values in, values out.

A value is a number, which all lanes share, a vector with a number for each of `width` lanes, or the result of a
comparison of either.  An operation on a number and a vector broadcasts the number.  Multiplications and additions carry
the flag ``contract``, which allows fused multiply-adds and nothing else: tests for NaN keep their meaning.

Operators of Python between values, or between values and numbers, write the instructions for them.
"""

from __future__ import annotations

import functools
import operator
import struct
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, TypeVar

T = TypeVar("T")

_LATE = 2


def _operator(instruction: str, swapped: bool = False) -> Callable[[Any, Any], Any]:
    """Return the method of a value that writes an operation with another one, or with a number."""

    def write(self: Value, other: Value | float) -> Value:
        right = value_of(other)
        code = self.code or right.code
        assert code is not None, "one of two values comes from a function"
        apply = code.compare if instruction.startswith("o") else code.binary
        return apply(instruction, right, self) if swapped else apply(instruction, self, right)

    return write


@dataclass(slots=True, eq=False)
class Value:
    """A name or a literal, and what it stands for: "double", "i1", or a vector of either.

    ``code`` is the function that it belongs to; a literal belongs to any.  ``written`` counts the instructions of it
    until there for a vector, and is 0 for what all lanes share, on which none of them waits.
    """

    text: str
    vector: bool = False
    flag: bool = False
    literal: float | None = None
    code: Instructions | None = field(default=None, repr=False)
    written: int = 0

    __add__, __radd__ = _operator("fadd"), _operator("fadd", swapped=True)
    __sub__, __rsub__ = _operator("fsub"), _operator("fsub", swapped=True)
    __mul__, __rmul__ = _operator("fmul"), _operator("fmul", swapped=True)
    __truediv__, __rtruediv__ = _operator("fdiv"), _operator("fdiv", swapped=True)
    __lt__, __le__, __gt__, __ge__ = (_operator(relation) for relation in ("olt", "ole", "ogt", "oge"))

    def __neg__(self) -> Value:
        return self.function.number(-self.literal) if self.literal is not None else self.function.negative(self)

    def __abs__(self) -> Value:
        return self.function.intrinsic("fabs", self)

    def __and__(self, other: Value) -> Value:
        return self.function.logical("and", self, other)

    def __or__(self, other: Value) -> Value:
        return self.function.logical("or", self, other)

    def equals(self, other: Value | float) -> Value:
        """Compare; false for NaN."""
        return self.function.compare("oeq", self, value_of(other))

    def differs(self, other: Value | float) -> Value:
        """Compare; true for NaN."""
        return self.function.compare("une", self, value_of(other))

    @staticmethod
    def dot(pairs: Sequence[tuple[Value | float, Value]]) -> Value:
        """Return a sum of products, those of values written last at its end: they may have to be waited for.

        A long one is two chains side by side, each link of which waits for the one before, and the last two products.
        """
        terms = sorted(pairs, key=lambda pair: max(getattr(value, "written", 0) for value in pair))
        early, late = (terms[:-_LATE], terms[-_LATE:]) if len(terms) > 2 * _LATE + 1 else (terms, [])
        chains = [early[::2], early[1::2]] if late else [early]
        found = total(total(x * y for x, y in chain) for chain in chains)
        return functools.reduce(lambda known, pair: known + pair[0] * pair[1], late, found)

    @property
    def function(self) -> Instructions:
        """The function that it belongs to."""
        assert self.code is not None, "a literal belongs to no function"
        return self.code


def number(value: float, code: Instructions | None = None) -> Value:
    """Return a literal; its bits are written out, so that it is the same number on the other side."""
    return Value(f"0x{struct.pack('>d', value).hex().upper()}", literal=float(value), code=code)


def value_of(given: Value | float) -> Value:
    """Return a value as it is, and a number as a literal."""
    return given if isinstance(given, Value) else number(given)


def where(condition: Value, a: Value | float, b: Value | float) -> Value:
    """Return a where a condition holds, else b."""
    return condition.function.select(condition, value_of(a), value_of(b))


def total(terms: Iterable[Value]) -> Value:
    """Return a sum, from the first term to the last."""
    return functools.reduce(operator.add, terms)


def in_chains(items: Sequence[T], term: Callable[[T], Value]) -> Value | None:
    """Return the sum of the terms of items: a long one as two chains, each link of which waits for the one before."""
    parts = [items] if len(items) < 4 else [items[::2], items[1::2]]
    sums = [total(map(term, part)) for part in parts if part]
    return total(sums) if sums else None


def dot(pairs: Iterable[tuple[Value | float, Value]]) -> Value | None:
    """Return a sum of products as their values make it; None where there are none."""
    listed = list(pairs)
    return type(listed[0][1]).dot(listed) if listed else None


@dataclass
class Instructions:
    """The body of one function, instruction by instruction.

    ``width`` is the number of lanes of a vector, ``flags`` are those of arithmetic.  ``declared`` collects the
    functions of LLVM and of the C library that the body calls.
    """

    width: int
    flags: str = "contract"
    lines: list[str] = field(default_factory=list)
    declared: set[str] = field(default_factory=set)
    block: str = "entry"
    _count: int = 0
    _broadcast: dict[str, Value] = field(default_factory=dict)
    _before: list[str] | None = None

    def type_of(self, value: Value) -> str:
        """Return the type of a value."""
        return self.type(value.vector, value.flag)

    def type(self, vector: bool, flag: bool = False) -> str:
        """Return the type of numbers, or of results of comparisons, shared or of lanes."""
        scalar = "i1" if flag else "double"
        return f"<{self.width} x {scalar}>" if vector else scalar

    def write(self, line: str) -> None:
        """Append an instruction that has no result, or whose result has a name of its own."""
        self.lines.append("  " + line)

    def result(self, instruction: str, vector: bool = False, flag: bool = False) -> Value:
        """Append an instruction and return its result."""
        return self._append(self.lines, instruction, vector, flag)

    def _operation(self, instruction: str, vector: bool = False, flag: bool = False) -> Value:
        """Append an operation; inside a loop over lanes, one on numbers that all lanes share stands before the loop."""
        before = self.lines if vector or self._before is None else self._before
        return self._append(before, instruction, vector, flag)

    def _append(self, lines: list[str], instruction: str, vector: bool, flag: bool) -> Value:
        self._count += 1
        value = Value(f"%v{self._count}", vector, flag, None, self, self._count if vector else 0)
        lines.append(f"  {value.text} = {instruction}")
        return value

    def argument(self, name: str) -> Value:
        """Return a number that the function is called with."""
        return Value(name, code=self)

    def number(self, value: float) -> Value:
        """Return a literal of this function."""
        return number(value, self)

    def reciprocal(self, whole: int) -> Any:
        """Return one divided by a whole number, as a factor."""
        return 1.0 / whole

    # Arithmetic.

    def as_vector(self, value: Value) -> Value:
        """Return a value with its number in every lane."""
        if value.vector:
            return value
        scalar, vector = self.type(False, value.flag), self.type(True, value.flag)
        if value.literal is not None:
            return Value(f"<{', '.join([f'{scalar} {value.text}'] * self.width)}>", True, value.flag, None, self)
        known = self._broadcast.get(value.text)
        if known is None:
            first = self.result(f"insertelement {vector} poison, {scalar} {value.text}, i32 0")
            shuffle = f"shufflevector {vector} {first.text}, {vector} poison, <{self.width} x i32> zeroinitializer"
            known = self._broadcast[value.text] = self.result(shuffle, True, value.flag)
        return known

    def alike(self, *values: Value) -> tuple[Value, ...]:
        """Return values as vectors, if one of them is a vector."""
        return tuple(map(self.as_vector, values)) if any(v.vector for v in values) else values

    def binary(self, operation: str, a: Value, b: Value) -> Value:
        """Apply fadd, fsub, fmul, fdiv."""
        a, b = self.alike(a, b)
        flagged = f"{operation} {self.flags}".strip()
        return self._operation(f"{flagged} {self.type_of(a)} {a.text}, {b.text}", a.vector)

    def negative(self, a: Value) -> Value:
        """Return a number with the other sign."""
        return self._operation(f"fneg {self.type_of(a)} {a.text}", a.vector)

    def compare(self, relation: str, a: Value, b: Value) -> Value:
        """Compare by olt, ole, ogt, oge, oeq (false for NaN) or une (true for NaN)."""
        a, b = self.alike(a, b)
        return self._operation(f"fcmp {relation} {self.type_of(a)} {a.text}, {b.text}", a.vector, True)

    def logical(self, operation: str, a: Value, b: Value) -> Value:
        """Apply and, or."""
        a, b = self.alike(a, b)
        return self._operation(f"{operation} {self.type_of(a)} {a.text}, {b.text}", a.vector, True)

    def over_lanes(self, operation: str, flags: Value) -> str:
        """Join the results of a comparison in all lanes by and, or; return the name of the one that is left."""
        kind = f"v{self.width}i1"
        self.declared.add(f"declare i1 @llvm.vector.reduce.{operation}.{kind}({self.type_of(flags)})")
        return self.result(f"call i1 @llvm.vector.reduce.{operation}.{kind}({self.type_of(flags)} {flags.text})").text

    def select(self, condition: Value, a: Value, b: Value) -> Value:
        """Return a where the condition holds, else b."""
        if condition.vector:
            a, b = self.as_vector(a), self.as_vector(b)
        a, b = self.alike(a, b)
        if a.vector and not condition.vector:
            condition = self.as_vector(condition)
        what = f"{self.type_of(condition)} {condition.text}, {self.type_of(a)} {a.text}, {self.type_of(b)} {b.text}"
        return self._operation(f"select {what}", a.vector, a.flag)

    def seldom(self, condition: Value, name: str, arguments: list[Value], otherwise: Value) -> Value:
        """Call a function of the C library for the lanes where a condition holds, if there are any."""
        condition, otherwise, *arguments = self.alike(condition, otherwise, *arguments)
        if not condition.vector and self._before is not None:  # it stands before the loop, where no block may begin
            return self.select(condition, self.libm(name, *arguments), otherwise)
        self._count += 1
        label, kind, known, before = f"seldom{self._count}", self.type_of(otherwise), self._broadcast, self.block
        asked = self.over_lanes("or", condition) if condition.vector else condition.text
        self.write(f"br i1 {asked}, label %{label}, label %{label}.not")
        self.label(label)
        found = self._called_for_lanes(name, *arguments) if condition.vector else self.libm(name, *arguments)
        chosen = self.select(condition, found, otherwise)
        self.jump(f"{label}.not")
        self.label(f"{label}.not")
        self._broadcast = known
        return self.result(f"phi {kind} [{otherwise.text}, %{before}], [{chosen.text}, %{label}]", otherwise.vector)

    def _called_for_lanes(self, name: str, *arguments: Value) -> Value:
        """Call a function of the C library for all lanes in a function of its own: code that is seldom run is short."""
        body, kind = Instructions(self.width), self.type(True)
        parts = [Value(f"%a{i}", True) for i in range(len(arguments))]
        total = body.libm(name, *parts).text
        given = ", ".join(f"{kind} {part.text}" for part in parts)
        lines = "\n".join([*body.lines, f"  ret {kind} {total}"])
        function = f"@lanes.{name}.{self.width}"
        self.declared |= {
            *body.declared,
            f"define internal {kind} {function}({given}) cold noinline #0 {{\n{lines}\n}}",
        }
        return self.result(f"call {kind} {function}({', '.join(f'{kind} {a.text}' for a in arguments)})", True)

    def intrinsic(self, name: str, *arguments: Value) -> Value:
        """Call a function of LLVM, such as sqrt or floor."""
        arguments = self.alike(*arguments)
        kind, vector = self.type_of(arguments[0]), arguments[0].vector
        function = f"@llvm.{name}.{f'v{self.width}f64' if vector else 'f64'}"
        self.declared.add(f"declare {kind} {function}({', '.join([kind] * len(arguments))})")
        given = ", ".join(f"{kind} {a.text}" for a in arguments)
        return self._operation(f"call {kind} {function}({given})", vector)

    def libm(self, name: str, *arguments: Value) -> Value:
        """Call a function of the C library, once for each lane."""
        self.declared.add(f"declare double @{name}({', '.join(['double'] * len(arguments))})")
        arguments = self.alike(*arguments)

        def call_text(scalars: list[str]) -> str:
            return f"call double @{name}({', '.join(f'double {s}' for s in scalars)})"

        if not arguments[0].vector:
            return self._operation(call_text([a.text for a in arguments]))
        kind, total = self.type(True), Value("poison", True)
        for i in range(self.width):
            lanes = [self.result(f"extractelement {kind} {a.text}, i32 {i}").text for a in arguments]
            value = self.result(call_text(lanes))
            total = self.result(f"insertelement {kind} {total.text}, double {value.text}, i32 {i}", True)
        return total

    def power_of_two(self, exponent: Value) -> Value:
        """Return 2 to a whole number, by its bits."""
        whole = f"<{self.width} x i64>" if exponent.vector else "i64"

        def constant(value: int) -> str:
            return f"<{', '.join([f'i64 {value}'] * self.width)}>" if exponent.vector else str(value)

        kind = self.type_of(exponent)
        bits = self._operation(f"fptosi {kind} {exponent.text} to {whole}", exponent.vector)
        biased = self._operation(f"add {whole} {bits.text}, {constant(1023)}", exponent.vector)
        shifted = self._operation(f"shl {whole} {biased.text}, {constant(52)}", exponent.vector)
        return self._operation(f"bitcast {whole} {shifted.text} to {kind}", exponent.vector)

    def negative_if_odd(self, a: Value, units: Value) -> Value:
        """Return a number, with the other sign where the last bit of another one is set."""
        kind, whole = self.type_of(a), f"<{self.width} x i64>" if a.vector else "i64"
        shift = f"<{', '.join(['i64 63'] * self.width)}>" if a.vector else "63"
        bits, last = (self._operation(f"bitcast {kind} {v.text} to {whole}", a.vector).text for v in (a, units))
        sign = self._operation(f"shl {whole} {last}, {shift}", a.vector).text
        changed = self._operation(f"xor {whole} {bits}, {sign}", a.vector).text
        return self._operation(f"bitcast {whole} {changed} to {kind}", a.vector)

    def exponent_and_mantissa(self, a: Value) -> tuple[Value, Value]:
        """Return a whole number n and f in [1, 2) such that a positive normal number is 2^n f, by its bits."""
        kind, whole = self.type_of(a), f"<{self.width} x i64>" if a.vector else "i64"

        def bitwise(operation: str, bits: str, operand: int) -> str:
            constant = f"<{', '.join([f'i64 {operand}'] * self.width)}>" if a.vector else str(operand)
            return self._operation(f"{operation} {whole} {bits}, {constant}", a.vector).text

        bits = self._operation(f"bitcast {kind} {a.text} to {whole}", a.vector).text
        power = bitwise("sub", bitwise("lshr", bits, 52), 1023)
        fraction = bitwise("or", bitwise("and", bits, 2**52 - 1), 1023 << 52)
        exponent = self._operation(f"sitofp {whole} {power} to {kind}", a.vector)
        return exponent, self._operation(f"bitcast {whole} {fraction} to {kind}", a.vector)

    # Memory.

    def address(self, base: str, index: str | int) -> str:
        """Return the address of an element of an array of eight-byte numbers."""
        return self.result(f"getelementptr double, ptr {base}, i64 {index}").text

    def load(self, address: str, vector: bool = False) -> Value:
        """Load a number, or the numbers of neighbouring lanes."""
        return self.result(f"load {self.type(vector)}, ptr {address}, align 8", vector)

    def store(self, value: Value, address: str) -> None:
        """Store a number, or the numbers of neighbouring lanes."""
        self.write(f"store {self.type_of(value)} {value.text}, ptr {address}, align 8")

    def load_whole(self, address: str) -> str:
        """Load a whole number; return its name."""
        return self.result(f"load i64, ptr {address}, align 8").text

    def store_whole(self, value: str | int, address: str) -> None:
        """Store a whole number."""
        self.write(f"store i64 {value}, ptr {address}, align 8")

    def whole(self, operation: str, a: str | int, b: str | int) -> str:
        """Apply add, sub, mul, shl, ashr, or to whole numbers; return the name of the result."""
        return self.result(f"{operation} i64 {a}, {b}").text

    def array(self, size: int, kind: str = "double") -> str:
        """Reserve memory until the function returns; to be called at its beginning.  Return its address."""
        return self.result(f"alloca [{size} x {kind}], align 64").text

    # Control.

    def jump(self, name: str) -> None:
        """Go on at a label."""
        self.write(f"br label %{name}")

    def branch(self, relation: str, a: str | int, b: str | int, then: str, otherwise: str) -> None:
        """Compare whole numbers by eq, ne, slt, sgt, and go on at one of two labels, the first of which begins here."""
        condition = self.result(f"icmp {relation} i64 {a}, {b}").text
        self.write(f"br i1 {condition}, label %{then}, label %{otherwise}")
        self.label(then)

    def label(self, name: str) -> None:
        """Begin a block.  Broadcasts of other blocks may not have been made on the way to it."""
        self.lines.append(f"{name}:")
        self.block, self._broadcast = name, {}

    @contextmanager
    def loop(self, name: str, count: str | int, step: int = 1) -> Iterator[str]:
        """Repeat what is written inside for an index from 0 to below a count."""
        index, before = f"%{name}", self.block
        self.write(f"br label %{name}.test")
        self.label(f"{name}.test")
        self.write(f"{index} = phi i64 [0, %{before}], [%{name}.next, %{name}.end]")
        self.write(f"%{name}.more = icmp slt i64 {index}, {count}")
        self.write(f"br i1 %{name}.more, label %{name}.body, label %{name}.done")
        self.label(f"{name}.body")
        yield index
        self.write(f"br label %{name}.end")
        self.label(f"{name}.end")
        self.write(f"%{name}.next = add i64 {index}, {step}")
        self.write(f"br label %{name}.test")
        self.label(f"{name}.done")

    @contextmanager
    def loop_over_lanes(self, lanes: str | int, name: str = "lane") -> Iterator[str]:
        """Repeat what is written inside for each vector of lanes, given the number of its first lane."""
        lines, self.lines, self._before = self.lines, [], []
        with self.loop(name, lanes, self.width) as lane:
            yield lane
        self.lines, self._before = [*lines, *self._before, *self.lines], None

    def function(self, name: str, arguments: str) -> str:
        """Return the text of the function whose body this is; `arguments` with their types."""
        body = "\n".join(self.lines)
        return f"define void @{name}({arguments}) #0 {{\nentry:\n{body}\n  ret void\n}}\n"


def module_text(functions: str, *bodies: Instructions) -> str:
    """Return the text of a module of functions, with the declarations that their bodies need.

    The stack is aligned for the vectors that are kept there, none of which then lies across two lines of the cache.
    """
    declared = "\n".join(sorted(set().union(*(body.declared for body in bodies))))
    return f'{declared}\n{functions}\nattributes #0 = {{ nounwind "prefer-vector-width"="512" "stackrealign" }}\n'
