"""Statements of the language."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from typing import Any

from .expressions import Expressions
from .marks import Deferred, Failure
from .values import (
    SEEN_AGAIN,
    WHOLE,
    ArrayKind,
    Kind,
    Known,
    TupleKind,
    TypedValue,
    items_of,
    joined,
    made,
    registers,
    tuple_of,
)


class Widened(Exception):
    """A variable turned out to need a wider type: the function is translated again from its beginning."""


class Statements(Expressions):
    """The body of a function: its variables, in memory that LLVM makes registers of, and its statements."""

    def __init__(
        self,
        module: Any,
        what: Deferred,
        given: dict[str, TypedValue],
        names: Mapping[str, int],
        kinds: dict[str, Kind],
        result: list[Kind],
    ) -> None:
        super().__init__(module, what, given, names, kinds)
        self._result = result
        self._ends_without = False
        self.conversions: list[str] = []
        self.results = [self.writer.memory(t) for t in registers(self.result)]
        for name in names:
            if name in given:
                self._place(name)

    @property
    def result(self) -> Kind:
        """The kind of what is returned, as far as that is known."""
        return self._result[0] if self._result else None

    def function(self, statements: list[ast.stmt]) -> None:
        """Write all statements."""
        self.block(statements)
        if self._result and (self._ends_without or not self.writer.ended):
            raise TypeError("the function may end without a result")

    def block(self, statements: list[ast.stmt]) -> None:
        """Write statements, one after the other."""
        for statement in statements:
            if self.writer.ended:
                return
            self.line = statement.lineno
            getattr(self, f"_{type(statement).__name__.lower()}")(statement)

    def fitted(self, value: TypedValue | Known, kind: Kind, first: bool = False) -> TypedValue:
        """Return a value as one of the kind of a variable; `first` writes what it takes before everything else."""
        if first:
            lines, self.writer.lines, ended = self.writer.lines, self.conversions, self.writer.ended
            self.writer.ended = False
            found = self.fitted(value, kind)
            self.writer.lines, self.writer.ended = lines, ended
            return found
        if isinstance(kind, str):
            return self.numbers.converted(value, kind)
        assert isinstance(value, TypedValue)
        if isinstance(kind, ArrayKind):
            return self.arrays.laid_out(value, kind.layout)
        if isinstance(kind, TupleKind):
            items = zip(items_of(value), kind.items, strict=True)
            return tuple_of([self.fitted(item, wanted) for item, wanted in items], kind.names)
        return value

    def _place(self, name: str) -> None:
        self.places[name] = [self.writer.memory(t) for t in registers(self.kinds[name])]

    def _set(self, name: str, value: TypedValue | Known) -> None:
        value = self.value(value)
        kind = value.kind
        if kind is None:
            raise TypeError(f"{name} is what a function returns that returns nothing")
        if made(kind) == SEEN_AGAIN:
            raise TypeError(f"{name} is an array made in a loop, or part of one, which has a name already")
        if name not in self.kinds:
            self.kinds[name] = kind
        elif self.kinds[name] != (wider := joined(self.kinds[name], kind)):
            self.kinds[name] = wider
            raise Widened
        fitted = self.fitted(value, self.kinds[name])
        if name in self.once:
            self.fixed[name] = fitted
        else:
            if name not in self.places:
                self._place(name)
            for t, register, place in zip(registers(fitted.kind), fitted.registers, self.places[name], strict=True):
                self.writer.write(f"store {t} {register}, ptr {place}")
        self.bound.add(name)

    def _assign_to(self, target: ast.expr, value: TypedValue | Known) -> None:
        if isinstance(target, ast.Name):
            self._set(target.id, value)
        elif isinstance(target, ast.Tuple):
            for one, item in zip(target.elts, self.items(value, len(target.elts)), strict=True):
                self._assign_to(one, item)
        elif isinstance(target, ast.Subscript):
            array, indices = self.array(target.value), self.indices(target.slice)
            if isinstance(value, TypedValue) and isinstance(value.kind, ArrayKind):  # it may be part of the target
                lengths: list[TypedValue | Known] = [
                    TypedValue(WHOLE, (length,)) for length in self.arrays.shape(value)
                ]
                source, value = value, self.allocated(lengths, value.kind.element)
                self.arrays.assign(value, [(None, None)], source)
            self.arrays.assign(array, indices, value)
        else:
            raise TypeError(f"an assignment to {ast.unparse(target)}")

    def _assign(self, statement: ast.Assign) -> None:
        given = statement.value.elts if isinstance(statement.value, ast.Tuple) else [statement.value]
        are_new = len(given) == 1 or not any(isinstance(part, ast.Subscript) for one in given for part in ast.walk(one))
        self.making = given if len(statement.targets) == 1 and are_new else []
        value = self.expression(statement.value)
        for target in statement.targets:
            self._assign_to(target, value)

    def _augassign(self, statement: ast.AugAssign) -> None:
        target = statement.target
        if isinstance(target, ast.Subscript):
            array, indices = self.array(target.value), self.indices(target.slice)
            before = self.arrays.indexed(array, indices)
            added = self.expression(statement.value)
            self.arrays.assign(array, indices, self.numbers.binary(statement.op, before, added))
        else:
            if not isinstance(target, ast.Name):
                raise TypeError(f"an assignment to {ast.unparse(target)}")
            found = self.expression(ast.Name(target.id))
            self._set(target.id, self.numbers.binary(statement.op, found, self.expression(statement.value)))

    def _expr(self, statement: ast.Expr) -> None:
        if not isinstance(statement.value, ast.Constant):
            self.expression(statement.value)

    def _pass(self, statement: ast.Pass) -> None:
        pass

    def _if(self, statement: ast.If) -> None:
        known = self.known(statement.test)
        if known is not None:
            self.block(statement.body if known.value else statement.orelse)
            return
        w = self.writer
        then, otherwise, after = w.label(), w.label(), w.label()
        self.condition(statement.test, then, otherwise)
        before, ways = self.bound, []
        for label, statements in ((then, statement.body), (otherwise, statement.orelse)):
            w.begin(label)
            self.bound = set(before)
            self.block(statements)
            ways += [] if w.ended else [self.bound]
            w.jump(after)
        self._after(after, ways)

    def _after(self, label: str, ways: list[set[str]]) -> None:
        """Begin a block to which there are ways with these names bound."""
        self.writer.begin(label)
        if not ways:
            self.writer.write("unreachable")
            self.writer.ended = True
        else:
            self.bound = set.intersection(*ways)

    def _while(self, statement: ast.While) -> None:
        w = self.writer
        test, body, after = w.label(), w.label(), w.label()
        w.begin(test)
        self.condition(statement.test, body, after)
        known, before = self.known(statement.test), set(self.bound)
        w.begin(body)
        ways = self._inside(statement.body, test, after)
        w.repeat(test)
        self._after(after, ways if known is not None and known.value else [before])

    def _inside(self, statements: list[ast.stmt], again: str, after: str) -> list[set[str]]:
        self.turns.append((again, after, []))
        self.block(statements)
        return self.turns.pop()[2]

    def _for(self, statement: ast.For) -> None:
        if not isinstance(statement.target, ast.Name):
            raise TypeError(f"a loop over {ast.unparse(statement.target)}")
        before = set(self.bound)
        self._for_name(statement.target.id, statement)
        self.bound = before

    def _for_name(self, name: str, statement: ast.For) -> None:
        source = statement.iter
        if isinstance(source, ast.Call) and self.known(source.func) == Known(range):
            self._for_range(name, source.args, statement.body)
            return
        if isinstance(source, ast.Attribute) and source.attr == "flat":
            array, axes = self.array(source.value), None
        else:
            array, axes = self.listed(self.expression(source)), 1
        shape = self.arrays.shape(array)
        if axes is not None and len(shape) != axes:
            raise TypeError(f"a loop over the rows of an array of {len(shape)} dimensions")

        def visit(places: list[str]) -> None:
            after = self.writer.label()
            self._set(name, self.arrays.element(array, places))
            self._inside(statement.body, after, self._leaves[-1])
            self.writer.begin(after)

        self._leaves.append(self.writer.label())
        self.arrays.each(shape, visit)
        self.writer.begin(self._leaves.pop())

    def _for_range(self, name: str, given: list[ast.expr], body: list[ast.stmt]) -> None:
        w = self.writer
        numbers = [self.expression(one) for one in given]
        if len(numbers) == 1:
            numbers.insert(0, Known(0))
        begin, end, step = [*numbers, Known(1)] if len(numbers) == 2 else numbers
        first, last, width = (self.numbers.whole(one).register for one in (begin, end, step))
        if not isinstance(step, Known) or step.value == 0:
            self.arrays.require(f"icmp ne i64 {width}, 0", Failure.WRONG_VALUE)
        counter, test, inside, again, after = w.memory("i64"), w.label(), w.label(), w.label(), w.label()
        w.write(f"store i64 {first}, ptr {counter}")
        w.begin(test)
        place = w.value(f"load i64, ptr {counter}")
        if isinstance(step, Known):
            goes_on = w.value(f"icmp {'slt' if step.value > 0 else 'sgt'} i64 {place}, {last}")
        else:
            below, above = w.value(f"icmp slt i64 {place}, {last}"), w.value(f"icmp sgt i64 {place}, {last}")
            goes_on = w.value(f"select i1 {w.value(f'icmp sgt i64 {width}, 0')}, i1 {below}, i1 {above}")
        w.branch(goes_on, inside, after)
        w.begin(inside)
        self._set(name, TypedValue(WHOLE, (place,)))
        self._inside(body, again, after)
        w.begin(again)
        w.write(f"store i64 {w.value(f'add nsw i64 {place}, {width}')}, ptr {counter}")
        w.repeat(test)
        w.begin(after)

    def _break(self, statement: ast.Break) -> None:
        self.turns[-1][2].append(self.bound)
        self.writer.jump(self.turns[-1][1])

    def _continue(self, statement: ast.Continue) -> None:
        self.writer.jump(self.turns[-1][0])

    def _return(self, statement: ast.Return) -> None:
        if statement.value is None:
            self._ends_without = True
        else:
            value = self.value(self.expression(statement.value))
            if made(value.kind):
                raise TypeError("an array is returned that was made here and does not last")
            wider = value.kind if not self._result else joined(self._result[0], value.kind)
            if self._result != [wider]:
                self._result[:] = [wider]
                raise Widened
            fitted = self.fitted(value, wider)
            for t, register, place in zip(registers(wider), fitted.registers, self.results, strict=True):
                self.writer.write(f"store {t} {register}, ptr {place}")
        self.writer.jump("exit")
