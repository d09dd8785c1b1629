"""HDF5 files with a checksum that is verified before the HDF5 library reads any of the file.

The HDF5 library trusts the contents of a file: damage can make it loop for ever, and a manipulated file can make it
read other files.  A file therefore begins with a block that holds the checksum of all that follows, except arrays that
change later and have checksums of their own.  After this check the file is opened and its contents are inspected: only
plain groups, arrays of numbers in the file itself, and attributes of fixed length are accepted.
"""

from __future__ import annotations

import hashlib
import json
import os
import secrets
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import DTypeLike, NDArray

from .files import StoreError, opened_file, told_of_full_disk
from .signatures import RENAMED
from .systems import take_room


class UnsealedError(StoreError):
    """An HDF5 file of something else, or of an older cellmap, that does not begin with a checksum."""


class ChangedError(StoreError):
    """A file that begins with a checksum, of contents that are others: damaged, or changed by another program."""


ROOM = 512
"""Bytes of the block before the HDF5 file."""

Hole = tuple[int, int]
"""First byte and length of what the checksum leaves out."""

_MAGIC = b"cellmap seal 1\n"
_HDF5 = b"\x89HDF\r\n\x1a\n"
_READ = 2**22  # bytes at a time
_DENSEST = 2000  # compression squeezes zeros by half of this
_SMALL = 2**20  # bytes of arrays whose room in the file is not looked at
_LONGEST = 2**15  # bytes of text that an attribute holds
_FILTERS = {h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32}
_NUMBERS = {h5py.h5t.INTEGER, h5py.h5t.FLOAT, h5py.h5t.ENUM, getattr(h5py.h5t, "COMPLEX", None)}


def seal(path: Path, holes: Sequence[Hole] = ()) -> None:
    """Write the checksum of a file that was made with room for it."""
    size = path.stat().st_size
    with path.open("r+b") as stream:
        content = {"bytes": size, "holes": sorted(holes), "sha256": _checksum(stream, size, sorted(holes))}
        block = _MAGIC + json.dumps(content).encode()
        if len(block) > ROOM:
            raise ValueError(f"{len(holes)} arrays are too many to be left out of a checksum")
        stream.seek(0)
        stream.write(block.ljust(ROOM, b"\0"))


def image_of(write: Callable[[h5py.File], None]) -> bytes:
    """Return what a file would hold that `write` fills.

    HDF5's library does not survive a write that fails, as on a full disk; what it has written to memory does.
    """
    # HDF5 tells files apart by their names, those in memory too.
    with h5py.File(f"image {secrets.token_hex(16)}", "w", driver="core", backing_store=False) as file:
        write(file)
        file.flush()
        return bytes(file.id.get_file_image())


def write_sealed(path: Path, write: Callable[[h5py.File], None]) -> None:
    """Make a file that `write` fills, by way of memory."""
    content = image_of(write)
    with told_of_full_disk(path, ROOM + len(content)):
        path.write_bytes(bytes(ROOM) + content)
        seal(path)


def reserve(path: Path, more: int = 0) -> None:
    """Take the room of a file on the disk, and some more, before what cannot bear a full one writes there.

    These are HDF5's library and maps into memory.
    """
    size = path.stat().st_size + more
    with told_of_full_disk(path, size), path.open("r+b") as stream:
        take_room(stream.fileno(), size)


@contextmanager
def opened(path: Path, unverified: bool = False) -> Iterator[h5py.File]:
    """Open a file for reading, once its checksum is verified, or without one where that is asked for.

    Raises
    ------
    StoreError
        For a file that is damaged, that something else wrote, or that refers to other files.
    """
    try:
        _verify(path, unverified)
        with h5py.File(path, "r") as file:
            _look_through(file, unverified)
            yield file
    except (StoreError, MemoryError):
        raise
    except Exception as error:
        raise StoreError(
            f"{str(path)!r} is truncated, damaged or no HDF5 file of cellmap's: write it again ({error})"
        ) from error


