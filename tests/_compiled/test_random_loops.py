"""Random functions, compiled and in plain Python: equal in every bit, or refused with file and line."""

from pathlib import Path

import pytest

from tests._compiled import random_loops
from tests._compiled.processes import printed
from tests._compiled.random_loops import Writer, differences

FEW, MANY = range(6, 18, 6), 3000  # those before loop for seconds in Python


@pytest.mark.parametrize("first", FEW)
def test_random_functions(first: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(random_loops.loops, "CHECKED", True)
    for seed in range(first, first + 6):
        kind, wrong = differences(Writer(seed, 2).text(), tmp_path, f"random_{seed}", range(4))
        assert (kind, wrong) == ("equal", []), f"seed {seed}"


@pytest.mark.slow
@pytest.mark.parametrize("first", range(10_000, 10_000 + MANY, 100))
@pytest.mark.parametrize("checked", [True, False])
def test_thousands_of_random_functions(first, checked, tmp_path, monkeypatch):
    monkeypatch.setattr(random_loops.loops, "CHECKED", checked)
    for seed in range(first, first + 100):
        kind, wrong = differences(Writer(seed + 50 * checked).text(), tmp_path, f"random_{seed}", range(8))
        assert kind != "refused", f"seed {seed}"
        assert wrong == [], f"seed {seed}"


def tried(first: int, last: int, path: Path) -> list[str]:
    """Return what a process prints that tries functions with random constructs of Python's grammar in them."""
    return printed(
        f"from tests._compiled.random_loops import main; main({first}, {last}, {str(path)!r})", path
    ).splitlines()


def test_constructs_that_are_not_in_the_language_are_refused_or_right(tmp_path: Path) -> None:
    lines = tried(10, 25, tmp_path)
    assert [line for line in lines if line.startswith("wrong")] == []
    counts = dict(part.split(": ") for part in lines[-1].removeprefix("counts ").strip("{}").split(", "))
    assert int(counts["'refused'"]) >= 4
    assert int(counts["'equal'"]) >= 2


@pytest.mark.slow
@pytest.mark.parametrize("first", range(10_000, 15_000, 250))
def test_thousands_of_constructs(first: int, tmp_path: Path) -> None:
    assert [line for line in tried(first, first + 250, tmp_path) if line.startswith("wrong")] == []
