"""Checkpoints: arrays of a run in an HDF5 file that is valid at every moment and records which tiles are finished.

HDF5 keeps part of a file's metadata in memory: a process that is killed while it writes may leave an unreadable file.
The file is therefore created with all its arrays in their full size; after that only the contents of the arrays change,
through a memory map of the file.  Data that a process has written there survive the process.  A tile counts as finished
once its entry holds the checksum of its contents, so that a tile that was written in part is recognised.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import h5py
import numpy as np
from numpy.typing import DTypeLike, NDArray

from .. import __version__
from .files import PART, StoreError, discard_parts, written_whole
from .sealed import (
    ROOM,
    UnsealedError,
    get_number,
    get_settings,
    get_text,
    image_of,
    opened,
    put_text,
    reserve,
    rows_of,
    seal,
)
from .systems import let_go

FORMAT = "cellmap checkpoint"
SCHEMA = 2

TILE = np.dtype([("tally", "<i8", (4,)), ("checksum", "<u4"), ("done", "<u4")])
"""Entry of a tile: four numbers of the run's own, and the checksum of these and of its contents."""

Arrays = Mapping[str, tuple[tuple[int, ...], DTypeLike]]
"""Arrays of a file by name: their shapes and types."""

Read = TypeVar("Read")

SLACK = 2**16  # bytes that HDF5 may take for its own more than it has taken in memory
_RELEASE = 64  # tiles after which pages of the file are given back to the system


class Checkpoint:
    """A file of arrays that is mapped into memory.

    Parameters
    ----------
    path : Path
        An existing file with contiguous arrays.
    mode : {"r+", "c"}, optional
        Write through to the file, or keep changes to this process.
    """

    def __init__(self, path: Path, mode: str = "r+") -> None:
        self._path = path
        with h5py.File(path, "r") as file:
            places = {n: (d.id.get_offset(), d.shape, d.dtype) for n, d in _datasets(file).items()}
        self._maps = {
            name: np.memmap(path, dtype, mode, offset, shape)  # type: ignore[call-overload]
            for name, (offset, shape, dtype) in places.items()
            if offset is not None and np.prod(shape, dtype=object)
        }
        self._written = 0

    def __getitem__(self, name: str) -> NDArray[Any]:
        if name not in self._maps:
            raise damaged(self._path, f"{name} is not there in one piece")
        return self._maps[name].view(np.ndarray)

    def finish(self, tiles: str, number: int, tally: tuple[int, ...], contents: list[NDArray[Any]]) -> None:
        """Enter a tile whose contents are in their arrays."""
        entry = self[tiles]
        entry["tally"][number] = tally
        entry["checksum"][number] = _checksum(tally, contents)
        entry["done"][number] = 1
        self._written += 1
        if self._written % _RELEASE == 0:
            self.release()

    def is_done(self, tiles: str, number: int, contents: list[NDArray[Any]]) -> bool:
        """Tell whether a tile is entered with the checksum of its present contents."""
        entry = self[tiles][number]
        return bool(entry["done"] == 1) and int(entry["checksum"]) == _checksum(entry["tally"], contents)

    def release(self) -> None:
        """Give pages of the file back to the system, which keeps their contents: files may be larger than memory."""
        for mapped in self._maps.values():
            let_go(mapped._mmap)


@contextmanager
def made(
    path: Path, belongs: Mapping[str, Any], arrays: Arrays, write: Callable[[h5py.File], None] = lambda file: None
) -> Iterator[Checkpoint]:
    """Make a file with arrays of zeros and what `write` adds; yield it, to be filled before it takes its place."""
    with written_whole(path, kind=PART) as temporary:

        def fill(file: h5py.File) -> None:
            describe(file, FORMAT, SCHEMA)
            put_text(file, "belongs", json.dumps(plain(belongs)))
            write(file)

        rest = sum(int(np.prod(shape, dtype=object)) * np.dtype(dtype).itemsize for shape, dtype in arrays.values())
        with made_with_room(temporary, rest, fill) as file:
            for name, (shape, dtype) in arrays.items():
                add_unwritten(file, name, shape, dtype)
            fill(file)
            holes = [(file[name].id.get_offset(), file[name].nbytes) for name in arrays if file[name].size]
        reserve(temporary)
        seal(temporary, holes)
        yield Checkpoint(temporary)


@contextmanager
def made_with_room(path: Path, arrays: int, fill: Callable[[h5py.File], None]) -> Iterator[h5py.File]:
    """Make an HDF5 file, once there is room for arrays of some bytes and for what `fill` adds to them."""
    reserve(path, arrays + len(image_of(fill)) + SLACK)
    with h5py.File(path, "w", userblock_size=ROOM) as file:
        yield file


