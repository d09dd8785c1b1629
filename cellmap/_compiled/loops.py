"""Loops written by hand, in Python, and compiled: once on a machine, by numba, without which later processes run them.

Numba takes half a second to be imported, and as long again to load what it has kept on disk.  So it is asked for the
machine code of a loop alone, which goes where all other machine code goes.  A loop is compiled for the types of its
arguments when it is called with them first, and called through the entry that
:mod:`cellmap._compiled.entry` describes.

Functions that loops call, and operations that are handed to the compiler as they are, become what numba makes of them
only where a loop is compiled.
"""

from __future__ import annotations

import functools
import hashlib
import importlib
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any, overload

from .entry import MEMORY, MISFIT, NAME, EntryText, key_of, plain, python_function
from .forking import COMPILING, keep_compilers_whole
from .machine_code import MachineCode, compiled_once, linked

keep_compilers_whole()

LOOP: dict[str, Any] = {"nogil": True, "error_model": "numpy", "fastmath": {"contract"}, "boundscheck": False}
"""Options of the compiler, in one place.

``error_model="numpy"`` removes the zero-division branch that would keep LLVM from vectorising a loop.
``fastmath={"contract"}`` allows fused multiply-add and nothing else: full fastmath would delete the tests for NaN on
which the labels of failed initial conditions rest.
"""

INLINE: dict[str, Any] = {k: v for k, v in LOOP.items() if k != "nogil"} | {"forceinline": True}
"""Of a function called in the body of a loop over lanes; it must vanish into the loop, or the loop stays scalar."""


class Deferred:
    """A function that numba is shown when a loop that calls it is compiled; in Python it is the plain function."""

    def __init__(self, function: Callable[..., Any], shown: Callable[[Callable[..., Any]], Any]) -> None:
        self.function, self._shown = function, shown
        functools.update_wrapper(self, function)

    def __call__(self, *arguments: Any) -> Any:
        return self.function(*arguments)

    @functools.cached_property
    def for_numba(self) -> Any:
        """What numba makes of the function."""
        return self._shown(self.function)


class Loop(Deferred):
    """A function of arrays and numbers that is called from Python."""

    def __init__(self, function: Callable[..., Any], **options: Any) -> None:
        super().__init__(function, lambda f: numba().njit(**LOOP | options | _BARE)(f))
        self._entries: dict[Any, tuple[Callable[..., Any], Any]] = {}
        self._entry: Callable[..., Any] = lambda *arguments: MISFIT

    def __call__(self, *arguments: Any) -> Any:
        """Run the loop, compiled for the types of these arguments."""
        result = self._entry(*arguments)
        if result is MISFIT:
            result = self._other_types(arguments)
        if type(result) is bytes:
            kind, given, _ = pickle.loads(result)
            raise kind(*given)
        return result

    def _other_types(self, arguments: tuple[Any, ...]) -> Any:
        arguments = plain(arguments)
        key = key_of(arguments)
        if key not in self._entries:
            text = EntryText(arguments)

            def compiled() -> bytes:
                signature = tuple(map(numba().typeof, arguments))
                return _compiled(self, signature, lambda function, result: (text.text(function, result), MEMORY))

            with COMPILING:
                if key not in self._entries:  # machine code that another thread may be running is never replaced
                    code = compiled_once(f"{_source_of(self.function)}\n{key}", compiled)
                    function, method = python_function(code.address(NAME), text.expected)
                    self._entries[key] = function, (code, method)
        self._entry = entry = self._entries[key][0]
        return entry(*arguments)


class AddressedLoop(Deferred):
    """A function of numbers and addresses, of a signature that numba reads, which is called by its address."""

    def __init__(self, function: Callable[..., Any], signature: str) -> None:
        super().__init__(function, lambda f: numba().njit(**LOOP | _BARE)(f))
        self._signature = signature

    @property
    def address(self) -> int:
        """Where the function begins."""
        return self._code.address(NAME)

    @functools.cached_property
    def _code(self) -> MachineCode:
        def compiled() -> bytes:
            signature = numba().core.sigutils.normalize_signature(self._signature)[0]
            return _compiled(
                self, signature, lambda function, result: (_called_by_address(function, signature), MEMORY)
            )

        with COMPILING:
            return compiled_once(_source_of(self.function), compiled)


