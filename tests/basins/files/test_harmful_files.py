"""Files that were made to do harm, with the right checksums: an error that names the file, at once."""

import json
import os
import shutil
import socket
import tracemalloc
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


def array(path: str, value: Any) -> Callable[[h5py.Group], object]:
    """Put an array in the place of another one."""
    folder, _, name = f"./{path}".rpartition("/")
    return lambda group: replaced(group[folder], name, lambda g, n: g.__setitem__(n, value))


def crafted(whole: Path, folder: Path, change: Callable[[h5py.File], object]) -> Path:
    """A changed copy with the right checksums."""
    path = Path(shutil.copy(whole, folder / "crafted.h5"))
    with h5py.File(path, "r+") as file:
        change(file)
    seal(path)
    return path


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
    path = crafted(files / "picture.h5", tmp_path, lambda f: replaced(f["basins"], "labels", ITEMS[item](secret)))
    for unverified in (False, True):
        with pytest.raises(StoreError, match=r"crafted\.h5"):
            load_basins(path, unverified=unverified)


def long_array(group: h5py.Group, name: str) -> None:  # which takes minutes to be looked through
    group.create_dataset(name, (2**28,), np.int8, chunks=(2**28,))


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
    "counts that are none": lambda g: g.attrs.__setitem__("undecided", np.bytes_(b'{"slow": -1}')),
    "a list of reasons": lambda g: g.attrs.__setitem__("undecided", np.bytes_(b"[[]]")),
    "text for numbers": lambda g: g["grid"].attrs.__setitem__("upper", np.bytes_(b"{}")),
    "settings that are a number": lambda g: g.attrs.__setitem__("settings", np.bytes_(b"NaN")),
    "no cost": lambda g: g.attrs.__setitem__("cost", np.bytes_(b'{"seconds": "long"}')),
    "many exponents": array("attractors/0/exponents", np.zeros(90)),
    "a negative distance": lambda g: g["attractors/0"].attrs.__setitem__("grazing", -1.0),
    "other ellipsoids": array("attractors/0/neighbourhood/metrics", np.zeros((9, 2, 2))),
    "an array for attractors": lambda g: replaced(g, "attractors", long_array),
    "an array for an attractor": lambda g: replaced(g["attractors"], "0", long_array),
    "an array for a grid": lambda g: replaced(g, "grid", long_array),
    "no contraction": array("attractors/0/neighbourhood/contraction", np.nan),
    "no labels": lambda g: g.pop("labels"),
    "no times": lambda g: g.pop("settling_time"),
    "negative times": array("settling_time", np.full((60, 50), -2, "i4")),
    "turned times": array("settling_time", np.zeros((50, 60), "i4")),
    "no attractors": lambda g: g.pop("attractors"),
    "another number": lambda g: g.move("attractors/0", "attractors/7"),
    "no params": lambda g: g.attrs.pop("params"),
    "no JSON": lambda g: g.attrs.__setitem__("params", "{not json"),
    "lists for params": lambda g: g.attrs.__setitem__("params", np.bytes_(b'{"a": [1, 2]}')),
    "no coordinates": lambda g: g.attrs.__setitem__("coordinates", "[]"),
    "strange coordinates": lambda g: g.attrs.__setitem__("coordinates", np.bytes_(b'[{"nome": "x"}]')),
    "strange cost": lambda g: g.attrs.__setitem__("cost", np.bytes_(b'{"dollars": 3}')),
    "unheard of": lambda g: g["attractors/0"].attrs.__setitem__("kind", "unheard of"),
    "no number": lambda g: g["attractors/0"].attrs.__setitem__("period", "many"),
    "a period of more points": lambda g: g["attractors/0"].attrs.__setitem__("period", 2),
    "three rotations": lambda g: g["attractors/0"].attrs.__setitem__("turns", [1, 2, 3]),
    "points that are none": array("attractors/0/points", np.full((1, 2), np.nan)),
    "real multipliers": array("attractors/0/multipliers", np.ones(2)),
    "no centres": array("attractors/0/neighbourhood/centres", 1.0),
    "a turned window": lambda g: g["grid"].attrs.__setitem__("upper", [-10.0, -1000.0]),
    "another grid": lambda g: g["grid"].attrs.__setitem__("shape", [3, 3]),
    "a negative count": lambda g: g.attrs.__setitem__("inaccurate", -1),
    "half an orbit": lambda g: g.attrs.__setitem__("inaccurate", 2.5),
}