def describe(file: h5py.File, format: str, schema: int) -> None:
    """Say what a file is, and what wrote it."""
    from importlib.metadata import version  # slow to import

    put_text(file, "format", format)
    file.attrs["schema"] = schema
    versions = {"cellmap": __version__} | {n: version(n) for n in ("numpy", "llvmlite", "h5py")}
    put_text(file, "versions", json.dumps(versions))


def add_unwritten(group: h5py.Group, name: str, shape: tuple[int, ...], dtype: DTypeLike) -> None:
    """Add an array that has its place in the file at once, and is filled through a map of the file."""
    how = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    how.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    how.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    space = h5py.h5s.create_simple(shape)
    h5py.h5d.create(group.id, name.encode(), h5py.h5t.py_create(np.dtype(dtype)), space, how).close()


def resumed(
    path: Path, belongs: Mapping[str, Any], arrays: Callable[[Read], Arrays], read: Callable[[h5py.File], Read]
) -> tuple[Checkpoint, Read] | None:
    """Open a file to resume from, and return it with what `read` reads of it; None where there is none.

    One that is damaged or foreign, that belongs to another run or has other arrays than these is refused.
    """
    discard_parts(path, PART)
    if not path.exists():
        return None
    theirs = _with_file(path, lambda file: (get_text(file, "format"), get_number(file, "schema"), belongs_of(file)))
    if theirs[0] != FORMAT:
        raise _no_checkpoint(path)
    if theirs[1] > SCHEMA:
        raise StoreError(f"checkpoint={str(path)!r} was written by a newer cellmap: update, or delete the file")
    check_belongs(path, theirs[2], belongs)

    def contents(file: h5py.File) -> Read:
        found = read(file)
        expected = arrays(found)
        if any((file[n].shape, file[n].dtype) != (shape, np.dtype(t)) for n, (shape, t) in expected.items()):
            raise ValueError("its arrays are of other shapes")
        return found

    found = _with_file(path, contents)
    return Checkpoint(path), found


def _with_file(path: Path, read: Callable[[h5py.File], Read]) -> Read:
    try:
        with opened(path) as file:
            return read(file)
    except UnsealedError as error:
        raise _no_checkpoint(path) from error
    except StoreError as error:
        raise damaged(path, error) from error


def belongs_of(file: h5py.Group) -> dict[str, Any]:
    """Read which run a file belongs to; nothing where it does not say."""
    return get_settings(file, "belongs") if ".belongs" in file or "belongs" in file.attrs else {}


def _no_checkpoint(path: Path) -> StoreError:
    return StoreError(
        f"checkpoint={str(path)!r} is not a checkpoint of this kind, or one of an older cellmap, which had no "
        "checksum: give the name of a new file"
    )


def damaged(path: Path, error: object) -> StoreError:
    """Return the error for a file that cannot be used."""
    return StoreError(f"checkpoint={str(path)!r} is damaged or no HDF5 file: delete it, or give another name ({error})")


def check_belongs(path: Path, theirs: Mapping[str, Any], ours: Mapping[str, Any]) -> None:
    """Refuse a file of another run, naming what differs."""
    now = json.loads(json.dumps(plain(ours)))
    for name in {**now, **theirs}:
        one, other = theirs.get(name), now.get(name)
        if one != other:
            raise ValueError(
                f"checkpoint={str(path)!r} belongs to another run, with {name}={one!r}, and this one has {other!r}: "
                "give another file, or delete this one"
            )


def digest_of(group: h5py.Group) -> str:
    """Hash of all that a group holds: names, attributes and arrays."""
    digest = hashlib.sha256()

    def add(name: str, item: h5py.Group | h5py.Dataset) -> None:
        digest.update(name.encode())
        for key in sorted(set(item.attrs) - {"digest"}):
            digest.update(f"{key}={np.asarray(item.attrs[key]).tolist()!r}".encode())
        if isinstance(item, h5py.Dataset):
            digest.update(f"{item.dtype.str}{item.shape}".encode())
            for part in rows_of(item):
                digest.update(np.ascontiguousarray(part).tobytes())

    add("/", group)
    group.visititems(add)
    return digest.hexdigest()


def plain(value: Any) -> Any:
    """Turn settings into what JSON holds."""
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return plain(dataclasses.asdict(value))
    return value.item() if isinstance(value, np.generic) else value


def _checksum(tally: Any, contents: list[NDArray[Any]]) -> int:
    code = zlib.crc32(np.array(tally, np.int64).tobytes())
    for part in contents:
        code = zlib.crc32(np.ascontiguousarray(part).tobytes(), code)
    return code


def _datasets(file: h5py.File) -> dict[str, h5py.Dataset]:
    found: dict[str, h5py.Dataset] = {}
    file.visititems(lambda name, item: found.update({name: item}) if isinstance(item, h5py.Dataset) else None)
    return found
