"""The library as it is installed: distributions, an empty folder, no home, no POSIX; kept code needs no compiler."""

import ast
import os
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

import cellmap

ROOT = Path(__file__).parents[1]
UNSET = ("CELLMAP_CACHE_DIR", "XDG_CACHE_HOME", "HOME", "PYTHONPATH")


def printed(program: str, *arguments: object, folder: Path, **variables: str) -> list[str]:
    """Run a program in a folder, and return the words that it prints."""
    environment = {k: v for k, v in os.environ.items() if k not in UNSET} | variables
    command = [sys.executable, "-c", program, *map(str, arguments)]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=250)
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def built(kind: str, folder: Path) -> Path:
    build = f"import sys; from hatchling.build import build_{kind}; build_{kind}(sys.argv[1])"
    printed(build, folder, folder=ROOT)
    (path,) = (p for p in folder.iterdir() if p.is_file())
    return path


def test_the_source_distribution_has_neither_tests_nor_studies(tmp_path):
    with tarfile.open(built("sdist", tmp_path)) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    documents = {"CHANGELOG.md", "CITATION.cff", "LICENSE", "PKG-INFO", "README.md", "pyproject.toml"}
    assert documents <= names
    assert {name.split("/")[0] for name in names} - {".gitignore"} == documents | {"cellmap", "systems"}


IN_AN_EMPTY_FOLDER = """
import sys
sys.path.insert(0, sys.argv[1])
import cellmap, systems
from cellmap import CellGrid, discrete_map, find_basins
from cellmap.analysis.fractal import basin_entropy
assert cellmap.__file__.startswith(sys.argv[1]) and systems.__file__.startswith(sys.argv[1])
halves = find_basins(discrete_map(lambda x, p: (1.5 * x[0] - x[0] ** 3, 0.5 * x[1]), {}, ("x", "y")),
                     CellGrid((-1, -1), (1, 1), (20, 20)))
print(len(halves.attractors))
"""


def test_a_wheel_has_types_rooms_and_the_page_and_runs_from_an_empty_folder(tmp_path):
    wheel = built("wheel", tmp_path)
    assert wheel.name.startswith("cellmap_dynamics-")
    names = set(zipfile.ZipFile(wheel).namelist())
    sources = {str(p.relative_to(ROOT)) for room in ("cellmap", "systems") for p in (ROOT / room).rglob("*.py*")}
    assert {name for name in sources if name.endswith((".py", ".pyi"))} <= names
    page = [p for p in (ROOT / "cellmap" / "explorer" / "page").iterdir() if p.is_file()]
    assert {str(p.relative_to(ROOT)) for p in page} | {"cellmap/py.typed", "systems/py.typed"} <= names
    assert "cellmap/explorer/page/index.html" in names
    about = f"{wheel.name[: -len('-py3-none-any.whl')]}.dist-info"
    assert {name.split("/")[0] for name in names} == {"cellmap", "systems", about}
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(tmp_path / "site")
    assert printed(IN_AN_EMPTY_FOLDER, tmp_path / "site", folder=tmp_path) == ["2"]


WITHOUT_HOME = """
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


def test_without_a_home_code_is_compiled_in_memory_or_kept_in_the_chosen_folder(installed, tmp_path):
    """A later process needs no compiler."""
    expected = [str(installed / "cellmap"), "1.5", "False"]
    place, folder = {"PYTHONPATH": str(installed), "HOME": "/dev/null/nobody"}, tmp_path / "kept"
    assert printed(WITHOUT_HOME, folder=installed, **place) == expected
    for _ in range(2):
        assert printed(WITHOUT_HOME, folder=installed, **place, CELLMAP_CACHE_DIR=str(folder)) == expected
        assert list(folder.glob("*.object"))
        assert folder.stat().st_mode & 0o777 == 0o700


TO_LABELS = """
from math import cos, pi
from pathlib import Path
import sys
import numpy as np
from cellmap import CellGrid, ForcedSystem, find_basins, interpolated_map, load_basins, save_basins, stroboscopic_map

folder = Path(sys.argv[1])
system = ForcedSystem(lambda t, x, p: (x[1], x[0] - x[0] ** 3 - 0.2 * x[1] + 0.1 * cos(t)), {}, 2 * pi, ("q", "v"))
grid = CellGrid((-1.5, -1.0), (1.5, 1.0), (30, 20))
"""
FILES = """
icm = interpolated_map(stroboscopic_map(system), grid, tolerance=1e6, checkpoint=folder / "table.h5")
basins = find_basins(icm, grid, checkpoint=folder / "basins.h5")
save_basins(basins, folder / "saved.h5")
again = load_basins(folder / "saved.h5")
assert np.array_equal(again.labels, basins.labels)
assert len(basins.attractors) == 2 and list((folder / "cache").glob("*.object"))
"""
LOADED = """
find_basins(interpolated_map(stroboscopic_map(system), grid, tolerance=1e6), grid)
assert not {"numba", "scipy", "sklearn", "tqdm"} & sys.modules.keys()
"""
TAKEN_AWAY = """
import mmap, os, platform, subprocess, sys, threading, warnings
for name in ("fcntl", "pwd", "grp", "termios"):
    sys.modules[name] = None
for name in POSIX:
    vars(os).pop(name, None)
vars(mmap).pop("MADV_DONTNEED", None)
"""
LOCKS = """
from cellmap._lib.files import StoreError, locked

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
lock.write_text(f"process {gone.pid} on {platform.node()}")
with locked(folder / "basins.h5"):
    pass
lock.write_text("process 1 on another machine")
try:
    with locked(folder / "basins.h5"):
        raise AssertionError("somebody else's")
except StoreError as error:
    assert "another machine" in str(error)
"""
POSIX = "posix_fallocate geteuid register_at_fork sched_getaffinity fork O_CLOEXEC O_NONBLOCK".split()


def in_a_folder(program: str, folder: Path) -> list[str]:
    """Run a program whose code is kept beside its files."""
    (folder / "cache").mkdir(mode=0o700, exist_ok=True)
    place = {"CELLMAP_CACHE_DIR": str(folder / "cache"), "PYTHONPATH": str(ROOT), "HOME": str(folder)}
    return printed(program, folder, folder=folder, **place)


def test_what_is_loaded_on_the_way_to_labels_and_that_labels_files_and_locks_need_no_posix(tmp_path):
    """Nothing that takes long to load; the labels are those that this system gives."""
    (tmp_path / "posix").mkdir()
    end = "print(*basins.labels.ravel())"
    labels = in_a_folder(TO_LABELS + LOADED + FILES + end, tmp_path / "posix")
    assert in_a_folder(f"POSIX = {POSIX}\n{TAKEN_AWAY}{TO_LABELS}{FILES}{LOCKS}{end}", tmp_path) == labels
    assert len(labels) == 600


def test_one_module_alone_asks_for_what_systems_do_differently():
    """No other one imports what POSIX has alone, or calls functions of ``os`` that are not everywhere."""
    alone, found = {f"os.{name}" for name in POSIX}, []
    for path in sorted((ROOT / "cellmap").rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        if path.name == "systems.py" or not any(word in text for word in ("os.", "fcntl", "pwd", "resource", "mmap")):
            continue
        for node in ast.walk(ast.parse(text)):
            imported = {a.name for a in node.names} if isinstance(node, ast.Import) else set()
            used = {ast.unparse(node)} if isinstance(node, ast.Attribute) else set()
            if imported & {"fcntl", "pwd", "resource", "mmap"} or used & alone:
                found.append(f"{path.relative_to(ROOT)}:{node.lineno}")
    assert not found
