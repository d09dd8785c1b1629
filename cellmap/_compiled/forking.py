"""Processes forked while threads compile or import: compilers and importers are left alone at that moment.

A child has no other threads than the one that forked.  What they were in the middle of stays unfinished in its memory,
and locks that they held are never released there.
"""

from __future__ import annotations

import _imp
import contextlib
import importlib
import sys
import threading
import time

from llvmlite.binding import ffi

from .._lib.systems import at_fork

COMPILING = threading.RLock()
"""To be held by who compiles."""

_PATIENCE = 10.0  # seconds for imports of other threads, one of which may wait for the thread that forks
_SHORTLY = 0.001

_held = contextlib.ExitStack()


def _hold() -> None:
    last = time.monotonic() + _PATIENCE
    while True:
        # The outer locks first; each of them lets the same thread in twice.
        _held.enter_context(COMPILING)
        numba = sys.modules.get("numba.core.compiler_lock")
        for holder, name in ((numba, "global_compiler_lock"), (ffi.lib, "_lock")):
            _held.enter_context(getattr(holder, name, contextlib.nullcontext()))
        # No thread begins to import a module without this one, of which Python lets go in the child.
        _imp.acquire_lock()
        _held.callback(_imp.release_lock)
        if not _imported_elsewhere() or time.monotonic() >= last:
            return
        _held.close()
        time.sleep(_SHORTLY)


def _imported_elsewhere() -> bool:
    """Whether another thread is in the middle of importing a module."""
    locks = list(getattr(importlib._bootstrap, "_module_locks", {}).values())
    owners = {getattr(lock(), "owner", None) for lock in locks}
    return bool(owners - {None, threading.get_ident()})


# Every later fork of this process waits until no other thread is in a compiler or imports a module.
at_fork(_held.close, around=_hold)
