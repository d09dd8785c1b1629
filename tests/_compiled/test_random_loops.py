"""Random functions, compiled and in plain Python: equal in every bit, or refused with file and line."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests._compiled import random_loops
from tests._compiled.random_loops import Writer, differences

FEW, MANY = range(6, 30, 6), 3000  # those before loop for seconds in Python


@pytest.mark.parametrize("first", FEW)
def test_random_functions(first: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(random_loops.loops, "CHECKED", True)
    for seed in range(first, first + 6):
        kind, wrong = differences(Writer(seed, 2).text(), tmp_path, f"random_{seed}", range(4))
        assert (kind, wrong) == ("equal", []), f"seed {seed}"


@pytest.mark.slow
@pytest.mark.parametrize("first", range(10_000, 10_000 + MANY, 100))
@pytest.mark.parametrize("checked", [True, False])
def test_thousands_of_random_functions(
    first: int, checked: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(random_loops.loops, "CHECKED", checked)
    for seed in range(first, first + 100):
        kind, wrong = differences(Writer(seed + 50 * checked).text(), tmp_path, f"random_{seed}", range(8))
        assert kind != "refused", f"seed {seed}"
        assert wrong == [], f"seed {seed}"


def tried(first: int, last: int, path: Path) -> list[str]:
    """Return what a process prints that tries functions with random constructs of Python's grammar in them."""
    command = [sys.executable, "-W", "ignore", str(Path(random_loops.__file__)), str(first), str(last), str(path)]
    environment = {**os.environ, "CELLMAP_CACHE_DIR": str(path), "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-200:] + done.stderr[-2000:]
    return done.stdout.splitlines()


def test_constructs_that_are_not_in_the_language_are_refused_or_right(tmp_path: Path) -> None:
    lines = tried(10, 40, tmp_path)
    assert [line for line in lines if line.startswith("wrong")] == []
    counts = dict(part.split(": ") for part in lines[-1].removeprefix("counts ").strip("{}").split(", "))
    assert int(counts["'refused'"]) >= 8
    assert int(counts["'equal'"]) >= 5


@pytest.mark.slow
@pytest.mark.parametrize("first", range(10_000, 15_000, 250))
def test_thousands_of_constructs(first: int, tmp_path: Path) -> None:
    assert [line for line in tried(first, first + 250, tmp_path) if line.startswith("wrong")] == []
