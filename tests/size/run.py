"""Lines of code, without docstrings, comments and blanks, in each room of some folders."""

from __future__ import annotations

import ast
import sys
import tokenize
from collections import Counter
from pathlib import Path

BLANK = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}


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


def main(folders: list[str]) -> None:
    """Print the lines of each room, and the largest files of all."""
    files = {path: code_lines(path) for folder in folders for path in sorted(Path(folder).rglob("*.py"))}
    rooms = Counter[str]()
    for path, lines in files.items():
        for folder in {path.parts[0], "/".join(path.parent.parts[:2])}:
            rooms[folder] += lines
    for room, lines in sorted(rooms.items()):
        print(f"{lines:7,} {room}")
    for path, lines in sorted(files.items(), key=lambda item: -item[1])[:10]:
        print(f"{lines:7,} {path}")


if __name__ == "__main__":
    main(sys.argv[1:])
