"""Entries of compiled loops: functions of Python's C interface, as LLVM instructions.

An entry takes Python's arguments as they are, sees whether they have the types that the loop was compiled for, hands
their numbers and the memory of arrays over, and returns what the loop returns.  It reads objects through functions of
the interface that all versions of Python have, and arrays where NumPy's interface has their fields.
"""

from __future__ import annotations

import ctypes
import operator
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from .translation.marks import Failure

if TYPE_CHECKING:
    from .translation.functions import Callee

MISFIT = object()
"""What an entry returns where its arguments are of other types."""

NAME = "entry"
_HEAD = object.__basicsize__  # bytes of an object before its own fields; its type is the last of them
_DATA, _DIMENSIONS, _SHAPE, _STRIDES, _DESCR, _FLAGS = (_HEAD + offset for offset in (0, 8, 16, 24, 40, 48))
_C, _F, _ALIGNED, _WRITEABLE = 0x1, 0x2, 0x100, 0x400
_FASTCALL = 0x80

_INTERFACE = r"""
declare i64 @PyLong_AsLongLong(ptr)
declare double @PyFloat_AsDouble(ptr)
declare ptr @PyErr_Occurred()
declare ptr @PyTuple_GetItem(ptr, i64)
declare i64 @PyTuple_Size(ptr)
declare ptr @PyLong_FromLongLong(i64)
declare ptr @PyBool_FromLong(i64)
declare ptr @PyFloat_FromDouble(double)
declare ptr @PyErr_NoMemory()
declare void @PyErr_SetString(ptr, ptr)
@outside = internal constant [27 x i8] c"index outside of its array\00"
@negative = internal constant [44 x i8] c"negative dimensions, or a range with step 0\00"
declare ptr @PyEval_SaveThread()
declare void @PyEval_RestoreThread(ptr)
declare void @Py_IncRef(ptr)
"""
# What entries ask of each argument: comparisons with the objects that they keep, of which %place is the first.
_QUESTIONS = f"""
define internal i1 @same(ptr %self, i64 %place, ptr %object, i64 %offset) noinline {{
  %field = getelementptr i8, ptr %object, i64 %offset
  %found = load ptr, ptr %field
  %wanted = call ptr @PyTuple_GetItem(ptr %self, i64 %place)
  %same = icmp eq ptr %found, %wanted
  ret i1 %same
}}
define internal i1 @is_tuple(ptr %self, i64 %place, ptr %object, i64 %length) noinline {{
  %typed = call i1 @same(ptr %self, i64 %place, ptr %object, i64 {_HEAD - 8})
  br i1 %typed, label %tuple, label %other
tuple:
  %size = call i64 @PyTuple_Size(ptr %object)
  %long = icmp eq i64 %size, %length
  ret i1 %long
other:
  ret i1 false
}}
define internal i1 @is_array(ptr %self, i64 %place, ptr %object, i32 %axes, i32 %asked, i32 %flags) noinline {{
  %typed = call i1 @same(ptr %self, i64 %place, ptr %object, i64 {_HEAD - 8})
  br i1 %typed, label %array, label %other
array:
  %next = add i64 %place, 1
  %of_items = call i1 @same(ptr %self, i64 %next, ptr %object, i64 {_DESCR})
  %axes_place = getelementptr i8, ptr %object, i64 {_DIMENSIONS}
  %axes_found = load i32, ptr %axes_place
  %as_many = icmp eq i32 %axes_found, %axes
  %flags_place = getelementptr i8, ptr %object, i64 {_FLAGS}
  %all_flags = load i32, ptr %flags_place
  %flags_found = and i32 %all_flags, %asked
  %laid_out = icmp eq i32 %flags_found, %flags
  %shaped = and i1 %as_many, %laid_out
  %suits = and i1 %shaped, %of_items
  ret i1 %suits
other:
  ret i1 false
}}
"""
_FAILURES = f"i32 {Failure.NO_MEMORY:d}, label %full  i32 {Failure.WRONG_VALUE:d}, label %negative"
_RESULTS = {
    "int64": "call ptr @PyLong_FromLongLong(i64 %value)",
    "bool": "call ptr @PyBool_FromLong(i64 %wide)",
    "float64": "call ptr @PyFloat_FromDouble(double %value)",
}


def key_of(argument: Any) -> Any:
    """Return the key of an argument: arguments with one key share their machine code."""
    if isinstance(argument, np.ndarray):
        flags = argument.flags
        layout = "C" if flags.c_contiguous else "F" if flags.f_contiguous else "A"
        return argument.dtype.str, argument.ndim, layout, flags.writeable
    if isinstance(argument, tuple):
        return type(argument), getattr(argument, "_fields", ()), *(key_of(item) for item in argument)
    return type(argument)


def plain(argument: Any) -> Any:
    """Return an argument as one of the types that entries know: ndarray, tuple, int, float.

    Raises
    ------
    TypeError
        Where it is none of these, or an array whose elements are not all there is to it, or not where they should be.
    """
    if isinstance(argument, np.ndarray):
        if type(argument) not in (np.ndarray, np.memmap) or not argument.flags.aligned:
            kind = type(argument).__name__ if argument.flags.aligned else "misaligned array"
            raise TypeError(f"a loop is given a {kind}: make an ndarray of it with np.array(..., copy=True)")
        array = argument.view(np.ndarray)
        standard = np.dtype(array.dtype.str)  # of which there is one, to be known by its address
        return array if array.dtype is standard else array.view(standard)
    if isinstance(argument, tuple):
        items = tuple(plain(item) for item in argument)
        return items if type(argument) is tuple else type(argument)(*items)
    if isinstance(argument, float | np.float32 | np.float16):
        return float(argument)
    return int(argument) if isinstance(argument, np.bool_) else operator.index(argument)


