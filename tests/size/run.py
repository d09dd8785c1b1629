"""Sizes of what is in some folders: lines of code of each subpackage, largest functions and smallest modules."""

from __future__ import annotations

import ast
import sys
import tokenize
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

BLANK = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}
SMALL = 45


def code_lines(path: Path) -> int:
    """Return how many lines of a file have code on them."""
    with tokenize.open(path) as file:
        tokens = [t for t in tokenize.generate_tokens(file.readline) if t.type not in BLANK]
    lines = {n for t in tokens for n in range(t.start[0], t.end[0] + 1)}
    for node in ast.walk(ast.parse(path.read_bytes())):
        match node:
            case ast.Expr(value=ast.Constant(value=str()), lineno=first, end_lineno=int(last)):
                lines -= set(range(first, last + 1))
    return len(lines)


def functions(path: Path) -> Iterator[tuple[int, int, str]]:
    """Yield the lines, without the docstring, and the arguments of each function of a file, and where it is."""
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.FunctionDef):
            first = node.body[0].end_lineno if ast.get_docstring(node) else node.lineno - 1
            takes = node.args.posonlyargs + node.args.args + node.args.kwonlyargs
            yield (node.end_lineno or 0) - (first or 0), len(takes), f"{path}:{node.lineno} {node.name}"


def main(folders: list[str]) -> None:
    """Print the lines of each room, the largest files, the largest functions of the kernels, and the small modules."""
    files = {path: code_lines(path) for folder in folders for path in sorted(Path(folder).rglob("*.py"))}
    rooms = Counter[str]()
    for path, lines in files.items():
        for folder in {path.parts[0], "/".join(path.parent.parts[:2])}:
            rooms[folder] += lines
    for room, lines in sorted(rooms.items()):
        print(f"{lines:7,} {room}")
    for path, lines in sorted(files.items(), key=lambda item: -item[1])[:10]:
        print(f"{lines:7,} {path}")
    kernels = [one for path in files if "kernels" in path.parts for one in functions(path)]
    if kernels:
        lines, _, where = max(kernels)
        print(f"{lines:7,} lines of the largest function of the kernels: {where}")
        _, takes, where = max(kernels, key=lambda one: one[1])
        print(f"{takes:7,} arguments at most: {where}")
    small = [path for path in files if path.name[:2] != "__" and len(path.read_text("utf-8").splitlines()) <= SMALL]
    print(f"{len(small):7,} modules of at most {SMALL} lines of text")


if __name__ == "__main__":
    main(sys.argv[1:])
