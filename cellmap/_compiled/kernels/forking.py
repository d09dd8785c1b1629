"""Processes forked while threads compile: the compilers are left alone at that moment.

A child has no other threads than the one that forked.  What they were in the middle of stays unfinished in its memory,
and locks that they held are never released there.
"""

from __future__ import annotations

import contextlib
import os
from typing import Any

from llvmlite.binding import ffi
from numba.core.compiler_lock import global_compiler_lock

# Compilers of kernels take the lock of numba first and that of LLVM inside of it; both let the same thread in twice.
_LOCKS: tuple[Any, ...] = (global_compiler_lock, getattr(ffi.lib, "_lock", contextlib.nullcontext()))


def _hold() -> None:
    for lock in _LOCKS:
        lock.__enter__()


def _release() -> None:
    for lock in reversed(_LOCKS):
        lock.__exit__(None, None, None)


def keep_compilers_whole() -> None:
    """Let every later fork of this process wait until no other thread is in a compiler.  To be called once."""
    if hasattr(os, "register_at_fork"):
        os.register_at_fork(before=_hold, after_in_parent=_release, after_in_child=_release)
