"""Memory of the machine that is available, in the container where the process runs, and what the process gives back."""

from __future__ import annotations

import contextlib
import ctypes
from pathlib import Path

_GROUPS = Path("/sys/fs/cgroup")
_OWN = Path("/proc/self/cgroup")

_FILES = {
    "": ("memory.max", "memory.current", "inactive_file"),
    "memory": ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"),
}
"""Files of control groups of version 2 and 1: the limit, what is used, and what of that are pages of idle files."""


def memory_available() -> int:
    """Return the bytes that this process may still take without swapping, within what its container allows."""
    import psutil

    return max(0, min([psutil.virtual_memory().available, *_left_in_groups()]))


def give_back_memory() -> bool:
    """Return to the system what the C library keeps of memory that was freed, and tell whether it can.

    The GNU library keeps free pages between those in use, in each thread's arena: after an hour of images of many sizes
    they are a quarter of the process.
    """
    try:
        trim = ctypes.CDLL(None).malloc_trim
    except (AttributeError, OSError, TypeError):  # another C library, another system
        return False
    return bool(trim(ctypes.c_size_t(0)))


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
