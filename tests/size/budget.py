"""The size of the code against `budget.toml`: `python tests/size/budget.py`; with `--show` what that file would be now.

Lines of code and numeric constants of modules may exceed their budget by 1 %, the number of long modules by nothing,
and no two classes of the library may share a name that is not listed.  A budget is lowered after each simplification,
and raised only in a commit that says what users get for it.
"""

from __future__ import annotations

import ast
import sys
import tomllib
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))
from tests.size.run import code_lines

ROOT = Path(__file__).parents[2]
TOOLS = {"bench", "mutation", "platforms", "size"}
"""Folders of tests that measure, and are counted apart."""
LONG = 400
"""Lines of text from which a module is long."""
FREE = {"code_lines": 0.01, "numeric_constants": 0.01, "long_modules": 0.0}
"""Part of a budget by which it may be exceeded."""
Counts = dict[str, dict[str, int]]


def is_number(node: ast.expr) -> bool:
    """Tell whether an expression is a number, or several, written out."""
    match node:
        case ast.Constant(value=value):
            return isinstance(value, int | float | complex) and not isinstance(value, bool)
        case ast.UnaryOp(operand=one):
            return is_number(one)
        case ast.BinOp(left=left, right=right):
            return is_number(left) and is_number(right)
        case ast.Tuple(elts=parts) | ast.List(elts=parts) | ast.Dict(values=parts):
            return bool(parts) and all(map(is_number, parts))
    return False


def numeric_constants(text: bytes) -> Iterator[str]:
    """Yield the names of a module, not of its classes, that are numbers."""
    for statement in ast.parse(text).body:
        match statement:
            case ast.Assign(targets=targets, value=value) if is_number(value):
                yield from (t.id for t in targets if isinstance(t, ast.Name))
            case ast.AnnAssign(target=ast.Name(id=name), value=ast.expr() as value) if is_number(value):
                yield name


def room_of(path: Path) -> str:
    """Return what a file counts for: a subpackage of the library, the systems, the tests or their tools."""
    if path.parts[0] == "cellmap":
        return "/".join(path.parts[: min(2, len(path.parts) - 1)])
    return "tools" if path.parts[0] == "tests" and path.parts[1] in TOOLS else path.parts[0]


def counted(root: Path = ROOT) -> tuple[Counts, list[str]]:
    """Return the counts of each kind by room, and the names that several classes of the library have."""
    found = {kind: Counter[str]() for kind in FREE}
    classes = Counter[str]()
    for path in sorted(p for folder in ("cellmap", "systems", "tests") for p in (root / folder).rglob("*.py")):
        text, room = path.read_bytes(), room_of(path.relative_to(root))
        found["code_lines"][room] += code_lines(path)
        if room.startswith("cellmap"):
            found["numeric_constants"][room] += len(list(numeric_constants(text)))
            found["long_modules"][room] += len(text.splitlines()) > LONG
            classes.update(n.name for n in ast.walk(ast.parse(text)) if isinstance(n, ast.ClassDef))
    counts = {kind: {room: n for room, n in sorted(rooms.items()) if n} for kind, rooms in found.items()}
    return counts, sorted(name for name, times in classes.items() if times > 1)


def exceeded(counts: Counts, repeated: list[str], budget: Mapping[str, Mapping[str, int] | list[str]]) -> list[str]:
    """Return a sentence for each budget that is exceeded."""
    said = []
    for kind, rooms in counts.items():
        allowed = budget[kind]
        for room, number in rooms.items():
            most = allowed.get(room, 0) if isinstance(allowed, Mapping) else 0
            if number > most * (1.0 + FREE[kind]):
                said.append(f"{room}: {number:,} {kind.replace('_', ' ')}, the budget is {most:,}")
    said += [f"class {name} stands twice: choose another name" for name in repeated if name not in budget["classes"]]
    return said


def as_toml(counts: Counts, repeated: list[str]) -> str:
    """Return what the file of the budget is for some counts."""
    text = ["# Sizes that only fall: raised in a commit that says what users get for it, see `budget.py`.\n"]
    names = "".join(f'    "{name}",\n' for name in repeated)
    text.append(f"classes = [ # names that several classes have\n{names}]\n")
    for kind, rooms in counts.items():
        text.append(f"[{kind}]\n" + "".join(f'"{room}" = {number}\n' for room, number in rooms.items()))
    return "\n".join(text)


def main() -> None:
    """Print the budgets that are exceeded, or with `--show` what they would be now."""
    counts, repeated = counted()
    if "--show" in sys.argv:
        print(as_toml(counts, repeated), end="")
        return
    said = exceeded(counts, repeated, tomllib.loads((Path(__file__).parent / "budget.toml").read_text("utf-8")))
    if said:
        raise SystemExit("\n".join([*said, "take something away, or raise tests/size/budget.toml and say for what"]))


if __name__ == "__main__":
    main()
