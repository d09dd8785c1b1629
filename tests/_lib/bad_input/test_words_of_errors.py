"""Arguments that errors name, ``word=``, are arguments of something public."""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Iterator
from pathlib import Path

from public_calls import public_things

import cellmap

WORD = re.compile(r"(?<![\w.{'\"])([a-z_][a-z_0-9]*)=(?!=)")
OTHERS = {"random_state", "record", "grazing", "q"}  # of a clusterer of scikit-learn; entries of files and records


def public_arguments() -> set[str]:
    """Names of arguments of all public functions, classes and methods."""
    names: set[str] = set()
    for thing in public_things().values():
        for member in [thing, *(vars(thing).values() if inspect.isclass(thing) else ())]:
            member = getattr(member, "__func__", member)
            if callable(member) and member is not type:
                try:
                    names |= set(inspect.signature(member).parameters)
                except (TypeError, ValueError):  # built in
                    continue
    return names


def words_of_errors() -> Iterator[tuple[str, str]]:
    """Yield where an error is raised, and each argument that it names; the explorer's name those of its page."""
    root = Path(cellmap.__file__).parent
    for path in sorted(root.rglob("*.py")):
        if "explorer" in path.parts:
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Raise) and node.exc is not None:
                for part in ast.walk(node.exc):
                    if isinstance(part, ast.Constant) and isinstance(part.value, str):
                        yield from ((f"{path.relative_to(root)}:{part.lineno}", w) for w in WORD.findall(part.value))


def test_errors_name_arguments_that_exist() -> None:
    known = public_arguments() | OTHERS
    found = list(words_of_errors())
    assert len(found) > 200
    assert [(place, word) for place, word in found if word not in known] == []
