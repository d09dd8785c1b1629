"""Files that were made to do harm, with the right checksums: an error that names the file, at once."""

from __future__ import annotations

import json
import os
import shutil
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from interrupted_files import READERS

from cellmap import load_basins
from cellmap._lib.sealed import ROOM, seal
from cellmap.basins import StoreError


def replaced(group: h5py.Group, name: str, make: Callable[[h5py.Group, str], object]) -> None:
    del group[name]
    make(group, name)


def external(secret: Path) -> Callable[[h5py.Group, str], object]:
    storage = [(str(secret), 0, h5py.h5f.UNLIMITED)]
    return lambda group, name: group.create_dataset(name, (60, 50), np.int16, external=storage)


def virtual(secret: Path) -> Callable[[h5py.Group, str], object]:
    layout = h5py.VirtualLayout((60, 50), np.int16)
    layout[...] = h5py.VirtualSource(str(secret), "labels", (60, 50))
    return lambda group, name: group.create_virtual_dataset(name, layout)


def unwritten(shape: tuple[int, ...], **how: Any) -> Callable[[h5py.Group, str], object]:
    return lambda group, name: group.create_dataset(name, shape, np.int16, **how)


def deep(group: h5py.Group, name: str) -> None:
    for _ in range(3000):
        group = group.create_group("g")


def opaque(group: h5py.Group, name: str) -> None:
    group[name] = np.zeros((60, 50), "V2")


ITEMS: dict[str, Callable[[Path], Callable[[h5py.Group, str], object]]] = {
    "external storage": external,
    "external storage in a pipe": lambda secret: external(secret.with_name("pipe")),
    "external link": lambda s: lambda g, n: g.__setitem__(n, h5py.ExternalLink(str(s), "labels")),
    "external link to a pipe": lambda s: (
        lambda g, n: g.__setitem__(n, h5py.ExternalLink(str(s.with_name("pipe")), "x"))
    ),
    "external link to a device": lambda s: lambda g, n: g.__setitem__(n, h5py.ExternalLink("/dev/zero", "labels")),
    "soft link": lambda s: lambda g, n: g.__setitem__(n, h5py.SoftLink("../settling_time")),
    "dangling link": lambda s: lambda g, n: g.__setitem__(n, h5py.SoftLink("/nowhere")),
    "link to itself": lambda s: lambda g, n: g.__setitem__(n, h5py.SoftLink(n)),
    "the group itself": lambda s: lambda g, n: g.__setitem__(n, g),
    "the root": lambda s: lambda g, n: g.__setitem__(n, g["/"]),
    "another array": lambda s: lambda g, n: g.__setitem__(n, g["settling_time"]),
    "virtual": virtual,
    "a type": lambda s: lambda g, n: g.__setitem__(n, np.dtype(np.int16)),
    "a group": lambda s: lambda g, n: g.create_group(n),
    "many groups": lambda s: deep,
    "text": lambda s: lambda g, n: g.__setitem__(n, "labels"),
    "texts": lambda s: lambda g, n: g.__setitem__(n, np.array(["a"] * 3000, object).reshape(60, 50)),
    "references": lambda s: lambda g, n: g.create_dataset(n, (60, 50), h5py.ref_dtype),
    "lists": lambda s: lambda g, n: g.create_dataset(n, (60, 50), h5py.vlen_dtype(np.int16)),
    "opaque": lambda s: opaque,
    "empty": lambda s: lambda g, n: g.__setitem__(n, h5py.Empty(np.int16)),
    "one number": lambda s: lambda g, n: g.__setitem__(n, np.int16(0)),
    "no length": lambda s: unwritten((0, 50)),
    "huge": lambda s: unwritten((2**31, 2**31)),
    "huge in chunks": lambda s: unwritten((2**31, 2**31), chunks=(64, 64)),
    "huge and compressed": lambda s: unwritten((2**31, 2**31), chunks=(64, 64), compression="gzip"),
    "a filter of its own": lambda s: unwritten((60, 50), chunks=(60, 50), compression="lzf"),
    "rounded": lambda s: unwritten((60, 50), chunks=(60, 50), scaleoffset=3),
    "complex": lambda s: lambda g, n: g.__setitem__(n, np.zeros((60, 50), complex)),
    "floats": lambda s: lambda g, n: g.__setitem__(n, np.zeros((60, 50))),
    "other byte order": lambda s: lambda g, n: g.__setitem__(n, np.zeros((60, 50), ">i2")),
    "unsigned": lambda s: lambda g, n: g.__setitem__(n, np.zeros((60, 50), np.uint16)),
    "turned": lambda s: lambda g, n: g.__setitem__(n, np.zeros((50, 60), np.int16)),
    "flat": lambda s: lambda g, n: g.__setitem__(n, np.zeros(3000, np.int16)),
    "no such attractor": lambda s: lambda g, n: g.__setitem__(n, np.full((60, 50), 7, np.int16)),
    "no such code": lambda s: lambda g, n: g.__setitem__(n, np.full((60, 50), -30, np.int16)),
}


@pytest.mark.parametrize("item", ITEMS)
def test_labels_that_are_something_else(item, files, tmp_path):
    """Of what other files hold nothing is read, a pipe is not waited for, and nothing huge is made."""
    secret = tmp_path / "secret.h5"
    with h5py.File(secret, "w") as file:
        file["labels"] = np.zeros((60, 50), np.int16)
    os.mkfifo(tmp_path / "pipe")
    path = Path(shutil.copy(files / "picture.h5", tmp_path / "crafted.h5"))
    with h5py.File(path, "r+") as file:
        replaced(next(iter(file.values())), "labels", ITEMS[item](secret))
    seal(path)
    for unverified in (False, True):
        with pytest.raises(StoreError, match=r"crafted\.h5"):
            load_basins(path, unverified=unverified)


