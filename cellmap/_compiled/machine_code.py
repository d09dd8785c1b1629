"""Machine code of this processor from the text of LLVM modules, compiled once and kept on disk."""

from __future__ import annotations

import functools
import hashlib
import logging
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any

import llvmlite
import llvmlite.binding as llvm

from .object_cache import ObjectCache

_LEVEL = 2  # optimisation; loops are left as they are written, and vectors too
LOOPS = 1
"""Level of loops: at the second one they take a third longer to compile, and are no faster."""

_QUICK = 0  # level of optimisation of large functions, whose values go by memory
_LONG = 4000  # lines of text that may take seconds
_PATIENCE = 2.0  # seconds before which nothing is said

_name = ContextVar("name", default="formulas")


@dataclass(frozen=True, eq=False)
class MachineCode:
    """Functions in memory.  They last as long as this record."""

    text: str
    engine: Any

    def address(self, name: str) -> int:
        """Return where a function begins."""
        return int(self.engine.get_function_address(name))

    @property
    def assembly(self) -> str:
        """Return the instructions of the processor that the text is compiled to."""
        return assembly_for(self.text, *_host())


@contextmanager
def named(function: Any) -> Iterator[None]:
    """Name the function whose formulas are compiled in this context."""
    token = _name.set(f"the formulas of {getattr(function, '__qualname__', type(function).__name__)}")
    try:
        yield
    finally:
        _name.reset(token)


@functools.lru_cache(maxsize=256)
def machine_code(text: str, quick: bool = False) -> MachineCode:
    """Return the compiled functions of a module, from disk where they have been compiled before.

    To find registers for large functions takes most of the time, more than in proportion; `quick` leaves it out.
    """
    level, lines = _QUICK if quick else _LEVEL, text.count("\n")

    def compiled() -> bytes:
        what = f"cellmap compiles {_name.get()}: {lines:,} instructions"
        with _told_if_long(what) if lines > _LONG else nullcontext():
            return object_code(text, *_host(), level)

    return compiled_once(text, compiled, level)


def compiled_once(source: str, compiled: Callable[[], bytes], level: int = _LEVEL) -> MachineCode:
    """Return the functions of an object file for this processor, compiled if it is not on disk.

    The source is all that they are compiled from, at a level of optimisation.
    """
    cache, key = ObjectCache.of_user(), key_of_object(source, level)
    found = cache.read(key)
    if found is None:
        found = compiled()
        cache.write(key, found)
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _target_machine(*_host()))
    engine.add_object_file(llvm.ObjectFileRef.from_data(found))
    engine.finalize_object()
    return MachineCode(source, engine)


def key_of_object(source: str, level: int) -> str:
    """Return the name of the object file for this processor of what is compiled from a source."""
    versions = (str(llvm.llvm_version_info), llvmlite.__version__, *_host(), str(level))
    return hashlib.sha256("\0".join((source, *versions)).encode()).hexdigest()


def loop_code(text: str) -> bytes:
    """Return the object file for this processor of a module of loops, with vectors where they make loops faster."""
    triple, cpu, features = _host()
    machine = _back_end(triple, cpu, features)
    module = _parsed(text, triple, machine)
    tuning = llvm.create_pipeline_tuning_options(speed_level=LOOPS)
    tuning.loop_unrolling = False
    tuning.loop_vectorization = True
    builder = llvm.create_pass_builder(machine, tuning)
    builder.getModulePassManager().run(module, builder)
    return bytes(machine.emit_object(module))


def object_code(text: str, triple: str, cpu: str, features: str, level: int = _LEVEL) -> bytes:
    """Return the object file of a module for a processor, this one or another."""
    machine = _back_end(triple, cpu, features, level)
    return bytes(machine.emit_object(_optimised(text, triple, cpu, features)))


def assembly_for(text: str, triple: str, cpu: str, features: str) -> str:
    """Return the instructions of a processor that a module is compiled to."""
    return str(_back_end(triple, cpu, features).emit_assembly(_optimised(text, triple, cpu, features)))


def vector_width() -> int:
    """Return how many doubles the registers of this processor hold, or two of them together where they are short."""
    return 8 if "+avx512f" in _host()[2] else 4


@functools.cache
def _host() -> tuple[str, str, str]:
    return llvm.get_default_triple(), llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()


@functools.cache
def _back_end(triple: str, cpu: str, features: str, level: int = _LEVEL) -> Any:
    """Return the back end that modules for a processor share: to make one takes as long as to compile a small map."""
    return _target_machine(triple, cpu, features, level)


def _target_machine(triple: str, cpu: str, features: str, level: int = _LEVEL) -> Any:
    """Return a compiler's back end for a processor, this one or another."""
    if triple == _host()[0]:
        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
    else:
        llvm.initialize_all_targets()
        llvm.initialize_all_asmprinters()
    return llvm.Target.from_triple(triple).create_target_machine(cpu=cpu, features=features, opt=level)


def _optimised(text: str, triple: str, cpu: str, features: str) -> Any:
    """Return the module of a text, simplified.

    The text is vector code without repetitions already.  What is left to find are terms that functions inlined side by
    side share; more passes take longer and gain nothing that could be measured.
    """
    machine = _back_end(triple, cpu, features)
    module = _parsed(text, triple, machine)
    builder = llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options(speed_level=_LEVEL))
    passes = llvm.create_new_function_pass_manager()
    passes.add_sroa_pass()
    passes.add_new_gvn_pass()
    passes.add_instruction_combine_pass()
    for function in module.functions:
        if not function.is_declaration:
            passes.run(function, builder)
    return module


def _parsed(text: str, triple: str, machine: Any) -> Any:
    """Return the module of a text, for a processor."""
    module = llvm.parse_assembly(text)
    module.triple, module.data_layout = triple, str(machine.target_data)
    module.verify()
    return module


@contextmanager
def _told_if_long(what: str) -> Iterator[None]:
    """Say on a terminal, and in the log, what is done once it has lasted two seconds and has no progress to show."""

    def tell() -> None:
        logging.getLogger("cellmap").info("%s", what)
        if sys.stderr.isatty():
            sys.stderr.write(f"{what}\n")
            sys.stderr.flush()

    timer = threading.Timer(_PATIENCE, tell)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
