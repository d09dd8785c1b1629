"""The library without what POSIX alone offers: the modules and functions are taken away, and all else runs the same."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent
POSIX = "posix_fallocate geteuid register_at_fork sched_getaffinity fork O_CLOEXEC O_NONBLOCK".split()

PROGRAM = """
import mmap, os, subprocess, sys, threading, warnings
for name in ("fcntl", "pwd", "grp", "termios"):
    sys.modules[name] = None
for name in POSIX:
    vars(os).pop(name, None)
vars(mmap).pop("MADV_DONTNEED", None)

from math import cos, pi
from pathlib import Path
import numpy as np
from cellmap import CellGrid, ForcedSystem, find_basins, interpolated_map, load_basins, save_basins, stroboscopic_map
from cellmap._lib.files import StoreError, locked

folder = Path(sys.argv[1])
system = ForcedSystem(lambda t, x, p: (x[1], x[0] - x[0] ** 3 - 0.2 * x[1] + 0.1 * cos(t)), {}, 2 * pi, ("q", "v"))
grid = CellGrid((-1.5, -1.0), (1.5, 1.0), (30, 20))
icm = interpolated_map(stroboscopic_map(system), grid, tolerance=1e6, checkpoint=folder / "table.h5")
basins = find_basins(icm, grid, checkpoint=folder / "basins.h5")
save_basins(basins, folder / "saved.h5")
again = load_basins(folder / "saved.h5")
assert np.array_equal(again.labels, basins.labels)
assert len(basins.attractors) == 2 and list((folder / "cache").glob("*.object"))

lock = folder / ".basins.h5.lock"
with locked(folder / "basins.h5"):
    assert lock.exists()
    try:
        with locked(folder / "basins.h5"):
            raise AssertionError("two have it")
    except StoreError as error:
        assert f"process {os.getpid()} on" in str(error)
assert not lock.exists()

gone = subprocess.Popen([sys.executable, "-c", ""])
gone.wait()
import platform
lock.write_text(f"process {gone.pid} on {platform.node()}")
with locked(folder / "basins.h5"):
    pass
lock.write_text("process 1 on another machine")
try:
    with locked(folder / "basins.h5"):
        raise AssertionError("somebody else's")
except StoreError as error:
    assert "another machine" in str(error)
print(*basins.labels.ravel())
"""


def run(program: str, folder: Path) -> list[str]:
    environment = os.environ | {"CELLMAP_CACHE_DIR": str(folder / "cache"), "PYTHONPATH": str(ROOT)}
    (folder / "cache").mkdir(mode=0o700, parents=True)
    done = subprocess.run(
        [sys.executable, "-c", program, str(folder)], capture_output=True, text=True, env=environment, timeout=250
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_labels_files_and_locks_without_posix(tmp_path):
    """The labels are those that this system gives."""
    with_all = PROGRAM[PROGRAM.index("from math") : PROGRAM.index("lock = ")] + "\nprint(*basins.labels.ravel())"
    ours = run("import sys\n" + with_all, tmp_path / "posix")
    assert run(f"POSIX = {POSIX}\n{PROGRAM}", tmp_path / "other") == ours
    assert len(ours) == 600


def test_one_module_alone_asks_for_what_systems_do_differently():
    """No other one imports what POSIX has alone, or calls functions of ``os`` that are not everywhere."""
    found = []
    for path in sorted((ROOT / "cellmap").rglob("*.py")):
        if path == ROOT / "cellmap" / "_lib" / "systems.py":
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import) and {a.name for a in node.names} & {"fcntl", "pwd", "resource", "mmap"}:
                found.append(f"{path.relative_to(ROOT)}:{node.lineno}")
            if isinstance(node, ast.Attribute) and ast.unparse(node) in {f"os.{name}" for name in POSIX}:
                found.append(f"{path.relative_to(ROOT)}:{node.lineno}")
    assert not found
