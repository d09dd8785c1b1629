"""Budgets of size: what is counted, and what exceeds one."""

from __future__ import annotations

import tomllib
from pathlib import Path

from tests.size.budget import as_toml, counted, exceeded, numeric_constants

MODULE = b"""
A = 3
B: float = -1e-9
C, D = 2**16, {"a": 1, "b": (2, 3)}
E = [1, 2]
F = True
G = "3"
H = float(3)
I: int
class J:
    K = 3
"""


def tree(root: Path) -> Path:
    for name, text in {
        "cellmap/__init__.py": "A = 1\n",
        "cellmap/maps/grid.py": "A = 1\nB = 2\n\nclass Grid: ...\n",
        "cellmap/maps/deep/long.py": "class Grid: ...\n" + "\n" * 400,
        "systems/henon.py": "A = 1\n",
        "tests/maps/test_grid.py": "assert True\n",
        "tests/bench/test_speed.py": "assert True\nassert True\n",
    }.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    return root


def test_numbers_written_out_are_counted() -> None:
    """Not a pair of names, which the library does not write, nor what is computed by a call."""
    assert list(numeric_constants(MODULE)) == ["A", "B", "E"]


def test_what_is_counted_for_what(tmp_path: Path) -> None:
    counts, repeated = counted(tree(tmp_path))
    assert counts == {
        "code_lines": {"cellmap": 1, "cellmap/maps": 4, "systems": 1, "tests": 1, "tools": 2},
        "numeric_constants": {"cellmap": 1, "cellmap/maps": 2},
        "long_modules": {"cellmap/maps": 1},
    }
    assert repeated == ["Grid"]


def test_a_percent_more_is_allowed_and_no_new_name_twice(tmp_path: Path) -> None:
    counts, repeated = counted(tree(tmp_path))
    assert exceeded(counts, repeated, tomllib.loads(as_toml(counts, repeated))) == []
    budget = tomllib.loads(as_toml(counts, []))
    budget["code_lines"] |= {"cellmap/maps": 3, "tools": 0}
    assert exceeded(counts, repeated, budget) == [
        "cellmap/maps: 4 code lines, the budget is 3",
        "tools: 2 code lines, the budget is 0",
        "class Grid stands twice: choose another name",
    ]
    budget["code_lines"] |= {"cellmap/maps": 100, "tools": 100}
    counts["code_lines"]["cellmap/maps"] = 101
    assert exceeded(counts, [], budget) == []
    counts["long_modules"]["cellmap/maps"] = 2
    assert len(exceeded(counts, [], budget)) == 1