ATTRIBUTES: dict[str, Callable[[h5py.Group], object]] = {
    "text of any length": lambda g: g.attrs.__setitem__("params", "{}"),
    "texts of any length": lambda g: g.attrs.__setitem__("params", ["{}", "{}"]),
    "reference": lambda g: g.attrs.__setitem__("params", g.ref),
    "nothing": lambda g: g.attrs.__setitem__("params", h5py.Empty("f")),
    "brackets": lambda g: g.attrs.__setitem__("params", np.bytes_(b"[" * 30_000)),
    "digits": lambda g: g.attrs.__setitem__("cost", np.bytes_(b'{"steps": ' + b"9" * 30_000 + b"}")),
    "no text": lambda g: g.attrs.__setitem__("params", np.bytes_(b"\xff\xfe")),
    "a list": lambda g: g.attrs.__setitem__("params", np.bytes_(b"[1]")),
    "huge number": lambda g: g.attrs.__setitem__("inaccurate", 1e300),
    "huge grid": lambda g: g["grid"].attrs.__setitem__("shape", [2**62, 2**62]),
    "no cells": lambda g: g["grid"].attrs.__setitem__("shape", [0, 50]),
    "no window": lambda g: g["grid"].attrs.__setitem__("upper", [np.nan, 1.0]),
    "no grid": lambda g: g.__delitem__("grid"),
    "two kinds of starts": lambda g: g.__setitem__("starts", np.zeros((60, 50, 2))),
}


@pytest.mark.parametrize("attribute", ATTRIBUTES)
def test_attributes_that_are_something_else(attribute, files, tmp_path):
    path = Path(shutil.copy(files / "picture.h5", tmp_path / "crafted.h5"))
    with h5py.File(path, "r+") as file:
        ATTRIBUTES[attribute](next(iter(file.values())))
    seal(path)
    with pytest.raises(StoreError, match=r"crafted\.h5"):
        load_basins(path)


def sealed_by_hand(content: object) -> bytes:
    text = content if isinstance(content, bytes) else json.dumps(content).encode()
    return (b"cellmap seal 1\n" + text).ljust(ROOM, b"\0")[:ROOM]


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"{",
        b"[" * 490,
        b"9" * 490,
        b"\xff\xff",
        [],
        {"bytes": "many"},
        {"bytes": 10**400, "holes": [], "sha256": ""},
        {"bytes": 0, "holes": [[-1, 5]], "sha256": ""},
        {"bytes": 17000, "holes": [[600, -80]], "sha256": ""},
        {"bytes": 17000, "holes": [[600, 10**15]], "sha256": ""},
        {"bytes": 17000, "holes": [[900, 100], [600, 100]], "sha256": ""},
        {"bytes": 17000, "holes": 3, "sha256": ""},
        {"bytes": 17000, "holes": [[1]], "sha256": None},
    ],
    ids=str,
)
def test_checksums_that_are_none(content, files, tmp_path):
    path = tmp_path / "crafted.h5"
    path.write_bytes(sealed_by_hand(content) + (files / "picture.h5").read_bytes()[ROOM:])
    for read in (load_basins, READERS["first pass"], READERS["table"]):
        with pytest.raises(StoreError, match=r"crafted\.h5"):
            read(path)


@pytest.mark.parametrize("kind", ["pipe", "socket", "device", "link to a pipe"])
def test_something_that_is_no_file(kind, tmp_path):
    path = tmp_path / "odd.h5"
    if kind == "socket":
        with socket.socket(socket.AF_UNIX) as end:
            end.bind(str(path))
    elif kind == "device":
        path.symlink_to("/dev/zero")
    else:
        os.mkfifo(tmp_path / "pipe")
        path.symlink_to(tmp_path / "pipe")
    with pytest.raises(OSError, match=r"odd\.h5"):
        load_basins(path)
    for read in (READERS["first pass"], READERS["table"]):
        with pytest.raises(OSError, match=r"odd\.h5"):
            read(path)


CHECKPOINTS: dict[str, Callable[[h5py.File], object]] = {
    "horizon": lambda f: f["pass"].attrs.__setitem__("horizon", 2**60),
    "legs": lambda f: f["pass"].attrs.__setitem__("legs", np.array([5, 3])),
    "huge legs": lambda f: f["pass"].attrs.__setitem__("legs", np.array([2**60])),
    "rows": lambda f: replaced(f["pass"], "rows", lambda g, n: g.__setitem__(n, np.zeros(3, np.uint8))),
    "settled": lambda f: replaced(f["pass"], "settled", lambda g, n: g.__setitem__(n, np.zeros(3, np.float32))),
    "guesses": lambda f: replaced(f["pass/examined"], "guesses", lambda g, n: g.__setitem__(n, np.zeros((3, 9)))),
    "external labels": lambda f: replaced(f, "labels", lambda g, n: g.__setitem__(n, h5py.ExternalLink("a.h5", "b"))),
    "no pass": lambda f: f.__delitem__("pass"),
}


@pytest.mark.parametrize("part", CHECKPOINTS)
def test_checkpoints_that_are_something_else(part, files, tmp_path):
    path = Path(shutil.copy(files / "later pass.h5", tmp_path / "crafted.h5"))
    with h5py.File(path, "r+") as file:
        CHECKPOINTS[part](file)
    seal(path)
    with pytest.raises(StoreError, match=r"checkpoint=.*crafted\.h5' is damaged"):
        READERS["later pass"](path)
