"""Kinds and values of the language: what is known of a value when a loop is compiled, and the registers it is in."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

WHOLE, UNSIGNED, FLOAT, TRUTH = "int64", "uint64", "float64", "bool"
"""Kinds of numbers."""

REGISTERS = {WHOLE: "i64", UNSIGNED: "i64", FLOAT: "double", TRUTH: "i1"}

STORED = {
    "float64": "double", "int64": "i64", "uint64": "i64", "int32": "i32", "uint32": "i32", "int16": "i16",
    "uint16": "i16", "int8": "i8", "uint8": "i8", "bool": "i8", "float32": "float",
}  # fmt: skip
"""Types of elements, and LLVM's."""

HERE, AGAIN, SEEN_AGAIN = 1, 2, 3
"""An array made once, one made in a loop, and what has come of it since."""

CONTIGUOUS, IN_ROWS, STRIDED = "C", "rows", "A"
"""Layouts of arrays: in one piece; with an innermost axis in one piece; with any strides."""


@dataclass(frozen=True)
class ArrayKind:
    """An array: NumPy's name of the type of its elements, dimensions, layout, and whether it can be written to.

    Memory of arrays that a function makes is ``made``: it lasts until the function returns, or, ``AGAIN``, until the
    next turn of a loop.
    """

    element: str
    ndim: int
    layout: str = CONTIGUOUS
    writeable: bool = True
    made: int = 0

    @property
    def itemsize(self) -> int:
        """Bytes of an element."""
        return np.dtype(self.element).itemsize


@dataclass(frozen=True)
class PointerKind:
    """An address of elements of a type."""

    element: str


@dataclass(frozen=True)
class TupleKind:
    """A tuple, or a named tuple where there are names."""

    items: tuple[Any, ...]
    names: tuple[str, ...] = ()


Kind = str | ArrayKind | PointerKind | TupleKind | None


@dataclass(frozen=True)
class TypedValue:
    """A value in registers, as many as :func:`registers` tells."""

    kind: Kind
    registers: tuple[str, ...]

    @property
    def register(self) -> str:
        """The only one."""
        (register,) = self.registers
        return register


@dataclass(frozen=True)
class Known:
    """A value that is known when a loop is compiled: a constant, a function, a module."""

    value: Any


def registers(kind: Kind) -> tuple[str, ...]:
    """Return LLVM's types of the registers of a value.

    An array has its address, its shape, and those strides in bytes that do not follow from its layout.
    """
    if kind is None:
        return ()
    if isinstance(kind, str):
        return (REGISTERS[kind],)
    if isinstance(kind, PointerKind):
        return ("ptr",)
    if isinstance(kind, TupleKind):
        return tuple(register for item in kind.items for register in registers(item))
    strides = {CONTIGUOUS: 0, IN_ROWS: kind.ndim - 1, STRIDED: kind.ndim}[kind.layout]
    return ("ptr",) + ("i64",) * (kind.ndim + strides)


def typed(value: TypedValue) -> list[str]:
    """Return the registers of a value with their types, as a call hands them over."""
    return [f"{kind} {register}" for kind, register in zip(registers(value.kind), value.registers, strict=True)]


def items_of(value: TypedValue) -> Iterator[TypedValue]:
    """Return the items of a tuple."""
    assert isinstance(value.kind, TupleKind)
    begin = 0
    for kind in value.kind.items:
        end = begin + len(registers(kind))
        yield TypedValue(kind, value.registers[begin:end])
        begin = end


def parts_of(value: TypedValue) -> list[TypedValue]:
    """Return the items of a tuple, and those of tuples among them; any other value as it is."""
    return (
        [part for item in items_of(value) for part in parts_of(item)] if isinstance(value.kind, TupleKind) else [value]
    )


def tuple_of(items: list[TypedValue], names: tuple[str, ...] = ()) -> TypedValue:
    """Return a tuple of values."""
    kind = TupleKind(tuple(item.kind for item in items), names)
    return TypedValue(kind, tuple(register for item in items for register in item.registers))


def element_of(dtype: Any) -> str:
    """Return the name of a type of elements.

    Raises
    ------
    TypeError
        Where the language does not have it.
    """
    found = np.dtype(dtype)
    if found.name not in STORED or not found.isnative:
        raise TypeError(f"an array of {found.str} ({found.name}): convert it to one of {', '.join(STORED)}")
    return found.name


def made(kind: Kind) -> int:
    """Return how long the memory of a value lasts."""
    if isinstance(kind, TupleKind):
        return max(map(made, kind.items), default=0)
    return kind.made if isinstance(kind, ArrayKind) else 0


def lasting(kind: Kind, how: int) -> Kind:
    """Return a kind, with arrays whose memory lasts as told."""
    if isinstance(kind, TupleKind):
        return TupleKind(tuple(lasting(item, how) for item in kind.items), kind.names)
    return replace(kind, made=how) if isinstance(kind, ArrayKind) and kind.made != how else kind


def kind_of_argument(argument: Any) -> Kind:
    """Return the kind of an argument of a loop: ndarray, tuple, int, float."""
    if isinstance(argument, np.ndarray):
        layout = CONTIGUOUS if argument.flags.c_contiguous else STRIDED
        return ArrayKind(element_of(argument.dtype), argument.ndim, layout, argument.flags.writeable)
    if isinstance(argument, tuple):
        return TupleKind(tuple(map(kind_of_argument, argument)), getattr(argument, "_fields", ()))
    return FLOAT if isinstance(argument, float) else WHOLE


def joined(one: Kind, other: Kind) -> Kind:
    """Return the kind of a variable that receives values of two kinds.

    Raises
    ------
    TypeError
        Where there is none.
    """
    if one == other:
        return one
    if {one, other} <= {WHOLE, FLOAT}:
        return FLOAT
    if {one, other} <= {WHOLE, TRUTH}:
        return WHOLE
    if isinstance(one, ArrayKind) and isinstance(other, ArrayKind):
        if (one.element, one.ndim) == (other.element, other.ndim):
            layouts = (CONTIGUOUS, IN_ROWS, STRIDED)
            layout = max(one.layout, other.layout, key=layouts.index)
            writeable = one.writeable and other.writeable
            return ArrayKind(one.element, one.ndim, layout, writeable, max(one.made, other.made))
    elif isinstance(one, TupleKind) and isinstance(other, TupleKind) and len(one.items) == len(other.items):
        items = tuple(joined(a, b) for a, b in zip(one.items, other.items, strict=True))
        return TupleKind(items, one.names if one.names == other.names else ())
    raise TypeError(f"one variable receives values of the kinds {one} and {other}")
