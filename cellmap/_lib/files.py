"""Files that are written whole or not at all."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import secrets
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

from .checks import in_bytes, shown
from .systems import READING, Locked, lock, unlock

PART = "run"
"""Kind of temporary files of a checkpoint, which who holds its lock makes and removes."""

_TOKEN = 8  # bytes in the name of a temporary
_KINDS: dict[int | None, str] = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a named pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFLNK: "a link",
}
_FULL = (errno.EFBIG, errno.ENOSPC, errno.EDQUOT)


class StoreError(OSError):
    """A file that is not what it should be."""


def as_path(name: str, value: Any) -> Path:
    """Return an argument as the name of a file."""
    try:
        path = Path(value)
        os.fsencode(path)
    except TypeError:
        raise TypeError(f"{name}={shown(value)}: give the name of a file") from None
    except UnicodeEncodeError:
        raise ValueError(f"{name}={str(path)!r}: give a name of characters that files may have") from None
    if "\0" in str(path):
        raise ValueError(f"{name}={str(path)!r}: give a name without a zero byte")
    return path


def as_target(name: str, value: Any) -> Path:
    """Return an argument as the name of a file that can be written, by :func:`written_whole`."""
    path = as_path(name, value)
    said = f"{name}={str(path)!r}"
    _try(said, _place(said, path))
    return path


def as_checkpoint(value: Any) -> Path | None:
    """Return the argument `checkpoint` as the file that it leads to, so that whoever uses it has one name for it.

    One that is there may lie where nothing can be written: a run that is over is merely read.
    """
    if value is None:
        return None
    path = as_path("checkpoint", value)
    said = f"checkpoint={str(path)!r}"
    place = _place(said, path)
    if not place.exists():
        _try(said, place, PART)
    return place


def _place(said: str, path: Path) -> Path:
    """Return where a path leads, by links if it is one: a file, or nothing yet in a folder that is there."""
    try:
        place = Path(os.path.realpath(path)) if path.is_symlink() else path
        if not place.parent.is_dir():
            raise FileNotFoundError(f"{said}: there is no folder {str(place.parent)!r}; make it first")
        kind = _kind(path)
    except OSError as error:
        if error.strerror is None:
            raise
        raise type(error)(f"{said}: give the name of another file ({error.strerror})") from None
    if kind == stat.S_IFDIR:
        raise IsADirectoryError(f"{said} is a folder: give the name of a file")
    if kind not in (None, stat.S_IFREG):
        raise StoreError(f"{said} is {_named(kind)}: give the name of a file")
    return place


def _kind(path: Path, follow_links: bool = True) -> int | None:
    """Return which kind of thing is at a path; None for nothing."""
    try:
        return stat.S_IFMT(path.stat(follow_symlinks=follow_links).st_mode)
    except FileNotFoundError:
        return None


def _named(kind: int | None) -> str:
    return _KINDS.get(kind, "a device")


def _try(said: str, place: Path, kind: str = "part") -> None:
    """Refuse a place beside which no temporary can be made, which the system alone can tell."""
    try:
        _made_beside(place, kind, place.suffix).unlink(missing_ok=True)  # who has the file to himself may discard it
    except OSError as error:
        raise type(error)(
            f"{said}: no file can be made in {str(place.parent)!r} ({error.strerror}); give another folder or name"
        ) from None


def _made_beside(place: Path, kind: str, suffix: str, mode: int = 0o666) -> Path:
    """Make an empty file beside a place, with a name that no temporary of another file can have."""
    temporary = place.with_name(f".{place.name}.{secrets.token_hex(_TOKEN)}.{kind}{suffix}")
    # The system itself takes the user's mask off these permissions; to ask for the mask would mean to change it.
    os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_RDWR, mode))
    return temporary


@contextlib.contextmanager
def written_whole(path: Path, durable: bool = True, kind: str = "part") -> Iterator[Path]:
    """Yield an empty file beside a place; move it there at the end, or remove it where that is not reached.

    The place is that to which links lead.  What is there and is no file is refused; of a file its owner and permissions
    are kept.  The temporary keeps the ending of the name, by which some writers choose a format.  With `durable` the
    file is on the disk, not merely on its way there, before it takes the place of an older one.
    """
    place = _place(repr(str(path)), path)
    old = place.stat() if place.exists() else None
    # Nobody may read in the meantime what they may not read at the end.
    temporary = _made_beside(place, kind, path.suffix, 0o666 if old is None else 0o600)
    try:
        with told_of_full_disk(path):
            yield temporary
            with temporary.open("r+b") as stream:
                if old is not None:
                    _give(stream.fileno(), temporary, old)
                if durable:
                    os.fsync(stream.fileno())
            temporary.replace(place)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def _give(handle: int, temporary: Path, old: os.stat_result) -> None:
    """Give a file the owner and the permissions of the one before it, as far as one may."""
    if hasattr(os, "fchown"):
        with contextlib.suppress(OSError):
            os.fchown(handle, old.st_uid, old.st_gid)
    temporary.chmod(stat.S_IMODE(old.st_mode) & 0o777)


def write_whole(path: Path, content: bytes) -> None:
    """Write a file whole or not at all, and say how much room it needs where there is none."""
    with written_whole(path) as temporary, told_of_full_disk(path, len(content)):
        temporary.write_bytes(content)


@contextlib.contextmanager
def told_of_full_disk(path: Path, size: int | None = None) -> Iterator[None]:
    """Turn the error of a full disk into one that says what room is needed, where it is known, and what to do."""
    try:
        yield
    except OSError as error:
        if error.errno not in _FULL or isinstance(error, StoreError):
            raise
        remedy = "raise the limit of file sizes (ulimit -f)" if error.errno == errno.EFBIG else "free some"
        needed = "" if size is None else f"{in_bytes(size)} are needed; "
        text = f"{os.strerror(error.errno)}: {needed}{remedy}, or choose another folder"
        raise StoreError(error.errno, text, str(path)) from error


@contextlib.contextmanager
def opened_file(path: Path) -> Iterator[BinaryIO]:
    """Open a file for reading; what is none, such as a pipe whose writer would be waited for, is refused."""
    handle = os.open(path, READING)
    with os.fdopen(handle, "rb") as stream:
        if not stat.S_ISREG(os.fstat(handle).st_mode):
            raise StoreError(f"{str(path)!r} is not a file but a device or a pipe")
        yield stream


def discard_parts(path: Path, kind: str) -> None:
    """Remove what killed writers of a file have left beside it; only for who has the file to himself."""
    ours = re.compile(rf"\.{re.escape(path.name)}\.[0-9a-f]{{{2 * _TOKEN}}}\.{kind}{re.escape(path.suffix)}")
    for part in path.parent.iterdir():
        if ours.fullmatch(part.name):
            part.unlink(missing_ok=True)


@contextlib.contextmanager
def locked(path: Path | None) -> Iterator[None]:
    """Have a file to oneself, among all processes and threads that ask for it so; None is no file.

    Raises
    ------
    StoreError
        Where another one has it.
    """
    if path is None:
        yield
        return
    place = path.with_name(f".{path.name}.lock")
    if (kind := _kind(place, follow_links=False)) not in (None, stat.S_IFREG):
        raise StoreError(f"checkpoint={str(path)!r}: its lock {str(place)!r} is {_named(kind)}; remove that")
    handle = _lock(place, path)
    try:
        yield
    finally:
        if handle is not None:
            unlock(place, handle)


def _lock(place: Path, path: Path) -> int | None:
    """Lock the file that stands for another one, until it is closed or the process dies; None where none can be had."""
    try:
        return lock(place)
    except Locked as holder:
        raise _in_use(path, str(holder)) from None
    except OSError as error:
        if place.exists():
            raise _in_use(path, "somebody else") from error
        return None  # what cannot be written to needs no lock


def _in_use(path: Path, holder: str) -> StoreError:
    return StoreError(
        f"checkpoint={str(path)!r} is in use by {holder}: wait until that run is over, or give another file"
    )
