"""Generated modules on disk."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from cellmap.codegen.lanes import HEADER
from cellmap.codegen.module import cache_folder, generated_module

TEXT = HEADER + '@njit("float64(float64)", **KERNEL)\ndef advance(x):\n    return {factor} * x\n'


import_anew = generated_module.__wrapped__
"""What a new process does: this one keeps the modules that it has imported."""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Give each test its own empty folder."""
    place = tmp_path / "kernels"
    monkeypatch.setenv("CELLMAP_CACHE_DIR", str(place))
    return place


def sources(folder: Path) -> list[Path]:
    return sorted(folder.glob("*.py"))


def test_equal_text_is_compiled_once(folder: Path) -> None:
    text = TEXT.format(factor=17.0)
    first = generated_module(text)
    assert generated_module(text) is first
    assert len(sources(folder)) == 1


def test_a_later_process_finds_the_compiled_code(folder: Path) -> None:
    import_anew(TEXT.format(factor=2.0))
    again = import_anew(TEXT.format(factor=2.0))
    assert again.advance(3.0) == 6.0
    assert sum(again.advance.stats.cache_hits.values()) == 1


def test_other_text_has_another_name(folder: Path) -> None:
    assert import_anew(TEXT.format(factor=2.0)).advance(1.0) == 2.0
    assert import_anew(TEXT.format(factor=3.0)).advance(1.0) == 3.0
    assert len(sources(folder)) == 2


def test_a_file_that_was_tampered_with_is_replaced(folder: Path) -> None:
    import_anew(TEXT.format(factor=2.0))
    (path,) = sources(folder)
    path.write_text("raise SystemExit", encoding="utf-8")
    assert import_anew(TEXT.format(factor=2.0)).advance(1.0) == 2.0
    assert path.read_text(encoding="utf-8") == TEXT.format(factor=2.0)


@pytest.mark.parametrize("place", [0, 40, -1])
def test_a_byte_that_is_no_text_is_mended(folder: Path, place: int) -> None:
    import_anew(TEXT.format(factor=2.0))
    (path,) = sources(folder)
    damaged = bytearray(path.read_bytes())
    damaged[place] = 0xFF
    path.write_bytes(damaged)
    for _ in range(2):
        assert import_anew(TEXT.format(factor=2.0)).advance(1.0) == 2.0
    assert path.read_bytes() == TEXT.format(factor=2.0).encode()


def planted(folder: Path) -> list[Path]:
    """Put a module into a folder that says so when it is run."""
    import_anew(TEXT.format(factor=2.0))
    compiled = list(folder.rglob("*.nb?"))
    assert compiled
    for path in compiled:
        path.write_bytes(b"planted")
    return compiled


@pytest.mark.parametrize("mode", [0o777, 0o770, 0o722])
def test_nothing_is_taken_from_a_folder_that_others_can_write_to(folder: Path, mode: int) -> None:
    compiled = planted(folder)
    folder.chmod(mode)
    with pytest.warns(UserWarning, match=r"CELLMAP_CACHE_DIR=.*kernels': .*others can write to it.*chmod 700"):
        assert import_anew(TEXT.format(factor=2.0)).advance(1.0) == 2.0
    assert all(path.read_bytes() == b"planted" for path in compiled), "neither read nor written"


def test_nothing_is_taken_from_a_folder_of_somebody_else(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    compiled = planted(folder)
    monkeypatch.setattr("os.geteuid", lambda: folder.stat().st_uid + 1)
    with pytest.warns(UserWarning, match="it belongs to somebody else"):
        assert import_anew(TEXT.format(factor=2.0)).advance(1.0) == 2.0
    assert all(path.read_bytes() == b"planted" for path in compiled)


def test_the_folder_is_made_for_its_user_alone(folder: Path) -> None:
    old = os.umask(0)
    try:
        import_anew(TEXT.format(factor=2.0))
    finally:
        os.umask(old)
    assert folder.stat().st_mode & 0o777 == 0o700


@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
@pytest.mark.parametrize("content", [b"", b"\x80", b"no compiled code"])
def test_damaged_compiled_code_is_compiled_anew(folder: Path, suffix: str, content: bytes) -> None:
    import_anew(TEXT.format(factor=2.0))
    (path,) = folder.rglob(f"*{suffix}")
    path.write_bytes(content)
    assert import_anew(TEXT.format(factor=2.0)).advance(1.0) == 2.0


def test_without_a_folder_modules_live_in_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CELLMAP_CACHE_DIR", "")
    assert cache_folder() is None
    assert import_anew(TEXT.format(factor=2.0)).advance(3.0) == 6.0


def test_a_folder_that_cannot_be_made_is_no_obstacle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    monkeypatch.setenv("CELLMAP_CACHE_DIR", str(tmp_path / "file" / "kernels"))
    assert import_anew(TEXT.format(factor=2.0)).advance(3.0) == 6.0


def test_the_folder_follows_the_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CELLMAP_CACHE_DIR", str(tmp_path / "mine"))
    assert cache_folder() == tmp_path / "mine"
    monkeypatch.delenv("CELLMAP_CACHE_DIR")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert cache_folder() == tmp_path / "xdg" / "cellmap"


def test_no_temporary_file_is_left(folder: Path) -> None:
    import_anew(TEXT.format(factor=2.0))
    assert not list(folder.rglob("*.tmp"))


PROGRAM = """
import numpy as np, sys
from math import cos, pi
from cellmap import ForcedSystem, stroboscopic_map
def rhs(t, x, p):
    return x[1], x[0] - x[0]**3 - 0.15 * x[1] + 0.2 * cos(t)
system = ForcedSystem(rhs, {}, 2 * pi, ("x", "v"))
np.save(sys.argv[1], stroboscopic_map(system, method="RK45", rtol=1e-6)(np.linspace(-1, 1, 20).reshape(10, 2)))
"""


def test_processes_that_start_together_agree(tmp_path: Path) -> None:
    """Two processes compile, write and read the same module at the same time; a third one reads it."""
    environment = {**os.environ, "CELLMAP_CACHE_DIR": str(tmp_path / "shared")}
    command = [sys.executable, "-c", PROGRAM]
    results = [tmp_path / f"{i}.npy" for i in range(3)]
    together = [subprocess.Popen([*command, str(r)], env=environment) for r in results[:2]]
    assert [p.wait(timeout=120) for p in together] == [0, 0]
    subprocess.run([*command, str(results[2])], env=environment, check=True, timeout=120)
    first, *others = (np.load(r) for r in results)
    assert np.isfinite(first).all()
    assert all(np.array_equal(first, other) for other in others)
