"""Differences of operating systems: locks, room on disks, owners of folders, forks.

Each has a way that Python offers everywhere, for systems without those of POSIX; all else of the library is the same on
all of them.
"""

from __future__ import annotations

import contextlib
import errno
import mmap
import os
import platform
import stat
from collections.abc import Callable
from pathlib import Path

try:
    import fcntl
except ImportError:
    _FLOCK = False
else:
    _FLOCK = True

_PIECE = 2**20  # bytes of zeros that are written at once

READING = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
"""How `os.open` opens a file to be read: bytes as they are, and not to wait for the writer of a pipe."""

_LOCKING = os.O_CREAT | os.O_RDWR | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_NOFOLLOW", 0)


class Locked(Exception):
    """A lock that another one has; the text says who."""


def cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def open_files() -> int:
    """Return how many files and connections this process may have open; 1024 where systems do not tell."""
    try:
        import resource
    except ImportError:
        return 1024
    limit = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    return limit if limit != resource.RLIM_INFINITY else 2**20


def at_fork(after_in_child: Callable[[], object], around: Callable[[], object] | None = None) -> None:
    """Have functions called when this process forks: `around` before, the other one after, in the child."""
    if not hasattr(os, "register_at_fork"):
        return
    if around is None:
        os.register_at_fork(after_in_child=after_in_child)
    else:
        os.register_at_fork(before=around, after_in_parent=after_in_child, after_in_child=after_in_child)


def is_private(folder: Path) -> bool:
    """Whether a folder is this user's, and nobody else can write to it; True where folders do not tell."""
    if not hasattr(os, "geteuid"):
        return True
    found = folder.stat()
    return found.st_uid == os.geteuid() and not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def take_room(handle: int, size: int) -> None:
    """Make a file `size` bytes long, and have the disk keep room for all of them."""
    if hasattr(os, "posix_fallocate"):
        os.posix_fallocate(handle, 0, size)
        return
    place = os.lseek(handle, 0, os.SEEK_END)
    while place < size:
        place += os.write(handle, bytes(min(_PIECE, size - place)))


def let_go(mapped: mmap.mmap) -> None:
    """Give the pages of a mapped file back to the system, where it can be told so; their contents stay."""
    if hasattr(mmap, "MADV_DONTNEED"):
        mapped.madvise(mmap.MADV_DONTNEED)


def lock(place: Path) -> int | None:
    """Lock a file until it is given to :func:`unlock` or the process dies; None on disks that know no locks.

    Raises
    ------
    Locked
        Where another process or thread has it.
    OSError
        Where the file cannot be made.
    """
    return _flock(place) if _FLOCK else _exclusive(place)


def unlock(place: Path, handle: int) -> None:
    """Release a lock, and remove its file."""
    if _FLOCK:
        place.unlink(missing_ok=True)
    os.close(handle)
    if not _FLOCK:  # what is open cannot be removed everywhere
        place.unlink(missing_ok=True)


def _flock(place: Path) -> int | None:
    while True:
        handle = os.open(place, _LOCKING, 0o666)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if _is_at(place, handle):
                with contextlib.suppress(OSError):
                    os.truncate(handle, 0)
                _write_name(handle)
                return handle
        except BlockingIOError:
            holder = os.read(handle, 200).decode(errors="replace")
            os.close(handle)
            raise Locked(holder or "another process") from None
        except OSError as error:
            os.close(handle)
            if error.errno in (errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS):
                return None
            raise
        os.close(handle)  # whoever had it removed it between the two calls: once more


def _exclusive(place: Path) -> int:
    """Lock by making a file that was not there; one that a process left when it died is removed."""
    for _ in range(2):
        try:
            handle = os.open(place, _LOCKING | os.O_EXCL, 0o666)
        except FileExistsError:
            holder = place.read_text(errors="replace")
            if not _has_died(holder):
                break
            place.unlink(missing_ok=True)
        else:
            _write_name(handle)
            return handle
    raise Locked(holder or "another process")


def _write_name(handle: int) -> None:
    with contextlib.suppress(OSError):  # a full disk; the name is for others to read
        os.write(handle, f"process {os.getpid()} on {platform.node()}".encode())


def _has_died(holder: str) -> bool:
    import psutil  # slow to import

    _, pid, _, node = (holder.split(" ", 3) + 4 * [""])[:4]
    return node == platform.node() and pid.isdigit() and not psutil.pid_exists(int(pid))


def _is_at(place: Path, handle: int) -> bool:
    try:
        return os.path.samestat(place.stat(), os.fstat(handle))
    except FileNotFoundError:
        return False
