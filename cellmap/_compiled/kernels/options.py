"""Compiler options of every kernel, in one place.

``error_model="numpy"`` removes the zero-division branch that would keep LLVM from vectorising a loop.
``fastmath={"contract"}`` allows fused multiply-add and nothing else: full fastmath would delete the tests for NaN on
which the labels of failed starts rest.  ``nogil`` lets the thread pool of :mod:`cellmap._lib.threads` run kernels side
by
side.
"""

from __future__ import annotations

from typing import Any

from .cache import kernels_are_kept
from .forking import keep_compilers_whole

keep_compilers_whole()

KERNEL: dict[str, Any] = {
    "nogil": True,
    "cache": kernels_are_kept(),
    "error_model": "numpy",
    "fastmath": {"contract"},
    "boundscheck": False,
}
"""A loop that is called from Python."""

INLINE: dict[str, Any] = {
    "forceinline": True,
    "error_model": "numpy",
    "fastmath": {"contract"},
    "boundscheck": False,
}
"""A scalar function called in the body of a loop over lanes; it must vanish into the loop, or the loop stays scalar."""

LANES = 32
"""Starts that step together.  A block is always full (the last start is repeated), so each start passes through the
same machine code wherever it stands, and its image has the same bits."""
