"""Files that are written whole or not at all."""

from __future__ import annotations

import contextlib
import os
import re
import secrets
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from .systems import Locked, lock, unlock

_TOKEN = 8  # bytes in the name of a temporary


class StoreError(OSError):
    """A file that is not what it should be."""


def as_path(name: str, value: Any) -> Path:
    """Return an argument as the name of a file."""
    try:
        path = Path(value)
    except TypeError:
        raise TypeError(f"{name}={value!r}: give the name of a file") from None
    if "\0" in str(path):
        raise ValueError(f"{name}={value!r}: give a name without a zero byte")
    return path


def as_target(name: str, value: Any) -> Path:
    """Return an argument as the name of a file to be written, in a folder that exists."""
    path = as_path(name, value)
    if not path.parent.is_dir():
        raise FileNotFoundError(f"{name}={str(path)!r}: there is no folder {str(path.parent)!r}; make it first")
    if path.is_dir():
        raise IsADirectoryError(f"{name}={str(path)!r} is a folder: give the name of a file")
    return path


@contextlib.contextmanager
def written_whole(path: Path, durable: bool = True, kind: str = "part") -> Iterator[Path]:
    """Yield an empty file beside a place; move it there at the end, or remove it where that is not reached.

    The temporary keeps the ending of the name, by which some writers choose a format, and no temporary of another file
    can have its name.  With `durable` the file is on the disk, not merely on its way there, before it takes the place
    of an older one.
    """
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(_TOKEN)}.{kind}{path.suffix}")
    # The system itself takes the user's mask off these permissions; to ask for the mask would mean to change it.
    os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_RDWR, 0o666))
    try:
        yield temporary
        if durable:
            with temporary.open("r+b") as stream:
                os.fsync(stream.fileno())
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


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
