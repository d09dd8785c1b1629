"""The distributions: what is in them, and a wheel that is put into an empty folder and used from there."""

from __future__ import annotations

import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

PROGRAM = """
import cellmap, systems, sys
from cellmap import CellGrid, discrete_map, find_basins
from cellmap.analysis.fractal import basin_entropy
assert cellmap.__file__.startswith(sys.argv[1]) and systems.__file__.startswith(sys.argv[1])
halves = find_basins(discrete_map(lambda x, p: (1.5 * x[0] - x[0] ** 3, 0.5 * x[1]), {}, ("x", "y")),
                     CellGrid((-1, -1), (1, 1), (20, 20)))
print(len(halves.attractors))
"""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    build = "import sys; from hatchling.build import build_wheel; print(build_wheel(sys.argv[1]))"
    subprocess.run([sys.executable, "-c", build, str(folder)], cwd=ROOT, check=True, capture_output=True)
    (path,) = folder.glob("*.whl")
    return path


def test_its_name_is_free_and_its_types_and_rooms_are_in_it(wheel: Path) -> None:
    assert wheel.name.startswith("cellmap_dynamics-")
    names = set(zipfile.ZipFile(wheel).namelist())
    sources = {str(p.relative_to(ROOT)) for room in ("cellmap", "systems") for p in (ROOT / room).rglob("*.py*")}
    assert {name for name in sources if name.endswith((".py", ".pyi"))} <= names
    assert {"cellmap/py.typed", "systems/py.typed"} <= names
    page = [p for p in (ROOT / "cellmap" / "explorer" / "page").iterdir() if p.is_file()]
    assert {str(p.relative_to(ROOT)) for p in page} <= names
    assert "cellmap/explorer/page/index.html" in names
    assert {name.split("/")[0] for name in names} == {
        "cellmap",
        "systems",
        f"{wheel.name[: -len('-py3-none-any.whl')]}.dist-info",
    }


def test_the_source_distribution_has_neither_tests_nor_studies(tmp_path: Path) -> None:
    build = "import sys; from hatchling.build import build_sdist; print(build_sdist(sys.argv[1]))"
    subprocess.run([sys.executable, "-c", build, str(tmp_path)], cwd=ROOT, check=True, capture_output=True)
    (path,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(path) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    documents = {"CHANGELOG.md", "CITATION.cff", "LICENSE", "PKG-INFO", "README.md", "pyproject.toml"}
    assert documents <= names
    assert {name.split("/")[0] for name in names} - {".gitignore"} == documents | {"cellmap", "systems"}


def test_it_runs_from_an_empty_folder(wheel: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(tmp_path / "site")
    program = "import sys; sys.path.insert(0, sys.argv[1]);" + PROGRAM
    done = subprocess.run(
        [sys.executable, "-c", program, str(tmp_path / "site")], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "2"
