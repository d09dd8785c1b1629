"""Arrays of the language: places of elements, views, copies, memory."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from .marks import Failure
from .numbers import Arithmetic, literal
from .values import CONTIGUOUS, FLOAT, IN_ROWS, STORED, STRIDED, TRUTH, UNSIGNED, WHOLE, ArrayKind, Known, TypedValue
from .writer import Writer

Index = TypedValue | Known | tuple[TypedValue | Known | None, TypedValue | Known | None]
"""A number, or the two ends of a slice."""

ALIGNMENT = 64
"""Bytes: arrays begin where a vector of the processor can begin."""


class Arrays:
    """Instructions for arrays.  ``refuse(failure)`` returns the block that ends the function with its code."""

    def __init__(self, writer: Writer, numbers: Arithmetic, refuse: Callable[[Failure], str], checked: bool) -> None:
        self.writer, self.numbers, self._refuse, self._checked = writer, numbers, refuse, checked

    def shape(self, array: TypedValue) -> tuple[str, ...]:
        """Return the registers with the shape of an array."""
        return array.registers[1 : 1 + _kind(array).ndim]

    def strides(self, array: TypedValue) -> tuple[str, ...]:
        """Return the strides in bytes: registers, or constants."""
        kind = _kind(array)
        known = array.registers[1 + kind.ndim :]
        if kind.layout == STRIDED:
            return known
        if kind.layout == IN_ROWS:
            return *known, str(kind.itemsize)
        strides = [str(kind.itemsize)]
        for length in reversed(self.shape(array)[1:]):
            strides.append(self._product(strides[-1], length))
        return tuple(reversed(strides))

    def indexed(self, array: TypedValue, indices: list[Index]) -> TypedValue:
        """Return an element, or a view where some axes are left."""
        kind, address, shape, strides = self._place(array, indices)
        return self.loaded(kind.element, address) if not shape else self._view(kind, address, shape, strides)

    def assign(self, array: TypedValue, indices: list[Index], value: TypedValue | Known) -> None:
        """Write an element, or all elements of a view."""
        kind, address, shape, strides = self._place(array, indices)
        if not kind.writeable:
            raise TypeError("an array that is read-only is written to")
        if not shape:
            self._store(kind.element, address, value)
            return
        view = self._view(kind, address, shape, strides)
        if isinstance(value, TypedValue) and isinstance(value.kind, ArrayKind):
            source = value
            if _kind(source).ndim != len(shape):
                raise TypeError(f"an array of {_kind(source).ndim} dimensions is assigned to {len(shape)}")
            for one, other in zip(self.shape(source), shape, strict=True):
                self.require_equal(one, other)

            def copy(places: list[str]) -> None:
                self._store(kind.element, self.address(view, places), self.element(source, places))

            self.each(shape, copy)
        else:
            self.each(shape, lambda places: self._store(kind.element, self.address(view, places), value))

    def element(self, array: TypedValue, places: list[str]) -> TypedValue:
        """Return the element at places in registers."""
        return self.loaded(_kind(array).element, self.address(array, places))

    def address(self, array: TypedValue, places: list[str]) -> str:
        """Return the address of an element."""
        address = array.registers[0]
        for place, stride in zip(places, self.strides(array), strict=False):
            address = self._moved(address, place, stride)
        return address

    def loaded(self, element: str, address: str) -> TypedValue:
        """Return the number at an address."""
        stored = STORED[element]
        found = self.writer.value(f"load {stored}, ptr {address}")
        if element == "bool":
            return TypedValue(TRUTH, (self.writer.value(f"icmp ne i8 {found}, 0"),))
        if element == "float32":
            return TypedValue(FLOAT, (self.writer.value(f"fpext float {found} to double"),))
        if stored not in ("i64", "double"):
            widened = "zext" if element.startswith("u") else "sext"
            return TypedValue(WHOLE, (self.writer.value(f"{widened} {stored} {found} to i64"),))
        return TypedValue(element, (found,))

    def each(self, shape: tuple[str, ...], act: Callable[[list[str]], None]) -> None:
        """Do something at all places of an array of a shape, in order."""

        def along(axis: int, places: list[str]) -> None:
            if axis == len(shape):
                act(places)
            else:
                self.count(shape[axis], lambda place: along(axis + 1, [*places, place]))

        along(0, [])

    def count(self, end: str, act: Callable[[str], None]) -> None:
        """Do something for all numbers from 0 to before the end."""
        w = self.writer
        counter, test, body, after = w.memory("i64"), w.label(), w.label(), w.label()
        w.write(f"store i64 0, ptr {counter}")
        w.begin(test)
        place = w.value(f"load i64, ptr {counter}")
        w.branch(w.value(f"icmp slt i64 {place}, {end}"), body, after)
        w.begin(body)
        act(place)
        w.write(f"store i64 {w.value(f'add nsw i64 {place}, 1')}, ptr {counter}")
        w.repeat(test)
        w.begin(after)

    def allocated(self, shape: list[TypedValue | Known], element: str, kept: str, zero: bool) -> TypedValue:
        """Return a new array, whose memory is written down at an address; what was there before is given back."""
        w, value = self.writer, self.writer.value
        kind = ArrayKind(element, len(shape))
        lengths = [self.numbers.whole(length).register for length in shape]
        size = str(kind.itemsize)
        for length in lengths:
            self.require(f"icmp sge i64 {length}, 0", Failure.WRONG_VALUE)
            both = value(f"call {{i64, i1}} @llvm.umul.with.overflow.i64(i64 {size}, i64 {length})")
            size = value(f"extractvalue {{i64, i1}} {both}, 0")
            self.require(f"icmp eq i1 {value(f'extractvalue {{i64, i1}} {both}, 1')}, false", Failure.NO_MEMORY)
        w.write(f"call void @free(ptr {value(f'load ptr, ptr {kept}')})")
        room = value(f"add i64 {size}, {2 * ALIGNMENT}")
        call = f"@calloc(i64 {room}, i64 1)" if zero else f"@malloc(i64 {room})"
        block = value(f"call ptr {call}")
        w.write(f"store ptr {block}, ptr {kept}")
        self.require(f"icmp ne ptr {block}, null", Failure.NO_MEMORY)
        behind = value(f"add i64 {value(f'ptrtoint ptr {block} to i64')}, {ALIGNMENT}")
        begin = value(f"and i64 {behind}, {-ALIGNMENT}")
        return TypedValue(kind, (value(f"inttoptr i64 {begin} to ptr"), *lengths))

    def _place(
        self, array: TypedValue, indices: list[Index]
    ) -> tuple[ArrayKind, str, tuple[str, ...], tuple[str, ...]]:
        """Return element, address, shape and strides of what indices choose."""
        kind, address = _kind(array), array.registers[0]
        lengths, all_strides = self.shape(array), self.strides(array)
        if len(indices) > kind.ndim:
            raise TypeError(f"{len(indices)} indices of an array of {kind.ndim} dimensions")
        shape, strides, whole = [], [], True
        for axis, index in enumerate(indices):
            if isinstance(index, tuple):
                begin, length = self._ends(index, lengths[axis])
                whole &= axis == 0
                shape.append(length)
                strides.append(all_strides[axis])
            else:
                begin = self._number(index, lengths[axis])
                whole &= not shape
            address = self._moved(address, begin, all_strides[axis])
        shape += lengths[len(indices) :]
        strides += all_strides[len(indices) :]
        in_one = kind.layout == CONTIGUOUS and whole
        in_rows = bool(strides) and strides[-1] == str(kind.itemsize)
        layout = CONTIGUOUS if in_one or (in_rows and len(shape) == 1) else IN_ROWS if in_rows else STRIDED
        chosen = ArrayKind(kind.element, len(shape), layout, kind.writeable, kind.made)
        return chosen, address, tuple(shape), tuple(strides)

    def _view(self, kind: ArrayKind, address: str, shape: tuple[str, ...], strides: tuple[str, ...]) -> TypedValue:
        known = {CONTIGUOUS: (), IN_ROWS: strides[:-1], STRIDED: strides}[kind.layout]
        return TypedValue(kind, (address, *shape, *known))

    def laid_out(self, array: TypedValue, layout: str) -> TypedValue:
        """Return an array as one of a layout that says less of it."""
        kind = _kind(array)
        if kind.layout == layout:
            return array
        other = ArrayKind(kind.element, kind.ndim, layout, kind.writeable, kind.made)
        return self._view(other, array.registers[0], self.shape(array), self.strides(array))

    def _number(self, index: TypedValue | Known, length: str) -> str:
        if isinstance(index, Known) and self.numbers.number(index).kind == WHOLE and index.value < 0:
            found = self.writer.value(f"add nsw i64 {length}, {int(index.value)}")
        else:
            if self.numbers.number(index).kind not in (WHOLE, UNSIGNED):
                raise TypeError("an index has to be a whole number")
            found = self.numbers.converted(index, WHOLE).register
        if self._checked:
            self.require(f"icmp ult i64 {found}, {length}", Failure.OUTSIDE)
        return found

    def _ends(self, ends: tuple[Any, Any], length: str) -> tuple[str, str]:
        """Return begin and length of a slice, whose ends lie within the array."""
        whole = TypedValue(WHOLE, (length,))
        if ends == (None, None):
            return "0", length
        begin = self._within(ends[0], whole) if ends[0] is not None else literal(0)
        end = self._within(ends[1], whole) if ends[1] is not None else whole
        size = self.writer.value(f"sub nsw i64 {end.register}, {begin.register}")
        return begin.register, self.writer.value(f"call i64 @llvm.smax.i64(i64 {size}, i64 0)")

    def _within(self, end: TypedValue | Known, length: TypedValue) -> TypedValue:
        number = self.numbers.whole(end)
        if isinstance(end, Known) and end.value < 0:
            raise TypeError("a slice from the end")
        if self._checked:
            self.require(f"icmp sge i64 {number.register}, 0", Failure.OUTSIDE)
        text = f"call i64 @llvm.smin.i64(i64 {number.register}, i64 {length.register})"
        return TypedValue(WHOLE, (self.writer.value(text),))

    def _store(self, element: str, address: str, value: TypedValue | Known) -> None:
        stored = STORED[element]
        kind = element if element in (FLOAT, WHOLE, UNSIGNED, TRUTH) else FLOAT if element == "float32" else WHOLE
        found = self.numbers.number(value)
        sign_differs = isinstance(value, TypedValue) and {found.kind, kind} == {WHOLE, UNSIGNED}
        if (found.kind == FLOAT and kind != FLOAT) or sign_differs:
            said = "float" if found.kind == FLOAT else found.kind
            raise TypeError(f"a {said} is written into an array of {element}: say how it is to be converted")
        if isinstance(value, Known) and kind == WHOLE and int(value.value) not in _numbers_in(element):
            raise TypeError(f"{value.value} is written into an array of {element}")
        register = self.numbers.converted(value, kind).register
        if element == "bool":
            register = self.writer.value(f"zext i1 {register} to i8")
        elif element == "float32":
            register = self.writer.value(f"fptrunc double {register} to float")
        elif stored not in ("i64", "double"):
            register = self.writer.value(f"trunc i64 {register} to {stored}")
        self.writer.write(f"store {stored} {register}, ptr {address}")

    def require_equal(self, one: str, other: str) -> None:
        """End the function where two lengths differ, if indices are checked."""
        if self._checked:
            self.require(f"icmp eq i64 {one}, {other}", Failure.OUTSIDE)

    def require(self, condition: str, failure: Failure) -> None:
        """Go on where a condition is met; else the function ends."""
        met = self.writer.label()
        self.writer.branch(self.writer.value(condition), met, self._refuse(failure))
        self.writer.begin(met)

    def _moved(self, address: str, place: str, stride: str) -> str:
        offset = self._product(place, stride)
        return (
            address if offset == "0" else self.writer.value(f"getelementptr inbounds i8, ptr {address}, i64 {offset}")
        )

    def _product(self, one: str, other: str) -> str:
        if one.isdigit() and other.isdigit():
            return str(int(one) * int(other))
        return self.writer.value(f"mul nsw i64 {one}, {other}")


def _numbers_in(element: str) -> range:
    limits = np.iinfo(element)
    return range(int(limits.min), int(limits.max) + 1)


def _kind(array: TypedValue) -> ArrayKind:
    if not isinstance(array.kind, ArrayKind):
        raise TypeError(f"a value of the kind {array.kind} is no array")
    return array.kind
