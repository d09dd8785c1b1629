"""Expressions of the language."""

from __future__ import annotations

import ast
import builtins
import math
import operator
from collections.abc import Mapping
from types import ModuleType
from typing import Any

import numpy as np

from .arrays import Arrays, Index
from .marks import ArrayAt, ByAddress, Deferred
from .numbers import INTRINSICS, NUMBERS, Arithmetic
from .values import (
    AGAIN,
    CONTIGUOUS,
    FLOAT,
    HERE,
    REGISTERS,
    SEEN_AGAIN,
    TRUTH,
    WHOLE,
    ArrayKind,
    Kind,
    Known,
    PointerKind,
    TupleKind,
    TypedValue,
    element_of,
    items_of,
    joined,
    lasting,
    made,
    parts_of,
    registers,
    tuple_of,
    typed,
)
from .writer import Writer

_FOLDED: dict[type[ast.AST], Any] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv, ast.Mod: operator.mod, ast.Pow: operator.pow, ast.LShift: operator.lshift,
    ast.RShift: operator.rshift, ast.BitAnd: operator.and_, ast.BitOr: operator.or_, ast.BitXor: operator.xor,
    ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt, ast.GtE: operator.ge, ast.Eq: operator.eq,
    ast.NotEq: operator.ne, ast.USub: operator.neg, ast.Not: operator.not_,
}  # fmt: skip
_NEW: dict[Any, bool] = {np.empty: False, np.zeros: True, np.ones: False, np.empty_like: False}
_GIVEN: dict[Any, Any] = {
    **dict.fromkeys([*NUMBERS, *INTRINSICS, abs, len, np.empty_like], (1,)),
    **dict.fromkeys([np.empty, np.zeros, np.ones], (1, 2)),
    **dict.fromkeys([math.copysign, np.copysign], (2,)),
    **dict.fromkeys([min, max], range(2, 256)),
}  # how many arguments a function is given