@pytest.mark.parametrize("attribute", ATTRIBUTES)
def test_attributes_that_are_something_else(attribute, files, tmp_path):
    path = Path(shutil.copy(files / "picture.h5", tmp_path / "crafted.h5"))
    with h5py.File(path, "r+") as file:
        ATTRIBUTES[attribute](next(iter(file.values())))
    with pytest.raises(StoreError, match=r"crafted\.h5.*(its contents are not those that were written|it had)"):
        load_basins(path)
    if attribute != "text of any length":  # which is no damage where nothing was sealed
        with pytest.raises(StoreError, match=r"crafted\.h5"):
            load_basins(path, unverified=True)
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
    "time limit": lambda f: f["pass"].attrs.__setitem__("time_limit", 2**60),
    "restart times": lambda f: f["pass"].attrs.__setitem__("restart_times", np.array([5, 3])),
    "huge restart times": lambda f: f["pass"].attrs.__setitem__("restart_times", np.array([2**60])),
    "rows": array("pass/rows", np.zeros(3, np.uint8)),
    "settled": array("pass/settled", np.zeros(3, np.float32)),
    "guesses": array("pass/examined/guesses", np.zeros((3, 9))),
    "external labels": array("labels", h5py.ExternalLink("a.h5", "b")),
    "no pass": lambda f: f.__delitem__("pass"),
    "an array for a pass": lambda f: replaced(f, "pass", long_array),
    "an array for what was examined": lambda f: replaced(f["pass"], "examined", long_array),
    "larger than what is stored": lambda f: replaced(
        f["pass/examined"], "points", lambda g, n: g.create_dataset(n, (2**26, 2), np.float64)
    ),
    "tally": lambda f: f["pass"].attrs.__setitem__("tally", np.zeros((2, 2))),
    "tally of no numbers": lambda f: f["pass"].attrs.__setitem__("tally", np.full(4, np.nan)),
    "belongs to a list": lambda f: f.attrs.__setitem__("belongs", np.bytes_(b"[1]")),
    "belongs to nothing": lambda f: f.attrs.__setitem__("belongs", np.bytes_(b"null")),
    "labels in pieces": lambda f: replaced(f, "labels", lambda g, n: g.create_dataset(n, (18200,), "i2", chunks=(99,))),
    "labels without a place": lambda f: replaced(f, "labels", lambda g, n: g.create_dataset(n, (18200,), np.int16)),
}


@pytest.mark.parametrize("part", CHECKPOINTS)
def test_checkpoints_that_are_something_else(part, files, tmp_path):
    path = crafted(files / "later pass.h5", tmp_path, CHECKPOINTS[part])
    tracemalloc.start()
    with pytest.raises(StoreError, match=r"checkpoint=.*crafted\.h5' is damaged"):
        READERS["later pass"](path)
    assert tracemalloc.get_traced_memory()[1] < 2**27
    tracemalloc.stop()


@pytest.mark.parametrize("name", ["displacement", "indicator", "tiles of displacement"])
def test_tables_whose_arrays_are_in_pieces(name, files, tmp_path):
    path = Path(shutil.copy(files / "table.h5", tmp_path / "crafted.h5"))
    with h5py.File(path, "r+") as file:
        shape, kind = file[name].shape, file[name].dtype
        replaced(file, name, lambda g, n: g.create_dataset(n, shape, kind, chunks=True))
    seal(path)
    with pytest.raises(StoreError, match=r"checkpoint=.*crafted\.h5' is damaged"):
        READERS["table"](path)


@pytest.mark.parametrize(
    "make", [lambda f, name: f.create_dataset(name, data=np.zeros(9)), lambda *_: None, long_array]
)
def test_files_without_basins(make, files, tmp_path):
    """An array in their place is not looked through, however large it is."""
    path = crafted(files / "finished.h5", tmp_path, lambda f: replaced(f, "basins", make))
    for read in (load_basins, READERS["finished"]):
        with pytest.raises(StoreError, match=r"crafted\.h5"):
            read(path)
