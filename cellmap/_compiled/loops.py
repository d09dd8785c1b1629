"""Loops written by hand, in Python, and compiled: once on a machine, and kept where all machine code is kept.

:mod:`cellmap._compiled.translation` describes the language that they are written in.  A loop is compiled for the types
of its arguments when it is called with them first, and called through the entry that :mod:`cellmap._compiled.entry`
describes.
"""

from __future__ import annotations

import functools
import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

from .._lib.computed import computed_once
from .._lib.stopping import check_stop
from .entry import MISFIT, NAME, EntryText, key_of, plain, python_function
from .forking import COMPILING
from .machine_code import LOOPS, MachineCode, compiled_once, loop_code
from .translation.marks import ByAddress, Deferred

CHECKED = bool(os.environ.get("CELLMAP_BOUNDS_CHECK"))
"""Whether loops raise IndexError at an index outside of an array: to look for faults in them, at half the speed."""


class Loop(Deferred):
    """A function of arrays and numbers that is called from Python."""

    def __init__(self, function: Callable[..., Any], contract: bool = True, vectors: bool = False) -> None:
        super().__init__(function, contract, vectors)
        self._entries: dict[Any, tuple[Callable[..., Any], Any]] = {}
        self._entry: Callable[..., Any] = lambda *arguments: MISFIT

    def __call__(self, *arguments: Any) -> Any:
        """Run the loop, compiled for the types of these arguments, unless the end of the work was asked for."""
        check_stop()
        result = self._entry(*arguments)
        if result is MISFIT:
            arguments = plain(arguments)  # a bool is a whole number, and NumPy's numbers are Python's
            result = self._entry(*arguments)
        return self._other_types(arguments) if result is MISFIT else result

    def _other_types(self, arguments: tuple[Any, ...]) -> Any:
        key = key_of(arguments)
        if key not in self._entries:
            entry = EntryText(arguments)

            def compiled() -> bytes:
                from .translation.functions import entered

                return loop_code(entered(self, arguments, entry.text, CHECKED))

            with COMPILING:
                if key not in self._entries:  # machine code that another thread may be running is never replaced
                    code = compiled_once(
                        f"{_source_of(self.function)}\n{self.contract}{self.vectors}\n{key}", compiled, LOOPS
                    )
                    function, method = python_function(code.address(NAME), entry.expected)
                    self._entries[key] = function, (code, method)
        self._entry = found = self._entries[key][0]
        result = found(*arguments)
        if result is MISFIT:
            raise TypeError(f"{self.function.__qualname__} is given arguments that do not suit their own types")
        return result


class AddressedLoop(Deferred):
    """A function of numbers and addresses that is called by its address."""

    def __init__(self, function: Callable[..., Any], signature: str) -> None:
        super().__init__(function)
        self._signature = signature

    @property
    def address(self) -> int:
        """Where the function begins."""
        return self._code.address(NAME)

    @computed_once
    def _code(self) -> MachineCode:
        def compiled() -> bytes:
            from .translation.functions import exported

            return loop_code(exported(NAME, self, self._signature, CHECKED))

        with COMPILING:
            return compiled_once(f"{_source_of(self.function)}\n{self._signature}", compiled, LOOPS)


def loop(function: Callable[..., Any] | None = None, *, contract: bool = True, vectors: bool = False) -> Any:
    """Make a function a loop that is called from Python."""
    made = functools.partial(Loop, contract=contract, vectors=vectors)
    return made if function is None else made(function)


def loop_by_address(signature: str) -> Callable[[Callable[..., Any]], AddressedLoop]:
    """Make a function one that is called by its address, with arguments of kinds in words: a star is an address."""
    return functools.partial(AddressedLoop, signature=signature)


def inlined(function: Callable[..., Any] | None = None, *, contract: bool = True, vectors: bool = False) -> Any:
    """Make a function part of the loops that call it."""
    made = functools.partial(Deferred, contract=contract, vectors=vectors, is_inlined=True)
    return made if function is None else made(function)


def by_address(function: Callable[..., Any]) -> ByAddress:
    """Make an empty function stand for those that are called by an address, its first argument."""
    return ByAddress(function)


def _source_of(function: Callable[..., Any]) -> str:
    """Return the source of a function with that of all that it is compiled from, by which a change shows.

    These are the files of the functions that it calls, which ones they are, and all that they find around them.
    """
    said, reached = [], [function]
    for one in reached:  # which grows
        names = one.__code__.co_names
        seen = {name: one.__globals__[name] for name in names if name in one.__globals__}
        around = [cell.cell_contents for cell in one.__closure__ or ()]
        seen |= dict(zip(one.__code__.co_freevars, around, strict=True))
        for name, value in seen.items():
            what = repr(value)
            if isinstance(value, Deferred):
                inner = value.function
                reached += [] if inner in reached else [inner]
                how = value.contract, value.vectors, value.is_inlined
                what = f"{reached.index(inner)} {inner.__module__}.{inner.__qualname__} {how}"
            elif isinstance(value, ModuleType):
                used = {name: getattr(value, name) for name in names if hasattr(value, name)}
                what = f"{value.__name__} { ({k: v for k, v in used.items() if isinstance(v, int | float | tuple)}) }"
            elif hasattr(value, "__qualname__"):
                fields = [getattr(value, name, "") for name in ("_fields", "_field_defaults")]
                what = f"{value.__module__}.{value.__qualname__} {fields}"
            elif what == object.__repr__(value):  # by its address, which is another one in each process
                what = f"{type(value).__module__}.{type(value).__qualname__}"
            said.append(f"{reached.index(one)} {name} {what}")
    files = "\n".join(_digest(file) for file in sorted({one.__code__.co_filename for one in reached} | set(_own())))
    return "\n".join([function.__module__, function.__qualname__, str(CHECKED), *said, files])


@functools.cache
def _own() -> tuple[str, ...]:
    """Return the files of the compiler."""
    here = Path(__file__).parent
    return (*(str(here / f"{name}.py") for name in ("loops", "entry")), *map(str, (here / "translation").glob("*.py")))


@functools.cache
def _digest(file: str) -> str:
    return hashlib.sha256(Path(file).read_bytes()).hexdigest()
