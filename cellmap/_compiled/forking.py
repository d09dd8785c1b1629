"""Processes forked while threads compile: the compilers are left alone at that moment.

A child has no other threads than the one that forked.  What they were in the middle of stays unfinished in its memory,
and locks that they held are never released there.
"""

from __future__ import annotations

import contextlib
import os
import sys
import threading

from llvmlite.binding import ffi

COMPILING = threading.RLock()
"""To be held by who compiles."""

_held = contextlib.ExitStack()


def _hold() -> None:
    # The outer locks first; each of them lets the same thread in twice.
    _held.enter_context(COMPILING)
    numba = sys.modules.get("numba.core.compiler_lock")
    for holder, name in ((numba, "global_compiler_lock"), (ffi.lib, "_lock")):
        _held.enter_context(getattr(holder, name, contextlib.nullcontext()))


# Every later fork of this process waits until no other thread is in a compiler.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(before=_hold, after_in_parent=_held.close, after_in_child=_held.close)