class EntryText:
    """The text of an entry for arguments of certain types, and the objects that it compares theirs with."""

    def __init__(self, arguments: tuple[Any, ...]) -> None:
        self.expected: list[Any] = [MISFIT, None, IndexError, ValueError]
        self._lines: list[str] = []
        self._handed: list[str] = []
        self._count = 0
        self._require(f"icmp eq i64 %number, {len(arguments)}")
        for place, argument in enumerate(arguments):
            self._take(self._field("%given", 8 * place), argument)

    def text(self, callee: Callee) -> str:
        """Return the entry to a function of the module that it is added to."""
        boxed = _RESULTS.get(str(callee.result))
        body = "\n".join(self._lines)
        call = callee.call(self._handed, "%place")
        widened = "%wide = zext i1 %value to i64" if callee.result == "bool" else ""
        end = f"%result = {boxed}" if boxed else "%result = call ptr @PyTuple_GetItem(ptr %self, i64 1)"
        kept = "" if boxed else "call void @Py_IncRef(ptr %result)"
        return f"""{_INTERFACE}{_QUESTIONS}
define ptr @{NAME}(ptr %self, ptr %given, i64 %number) {{
  %place = alloca i32
  store i32 0, ptr %place
{body}
  %wrong = call ptr @PyErr_Occurred()
  %right = icmp eq ptr %wrong, null
  br i1 %right, label %begin, label %refused
begin:
  %thread = call ptr @PyEval_SaveThread()
  {"%value = " if boxed else ""}{call}
  call void @PyEval_RestoreThread(ptr %thread)
  %code = load i32, ptr %place
  switch i32 %code, label %outside [i32 0, label %success  {_FAILURES}]
success:
  {widened}
  {end}
  {kept}
  ret ptr %result
full:
  %raised = call ptr @PyErr_NoMemory()
  ret ptr null
outside:
  %kind = call ptr @PyTuple_GetItem(ptr %self, i64 2)
  call void @PyErr_SetString(ptr %kind, ptr @outside)
  ret ptr null
negative:
  %other_kind = call ptr @PyTuple_GetItem(ptr %self, i64 3)
  call void @PyErr_SetString(ptr %other_kind, ptr @negative)
  ret ptr null
refused:
  ret ptr null
misfit:
  %sentinel = call ptr @PyTuple_GetItem(ptr %self, i64 0)
  call void @Py_IncRef(ptr %sentinel)
  ret ptr %sentinel
}}
"""

    def _take(self, item: str, argument: Any) -> None:
        """Check the type of an object, and hand over what is in it."""
        if isinstance(argument, np.ndarray):
            self._take_array(item, argument)
        elif isinstance(argument, tuple):
            self._require(f"call i1 @is_tuple({self._compared(item, type(argument))}, i64 {len(argument)})")
            for place, inner in enumerate(argument):
                self._take(self._value(f"call ptr @PyTuple_GetItem(ptr {item}, i64 {place})"), inner)
        else:
            self._require(f"call i1 @same({self._compared(item, type(argument))}, i64 {_HEAD - 8})")
            kind, read = ("double", "PyFloat_AsDouble") if isinstance(argument, float) else ("i64", "PyLong_AsLongLong")
            self._handed.append(f"{kind} {self._value(f'call {kind} @{read}(ptr {item})')}")

    def _take_array(self, item: str, array: np.ndarray[Any, Any]) -> None:
        layout = _C if array.flags.c_contiguous else _F if array.flags.f_contiguous else 0
        asked = _ALIGNED | _WRITEABLE | _C | (0 if layout == _C else _F)
        wanted = _ALIGNED | layout | (_WRITEABLE if array.flags.writeable else 0)
        compared = self._compared(item, type(array), array.dtype)
        self._require(f"call i1 @is_array({compared}, i32 {array.ndim}, i32 {asked}, i32 {wanted})")
        lengths = self._fields(self._field(item, _SHAPE), array.ndim)
        numbers = lengths if layout == _C else lengths + self._fields(self._field(item, _STRIDES), array.ndim)
        self._handed += [f"ptr {self._field(item, _DATA)}", *(f"i64 {number}" for number in numbers)]

    def _compared(self, item: str, *expected: Any) -> str:
        """Return the first arguments of a question: objects that are kept, and the one that is compared with them."""
        self.expected += expected
        return f"ptr %self, i64 {len(self.expected) - len(expected)}, ptr {item}"

    def _require(self, condition: str) -> None:
        met = self._value(condition)
        self._lines += [f"  br i1 {met}, label %after{self._count}, label %misfit", f"after{self._count}:"]

    def _fields(self, base: str, count: int) -> list[str]:
        return [self._field(base, 8 * place, "i64") for place in range(count)]

    def _field(self, base: str, offset: int, kind: str = "ptr") -> str:
        place = self._value(f"getelementptr i8, ptr {base}, i64 {offset}")
        return self._value(f"load {kind}, ptr {place}")

    def _value(self, operation: str) -> str:
        self._count += 1
        name = f"%v{self._count}"
        self._lines.append(f"  {name} = {operation}")
        return name


class _Method(ctypes.Structure):
    _fields_ = (("name", ctypes.c_char_p), ("call", ctypes.c_void_p), ("flags", ctypes.c_int), ("doc", ctypes.c_char_p))


def python_function(address: int, expected: list[Any]) -> tuple[Callable[..., Any], Any]:
    """Return the Python function of an entry, and the objects that must live as long as it does."""
    method = _Method(NAME.encode(), address, _FASTCALL, None)
    make = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p, ctypes.py_object, ctypes.c_void_p)(
        ("PyCFunction_NewEx", ctypes.pythonapi)
    )
    return make(ctypes.addressof(method), tuple(expected), None), method