def put_text(item: h5py.Group | h5py.Dataset, name: str, text: str) -> None:
    """Write text with a fixed length: as an attribute, or where it is too long for one as an array of bytes."""
    content = text.encode()
    if b"\0" in content:
        raise ValueError(f"{name}={text!r}: text with a zero byte cannot be stored")
    if len(content) <= _LONGEST:
        kind = h5py.string_dtype("utf-8", max(1, len(content)))
        item.attrs.create(name, np.array(content, kind), dtype=kind)
    else:
        group, prefix = (item, "") if isinstance(item, h5py.Group) else (item.parent, item.name.rpartition("/")[2])
        group[f"{prefix}.{name}"] = np.frombuffer(content, np.uint8)


def get_text(group: h5py.Group, name: str) -> str:
    """Read the text that was put into a group."""
    value = group.attrs[name] if name in group.attrs else group[f".{name}"][()].tobytes()
    if isinstance(value, bytes):
        return value.decode()
    if isinstance(value, str):
        return value
    raise TypeError(f"{name} is not text")


def get_number(group: h5py.Group, name: str, at_least: int = 0) -> int:
    """Read one whole number."""
    value = group.attrs[name]
    if not isinstance(value, np.integer) or value < at_least:
        raise ValueError(f"{name} is {value!r}")
    return int(value)


def get_numbers(group: h5py.Group, name: str, many: int | None = None, kinds: str = "i") -> list[Any]:
    """Read a list of numbers of some kinds, of any length where that is None."""
    values = np.asarray(group.attrs[name])
    if values.ndim != 1 or many not in (None, len(values)) or values.dtype.kind not in kinds:
        raise ValueError(f"{name} is {values!r}")
    return list(values.tolist())


def get_mapping(group: h5py.Group, name: str) -> dict[str, Any]:
    """Read a mapping that was put there as text."""
    if not isinstance(found := json.loads(get_text(group, name)), dict):
        raise TypeError(f"{name} is not a mapping")
    return found


def get_settings(group: h5py.Group, name: str) -> dict[str, Any]:
    """Read a mapping of arguments, of which some may have been written under an older name."""
    return {RENAMED.get(key, key): value for key, value in get_mapping(group, name).items()}


def group_of(group: h5py.Group, name: str) -> h5py.Group:
    """Return a group, and not an array in its place, which would be searched row by row for names."""
    if not isinstance(found := group[name], h5py.Group):
        raise TypeError(f"{found.name} is not a group")
    return found


def array_of(group: h5py.Group, name: str, kind: DTypeLike, shape: tuple[int | None, ...]) -> NDArray[Any]:
    """Read an array of a type and a shape, of any length where that is None."""
    item = group[name]
    if not isinstance(item, h5py.Dataset) or item.dtype != np.dtype(kind) or len(item.shape) != len(shape):
        raise ValueError(f"{item.name} is not an array of {len(shape)} axes of {np.dtype(kind)}")
    if any(wanted not in (None, found) for wanted, found in zip(shape, item.shape, strict=True)):
        raise ValueError(f"{item.name} has the shape {item.shape}")
    return np.asarray(item[()])


def within(values: NDArray[Any], lowest: int, highest: int) -> bool:
    """Tell whether all numbers are in a range."""
    return not values.size or bool(values.min() >= lowest and values.max() <= highest)


