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
_FAILURES = f"i32 {Failure.NO_MEMORY:d}, label %full  i32 {Failure.WRONG_VALUE:d}, label %negative"
_RESULTS = {
    "int64": "call ptr @PyLong_FromLongLong(i64 %value)",
    "bool": "call ptr @PyBool_FromLong(i64 %wide)",
    "float64": "call ptr @PyFloat_FromDouble(double %value)",
}


def key_of(argument: Any) -> Any:
    """Return what is to be known of an argument: for one key there is one machine code."""
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
        return f"""{_INTERFACE}
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
        self._require_object(self._field(item, _HEAD - 8), type(argument))
        if isinstance(argument, np.ndarray):
            self._take_array(item, argument)
        elif isinstance(argument, tuple):
            size = self._value(f"call i64 @PyTuple_Size(ptr {item})")
            self._require(f"icmp eq i64 {size}, {len(argument)}")
            for place, inner in enumerate(argument):
                self._take(self._value(f"call ptr @PyTuple_GetItem(ptr {item}, i64 {place})"), inner)
        elif isinstance(argument, float):
            self._handed.append(f"double {self._value(f'call double @PyFloat_AsDouble(ptr {item})')}")
        else:
            self._handed.append(f"i64 {self._value(f'call i64 @PyLong_AsLongLong(ptr {item})')}")

    def _take_array(self, item: str, array: np.ndarray[Any, Any]) -> None:
        self._require_object(self._field(item, _DESCR), array.dtype)
        dimensions = self._field(item, _DIMENSIONS, "i32")
        self._require(f"icmp eq i32 {dimensions}, {array.ndim}")
        layout = _C if array.flags.c_contiguous else _F if array.flags.f_contiguous else 0
        looked_at = _ALIGNED | _WRITEABLE | _C | (0 if layout == _C else _F)
        wanted = _ALIGNED | layout | (_WRITEABLE if array.flags.writeable else 0)
        flags = self._value(f"and i32 {self._field(item, _FLAGS, 'i32')}, {looked_at}")
        self._require(f"icmp eq i32 {flags}, {wanted}")
        lengths = self._fields(self._field(item, _SHAPE), array.ndim)
        numbers = lengths if layout == _C else lengths + self._fields(self._field(item, _STRIDES), array.ndim)
        self._handed += [f"ptr {self._field(item, _DATA)}", *(f"i64 {number}" for number in numbers)]

    def _require_object(self, found: str, expected: Any) -> None:
        wanted = self._value(f"call ptr @PyTuple_GetItem(ptr %self, i64 {len(self.expected)})")
        self.expected.append(expected)
        self._require(f"icmp eq ptr {found}, {wanted}")

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
    """Return the Python function of an entry, and what has to be kept as long as that is."""
    method = _Method(NAME.encode(), address, _FASTCALL, None)
    make = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p, ctypes.py_object, ctypes.c_void_p)(
        ("PyCFunction_NewEx", ctypes.pythonapi)
    )
    return make(ctypes.addressof(method), tuple(expected), None), method
