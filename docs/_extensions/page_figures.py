"""Figures of the programs on pages: ``<!-- figure: alternative text -->`` after a program becomes what it draws.

The programs of a page run once, from top to bottom as one program, and again only where the page or the library has
changed. Builds that only check the pages (``CELLMAP_STUDIES=skip``) leave the figures out.
"""

from __future__ import annotations

import functools
import hashlib
import re
import shutil
from contextlib import chdir, redirect_stdout
from io import StringIO
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, NamedTuple

import matplotlib.pyplot as plt
from study_pages import GENERATED, ROOT, computes

if TYPE_CHECKING:
    from sphinx.application import Sphinx

STATED = re.compile(r"^<!-- figure: (.+?) -->$", re.MULTILINE)
PROGRAM = re.compile(r"^```python\n(.*?)^```", re.DOTALL | re.MULTILINE)
CALLED = re.compile(r"(?<![\w.])(plot\.)?(\w+)\(")
DRAWS = re.compile(r"\bplot\.\w+\((?!.*\bax=)|\bplt\.(?:figure|subplots)\(")


def fill(app: Sphinx, docname: str, source: list[str]) -> None:
    """Put the figures of a page where it asks for them."""
    if not STATED.search(source[0]):
        return
    if not computes():
        source[0] = STATED.sub("", source[0])
        return
    folder = drawn(docname, source[0])
    numbers = iter(sorted(folder.glob("*.png")))

    def figure(found: re.Match[str]) -> str:
        place = next(numbers).relative_to(GENERATED.parent).as_posix()
        alternative = " ".join(found[1].split())
        return f"```{{image}} {'../' * docname.count('/')}{place}\n:alt: {alternative}\n:class: program-figure\n```"

    source[0] = STATED.sub(figure, source[0])


def drawn(docname: str, text: str) -> Path:
    """Return the folder with the figures of a page, in their order."""
    sources = [p for room in ("cellmap", "systems") for p in sorted((ROOT / room).rglob("*.py"))]
    code = hashlib.sha256(text.encode() + b"".join(p.read_bytes() for p in sources)).hexdigest()
    kept = GENERATED / f"{docname.replace('/', '_')}.{code[:16]}"
    if kept.exists():
        return kept
    for old in GENERATED.glob(f"{docname.replace('/', '_')}.*"):
        shutil.rmtree(old)
    unfinished = kept.with_name(f"{kept.name}.unfinished")
    unfinished.mkdir(parents=True)
    draw_all(text, unfinished)
    unfinished.rename(kept)
    return kept


def draw_all(text: str, folder: Path) -> None:
    """Run the programs of a text, and save the figures that each draws."""
    names: dict[str, object] = {"__name__": "__main__"}
    pieces = PROGRAM.split(text)
    numbers = count()
    with TemporaryDirectory() as elsewhere, chdir(elsewhere), redirect_stdout(StringIO()):
        for program, after in zip(pieces[1::2], pieces[2::2], strict=True):
            exec(compile(program, "program", "exec"), names)
            drawn, asked = plt.get_fignums(), len(STATED.findall(after))
            if asked != len(drawn):
                raise ValueError(f"{len(drawn)} figures, {asked} alternative texts after this program:\n{program}")
            for number, place in zip(drawn, numbers, strict=False):
                plt.figure(number).savefig(folder / f"{place:03d}.png", dpi=100, bbox_inches="tight")
            plt.close("all")


class PageFigure(NamedTuple):
    """A figure of a page: its number there, its alternative text, and the page."""

    number: int
    alternative: str
    page: str


def figures_of(text: str, page: str) -> dict[str, PageFigure]:
    """Return what the programs of a page call, each with the figure that shows it: ``plot.boxes``, ``stable_set``."""
    found: dict[str, PageFigure] = {}
    pieces, before = PROGRAM.split(text), 0
    for program, after in zip(pieces[1::2], pieces[2::2], strict=True):
        texts = STATED.findall(after)
        begins = [match.start() for match in DRAWS.finditer(program)]
        for call in CALLED.finditer(program):
            if call[0] == "plot.animate(":
                continue  # a film
            # The figures of a program are those of its drawing calls in their order, where there are as many.
            drawing = sum(begin <= call.start() for begin in begins) - 1 if len(begins) == len(texts) else 0
            place = min(max(drawing, 0), len(texts) - 1)
            if place >= 0:
                figure = PageFigure(before + place, " ".join(texts[place].split()), page)
                found.setdefault(f"{call[1] or ''}{call[2]}", figure)
        before += len(texts)
    return found


@functools.cache
def known_figures() -> dict[str, PageFigure]:
    """Return the figures of all pages of the guide by what they show."""
    found: dict[str, PageFigure] = {}
    for path in sorted(GENERATED.parent.glob("*.md")):
        found = {**figures_of(path.read_text(encoding="utf-8"), path.stem), **found}
    return found


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the hook, before that of the studies."""
    app.connect("source-read", fill, priority=400)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