def rows_of(item: h5py.Dataset) -> Iterator[Any]:
    """Yield an array a few rows at a time, so that no large one is in memory as a whole."""
    if not item.shape:
        yield np.asarray(item[()])
        return
    many = max(1, 2**24 // max(1, item.dtype.itemsize * int(np.prod(item.shape[1:], dtype=object))))
    for k in range(0, item.shape[0], many):
        yield item[k : k + many]


def _verify(path: Path, unverified: bool) -> None:
    with opened_file(path) as stream:
        if unverified:
            return
        block = stream.read(ROOM)
        if block.startswith(_HDF5):
            raise UnsealedError(f"{str(path)!r} is an HDF5 file without a checksum")
        if not block.startswith(_MAGIC):
            raise ValueError("it does not begin with a checksum")
        found = json.loads(block[len(_MAGIC) :].rstrip(b"\0"))
        size, holes = found["bytes"], [(int(begin), int(length)) for begin, length in found["holes"]]
        expected = _MAGIC + json.dumps({"bytes": size, "holes": holes, "sha256": found["sha256"]}).encode()
        if block != expected.ljust(ROOM, b"\0"):
            raise ValueError("its checksum is not written as cellmap writes it")
        there = os.fstat(stream.fileno()).st_size
        changed = f"{str(path)!r} is damaged, or another program has changed it: "
        if size > there:
            raise ValueError(f"it had {size:,} bytes")
        if size < there:
            raise ChangedError(f"{changed}it had {size:,} bytes")
        if found["sha256"] != _checksum(stream, size, holes):
            raise ChangedError(f"{changed}its contents are not those that were written")


def _checksum(stream: Any, size: int, holes: Sequence[Hole]) -> str:
    """Hash what is behind the block and outside the holes."""
    digest, begin = hashlib.sha256(), ROOM
    for hole, length in [*holes, (size, 0)]:
        if not begin <= hole <= size or length < 0:
            raise ValueError("its arrays overlap")
        stream.seek(begin)
        while begin < hole:
            part = stream.read(min(_READ, hole - begin))
            if not part:
                raise ValueError("it is shorter than it was")
            digest.update(part)
            begin += len(part)
        begin = hole + length
    return digest.hexdigest()


def _look_through(file: h5py.File, old: bool) -> None:
    """Refuse whatever no file of cellmap's holds: links but the plain one, data elsewhere, text of any length."""
    seen: set[Any] = set()
    groups = [h5py.h5g.open(file.id, b"/")]
    while groups:
        group = groups.pop()
        _check_attributes(group, old)
        for name in list(group):
            if group.links.get_info(name).type != h5py.h5l.TYPE_HARD:
                raise ValueError(f"{name.decode(errors='replace')} is a link to something else")
            item = h5py.h5o.open(group, name)
            place = h5py.h5g.get_objinfo(group, name).objno
            if place in seen:
                raise ValueError(f"{name.decode(errors='replace')} occurs twice")
            seen.add(place)
            if isinstance(item, h5py.h5g.GroupID):
                groups.append(item)
            elif isinstance(item, h5py.h5d.DatasetID):
                _check_attributes(item, old)
                _check_array(item, name.decode(errors="replace"))
            else:
                raise ValueError(f"{name.decode(errors='replace')} is neither a group nor an array")


def _check_array(item: Any, name: str) -> None:
    how = item.get_create_plist()
    filters = {how.get_filter(k)[0] for k in range(how.get_nfilters())}
    if how.get_external_count() or how.get_layout() == h5py.h5d.VIRTUAL:
        raise ValueError(f"{name} is kept in another file")
    if not filters <= _FILTERS or not _is_numeric(item.get_type()):
        raise ValueError(f"{name} is not an array of numbers")
    most = (_DENSEST if h5py.h5z.FILTER_DEFLATE in filters else 1) * item.get_storage_size() + _SMALL
    if int(np.prod(item.shape, dtype=object)) * item.get_type().get_size() > most:
        raise ValueError(f"{name} is larger than its file can hold")


def _check_attributes(item: Any, old: bool) -> None:
    for k in range(h5py.h5a.get_num_attrs(item)):
        attribute = h5py.h5a.open(item, index=k)
        kind = attribute.get_type()
        text = isinstance(kind, h5py.h5t.TypeStringID) and (old or not kind.is_variable_str())
        if not (text or _is_numeric(kind)):
            raise ValueError(f"{attribute.name.decode(errors='replace')} is neither text of fixed length nor numbers")


def _is_numeric(kind: Any) -> bool:
    if isinstance(kind, h5py.h5t.TypeCompoundID):
        return all(_is_numeric(kind.get_member_type(k)) for k in range(kind.get_nmembers()))
    if isinstance(kind, h5py.h5t.TypeArrayID):
        return _is_numeric(kind.get_super())
    return kind.get_class() in _NUMBERS
