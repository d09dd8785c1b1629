"""Compiled code on disk: what is damaged, foreign or open to others is never loaded."""

import ctypes
import os
import re
import subprocess
import sys
import time
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cellmap._compiled.codegen.instructions import Instructions, module_text
from cellmap._compiled.machine_code import machine_code
from cellmap._compiled.object_cache import ObjectCache, cache_folder

KEY, OTHER = "0123456789abcdef" * 4, "fedcba9876543210" * 4


@pytest.fixture
def cache(tmp_path: Path) -> ObjectCache:
    return ObjectCache(tmp_path)


def refused(cache: ObjectCache, key: str = KEY) -> None:
    with pytest.warns(RuntimeWarning, match="is damaged or foreign"):
        assert cache.read(key) is None


def test_what_was_written_is_read_again_but_not_with_any_byte_changed(cache: ObjectCache, tmp_path: Path) -> None:
    assert cache.read(KEY) is None
    cache.write(KEY, b"some code")
    assert (cache.read(KEY), cache.read(OTHER)) == (b"some code", None)
    (path,) = tmp_path.iterdir()
    whole = path.read_bytes()
    for place in range(len(whole)):
        for damaged in (whole[:place], whole[:place] + bytes([whole[place] ^ 0x10]) + whole[place + 1 :]):
            path.write_bytes(damaged)
            refused(cache)
            assert not path.exists()
    (path.with_name(path.name.replace(KEY[:32], OTHER[:32]))).write_bytes(whole)
    refused(cache, OTHER)


def test_an_entry_is_not_read_beyond_what_one_can_be(cache: ObjectCache, tmp_path: Path) -> None:
    """A sparse file of 16 GB, foreign or with the right beginning, takes no time and no memory."""
    cache.write(KEY, b"code")
    (path,) = tmp_path.iterdir()
    whole = path.read_bytes()
    for beginning in (whole, b"", whole[:50]):
        path.write_bytes(beginning)
        os.truncate(path, 2**34)
        tracemalloc.start()
        refused(cache)
        assert tracemalloc.get_traced_memory()[1] < 2**20
        tracemalloc.stop()
        assert not path.exists()


def test_the_folder_follows_the_environment_and_the_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("CELLMAP_CACHE_DIR", "~/kept")
    assert cache_folder() == tmp_path / "kept" and (tmp_path / "kept").is_dir()
    monkeypatch.setenv("CELLMAP_CACHE_DIR", "~nobody-of-this-name/kept")
    assert cache_folder() is None
    monkeypatch.delenv("CELLMAP_CACHE_DIR")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert cache_folder() == tmp_path / "xdg" / "cellmap"


def test_the_least_recently_used_entries_go_first(tmp_path: Path) -> None:
    cache = ObjectCache(tmp_path, limit=3500)
    keys = [f"{i:x}" * 64 for i in range(4)]
    for age, key in enumerate(keys[:3]):
        cache.write(key, bytes(1000))
        (path,) = tmp_path.glob(f"{key[:32]}*")
        os.utime(path, (time.time() - 1000 + age,) * 2)
    cache.read(keys[0])
    cache.write(keys[3], bytes(1000))
    assert [cache.read(key) is not None for key in keys] == [True, False, True, True]


def small_program() -> str:
    """Return a module with a function that doubles the number at an address."""
    out = Instructions(1)
    out.store(out.binary("fadd", number := out.load("%x"), number), "%x")
    return module_text(out.function("double_it", "ptr %x"), out)


def doubled() -> float:
    """Return what a new process computes: this one keeps the functions that it has loaded."""
    place = ctypes.c_double(2.0)
    loaded = machine_code.__wrapped__(small_program())
    ctypes.CFUNCTYPE(None, ctypes.c_void_p)(loaded.address("double_it"))(ctypes.addressof(place))
    return place.value


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    place = tmp_path / "kept"
    monkeypatch.setenv("CELLMAP_CACHE_DIR", str(place))
    return place


def test_code_is_kept_in_a_private_folder(folder: Path) -> None:
    old = os.umask(0)
    try:
        assert doubled() == 4.0
    finally:
        os.umask(old)
    assert folder.stat().st_mode & 0o777 == 0o700
    assert [path.suffix for path in folder.rglob("*") if path.is_file()] == [".object"]
    assert doubled() == 4.0


@pytest.mark.parametrize("tries", [20, pytest.param(1000, marks=pytest.mark.thorough)])
def test_a_damaged_entry_is_recompiled(folder: Path, tries: int) -> None:
    doubled()
    (path,) = folder.iterdir()
    whole = path.read_bytes()
    for place in range(0, len(whole), -(-len(whole) // tries)):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
        with pytest.warns(RuntimeWarning, match=re.escape(str(path))):
            assert doubled() == 4.0
        assert path.read_bytes() == whole


@pytest.mark.parametrize("mode", [0o770, 0o707, 0o777, "of somebody else"])
def test_a_folder_that_others_can_write_is_not_used(folder: Path, mode: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    doubled()
    if mode == "of somebody else":
        monkeypatch.setattr(os, "geteuid", lambda: folder.stat().st_uid + 1)
    else:
        folder.chmod(mode)
    for path in folder.iterdir():
        path.write_bytes(b"planted")
    with pytest.warns(UserWarning, match="others can write to it"):
        assert doubled() == 4.0
    assert [path.read_bytes() for path in folder.iterdir()] == [b"planted"]


def test_without_a_folder_code_lives_in_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CELLMAP_CACHE_DIR", "")
    assert doubled() == 4.0
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("CELLMAP_CACHE_DIR", str(tmp_path / "file" / "cache"))
    assert doubled() == 4.0


PROGRAM = """
import numpy as np, sys
from math import cos, pi
from cellmap import ForcedSystem, stroboscopic_map
def rhs(t, x, p):
    return x[1], x[0] - x[0]**3 - 0.15 * x[1] + 0.2 * cos(t)
system = ForcedSystem(rhs, {}, 2 * pi, ("x", "v"))
np.save(sys.argv[1], stroboscopic_map(system, method="RK45", rtol=1e-6)(np.linspace(-1, 1, 20).reshape(10, 2)))
"""


@pytest.mark.parametrize("count", [2, pytest.param(8, marks=pytest.mark.thorough)])
def test_processes_that_start_together_agree(tmp_path: Path, count: int) -> None:
    """Processes compile, write and read the same code at the same time; a later one reads it."""
    environment = {**os.environ, "CELLMAP_CACHE_DIR": str(tmp_path / "shared")}
    command = [sys.executable, "-c", PROGRAM]
    results = [tmp_path / f"{i}.npy" for i in range(count + 1)]
    together = [subprocess.Popen([*command, str(r)], env=environment) for r in results[:-1]]
    assert [p.wait(timeout=120) for p in together] == [0] * count
    subprocess.run([*command, str(results[-1])], env=environment, check=True, timeout=120)
    first, *others = (np.load(r) for r in results)
    assert np.isfinite(first).all()
    assert all(np.array_equal(first, other) for other in others)
