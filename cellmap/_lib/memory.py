"""Memory of the machine that is available, in the container where the process runs, and what the process gives back."""

from __future__ import annotations

import contextlib
import ctypes
from pathlib import Path

_GROUPS = Path("/sys/fs/cgroup")
_OWN = Path("/proc/self/cgroup")
_M_ARENA_MAX = -8  # M_ARENA_MAX of malloc.h

_FILES = {
    "": ("memory.max", "memory.current", "inactive_file"),
    "memory": ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"),
}
"""Files of control groups of version 2 and 1: the limit, what is used, and what of that are pages of idle files."""


def memory_available() -> int:
    """Return the bytes that this process may still take without swapping, within what its container allows."""
    import psutil

    return max(0, min([psutil.virtual_memory().available, *_left_in_groups()]))


def share_heaps() -> bool:
    """Let all threads of this process share two heaps of the C library, and tell whether it can.

    The GNU library makes eight for each core, and each keeps what the largest compilation in it took.
    """
    return bool(_in_c_library("mallopt", _M_ARENA_MAX, 2))


def give_back_memory() -> bool:
    """Return to the system the free pages that the C library keeps between those in use, and tell whether it can."""
    return bool(_in_c_library("malloc_trim", 0))


def _in_c_library(name: str, *arguments: int) -> int:
    """Call a function of the GNU library; 0 where there is another one."""
    try:
        return int(getattr(ctypes.CDLL(None), name)(*arguments))
    except (AttributeError, OSError, TypeError):
        return 0


def _left_in_groups() -> list[int]:
    """Return what the control groups of this process and those around them leave."""
    left = []
    with contextlib.suppress(OSError, ValueError):
        for line in _OWN.read_text(encoding="utf-8").splitlines():
            _, controllers, name = line.split(":", 2)
            if controllers in _FILES:
                # In a container the root may be the group itself, whatever name it has outside.
                parts = Path(name).parts[1:]
                for depth in range(len(parts) + 1):
                    folder = (_GROUPS / controllers).joinpath(*parts[:depth])
                    left += _left_in_group(folder, *_FILES[controllers])
    return left


def _left_in_group(folder: Path, limit: str, used: str, idle: str) -> list[int]:
    """Return the limit less what is used, without what the system keeps of files as long as there is room."""
    try:
        most, now = ((folder / name).read_text(encoding="ascii").strip() for name in (limit, used))
        counts = dict(line.split() for line in (folder / "memory.stat").read_text(encoding="ascii").splitlines())
        return [] if most == "max" else [int(most) - int(now) + int(counts.get(idle, 0))]
    except (OSError, ValueError):
        return []
