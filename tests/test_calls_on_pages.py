"""What programs on the pages import is there, and takes the arguments that they give: without running them.

They run in test_documentation.py.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import re
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
OWN = ("cellmap", "systems", "studies")
BLOCK = re.compile(r"^( *)```(?:python|\{code-cell\}[^\n]*)\n(.*?)^\1```", re.DOTALL | re.MULTILINE)
OPTIONS = re.compile(r"\A(?::[^\n]*\n|---\n.*?^---\n)+", re.DOTALL | re.MULTILINE)  # of a cell that Sphinx runs


def programs(page: Path) -> Iterator[ast.Module]:
    text = page.read_text(encoding="utf-8")
    for match in BLOCK.finditer(text):
        yield ast.parse(OPTIONS.sub("", textwrap.dedent(match[2])))


def imported(program: ast.Module, names: dict[str, Any]) -> None:
    """Add what a program imports from our packages to names; forget what it defines itself."""
    for node in ast.walk(program):
        if isinstance(node, ast.Import):
            for alias in node.names:
                if alias.name.split(".")[0] in OWN:
                    names[alias.asname or alias.name.split(".")[0]] = importlib.import_module(alias.name)
        elif isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] in OWN:
            module = importlib.import_module(node.module)
            for alias in node.names:
                names[alias.asname or alias.name] = getattr(module, alias.name)
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.pop(node.name, None)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names.pop(node.id, None)


def called(node: ast.expr, names: dict[str, Any]) -> Any:
    """Return the object of our packages that an expression of names and dots stands for, None for another."""
    if isinstance(node, ast.Name):
        return names.get(node.id)
    if isinstance(node, ast.Attribute) and inspect.ismodule(owner := called(node.value, names)):
        return getattr(owner, node.attr)
    return None


def check_calls(program: ast.Module, names: dict[str, Any]) -> int:
    """Raise TypeError where arguments do not fit; return how many calls were looked at."""
    count = 0
    for node in ast.walk(program):
        if not isinstance(node, ast.Call) or not callable(function := called(node.func, names)):
            continue
        plain = [a for a in node.args if not isinstance(a, ast.Starred)]
        given = {k.arg: k.value for k in node.keywords if k.arg is not None}
        signature = inspect.signature(function)
        try:
            if len(plain) == len(node.args) and len(given) == len(node.keywords):
                signature.bind(*plain, **given)
            else:
                signature.bind_partial(*plain, **given)
        except TypeError as error:
            raise TypeError(f"{ast.unparse(node)}: {error}") from None
        count += 1
    return count


@pytest.mark.parametrize("page", [p for p in PAGES if any(programs(p))], ids=lambda p: p.stem)
def test_what_programs_import_and_call_is_there(page):
    names: dict[str, Any] = {}
    for program in programs(page):
        imported(program, names)
        check_calls(program, names)


def test_most_calls_are_looked_at():
    count = 0
    for page in PAGES:
        names: dict[str, Any] = {}
        for program in programs(page):
            imported(program, names)
            count += check_calls(program, names)
    assert count > 200


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("from cellmap import find_basin", AttributeError),
        ("from cellmap import plot\nplot.basin(1)", AttributeError),
        ("from cellmap import find_basins\nfind_basins(1, 2, period=3)", TypeError),
        ("from cellmap import find_basins\nfind_basins()", TypeError),
    ],
)
def test_what_is_not_there_is_seen(text, error):
    program = ast.parse(text)
    names: dict[str, Any] = {}
    with pytest.raises(error):
        imported(program, names)
        check_calls(program, names)


def test_functions_of_a_program_are_its_own():
    program = ast.parse("from cellmap import find_basins\ndef find_basins():\n    pass\nfind_basins()")
    names: dict[str, Any] = {}
    imported(program, names)
    assert check_calls(program, names) == 0
