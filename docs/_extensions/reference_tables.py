"""Tables of names and of modules in pages and READMEs, written from the code; ``make docs-tables`` renews them.

A reader of a checkout sees each public name with the file that defines it and the first sentence of its docstring. The
site shows the pages of the names in their place.
"""

from __future__ import annotations

import ast
import functools
import re
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sphinx.application import Sphinx

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
LISTED = DOCS / "generated" / "names.rst"
ROW = re.compile(r"^\| \[?`((?:cellmap|systems)\.[\w.]+)`.*\|$", re.MULTILINE)
TABLE = re.compile(rf"^\| name \| \|\n\|---\|---\|\n((?:{ROW.pattern[1:-1]}\n?)+)", re.MULTILINE)
QUESTIONS = DOCS / "which-function.md"
ANSWER = re.compile(r"\[?`([\w.]+)`(?:\]\(reference-\w+\.md\))?")
LABORATORY = DOCS / "laboratory-reference.md"
EXPORTS = "<!-- everything that systems.lab exports -->"
HEAD = "| name | |\n|---|---|\n"


def written() -> dict[Path, str]:
    """Return the text of each page and README that holds tables, as the code would have it."""
    texts = {page: ROW.sub(lambda row: of_name(row[1]), page.read_text(encoding="utf-8")) for page in pages()}
    places = {name: page.name for page in pages() for name in ROW.findall(texts[page])}

    def answer(found: re.Match[str]) -> str:
        return f"[`{found[1]}`]({places[full_name(found[1], list(places)).removesuffix('.verify')]})"

    texts[QUESTIONS] = ANSWER.sub(answer, QUESTIONS.read_text(encoding="utf-8"))
    texts[LABORATORY] = f"{LABORATORY.read_text(encoding='utf-8').split(EXPORTS)[0]}{EXPORTS}\n\n{of_laboratory()}\n"
    return texts | {room / "README.md": of_room(room) for room in rooms()}


def full_name(name: str, listed: list[str]) -> str:
    """Return the public name that ends in a short one, or has it as a method; of a figure only as ``plot.NAME``."""
    short = name.removesuffix(".verify")
    found = [full for full in listed if full.endswith(f".{short}") and (".plot." not in full or "plot." in name)]
    if len(found) != 1:
        raise LookupError(f"{name} in {QUESTIONS.name}: {found} have this name")
    return found[0] + name.removeprefix(short)


def pages() -> list[Path]:
    """Return the pages that list public names."""
    return [*sorted(DOCS.glob("reference-*.md")), DOCS / "systems-reference.md"]


def rooms() -> list[Path]:
    """Return the folders whose modules a README of their own lists."""
    return [*(path.parent for path in sorted((ROOT / "cellmap").glob("*/__init__.py"))), ROOT / "systems"]


def of_name(name: str) -> str:
    """Return the row of a public name."""
    place, about = defined(name)
    return f"| [`{name}`](../{place.relative_to(ROOT).as_posix()}) | {about} |"


def of_laboratory() -> str:
    """Return a section for each module of the laboratory, with a row for each name that it offers."""
    sections: dict[Path, list[str]] = {}
    for name in re.findall(
        r" as (\w+)$", (ROOT / "systems/lab/__init__.pyi").read_text(encoding="utf-8"), re.MULTILINE
    ):
        sections.setdefault(defined(f"systems.lab.{name}")[0], []).append(of_name(f"systems.lab.{name}"))
    titles = {path: re.split("[.:,]", docstring(path))[0].replace("\n", " ") for path in sections}
    return "\n\n".join(f"## {titles[path]}\n\n{HEAD}" + "\n".join(rows) for path, rows in sections.items())


def of_room(room: Path) -> str:
    """Return the README of a room: what it is for, and a row for each module, folder by folder."""
    name = room.relative_to(ROOT).as_posix()
    parts = [f"# {name}\n\nWritten by `make docs-tables` from the first sentences of the modules."]
    for folder in [room, *(path for path in sorted(room.rglob("*")) if path.is_dir())]:
        files = sorted(
            path for suffix in ("py", "js") for path in folder.glob(f"*.{suffix}") if path.stem != "__init__"
        )
        if not files:
            continue
        if folder != room:
            parts.append(f"## {folder.relative_to(room).as_posix()}")
        if (folder / "__init__.py").exists():
            parts.append(sentence(docstring(folder / "__init__.py")))
        rows = [f"| [`{p.name}`]({p.relative_to(room).as_posix()}) | {sentence(docstring(p))} |" for p in files]
        parts.append("| file | what it has |\n|---|---|\n" + "\n".join(rows))
    return "\n\n".join(part for part in parts if part) + "\n"


