"""Damaged files, and files that were made to do harm: an error that names the file, at once, or what was written."""

from __future__ import annotations

import faulthandler
import json
import os
import shutil
import socket
import subprocess
import sys
from collections.abc import Callable
from math import cos, sin
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import cellmap._lib.checkpoint
from cellmap import Basins, CellGrid, discrete_map, find_basins, interpolated_map, load_basins, save_basins
from cellmap._lib.sealed import ROOM, seal
from cellmap.basins import StoreError

WINDOW = CellGrid((-0.6, -0.6), (0.6, 0.6), (140, 130))  # two tiles


def conservative(x, p):
    """Hénon's area-preserving map: nothing settles, and the second pass goes on with what is left."""
    y = x[1] - x[0] * x[0]
    return x[0] * cos(p.angle) - y * sin(p.angle), x[0] * sin(p.angle) + y * cos(p.angle)


def turning():
    return discrete_map(conservative, {"angle": 1.327}, ("x", "y"))


def halves() -> Basins:
    return find_basins(
        discrete_map(lambda x, p: (x[0] / 2, x[1] / 3), {}, ("x", "y")), CellGrid((-1, -1), (1, 1), (60, 50))
    )


_SECONDS = 60.0  # for one file, and the run that goes on from it, on a busy machine


class Died(BaseException):
    """What ends a run in the middle here."""


def interrupted(run: Callable[[], Any], tiles: int) -> None:
    """Let a run die after some tiles."""
    original, left = cellmap._lib.checkpoint.Checkpoint.finish, tiles

    def finish(self: Any, *entry: Any) -> None:
        nonlocal left
        if not left:
            raise Died
        left -= 1
        original(self, *entry)

    cellmap._lib.checkpoint.Checkpoint.finish = finish
    try:
        run()
    except Died:
        pass
    finally:
        cellmap._lib.checkpoint.Checkpoint.finish = original


READERS: dict[str, Callable[[Path], bytes]] = {
    "picture": lambda path: load_basins(path).labels.tobytes(),
    "finished": lambda path: find_basins(turning(), WINDOW, 260, checkpoint=path).labels.tobytes(),
    "first pass": lambda path: find_basins(turning(), WINDOW, 260, checkpoint=path).labels.tobytes(),
    "later pass": lambda path: find_basins(turning(), WINDOW, 260, checkpoint=path).labels.tobytes(),
    "table": lambda path: interpolated_map(turning(), WINDOW, checkpoint=path).table.coefficients.tobytes(),
}


def make_files(folder: Path) -> None:
    cellmap.set_threads(1)
    save_basins(halves(), folder / "picture.h5")
    READERS["finished"](folder / "finished.h5")
    interrupted(lambda: READERS["first pass"](folder / "first pass.h5"), 1)
    interrupted(lambda: READERS["later pass"](folder / "later pass.h5"), 3)
    with h5py.File(folder / "later pass.h5", "r") as file:
        assert "rows" in file["pass"]
    interrupted(lambda: READERS["table"](folder / "table.h5"), 2)


def damage(whole: bytes, rng: np.random.Generator) -> bytes:
    """Return contents as disks, programs and people leave them."""
    part = bytearray(whole)
    kind, size = rng.integers(8), int(rng.choice([1, 4, 512, 4096]))
    place = int(rng.integers(len(part))) // size * size
    if kind == 0:
        part[place] ^= 1 << int(rng.integers(8))
    elif kind == 1:
        part[place : place + size] = bytes(len(part[place : place + size]))
    elif kind == 2:
        part[place : place + size] = rng.bytes(len(part[place : place + size]))
    elif kind == 3:
        del part[place:]
    elif kind == 4:
        del part[place : place + size]
    elif kind == 5:
        part[place:place] = bytes(size)
    elif kind == 6:
        other = int(rng.integers(len(part))) // size * size
        part[place : place + size], part[other : other + size] = part[other : other + size], part[place : place + size]
    else:
        part += rng.bytes(size)
    return bytes(part)


def campaign(folder: Path, files: Path, count: int, seed: int) -> None:
    """Damage files and read them; say which one it is, so that one that hangs can be found."""
    rng, refused = np.random.default_rng(seed), 0
    cellmap.set_threads(1)
    for name, reader in READERS.items():
        whole, path = (files / f"{name}.h5").read_bytes(), folder / f"{name}.h5"
        shutil.copy(files / f"{name}.h5", path)
        expected = reader(path)
        for k in range(6 * count // 10 if name == "picture" else count // 10):
            path.write_bytes(damaged := damage(whole, rng))
            print(f"{name} {k}", file=sys.stderr, flush=True)
            faulthandler.dump_traceback_later(_SECONDS, exit=True)
            try:
                found = reader(path)
            except StoreError as error:
                refused += 1
                assert str(path) in str(error), error
                assert path.read_bytes() == damaged, "what cannot be read is not changed"
            else:
                assert found == expected
    faulthandler.cancel_dump_traceback_later()
    print(f"{refused} refused")


def run_campaign(folder: Path, files: Path, count: int) -> int:
    program = (
        f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r}); from pathlib import Path\n"
        "from test_damaged_files import campaign\n"
        f"campaign(Path({str(folder)!r}), Path({str(files)!r}), {count}, 0)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    return int(done.stdout.split()[0])


@pytest.fixture(scope="module")
def files(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("whole")
    make_files(folder)
    return folder


@pytest.mark.parametrize("count", [100, pytest.param(10_000, marks=pytest.mark.slow)])
def test_damage_is_an_error_that_names_the_file_or_changes_nothing(count, files, tmp_path):
    """In a process of its own, which ends where a file takes long: HDF5's library does not listen to anything else."""
    refused = run_campaign(tmp_path, files, count)
    assert refused > 0.6 * count, "what is not refused has hit tiles that are done again"


@pytest.mark.parametrize("name", READERS)
def test_every_sector_counts(name, files, tmp_path):
    """Each sector outside the arrays, zeroed, is noticed before HDF5 sees it."""
    whole, path = (files / f"{name}.h5").read_bytes(), tmp_path / "damaged.h5"
    content = json.loads(whole[len(b"cellmap seal 1\n") : ROOM].rstrip(b"\0"))
    arrays = [range(begin, begin + length) for begin, length in content["holes"]]
    for place in range(0, len(whole), 512):
        if not any(place in part or place + 511 in part for part in arrays) and any(whole[place : place + 512]):
            path.write_bytes(whole[:place] + bytes(512) + whole[place + 512 :])
            with pytest.raises(StoreError, match=r"damaged\.h5"):
                READERS[name](path)


def test_a_flipped_label_is_noticed(files, tmp_path):
    """One bit of a label of a tile that is done, and of one that an earlier pass has left as it is."""
    path = Path(shutil.copy(files / "finished.h5", tmp_path / "flipped.h5"))
    with h5py.File(path, "r") as file:
        place = next(iter(file.values()))["labels"].id.get_offset()
    with path.open("r+b") as stream:
        stream.seek(place + 2000)
        byte = stream.read(1)[0]
        stream.seek(place + 2000)
        stream.write(bytes([byte ^ 1]))
    with pytest.raises(StoreError, match=r"flipped\.h5' is .*damaged"):
        load_basins(path)


# --- files that were made to do harm, with the right checksum


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
