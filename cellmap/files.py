"""Files that are written whole or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any


class StoreError(OSError):
    """A file that is not what it should be."""


def as_path(name: str, value: Any) -> Path:
    """Return an argument as the name of a file."""
    try:
        return Path(value)
    except TypeError:
        raise TypeError(f"{name}={value!r}: give the name of a file") from None


def as_target(name: str, value: Any) -> Path:
    """Return an argument as the name of a file to be written, in a folder that exists."""
    path = as_path(name, value)
    if not path.parent.is_dir():
        raise FileNotFoundError(f"{name}={str(path)!r}: there is no folder {str(path.parent)!r}; make it first")
    if path.is_dir():
        raise IsADirectoryError(f"{name}={str(path)!r} is a folder: give the name of a file")
    return path


@contextmanager
def written_whole(path: Path, durable: bool = True) -> Iterator[Path]:
    """Yield an empty file beside a place; move it there at the end, or remove it where that is not reached.

    The temporary keeps the ending of the name, by which some writers choose a format.  With `durable` the file is on
    the disk, not merely on its way there, before it takes the place of an older one.
    """
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}.", suffix=f".part{path.suffix}")
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        if durable:
            with temporary.open("rb") as stream:
                os.fsync(stream.fileno())
        temporary.chmod(0o666 & ~_umask())
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def discard_parts(path: Path) -> None:
    """Remove what killed writers of a file have left beside it."""
    for part in path.parent.glob(f".{_literal(path.stem)}.*.part{_literal(path.suffix)}"):
        part.unlink(missing_ok=True)


def _literal(text: str) -> str:
    """Escape what a pattern of file names gives a meaning of its own."""
    return "".join(f"[{c}]" if c in "*?[" else c for c in text)


def _umask() -> int:
    current = os.umask(0)
    os.umask(current)
    return current
