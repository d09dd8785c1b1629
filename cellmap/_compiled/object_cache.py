"""Compiled code on disk: private to the user, checked before it is loaded, bounded in size.

An entry is one file, written whole, named after a hash of what it was compiled from and for.  It holds that name, a
checksum, and an object file.  Whatever does not match is recompiled, with a warning.  Code is never read from a folder
that belongs to somebody else or that others can write to.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import stat
import warnings
from dataclasses import dataclass
from pathlib import Path

from platformdirs import user_cache_path

from .._lib.files import opened_file, written_whole
from .._lib.systems import is_private

LIMIT = 256 * 2**20
"""Bytes of all entries together; the least recently used go first."""

_room: dict[ObjectCache, int] = {}
"""Bytes that may be written to a folder before all of its entries are looked at again: a sixteenth of them at most."""

_MAGIC = b"cellmap object 1\n"
_ENDING = ".object"


def cache_folder() -> Path | None:
    """Return ``$CELLMAP_CACHE_DIR``, or a folder in the user's cache, made if need be.

    None where the variable is empty, where the folder cannot be made, or where it is not the user's alone: compiled
    code is not kept then.
    """
    chosen = os.environ.get("CELLMAP_CACHE_DIR")
    if chosen == "":
        return None
    try:
        folder = user_cache_path("cellmap") if chosen is None else Path(chosen).expanduser()
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        private = is_private(folder)
    except (OSError, RuntimeError):  # RuntimeError: a user without a home
        return None
    if not private:
        warnings.warn(
            f"CELLMAP_CACHE_DIR={str(folder)!r}: it belongs to somebody else, or others can write to it, so that code "
            "from there is not run and all is compiled again; empty it and take `chmod 700`, or give another one",
            stacklevel=2,
        )
        return None
    return folder


@dataclass(frozen=True)
class ObjectCache:
    """Object files by keys, hexadecimal digests of 64 digits.  A folder of None keeps nothing."""

    folder: Path | None
    limit: int = LIMIT

    @classmethod
    def of_user(cls) -> ObjectCache:
        """Return the cache of this user, one that keeps nothing where there is no private folder to be written."""
        return cls(cache_folder())

    def read(self, key: str) -> bytes | None:
        """Return an object file; None where there is none, or none that is whole."""
        if self.folder is None:
            return None
        path = self._path(key)
        try:
            with opened_file(path) as stream:
                # An entry is read once it begins as one, and none is longer than all of them may be together.
                begins = stream.read(len(_beginning(key))) == _beginning(key)
                rest = stream.read() if begins and os.fstat(stream.fileno()).st_size <= self.limit else b""
        except FileNotFoundError:
            return None
        except OSError as error:
            _warn(path, f"cannot be read ({error.strerror or 'it is no file'})")
            return None
        checksum, _, code = rest.partition(b"\n")
        if checksum != _checksum(key, code):
            _warn(path, "is damaged or foreign")
            with contextlib.suppress(OSError):
                path.unlink()
            return None
        with contextlib.suppress(OSError):
            os.utime(path)  # used just now
        return code

    def write(self, key: str, code: bytes) -> None:
        """Keep an object file; where that cannot be done, nothing happens."""
        if self.folder is None:
            return
        with contextlib.suppress(OSError):
            with written_whole(self._path(key), durable=False) as temporary:
                temporary.write_bytes(_beginning(key) + _checksum(key, code) + b"\n" + code)
            _room[self] = _room.get(self, 0) - len(code)
            if _room[self] < 0:
                _room[self] = min(self.limit // 16, self.limit - self._drop_old_entries())

    def _path(self, key: str) -> Path:
        assert self.folder is not None
        return self.folder / (key[:32] + _ENDING)

    def _drop_old_entries(self) -> int:
        """Remove entries until the others are not too large together; return the bytes of these."""
        assert self.folder is not None
        entries = []
        for path in self.folder.glob(f"*{_ENDING}"):
            with contextlib.suppress(OSError):  # another process may have dropped it
                entry = path.lstat()
                if stat.S_ISREG(entry.st_mode):
                    entries.append((entry.st_mtime, entry.st_size, path))
        total = sum(size for _, size, _ in entries)
        for _, size, path in sorted(entries):
            if total <= self.limit:
                break
            with contextlib.suppress(OSError):
                path.unlink()
            total -= size
        return total


def _beginning(key: str) -> bytes:
    return _MAGIC + f"{key}\n".encode()


def _checksum(key: str, code: bytes) -> bytes:
    """Return the checksum of key and code, which an entry holds on a line of its own."""
    return hashlib.sha256(key.encode() + code).hexdigest().encode()


def _warn(path: Path, what: str) -> None:
    warnings.warn(f"cache of compiled code: {str(path)!r} {what}", RuntimeWarning, stacklevel=2)
