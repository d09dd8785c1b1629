"""Plugin of pytest: whatever tests have compiled for this processor is compiled for AArch64 as well.

    make test-aarch64 ROOMS=tests/maps

A module that the back end of AArch64 cannot translate fails the test that asked for it.  Object files are kept in the
folder CELLMAP_AARCH64, under the names by which a process on that processor looks for them: with CELLMAP_CACHE_DIR at
that folder, the same tests run there, or in an emulator such as QEMU's, and have nothing to compile:

    CELLMAP_CACHE_DIR=$CELLMAP_AARCH64 qemu-aarch64-static -L ROOT ROOT/usr/bin/python3 -m pytest tests/maps
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import llvmlite.binding as llvm
import pytest

from cellmap._compiled import machine_code
from cellmap._compiled.object_cache import ObjectCache

HOST = ("aarch64-unknown-linux-gnu", "generic", os.environ.get("CELLMAP_AARCH64_FEATURES", "-aes,-rand,-sha2,-sve"))
"""What LLVM says of an AArch64 processor without extensions, as QEMU emulates it."""

here, native, plain = threading.local(), machine_code._host(), machine_code.compiled_once
kept = ObjectCache(Path(os.environ.get("CELLMAP_AARCH64", ".pytest_cache/aarch64")))
found: dict[str, int] = {}


@contextmanager
def as_aarch64() -> Iterator[None]:
    here.host = HOST
    try:
        yield
    finally:
        del here.host


def compiled_twice(source: str, compiled: Callable[[], bytes], level: int = 2) -> machine_code.MachineCode:
    with as_aarch64():
        key = machine_code.key_of_object(source, level)
        if (code := kept.read(key)) is None:
            kept.write(key, code := compiled())
    found[key] = len(code)
    return plain(source, compiled, level)


def pytest_configure(config: pytest.Config) -> None:
    assert kept.folder is not None
    kept.folder.mkdir(parents=True, exist_ok=True)
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    machine_code._host = lambda: getattr(here, "host", native)
    machine_code.vector_width = lambda: 4  # before any module imports it
    machine_code.compiled_once = compiled_twice


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    terminalreporter.write_line(f"{len(found):,} modules compiled for AArch64, {sum(found.values()) / 1e6:.1f} MB")
