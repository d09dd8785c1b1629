"""A user without a home, and folders that cannot be written to: the library works, and keeps code where it may."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import cellmap

PROGRAM = """
import sys
from pathlib import Path
import cellmap
halved = cellmap.discrete_map(lambda x, p: (x[0] / 2,), {}, ("x",))([3.0])
print(Path(cellmap.__file__).parent, halved[0], "numba" in sys.modules, sep="\\n")
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The library in a place where nobody, the system's administrator included, can make a folder for compiled code."""
    place = tmp_path_factory.mktemp("site")
    source = Path(cellmap.__file__).parent
    shutil.copytree(source, place / "cellmap", ignore=shutil.ignore_patterns("__pycache__"))
    for folder in [place / "cellmap", *(p for p in (place / "cellmap").rglob("*") if p.is_dir())]:
        (folder / "__pycache__").touch()
    return place


def started(installed: Path, **variables: str) -> list[str]:
    environment = {k: v for k, v in os.environ.items() if k not in ("CELLMAP_CACHE_DIR", "XDG_CACHE_HOME", "HOME")}
    environment |= {"PYTHONPATH": str(installed), "HOME": "/dev/null/nobody", **variables}
    found = subprocess.run(
        [sys.executable, "-c", PROGRAM], cwd=installed, env=environment, capture_output=True, text=True
    )
    assert found.returncode == 0, found.stderr
    folder, *answers = found.stdout.splitlines()
    assert Path(folder) == installed / "cellmap"
    return answers


def test_without_a_home_everything_is_compiled_in_memory(installed):
    assert started(installed) == ["1.5", "False"]


def test_the_chosen_folder_keeps_what_was_compiled_and_later_processes_need_no_compiler(installed, tmp_path):
    folder = tmp_path / "kept"
    assert started(installed, CELLMAP_CACHE_DIR=str(folder)) == ["1.5", "False"]
    assert list(folder.glob("*.object"))
    assert folder.stat().st_mode & 0o777 == 0o700
    assert started(installed, CELLMAP_CACHE_DIR=str(folder)) == ["1.5", "False"]


TO_LABELS = """
import sys
from math import cos, pi
from cellmap import CellGrid, ForcedSystem, find_basins, interpolated_map, stroboscopic_map
def rhs(t, x, p):
    return x[1], x[0] - x[0]**3 - 0.15 * x[1] + 0.2 * cos(t)
grid = CellGrid((-2.2, -2.2), (2.2, 2.2), (30, 30))
basins = find_basins(interpolated_map(stroboscopic_map(ForcedSystem(rhs, {}, 2 * pi, ("q", "v"))), grid), grid)
print(len(basins.attractors), sorted({"numba", "scipy", "sklearn", "tqdm"} & sys.modules.keys()))
"""


def test_what_takes_long_to_load_is_not_loaded_on_the_way_to_labels():
    def run() -> str:
        return subprocess.run([sys.executable, "-c", TO_LABELS], capture_output=True, text=True, check=True).stdout

    run()  # compiles what has not been compiled on this machine
    assert run() == "2 []\n"