@overload
def loop(function: Callable[..., Any]) -> Loop: ...
@overload
def loop(**options: Any) -> Callable[[Callable[..., Any]], Loop]: ...
def loop(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """Make a function a loop that is called from Python; options of the compiler that differ from those of all."""
    return functools.partial(Loop, **options) if function is None else Loop(function)


def loop_by_address(signature: str) -> Callable[[Callable[..., Any]], AddressedLoop]:
    """Make a function one that is called by its address."""
    return functools.partial(AddressedLoop, signature=signature)


@overload
def inlined(function: Callable[..., Any]) -> Deferred: ...
@overload
def inlined(**options: Any) -> Callable[[Callable[..., Any]], Deferred]: ...
def inlined(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """Make a function part of the loops that call it."""
    shown = lambda f: numba().njit(**INLINE | options)(f)  # noqa: E731
    return functools.partial(Deferred, shown=shown) if function is None else Deferred(function, shown)


def operation(function: Callable[..., Any]) -> Deferred:
    """Make a function an operation of the compiler: one that numba calls an intrinsic."""
    return Deferred(function, lambda f: numba().extending.intrinsic(f))


_BARE = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}


@functools.cache
def numba() -> Any:
    """Import numba, which sees what is deferred as what it stands for."""
    module = importlib.import_module("numba")
    extending, registry = (importlib.import_module(f"numba.{name}") for name in ("extending", "core.registry"))

    types = registry.cpu_target.typing_context

    def type_of_what_it_stands_for(value: Deferred, context: Any) -> Any:
        shown = value.for_numba
        types.refresh()
        return types.resolve_value_type(shown)

    extending.typeof_impl.register(Deferred, type_of_what_it_stands_for)
    return module


def _compiled(what: Deferred, signature: tuple[Any, ...], others: Callable[[str, str], tuple[str, ...]]) -> bytes:
    """Return the machine code of a function and of what `others` writes about its symbol and its result."""
    dispatcher = what.for_numba
    dispatcher.compile(signature)
    found = dispatcher.overloads[signature]
    texts = others(found.fndesc.llvm_func_name, str(found.signature.return_type))
    try:
        return linked(found.library.get_llvm_str(), *texts)
    except TypeError as error:
        raise TypeError(f"{what.function.__qualname__} needs numba where it runs: {error}") from None


def _called_by_address(function: str, signature: tuple[Any, ...]) -> str:
    """Return the module of a function of C that calls a function of numba's."""
    types = [
        "ptr" if str(kind).endswith("*") else {"int64": "i64", "float64": "double"}[str(kind)] for kind in signature
    ]
    given = ", ".join(f"{kind} %a{place}" for place, kind in enumerate(types))
    return f"""
declare i32 @"{function}"(ptr, ptr, {", ".join(types)})
define void @{NAME}({given}) {{
  %nothing = alloca ptr
  %complaint = alloca ptr
  %status = call i32 @"{function}"(ptr %nothing, ptr %complaint, {given})
  ret void
}}
"""


def _source_of(function: Callable[..., Any]) -> str:
    """Return what tells a function from others, and from itself before anything was changed that it is compiled from.

    These are the files of the functions that it calls, which ones they are, and the numbers that they find around them.
    """
    values, known, left = [], set(), [function]
    while left:
        one = left.pop()
        if one in known:
            continue
        known.add(one)
        seen = {name: one.__globals__[name] for name in one.__code__.co_names if name in one.__globals__}
        around = [cell.cell_contents for cell in one.__closure__ or ()]
        seen |= dict(zip(one.__code__.co_freevars, around, strict=True))
        for name, value in seen.items():
            if isinstance(value, Deferred):
                left.append(value.function)
                values.append(f"{one.__qualname__} {name} {value.function.__module__}.{value.function.__qualname__}")
            elif isinstance(value, int | float | tuple):
                values.append(f"{one.__qualname__} {name} {value!r}")
    files = "\n".join(_digest(file) for file in sorted({one.__code__.co_filename for one in known} | set(_OWN)))
    return "\n".join([function.__module__, function.__qualname__, *sorted(values), files])


_OWN = tuple(str(Path(__file__).with_name(f"{name}.py")) for name in ("loops", "entry"))


@functools.cache
def _digest(file: str) -> str:
    return hashlib.sha256(Path(file).read_bytes()).hexdigest()