def defined(name: str) -> tuple[Path, str]:
    """Return the file that defines a public name, and the first sentence about it."""
    package, _, last = name.rpartition(".")
    folder = ROOT / package.replace(".", "/")
    stub = next(p for p in (folder / "__init__.pyi", folder / "__init__.py") if p.exists())
    path = imported(stub, last)
    assert path is not None, name
    while (further := imported(path, last)) is not None:
        path = further
    nodes = parsed(path).body
    for node, after in zip(nodes, [*nodes[1:], None], strict=True):
        if isinstance(node, ast.ClassDef | ast.FunctionDef) and node.name == last:
            return path, sentence(ast.get_docstring(node) or "")
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
        if any(isinstance(target, ast.Name) and target.id == last for target in targets):
            about = after.value if isinstance(after, ast.Expr) else None
            return path, sentence(str(about.value) if isinstance(about, ast.Constant) else "")
    raise LookupError(f"{name} is not in {path}")


def imported(path: Path, name: str) -> Path | None:
    """Return the file from which a file imports a name, or None if it does not."""
    for node in parsed(path).body:
        if isinstance(node, ast.ImportFrom) and node.level and any((a.asname or a.name) == name for a in node.names):
            place = path.parents[node.level - 1].joinpath(*(node.module or "").split("."))
            return place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
    return None


@functools.cache
def parsed(path: Path) -> ast.Module:
    """Return the syntax tree of a file."""
    return ast.parse(path.read_text(encoding="utf-8"))


def docstring(path: Path) -> str:
    """Return the docstring of a module, or the comment at the beginning of a script of the page."""
    if path.suffix == ".js":
        lines = path.read_text(encoding="utf-8").split("\n")
        return " ".join(line[3:] for line in lines[: next(k for k, line in enumerate(lines) if line[:2] != "//")])
    return ast.get_docstring(parsed(path)) or ""


def sentence(text: str) -> str:
    """Return the first sentence of a docstring, in Markdown."""
    first = re.split(r"(?<=[.?!])\s+(?=[A-Z`:])", " ".join(text.split("\n\n")[0].split()))[0]
    first = re.sub(r":\w+:`~?(?:[\w.]*\.)?(\w+)`", r"`\1`", first)
    return re.sub(r"``([^`]+)``", r"`\1`", first).replace("|", "\\|")


def names_for_autosummary() -> list[str]:
    """Write the names of all pages where Sphinx looks for names that get pages of their own; return that file."""
    LISTED.parent.mkdir(exist_ok=True)
    names = [name for page in pages() for name in ROW.findall(page.read_text(encoding="utf-8"))]
    LISTED.write_text(directive(names, "../auto/api"), encoding="utf-8")
    return [LISTED.relative_to(DOCS).as_posix()]


def directive(names: list[str], folder: str = "auto/api") -> str:
    """Return the directive that lists names and leads to their pages."""
    lines = [f"   {'~' if name.count('.') > 1 else ''}{name}" for name in names]
    return "\n".join([".. autosummary::", f"   :toctree: {folder}", "   :nosignatures:", "", *lines, ""])


def show_pages(app: Sphinx, docname: str, source: list[str]) -> None:
    """Put what leads to the pages of names in the place of the tables."""
    if docname == QUESTIONS.stem:
        listed = [name for page in pages() for name in ROW.findall(page.read_text(encoding="utf-8"))]
        source[0] = ANSWER.sub(lambda found: f"{{py:obj}}`{found[1]} <{full_name(found[1], listed)}>`", source[0])
    elif docname != LABORATORY.stem:
        source[0] = TABLE.sub(lambda table: f"```{{eval-rst}}\n{directive(ROW.findall(table[1]))}```\n", source[0])


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the hook."""
    app.connect("source-read", show_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


if __name__ == "__main__":
    for path, text in written().items():
        path.write_text(text, encoding="utf-8")
