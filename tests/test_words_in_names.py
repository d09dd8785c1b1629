"""Names of functions, classes, arguments and variables are the words of the field, private ones included."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parent.parent

PACKAGES = ("cellmap", "systems", "studies", "tests", "docs")

NAMES = {
    "starts": "initial_conditions",
    "picture": "image, figure",
    "pictures": "images, figures",
    "leap": "max_step, multi_period_step",
    "leaps": "multi_period_steps",
    "seam": "branch_cut",
    "seams": "branch_cuts",
    "shares": "fractions",
    "tabulated": "interpolated",
    "polish": "refinement",
    "anew": "again",
}
"""Private words that no name of a function, a class, an argument or a variable has between its underscores."""


def names_in(source: str) -> Iterator[tuple[str, int]]:
    """Names that code gives to functions, classes, arguments and variables, each with its line."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield node.name, node.lineno
        elif isinstance(node, ast.arg):
            yield node.arg, node.lineno
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id, node.lineno


def private_names(source: str) -> Iterator[tuple[str, int, str]]:
    if not re.search("|".join(NAMES), source.lower()):  # faster than to parse
        return
    for name, line in names_in(source):
        for word in {*name.lower().split("_")} & NAMES.keys():
            yield name, line, NAMES[word]


def test_the_names_are_those_of_the_field():
    found = [
        f"{path.relative_to(ROOT).as_posix()}:{line}: {name}; write {instead}"
        for package in PACKAGES
        for path in sorted((ROOT / package).rglob("*.py"))
        for name, line, instead in private_names(path.read_text(encoding="utf-8"))
    ]
    assert not found, "\n".join(found)


def test_private_names_are_found():
    source = "def draw_picture(starts):\n    class Leap:\n        seam = starts.polish\n    _start = 1\n"
    assert sorted(name for name, _, _ in private_names(source)) == ["Leap", "draw_picture", "seam", "starts"]
