"""Compiled code on disk: private to the user, checked before it is loaded, bounded in size.

An entry is one file, written whole, named after a hash of what it was compiled from and for.  It holds that name, a
checksum, and an object file.  Whatever does not match is recompiled, with a warning.  Code is never read from a folder
that belongs to somebody else or that others can write to.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import warnings
from dataclasses import dataclass
from pathlib import Path

from ..._lib.files import written_whole
from ..kernels.cache import cache_folder

LIMIT = 256 * 2**20
"""Bytes of all entries together; the least recently used go first."""

_MAGIC = b"cellmap object 1\n"
_ENDING = ".object"


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
            content = path.read_bytes()
        except FileNotFoundError:
            return None
        except OSError as error:
            _warn(path, f"cannot be read ({error.strerror})")
            return None
        head, code = content[: len(_header(key, b""))], content[len(_header(key, b"")) :]
        if head != _header(key, code):
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
                temporary.write_bytes(_header(key, code) + code)
            self._drop_old_entries()

    def _path(self, key: str) -> Path:
        assert self.folder is not None
        return self.folder / (key[:32] + _ENDING)

    def _drop_old_entries(self) -> None:
        assert self.folder is not None
        entries = []
        for path in self.folder.glob(f"*{_ENDING}"):
            with contextlib.suppress(OSError):  # another process may have dropped it
                entry = path.stat()
                entries.append((entry.st_mtime, entry.st_size, path))
        total = sum(size for _, size, _ in entries)
        for _, size, path in sorted(entries):
            if total <= self.limit:
                break
            with contextlib.suppress(OSError):
                path.unlink()
            total -= size


def _header(key: str, code: bytes) -> bytes:
    """Return what stands before the code: the key in full, and a checksum."""
    return _MAGIC + f"{key}\n{hashlib.sha256(key.encode() + code).hexdigest()}\n".encode()


def _warn(path: Path, what: str) -> None:
    warnings.warn(f"cache of compiled code: {str(path)!r} {what}", RuntimeWarning, stacklevel=2)