class Expressions:
    """Translation of expressions; constants are worked out at once."""

    def __init__(
        self,
        module: Any,
        what: Deferred,
        given: dict[str, TypedValue],
        names: Mapping[str, int],
        kinds: dict[str, Kind],
    ) -> None:
        self.module, self.kinds = module, kinds
        self._own = {*names, *given}
        self.bound = set(given)  # what has a value, whatever way a run takes to here
        self.fixed = {name: value for name, value in given.items() if name not in names}
        self.once = {name for name, places in names.items() if places == 1 and name not in given}
        self.places: dict[str, list[str]] = {}
        function = what.function
        cells = zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
        self._around = {**vars(builtins), **function.__globals__, **{name: cell.cell_contents for name, cell in cells}}
        self.writer = Writer(what.vectors)
        self.numbers = Arithmetic(self.writer, "contract" if what.contract else "")
        self.arrays = Arrays(self.writer, self.numbers, self._refusal, module.checked)
        self.kept: list[str] = []
        self.refusals: list[str] = []
        self.may_fail = False
        self.line = what.function.__code__.co_firstlineno
        self.turns: list[tuple[str, str, list[set[str]]]] = []  # loops around: where they go on, end, and broke off
        self.making: list[ast.expr] = []  # what the names of an assignment are given
        self._leaves: list[str] = []
        self._blocks_of_codes: dict[int, str] = {}

    def variable(self, name: str) -> TypedValue | None:
        """Return the value of a variable; None where the name is not one."""
        fixed = self.fixed.get(name)
        if fixed is None and name not in self.places:
            return None
        if name not in self.bound:
            raise TypeError(f"{name} may have no value here")
        if fixed is not None:
            kind, found = fixed.kind, fixed.registers
        else:
            kind = self.kinds[name]
            pairs = zip(registers(kind), self.places[name], strict=True)
            found = tuple(self.writer.value(f"load {t}, ptr {place}") for t, place in pairs)
        return TypedValue(lasting(kind, SEEN_AGAIN) if made(kind) == AGAIN else kind, found)

    def value(self, found: TypedValue | Known) -> TypedValue:
        """Return a constant as the number or tuple that it is."""
        if isinstance(found, Known) and isinstance(found.value, tuple):
            items = [self.value(Known(item)) for item in found.value]
            return tuple_of(items, getattr(found.value, "_fields", ()))
        return self.numbers.number(found) if isinstance(found, Known) else found

    def known(self, node: ast.expr) -> Known | None:
        """Return what an expression is, where that is known without running anything."""
        if isinstance(node, ast.Constant):
            return Known(node.value)
        if isinstance(node, ast.Name):
            if node.id in self._around and node.id not in self._own:
                return Known(self._around[node.id])
            return None
        if not isinstance(node, ast.Attribute | ast.BinOp | ast.UnaryOp | ast.Compare | ast.Tuple):
            return None
        values = []
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.expr):
                part = self.known(child)
                if part is None:
                    return None
                values.append(part.value)
        if isinstance(node, ast.Attribute):
            is_known = isinstance(values[0], ModuleType) or node.attr in getattr(values[0], "_fields", ())
            return Known(getattr(values[0], node.attr)) if is_known else None
        if isinstance(node, ast.BinOp):
            return Known(_FOLDED[type(node.op)](*values))
        if isinstance(node, ast.UnaryOp):
            return Known(_FOLDED[type(node.op)](values[0]))
        if isinstance(node, ast.Compare) and len(node.ops) == 1:
            return Known(_FOLDED[type(node.ops[0])](*values))
        if isinstance(node, ast.Tuple):
            return Known(tuple(values))
        return None

    def expression(self, node: ast.expr) -> TypedValue | Known:
        """Return the value of an expression."""
        known = self.known(node)
        if known is not None:
            return known
        written: TypedValue | Known = getattr(self, f"_of_{type(node).__name__.lower()}")(node)
        return written

    def array(self, node: ast.expr) -> TypedValue:
        """Return the array that an expression is."""
        value = self.expression(node)
        if not isinstance(value, TypedValue) or not isinstance(value.kind, ArrayKind):
            raise TypeError(f"{ast.unparse(node)} is no array")
        return value

    def listed(self, value: TypedValue | Known) -> TypedValue:
        """Return an array, or constants as one."""
        if isinstance(value, TypedValue):
            return value
        name, kind = self.module.constants(value.value)
        return TypedValue(ArrayKind(kind, 1, writeable=False), (name, str(len(value.value))))

    def items(self, value: TypedValue | Known, count: int = 0) -> list[TypedValue | Known]:
        """Return the items of a tuple, or the first ones of an array."""
        if isinstance(value, Known):
            return [Known(item) for item in value.value]
        if isinstance(value.kind, ArrayKind) and count:
            self.arrays.require_equal(self.arrays.shape(value)[0], str(count))
            return [self.arrays.indexed(value, [Known(place)]) for place in range(count)]
        if not isinstance(value.kind, TupleKind):
            raise TypeError(f"a value of the kind {value.kind} is no tuple")
        return list(items_of(value))

    def indices(self, node: ast.expr) -> list[Index]:
        """Return the indices in brackets."""
        found: list[Index] = []
        for one in node.elts if isinstance(node, ast.Tuple) else [node]:
            if isinstance(one, ast.Slice):
                ends = [None if end is None else self.expression(end) for end in (one.lower, one.upper)]
                found.append((ends[0], ends[1]))
            else:
                found.append(self.expression(one))
        return found

    def condition(self, node: ast.expr, then: str, otherwise: str, wants_bool: bool = False) -> None:
        """Go on with one of two blocks; what does not matter is not looked at."""
        known = self.known(node)
        if known is not None:
            if wants_bool and not isinstance(known.value, bool):
                raise TypeError(f"`and` or `or` of {ast.unparse(node)}, which is no bool")
            self.writer.jump(then if known.value else otherwise)
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            self.condition(node.operand, otherwise, then)
        elif isinstance(node, ast.BoolOp):
            for one in node.values[:-1]:
                following = self.writer.label()
                if isinstance(node.op, ast.And):
                    self.condition(one, following, otherwise, wants_bool)
                else:
                    self.condition(one, then, following, wants_bool)
                self.writer.begin(following)
            self.condition(node.values[-1], then, otherwise, wants_bool)
        else:
            found = self.expression(node)
            if wants_bool and not (isinstance(found, TypedValue) and found.kind == TRUTH):
                raise TypeError(f"`and` or `or` of {ast.unparse(node)}, which is no bool")
            self.writer.branch(self.numbers.truth(found).register, then, otherwise)

    def _refusal(self, code: int) -> str:
        """Return the block that ends the function with a code."""
        self.may_fail = True
        if code not in self._blocks_of_codes:
            label = self._blocks_of_codes[code] = self.writer.label()
            self.refusals += [f"{label}:", f"  store i32 {code}, ptr %failure", "  br label %exit"]
        return self._blocks_of_codes[code]

    def _of_name(self, node: ast.Name) -> TypedValue:
        value = self.variable(node.id)
        if value is None:
            raise TypeError(f"{node.id} has no value here")
        return value

    def _of_tuple(self, node: ast.Tuple) -> TypedValue:
        return tuple_of([self.value(self.expression(one)) for one in node.elts])

    def _of_attribute(self, node: ast.Attribute) -> TypedValue:
        value = self.expression(node.value)
        if isinstance(value, Known):
            raise TypeError(f"{ast.unparse(node)} is not in the language")
        if isinstance(value.kind, TupleKind) and node.attr in value.kind.names:
            return list(items_of(value))[value.kind.names.index(node.attr)]
        if isinstance(value.kind, ArrayKind):
            shape = [TypedValue(WHOLE, (length,)) for length in self.arrays.shape(value)]
            if node.attr == "shape":
                return tuple_of(shape)
            if node.attr == "size":
                size: TypedValue | Known = Known(1)
                for length in shape:
                    size = self.numbers.binary(ast.Mult(), size, length)
                return self.numbers.number(size)
        raise TypeError(f"{ast.unparse(node)}: no such field of a value of the kind {value.kind}")

    def _of_subscript(self, node: ast.Subscript) -> TypedValue | Known:
        value, indices = self.expression(node.value), self.indices(node.slice)
        if isinstance(value, TypedValue) and isinstance(value.kind, ArrayKind):
            return self.arrays.indexed(value, indices)
        (place,) = indices
        if isinstance(value, TypedValue) and isinstance(value.kind, PointerKind):
            return self.arrays.indexed(self._array_at(value, Known(2**62)), indices)
        if not isinstance(place, Known):
            if isinstance(value, Known):
                return self.arrays.indexed(self.listed(value), indices)
            raise TypeError(f"{ast.unparse(node)}: the place in a tuple has to be a constant")
        return self.items(value)[place.value]

    def _of_binop(self, node: ast.BinOp) -> TypedValue:
        return self.numbers.binary(node.op, self.expression(node.left), self.expression(node.right))

    def _of_unaryop(self, node: ast.UnaryOp) -> TypedValue | Known:
        if isinstance(node.op, ast.Not):
            truth = self.numbers.truth(self.expression(node.operand))
            return TypedValue(TRUTH, (self.writer.value(f"xor i1 {truth.register}, true"),))
        return self.numbers.negative(self.expression(node.operand))

    def _of_compare(self, node: ast.Compare) -> TypedValue:
        left, found, w = self.expression(node.left), "", self.writer
        place, after = "", ""
        for comparison, other in zip(node.ops, node.comparators, strict=True):
            if found and any(map(self._looks, ast.walk(other))):  # no more where a comparison before has failed
                place, after, following = place or w.memory("i1"), after or w.label(), w.label()
                w.write(f"store i1 {found}, ptr {place}")
                w.branch(found, following, after)
                w.begin(following)
            right = self.expression(other)
            one = self.numbers.compared(comparison, left, right).register
            found = w.value(f"and i1 {found}, {one}") if found else one
            left = right
        if after:
            w.write(f"store i1 {found}, ptr {place}")
            w.begin(after)
            found = w.value(f"load i1, ptr {place}")
        return TypedValue(TRUTH, (found,))

    def _looks(self, node: ast.AST) -> bool:
        """Tell whether an expression reads an array, or may do anything else."""
        if isinstance(node, ast.Subscript):
            return not (isinstance(node.value, ast.Attribute) and node.value.attr == "shape")
        known = self.known(node.func) if isinstance(node, ast.Call) else None
        return known is not None and isinstance(known.value, Deferred)

    def _of_boolop(self, node: ast.BoolOp) -> TypedValue:
        w = self.writer
        then, otherwise, after = w.label(), w.label(), w.label()
        place = w.memory("i1")
        self.condition(node, then, otherwise, wants_bool=True)
        for label, truth in ((then, "true"), (otherwise, "false")):
            w.begin(label)
            w.write(f"store i1 {truth}, ptr {place}")
            w.jump(after)
        w.begin(after)
        return TypedValue(TRUTH, (w.value(f"load i1, ptr {place}"),))

    def _of_ifexp(self, node: ast.IfExp) -> TypedValue | Known:
        known = self.known(node.test)
        if known is not None:
            return self.expression(node.body if known.value else node.orelse)
        w = self.writer
        then, otherwise, after = w.label(), w.label(), w.label()
        self.condition(node.test, then, otherwise)
        found, ends = [], []
        for label, one in ((then, node.body), (otherwise, node.orelse)):
            w.begin(label)
            found.append(self.numbers.number(self.expression(one)))
            ends.append(w.label())
            w.begin(ends[-1])  # to be written on where the kind of both is known
            w.lines.append("")
        kind = FLOAT if FLOAT in (found[0].kind, found[1].kind) else joined(found[0].kind, found[1].kind)
        place = w.memory(REGISTERS[str(kind)])
        later = w.lines
        for end, value in zip(ends, found, strict=True):
            w.lines, w.ended = [], False
            register = self.numbers.converted(value, str(kind)).register
            w.write(f"store {REGISTERS[str(kind)]} {register}, ptr {place}")
            w.jump(after)
            at = later.index(f"{end}:") + 1
            later[at : at + 1] = w.lines
        w.lines, w.ended = later, True
        w.begin(after)
        return TypedValue(kind, (w.value(f"load {REGISTERS[str(kind)]}, ptr {place}"),))

    def _of_call(self, node: ast.Call) -> TypedValue | Known:
        known = self.known(node.func)
        if known is None:
            if isinstance(node.func, ast.Attribute) and node.func.attr == "_replace" and not node.args:
                before = self.value(self.expression(node.func.value))
                names = before.kind.names if isinstance(before.kind, TupleKind) else ()
                return self._record(node, names, dict(zip(names, self.items(before), strict=bool(names))))
            raise TypeError(f"{ast.unparse(node.func)} is not known")
        function = known.value
        if isinstance(function, type) and issubclass(function, tuple) and hasattr(function, "_fields"):
            defaults: dict[str, Any] = getattr(function, "_field_defaults", {})
            return self._record(node, function._fields, {name: Known(value) for name, value in defaults.items()})
        if node.keywords:
            raise TypeError(f"arguments by name are not in the language: {ast.unparse(node)}")
        counts = _GIVEN.get(function) if function.__hash__ else None
        if counts is not None and len(node.args) not in counts:
            raise TypeError(f"{ast.unparse(node.func)} with {len(node.args)} arguments is not in the language")
        if function in _NEW:
            return self._new(node)
        given = [self.expression(one) for one in node.args]
        if isinstance(function, ByAddress):
            return self._called_by_address(function, given)
        if isinstance(function, ArrayAt):
            return self._array_at(*given)
        if isinstance(function, Deferred):
            return self._called(function, given)
        if function in NUMBERS:
            return self.numbers.converted(given[0], NUMBERS[function])
        if function in INTRINSICS:
            return self.numbers.intrinsic(INTRINSICS[function], given)
        if function in (min, max):
            return self.numbers.extreme(ast.Lt() if function is min else ast.Gt(), given)
        if function is abs:
            return self.numbers.absolute(given[0])
        if function is len and isinstance(given[0], TypedValue):
            return TypedValue(WHOLE, (self.arrays.shape(given[0])[0],))
        raise TypeError(f"{ast.unparse(node.func)} is not in the language")

    def _record(self, node: ast.Call, names: tuple[str, ...], others: Mapping[str, TypedValue | Known]) -> TypedValue:
        """Return a named tuple of arguments by place and by name; fields that are not given have those of others."""
        what, given = ast.unparse(node.func), dict[str, TypedValue | Known]()
        if len(node.args) > len(names):
            raise TypeError(f"{what} has {len(names)} fields, not {len(node.args)}")
        for name, one in [*zip(names, node.args, strict=False), *((one.arg, one.value) for one in node.keywords)]:
            if name not in names:
                raise TypeError(f"{what} has no field {name or '**'}")
            if name in given:
                raise TypeError(f"{what} is given {name} twice")
            given[name] = self.expression(one)
        found = {**others, **given}
        if lacking := [name for name in names if name not in found]:
            raise TypeError(f"{what} is not given {', '.join(lacking)}")
        return tuple_of([self.value(found[name]) for name in names], names)

    def _new(self, node: ast.Call) -> TypedValue:
        known, given = self.known(node.func), node.args
        assert known is not None
        function = known.value
        if self.turns and node not in self.making:
            raise TypeError("an array that is made in a loop is given a name at once: name = np.empty(...)")
        if function is np.empty_like:
            model = self.array(given[0])
            assert isinstance(model.kind, ArrayKind)
            lengths: list[TypedValue | Known] = [TypedValue(WHOLE, (length,)) for length in self.arrays.shape(model)]
            element = model.kind.element
        else:
            shape = self.expression(given[0])
            is_tuple = isinstance(shape.value, tuple) if isinstance(shape, Known) else isinstance(shape.kind, TupleKind)
            lengths = self.items(shape) if is_tuple else [shape]
            chosen = self.known(given[1]) if len(given) > 1 else Known(np.float64)
            if chosen is None:
                raise TypeError(f"{ast.unparse(given[1])} is no type of elements")
            element = element_of(chosen.value)
        array = self.allocated(lengths, element, _NEW[function])
        if function is np.ones:
            self.arrays.assign(array, [(None, None)], Known(1))
        return TypedValue(lasting(array.kind, AGAIN if self.turns else HERE), array.registers)

    def allocated(self, lengths: list[TypedValue | Known], element: str, zero: bool = False) -> TypedValue:
        """Return a new array, whose memory is given back when its successor is made, and at the end."""
        self.kept.append(self.writer.memory("ptr", "null"))
        return self.arrays.allocated(lengths, element, self.kept[-1], zero)

    def _called_by_address(self, what: ByAddress, given: list[TypedValue | Known]) -> TypedValue:
        handed = []
        if len(given) != what.function.__code__.co_argcount:
            raise TypeError(f"{what.function.__qualname__} does not take {len(given)} arguments")
        for one in parts_of(tuple_of([self.value(value) for value in given[1:]])):
            whole = one.kind.layout == CONTIGUOUS if isinstance(one.kind, ArrayKind) else len(one.registers) == 1
            if not whole:
                raise TypeError(f"a value of the kind {one.kind} is handed over by its address")
            handed.append(f"{registers(one.kind)[0]} {one.registers[0]}")
        address = self.numbers.whole(given[0]).register
        function = self.writer.value(f"inttoptr i64 {address} to ptr")
        self.writer.write(f"call void {function}({', '.join(handed)})")
        return TypedValue(None, ())

    def _array_at(self, address: TypedValue | Known, shape: TypedValue | Known) -> TypedValue:
        if isinstance(address, TypedValue) and isinstance(address.kind, PointerKind):
            kind, begin = address.kind, address.register
        else:
            whole = self.numbers.whole(address).register
            kind, begin = PointerKind(FLOAT), self.writer.value(f"inttoptr i64 {whole} to ptr")
        is_tuple = isinstance(shape, TypedValue) and isinstance(shape.kind, TupleKind)
        lengths = [self.numbers.whole(one) for one in (self.items(shape) if is_tuple else [shape])]
        return TypedValue(ArrayKind(kind.element, len(lengths)), (begin, *(length.register for length in lengths)))

    def _called(self, what: Deferred, given: list[TypedValue | Known]) -> TypedValue:
        values = [self.value(one) for one in given]
        callee = self.module.callee(what, tuple(lasting(value.kind, 0) for value in values))
        result_kind = lasting(callee.result, max((made(value.kind) for value in values), default=0))
        types = registers(callee.result)
        handed = [one for value in values for one in typed(value)]
        instruction = callee.call(handed, "%failure")
        if types:
            result = self.writer.value(instruction)
        else:
            self.writer.write(instruction)
        if callee.may_fail:
            self.may_fail = True
            going_on = self.writer.label()
            code = self.writer.value("load i32, ptr %failure")
            self.writer.branch(self.writer.value(f"icmp ne i32 {code}, 0"), "exit", going_on)
            self.writer.begin(going_on)
        if len(types) < 2:
            return TypedValue(result_kind, (result,) if types else ())
        text = "{" + ", ".join(types) + "}"
        parts = (self.writer.value(f"extractvalue {text} {result}, {k}") for k in range(len(types)))
        return TypedValue(result_kind, tuple(parts))
