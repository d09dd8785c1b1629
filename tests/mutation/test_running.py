"""The tool as a whole, on a library of one module: what it kills, what survives, and what it refuses to judge."""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
from pathlib import Path

import pytest
from run import OPTIONS

from cellmap._lib.systems import lock, unlock

HERE = Path(__file__).parent
LIBRARY = """
HALF = 0.5

def larger(a, b):
    return a if a > b else b

def halved(a):
    return HALF * a

def unseen(a):
    return a + 1
"""
TESTS = """
from cellmap.tiny.larger import halved, larger

def test_larger():
    assert larger(1, 2) == larger(2, 1) == 2

def test_half():
    assert halved(4) == 2
"""
LARGER, HALF, UNSEEN = (f"cellmap/tiny/larger.py:{line}" for line in (5, 2, 11))


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """Return a tree with a library of one module."""
    for folder in ("cellmap/tiny", "tests/tiny"):
        (tmp_path / folder).mkdir(parents=True)
    for package in ("cellmap", "cellmap/tiny"):
        (tmp_path / package / "__init__.py").touch()
    (tmp_path / "cellmap/tiny/larger.py").write_text(LIBRARY)
    (tmp_path / "tests/tiny/test_larger.py").write_text(TESTS)
    return tmp_path


def test_the_tests_of_this_library_are_collected_with_the_options_of_the_tool() -> None:
    command = [sys.executable, "-m", "pytest", *OPTIONS, "--collect-only", HERE.parent / "size"]
    subprocess.run(command, cwd=HERE.parents[1], check=True, capture_output=True, timeout=100)


def test_a_folder_that_another_run_uses_is_refused(tree: Path) -> None:
    (tree / "work/tree").mkdir(parents=True)
    locked = lock(tree / "work/in_use")
    done, killed = judged(tree, LARGER)
    assert locked is not None
    unlock(tree / "work/in_use", locked)
    assert (done.returncode, killed) == (1, {})
    assert f"process {os.getpid()} on {platform.node()} uses it" in done.stderr
    assert (tree / "work/tree").exists()


def judged(tree: Path, *places: str) -> tuple[subprocess.CompletedProcess[str], dict[tuple[str, str], bool]]:
    """Run all mutants of some lines; return whether each was killed, by its old and its new text."""
    command = [sys.executable, HERE / "run.py", "--root", tree, "--work", tree / "work", "--prepared", "--at", *places]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100, check=False)
    results = tree / "work/results.jsonl"
    rows = map(json.loads, results.read_text().splitlines()) if results.exists() else ()
    return done, {(row["old"], row["new"]): row["killed"] for row in rows}


@pytest.mark.thorough
def test_a_wrong_mutant_is_killed_and_an_equivalent_one_survives(tree: Path) -> None:
    """Of two equal numbers either is the larger; a constant is seen where its module is imported again."""
    done, killed = judged(tree, LARGER, HALF, UNSEEN)
    assert (done.returncode, done.stderr) == (0, "")
    assert killed == {
        (">", ">="): False,
        (">", "<="): True,
        ("a > b", "not (a > b)"): True,
        ("0.5", "1.5"): True,
        ("+", "-"): False,
        ("1", "2"): False,
    }
    assert "tiny: 3 of 6 killed" in done.stdout


@pytest.mark.thorough
@pytest.mark.parametrize("tests", [TESTS + "\n    assert larger(1, 1) == 0\n", ""])
def test_tests_that_fail_or_are_none_judge_nothing(tree: Path, tests: str) -> None:
    (tree / "tests/tiny/test_larger.py").write_text(tests)
    done, killed = judged(tree, LARGER)
    assert (done.returncode, killed) == (1, {})
    assert "tests of tiny have to pass without any mutant" in done.stderr
    assert not (tree / "work/tiny.json").exists()
